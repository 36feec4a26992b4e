"""What tests of several packages share: a small figure, dances, damaged files, Mono, the toy project."""

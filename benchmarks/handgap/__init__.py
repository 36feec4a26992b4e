"""Finding and filling of hidden hands, every method against the truth."""

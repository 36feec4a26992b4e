"""One file a command: `declare` its arguments, `do` it."""

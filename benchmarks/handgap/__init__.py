"""Hidden hands: found and filled, every method, against the truth."""

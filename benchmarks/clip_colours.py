"""The colours of clips in charts."""

COLOURS = ("#0b6e4f", "#b5532a", "#33508a", "#8a6d33", "#6a3d7a")
"""In the order of the clips; further ones begin anew."""

"""Rendered people with a hand behind the back: how far off arm and skin are while nothing shows the hand."""

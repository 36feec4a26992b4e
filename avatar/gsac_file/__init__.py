"""The `.gsac` format: one file that holds a rigged avatar, written and read."""

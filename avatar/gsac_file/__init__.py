"""The `.gsac` format: one file that holds a rigged avatar. Writing, reading and checking."""

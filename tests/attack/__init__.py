"""The long attacks of `make attack`: `python -m attack NAME ... --trials N`, with `tests/` on the path.

Each attack is a function of a number of trials and a seed that returns a Tally; ATTACKS in __main__.py names them.
"""

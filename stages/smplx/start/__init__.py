"""Poses that the user brings: what they start a fit from (begin.py), or take as its result (fit.py)."""

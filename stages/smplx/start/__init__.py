"""Poses that the user brings: what they start a fit from, or take as its result.

files.py reads a file of any layout as arrays over its frames; exavatar.py, smpler_x.py, hand4whole.py and wham.py know what their
arrays mean; read.py lays them on the clip's frames; begin.py checks them against the pictures.
"""

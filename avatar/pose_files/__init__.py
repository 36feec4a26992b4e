"""Poses of a person that the user brings, of ExAvatar, SMPLer-X, Hand4Whole or WHAM.

files.py reads a file of any layout as arrays over its frames; exavatar.py, smpler_x.py, hand4whole.py and wham.py know what their
arrays mean; read.py lays them on the clip's frames.
"""

"""Data sets that a user downloaded under their licences, as folders that `gsac run` takes.

peoplesnapshot.py, xhumans.py, neuman.py and folder.py each read one layout; given.py is what they read; write.py writes it;
read.py chooses by name. plain_pickle.py and hdf5.py read the two formats without running what lies in them.
"""

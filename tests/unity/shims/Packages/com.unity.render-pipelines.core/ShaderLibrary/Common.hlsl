// Stands for the core package's file of this name in the tests; HDRP's other file brings what is used.

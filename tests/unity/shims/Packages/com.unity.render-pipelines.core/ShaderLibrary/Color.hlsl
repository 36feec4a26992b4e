// Stands for the core package's file of this name in the tests: nothing of it is used by the stand-ins.

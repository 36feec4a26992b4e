"""Where the clips of a batch run."""

"""Where the pipeline breaks: faults put into truth clips at severities 0 to 5, what is left of the fit, and whether it was said."""

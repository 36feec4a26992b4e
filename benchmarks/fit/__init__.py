"""The body fit against truth clips: error and seconds of both methods in one run."""

"""The body fit against truth clips: how right, and after how many seconds, for both methods in one run."""

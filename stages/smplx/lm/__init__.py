"""`smplx.method lm`: all frames at once by Levenberg-Marquardt."""

"""Truth clips: a clothed person turns before a still camera, with everything the real job has to find known exactly.

Body, clothes and hair are meshes drawn by a z-buffer: nothing here shares code with the gaussians judged on it.
"""

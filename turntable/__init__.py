"""Truth clips: a made-up, clothed person turns before a still camera; pose, shape and camera of every frame are known exactly.

Body, clothes and hair are meshes drawn by a z-buffer: no code is shared with the gaussians that are judged on these clips.
"""

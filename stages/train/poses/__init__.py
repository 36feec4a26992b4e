"""Poses of the frames: refined with the images, kept comparable with the body fit."""

"""The skeleton and the dance of the motion tests."""

from support.dances import dance, skeleton  # noqa: F401

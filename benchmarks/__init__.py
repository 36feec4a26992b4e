"""Measurements against truth, as tables and charts: each package with a module `bench` is a `gsac bench NAME`."""

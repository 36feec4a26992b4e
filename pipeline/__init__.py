"""The engine: reads `dvc.yaml`, says what has to run and why, runs it, and keeps every result in the cache."""

"""The engine: reads `dvc.yaml`, decides which stages have to run and why, runs them, and keeps every result in the cache."""

"""report.html of a run's folder: one page that needs nothing but itself."""

"""report.html of a run's folder: one page that needs nothing but itself."""

from gsac.pipeline.report.page import write_report

__all__ = ["write_report"]

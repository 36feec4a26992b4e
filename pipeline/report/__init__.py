"""report.html of a run's folder: one page that needs nothing but itself."""

from gsac.pipeline.report.page import draw_sections, write_report

__all__ = ["draw_sections", "write_report"]

"""axe-core, which finds what keeps people from using a page, in the browser that a test drives."""

from __future__ import annotations

import pytest

from gsac.benchmarks.viewer.browser import Browser

PACKAGE = "axe-core@4.10.3"
FAULTS = """axe.run().then((found) => found.violations.filter((fault) => ['serious', 'critical'].includes(fault.impact))
  .map((fault) => `${fault.id}: ${fault.nodes.map((node) => node.target).join(', ')}`))"""


@pytest.fixture(scope="session")
def axe(node_package):
    """browser -> its open page's serious and critical faults, each with the elements concerned."""
    script = (node_package(PACKAGE) / "node_modules/axe-core/axe.min.js").read_text()

    def faults(browser: Browser) -> list[str]:
        if not browser.run("'axe' in window"):
            browser.run(f"{script};0")
        return browser.run(FAULTS)

    return faults

"""What the pages' tests share."""

import pytest

from gsac.benchmarks.viewer import browser as chromium


@pytest.fixture(scope="module")
def browser(request):
    """A browser whose window is as large as the module's SIZE."""
    it = chromium.Browser(request.module.SIZE, request.module.SIZE, chromium.WEBGPU)
    yield it
    it.close()

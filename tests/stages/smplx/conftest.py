"""The open body, loaded once."""

import pytest

from gsac.avatar.body import Body


@pytest.fixture(scope="session")
def body() -> Body:
    return Body.load()

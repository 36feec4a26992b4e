"""Everybody can use viewer.html: axe finds nothing serious, and the keyboard alone reaches every control."""

import pytest

from gsac.avatar.gsac_file.write import avatar_bytes
from gsac.benchmarks.viewer import browser as chromium
from gsac.viewer.page import page_bytes

pytestmark = [pytest.mark.slow,
              pytest.mark.skipif(chromium.find_chromium() is None, reason="needs the Debian package chromium")]

STATES = {
    "all controls": "document.body.classList.remove('folded')",
    "folded": "document.body.classList.add('folded')",
    "drawer of joints": "document.body.classList.remove('folded'), document.getElementById('show-joints').click()",
    "drawer of the face": "document.getElementById('show-faces').click()",
    "help": "document.querySelector('#faces .close').click(), document.getElementById('show-help').click()",
}
"""What is open -> the script that opens it, in this order."""
IN_VIEW = """[...document.querySelectorAll('button, select, input, [tabindex]')]
  .filter((it) => it.checkVisibility() && !it.disabled).map((it, i) => it.dataset.at = String(i))"""
"""Numbers the controls that are seen, and gives the numbers."""


@pytest.fixture(scope="module")
def address(figure, tmp_path_factory):
    path = tmp_path_factory.mktemp("page") / "viewer.html"
    path.write_bytes(page_bytes(avatar_bytes(figure)))
    return path.as_uri()


@pytest.fixture(scope="module", params=[390, 1440])
def page(request, address):
    browser = chromium.Browser(request.param, 800)
    browser.resize(request.param, 800, mobile=request.param < 500)
    browser.open(f"{address}#pose=A&turntable=off")
    yield browser
    browser.close()


@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_axe_finds_nothing_serious_with_controls_open_or_folded_drawers_or_help(page, axe, scheme):
    page.call("Emulation.setEmulatedMedia", features=[{"name": "prefers-color-scheme", "value": scheme}])
    found = {}
    for state, script in STATES.items():
        page.run(script)
        found[state] = axe(page)
    page.run("document.querySelector('#help button').click()")
    assert found == dict.fromkeys(STATES, [])
    assert not page.errors


def test_the_keyboard_alone_reaches_every_control(page):
    page.run(STATES["all controls"])
    wanted, reached = set(page.run(IN_VIEW)), set()
    for _ in range(2 * len(wanted)):
        for kind in ("keyDown", "keyUp"):
            page.call("Input.dispatchKeyEvent", type=kind, key="Tab", code="Tab", windowsVirtualKeyCode=9)
        reached.add(page.run("document.activeElement.dataset.at ?? ''"))
    assert wanted <= reached and len(wanted) > 15

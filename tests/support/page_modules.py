"""The viewer's modules outside of the page: in a browser's tests by name, and as files that node and TypeScript read."""

import json

from gsac.viewer.page import HERE, MODULES, join_modules


def expose(page, *names):
    """Makes top-level names of the modules, exported or not, global in an open page, which keeps its own to itself."""
    page.run(f"(() => {{ 'use strict';\n{join_modules(MODULES[:-1])}\nObject.assign(window, {{ {', '.join(names)} }}); }})()")


def copy_modules(folder):
    """Copies the modules into an empty folder that says they are modules, as old releases of node want it."""
    (folder / "package.json").write_text(json.dumps({"private": True, "type": "module"}))
    for name in MODULES:
        (folder / name).write_bytes((HERE / name).read_bytes())
    return folder

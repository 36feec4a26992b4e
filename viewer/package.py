"""`python -m gsac.viewer.package FOLDER`: writes the npm package `gsac-avatar`: an element for pages of others and an object for
three.js, made of the modules of viewer.html."""

from __future__ import annotations

import argparse
import re
import sys
from pathlib import Path

from gsac.viewer.page import HERE, MODULES, join_modules

NPM = HERE / "npm"
IMPORTED = re.compile(r'from "\./(\w+\.js)";')
WHOLE = "gsac-avatar.js"
"""The element in one file, for a page without a bundler."""
DEFINED = 'if (!customElements.get("gsac-avatar")) customElements.define("gsac-avatar", GsacAvatar);\nexport { GsacAvatar };\n'


def package_files() -> dict[str, bytes]:
    """name -> content; the same sources give the same package."""
    files = {path.name: path.read_bytes() for path in sorted(NPM.iterdir())}
    element = find_modules(files["index.js"].decode())
    for name in find_modules(files["index.js"].decode() + files["three.js"].decode()):
        files[name] = (HERE / name).read_bytes()
    return files | {WHOLE: (join_modules(element) + "\n" + DEFINED).encode()}


def find_modules(text: str) -> list[str]:
    """The viewer's modules that a text imports, and those that they import, each after those that it imports."""
    found, left = set(), IMPORTED.findall(text)
    while left:
        name = left.pop()
        if name not in found:
            found.add(name)
            left += IMPORTED.findall((HERE / name).read_text())
    return [name for name in MODULES if name in found]


def write_package(folder: Path) -> None:
    """Writes the package's files into a folder, which is made. FileExistsError where it holds a file that is none of them."""
    files = package_files()
    foreign = sorted(path.name for path in folder.iterdir() if path.name not in files) if folder.is_dir() else []
    if foreign or (folder.is_dir() and any(folder.iterdir()) and not (folder / WHOLE).is_file()):
        raise FileExistsError(f"{folder} holds files of others ({', '.join(foreign[:3]) or 'package.json'}); give one that is "
                              "new or empty, or one of an earlier package")
    folder.mkdir(parents=True, exist_ok=True)
    for name, content in files.items():
        (folder / name).write_bytes(content)


def main() -> None:
    parser = argparse.ArgumentParser(prog="python -m gsac.viewer.package", description="Writes the npm package gsac-avatar.")
    parser.add_argument("folder", type=Path, metavar="FOLDER", help="new or empty, or of an earlier package")
    try:
        write_package(parser.parse_args().folder)
    except OSError as error:
        sys.exit(str(error))


if __name__ == "__main__":
    main()

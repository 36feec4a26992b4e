"""Digest and references of a Python source; comments, formatting and docstrings do not count."""

from __future__ import annotations

import ast
from collections.abc import Iterator
from typing import Any

from gsac.cache.digest import canonical, typed_digest

NOT_MEANING = ("kind", "type_comment", "ctx")
"""Fields of the syntax tree that hold how something is written, or follow from its place."""


def read_source(source: bytes, package: str) -> tuple[str, set[str]]:
    """Digest of the normalised syntax tree, and the names and strings that may refer to modules or files beside it.

    package: the package that relative imports start from. `from a import b` refers to a and a.b.
    A source that cannot be parsed counts byte by byte.
    """
    try:
        tree = ast.parse(source)
    except (SyntaxError, ValueError):
        return typed_digest("module unparsed 1", source), set()
    return typed_digest("module 1", canonical(normalise(tree))), set(_references(tree, package))


def normalise(node: Any) -> Any:
    """The tree as nested lists. Empty fields are left out, so that a field new in a later Python changes nothing."""
    if isinstance(node, ast.AST):
        fields = [
            [name, normalise(value)]
            for name, value in ast.iter_fields(node)
            if name not in NOT_MEANING and (value not in (None, []) or isinstance(node, ast.Constant))
        ]
        return [type(node).__name__, *fields]
    if isinstance(node, list):
        return [normalise(item) for item in node if not _is_bare_string(item)]
    if node is None or isinstance(node, (str, int)):
        return node
    return [type(node).__name__, repr(node)]  # bytes, floats, complex numbers, the ellipsis


def _is_bare_string(node: Any) -> bool:
    """A docstring, or a string that documents the field above it."""
    return isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant) and isinstance(node.value.value, str)


def _references(tree: ast.AST, package: str) -> Iterator[str]:
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            base = node.module or ""
            if node.level:
                start = package.rsplit(".", node.level - 1)[0] if node.level > 1 else package
                base = f"{start}.{base}" if base else start
            yield base
            yield from (f"{base}.{alias.name}" for alias in node.names)
        elif isinstance(node, ast.BinOp) and isinstance(node.op, ast.Div):
            yield "/".join(_joined(node))
        elif isinstance(node, ast.Constant) and isinstance(node.value, str) and "\n" not in node.value:
            yield node.value


def _joined(node: ast.AST) -> list[str]:
    """The strings at the end of a path expression: `HERE / "viewer" / "page.html"` gives both."""
    if isinstance(node, ast.BinOp) and isinstance(node.op, ast.Div):
        right = _joined(node.right)
        return _joined(node.left) + right if right else []
    return [node.value] if isinstance(node, ast.Constant) and isinstance(node.value, str) else []

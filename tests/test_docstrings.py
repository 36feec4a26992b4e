"""Every public function says what it takes: hints on all parameters, and the shape of each array, as gsplat and trimesh do."""

from __future__ import annotations

import ast
import re
from collections.abc import Iterator
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]
PACKAGES = ("cache", "avatar", "unity", "viewer", "turntable", "stages", "pipeline", "benchmarks")
COMPILED = ("kernel", "own_kernel", "njit", "intrinsic", "vectorize")
"""Decorators of numba, whose functions are typed by their calls; they say in their docstring what they work on."""
ARRAY = re.compile(r"\b(np\.)?ndarray\b|\bTensor\b|\bspmatrix\b")
SHAPE = re.compile(r"\((?=[^()]*(,|\.\.\.))[^()]*\)|\bscalar\b")
"""`(N, 3)`, `(T,)`, `(..., 3)`."""
REACH = 160
"""Characters after an array's name within which its shape stands: arrays of one shape share it."""

Function = ast.FunctionDef | ast.AsyncFunctionDef


def public_functions(tree: ast.Module) -> Iterator[tuple[str, Function]]:
    """Qualified name and node, methods of public classes among them; what numba compiles and overloads left out."""
    for node in tree.body:
        if isinstance(node, ast.ClassDef) and not node.name.startswith("_"):
            for inner in node.body:
                if isinstance(inner, Function) and (not inner.name.startswith("_") or inner.name == "__init__"):
                    yield f"{node.name}.{inner.name}", inner
        elif isinstance(node, Function) and not node.name.startswith("_"):
            yield node.name, node


def decorators(node: Function) -> set[str]:
    return {re.split(r"[.(]", ast.unparse(d).replace("numba.", ""))[0] for d in node.decorator_list}


def parameters(node: Function) -> list[ast.arg]:
    every = [*node.args.posonlyargs, *node.args.args, *node.args.kwonlyargs, *filter(None, (node.args.vararg, node.args.kwarg))]
    return [a for a in every if a.arg not in ("self", "cls") and not a.arg.startswith("_")]


def has_shape(name: str, text: str) -> bool:
    """Whether some mention of the name is followed, or right before it preceded, by a shape."""
    return any(SHAPE.search(text[m.end():m.end() + REACH]) or SHAPE.search(text[max(0, m.start() - 40):m.start()])
               for m in re.finditer(rf"(?<!\w){re.escape(name)}(?!\w)", text))


def faults_of(path: Path) -> list[str]:
    tree, found = ast.parse(path.read_text()), []
    for name, node in public_functions(tree):
        if decorators(node) & set(COMPILED):
            continue
        where = f"{path.relative_to(ROOT)}:{node.lineno} {name}"
        text = ast.get_docstring(node) or ""
        if name.endswith(".__init__"):
            text += ast.get_docstring(next(c for c in tree.body if isinstance(c, ast.ClassDef) and node in c.body)) or ""
        for parameter in parameters(node):
            if parameter.annotation is None:
                found.append(f"{where}: {parameter.arg} has no hint")
            elif ARRAY.search(ast.unparse(parameter.annotation)) and not has_shape(parameter.arg, text):
                found.append(f"{where}: the docstring does not give {parameter.arg}'s shape")
        if node.returns is None and not name.endswith(".__init__"):
            found.append(f"{where}: what it returns has no hint")
        elif node.returns is not None and ARRAY.search(ast.unparse(node.returns)) and not SHAPE.search(text):
            found.append(f"{where}: the docstring does not give the shape of what it returns")
    return found + fields_without_shape(path, tree)


def fields_without_shape(path: Path, tree: ast.Module) -> list[str]:
    """Fields of dataclasses and named tuples that are arrays, with a shape neither in the docstring below nor in a comment."""
    lines, found = path.read_text().splitlines(), []
    for owner in (node for node in tree.body if isinstance(node, ast.ClassDef) and not node.name.startswith("_")):
        for field, after in zip(owner.body, [*owner.body[1:], None], strict=True):
            if not isinstance(field, ast.AnnAssign) or not ARRAY.search(ast.unparse(field.annotation)):
                continue
            below = after.value.value if (isinstance(after, ast.Expr) and isinstance(after.value, ast.Constant)) else ""
            comment = lines[field.lineno - 1].partition("#")[2]
            if not SHAPE.search(f"{below} {comment}") and not has_shape(ast.unparse(field.target), ast.get_docstring(owner) or ""):
                found.append(f"{path.relative_to(ROOT)}:{field.lineno} {owner.name}.{ast.unparse(field.target)}: no shape")
    return found


@pytest.mark.parametrize("package", PACKAGES)
def test_public_functions_have_hints_and_each_array_its_shape(package):
    faults = [fault for path in sorted((ROOT / package).rglob("*.py")) for fault in faults_of(path)]
    assert not faults, "\n".join([f"{len(faults)} faults", *faults])

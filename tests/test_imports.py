"""No two files of the package need each other: import-linter keeps the rooms in order, this the files within them."""

from __future__ import annotations

import ast
from collections.abc import Iterator
from graphlib import CycleError, TopologicalSorter
from pathlib import Path

import pytest

import terragrip

_ROOT = Path(terragrip.__file__).parent


def _module(path: Path, root: Path) -> str:
    parts = path.relative_to(root.parent).with_suffix("").parts
    return ".".join(parts[:-1] if parts[-1] == "__init__" else parts)


def _is_type_checking(node: ast.stmt) -> bool:
    return isinstance(node, ast.If) and ast.unparse(node.test).endswith("TYPE_CHECKING")


def _imports(node: ast.AST) -> Iterator[ast.Import | ast.ImportFrom]:
    """Every import below a node, also within functions, but not those for types alone; expressions, most of a file, hold none."""
    for child in ast.iter_child_nodes(node):
        if isinstance(child, ast.expr):
            continue
        if isinstance(child, ast.Import | ast.ImportFrom):
            yield child
        elif isinstance(child, ast.If) and _is_type_checking(child):
            for other in child.orelse:
                yield from _imports(other)
        else:
            yield from _imports(child)


def _homes(tree: ast.Module) -> dict[str, str]:
    """The module that each name of a package is from; the names which load on first use stand under TYPE_CHECKING."""
    return {
        name.asname or name.name: node.module
        for node in ast.walk(tree)
        if isinstance(node, ast.ImportFrom) and node.module
        for name in node.names
    }


def import_graph(root: Path) -> dict[str, set[str]]:
    """Of each module of the package at `root` the modules that it imports anywhere, by the file that defines what is imported."""
    trees = {_module(path, root): ast.parse(path.read_text()) for path in root.rglob("*.py")}
    homes = {_module(path, root): _homes(trees[_module(path, root)]) for path in root.rglob("__init__.py")}
    graph: dict[str, set[str]] = {}
    for module, tree in trees.items():
        targets: set[str] = set()
        for node in _imports(tree):
            if isinstance(node, ast.Import):
                targets.update(name.name for name in node.names)
                continue
            assert node.module, f"{module}: a relative import"
            for name in node.names:
                inner = f"{node.module}.{name.name}"
                targets.add(
                    inner if inner in trees else homes.get(node.module, {}).get(name.name, node.module)
                )
        graph[module] = targets & trees.keys() - {module}
    return graph


def circle_in(graph: dict[str, set[str]]) -> str:
    try:
        TopologicalSorter(graph).prepare()
    except CycleError as error:
        return " -> ".join(error.args[1])
    return ""


def test_no_file_imports_in_a_circle() -> None:
    graph = import_graph(_ROOT)
    assert len(graph) > 300
    assert circle_in(graph) == ""


@pytest.mark.parametrize(
    ("inner", "circle"),
    [
        ("from package.first import one", True),
        ("def late():\n    from package import one", True),
        ("from typing import TYPE_CHECKING\nif TYPE_CHECKING:\n    from package.first import one", False),
    ],
    ids=["at-the-top", "in-a-function-by-the-package", "for-types-alone"],
)
def test_a_circle_is_seen_wherever_the_import_stands(tmp_path: Path, inner: str, circle: bool) -> None:
    root = tmp_path / "package"
    root.mkdir()
    (root / "__init__.py").write_text("from package.first import one")
    (root / "first.py").write_text("from package.second import two\none = 1")
    (root / "second.py").write_text(f"{inner}\ntwo = 2")
    assert bool(circle_in(import_graph(root))) is circle


def test_no_file_is_longer_than_a_reader_keeps_in_mind() -> None:
    sources = [*_ROOT.rglob("*.py"), *_ROOT.rglob("*.[ch]"), *(_ROOT.parents[1] / "kernel").rglob("*.[ch]")]
    lines = {str(path): path.read_text().count("\n") for path in sources if path.name != "terragrip.h"}
    assert len(lines) > 300
    assert {name: count for name, count in lines.items() if count > 400} == {}

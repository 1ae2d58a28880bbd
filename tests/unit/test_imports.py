"""Imports: none in a circle, in Python and in C; the methods build on the common modules."""

import ast
import re
from collections.abc import Iterator, Mapping
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
CSRC = ROOT / "csrc"

# ---- Python ----


def _modules() -> dict[str, Path]:
    """Source of every module of the package, by name; the stub stands for the compiled core."""
    found = {}
    for path in sorted((ROOT / "granular").rglob("*.py*")):
        if path.suffix not in (".py", ".pyi"):
            continue
        parts = path.relative_to(ROOT).with_suffix("").parts
        found[".".join(parts[:-1] if parts[-1] == "__init__" else parts)] = path
    return found


def _statements(body: list[ast.stmt]) -> Iterator[ast.stmt]:
    """Statements that run on import: those of blocks and classes too, but not of functions."""
    for statement in body:
        yield statement
        if isinstance(statement, (ast.FunctionDef, ast.AsyncFunctionDef)):
            continue
        blocks = ["body", "orelse", "finalbody"]
        if isinstance(statement, ast.If) and "TYPE_CHECKING" in ast.unparse(statement.test):
            blocks.remove("body")
        for block in blocks:
            yield from _statements(getattr(statement, block, []))
        for handler in getattr(statement, "handlers", []):
            yield from _statements(handler.body)


def _imports(source: str, package: str, known: set[str]) -> set[str]:
    """Modules that a source names in imports, without the parents that run along with them."""
    found = set()
    for statement in _statements(ast.parse(source).body):
        if isinstance(statement, ast.Import):
            found |= {name.name for name in statement.names}
        elif isinstance(statement, ast.ImportFrom):
            above = package.split(".")[: len(package.split(".")) - statement.level + 1]
            start = ".".join(above if statement.level else [])
            base = ".".join(filter(None, (start, statement.module)))
            for name in statement.names:
                whole = f"{base}.{name.name}"
                found.add(whole if whole in known else base)
    return found & known


def _graph() -> dict[str, set[str]]:
    modules = _modules()
    graph = {}
    for name, path in modules.items():
        package = name if path.stem == "__init__" else name.rpartition(".")[0]
        graph[name] = _imports(path.read_text(), package, set(modules))
    return graph


def _cycle(graph: Mapping[str, set[str]]) -> list[str]:
    """Some circle of a graph, its first node again at the end; empty if there is none."""
    done: set[str] = set()

    def search(node: str, trail: list[str]) -> list[str]:
        if node in trail:
            return [*trail[trail.index(node) :], node]
        if node in done:
            return []
        for following in sorted(graph.get(node, ())):
            if circle := search(following, [*trail, node]):
                return circle
        done.add(node)
        return []

    return next(filter(None, (search(node, []) for node in sorted(graph))), [])


@pytest.mark.parametrize(
    ("graph", "circle"),
    [
        ({"a": {"b"}, "b": {"c"}, "c": set()}, []),
        ({"a": {"b"}, "b": {"c"}, "c": {"b"}}, ["b", "c", "b"]),
        ({"a": {"a"}}, ["a", "a"]),
    ],
)
def test_circles_are_found(graph, circle):
    assert _cycle(graph) == circle


def test_imports_are_found():
    source = """
from typing import TYPE_CHECKING
from p.a import b, name
if TYPE_CHECKING:
    import p.hidden
else:
    import p.shown
try:
    from . import c
except ImportError:
    import p.spare
def f():
    import p.late
class C:
    from p.d import x
"""
    known = {f"p.{name}" for name in ("a", "a.b", "hidden", "shown", "c", "spare", "late", "d")}
    wanted = {f"p.{name}" for name in ("a", "a.b", "shown", "c", "spare", "d")}
    assert _imports(source, "p", known) == wanted


def test_modules_do_not_import_each_other_in_a_circle():
    graph = _graph()
    assert len(graph) > 100
    assert "granular._core" in graph["granular.simulation"]
    assert " -> ".join(_cycle(graph)) == ""


def test_common_modules_import_no_method_and_methods_not_each_other():
    def method(name):
        found = re.match(r"granular\.(mpm|sph)(\.|$)", name)
        return found and found[1]

    common = {n for n, p in _modules().items() if p.parent == ROOT / "granular"}
    common -= {"granular"}
    broken = [
        (name, wanted)
        for name, imported in _graph().items()
        for wanted in imported
        if method(wanted) and (name in common or method(name) not in (None, method(wanted)))
    ]
    assert not broken


# ---- C ----


def _includes() -> set[tuple[str, str]]:
    """Pairs (folder, header) of the sources of the core, tests apart; the top folder is ""."""
    found = set()
    for path in sorted(CSRC.rglob("*")):
        folder = path.relative_to(CSRC).parts[0] if path.parent != CSRC else ""
        if path.suffix in (".c", ".h", ".inl") and folder != "tests":
            names = re.findall(r'^\s*#\s*include\s+"([^"]+)"', path.read_text(), flags=re.M)
            found |= {(folder, name) for name in names}
    return found


def test_folders_of_the_core_do_not_include_each_other_in_a_circle():
    includes = _includes()
    folders = {path.name for path in CSRC.iterdir() if path.is_dir()} - {"tests"}
    graph: dict[str, set[str]] = {folder: set() for folder in folders}
    for folder, name in includes:
        target = name.rpartition("/")[0]
        assert target in folders | {""}, f"{folder} includes {name}"
        if folder and target and folder != target:
            graph[folder].add(target)
    assert " -> ".join(_cycle(graph)) == ""
    # Files of the top folder build on all methods: kernels.h declares the table of the kernels
    # that are compiled for each instruction set. A step of the material point method takes its
    # kernels from this table, and what serves Python selects one; nothing else may look there.
    assert {pair for pair in includes if pair[0] and "/" not in pair[1]} == {
        ("mpm", "kernels.h"),
        ("python", "kernels.h"),
    }

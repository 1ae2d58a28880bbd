"""Imports: none in a circle, in Python and in C; the methods build on the common modules."""

import ast
import re
from collections.abc import Iterator, Mapping
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
CSRC = ROOT / "csrc"

# ---- Python ----

RUNS, LATER, TYPES = "runs", "later", "types"
"""When an import is made: with that of the module, in a function, or by a type checker alone."""

LARGEST = 7
"""Most modules that may know each other, counting imports of all kinds."""

KNOW_EACH_OTHER = {
    "what a module checks or describes is of the type that imports it": {
        ("granular.model.inflow", "granular.model.scene"),
        ("granular.model.indicators", "granular.model.scene"),
        ("granular.mpm.body_limits", "granular.mpm.scene"),
        ("granular.shapes.mesh_samples", "granular.shapes.mesh"),
        ("granular.mpm.filling", "granular.mpm.scene"),
        ("granular.mpm.indicators", "granular.mpm.scene"),
        ("granular.mpm.inflow", "granular.mpm.scene"),
        ("granular.mpm.limits", "granular.mpm.scene"),
        ("granular.mpm.support", "granular.mpm.scene"),
        ("granular.sph.inflow", "granular.sph.scene"),
        ("granular.sph.limits", "granular.sph.scene"),
    },
    "`Simulation(scene)` is of the class of the method, which editors should know": {
        ("granular.run.simulation", "granular.mpm.simulation"),
        ("granular.run.simulation", "granular.sph.simulation"),
    },
    "a check that two laws share is given either": {
        ("granular.materials.laws", "granular.materials.dilatant"),
        ("granular.materials.laws", "granular.materials.regularised"),
    },
    "the law begins where the theory says that another one is ill posed": {
        ("granular.materials.regularised", "granular.theory.well_posed"),
    },
}
"""Imports that do not run with their module and close a circle, by their reason."""


COMMON = ("tools", "shapes", "model", "materials", "run")
"""Rooms that both methods share."""


def _modules() -> dict[str, Path]:
    """Source of every module of the package, by name; the stub stands for the compiled core."""
    found = {}
    for path in sorted((ROOT / "granular").rglob("*.py*")):
        if path.suffix not in (".py", ".pyi"):
            continue
        parts = path.relative_to(ROOT).with_suffix("").parts
        found[".".join(parts[:-1] if parts[-1] == "__init__" else parts)] = path
    return found


def _statements(body: list[ast.stmt], when: str) -> Iterator[tuple[ast.stmt, str]]:
    """Statements, those of blocks, classes and functions too, and when they run."""
    for statement in body:
        yield statement, when
        inside = {"body": when, "orelse": when, "finalbody": when}
        if isinstance(statement, (ast.FunctionDef, ast.AsyncFunctionDef)):
            inside["body"] = LATER
        if isinstance(statement, ast.If) and "TYPE_CHECKING" in ast.unparse(statement.test):
            inside["body"] = TYPES
        for block, then in inside.items():
            yield from _statements(getattr(statement, block, []), then)
        for handler in getattr(statement, "handlers", []):
            yield from _statements(handler.body, when)


def _imports(source: str, package: str, known: set[str]) -> set[tuple[str, str]]:
    """Pairs (module, when) that a source imports, without the parents that run along with them."""
    found = set()
    for statement, when in _statements(ast.parse(source).body, RUNS):
        names = set()
        if isinstance(statement, ast.Import):
            names = {name.name for name in statement.names}
        elif isinstance(statement, ast.ImportFrom):
            above = package.split(".")[: len(package.split(".")) - statement.level + 1]
            start = ".".join(above if statement.level else [])
            base = ".".join(filter(None, (start, statement.module)))
            whole = {f"{base}.{name.name}" for name in statement.names}
            names = {name if name in known else base for name in whole}
        found |= {(name, when) for name in names & known}
    return found


def _graph(*kinds: str) -> dict[str, set[str]]:
    """Modules that each module imports in one of these ways."""
    modules, graph = _modules(), {}
    for name, path in modules.items():
        package = name if path.stem == "__init__" else name.rpartition(".")[0]
        pairs = _imports(path.read_text(), package, set(modules))
        graph[name] = {module for module, when in pairs if when in kinds}
    return graph


def _with_parents(graph: Mapping[str, set[str]]) -> dict[str, set[str]]:
    """The graph with the packages that run before their modules, but for those already running."""

    def parents(name: str) -> set[str]:
        parts = name.split(".")
        return {".".join(parts[:i]) for i in range(1, len(parts))}

    return {
        name: set().union(wanted, *map(parents, wanted)) - parents(name) - {name}
        for name, wanted in graph.items()
    }


def _circles(graph: Mapping[str, set[str]]) -> list[set[str]]:
    """Sets of modules each of which reaches all others of its set."""
    reached = {name: _reached(graph, name) for name in graph}
    found = []
    for name in sorted(graph):
        together = {other for other in reached[name] if name in reached.get(other, ())}
        if together and together not in found:
            found.append(together)
    return found


def _reached(graph: Mapping[str, set[str]], start: str) -> set[str]:
    found: set[str] = set()
    ahead = [start]
    while ahead:
        new = graph.get(ahead.pop(), set()) - found
        found |= new
        ahead += new
    return found


@pytest.mark.parametrize(
    ("graph", "circles"),
    [
        ({"a": {"b"}, "b": {"c"}, "c": set()}, []),
        ({"a": {"b"}, "b": {"c"}, "c": {"b"}}, [{"b", "c"}]),
        ({"a": {"a"}, "b": {"c", "a"}, "c": {"b"}}, [{"a"}, {"b", "c"}]),
    ],
)
def test_circles_are_found(graph, circles):
    assert _circles(graph) == circles


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
    wanted = {(f"p.{name}", RUNS) for name in ("a", "a.b", "shown", "c", "spare", "d")}
    wanted |= {("p.hidden", TYPES), ("p.late", LATER)}
    assert _imports(source, "p", known) == wanted
    graph = {"p.a.b": {"p.a.c", "p.d.e"}}
    assert _with_parents(graph) == {"p.a.b": {"p.a.c", "p.d", "p.d.e"}}


def test_modules_do_not_import_each_other_in_a_circle():
    """With the packages that run first, so that no order of imports matters."""
    graph = _with_parents(_graph(RUNS))
    assert len(graph) > 100
    assert "granular._core" in graph["granular.run.simulation"]
    assert "granular.measure" in graph["granular.run.monitor"]
    assert _circles(graph) == []


def test_modules_that_know_each_other_are_few_and_have_a_reason():
    graph, runs = _graph(RUNS, LATER, TYPES), _graph(RUNS)
    circles = _circles(graph)
    assert max(map(len, circles)) <= LARGEST
    closing = {
        (name, wanted)
        for circle in circles
        for name in circle
        for wanted in (graph[name] - runs[name]) & circle
    }
    assert closing == set().union(*KNOW_EACH_OTHER.values())


def test_common_modules_import_no_method_and_methods_not_each_other():
    def method(name):
        found = re.match(r"granular\.(mpm|sph)(\.|$)", name)
        return found and found[1]

    common = {name for name in _modules() if re.match(rf"granular\.({'|'.join(COMMON)})\b", name)}
    assert len(common) > 40
    broken = [
        (name, wanted)
        for name, imported in _graph(RUNS).items()
        for wanted in imported
        if method(wanted) and (name in common or method(name) not in (None, method(wanted)))
    ]
    assert not broken


# ---- C ----


PAIRS_OF_THE_CORE = [
    # a body has a chain of motions, whose poses are those of the body
    {"body/body", "body/chain"},
    # points that come from other ranks are inserted as all others, which lets those go that leave
    {"mpm/arrivals", "mpm/migrate"},
    # the servo moves a wall by the impulses on it, and is a part of their sums
    {"mpm/servo", "mpm/wall_impulse"},
]
"""Modules of the core, a source with its header, of which each includes the other."""


def _includes() -> set[tuple[str, str]]:
    """Pairs (module, header) of the sources of the core, tests apart."""
    found = set()
    for path in sorted(CSRC.rglob("*")):
        module = path.relative_to(CSRC).with_suffix("").as_posix()
        if path.suffix in (".c", ".h", ".inl") and not module.startswith("tests/"):
            names = re.findall(r'^\s*#\s*include\s+"([^"]+)"', path.read_text(), flags=re.M)
            found |= {(module, name) for name in names}
    return found


def _folder(name: str) -> str:
    """Folder of a module or header of the core; that of the top is ""."""
    return name.rpartition("/")[0]


def test_folders_of_the_core_do_not_include_each_other_in_a_circle():
    includes = _includes()
    folders = {path.name for path in CSRC.iterdir() if path.is_dir()} - {"tests"}
    graph: dict[str, set[str]] = {folder: set() for folder in folders}
    for module, name in includes:
        folder, target = _folder(module), _folder(name)
        assert target in folders | {""}, f"{module} includes {name}"
        if folder and target and folder != target:
            graph[folder].add(target)
    assert _circles(graph) == []
    # Files of the top folder build on all methods: kernels.h declares the table of the kernels
    # that are compiled for each instruction set. A step of the material point method takes its
    # kernels from this table, and what serves Python selects one; nothing else may look there.
    assert {(_folder(m), name) for m, name in includes if _folder(m) and not _folder(name)} == {
        ("engine", "kernels.h"),
        ("mpm", "kernels.h"),
        ("python", "kernels.h"),
    }


def test_modules_within_a_folder_of_the_core_include_each_other_in_pairs_at_most():
    graph: dict[str, set[str]] = {}
    for module, name in _includes():
        target = name.rpartition(".")[0]
        if _folder(module) == _folder(target) and module != target:
            graph.setdefault(module, set()).add(target)
    assert _circles(graph) == PAIRS_OF_THE_CORE

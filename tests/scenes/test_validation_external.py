"""Data of other authors: the files are read and shipped, and coarse runs stay near them."""

import tomllib
from pathlib import Path

import numpy as np
import pytest

from granular.cli import main as command
from granular.verify import external
from granular.verify.external import bagnold, columns, frame, hstop, limit_analysis

ROOT = Path(__file__).parents[2]


def test_every_file_says_where_it_comes_from_and_is_shipped():
    files = sorted((ROOT / "granular" / "verify" / "data").glob("*.csv"))
    assert len(files) > 10
    for file in files:
        data = external.load(file.stem)
        assert "source" in data.notes[0]
        assert all(len(column) > 1 for column in data.columns.values())
    setup = tomllib.loads((ROOT / "pyproject.toml").read_text())["tool"]["setuptools"]
    assert "verify/data/*.csv" in setup["package-data"]["granular"]


def test_unknown_names_are_refused(capsys):
    with pytest.raises(ValueError, match="no_such"):
        external.load("no_such")
    assert command(["verify", "--external", "no_such"]) == 2
    assert "no_such" in capsys.readouterr().err


def test_rows_are_met_reported_or_not():
    """A band is met inside, and beyond its ends by the tolerance."""
    assert external.near("q", 1.04, 1.0, 0.05).passed
    assert external.near("q", 1.06, 1.0, 0.05).passed is False
    assert external.near("q", 1.06, 1.0, 0.05, gate=False).passed is None
    assert external.below("q", np.nan, 1.0).passed is False
    assert external.near("q", np.nan, 1.0, 0.05).passed is False
    rows = [external.near("q", ours, (3.0, 2.0), 0.05) for ours in (1.89, 1.91, 2.5, 3.14, 3.16)]
    assert [row.passed for row in rows] == [False, True, True, True, False]
    assert frame.cells_of(rows[0])[2:] == ["3 to 2", "5%", "not met"]


def drawn(name):
    """Rows of a quick run, whose picture is drawn as well."""
    outcome = external.cases[name].outcome(quick=True)
    figure = external.cases[name].picture(outcome)
    assert all(axes.has_data() for axes in figure.axes)
    return outcome.rows


def test_coarse_bagnold(monkeypatch):
    """1 % with 10 cells, of softer grains and after a shorter time than in the case."""
    monkeypatch.setattr(bagnold, "STIFFNESS", 1e3)
    monkeypatch.setattr(bagnold, "RELAXATIONS", 9.0)
    rows = drawn("bagnold")
    assert len(rows) == 4 and all(row.passed for row in rows)


def test_coarse_contact_dynamics():
    """L1 norm and run-out of 99 % are met with 10 cells, by the default scheme.

    The foot needs cells of two grains, and these are of six. The mean distance falls short by 3.2
    to 3.4 %, for places of the points by four seeds.
    """
    rows = drawn("contact_dynamics")
    missed = [row for row in rows if row.passed is False]
    assert [row.quantity for row in missed] == [
        "mean distance of the deposit, a = 1.42, default, 10 cells"
    ]
    assert missed[0].ours == pytest.approx(missed[0].reference, rel=0.036)
    assert sum(row.passed is True for row in rows) == 2


def test_moments_of_a_deposit():
    """A triangle has them in closed form; the deposit of the discs deviates from itself by 0."""
    data = columns.Discs.load(1.42)
    x = (np.arange(400) + 0.5) / 200.0
    found = data.of_deposit(x, 1.0 - 0.5 * x)
    assert found["mean"] == pytest.approx(2.0 / 3.0, rel=1e-4)
    assert found["energy"] == pytest.approx(1.0 / 3.0, rel=1e-4)
    reach = 2.0 - 2.0 * np.sqrt(1.0 - columns.REACHES)
    assert found["runout"] == pytest.approx(reach - columns.REACHES * data.half_width, rel=1e-2)
    assert data.deviation(np.interp(data.places(), data.x, data.h, right=0.0)) == 0.0


def test_toe_and_foot_of_a_surface():
    """Where it first falls to a level; where the line through it, but for a sheet thinner than two
    grains, meets the ground."""
    assert columns.toe(np.arange(5.0), np.array([3.0, 2.0, 1.0, 2.0, 0.0]), 1.5) == 1.5
    x = np.linspace(0.0, 20.0, 401)
    line = 1.0 - 0.1 * x
    assert columns.foot(x, np.maximum(line, 0.0), 0.05) == pytest.approx(10.0)
    sheet = np.where(line < 0.1, 0.02, line)
    assert columns.foot(x, np.where(x < 15.0, sheet, 0.0), 0.05) == pytest.approx(10.0, rel=0.01)


def test_another_method_with_the_same_law_ends_near():
    """At a = 1.42 the mean distance by the volume-of-fluid method is within 3 % of ours."""
    known, data = external.load("lagree2011_mui_basilisk"), columns.Discs.load(1.42)
    mine = known["a_nominal"] == 1.42
    theirs = data.of_deposit(known["x_over_H"][mine], known["h_over_H"][mine])
    ours = columns.collapse_of_discs(data, 8, columns.SCHEMES["default"])
    assert ours["mean"][-1] == pytest.approx(theirs["mean"], rel=0.03)


@pytest.mark.parametrize(
    ("name", "number"),
    [("runout_laws", 2), pytest.param("limit_analysis", 5, marks=pytest.mark.slow)],
)
def test_every_row_of_a_coarse_run_is_met(name, number, monkeypatch):
    """Run-outs lie among the laws; a wall along a turned bed and a surcharged footing, within 5 %
    of limit analysis."""
    monkeypatch.setitem(limit_analysis.BASES, "rough", (14,))
    rows = drawn(name)
    assert len(rows) == number and all(row.passed for row in rows)


def test_coarse_bars(monkeypatch):
    """With tan phi the surface is within what is asked, in cells of 0.01 m."""
    chosen = "mu = tan phi"
    monkeypatch.setattr(columns, "BARS", {chosen: columns.BARS[chosen]})
    rows = {row.quantity: row for row in drawn("bars")}
    assert rows[f"rms of the surface [m], {chosen}"].passed


def test_coarse_stopping_height(monkeypatch):
    """3 % of the law in 10 cells by the scheme that such scenes take; the rest decides nothing.

    Two halvings of the interval end within 1.3 % of the law, or 3.8 % off it.
    """
    monkeypatch.setattr(hstop, "SEARCH", (0.95, 1.05))
    monkeypatch.setattr(hstop, "HALVINGS", 2)
    rows = {row.quantity: row for row in drawn("hstop")}
    decide = [name for name, row in rows.items() if row.passed is not None]
    assert len(decide) == 2 and all("cell_averaged" in name for name in decide)
    assert all(rows[name].passed for name in decide)
    default = rows["u/sqrt(g h), 24 deg, h = 1.5 h_stop, 10 cells, default"]
    assert default.ours == pytest.approx(default.reference, rel=0.07)


def test_the_exit_code_says_whether_every_tolerance_is_met(monkeypatch, capsys):
    """0 if all are, 1 if not; --quick arrives at the case, and needs --external."""
    seen = []

    def run(quick):
        seen.append(quick)
        return external.Outcome(rows=[external.near("q", 1.0 + 0.1 * quick, 1.0, 0.05)])

    monkeypatch.setitem(external.cases, "made_up", external.Case("made_up", run, None))
    assert command(["verify", "--external", "made_up"]) == 0
    assert command(["verify", "--external", "made_up", "--quick"]) == 1
    assert seen == [False, True]
    assert "not met" in capsys.readouterr().out
    assert command(["verify", "--quick"]) == 2
    assert "--external" in capsys.readouterr().err

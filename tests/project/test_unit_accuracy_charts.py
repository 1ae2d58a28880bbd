"""Charts and tables of error against core-seconds, of the package and beside other codes."""

import json
import sys
from pathlib import Path

import pytest
from PIL import Image

RESULTS = Path(__file__).parents[2] / "benchmarks" / "results"


def run(module, tmp_path, *options):
    out = tmp_path / "table.json"
    script = module("speed_accuracy")
    script.main(["--quick", "--out", str(out), "--figures", str(tmp_path / "new"), *options])
    return json.loads(out.read_text())


def test_a_quick_chart_is_written(module, tmp_path, capsys):
    """Every scene has a row with a time and its own result; a second call runs nothing."""
    table = run(module, tmp_path)
    assert {"machine", "compiler", "isa"} <= table["head"].keys()
    rows = table["rows"]
    assert all(row["commit"] for row in rows)
    assert {row["scene"] for row in rows} == set(module("accuracy.cases").SCENES)
    assert all(row["core_seconds"] > 0 and row["steps"] > 0 for row in rows)
    for row in rows:
        names = {"collapse": "runout_quantile", "silo": "rate"}
        assert row[names.get(row["scene"], "profile_error")] > 0
    with Image.open(tmp_path / "new" / "accuracy_inclines.png") as picture:
        assert min(picture.size) > 200
    assert len(capsys.readouterr().out.splitlines()) == len(rows)
    assert run(module, tmp_path) == table
    assert capsys.readouterr().out == ""


def test_what_is_left_out_is_said(module, tmp_path):
    rows = run(module, tmp_path, "--limit", "0", "--only", "silo")["rows"]
    assert [row["scene"] for row in rows] == ["silo"]
    assert "foreseen" in rows[0]["left_out"]
    assert "rate" not in rows[0]
    # times of two builds do not mix
    path = tmp_path / "table.json"
    path.write_text(json.dumps({"head": {"machine": "another"}, "rows": []}))
    with pytest.raises(ValueError, match="another"):
        module("accuracy.results").Table(path)


def test_a_peer_that_is_not_there_is_named(module, monkeypatch):
    cases, script = module("accuracy.cases"), module("speed_accuracy")
    for package in ("taichi", "newton", "KratosMultiphysics"):
        monkeypatch.setitem(sys.modules, package, None)
    for name, file in module("peers.codes").MODULES.items():
        monkeypatch.delitem(sys.modules, f"peers.{file}", raising=False)
        case = cases.Case(scene="silo", solver=name, scheme=name)
        assert f"{name} cannot be imported" in script.run(case, 1.0)["left_out"]


def test_every_case_is_run_once_and_its_committed_result_is_there(module):
    """The committed table has the results of each case, or the reason for their absence."""
    cases = module("accuracy.cases").full()
    assert len(set(cases)) == len(cases)
    assert {case.scene for case in cases if case.published} == set(module("accuracy.cases").SCENES)
    table = json.loads((RESULTS / "speed_accuracy.json").read_text())
    found = {tuple(row[name] for name in cases[0].row()) for row in table["rows"]}
    assert {tuple(case.row().values()) for case in cases} <= found
    rows = json.loads((RESULTS / "peers.json").read_text())["rows"]
    assert len(module("peers.columns_errors").references(rows)) == 15


def _row(**entries):
    row = {"solver": "granular", "scheme": "default", "E": 1e7, "cell": 0.01, "points": 4}
    row |= {"scene": "silo", "angle_deg": None, "seed": 0, "until": None, "core_seconds": 1.0}
    return row | entries


def test_the_front_holds_what_nothing_beats_and_rates_are_extrapolated(module):
    points = [(_row(core_seconds=s), e) for s, e in ((3.0, 0.1), (1.0, 0.3), (2.0, 0.4), (4, 0.1))]
    assert module("accuracy.errors").front(points) == [points[1], points[0]]
    # Q = 600 (1 + a dx), with another a and another limit for each scheme
    rows = [
        _row(scheme=scheme, cell=cell, rate=limit * (1 + a * cell))
        for scheme, limit, a in (("default", 606.0, 5.0), ("linear flip", 594.0, -2.0))
        for cell in (0.02, 0.01, 0.005)
    ]
    reference = module("accuracy.errors").silo_reference(rows)
    assert reference.value[0] == pytest.approx(600.0, rel=1e-12)
    assert reference.uncertainty == pytest.approx(0.01, rel=1e-9)


def test_the_slope_of_a_bias_is_found(module):
    """A rate of 600 (1 + 3 p/K) gives steps of slope -1 and a bias of 3 p/K to first order."""
    errors, slopes = module("accuracy.errors"), module("accuracy.slopes")
    rows = [_row(E=E) for E in (1e5, 1e6, 1e7, 1e8)]
    for row in rows:
        row["rate"] = 600 * (1 + 3 * errors.stiffness(row)["p_over_K"])
    (entry,) = slopes.table(rows, errors.references(rows))
    assert entry["parameter"] == "E"
    assert entry["slope"] == pytest.approx(-1.0, abs=0.03)
    for measured in entry["measured"][1:]:
        assert measured["step_per_p_over_K"] == pytest.approx(3.0, rel=0.02)


def test_quick_columns_beside_peers(module, tmp_path, capsys):
    """Our codes run, the errors against the discs are finite, and a second call runs nothing."""
    script, out = module("peers.peers"), tmp_path / "table.json"
    common = ["--quick", "--out", str(out), "--pictures", str(tmp_path)]
    for lines in (3, 0):
        script.main([*common, "--only", "default", "published"])
        assert len(capsys.readouterr().out.splitlines()) == lines
    errors = module("peers.columns_errors")
    rows = json.loads(out.read_text())["rows"]
    assert all(row["core_seconds"] > 0 and row["kept"] == 1.0 for row in rows)
    found = errors.of_panel(rows, "mu_I", 1.42, errors.of_discs(1.42))
    assert len(found) == 2 and all(0.01 < e < 0.3 for _, e in found)
    with Image.open(tmp_path / "peers.png") as picture:
        assert min(picture.size) > 200

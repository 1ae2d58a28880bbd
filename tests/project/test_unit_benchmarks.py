"""The scripts of `benchmarks` run, and make tables of their results."""

import json
import re
import sys
from pathlib import Path

import numpy as np
import pytest

import granular as gr
from granular import verify
from granular.verify.rows import Check, at_most

RESULTS = Path(__file__).parents[2] / "benchmarks" / "results"


@pytest.fixture
def measure(module, tmp_path, capsys):
    """Function that runs a script with --quick; returns it, its results and the printed lines."""

    def run(name, *options):
        script, out = module(name), tmp_path / f"{name}.json"
        script.main([*options, "--quick", "--out", str(out)])
        results = json.loads(out.read_text(), parse_constant=pytest.fail)
        return script, results, capsys.readouterr().out.splitlines()

    return run


def test_a_quick_table_of_bodies_is_written(measure):
    """Each row has lines with numbers; a second call measures nothing."""
    assert len(measure("bodies", "--only", "bed", "box", "plate")[2]) == 3
    script, table, printed = measure("bodies", "--only", "bed")
    assert not printed
    text = "\n".join(script.tables(table)["bodies"])
    assert all(case["deepest"] < 0.25 for row in table["rows"].values() for case in row.values())
    for name in table["rows"]:
        assert f"| **{script.ROWS[name].title}** |" in text
    assert "nan" not in text and "inf" not in text


def test_quick_tables_of_free_bodies_are_written(measure):
    """A second call measures nothing; each table has a stamp of its own."""
    assert len(measure("free_bodies", "light", "craters")[2]) == 2
    script, results, printed = measure("free_bodies", "light", "craters")
    assert not printed and results["stamps"].keys() == {"light", "craters"}
    made = script.tables(results)
    assert made["light"][0] == "| mass over that of a cell | radius of 4 cells |"
    assert made["craters"][2].startswith("| 0.2 | 2.5 |")


def test_points_are_split_in_a_quick_table(measure):
    """Halves keep the mass, and the numbers of the orifice have a scatter."""
    script, results, _ = measure("splitting")
    (name,) = results["rows"]
    assert all(run["splits"] > 50 for run in results["rows"][name]["4, at least 2"])
    sim = gr.Simulation(gr.scenes.column_collapse(cell=0.025, E=1e6), threads=1)
    sim.step(50)
    halves = script.halved(sim, np.array([3, 7]), np.array([[0.002, 0.0], [0.0, 0.002]]))
    for state in (sim.state, halves.state):
        assert state.mass.sum() == pytest.approx(sim.state.mass.sum(), rel=1e-14)
        turning = state.mass * (state.x[:, 0] * state.v[:, 1] - state.x[:, 1] * state.v[:, 0])
        known = sim.state.mass * (
            sim.state.x[:, 0] * sim.state.v[:, 1] - sim.state.x[:, 1] * sim.state.v[:, 0]
        )
        assert turning.sum() == pytest.approx(known.sum(), rel=1e-12)
    assert halves.n_points == sim.n_points + 2


def test_quick_error_bars_contain_what_is_known(measure):
    _, results, printed = measure("error_bars")
    assert len(results["rows"]) == 2 and printed[-1].startswith("2 of 2 inside")


def test_the_bytes_of_a_step_are_counted(measure):
    """G2P writes the affine field unread, P2G reads the mass; averages are one step of four."""
    script, results, _ = measure("traffic")
    (row,) = results["rows"]
    arrays = {line["array"]: line for line in row["arrays"]}
    number = 8 * row["slots"]
    assert arrays["v"]["g2p read"] == pytest.approx(2 * number, rel=0.01)
    assert arrays["affine"]["g2p write"] == pytest.approx(4 * number, rel=0.01)
    assert arrays["affine"]["g2p read"] == arrays["mass"]["g2p read"] == 0
    assert arrays["mass"]["p2g read"] == pytest.approx(number, rel=0.01)
    assert arrays["shift_velocity"]["g2p write"] == pytest.approx(2 * number / 4, rel=0.02)
    assert len(script.tables(results)["arrays"]) == 2 + 19


def test_a_quick_table_of_features_is_written(measure):
    """Two features are measured in turns; the table has a row for each, in their order."""
    script, results, printed = measure("features", "--only", "cohesion", "SPH inflow")
    rows = results["rows"]
    assert list(rows) == ["cohesion", "SPH inflow"] and len(printed) == 2
    assert all(1.0 < row["off"] < 1e5 and 0.1 < row["ratio"][1] < 10.0 for row in rows.values())
    text = "\n".join(script.tables(results)["features"])
    assert text.index("with cohesion") < text.index("SPH, an inflow")


@pytest.mark.slow
def test_a_quick_table_of_speed_is_written(measure):
    """The table has a time for each scheme and state, with one thread and with two."""
    script, results, printed = measure("speed")
    rows = results["rows"]
    assert {row["scheme"] for row in rows} == results["errors"].keys() == set(script.SCHEMES)
    assert len(rows) == 8 * len(script.SCHEMES) and {row["threads"] for row in rows} == {1, 2}
    assert all(1.0 < row["ns"] < 1e4 for row in rows)
    assert len(printed) == len(rows) / 2
    assert {"summary", "machine", "errors", "2D, 4 in a cell"} < script.tables(results).keys()


def test_the_smaller_time_of_two_runs_is_kept(module):
    """Results of two runs are joined row by row, if the rows are the same ones."""

    def results(isa, *times):
        rows = [{"scheme": f"scheme {k}", "points": 8192, "ns": ns} for k, ns in enumerate(times)]
        return {"isa": isa, "rows": rows, "machine": {"memory": times[0]}, "reference": times[1]}

    script = module("speed")
    joined = script.least(results("avx2", 9.0, 20.0), results("avx2", 10.0, 19.0))
    assert [row["ns"] for row in joined["rows"]] == [9.0, 19.0]
    assert joined["machine"] == {"memory": 10.0} and joined["reference"] == 19.0
    with pytest.raises(SystemExit, match="another instruction set"):
        script.least(results("avx512", 9.0, 20.0), results("avx2", 10.0, 19.0))
    other = results("avx2", 8.0, 19.0)
    other["rows"][0]["points"] = 1
    with pytest.raises(SystemExit, match="other rows"):
        script.least(results("avx2", 9.0, 20.0), other)


def test_a_quick_table_of_places_is_written(module, measure, monkeypatch):
    """Buffers are larger than the points, and the table has a row for each case."""
    cases = dict(list(module("places").CASES.items())[-1:])
    monkeypatch.setattr(module("places"), "CASES", cases)
    script, results, _ = measure("places")
    (sizes,) = results["cases"].values()
    assert sizes["points"] == 2048 and 1.0 < sizes["start"] <= sizes["end"] < 2.0
    (lines,) = script.tables(results).values()
    assert len(lines) == 3 and "| 2,048 |" in lines[-1]
    assert results["stamp"].keys() == {"commit", "command", "processor", "build", "date"}


@pytest.mark.slow
def test_a_quick_table_in_3d_is_written(measure):
    script, table, printed = measure("speed_3d")
    assert [row["case"] for row in table["rows"]] == list(script.CASES)
    assert all(1.0 < t < 1e4 for row in table["rows"] for t in row["ns"])
    assert len(printed) == 1 + len(table["rows"])


def test_serial_samples_are_those_outside_of_the_team(module):
    """Five samples of steps, two of them of work that is divided; one of no step."""
    chains = (
        ("gr_locate", "add_point", "gr_team_run", "gr_regroup", "finish", "make_steps", "main"),
        ("memcpy", "gr_regroup", "finish", "make_steps", "main"),
        ("make_steps", "[unknown]"),
        ("gr_locate", "sweep_2", "[unknown]"),
        ("memcpy", "gr_migrate", "[unknown]"),
        ("gr_regroup", "main"),
    )
    text = "\n\n".join("\n".join(f"  7f0a {name}+0x1f" for name in chain) for chain in chains)
    serial, samples = module("serial_share").count(text + "\n\n")
    assert samples == 5
    assert serial == {"finish": 1, "make_steps": 1, "gr_migrate": 1}


def test_a_quick_roofline_is_written(measure):
    """The bounds follow from the rates that were measured in the same run."""
    _, found, printed = measure("roofline")
    assert found["bound by the memory [ns]"] * found["memory [GB/s]"] == (
        pytest.approx(found["bytes a particle-step"])
    )
    assert found["bound by operations [ns]"] * found["multiply-adds [Gflop/s]"] == (
        pytest.approx(found["operations a particle-step"])
    )
    committed = json.loads((RESULTS / "roofline.json").read_text())
    assert committed.keys() - found.keys() == {f"measured, {n} points [ns]" for n in (8192, 204800)}
    assert len(printed) == len(found) - 1


def test_history_of_the_speed(measure):
    """Each run adds a row; changes are against the last row of the same machine and build."""
    script, table, printed = measure("history")
    (row,) = table["rows"]
    assert len(row["ratios"]) == len(script.CASES) * len(script.NAMES)
    assert min(row["ratios"].values()) > 1
    faster = row | {"ratios": {name: 0.5 * ratio for name, ratio in row["ratios"].items()}}
    other = faster | {"kind": row["kind"] | {"isa": "another"}}
    lines = script.table([row, other, faster], last=2).splitlines()
    assert lines[: len(row["ratios"])] == printed[: len(row["ratios"])]
    assert len(lines) == len(printed) + 1 and "%" not in "".join([*printed, lines[-2]])
    assert lines[-1].count("-50 %") == len(row["ratios"])
    committed = json.loads((RESULTS / "history.json").read_text())["rows"]
    assert all(row.keys() == old.keys() for old in committed)


def test_a_quick_account_of_a_record(module, capsys):
    """All parts are timed, their sum is the whole, and the timers are removed afterwards."""
    script, advance = module("record"), gr.Simulation._advance
    script.main(["--quick", "--threads", "1"])
    head, _, *lines = capsys.readouterr().out.splitlines()
    assert head.startswith("512 points") and " 7 frames" in head
    parts = {line[:26].strip(): float(line[26:].split()[1]) for line in lines[:-2]}
    assert parts.keys() == {part for *_, part in script.PARTS} | {"all else", "sum"}
    assert parts.pop("sum") == pytest.approx(sum(parts.values()), abs=0.05)
    assert parts["kernels"] > 0.1
    steps = int(head.split()[2])
    in_steps = parts["frames"] / 7 / (parts["kernels"] / steps)
    assert float(lines[-1][26:].split()[1]) == pytest.approx(in_steps, rel=0.02)
    assert gr.Simulation._advance is advance


def test_time_is_charged_once(module, monkeypatch):
    """Time that one part spends in another is counted for the other only."""
    script = module("record")
    account = script.Account()
    ticks = iter([[0.0, 0.0], [1.0, 1.0], [4.0, 3.0], [6.0, 5.0]])
    monkeypatch.setattr(script, "now", lambda: np.array(next(ticks)))
    inner = account.of(lambda: None, "inner")
    account.of(inner, "outer")()
    assert account.spent["inner"].tolist() == [3.0, 2.0]
    assert account.spent["outer"].tolist() == [3.0, 3.0]


def test_the_laws_and_threads_beside_others_are_timed(measure):
    _, table, printed = measure("laws")
    assert {row["law"] for row in table["rows"]} >= {"mu_I", "loose", "linear_ngf"}
    assert all(len(row["ns"]) == 2 and min(row["ns"]) > 0 for row in table["rows"])
    assert len(printed) == len(table["rows"]) + 2
    _, table, printed = measure("threads_beside_others")
    assert [row["others"] for row in table["rows"]] == [0, 1, 2]
    assert all(seconds > 0 for row in table["rows"] for seconds in row["seconds"].values())
    assert len(printed) == 1 + len(table["rows"])


@pytest.mark.slow
def test_an_empty_box_costs_next_to_nothing(module, tmp_path, capsys):
    """The box is 64 times larger than the heap: equal time but for noise, few bytes per point."""
    out = tmp_path / "box.json"
    module("box_size").main(["--out", str(out)])
    capsys.readouterr()
    rows = {(row["law"], row["box"]): row for row in json.loads(out.read_text())["rows"]}
    for law in ("local", "nonlocal"):
        tight, wide = rows[law, 1], rows[law, 64]
        assert wide["ns"] < 1.5 * tight["ns"]
        assert wide["bytes_per_point"] < tight["bytes_per_point"] + 250


def test_digests_of_bits(module, tmp_path, monkeypatch, capsys):
    """Digests are equal for any number of threads; a changed bit or lost name is a difference."""
    cases, bits = module("bits_cases"), module("bits")
    out = tmp_path / "digests.json"
    monkeypatch.setattr(sys, "argv", ["bits_cases.py", "--out", str(out), "--only", "slug"])
    cases.main()
    before = json.loads(out.read_text())
    assert {"state x", "array x", "number dt"} <= before["slug, baseline, 1"].keys()
    assert before["slug, baseline, 1"] == before["slug, baseline, 2"]
    array = np.array([1.0, 2.0])
    assert cases.digest(array) != cases.digest(np.nextafter(array, 3.0))

    assert bits.compare(before, before, []) == 0
    after = {case: dict(names) for case, names in before.items()}
    for names in after.values():
        names["state place"] = names.pop("state x")
    assert bits.compare(before, after, []) == 0
    assert "renamed: state x -> state place" in capsys.readouterr().out
    for names in after.values():
        del names["state v"]
    assert bits.compare(before, after, []) == 1
    assert bits.compare(before, after, ["state v"]) == 0
    after["slug, baseline, 2"]["array mass"] = "another"
    assert bits.compare(before, after, ["state v"]) == 1
    del after["slug, baseline, 1"]
    assert bits.compare(before, after, ["state v"]) == 2


# ---- results and tables ----


def test_the_readme_names_every_script():
    from shared import scripts

    text = (RESULTS.parent / "README.md").read_text()
    assert sorted(re.findall(r"^\| `(\w+)` \|", text, re.M)) == sorted(scripts())


@pytest.mark.parametrize("result", [path.stem for path in sorted(RESULTS.glob("*.json"))])
def test_results_have_a_stamp_and_whole_tables(module, result):
    """Each row of each table has as many cells as its head."""
    stored = json.loads((RESULTS / f"{result}.json").read_text())
    script = module(result.partition("-")[0])
    tables = script.tables(stored) if hasattr(script, "tables") else {}
    for stamp in (stored["stamp"], *stored.get("stamps", {}).values()):
        assert {"commit", "command", "processor", "date"} <= stamp.keys()
    for lines in tables.values():
        rows = [line.replace("\\|", "") for line in lines if line.startswith("|")]
        assert len(rows) > 2 and len({row.count("|") for row in rows}) == 1


# ---- clogging silos ----


@pytest.fixture
def clogging():
    """The committed table of clogging silos."""
    return json.loads((RESULTS / "clogging.json").read_text())


def keys(rows):
    return {(row["scheme"], *row["case"]) for row in rows}


def test_the_table_of_clogging_holds_every_case(module, clogging):
    plan = module("clogging").Plan()
    assert keys(clogging["diagram"]) == set(plan.diagram())
    assert keys(clogging["substeps"]) == set(plan.subdivided())
    assert keys(clogging["refined"]) == set(plan.refined())
    assert len(clogging["refinement"]) == 4
    script = module("clogging")
    assert script.plain(script.thresholds(clogging["diagram"])) == clogging["thresholds"]


def test_the_gates_hold_and_velocities_of_refined_packings_agree(clogging):
    found = {(row["scheme"], *row["case"]): row["verdict"] for row in clogging["diagram"]}
    schemes = {scheme for scheme, *_ in found}
    assert len(schemes) == 2
    for scheme in schemes:
        assert found[scheme, 1.0, 1] == found[scheme, 2.0, 1] == "static"
        assert found[scheme, 0.1, 1] == found[scheme, 1.0, 5] == "flowing"
    for row in clogging["packings"]:
        assert row["largest"] <= 0.10
        assert row["standard_error"] < 0.03


def test_two_by_two_cells_keep_means(module):
    rng = np.random.default_rng(1)
    axes = (np.arange(4) + 0.5, np.arange(6) + 0.5)
    value, weight = rng.random((2, 4, 6))
    value[:2, :2], weight[:2, :2] = np.nan, 0.0
    value[2, 2], weight[2, 2] = np.nan, 0.0
    coarse = module("refined_silos").coarsened(gr.measure.GridField(axes, value, weight, 1))
    assert coarse.axes[1] == pytest.approx([1, 3, 5])
    assert np.isnan(coarse.value[0, 0])
    expected = np.nansum((value * weight)[2:, 2:4]) / weight[2:, 2:4].sum()
    assert coarse.value[1, 1] == pytest.approx(expected, rel=1e-14)


@pytest.mark.slow
def test_a_quick_table_of_clogging_is_written_and_goes_on(module, tmp_path, capsys):
    """A second call runs nothing: its rows have the same times."""
    script = module("clogging")
    chosen = ["--quick", "--folder", str(tmp_path / "runs"), "--out", str(tmp_path / "new.json")]
    script.main(chosen)
    first = json.loads((tmp_path / "new.json").read_text())
    assert keys(first["diagram"]) == set(script.QUICK.diagram())
    assert "W/d = 5" in capsys.readouterr().out
    script.main(chosen)
    assert json.loads((tmp_path / "new.json").read_text()) == first


# ---- the density correction ----


@pytest.fixture
def correction(monkeypatch, module):
    """The script, with a single fast check that knows the scheme it is given."""

    def rows(scheme):
        yield at_most("nodes | along an axis", 3.0 if scheme.basis == "quadratic" else 2.0, 2.5)
        if scheme.transfer == "apic":
            raise RuntimeError("went wrong")

    fake = Check("density_correction_box", True, rows)
    monkeypatch.setitem(verify.checks, "density_correction_box", fake)
    return module("density_correction_table")


def test_rows_are_kept_and_make_a_table(correction, tmp_path):
    out = tmp_path / "new" / "table.json"
    common = ["--checks", "density_correction_box", "--out", str(out), "--schemes"]
    correction.main([*common, "default", "quadratic APIC"])
    correction.main([*common, "default", "published"])
    stored = json.loads(out.read_text())
    results = stored["rows"]
    assert [r["scheme"] for r in results] == ["quadratic APIC", "default", "published"]
    assert results[0]["rows"][1][:2] == ["RuntimeError: went wrong", "stopped"]
    assert results[1]["rows"] == [["nodes | along an axis", "3", "<= 2.5", False]]
    assert {"commit", "seconds"} <= results[1].keys()
    text = "\n".join(correction.tables(stored)["density correction"])
    assert "| nodes \\| along an axis | <= 2.5 | 3 **!** | 2 | 3 **!** |" in text
    assert "| quantity | asked | default | published | quadratic APIC |" in text


def test_every_check_is_offered(correction):
    assert set(correction.CHECKS) == {
        name for name in verify.checks if name.startswith("density_correction_")
    }


# ---- tools in soil ----


@pytest.fixture
def runs(monkeypatch, module, tmp_path):
    """The script with tiny cases of two names, with its results in a separate folder."""
    script = module("three_d")
    size = {"cell": 0.05, "length": 0.6, "width": 0.2, "start": 0.2, "headroom": 0.15}
    fast = {"speed": 0.2, "dive_speed": 0.1, "travel": 0.1, "blade": (0.05, 0.1, 0.4)}
    roll = {"length": 0.6, "soil": 0.1, "width": 0.2, "tread": 0.1, "start": 0.2, "duration": 0.4}
    ring = {"inner": 0.05, "outer": 0.1, "height": 0.03, "omega": 1.0, "duration": 0.3}
    cases = {
        "couette_shallow": lambda: gr.scenes.couette(cell=0.01, **ring),
        "excavation_5_fine": lambda: script.blade_scene(0.05, **size, **fast),
        "excavation_5_whole": lambda: script.blade_scene(0.05, half=False, **size, **fast),
        "narrow_5": lambda: script.blade_scene(0.05, **size, **fast),
        "wheel_20": lambda: gr.scenes.wheel(cell=0.05, settle=0.1, ramp=0.05, **roll),
        "excavator": lambda: gr.scenes.excavator(cell=0.05, speed=0.4, duration=0.6, ramp=0.02),
    }
    monkeypatch.setattr(script, "CASES", cases)
    monkeypatch.setattr(script, "OUT", tmp_path / "results.json")
    return script


@pytest.mark.slow
def test_cases_are_run_and_measured(runs, tmp_path):
    runs.main([*runs.CASES, "--records", str(tmp_path / "records")])
    table = json.loads((tmp_path / "results.json").read_text())
    assert list(table) == [*runs.CASES, "stamp", "stamps"]
    assert table["excavation_5_fine"]["lateral"] == 0 != table["excavation_5_whole"]["lateral"]
    assert 0 < table["couette_shallow"]["mean_error"] < table["couette_shallow"]["error"] < 0.5
    assert table["narrow_5"]["forward"] > 0 and len(table["narrow_5"]["course"]) == 5
    assert table["wheel_20"]["load"] > 0 and table["wheel_20"]["pull_over_load"] == pytest.approx(
        table["wheel_20"]["drawbar_pull"] / table["wheel_20"]["load"]
    )


def test_unknown_cases_are_refused(runs, capsys):
    with pytest.raises(SystemExit):
        runs.main(["nonsense"])
    assert "must be among" in capsys.readouterr().err
    runs.main([])
    assert capsys.readouterr().out.split() == list(runs.CASES)


def test_all_cases_are_scenes(module):
    """Each case can be built: its sizes fit together."""
    scenes = [make() for make in module("three_d").CASES.values()]
    assert all(scene.bodies for scene in scenes)


def test_quick_tables_of_limits_are_written(measure):
    """Behind a thin body speeds fall with the distance from its edge, to nothing."""
    rows = measure("stability_tables")[1]["rows"]
    assert all(rows[name] for name in ("resting", "closed", "edges", "discs"))
    for row in rows["edges"]:
        near, *_, far = row["shares"]
        assert 0.3 > near > 0.05 and far == 0.0
        assert row["shares"] == sorted(row["shares"], reverse=True)


def test_a_quick_table_of_the_sph_examples_is_written(measure):
    """A repose of 0.2 s has no creep; the table is strict JSON."""
    (row,) = measure("sph_examples", "--only", "repose")[1]["rows"]
    assert row["kind"] == "repose"
    assert row["creep_deg_per_s"] is None and row["angle_deg"] > 0

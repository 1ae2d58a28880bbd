"""The scripts about economy run, and the error laws bound the runs in the committed table."""

import json
from pathlib import Path

import numpy as np
import pytest

import granular as gr
from granular.economy import bias
from granular.economy.pace import nanoseconds
from granular.papers.runs import Runs

FOLDER = Path(__file__).parents[2] / "benchmarks"


@pytest.fixture
def table(module):
    """The committed runs: {case: numbers}."""
    rows = json.loads((FOLDER / "results" / "economy.json").read_text())["rows"]
    case = module("economy").Case
    return {case(**row["case"]).key: row["numbers"] for row in rows}


def test_the_table_holds_every_case_and_its_damping(module, table):
    cases = [case.key for group in module("economy").GROUPS.values() for case in group()]
    assert len(cases) == len(set(cases)) and set(cases) == set(table)
    case = module("economy").Case
    soft = case("silo", {"orifice": 0.2}, 1e6, held=1e8).build()
    assert soft.material.E == 1e6
    assert soft.scheme.tpic_decay == pytest.approx(0.3)
    assert case("silo", {"orifice": 0.2}, 1e6).build().scheme.tpic_decay == 0.03


def reference(case, law, cases):
    """Stiff run with which a softer run is compared, or None.

    It has the stiffness whose decay the softer run holds, or is the stiffest of its kind whose
    damping does not exceed that of the law.
    """
    same = [
        c
        for c in cases
        if (c.keywords, c.scheme, c.law, c.changes) == (case.keywords, case.scheme, "mu_I", {})
        and c.held is None
        and c.E > case.E
        and (case.held is None or c.E == case.held)
        and bias.grid_damping(c.build()) <= law.damping
    ]
    usable = case.law == "mu_I" and not case.changes and bool(case.held) == law.held
    return max(same, key=lambda c: c.E) if same and usable else None


def variance(cases, table, quantity):
    """Variance of a quantity between seedings of one scene, the median over the scenes."""
    several = {}
    for case in cases:
        keywords = {k: v for k, v in case.keywords.items() if k not in ("seed", "jitter")}
        key = case.E, case.held, case.law, str(keywords), str(case.changes)
        several.setdefault(key, []).append(np.ravel(table[case.key][quantity]))
    return np.median([np.var(v, axis=0, ddof=1).sum() for v in several.values() if len(v) > 2])


@pytest.mark.parametrize("name", list(bias.LAWS), ids="-".join)
def test_laws_bound_the_runs(module, table, name):
    """The mean error of softer runs over the seedings is within the law."""
    scene, scheme = name
    quantity, _ = module("economy").QUANTITIES[scene]
    law, groups = bias.LAWS[name], {}
    cases = [case for case in module("economy").GROUPS[scene]() if case.scheme == scheme]
    for case in cases:
        stiff = reference(case, law, cases)
        if stiff is not None:
            key = case.E, case.held, stiff.E, case.keywords.get("cell")
            groups.setdefault(key, []).append((case, stiff))
    # Run-outs vary between seedings: two standard errors of a difference of means are allowed.
    scatter = variance(cases, table, quantity) if scene == "column_collapse" else 0.0
    compared = 0
    for key, pairs in groups.items():
        found = [
            np.array([table[case.key][quantity] for case in runs])
            for runs in zip(*pairs, strict=True)
        ]
        soft, stiff = (numbers.mean(axis=0) for numbers in found)
        bound = law(bias.pressure_strain(pairs[0][0].build()))
        slack = 2.0 * np.sqrt(scatter * sum(1 / len(numbers) for numbers in found))
        assert np.linalg.norm(soft - stiff) <= bound * np.linalg.norm(stiff) + slack, key
        compared += np.isfinite(bound)
    assert compared >= 2


def test_what_runs_are_said_to_cost_was_measured(module):
    """The table in the package is that of the committed results, and its numbers come back."""
    script, results = module("speed"), json.loads((FOLDER / "results" / "speed.json").read_text())
    known = script.step_times(results)
    assert known == json.loads(script.TIMES.read_text())
    for dim in (2, 3):
        assert known[str(dim)].keys() == script.SCHEMES.keys()
        for name, scheme in script.SCHEMES.items():
            for per_cell, rows in known[str(dim)][name].items():
                for points, ns in rows:
                    found = nanoseconds(scheme, dim, points, int(per_cell))
                    assert found == pytest.approx(ns, rel=1e-12)


def test_figures_are_drawn_from_the_modulus_of_the_document(module):
    """With a tolerance, which is at least the one that can be promised."""
    script = module("suggested")
    assert [script.tolerance_of("dunatunga2015", name) for name in ("3", "4")] == [0.13, 0.02]
    settings = gr.papers.Settings(tolerance=0.05)
    paper = gr.papers.document("dunatunga2015")
    assert Runs(settings, paper.figures["4"].E, paper.E).E == 1e9
    assert Runs(gr.papers.Settings(), paper.figures["4"].E, paper.E).E == 1e7


@pytest.mark.slow
def test_draining_and_quick_tables_run(module, tmp_path):
    module("draining").main(["--quick", "--out", str(tmp_path / "draining.json")])
    rows = json.loads((tmp_path / "draining.json").read_text())["silo"]
    assert rows[2]["cells"] < 0.6 * rows[0]["cells"]
    out = tmp_path / "economy.json"
    module("economy").main(["--quick", "--only", "silo", "--out", str(out)])
    assert len(json.loads(out.read_text())["rows"]) == 1

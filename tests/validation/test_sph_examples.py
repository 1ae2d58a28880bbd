"""The examples of chapter 5 of Hurley's thesis: small forms in the plane, and the table of all."""

import json
from pathlib import Path

import numpy as np
import pytest

import granular as gr
from granular import sph

RESULTS = Path(__file__).parents[2] / "benchmarks" / "results" / "sph_examples.json"


def reach(simulation, share=0.99):
    state = simulation.state
    order = np.argsort(state.x[:, 0])
    held = np.cumsum(state.mass[order])
    return state.x[order[np.searchsorted(held, share * held[-1])], 0]


@pytest.mark.parametrize("phi", [20.0, 30.0])
def test_a_slope_stays_below_the_friction_and_creeps(phi):
    """A small box, so that it empties soon: the slope that is left is below phi, and falls."""
    scene = gr.scenes.slump_sph(
        phi_deg=phi, length=0.3, height=0.15, orifice=0.06, duration=4.0, settle=0.4
    )
    simulation = gr.Simulation(scene)
    angles = []

    def look(running):
        state = running.state
        top = gr.measure.surface(state, above=0.0, along="x")
        kept = (top.x > 0.03) & (top.x < 0.21) & np.isfinite(top.top)
        angles.append(-np.degrees(np.arctan(np.polyfit(top.x[kept], top.top[kept], 1)[0])))

    simulation.run(every=0.5, hooks=(look,))
    assert simulation.counts["dropped"] > 0.2 * scene.n_points
    assert 0.5 * phi < angles[-1] < angles[-3] < phi


def test_dilation_shortens_a_collapse_and_taller_columns_run_farther():
    found = {}
    for aspect in (1.8, 3.2):
        for dilation in (0.0, 0.5):
            grains = sph.grit.replace(dilation=dilation)
            scene = sph.scenes.column_collapse(aspect=aspect, material=grains, duration=1.2)
            found[aspect, dilation] = reach(gr.Simulation(scene).run())
    assert found[1.8, 0.5] < found[1.8, 0.0] and found[3.2, 0.5] < found[3.2, 0.0]
    assert found[3.2, 0.0] > 1.2 * found[1.8, 0.0]


def test_an_inclined_collapse_runs_farther_down_a_steeper_slope():
    """In the plane, which has no side walls; those are in the table."""
    far = {}
    for angle, dilation in ((0.0, 0.0), (16.0, 0.0), (16.0, 0.5)):
        scene = gr.scenes.inclined_collapse(
            angle_deg=angle,
            dilation=dilation,
            side_walls=False,
            width=0.0,
            duration=0.7,
            settle=0.3,
        )
        simulation = gr.Simulation(scene).run()
        assert simulation.counts["dropped"] == 0
        far[angle, dilation] = reach(simulation)
    assert far[0.0, 0.0] < far[16.0, 0.5] < far[16.0, 0.0]


@pytest.mark.slow
def test_side_walls_shorten_an_inclined_collapse():
    far = {}
    for side_walls, width in ((False, 0.04), (True, 0.1)):
        scene = gr.scenes.inclined_collapse(
            angle_deg=10.0, side_walls=side_walls, width=width, reach=0.8, duration=0.8
        )
        far[side_walls] = reach(gr.Simulation(scene, threads=2).run())
    assert far[True] < far[False]


@pytest.fixture(scope="module")
def table():
    return json.loads(RESULTS.read_text())


def rows(table, kind, **entries):
    found = [row for row in table["rows"] if row["kind"] == kind]
    return [row for row in found if all(row.get(k) == v for k, v in entries.items())]


def test_the_table_has_the_orderings_of_the_thesis(table):
    for angle, found in table["inclined"].items():
        assert len(found) == 4, angle
        far = {name: quantile for name, (quantile, _) in found.items()}
        for walls in ("periodic", "side walls"):
            assert far[f"{walls}, beta 0.5"] < far[f"{walls}, beta 0"], angle
        for beta in ("0", "0.5"):
            assert far[f"side walls, beta {beta}"] < far[f"periodic, beta {beta}"], angle

"""The cell-averaged density in flows: mass of neighbouring columns, light nodes, stiffness."""

import numpy as np
import pytest
from scenes_by_hand import scene_with

import granular as gr
from granular.measure.bulk import Bulk
from granular.measure.cell_sums import CellSums
from granular.scenes._build import block, gravity_down, smooth_sides
from granular.verify import density_correction_budget, layers

SCHEME = gr.schemes.cell_averaged


def mass_over_top(state, least=8):
    """Mass of each column of cells over that of a full one up to its highest point.

    Only columns from the axis to the first one of less than `least` cells.
    """
    grid = state.scene.grid
    column = np.floor((state.x[:, 0] - grid.lower[0]) / grid.cell).astype(int)
    mass = np.bincount(column, state.mass)
    top = np.zeros(len(mass))
    np.maximum.at(top, column, state.x[:, 1] - grid.lower[1])
    low = np.flatnonzero(top < least * grid.cell)
    end = low[0] if len(low) else len(mass)
    return mass[:end] / (state.scene.material.rho_c * grid.cell * top[:end])


@pytest.mark.parametrize("jitter", [0.5, pytest.param(0.0, marks=pytest.mark.slow)])
def test_neighbouring_columns_of_a_heap_hold_the_same(jitter):
    """Columns at the axis of a tall column that collapsed, under a flat surface.

    A difference of one point in each cell, which is left to chance, makes 0.02 (rms) in a column of
    twenty cells with 16 points: sqrt(2/20)/16. Six seeds have 0.015 to 0.035, and 0.028 to 0.059 as
    the largest of the fifteen differences.
    """
    scene = gr.scenes.column_collapse(aspect=4.0, scheme=SCHEME, E=1e6, jitter=jitter, seed=1)
    state = gr.Simulation(scene, threads=1).run(until=1.5, monitor=False).state
    filled = mass_over_top(state)[:16]
    assert len(filled) == 16
    assert np.sqrt(np.mean(np.diff(filled) ** 2)) < 0.04


@pytest.mark.parametrize("seeds", [1, pytest.param(3, marks=pytest.mark.slow)])
def test_points_in_simple_shear_are_left_where_they_are(seeds):
    """A layer in 3D neither rises nor oscillates as a whole.

    An exchange across all faces lifts it by 1 % and makes errors of the pressure of 0.1. Here that
    error scatters between runs, 0.041 +- 0.014 in fourteen of them, so that the mean of some has a
    bound three of its deviations above.
    """
    flows = layers.several(
        5.0, range(seeds), steady=True, height=0.1, columns=4, across=4, points=8, scheme=SCHEME
    )
    assert all(abs(flow.height - 1) < 0.003 and flow.error < 0.01 for flow in flows)
    assert np.mean([flow.pressure for flow in flows]) < 0.041 + 3 * 0.014 / np.sqrt(seeds)


def hollow(dim, node, far):
    """A full box; the points of the cells around a node lie `far` to `far`/2 cells from their far
    corners. The lower half of the box has twice the pressure of the upper one."""
    n, cell = 6, 0.1
    walls = [gr.Wall(d, end, kind="free_slip") for d in range(dim) for end in (0.0, n * cell)]
    scene = scene_with(
        grid=gr.Grid((0.0,) * dim, cell, (n,) * dim),
        fills=(gr.Fill(gr.Box((0.0,) * dim, (n * cell,) * dim), 2**dim, jitter=0.6),),
        material=gr.materials.glass_beads.replace(E=1e6),
        scheme=SCHEME,
        walls=tuple(walls),
        gravity=0.0,
    )
    sim = gr.Simulation(scene, threads=1)
    points = np.flatnonzero(sim.buffers["id"] >= 0)
    r = sim.buffers["x"][:, points].T / cell - node
    near = (abs(r) < 1).all(axis=1)
    assert near.any()
    r[near] = np.sign(r[near]) * (1 - far * (0.5 + 0.5 * abs(r[near])))
    c = np.where(r[:, -1] < 0, 2e-3, 1e-3)
    sim.buffers["x"][:, points] = ((r + node) * cell).T
    sim.buffers["log_density"][0, points] = c
    sim.buffers["stress"][:3, points] = -scene.material.K * c
    return sim


NODES = [(0, 3), (6, 3), (3, 0), (3, 3), (0, 0, 3), (6, 0, 3), (3, 6, 3), (0, 3, 3), (3, 3, 3)]


@pytest.mark.parametrize("far", [1e-1, 1e-3, 1e-9])
@pytest.mark.parametrize("node", NODES, ids=str)
def test_a_node_with_hardly_any_mass_is_not_thrown(node, far):
    """At symmetry planes, where two meet, and inside: the forces go with the mass.

    Material released from the pressure p moves at p/(rho_c c_w), at a free surface at twice that.
    """
    sim = hollow(len(node), np.array(node), far)
    grains, before = sim.scene.material, sim.state
    sim.step(100)
    state = sim.state
    assert len(state.id) == len(before.id)
    assert abs(state.v).max() < 2 * before.pressure.max() / (grains.rho_c * grains.wave_speed)
    assert state.pressure.max() < 2 * before.pressure.max()


@pytest.mark.parametrize("seed", [1, 4, 7])
def test_light_points_at_the_surface_give_a_body_no_energy(seed):
    """An elastic disc that moves through the cells, with noise, at the longest step of the scheme.

    The points of the cells that its surface cuts have as little as a tenth of the mass of others.
    """
    c, cell = gr.Elastic(E=1e6, rho_c=1500.0).wave_speed, 0.1
    drift = 0.025 * c
    scene = scene_with(
        grid=gr.Grid((0.0, 0.0), cell, (16, 16), periodic=(True, True)),
        fills=(gr.Fill(gr.Sphere(0.43, center=(0.8, 0.8)), 16, jitter=1.0),),
        material=gr.Elastic(E=1e6, rho_c=1500.0),
        scheme=SCHEME.replace(dt=SCHEME.cfl * cell / (c + drift)),
        seed=seed,
        gravity=0.0,
    )
    sim = gr.Simulation(scene, threads=1)
    points = np.flatnonzero(sim.buffers["id"] >= 0)
    noise = np.random.default_rng(seed).standard_normal((2, len(points)))
    mean = np.array([[0.8], [0.6]]) * drift
    sim.buffers["v"][:, points] = mean + 1e-6 * c * noise

    def own_energy():
        state = sim.state
        v = state.v - np.average(state.v, axis=0, weights=state.mass)
        return (state.mass * (v**2).sum(axis=1)).sum() / 2 + gr.measure.energy(state).elastic

    sim.step(20)
    before = own_energy()
    sim.step(2000)
    assert own_energy() < before


@pytest.mark.parametrize(
    ("moduli", "seeds", "bound"),
    [((1e5, 1e6), 2, 0.03), pytest.param((1e5, 1e6, 1e7), 4, 0.02, marks=pytest.mark.slow)],
)
def test_run_out_hardly_depends_on_the_stiffness(moduli, seeds, bound):
    """Toes of single runs scatter by 0.013 with the seeding. The run-out of 99.9 % of the mass is
    that of four points, which single thrown points change by 0.1."""
    reach = []
    for E in moduli:
        scenes = [
            gr.scenes.column_collapse(aspect=1.0, scheme=SCHEME, E=E, jitter=0.5, seed=seed)
            for seed in range(seeds)
        ]
        states = [
            gr.Simulation(scene, threads=1).run(until=1.0, monitor=False).state for scene in scenes
        ]
        reach.append(np.mean([gr.measure.runout(state).toe for state in states]))
    assert np.ptp(reach) < bound * np.mean(reach)


def orifice(scheme, across=12, cell=0.01, E=1e6):
    """A quarter of a flat-bottomed bin over a round orifice, stepped in cells."""
    radius, width, height = across / 2, 14, 20
    filled = block(
        cell,
        (width, width, height + 3),
        (width * cell, width * cell, height * cell),
        open_sides={"z-"},
        points_per_cell=8,
        jitter=0.6,
        lithostatic=True,
    )
    walls = []
    for row in range(width):
        free = cell * round(np.sqrt(max(radius**2 - (row + 0.5) ** 2, 0.0)))
        span = (row * cell, (row + 1) * cell)
        walls.append(gr.Wall(2, 0.0, kind="no_slip", span=((free, width * cell), span)))
        if free:
            walls.append(gr.Wall(2, 0.0, kind="no_slip", span=((0.0, free), span), opens_at=0.0))
    return gr.Scene(
        name="orifice",
        **filled,
        material=gr.materials.glass_beads.replace(E=E),
        scheme=scheme,
        walls=(*walls, *smooth_sides(filled["grid"])),
        gravity=gravity_down(3, 9.8),
        duration=0.3,
    )


def discharge(scene):
    """Rate of discharge of the quarter [kg/s] between 0.1 s and 0.3 s."""
    sim = gr.Simulation(scene, threads=1)
    times = np.linspace(0.1, 0.3, 7)
    mass = [sim.run(until=float(time), monitor=False).state.mass.sum() for time in times]
    return -np.polyfit(times, mass, 1)[0]


def test_the_update_of_velocities_adds_no_momentum():
    """Whatever the shear rates of the cells; over the momenta of all points without their signs."""
    rows = density_correction_budget.density_correction_budget_quick(SCHEME)
    (row,) = (row for row in rows if row.quantity.startswith("momentum given"))
    assert row.passed


@pytest.mark.slow
def test_an_orifice_of_twelve_cells():
    """Within 20 % of the default scheme, and of 5 % whatever the step.

    With E = 1e7 it is 0.77 of the default (docs/reports/accuracy_of_schemes.md).
    """
    rate = discharge(orifice(SCHEME))
    assert rate == pytest.approx(discharge(orifice(gr.schemes.default)), rel=0.2)
    assert discharge(orifice(SCHEME.replace(cfl=0.25))) == pytest.approx(rate, rel=0.05)
    stiff = [discharge(orifice(scheme, E=1e7)) for scheme in (SCHEME, gr.schemes.default)]
    assert stiff[0] / stiff[1] == pytest.approx(0.77, abs=0.05)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("scheme", "low", "high"), [("cell_averaged", 0, 0.003), ("default", 0.008, 0.02)]
)
def test_density_drift_is_the_mass_in_excess(scheme, low, high):
    """In a 3D orifice the indicator tells what the cells hold; with averaged cells it is 0."""
    scene = orifice(getattr(gr.schemes, scheme))
    state = gr.Simulation(scene, threads=1).run(monitor=False).state
    drift = gr.measure.density_drift(state)
    assert low <= drift < high
    bulk = Bulk(CellSums.from_state(state), packed=0.9)
    first = [side.start for side in bulk.box]
    cells = np.floor((state.x - scene.grid.lower) / scene.grid.cell).astype(int) - first
    deep = bulk.cells[tuple(cells.T)]
    full = scene.material.rho_c * bulk.cell_volume
    density = np.average(np.exp(state.log_density[deep]), weights=state.mass[deep])
    assert bulk.mass[bulk.cells].mean() / (full * density) - 1 == pytest.approx(drift, abs=0.01)

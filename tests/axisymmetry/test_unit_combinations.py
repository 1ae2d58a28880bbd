"""Rings with the other parts of a scene: threads, restarts, precision, sleep, inflow, pressure."""

import math

import numpy as np
import pytest
from scenes_by_hand import scene_with

import granular as gr

CELL = 0.02


def heap(**changes):
    """A cylinder that collapses, coarse and short."""
    return gr.scenes.cylinder_collapse(
        aspect=1.0, radius=0.12, axisymmetric=True, cell=CELL, ramp=0.0, E=1e5, **changes
    )


def bits(sim):
    return {name: array.tobytes() for name, array in sim.checkpoint().arrays.items()}


@pytest.mark.parametrize("nonlocal_law", [False, True])
def test_threads_and_a_restart_change_no_bit(nonlocal_law):
    grains = gr.materials.NGF(E=1e5, A=0.5, d=5e-3, t0=1e-4)
    scene = heap(**({"material": grains} if nonlocal_law else {}))
    one, three = gr.Simulation(scene, threads=1), gr.Simulation(scene, threads=3)
    one.step(300)
    three.step(150)
    resumed = gr.Simulation.from_checkpoint(scene, three.checkpoint(), threads=2)
    resumed.step(150)
    assert bits(one) == bits(resumed)


def test_single_precision_is_as_near_as_in_a_plane():
    """The height of the collapse after 0.15 s is the same to a hundredth of a cell."""
    tops = []
    for precision in ("double", "single"):
        sim = gr.Simulation(heap(scheme=gr.schemes.default.replace(precision=precision)), threads=1)
        sim.run(until=0.15)
        tops.append(np.average(sim.state.x[:, 1], weights=sim.state.mass))
    assert tops[1] == pytest.approx(tops[0], abs=0.01 * CELL)


def test_a_heap_at_rest_falls_asleep():
    scheme = gr.schemes.default.replace(sleep_speed=0.02)
    sim = gr.Simulation(heap(scheme=scheme), threads=1)
    sim.run(until=1.5)
    before = sim.state.x
    sim.run(until=1.6)
    assert (sim.state.x == before).all(axis=1).mean() > 0.8


def test_material_enters_at_its_rate():
    """A stream along the axis, of the radius 0.1 m, and one through a cylinder of 0.3 m."""
    grid = gr.Grid((0.0, 0.0), CELL, (15, 25), axisymmetric=True, open_sides={"y-"})
    stream = gr.Inflow(gr.Box((0.0, 0.4), (0.1, 0.44)), (0.0, -0.5), 4, density=1000.0)
    inwards = gr.Inflow(gr.Box((0.26, 0.1), (0.3, 0.2)), (-0.5, 0.0), 4, density=1000.0)
    for inflow, area in ((stream, math.pi * 0.1**2), (inwards, 2 * math.pi * 0.3 * 0.1)):
        scene = scene_with(grid=grid, fills=(), inflows=(inflow,), gravity=0.0)
        sim = gr.Simulation(scene, threads=1)
        sim.run(until=0.1)
        assert inflow.rate_in(grid, 1500.0) == pytest.approx(1000.0 * 0.5 * area, rel=0.04)
        assert sim.inflows[0].mass == pytest.approx(1000.0 * 0.5 * area * 0.1, rel=0.06)


@pytest.mark.parametrize("axis", [0, 1])
def test_a_wall_keeps_a_pressure_on_rings(axis):
    """On the lid of a cylinder, or on its side: the force is the pressure times the area."""
    cells, pressure = 10, 1000.0
    size = cells * CELL
    grid = gr.Grid((0.0, 0.0), CELL, (cells, cells), axisymmetric=True)
    walls = [gr.Wall(1, 0.0, kind="free_slip")]
    for k in (0, 1):
        kept = {"pressure": pressure} if k == axis else {}
        walls.append(gr.Wall(k, size, kind="free_slip", **kept))
    scene = scene_with(
        grid=grid,
        fills=(gr.Fill(gr.Box((0.0, 0.0), (size, size)), 4, jitter=0.3),),
        material=gr.MuI(E=1e6),
        walls=tuple(walls),
        gravity=0.0,
    )
    sim = gr.Simulation(scene, threads=1, wall_forces=True)
    sim.run(until=0.3)
    before, start = sim.walls[1 + axis].impulse.copy(), sim.time
    sim.run(until=0.4)
    force = (sim.walls[1 + axis].impulse[axis] - before[axis]) / (sim.time - start)
    area = math.pi * size**2 if axis else 2 * math.pi * size * size
    assert force == pytest.approx(pressure * area, rel=0.02)
    assert sim.state.pressure.mean() == pytest.approx(pressure, rel=0.05)


def widened(dt, parameters, gradient, log_density, stress, shear_rate, history):
    history[0] += gradient[0, 0] + gradient[1, 1] + gradient[2, 2]
    history[1] += gradient[2, 2]


IN_C = """
void update(int64_t n, int64_t dim, double dt, const double *parameters, const double *gradient,
            const double *log_density, double *stress, double *shear_rate, double *history)
{
    for (int64_t k = 0; k < n; k++) {
        history[k] += gradient[k] + gradient[4 * n + k] + gradient[8 * n + k];
        history[n + k] += gradient[8 * n + k];
    }
}
"""


@pytest.mark.parametrize("language", ["numpy", "numba", "c"])
def test_a_users_law_finds_the_hoop_strain(language):
    """Sum of the strains of an elastic ring that spreads: ln(rho0/rho), and ln(r/r0) of hoops."""
    if language == "numba":
        pytest.importorskip("numba")
    law = gr.materials.from_function(
        IN_C if language == "c" else widened,
        compiler="numba" if language == "numba" else None,
        name="widened",
        history={"sum": 0.0, "hoop": 0.0},
        E=1e5,
        bears_tension=True,
        axisymmetric=True,
    )
    grid = gr.Grid((0.0, 0.0), CELL, (30, 10), axisymmetric=True)
    ring = gr.Fill(gr.Box((0.2, 0.05), (0.3, 0.15)), 4, velocity=(1.0, 0.0))
    scene = scene_with(grid=grid, fills=(ring,), material=law, gravity=0.0)
    sim = gr.Simulation(scene, threads=1)
    start = sim.state
    sim.step(50)
    state = sim.state
    growth = np.log(state.x[:, 0] / start.x[:, 0])
    assert growth.min() > 0.01
    assert state.history[:, 1] == pytest.approx(growth, rel=0.05)
    lost = np.log(start.density / state.density)
    assert np.abs(state.history[:, 0] - lost).max() < 0.02 * np.abs(lost).max()

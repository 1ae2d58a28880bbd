"""Runs that ranks share have the bits of one process: for any division, through restarts."""

import time

import numpy as np
import pytest
from same_bits import bits, stepped

import granular as gr
from granular.mpm import engine as core
from granular.ranks.part import Part

GRAINS = gr.materials.glass_beads.replace(E=1e6)


def column(**numbers):
    """A column that collapses, of 512 points."""
    defaults = {"cell": 0.025, "points_per_cell": 4, "material": GRAINS, "duration": 0.4}
    return gr.scenes.column_collapse(**(defaults | numbers))


def shared(scene, size, *steps, **options):
    """Data of a restart after steps by so many ranks."""
    with gr.ranks.threads(size) as comm:
        sim = gr.Simulation(scene, comm=comm, **options)
        for n in steps:
            sim.step(n)
        return bits(sim)


@pytest.mark.parametrize("dim", [2, 3])
def test_every_scheme_with_blocks_at_random(combination, dim, small_scene, scattered):
    scene = small_scene("walls", dim, combination, E=1e5)
    alone = bits(stepped(scene, 60))
    for size in (2, 5):
        with scattered(size):
            assert shared(scene, size, 25, 35, threads=size % 2 + 1) == alone


@pytest.mark.parametrize("size", [1, 2, 3, 4])
def test_parts_of_the_curve_over_a_collapse(size):
    scene = column()
    assert shared(scene, size, 400) == bits(stepped(scene, 400))


def discs():
    """An elastic column of rings with averaged cells, some of which have no points.

    Spare slots of empty cells at the axis had NaN, which points that entered them met.
    """
    return gr.Scene(
        name="rings",
        grid=gr.Grid((0.0, 0.0), 0.02, (3, 16), open_sides=("x+", "y+"), axisymmetric=True),
        fills=(gr.Fill(gr.Box((0.0, 0.0), (0.03, 0.2)), 4, velocity=(0.5, -0.4), jitter=0.5),),
        material=gr.materials.Elastic(E=1e4),
        scheme=gr.Scheme(basis="linear", transfer="tpic", density=gr.CellAveragedDensity()),
        walls=(gr.Wall(1, 0.0, kind="coulomb", friction=0.4),),
        gravity=(0.0, -9.81),
        duration=1.0,
        seed=77,
    )


SCENES = {
    "rings with averaged cells": discs,
    "open sides": lambda: gr.scenes.silo(cell=0.05, jitter=0.3),
    "periodic": lambda: gr.scenes.incline(columns=12, jitter=0.4),
    "rings": lambda: gr.scenes.cylinder_collapse(cell=0.05, axisymmetric=True),
    "space": lambda: gr.scenes.cylinder_collapse(cell=0.1),
    "single": lambda: column(scheme=gr.Scheme(precision="single")),
    # where it explodes, an empty cell that is not active is inside the material (face_drops)
    "exploding": lambda: gr.scenes.silo(cell=0.05, material=GRAINS.replace(E=1e4)),
    "two materials": lambda: column().replace(
        fills=(
            gr.Fill(gr.Box((0.0, 0.0), (0.1, 0.2)), 4),
            gr.Fill(gr.Box((0.1, 0.0), (0.2, 0.2)), 4, material=GRAINS.replace(rho_c=1000.0)),
        )
    ),
}


@pytest.mark.parametrize("name", SCENES)
def test_kinds_of_scenes(name, scattered):
    scene, steps = SCENES[name](), 400 if name == "exploding" else 150
    with scattered(3):
        assert shared(scene, 3, steps) == bits(stepped(scene, steps))


LINEAR = gr.Scheme(basis="linear", transfer="flip", density=gr.ParticleDensity())
SOIL = gr.materials.NGF(
    E=1.5e5, elasticity="hencky", A=0.48, t0=1e-3, mu_s=0.38, mu_2=0.64, I0=0.278, d=4e-3
)
DIFFUSIONS = {
    "implicit": (2, gr.Scheme(dt=1e-4), {"method": "implicit", "substeps": 3}),
    "explicit": (2, gr.Scheme(dt=1e-4), {"method": "explicit", "stencil": "isotropic"}),
    "rkl2": (2, LINEAR, {"method": "rkl2", "stencil": "isotropic"}),
    "space": (3, gr.Scheme(), {}),
}


@pytest.mark.parametrize("name", DIFFUSIONS)
def test_the_nonlocal_law_with_runs_of_cells_at_random(name, scattered):
    dim, scheme, fluidity = DIFFUSIONS[name]
    shape = (64, 30) if dim == 2 else (13, 11, 14)
    periodic = (True,) + (False,) * (dim - 1)
    heights = (0.2,) if dim == 2 else (0.11, 0.08)
    scene = gr.Scene(
        name="slope",
        grid=gr.Grid((0.0,) * dim, 0.01, shape, periodic=periodic),
        fills=(gr.Fill(gr.Box((0.0,) * dim, (shape[0] * 0.008, *heights)), 2**dim, jitter=0.5),),
        material=SOIL,
        scheme=scheme.replace(fluidity=gr.Fluidity(initial=0.5, **fluidity)),
        walls=(gr.Wall(dim - 1, 0.0),),
        gravity=(6.0, *(0.0,) * (dim - 2), -7.7),
        duration=1.0,
        seed=2,
    )
    alone = bits(stepped(scene, 50))
    assert np.any(stepped(scene, 50).state.g > 0)
    for size in (2, 5):
        with scattered(size):
            assert shared(scene, size, 20, 30) == alone


def test_impulses_on_walls_and_a_wall_that_keeps_a_pressure(scattered):
    grid = gr.Grid((0.0, 0.0), 0.01, (6, 20), periodic=(True, False))
    fill = gr.Fill(gr.Box((0.0, 0.0), (0.06, 0.2)), 4, jitter=0.6)
    moving = gr.Wall(1, 0.2, velocity=(0.5, 0.0), pressure=1000.0)
    scene = gr.Scene(
        name="shear",
        grid=grid,
        fills=(fill,),
        material=GRAINS,
        walls=(gr.Wall(1, 0.0), moving),
        gravity=(0.0, 0.0),
        duration=1.0,
    )
    alone = stepped(scene, 200)
    assert alone.walls[1].displacement != 0
    with scattered(4), gr.ranks.threads(3) as comm:
        sim = gr.Simulation(scene, comm=comm)
        sim.step(100)
        with scattered(5):
            sim.balance(1.0)
        sim.step(50)
        sim = gr.Simulation.from_checkpoint(scene, sim.checkpoint(), comm=comm)
        sim.step(50)
        assert bits(sim) == bits(alone)
        assert np.array_equal(sim.walls[1].impulse, alone.walls[1].impulse)


def test_points_that_leave_count_once():
    scene = gr.scenes.silo(cell=0.05, material=GRAINS.replace(E=1e5))
    alone = stepped(scene, 600)
    scalars, _ = shared(scene, 3, 600)
    assert alone.checkpoint().scalars["dropped"] > 0
    assert scalars == alone.checkpoint().scalars


def test_blocks_change_their_owners_in_mid_run(scattered):
    scene = column()
    with gr.ranks.threads(3) as comm:
        sim = gr.Simulation(scene, comm=comm)
        sim.step(300)
        for seed in (1, 2):
            before = sim.points_of_ranks
            with scattered(seed):
                assert sim.balance(1.0) and sim.points_of_ranks != before
            sim.step(50)
        assert sim.balance(1.1) and max(sim.points_of_ranks) < max(before)
        assert not sim.balance(1.1)
        assert sim.n_points == sum(sim.points_of_ranks) == 512
        assert bits(sim) == bits(stepped(scene, 400))


def test_records_do_not_know_the_number_of_ranks(tmp_path):
    scene = column(duration=0.1)
    alone = gr.Simulation(scene).run(every=0.02, save=tmp_path / "alone.h5")
    with gr.ranks.threads(3) as comm:
        gr.Simulation(scene, comm=comm).run(every=0.02, save=tmp_path / "three.h5")
    with gr.open(tmp_path / "alone.h5") as a, gr.open(tmp_path / "three.h5") as b:
        assert len(a) == len(b) == 6
        for one, other in zip(a, b, strict=True):
            assert one.fields.keys() == other.fields.keys()
            assert all(np.array_equal(one.fields[n], other.fields[n]) for n in one.fields)
    alone.run(until=0.2)
    with gr.ranks.threads(2) as comm:
        resumed = gr.Simulation.resume(tmp_path / "three.h5", comm=comm).run(until=0.2)
        assert bits(resumed) == bits(alone)
        point = resumed.checkpoint()
    again = gr.Simulation.resume(tmp_path / "three.h5")
    assert bits(again) == bits(alone)
    with gr.ranks.threads(4) as comm:
        sim = gr.Simulation.from_checkpoint(scene, point, comm=comm)
        assert bits(sim) == bits(alone)


def mean_height(state):
    return float(np.sum(state.mass * state.x[:, 1])), float(np.sum(state.mass))


def test_measures_of_the_parts_and_of_the_whole():
    scene = column()
    with gr.ranks.threads(3) as comm:
        sim = gr.Simulation(scene, comm=comm)
        sim.step(50)
        parts = np.sum(sim.on_each_rank(mean_height), axis=0)
        assert parts == pytest.approx(mean_height(sim.state), rel=1e-12)
        assert np.array_equal(sim.state.id, np.arange(512))
        with pytest.raises(ValueError, match="buffers: each rank has those of its own points"):
            _ = sim.buffers


def count(state):
    return state.n


def interrupted(state):
    if state.id[0] == 0:
        raise KeyboardInterrupt
    return "stale"


def test_an_interrupted_request_leaves_no_answers_behind():
    with gr.ranks.threads(3) as comm:
        sim = gr.Simulation(column(), comm=comm)
        for function, error in (
            (interrupted, KeyboardInterrupt),
            (lambda _: sim.state, RuntimeError),
        ):
            with pytest.raises(error):
                sim.on_each_rank(function)
            assert sum(sim.on_each_rank(count)) == 512
    with pytest.raises(gr.SimulationError, match="has ended"):
        _ = sim.state


def test_the_failure_of_one_rank_ends_all_and_names_the_point(monkeypatch):
    def spoil(part):
        if part._communicator.rank == 1:
            part.simulation.buffers["v"][0, part.simulation._buffers["id"] >= 0] = np.nan

    monkeypatch.setattr(Part, "traffic", spoil)
    with gr.ranks.threads(3, timeout=20) as comm:
        sim = gr.Simulation(column(), comm=comm)
        sim.step(20)
        _ = sim.traffic
        with pytest.raises(gr.SimulationError, match="not finite: point") as failure:
            sim.step(20)
        assert failure.value.point >= 0
        with pytest.raises(gr.SimulationError, match="has failed in a step before"):
            sim.step(1)


def fluid(dt, parameters, gradient, log_density, stress, shear_rate, history):
    stress[:3] = -np.maximum(parameters[0] * log_density, 0.0)
    stress[3:] = 0.0


def brittle(dt, parameters, gradient, log_density, stress, shear_rate, history):
    if (log_density > 1e-3).any():
        raise ArithmeticError("it breaks")


def test_user_defined_laws_and_the_error_of_one(scattered):
    scene = column(material=gr.materials.from_function(fluid))
    with scattered(7):
        assert shared(scene, 3, 100) == bits(stepped(scene, 100))
    scene = column(material=gr.materials.from_function(brittle))
    with scattered(7), gr.ranks.threads(3, timeout=20) as comm:
        sim = gr.Simulation(scene, comm=comm)
        with pytest.raises(ArithmeticError, match="it breaks"):
            sim.step(400)
        with pytest.raises(gr.SimulationError, match="has failed in a step before"):
            sim.step(1)


def test_a_rank_that_does_not_answer_is_named(monkeypatch):
    def sleep(part):
        if part._communicator.rank == 1:
            time.sleep(1.0)

    monkeypatch.setattr(Part, "traffic", sleep)
    with gr.ranks.threads(2, timeout=0.2) as comm:
        sim = gr.Simulation(column(), comm=comm)
        with pytest.raises(gr.ranks.LostRankError, match="rank 1 of the run has not answered"):
            _ = sim.traffic
        with pytest.raises(gr.ranks.LostRankError, match="start the run again"):
            _ = sim.state
    time.sleep(1.2)  # the thread of rank 1 ends without an error, too


def test_wrong_communicators():
    with pytest.raises(TypeError, match="comm = 3 must be a communicator"):
        gr.Simulation(column(), comm=3)
    with gr.ranks.threads(1) as comm, pytest.raises(ValueError, match="material point method"):
        gr.Simulation(gr.scenes.incline_sph(height=0.05), comm=comm)
    with gr.ranks.threads(1) as comm, pytest.raises(TypeError, match="wall_forces"):
        gr.Simulation(column(), comm=comm, wall_forces="no")
    with pytest.raises(ValueError, match="size = 0"), gr.ranks.threads(0):
        pass
    with pytest.raises(ValueError, match="timeout = 1e"), gr.ranks.threads(1, timeout=1e10):
        pass


class Confused:
    """A link that answers with one number only."""

    def __init__(self, number):
        self.number = number

    def exchange(self, messages):
        for _, _, into in messages:
            np.frombuffer(into, dtype=np.int64)[:] = self.number
        return True

    def sum(self, view):
        return True

    largest = sum


@pytest.mark.parametrize("number", [-1, 2**40, 2**61 + 1])
def test_confused_messages_end_in_an_error(number):
    sim = gr.Simulation(column())
    engine = core.build(sim.scene, 1.0)
    blocks = int(np.prod(engine.blocks(8)))
    engine.share(Confused(number), 0, 2, 8, np.arange(blocks, dtype=np.int32) % 2)
    engine.bind(core.initial_buffers(engine, ()), 0, True)
    with pytest.raises(RuntimeError, match="does not answer"):
        engine.regroup()
    assert engine.blocks(2**31 - 1) == (1, 1, 1)


def test_spare_slots_are_finite():
    sim = gr.Simulation(discs())
    sim.step(20)
    assert all(np.isfinite(array).all() for array in sim.buffers.values())


def test_a_point_half_a_cell_below_a_periodic_end_can_be_grouped_again():
    grid = gr.Grid((-0.37, -0.37), 0.1, (3, 400), periodic=(True, False))
    fill = gr.Fill(gr.Box((-0.37, -0.37), (-0.07, 39.63)), 1)  # so many that buffers grow
    scheme = gr.Scheme(basis="ugimp", transfer="apic", density=gr.ParticleDensity())
    scene = gr.Scene(
        name="periodic",
        grid=grid,
        fills=(fill,),
        material=GRAINS,
        scheme=scheme,
        walls=(gr.Wall(1, -0.37),),
        gravity=(0.0, -9.81),
        duration=1.0,
    )
    assert shared(scene, 2, 5) == bits(stepped(scene, 5))

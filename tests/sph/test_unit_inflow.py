"""Inflows of SPH: what is refused, growing memory, threads, restarts, records, cost and files."""

from dataclasses import replace

import numpy as np
import pytest
from inlets import fed_gas
from refusals import refused
from same_bits import fields

import granular as gr
from granular import Gravity, sph
from granular.run.machine import Machine
from granular.sph import simulation

DX = 0.01
NOZZLE = gr.Box((0.06, 0.3), (0.14, 0.4))


def inlet(region=NOZZLE, velocity=(0.0, -1.0), points=1, **more):
    return gr.Inflow(region, velocity, points, **{"driven": True} | more)


def scene_of(*, inflows=None, **more):
    """A jet that falls on a bed."""
    return sph.Scene(
        **{
            "name": "jet",
            "grid": gr.Grid((0.0, 0.0), DX, (20, 40), periodic=(True, False)),
            "fills": (gr.Fill(gr.Box((0.0, 0.0), (0.2, 0.06)), 1),),
            "inflows": (inlet(),) if inflows is None else inflows,
            "walls": (sph.ParticleWall(1, 0.0, 1),),
            "gravity": Gravity((0.0,), ((0.0, -9.81),)),
            "duration": 0.3,
        }
        | more
    )


def test_what_sph_does_not_have_is_refused():
    def of(*inflows, **more):
        return lambda: scene_of(inflows=inflows, **more)

    short = gr.Box((0.06, 0.38), (0.14, 0.4))
    rest = gr.Grid((0.0, 0.0), DX, (20, 40), periodic=(True, True))
    beside = gr.Box((0.1, 0.3), (0.16, 0.4))
    refused(
        (r"inflows\[0\].driven = False must be True", of(inlet(driven=False))),
        (r"points_per_cell = 4 must be 1", of(inlet(points=4))),
        (r"material must be None", of(inlet(material=gr.MuI()))),
        (r"must have the density of the material", of(inlet(density=100.0))),
        (r"no weight on it", of(inlet(lithostatic=True))),
        (r"rate = 62.0 must be None: .* velocity of 0.5 m/s", of(inlet(rate=62.0))),
        (r"length 0.02 along y, must have at least 0.024", of(inlet(short))),
        (r"must not overlap that of fills\[0\]", of(inlet(gr.Box((0.06, 0.05), (0.14, 0.2))))),
        (r"must not overlap that of inflows\[1\]", of(inlet(), inlet(beside))),
        (
            r"outside of walls\[1\]",
            of(inlet(), walls=(sph.ParticleWall(1, 0.0, 1), sph.ParticleWall(1, 0.35, -1))),
        ),
        (r"along which the grid is periodic", of(inlet(), grid=rest, walls=())),
        (r"must hold at least one Fill", of(fills=())),
        (r"velocity = \(0.0, 0.0\) must not be 0", lambda: sph.Jet(NOZZLE, (0.0, 0.0), 1.0)),
        (r"density = -1.0", lambda: sph.Jet(NOZZLE, (0.0, -1.0), -1.0)),
        (r"speed = 0.0", lambda: fed_gas(speed=0.0)),
    )
    refused((r"inflows", of("x")), error=TypeError)


def test_memory_grows_and_threads_and_restarts_give_the_same_bits(monkeypatch):
    """With few spare rows the buffers grow in the middle, before and after a restart."""
    one = sph.Simulation(scene_of(), threads=1)
    capacity = one.buffers["id"].size
    one.run(until=0.3, monitor=False)
    monkeypatch.setattr(simulation, "LEAST_SPARE", 16)
    for threads in (2, 3):
        sim = sph.Simulation(scene_of(), threads=threads)
        assert sim.buffers["id"].size < capacity
        sim.run(until=0.15, monitor=False)
        sim = sph.Simulation.from_checkpoint(scene_of(), sim.checkpoint(), threads=threads)
        sim.run(until=0.3, monitor=False)
        assert sim.n_points > sim.scene.n_points + 200
        assert fields(sim.state) == fields(one.state) and sim.counts == one.counts
        (a,), (b,) = sim.inflows, one.inflows
        assert (a.points, a.work, *a.impulse) == (b.points, b.work, *b.impulse)


def test_gas_that_enters_has_the_same_bits_too(monkeypatch):
    found = []
    for threads, spare in ((1, 256), (3, 4)):
        monkeypatch.setattr(simulation, "LEAST_SPARE", spare)
        sim = sph.Simulation(fed_gas(), threads=threads).run(until=0.005, monitor=False)
        sim = sph.Simulation.from_checkpoint(fed_gas(), sim.checkpoint(), threads=threads).run(
            monitor=False
        )
        found.append((fields(sim.state), fields(sim.gas)))
        assert sim.counts["gas_entered"] > 80
    assert found[0] == found[1]


def test_frames_hold_as_many_particles_as_there_are(tmp_path):
    sim = sph.Simulation(scene_of(duration=0.2), threads=1)
    sim.run(save=tmp_path / "jet.vtkhdf", every=0.05)
    with gr.open(tmp_path / "jet.vtkhdf") as record:
        counts = [frame.n for frame in record]
        assert len(counts) == 5 and np.all(np.diff(counts) > 30)
        assert counts[-1] == sim.n_points
        assert record.scene == sim.scene
    with pytest.raises(ValueError, match="inflows"):
        other = scene_of(duration=0.2, inflows=[inlet(velocity=(0.0, -2.0))])
        gr.Simulation.resume(tmp_path / "jet.vtkhdf", scene=other)


def test_points_are_free_when_the_inflow_ends():
    scene = scene_of(inflows=[inlet(times=(0.0, 0.05))], fills=())
    sim = sph.Simulation(scene, threads=1).run(until=0.08, monitor=False)
    assert sim.inflows[0].points == 40
    v = sim.state.v[:, 1]
    assert v.max() < -1.2  # all fall


def test_cost_counts_what_enters():
    cost = gr.economy.cost(scene_of())
    scene = scene_of()
    assert cost.points == pytest.approx(scene.n_points + 0.3 * 8 / DX, abs=2)
    assert cost.unborn == pytest.approx(0.5 * 0.3 * 8 / DX, abs=2)
    fed = fed_gas()
    (jet,) = fed.gas.jets
    closed = fed.replace(gas=replace(fed.gas, jets=(replace(jet, density=None),)))
    more = gr.economy.cost(fed).points - gr.economy.cost(closed).points
    assert more == pytest.approx(0.01 * 50 / 0.02 * 4, abs=1)


def test_the_core_refuses_inlets_that_cannot_be():
    sim = sph.Simulation(scene_of(), threads=1)
    rows = np.zeros((1, 20))
    given = (rows, 1, (0.0, -1.0, 0.0), DX, 0.0, np.inf, False, (0.0, 0.0, 0.0), (1.0, 1.0, 0.0))
    with pytest.raises(ValueError, match="records"):
        sim._engine.add_inlet(*given)
    n = sum(count for _, count, *_ in sim._engine.fields())
    with pytest.raises(ValueError, match="configuration"):
        sim._engine.add_inlet(np.ones((1, n)), *given[1:])
    with pytest.raises(ValueError, match="inflow must hold"):
        sim._engine.restore_inflow(np.full_like(sim._engine.inflow(), -1))
    with pytest.raises(ValueError, match="loads"):
        sim._engine.restore_inlet_loads(np.full((1, 7), np.nan))
    checkpoint = sim.checkpoint()
    for name in ("inflow", "inlet_loads"):
        arrays = {key: value for key, value in checkpoint.arrays.items() if key != name}
        with pytest.raises(ValueError, match=name):
            sph.Simulation.from_checkpoint(sim.scene, replace(checkpoint, arrays=arrays))


def test_a_picture_shows_the_nozzle(tmp_path):
    figure = gr.plot.scene(scene_of())
    figure.savefig(tmp_path / "jet.png")
    texts = [text.get_text() for axes in figure.axes for text in axes.texts]
    texts += [text.get_text() for legend in figure.legends for text in legend.get_texts()]
    assert any("driven inflow" in text for text in texts) or figure.axes


@pytest.mark.parametrize(
    ("speed", "spacing", "begin", "end"),
    [(-1.0, 1e-290, 0.0, np.inf), (-1e300, 1.0, 0.0, 1.0), (-1.0, 1e300, 0.0, 1.0)],
)
def test_extreme_inlets_are_refused_or_want_memory(speed, spacing, begin, end):
    """Whatever the rate, the core asks for larger buffers before it writes beyond those it has."""
    scene = scene_of()
    sim = sph.Simulation(scene, threads=1)
    engine = simulation._build(scene, Machine())
    n = sum(count for _, count, *_ in engine.fields())
    box = (0.06, 0.1, 0.0), (0.14, 0.2, 0.0)  # empty
    engine.add_inlet(np.ones((1, n)), 1, (0.0, speed, 0.0), spacing, begin, end, False, *box)
    rows = sim._rows
    engine.bind(sim.buffers, rows.grains, rows.wall_first, rows.walls, True)
    full = engine.advance(3, np.inf, 1)
    assert full == (spacing < 1e300)
    assert engine.scalars()["n_points"] == rows.grains
    for bad in ((0.0, 1.0), (np.nan, 1.0), (-1.0, -1.0), (-1.0, np.inf)):
        other = simulation._build(scene, Machine())
        given = (0.0, bad[0], 0.0), bad[1], begin, end, False, *box
        with pytest.raises(ValueError, match="configuration"):
            other.add_inlet(np.ones((1, n)), 1, *given)

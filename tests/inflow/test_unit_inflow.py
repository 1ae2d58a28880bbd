"""Inflows: arguments, rates, places of the points, cost, scaling, files and pictures."""

import math

import numpy as np
import pytest
from inlets import CELL, SAND, H, chute, stream
from refusals import refused
from scenes_by_hand import scene_with

import granular as gr
from granular import _core
from granular.mpm import engine
from granular.mpm.scaling import Froude

BOX = gr.Box((0.1, 0.7), (0.3, 0.74))
LEFT = gr.Box((0.0, 0.7), (0.08, 0.74))
DOWN = (0.0, -1.0)


def inlet(region=BOX, velocity=DOWN, points=4, **more):
    return gr.Inflow(region, velocity, points, **more)


def test_bad_arguments_are_refused():
    cloud = gr.Cloud(np.array([[0.2, 0.72]]), volume=1e-4)
    refused(
        (r"velocity = \(0.0, 0.0\) must not be 0", lambda: inlet(velocity=(0, 0))),
        ("velocity", lambda: inlet(velocity=(0, 1, 0))),
        ("points_per_cell = 5 must be the square", lambda: inlet(points=5)),
        ("rate = -1.0 must be", lambda: inlet(rate=-1)),
        ("density = 0.0 must be", lambda: inlet(density=0)),
        ("density = 9.0 must be None with rate = 1.0", lambda: inlet(density=9, rate=1)),
        ("rate = 1.0 must be None in a lithostatic", lambda: inlet(rate=1, lithostatic=True)),
        ("density = 9.0 must be None in a lithostatic", lambda: inlet(density=9, lithostatic=True)),
        (r"times\[1\] = 1.0 must exceed times\[0\] = 2.0", lambda: inlet(times=(2, 1))),
        (r"times\[0\] = inf must be", lambda: inlet(times=(math.inf, math.inf))),
        ("times = .* must be two times", lambda: inlet(times=(0, 1, 2))),
        (r"times\[0\] = 0.1 must be 0 for a driven", lambda: inlet(driven=True, times=(0.1, 1))),
    )
    refused(
        ("region must not be a Cloud", lambda: inlet(cloud)),
        (
            "must be a Box that is not turned",
            lambda: inlet(gr.Sphere(0.05, center=(0.2, 0.7)), driven=True),
        ),
        ("region", lambda: inlet("x")),
        ("driven", lambda: inlet(driven=1)),
        error=TypeError,
    )


def test_what_does_not_fit_the_scene_is_refused():
    def of(inflow, **more):
        return lambda: stream(inflows=inflow if isinstance(inflow, list) else [inflow], **more)

    thin = gr.Box((0.1, 0.7), (0.101, 0.701))
    rest = gr.Grid((0.0, 0.0), CELL, (20, 40), periodic=(True, False))
    body = gr.Body(gr.shapes.Cylinder(0.03, center=(0.0, 0.0)), (0.2, 0.73))
    servo = [gr.Wall(1, 0.8, kind="free_slip", pressure=100.0)]
    refused(
        ("must hold at least one Fill", lambda: stream(inflows=[])),
        (r"inflows\[0\] reaches", of(inlet(gr.Box((0.1, 0.7), (0.3, 0.9))))),
        ("has dimension 3", of(inlet(gr.Box((0, 0, 0), (1, 1, 1)), (0, 0, 1), 8))),
        (r"inflows\[0\] = .* must hold at least one site", of(inlet(thin))),
        (r"inflows\[0\].density = 2000.0 must be <= 1500.0", of(inlet(density=2000))),
        (r"inflows\[0\].rate = 400.0 must be <= 300", of(inlet(rate=400))),
        ("along which the grid is periodic", of(inlet(velocity=(1, 0)), grid=rest)),
        (r"inflows\[1\].points_per_cell = 9 must be 4", of([inlet(), inlet(LEFT, points=9)])),
        (r"must not overlap that of inflows\[1\]", of([inlet(), inlet()])),
        ("must not be along gravity", of(inlet(lithostatic=True), gravity=9.81)),
        ("outside of walls", of(inlet(), walls=[gr.Solid((0.1, 0.7), (0.2, 0.74))])),
        ("outside of the bodies", of(inlet(), bodies=[body])),
        ("must be None with inflows", of(inlet(), walls=servo)),
        (r"must not overlap fills\[0\]", of(inlet(driven=True), fills=[gr.Fill(BOX, 4)])),
        ("xpic", of(inlet(driven=True), scheme=gr.Scheme(transfer="xpic", density=FREE))),
    )


FREE = gr.ParticleDensity()


def test_rate_density_and_velocity_go_with_one_another():
    grid = stream().grid
    assert inlet().area(grid) == pytest.approx(0.2)
    assert inlet().rate_in(grid, 1500.0) == pytest.approx(300.0)
    assert inlet(density=500).rate_in(grid, 1500.0) == pytest.approx(100.0)
    assert inlet(rate=150).density_in(grid, 1500.0) == pytest.approx(750.0)
    # what enters obliquely comes through the same area with the velocity across it
    oblique = inlet(velocity=(0.5, -2.0))
    assert (oblique.axis, oblique.speed) == (1, 2.0)
    assert oblique.rate_in(grid, 1500.0) == pytest.approx(600.0)
    disc = (
        stream(dim=3).grid,
        gr.Cylinder(0.05, center=(0.2, 0.08, 0.71), axis=(0.0, 0.0, 1.0), length=0.02),
    )
    round_ = inlet(disc[1], (0, 0, -1), 8)
    assert round_.area(disc[0]) == pytest.approx(math.pi * 0.05**2, rel=0.05)


def oracle(scene, time):
    """Places and numbers of the points that have entered without forces, in NumPy."""
    inflow = scene.inflows[0]
    velocity, axis = np.array(inflow.velocity), inflow.axis
    low, high = inflow.region.bounds
    sites = [np.arange(a + H / 2, b, H) for a, b in zip(low, high, strict=True)]
    sites[axis] = np.array([low[axis] if velocity[axis] > 0 else high[axis]])
    x = np.stack([a.ravel() for a in np.meshgrid(*sites[::-1], indexing="ij")[::-1]], axis=1)
    every = H / abs(velocity[axis]) / len(x)
    begin, end = inflow.times
    j = np.arange(math.floor((min(time, end) - begin) / every * (1 + 1e-12)))
    at = begin + (j + 1) * every
    return x[j % len(x)] + velocity * (time - at)[:, None]


@pytest.mark.parametrize(("dim", "cfl"), [(2, 0.5), (2, 0.21), (3, 0.5)])
def test_points_enter_at_the_sites_of_a_moving_seeding_lattice(dim, cfl):
    """In free flight without forces places, numbers and the mass are exact, at any time step."""
    speed = (0.25, *(0.1,) * (dim - 2), -1.0)
    given = {"velocity": speed, "times": (0.01, 0.1503), "density": 1400.0}
    # Grains apart, without a cutoff: rounding makes no stress, which would throw single points.
    alone = gr.Scheme(cfl=cfl, mass_cutoff=0.0)
    scene = stream(dim=dim, duration=0.2, inflow=given, scheme=alone)
    sim = gr.Simulation(scene, threads=1)
    rate = scene.inflows[0].rate_in(scene.grid, SAND.rho_c)
    for until in (0.05, 0.1, 0.2):
        sim.run(until=until, monitor=False)
        state, (entered,) = sim.state, sim.inflows
        x = oracle(scene, sim.time)
        np.testing.assert_array_equal(state.id, np.arange(len(x)))
        np.testing.assert_allclose(state.x, x, rtol=0, atol=1e-12)
        np.testing.assert_allclose(state.v, np.broadcast_to(speed, x.shape), rtol=0, atol=1e-11)
        expected = rate * (min(sim.time, 0.1503) - 0.01)
        assert -1e-9 < expected - state.mass.sum() < state.mass[0]
        assert entered.points == state.n and entered.missed == 0
        assert entered.mass == pytest.approx(state.mass.sum(), rel=1e-12)
        np.testing.assert_allclose(entered.momentum, state.mass @ state.v, atol=1e-10)


def test_ids_go_on_from_the_largest_even_if_its_point_has_left():
    scene = stream(fills=[gr.Fill(gr.Box((0.1, 0.0), (0.3, 0.1)), 4, velocity=(0, -3))])
    sim = gr.Simulation(scene, threads=1).run(monitor=False)
    first = scene.n_points
    assert sim.state.id.min() >= first
    assert sim.state.id.max() == first + sim.inflows[0].points - 1


def test_a_driven_inflow_is_full_at_the_start_and_moves_as_it_is_told():
    scene = chute()
    rows = 0.1 * 0.12 / H**2
    assert scene.n_points == pytest.approx(rows + 240, abs=1)
    sim = gr.Simulation(scene, threads=1).run(monitor=False)
    state = sim.state
    within = state.x[:, 0] < 0.06  # beyond, points touch nodes that are free
    np.testing.assert_allclose(state.v[within], np.tile([0.8, 0.0], (within.sum(), 1)), atol=1e-12)
    assert state.mass[within].sum() == pytest.approx(1500 * 0.06 * 0.12, rel=0.02)
    assert sim.inflows[0].impulse[1] > 0  # it bears the weight of what it holds


@pytest.mark.parametrize("end", [0.0, 0.4])
def test_driven_inflows_of_both_directions_are_mirror_images(end):
    """The upper end of a grid, which belongs to no cell, is where those down an axis begin."""
    found = []
    for way in (1, -1):
        low, high = sorted((end, end + way * 0.1))
        region = gr.Box((low, 0.0), (high, 0.1))
        scene = scene_with(
            grid=gr.Grid((min(end, end + way * 0.4), 0.0), 0.02, (20, 10)),
            fills=(),
            inflows=(gr.Inflow(region, (float(way), 0.0), 4, driven=True),),
            gravity=0.0,
            duration=0.1,
        )
        found.append(way * (scene.points().x[:, 0] - end))
    assert len(found[0]) == 100
    assert np.sort(found[0]) == pytest.approx(np.sort(found[1]), abs=1e-12)


def test_cost_and_memory_count_what_will_have_entered():
    scene = stream(duration=0.4)
    sim = gr.Simulation(scene, threads=1).run(monitor=False)
    cost = gr.economy.cost(scene)
    assert cost.points == sim.inflows[0].points
    assert cost.unborn == pytest.approx(cost.points / 2, rel=0.01)
    late = stream(duration=0.4, inflow={"times": (0.3, 0.35)})
    assert gr.economy.cost(late).points == pytest.approx(cost.points / 8, abs=1)
    assert gr.economy.cost(late).unborn == pytest.approx(cost.points / 8 * 0.325 / 0.4, abs=1)
    endless = stream(duration=1e7)
    with pytest.raises(ValueError, match="of memory"):
        gr.Simulation(endless)


def test_scaled_scenes_flow_alike_to_the_last_bit():
    scene = stream(gravity=9.81, inflow={"rate": 200.0, "times": (0.0, 0.25)})
    small = Froude(0.25)
    sims = [gr.Simulation(s, threads=1) for s in (scene, small.scene(scene))]
    for sim in sims:
        sim.step(600)
    real, model = (sim.state for sim in sims)
    np.testing.assert_array_equal(model.x, 0.25 * real.x)
    np.testing.assert_array_equal(model.v, 0.5 * real.v)
    rates = [s.scene.inflows[0].rate for s in sims]
    assert rates[1] == small.factor("mass_rate", dim=2) * rates[0] == rates[0] / 8


def test_scenes_with_inflows_are_stored_without_loss():
    scene = stream(inflow={"rate": 100.0, "material": gr.DruckerPrager(E=2e6), "times": (0.1, 0.2)})
    again = gr.Scene.from_json(scene.to_json())
    assert again == scene and again.inflows == scene.inflows
    assert [type(m).__name__ for m in scene.materials] == ["MuI", "DruckerPrager"]


def test_the_picture_of_a_scene_shows_its_inlets():
    figure = gr.plot.scene(chute())
    texts = [text.get_text() for text in figure.legends[0].get_texts()]
    assert any("driven inflow, 144 kg/s at 0.8 m/s" in text for text in texts)


def test_the_core_refuses_inlets_and_states_that_cannot_be():
    scene = stream()
    core = engine.build(scene, 1.0)
    width = sum(count for _, count, *_ in core.fields())
    good = np.zeros((2, width))
    good[:, :2], good[:, 9] = 0.2, 1.0  # x and mass, after v, stress and log_density
    velocity = (0.0, -1.0, 0.0)
    fine = (good, 1, velocity, H, 0.0, math.inf, True)
    core.add_inlet(*fine)
    for k, bad in enumerate([np.full((2, width), np.nan), 2, (1.0, 0.0, 0.0), 0.0, math.nan, -1.0]):
        with pytest.raises(ValueError):
            core.add_inlet(*fine[:k], bad, *fine[k + 1 :])
    outside = good.copy()
    outside[1, 0] = 9.0
    massless = np.where(np.arange(width) == 9, 0.0, good)
    for bad in (outside, massless, good[:0], good[:, 1:]):
        with pytest.raises(ValueError):
            core.add_inlet(bad, *fine[1:])
    state = core.inflow()
    np.testing.assert_array_equal(state, [0, 0, 0, 0, 0, 0, 0])
    for bad in ([-1, 0, 0, 0, 0, 0, 0], [0, 3, 0, 1, 1, 0, 0], [0, 2, 0, 0, 0, 2, 0], [0, 1]):
        with pytest.raises(ValueError):
            core.restore_inflow(np.array(bad))
    core.restore_inflow(np.array([9, 4, 1, 1, 1, 1, 0]))
    assert core.inflow()[0] == 9
    assert isinstance(core, _core.Engine)


def test_cheaper_scenes_and_resumed_ones_know_the_inflows(tmp_path):
    soft = SAND.replace(E=2e6)
    scene = stream(inflow={"material": soft}, duration=0.05)
    suggested = gr.economy.suggestion.changed(scene, {"E": 5e5})
    assert (suggested.material.E, suggested.inflows[0].material.E) == (5e5, 1e6)
    with pytest.raises(ValueError, match="inflows are not supported"):
        gr.economy.mirror_half(scene)
    path = tmp_path / "run.h5"
    gr.Simulation(scene, threads=1).run(save=path)
    faster = stream(inflow={"material": soft, "velocity": (0.0, -2.0)}, duration=0.05)
    with pytest.raises(ValueError, match=r"inflows = .* must be"):
        gr.Simulation.resume(path, scene=faster)
    on = gr.Simulation.resume(path, scene=scene.replace(gravity=gr.Gravity((0.0,), ((1.0, 0.0),))))
    assert on.run(until=0.06, monitor=False).inflows[0].points > 100 / 0.1 * 0.05

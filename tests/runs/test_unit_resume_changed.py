"""Runs that go on from a record with a changed scene."""

import numpy as np
import pytest
from scenes_by_hand import scene_with

import granular as gr
from granular import scenes

PARTICLE = gr.Scheme(transfer="flip", density=gr.ParticleDensity())


@pytest.fixture(scope="module")
def flying(tmp_path_factory):
    """Record of a disc in flight."""
    path = tmp_path_factory.mktemp("resume") / "slug.h5"
    scene = scenes.slug(E=1e6, cell=0.05)
    gr.Simulation(scene, threads=1).run(until=0.01, save=path)
    return path


def test_the_same_scene_goes_on_to_the_same_bits(flying):
    with gr.open(flying) as record:
        scene = record.scene
    states = [
        gr.Simulation.resume(flying, threads=1, **given).run(until=0.02, save=flying.parent / name)
        for name, given in (("a.h5", {}), ("b.h5", {"scene": scene}))
    ]
    first, second = (sim.state for sim in states)
    assert np.array_equal(first.x, second.x) and np.array_equal(first.stress, second.stress)


def test_gravity_is_that_of_the_changed_scene(flying):
    """In flight nothing else acts, so that the velocity changes by g t to round-off."""
    with gr.open(flying) as record:
        before, scene = record[-1], record.scene
    changed = scene.replace(gravity=gr.Gravity((0.0,), ((3.0, -1.0),)), duration=1.0)
    sim = gr.Simulation.resume(flying, scene=changed, threads=1)
    assert sim.record is None and sim.time == before.time
    sim.run(until=0.02)
    gained = np.average(sim.state.v, axis=0, weights=sim.state.mass)
    gained -= np.average(before.v, axis=0, weights=before.mass)
    assert gained == pytest.approx(np.array([3.0, -1.0]) * (sim.time - before.time), rel=1e-10)
    with gr.open(flying) as record:
        assert record.scene == scene and record.times[-1] == before.time


def test_numbers_of_material_and_scheme_change(flying):
    with gr.open(flying) as record:
        scene = record.scene
    softer = scene.replace(
        material=scene.material.replace(E=1e5), scheme=scene.scheme.replace(cfl=0.25)
    )
    sim = gr.Simulation.resume(flying, scene=softer, threads=1)
    path = flying.parent / "softer.h5"
    sim.run(until=0.02, save=path)
    with gr.open(path) as record:
        assert record.scene == softer
    whole = gr.Simulation.resume(path, threads=1)
    assert whole.steps == sim.steps and np.array_equal(whole.state.x, sim.state.x)


def bed(E, scheme, bodies=()):
    return scene_with(
        grid=gr.Grid((0.0, 0.0), 0.01, (12, 16)),
        fills=(gr.Fill(gr.Box((0.0, 0.0), (0.12, 0.1)), 4, lithostatic=True),),
        material=gr.MuI(E=E),
        scheme=scheme,
        walls=(gr.Wall(1, 0.0), *(gr.Wall(0, x, kind="free_slip") for x in (0.0, 0.12))),
        bodies=bodies,
    )


@pytest.mark.filterwarnings("ignore:ParticleDensity")
@pytest.mark.parametrize("factor", [10.0, 0.1])
@pytest.mark.parametrize("scheme", [gr.Scheme(), gr.schemes.cell_averaged, PARTICLE])
def test_a_bed_rests_on_with_another_stiffness(tmp_path, scheme, factor):
    """It keeps its pressure, and its time step is that of the changed scene from the first on."""
    sim = gr.Simulation(bed(1e6, scheme), threads=1)
    sim.step(161)  # the time step is computed anew every 16 steps
    sim.run(until=sim.time * 1.0001, save=tmp_path / "bed.h5", monitor=False)
    before = sim.state.pressure.mean()
    on = gr.Simulation.resume(tmp_path / "bed.h5", scene=bed(factor * 1e6, scheme), threads=1)
    on.step(1)
    assert on.dt == pytest.approx(sim.dt / np.sqrt(factor), rel=1e-3)
    assert on.state.pressure.mean() == pytest.approx(before, rel=1e-3)
    on.step(300)
    assert on.state.speed.max() < 2e-3


def test_the_first_place_of_a_body_stays(tmp_path):
    """Its present one is that of the record."""

    def scene_of(x):
        return bed(
            1e6, gr.Scheme(), (gr.Body(gr.shapes.Cylinder(0.03, center=(0.0, 0.0)), (x, 0.13)),)
        )

    gr.Simulation(scene_of(0.06), threads=1).run(until=1e-3, save=tmp_path / "ball.h5")
    with pytest.raises(ValueError, match=r"bodies\[0\].position = \(0.05, 0.13\) must be"):
        gr.Simulation.resume(tmp_path / "ball.h5", scene=scene_of(0.05))


@pytest.mark.parametrize(
    ("changes", "named"),
    [
        ({"grid": gr.Grid((0.0, 0.0), 0.05, (60, 60))}, "grid = "),
        ({"material": gr.Elastic(E=1e6)}, "material = Elastic must be MuI"),
        ({"walls": ()}, "walls = 0 must be"),
        ({"scheme": gr.Scheme(basis="linear")}, "scheme.basis = linear must be quadratic"),
    ],
)
def test_a_scene_that_does_not_fit_is_refused(flying, changes, named):
    with gr.open(flying) as record:
        scene = record.scene
    with pytest.raises(ValueError) as error:
        gr.Simulation.resume(flying, scene=scene.replace(**changes))
    assert named in str(error.value)


def test_another_method_is_refused(flying):
    with pytest.raises(TypeError, match="method 'mpm'"):
        gr.Simulation.resume(flying, scene=scenes.slump_sph())


def test_sph_goes_on_with_another_gravity(tmp_path):
    scene = scenes.slump_sph(spacing=0.05)
    path = tmp_path / "slump.h5"
    gr.Simulation(scene, threads=1).run(until=scene.duration / 200, save=path)
    g = gr.Gravity((0.0,), (tuple(0.0 for _ in range(scene.dim)),))
    still = gr.Simulation.resume(path, scene=scene.replace(gravity=g), threads=1)
    moved = gr.Simulation.resume(path, threads=1)
    for sim in (still, moved):
        sim.run(until=scene.duration / 100, save=tmp_path / f"{id(sim)}.h5")
    assert np.array_equal(still.state.id, moved.state.id)
    assert not np.array_equal(still.state.x, moved.state.x)

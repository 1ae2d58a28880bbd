"""Rigid bodies in a run: the same bits for any number of threads and after a restart."""

import numpy as np
import pytest
from same_bits import bits, same_bits
from scenes_by_hand import bed_with_bodies, scene_with

import granular as gr
from granular import Body, Box
from granular.mpm.body_distances import distance_from_bodies


@pytest.mark.parametrize(("thin", "single"), [(False, False), (True, False), (True, True)])
@pytest.mark.parametrize("dim", [2, 3])
def test_threads_and_restart(dim, thin, single):
    scene = bed_with_bodies(dim, thin=thin)
    if single:
        apic = gr.Scheme(transfer="apic", density=gr.ParticleDensity(), precision="single")
        scene = scene.replace(scheme=apic)
    sim = same_bits(scene, 37, 53, threads=(2, 4))
    assert all(np.abs(body.impulse).max() > 0 for body in sim.bodies)


@pytest.mark.parametrize("thin", [False, True])
def test_resumed_record(thin, tmp_path):
    scene = bed_with_bodies(2, thin=thin)
    whole = gr.Simulation(scene, threads=1).run(until=0.06, every=0.01, save=tmp_path / "a.h5")
    gr.Simulation(scene, threads=1).run(until=0.03, every=0.01, save=tmp_path / "b.h5")
    again = gr.Simulation.resume(tmp_path / "b.h5", threads=1).run(until=0.06)
    assert bits(whole) == bits(again)
    with gr.open(tmp_path / "a.h5") as a, gr.open(tmp_path / "b.h5") as b:
        assert a.bodies.tobytes() == b.bodies.tobytes()
        assert not a.damage()


@pytest.mark.parametrize("thin", [False, True])
def test_stages_are_the_step(thin):
    scene = bed_with_bodies(2, thin=thin)
    whole, parts = (gr.Simulation(scene, threads=1) for _ in range(2))
    for _ in range(20):
        whole.step()
        parts._engine.p2g()
        parts._engine.grid()
        parts._grow(parts._engine.g2p())
    assert bits(whole)[1] == bits(parts)[1]  # the stages alone make no tallies


@pytest.mark.parametrize("dim", [2, 3])
def test_bodies_within_one_another_act_as_their_union(dim):
    """Two boxes that overlap, and one as large as both: to the error of the sweeps."""
    scene, up = bed_with_bodies(dim), (0.0,) * (dim - 2)
    cell = scene.grid.cell
    edge, size = 4 * cell, (2 * cell,) * (dim - 2)
    impulses = []
    for halves in ((-1, 1), (0,)):
        long = 4 * edge if halves == (0,) else 2.5 * edge
        boxes = [Box(size=(long, *size, edge), center=(0.75 * edge * k, *up, 0.0)) for k in halves]
        bodies = tuple(Body(box, (0.5, *up, 0.3), friction=0.3) for box in boxes)
        sim = gr.Simulation(scene.replace(bodies=bodies), threads=1)
        sim.step(100)
        impulses.append(sum(body.impulse for body in sim.bodies))
    assert np.linalg.norm(impulses[0]) > 0
    size = np.abs(impulses[0]).max()
    assert np.allclose(impulses[0], impulses[1], rtol=0, atol=0.02 * size)


@pytest.mark.parametrize("dim", [2, 3])
def test_images_of_bodies_are_looked_for_as_bodies_are(dim):
    """A body at a periodic end is also at the other one, for other bodies and for material."""
    cell, cells, up = 0.1, 20, (0.0,) * (dim - 2)
    length, edge = cell * cells, 4 * cell
    grid = gr.Grid((0.0,) * dim, cell, (cells,) * dim, periodic=(True,) * (dim - 1) + (False,))
    at_end = Body(Box(size=(edge,) * dim), (0.0, *up, 1.0))
    high = (length, *(0.3 for _ in up), 1.2)

    def made(x, *bodies):
        fills = (gr.Fill(gr.Box((x, *up, 0.8), high), 4 if dim == 2 else 8),)
        return scene_with(grid=grid, fills=fills, gravity=(0.0, *up, -9.8), bodies=bodies)

    # The image reaches as far as the fill up, and two thirds along y.
    points = (scene := made(length - 0.6, at_end)).points()
    assert (distance_from_bodies(scene.grid, scene.bodies)(points.x)[0] > 0).all()
    whole = made(length - 0.6).points().volume.sum()
    assert points.volume.sum() == pytest.approx(whole * (1 - (2 / 3) ** (dim - 2) / 3))

"""Rigid bodies in a run: the same bits for any number of threads and after a restart."""

import numpy as np
import pytest
from same_bits import bits, same_bits
from scenes_by_hand import scene_with

import granular as gr
from granular import Body, Box, Cylinder, Fill, Grid, Motion, Union, Wall
from granular.mpm.body_distances import distance_from_bodies


def scene_of(dim, thin=False):
    """A bed with a rotating bucket, a free box and a disc that moves back and forth."""
    up, turning = dim - 1, 3.0 if dim == 2 else (0.0, -3.0, 0.0)
    shape, middle = ((16, 12), ()) if dim == 2 else ((8, 4, 6), (0.2,))
    cell = 0.8 / shape[0]
    edges = (2 * cell,) * (dim - 2)
    # thin: sides separated by duplicate nodes; thick: separated by the nodes alone
    thickness = 0.05 if thin else 2 * cell
    bucket = Union(
        (
            Box(size=(0.2, *edges, thickness)),
            Box(size=(thickness, *edges, 0.2), center=(0.1,) * dim),
        )
    )
    roller = Cylinder(0.06, center=(0.0,) * dim, axis=None if dim == 2 else (0, 1, 0))
    rest = (0.0,) * dim
    bodies = (
        Body(
            bucket,
            (0.2, *middle, 0.3),
            motion=Motion(velocity=(rest,), angular_velocity=(turning,)),
            contact="sticky",
        ),
        Body(
            Box(size=(max(0.15, 2 * cell), *edges, 2 * cell)),
            (0.5, *middle, 0.45),
            free="xy" if dim == 2 else "xyz",
            mass=3.0,
            friction=0.3,
        ),
        Body(
            roller,
            (0.6, *middle, 0.2),
            motion=Motion(
                times=(0.0, 0.02, 0.05),
                velocity=((0.5, *rest[1:]), (-1.0, *rest[1:]), (0.2, *rest[1:])),
            ),
            contact="bilateral",
            friction=0.2,
        ),
    )
    size = tuple(cell * n for n in shape)
    return scene_with(
        grid=Grid((0.0,) * dim, cell, shape),
        fills=(Fill(Box((0.0,) * dim, (*size[:-1], 0.4)), 2**dim, jitter=1.0),),
        scheme=gr.Scheme(density=gr.ParticleDensity()) if thin else gr.Scheme(),
        walls=(Wall(up, 0.0, kind="no_slip"),),
        bodies=bodies,
        seed=2,
    )


@pytest.mark.parametrize(("thin", "single"), [(False, False), (True, False), (True, True)])
@pytest.mark.parametrize("dim", [2, 3])
def test_threads_and_restart(dim, thin, single):
    scene = scene_of(dim, thin=thin)
    if single:
        apic = gr.Scheme(transfer="apic", density=gr.ParticleDensity(), precision="single")
        scene = scene.replace(scheme=apic)
    sim = same_bits(scene, 37, 53, threads=(2, 4))
    assert all(np.abs(body.impulse).max() > 0 for body in sim.bodies)


@pytest.mark.parametrize("thin", [False, True])
def test_resumed_record(thin, tmp_path):
    scene = scene_of(2, thin=thin)
    whole = gr.Simulation(scene, threads=1).run(until=0.06, every=0.01, save=tmp_path / "a.h5")
    gr.Simulation(scene, threads=1).run(until=0.03, every=0.01, save=tmp_path / "b.h5")
    again = gr.Simulation.resume(tmp_path / "b.h5", threads=1).run(until=0.06)
    assert bits(whole) == bits(again)
    with gr.open(tmp_path / "a.h5") as a, gr.open(tmp_path / "b.h5") as b:
        assert a.bodies.tobytes() == b.bodies.tobytes()
        assert not a.damage()


@pytest.mark.parametrize("thin", [False, True])
def test_stages_are_the_step(thin):
    scene = scene_of(2, thin=thin)
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
    scene, up = scene_of(dim), (0.0,) * (dim - 2)
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

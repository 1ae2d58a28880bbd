"""Pressure and friction along walls and bodies: sums, layers at rest, Janssen, restart."""

import numpy as np
import pytest
from scenes_by_hand import scene_with

import granular as gr
from granular.measure import wall_traction
from granular.measure.surface_area import body_surface, wall_surface

G, CELL = 9.8, 0.05


def recorded(scene, path, **options):
    gr.Simulation(scene, tractions=True, threads=1).run(save=path, **options)
    return gr.open(path)


def tumbling(dim):
    """Material that falls into a box with a block, a body that turns, and one that moves."""
    ends = (0.8, 0.8, 0.6)[:dim]
    grid = gr.Grid((0.0,) * dim, CELL, tuple(round(end / CELL) for end in ends))
    low, high = (0.1,) * dim, (0.7, 0.7, 0.5)[:dim]
    axis = ((0.0, 3.0, 0.0),) if dim == 3 else (3.0,)
    place = (0.4, 0.4, 0.2)[:dim] if dim == 2 else (0.4, 0.4, 0.2)
    disc = gr.Sphere(0.12, center=(0.0,) * dim)
    spinning = gr.Motion(velocity=((0.0,) * dim,), angular_velocity=axis)
    plate = gr.Box(size=(0.2, 0.1, 0.2)[:dim], center=(0.0,) * dim)
    pushed = gr.Motion(velocity=((0.2, *(0.0,) * (dim - 1)),))
    return scene_with(
        grid=grid,
        fills=(gr.Fill(gr.Box(low, high), 2**dim),),
        walls=(
            gr.Wall(0, 0.0, kind="coulomb", friction=0.4),
            gr.Wall(dim - 1, 0.0),
            gr.Solid((0.6, *(0.0,) * (dim - 1)), (0.8, *(0.8,) * (dim - 2), 0.1)),
        ),
        bodies=(
            gr.Body(disc, place, motion=spinning, friction=0.5),
            gr.Body(plate, (0.15, *place[1:]), motion=pushed, contact="sticky"),
        ),
        duration=0.25,
    )


@pytest.mark.parametrize("dim", [2, 3])
def test_bins_add_up_to_the_force_on_the_whole(dim, tmp_path):
    scene = tumbling(dim)
    with recorded(scene, tmp_path / "a.h5", every=0.05) as record:
        parts = [({"wall": i}, gr.measure.wall_force) for i in range(3)]
        parts += [({"body": i}, gr.measure.body_force) for i in range(2)]
        for which, force in parts:
            (index,) = which.values()
            traction, whole = wall_traction(record, **which), force(record, index, total=False)
            size = np.abs(whole.force).max()
            assert size > 1.0, which
            assert np.abs(traction.force - whole.force).max() < 1e-12 * size, which
            if which not in ({"wall": 2}, {"body": 1}):  # edges of blocks, and what may pull
                pressed = np.nansum(traction.normal * traction.area, axis=1)
                assert np.all(pressed >= -1e-9 * size), which
        # The normal force on a plane wall is that component of the force.
        floor = wall_traction(record, wall=1, along="x", bins=4)
        sums = np.nansum(floor.normal * floor.area, axis=1)
        np.testing.assert_allclose(sums, -floor.force[:, -1], rtol=1e-12, atol=1e-9)


@pytest.mark.parametrize("kind", ["wall", "block", "body"])
def test_a_layer_on_a_slope_presses_and_rubs_with_its_weight(kind, tmp_path):
    """p = m g cos(a)/A and tau = m g sin(a)/A everywhere below a layer at rest."""
    height, slope, ground = 0.5, np.radians(15.0), 0.2
    grid = gr.Grid((0.0, 0.0), CELL, (10, 20), periodic=(True, False))
    layer = gr.Fill(gr.Box((0.0, ground), (0.5, ground + height)), 4, lithostatic=True)
    under = {
        "wall": {"walls": (gr.Wall(1, ground),)},
        "block": {"walls": (gr.Solid((0.0, 0.0), (0.5, ground)),)},
        "body": {"bodies": (gr.Body(gr.HalfSpace((0.0, 1.0)), (0.0, ground), contact="sticky"),)},
    }[kind]
    level, tilted = (0.0, -G * np.cos(slope)), (G * np.sin(slope), -G * np.cos(slope))
    gravity = gr.Gravity((0.0, 0.4), (level, tilted))
    scene = scene_with(grid=grid, fills=(layer,), gravity=gravity, duration=1.0, **under)
    with recorded(scene, tmp_path / "a.h5", every=0.1) as record:
        which = {"body": 0} if kind == "body" else {"wall": 0}
        found = wall_traction(record, **which, along="x", bins=5).mean(after=0.5)
        weight = record[0].mass.sum() / 0.5 * G
    # A layer on a block, whose face is blurred, keeps on oscillating by some percent.
    near, scatter = (0.02, 0.1) if kind == "block" else (2e-3, 0.02)
    np.testing.assert_allclose(found.area, 0.1, rtol=1e-9)
    np.testing.assert_allclose(found.normal, weight * np.cos(slope), rtol=near)
    np.testing.assert_allclose(found.tangential, weight * np.sin(slope), rtol=0.01)
    np.testing.assert_allclose(found.friction, np.tan(slope), rtol=0.01)
    assert np.all(found.normal_scatter < scatter * weight)


def test_a_bin_fills_and_empties_as_janssen_and_jenike_say(tmp_path):
    """At rest Janssen's pressure; in flow it is larger at the transition and less in the cone."""
    scene = gr.scenes.hopper(
        orifice=0.08, width=0.2, angle_deg=20.0, friction=0.3, fill_height=0.8, cell=0.01,
        ramp=0.4, opens_at=0.5, duration=0.8, E=1e7, nu=0.4,
    )  # fmt: skip
    with recorded(scene, tmp_path / "a.h5", every=0.02) as record:
        upright = wall_traction(record, body=1, bins=np.linspace(0.25, 0.65, 6))
        cone = wall_traction(record, body=0, bins=[0.0, 0.05, 0.1, 0.15])
        rest, flow = upright.mean(0.4, 0.5), upright.mean(0.6, 0.8)
        still, drawn = cone.mean(0.4, 0.5), cone.mean(0.6, 0.8)
        transition = wall_traction(record, body=1, bins=[0.18, 0.22])
    np.testing.assert_allclose(rest.friction, 0.3, rtol=0.03)
    np.testing.assert_allclose(-flow.tangential[:3], 0.3 * flow.normal[:3], rtol=1e-6)
    ratio = scene.material.nu / (1 - scene.material.nu)
    theory = ratio * gr.theory.janssen_pressure(
        0.8 - rest.position, 0.2, friction=0.3, ratio=ratio, rho=scene.material.rho_c
    )
    np.testing.assert_allclose(rest.normal, theory, rtol=0.03)
    assert drawn.normal[0] < 0.6 * still.normal[0]  # the outlet is relieved
    assert transition.mean(0.6, 0.8).normal > 1.2 * transition.mean(0.4, 0.5).normal
    assert np.all(flow.normal[2:] < rest.normal[2:])


def test_pressure_on_a_disc_that_turns_stays_below_it(tmp_path):
    """The patches turn with it; they count where they are in the middle of a window."""
    grid = gr.Grid((0.0, 0.0), CELL, (16, 16))
    soil = gr.Fill(gr.Box((0.0, 0.0), (0.8, 0.35)), 4, lithostatic=True)
    spin = gr.Motion(velocity=((0.0, 0.0),), angular_velocity=(4.0,))
    disc = gr.Body(gr.Sphere(0.2, center=(0.0, 0.0)), (0.4, 0.45), motion=spin, friction=0.3)
    scene = scene_with(
        grid=grid, fills=(soil,), walls=(gr.Wall(1, 0.0),), bodies=(disc,), duration=0.5
    )
    with recorded(scene, tmp_path / "a.h5", every=0.02) as record:
        found = wall_traction(record, body=0, along="angle").mean(after=0.05)
        assert len(found.position) == 14
        found = wall_traction(record, body=0, along="angle", bins=12).mean(after=0.05)
        whole = gr.measure.body_force(record, 0)
    assert found.position[0] == -165.0 and found.position[-1] == 165.0
    np.testing.assert_allclose(found.area.sum(), 2 * np.pi * 0.2, rtol=1e-3)
    under = np.abs(found.position) < 90.0
    assert np.all(found.normal[~under] == 0.0)
    assert found.normal[under].max() > 100.0
    # Friction turns against the spin, which moves the bottom towards larger x.
    pressed = found.normal > 50.0
    np.testing.assert_allclose(found.tangential[pressed], -0.3 * found.normal[pressed], rtol=0.05)
    assert whole.force[2:, 0].mean() < 0.0


@pytest.mark.parametrize("dim", [2, 3])
def test_areas_are_those_of_the_shapes(dim):
    """Of a ball and a cube to 1 %, wherever they are; what lies on a wall does not count."""
    grid = gr.Grid((0.0,) * dim, CELL, (16,) * dim)
    fills = (gr.Fill(gr.Box((0.0,) * (dim - 1) + (0.7,), (0.8,) * dim), 2**dim),)
    origin = (0.0,) * dim
    r, side = 0.15, 0.3
    ball, cube = gr.Sphere(r, center=origin), gr.Box(size=(side,) * dim, center=origin)
    whole = {
        ball: 2 * np.pi * r if dim == 2 else 4 * np.pi * r**2,
        cube: 2 * dim * side ** (dim - 1),
    }
    for shape, area in whole.items():
        for place in ((0.37,) * dim, (0.4,) * dim):
            scene = scene_with(grid=grid, fills=fills, bodies=(gr.Body(shape, place),))
            assert body_surface(scene, 0).area.sum() == pytest.approx(area, rel=0.01)
    scene = scene_with(
        grid=grid, fills=fills, bodies=(gr.Body(cube, (0.4,) * (dim - 1) + (side / 2,)),)
    )
    open_area = whole[cube] * (2 * dim - 1) / (2 * dim)
    assert body_surface(scene, 0).area.sum() == pytest.approx(open_area, rel=0.02)


def test_a_floor_below_a_block_has_no_area():
    """A floor of 16 cells, 6 of which a block covers: its edges belong to half a cell each."""
    grid = gr.Grid((0.0, 0.0), CELL, (16, 16))
    walls = (gr.Wall(1, 0.0), gr.mpm.walls.Solid((5 * CELL, 0.0), (11 * CELL, 3 * CELL)))
    fills = (gr.Fill(gr.Box((0.0, 0.6), (0.7, 0.8)), 4),)
    free = scene_with(grid=grid, fills=fills, walls=walls[:1], scheme=gr.Scheme(basis="linear"))
    covered = scene_with(grid=grid, fills=fills, walls=walls, scheme=gr.Scheme(basis="linear"))
    assert wall_surface(free, 0).area.sum() == pytest.approx(16 * CELL)
    assert wall_surface(covered, 0).area.sum() == pytest.approx(11 * CELL)


def test_patches_are_the_same_after_a_restart_and_for_any_threads(tmp_path):
    scene = tumbling(2)
    paths = [tmp_path / name for name in ("one.h5", "three.h5", "resumed.h5")]
    for path, threads in zip(paths[:2], (1, 3), strict=True):
        gr.Simulation(scene, tractions=True, threads=threads).run(save=path, every=0.05)
    begun = gr.Simulation(scene, tractions=True, threads=1)
    begun.run(until=0.11, save=paths[2], every=0.05)
    del begun
    gr.Simulation.resume(paths[2]).run(until=scene.duration)
    records = [gr.open(path) for path in paths]
    ends = [record.patches()[-1] for record in records]
    for other in ends[1:]:
        assert {k: v.tobytes() for k, v in other.items()} == {
            k: v.tobytes() for k, v in ends[0].items()
        }
    assert records[0].damage() == []
    plain = gr.Simulation(scene, threads=1).run()
    assert plain.state.x.tobytes() == records[0][-1].x.tobytes()


def test_bad_arguments_are_named(tmp_path):
    scene = tumbling(2).replace(duration=0.02)
    record = recorded(scene, tmp_path / "a.h5", every=0.005)
    for options, message in (
        ({}, "body = None or wall = None must be given, and not both"),
        ({"body": 0, "wall": 0}, "and not both"),
        ({"body": 2}, "body = 2 must be an integer from 0 to 1"),
        ({"wall": -1}, "wall = -1 must be"),
        ({"wall": 0, "along": "angle"}, "along = 'angle' must be one of"),
        ({"body": 0, "along": "z"}, "along = 'z' must be one of"),
        ({"body": 0, "bins": 0}, "bins = 0 must be"),
        ({"body": 0, "bins": [0.0]}, "must have two edges"),
        ({"body": 0, "bins": [1.0, 0.0]}, "bins"),
        ({"body": 0, "window": 99}, "window = 99 must be less than"),
    ):
        with pytest.raises(ValueError, match=message):
            wall_traction(record, **options)
    with pytest.raises(ValueError, match="after = 9, before = inf must contain windows"):
        wall_traction(record, body=0).mean(after=9.0)
    gr.Simulation(scene).run(save=tmp_path / "b.h5")
    with pytest.raises(ValueError, match="must be one of a simulation with tractions"):
        wall_traction(gr.open(tmp_path / "b.h5"), body=0)
    with pytest.raises(TypeError, match="tractions = 1 must be"):
        gr.Simulation(scene, tractions=1)

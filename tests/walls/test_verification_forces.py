"""Impulses on walls and blocks: balance of momentum, weight, threads, restart, record, refusals."""

import warnings

import numpy as np
import pytest
from scenes_by_hand import scene_with

import granular as gr
from granular import Body, Box, CellAveragedDensity, Motion, ParticleDensity, measure
from granular.measure.cut_forces import of_whole, torques_of_whole
from granular.mpm.engine import averaging_interval, build
from granular.mpm.node_codes import node_codes
from granular.mpm.wall_owners import wall_owners

CELL, CELLS, LOW = 0.05, 12, 0.1
HIGH = LOW + CELLS * CELL
SCHEMES = [
    gr.Scheme(),
    gr.Scheme(basis="linear", transfer="tpic", density=CellAveragedDensity()),
    *(
        gr.Scheme(basis=basis, transfer=transfer, density=ParticleDensity())
        for basis, transfer in (
            *(("linear", transfer) for transfer in ("flip", "apic", "tpic", "xpic")),
            *(("quadratic", transfer) for transfer in ("flip", "apic", "tpic", "xpic")),
            ("ugimp", "flip"),
        )
    ),
    gr.Scheme(basis="quadratic", transfer="xpic", xpic_order=4, density=ParticleDensity()),
    gr.Scheme(basis="quadratic", transfer="flip", flip_decay=20.0, density=ParticleDensity()),
]


def at(x, z, dim, y):
    return (x, z) if dim == 2 else (x, y, z)


def thrown(scheme, dim=2):
    """Material thrown into a corner of walls of all kinds, blocks and a body; a lid opens."""
    walls = [
        gr.Wall(dim - 1, LOW, kind="coulomb", friction=0.3),
        gr.Wall(0, LOW, kind="free_slip"),
        gr.Wall(0, HIGH),
        gr.Wall(0, LOW + 4 * CELL, opens_at=0.008),
        gr.Solid(at(LOW + 8 * CELL, LOW, dim, LOW), at(HIGH, LOW + CELL, dim, HIGH)),
        gr.Solid(
            at(LOW + 9 * CELL, LOW + CELL, dim, LOW),
            at(HIGH, LOW + 2 * CELL, dim, HIGH),
            kind="free_slip",
        ),
    ]
    if dim == 3:
        walls += [gr.Wall(1, LOW), gr.Wall(1, HIGH, kind="coulomb", friction=0.2)]
    motion = Motion(velocity=(at(0.3, -0.5, dim, 0.1),))
    body = Body(Box(size=(0.16,) * dim), at(0.35, 0.5, dim, 0.4), motion=motion, friction=0.3)
    fill = gr.Box((LOW,) * dim, at(LOW + 8 * CELL, LOW + 6 * CELL, dim, HIGH))
    return scene_with(
        grid=gr.Grid((LOW,) * dim, CELL, (CELLS,) * dim),
        fills=(gr.Fill(fill, 2**dim, velocity=at(1.5, -1.0, dim, 0.4), jitter=0.5),),
        scheme=scheme,
        walls=tuple(walls),
        bodies=(body,),
        gravity=at(0.5, -9.8, dim, 0.2),
    )


def momentum(sim):
    """Momentum of the points, without that of a shift, which the next step takes back."""
    state = sim.state
    v = state.v
    last = (sim.steps - 1) % averaging_interval(sim.scene) == 0
    if sim.steps and "shift_velocity" in state.fields and last:
        v = v - state.shift_velocity
    return state.mass @ v, state.mass.sum()


def quiet(scene, **options):
    with warnings.catch_warnings():  # of schemes that are chosen to be many, not to be good
        warnings.simplefilter("ignore", gr.StabilityWarning)
        return gr.Simulation(scene, **({"threads": 1, "wall_forces": True} | options))


@pytest.mark.parametrize("dim", [2, 3])
@pytest.mark.parametrize("scheme", SCHEMES)
def test_walls_bodies_and_gravity_change_the_momentum(scheme, dim):
    scene = thrown(scheme, dim)
    sim = quiet(scene)
    before, mass = momentum(sim)
    for _ in range(4):
        sim.step(10)
        weight = mass * np.array(scene.gravity.vectors[0]) * sim.time
        to_walls = np.array([wall.impulse for wall in sim.walls])
        lost = to_walls.sum(axis=0) + sim.bodies[0].impulse
        scale = abs(to_walls).sum()
        np.testing.assert_allclose(
            momentum(sim)[0] - before, weight - lost, rtol=0, atol=1e-12 * scale
        )
    assert sim.time > 0.008
    pushed = abs(to_walls).max(axis=1) > 1e-3 * scale
    assert pushed[[0, 1, 3]].all()


def bed(dim=2, **changes):
    """A bed in equilibrium on a floor, between smooth walls."""
    walls = [gr.Wall(dim - 1, 0.0), *(gr.Wall(0, x, kind="free_slip") for x in (0.0, 0.4))]
    shape = at(8, 8, dim, 4)
    fill = gr.Fill(gr.Box((0.0,) * dim, at(0.4, 0.3, dim, 0.2)), 2**dim, lithostatic=True)
    return scene_with(
        grid=gr.Grid((0.0,) * dim, CELL, shape, periodic=at(False, False, dim, True)),
        fills=(fill,),
        **{"walls": walls, "duration": 0.2} | changes,
    )


@pytest.mark.parametrize("dim", [2, 3])
def test_a_floor_bears_the_weight_and_walls_the_pressure(dim, tmp_path):
    path = tmp_path / "a.h5"
    sim = gr.Simulation(bed(dim), threads=1, wall_forces=True).run(0.2, save=path, every=0.01)
    with gr.open(path) as record:
        floor, left, right = (measure.wall_force(record, i, window=20) for i in range(3))
        assert record.walls.shape == (21, 3, 9)
        np.testing.assert_array_equal(record.walls[-1, 0, :dim], sim.walls[0].impulse)
        assert not any(name.startswith("wall0") for name in record.samples)
    weight = 9.8 * sim.state.mass.sum()
    up = dim - 1
    assert floor.force[0, up] == pytest.approx(-weight, rel=0.01)
    torque = floor.torque[0] if dim == 2 else floor.torque[0, 1]
    assert torque == pytest.approx(-weight * 0.2 * (1 if dim == 2 else -1), rel=0.01)
    assert left.force[0, 0] == pytest.approx(-right.force[0, 0], rel=0.01)
    depth = 0.3 if dim == 2 else 0.3 * 0.2
    lithostatic = sim.scene.material.rho_c * 9.8 * 0.3 * depth / 2
    assert right.force[0, 0] == pytest.approx(sim.scene.material.K0 * lithostatic, rel=0.02)


@pytest.mark.parametrize("floor", ["wall", "block"])
def test_a_layer_that_starts_at_rest_on_a_floor_stays_at_rest(floor):
    """On a wall, and on a block across the domain, whose blurred face would let it drop and bounce:
    the pressure varied by 13 % after 3 s, and the points had 3 mm/s."""
    walls = {"wall": gr.Wall(1, 0.0), "block": gr.Solid((0.0, -0.05), (0.12, 0.0))}
    scene = gr.Scene(
        name="rest",
        grid=gr.Grid((0.0, -0.05), 0.01, (12, 19), periodic=(True, False)),
        fills=[gr.Fill(gr.Box((0.0, 0.0), (0.12, 0.1)), 4, lithostatic=True)],
        walls=[walls[floor]],
        material=gr.MuI(E=1e6),
        gravity=(0.0, -9.8),
        duration=0.5,
    )
    sim = gr.Simulation(scene)
    begin = sim.state
    for _ in range(20):
        sim.run(until=sim.time + 0.025, monitor=False)
        state = sim.state
        low = begin.x[:, 1] < 0.05
        assert state.pressure[low].mean() == pytest.approx(begin.pressure[low].mean(), rel=0.02)
        assert np.linalg.norm(state.v, axis=1).max() < 2e-3


def test_motion_is_the_same_whether_asked_or_not_and_for_any_threads():
    scene = thrown(gr.Scheme())
    sims = [quiet(scene, threads=n, wall_forces=asked) for n, asked in ((1, False), (1, True))]
    sims += [quiet(scene, threads=n) for n in (2, 3)]
    for sim in sims:
        sim.step(60)
    first = sims[0].checkpoint()
    for sim in sims[1:]:
        found = sim.checkpoint()
        for name, array in first.arrays.items():
            np.testing.assert_array_equal(found.arrays[name], array)
        np.testing.assert_array_equal(found.arrays["walls"], sims[1].checkpoint().arrays["walls"])
    assert "walls" not in first.arrays


def test_impulses_go_on_after_a_restart(tmp_path):
    scene, path = thrown(gr.Scheme()), tmp_path / "a.h5"
    whole = quiet(scene).run(0.02, every=0.005)
    quiet(scene).run(0.01, every=0.005, save=path)
    resumed = gr.Simulation.resume(path, threads=2).run(0.02)
    for one, other in zip(whole.walls, resumed.walls, strict=True):
        np.testing.assert_array_equal(one.impulse, other.impulse)
        np.testing.assert_array_equal(one.angular_impulse, other.angular_impulse)
    with gr.open(path) as record:
        assert len(measure.wall_force(record, 3).times) == 4


def test_a_component_counts_for_the_wall_it_is_normal_to():
    """The corner of a no-slip floor and a smooth side wall, and a block on the floor."""
    walls = (
        gr.Wall(1, 0.0),
        gr.Wall(0, 0.0, kind="free_slip"),
        gr.Wall(0, 0.4, opens_at=1.0),
        gr.Solid((0.2, 0.0), (0.3, 0.1)),
    )
    scene = bed(walls=walls, scheme=SCHEMES[2])
    codes, owners, opens_at, after = wall_owners(scene)
    codes = node_codes(scene)[0]._replace(values=codes).dense()
    assert owners[codes[0, 0]].tolist()[:2] == [1, 0]
    assert owners[codes[0, 2]].tolist()[:2] == [0, 0]
    assert owners[codes[1, 5]].tolist()[:2] == [3, 3]
    assert owners[codes[0, 5]].tolist()[:2] == [0, 0]
    assert owners[codes[3, 3]].tolist() == [-1, -1, -1]
    corner = codes[0, 8]
    assert owners[corner].tolist()[:2] == [2, 0] and opens_at[corner] == 1.0
    assert owners[after[corner]].tolist()[:2] == [0, 0]


def test_impulses_that_were_not_asked_for_are_refused(tmp_path):
    sim = gr.Simulation(bed(), threads=1)
    with pytest.raises(ValueError, match="wall_forces = False must be True"):
        _ = sim.walls
    sim.run(0.01, save=tmp_path / "a.h5", every=0.005)
    message = "must be one of a simulation with wall_forces"
    with gr.open(tmp_path / "a.h5") as record, pytest.raises(ValueError, match=message):
        measure.wall_force(record)
    with pytest.raises(TypeError, match="wall_forces = 1 must be True or False"):
        gr.Simulation(bed(), wall_forces=1)
    asked = gr.Simulation(bed(), threads=1, wall_forces=True)
    asked.run(0.01, save=tmp_path / "b.h5", every=0.005)
    with gr.open(tmp_path / "b.h5") as record:
        with pytest.raises(ValueError, match="wall = 3 must be"):
            measure.wall_force(record, 3)
        with pytest.raises(ValueError, match="window = 3 must be less than the 3 frames"):
            measure.wall_force(record, window=3)
    without = gr.Simulation(bed(walls=()), threads=1, wall_forces=True)
    assert without.walls == ()


def test_the_core_refuses_bad_owners():
    scene = bed()
    codes, owners, opens_at, after = wall_owners(scene)
    engine = gr.Simulation(scene, threads=1)._engine
    with pytest.raises(ValueError):  # points are bound
        engine.watch_walls(3, codes, owners, opens_at, after)
    with pytest.raises(ValueError):
        engine.walls()
    for bad in (
        (3, codes + np.int32(99), owners, opens_at, after),
        (1, codes, owners, opens_at, after),
        (3, codes.astype(np.int64), owners, opens_at, after),
        (3, codes[1:], owners, opens_at, after),
        (3, codes, owners[:, :2], opens_at, after),
        (3, codes, owners, opens_at[1:], after),
        (3, codes, owners, opens_at * np.nan, after),
        (3, codes, owners, np.zeros_like(opens_at), after),  # a chain without an end
        (3, codes, owners, opens_at, after - np.int32(1)),
        (-1, codes, owners, opens_at, after),
    ):
        fresh = build(scene, 1.0)
        with pytest.raises((TypeError, ValueError)):
            fresh.watch_walls(*bad)
    fresh.watch_walls(3, codes, owners, opens_at, after)
    with pytest.raises(ValueError):
        fresh.watch_walls(3, codes, owners, opens_at, after)
    with pytest.raises((TypeError, ValueError)):
        fresh.restore_walls(np.full((3, 6), np.nan))
    with pytest.raises((TypeError, ValueError)):
        fresh.restore_walls(np.zeros((2, 6)))
    for call in (fresh.patches, lambda: fresh.restore_patches(np.zeros((0, 4)), np.zeros((0, 7)))):
        with pytest.raises((TypeError, ValueError)):  # they are not watched
            call()
    with pytest.raises(ValueError):
        build(scene, 1.0).watch_patches()  # without watch_walls
    fresh.watch_patches()
    with pytest.raises(ValueError, match="once"):
        fresh.watch_patches()
    places, numbers = np.array([[0, 1, -2, 0], [2, 5, 0, 0]]), np.ones((2, 7))
    fresh.restore_patches(places, numbers)
    assert [part.tolist() for part in fresh.patches()] == [places.tolist(), numbers.tolist()]
    for bad in (
        (places.astype(float), numbers),
        (places[:, :3], numbers),
        (places, numbers[:1]),
        (places, numbers * np.nan),
        (places + 99, numbers),
        (places - 1, numbers),
        (np.array([[0, 2**40, 0, 0]]), numbers[:1]),
        (places,),
    ):
        with pytest.raises((TypeError, ValueError)):
            fresh.restore_patches(*bad)
    assert fresh.patches()[0].tolist() == places.tolist()


@pytest.mark.parametrize(("dim", "axes"), [(2, (0,)), (3, (1,)), (3, (0, 1))])
def test_forces_and_torques_with_their_images(dim, axes):
    """Random forces at random places, and their images one by one."""
    rng = np.random.default_rng(1)
    plane, about = rng.normal(size=(2, dim))
    x, f = rng.normal(size=(2, 9, dim))

    def torque(x, f):
        return np.cross(
            np.pad(x - about, ((0, 0), (0, 3 - dim))), np.pad(f, ((0, 0), (0, 3 - dim)))
        )

    places, forces = x, f
    for axis in axes:
        sign = np.where(np.arange(dim) == axis, -1.0, 1.0)
        places = np.concatenate([places, plane + sign * (places - plane)])
        forces = np.concatenate([forces, sign * forces])
    part, whole = (t.sum(axis=0, keepdims=True) for t in (torque(x, f), torque(places, forces)))
    if dim == 2:
        part, whole = part[:, 2], whole[:, 2]
    force = f.sum(axis=0, keepdims=True)
    np.testing.assert_allclose(of_whole(axes, force)[0], forces.sum(axis=0), atol=1e-13)
    found = torques_of_whole(axes, part, force, (about - plane)[None])
    np.testing.assert_allclose(found, whole, atol=1e-12)


def pressed(dim, cut):
    """A block that sinks into a bed, about planes of symmetry; whole, or cut at these planes."""
    plane, n = (0.3, 0.5)[: dim - 1], 4
    low = (*plane, 0.0) if cut else (*(x - n * CELL for x in plane), 0.0)
    shape = (*((n if cut else 2 * n,) * (dim - 1)), 6)
    high = tuple(x + m * CELL for x, m in zip(low, shape, strict=True))
    # Its position lies apart from the planes, so that it does not simply have no torque.
    across = (0.02,) * (dim - 1)
    body = Body(
        Box(size=(0.16,) * (dim - 1) + (0.1,), center=(*(-a for a in across), 0.0)),
        (*(x + a for x, a in zip(plane, across, strict=True)), 0.22),
        motion=Motion(velocity=((0.0,) * (dim - 1) + (-0.5,),)),
        friction=0.3,
    )
    ends = [(axis, x) for at in (high, low) for axis, x in enumerate(at[:-1])]
    return scene_with(
        grid=gr.Grid(low, CELL, shape),
        fills=(gr.Fill(gr.Box(low, (*high[:-1], 3 * CELL)), 2**dim),),
        scheme=gr.Scheme(basis="linear", transfer="flip", density=ParticleDensity()),
        walls=(gr.Wall(dim - 1, 0.0), *(gr.Wall(*end, kind="free_slip") for end in ends)),
        bodies=(body,),
        parameters=({}, {"half": True}, {"quarter": True})[(dim - 1) * cut],
    )


@pytest.mark.parametrize("dim", [2, 3])
def test_a_cut_scene_tells_the_forces_of_the_whole(dim, tmp_path):
    """Bodies and walls that planes of symmetry cut are whole; others, and parts, as they are."""
    found = []
    for cut in (False, True):
        path, scene = tmp_path / f"{cut}.h5", pressed(dim, cut)
        sim = gr.Simulation(scene, threads=1, wall_forces=True, force=True)
        sim.run(0.04, save=path, every=0.02)
        with gr.open(path) as record:
            motion, floor = measure.body_motion(record), measure.wall_force(record)
            felt = measure.body_force(record)
            found.append((motion.work[-1], felt.force, felt.torque, floor.force, floor.torque))
            part = measure.body_force(record, total=False).force
            side = [measure.wall_force(record, 1, total=choice).force for choice in (True, False)]
            mass = [gr.record.info(path, total=choice)["mass"][0] for choice in (True, False)]
    for whole, half in zip(*found, strict=True):
        assert np.abs(whole).max() > 0.0
        # A body that reaches beyond the grid has other contact points there: 0.7 % of the work.
        np.testing.assert_allclose(half, whole, rtol=0.0, atol=0.02 * np.abs(whole).max())
    share = 0.5 ** (dim - 1)
    assert part[:, -1] == pytest.approx(share * found[1][1][:, -1])
    # The side wall is one of two, which only the plane of the other axis cuts.
    assert side[0][:, 0] == pytest.approx(2 ** (dim - 2) * side[1][:, 0])
    assert np.abs(side[1][:, 0]).min() > 0.0
    assert mass[1] == pytest.approx(share * mass[0])


def test_indicators_are_no_numbers_of_walls(tmp_path):
    """A record with "wall_strain" in its samples, and without the impulses on walls."""
    sim = gr.Simulation(bed(), threads=1)
    state = sim.state
    with gr.record.TrajectoryWriter(tmp_path / "a.h5", sim.scene) as writer:
        writer.append(state, samples={"wall_strain": 0.25})
    with gr.open(tmp_path / "a.h5") as record:
        assert record.walls.shape == (1, 0, 0)
        assert record.samples["wall_strain"] == [0.25]
        with pytest.raises(ValueError, match="simulation with wall_forces"):
            measure.wall_force(record)

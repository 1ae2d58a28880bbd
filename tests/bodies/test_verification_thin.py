"""Blades thinner than the cells: no coupling across them, momentum, same bits, fluidity."""

import numpy as np
import pytest
from same_bits import same_bits
from scenes_by_hand import scene_with

import granular as gr
from granular import NGF, Body, Box, Fill, Fluidity, Gravity, Grid, Mesh, Motion, MuI, Union, Wall
from granular.shapes.shape import turned

CELL = 0.05


def scheme(**changes):
    return gr.Scheme(**{"transfer": "apic", "density": gr.ParticleDensity(), "dt": 4e-4} | changes)


def layers(thin_body, *, dim=2, velocity=(0.6, -0.5), **changes):
    """A layer at rest under an infinite thin body, and one above it that is thrown at it."""
    length = (6,) * (dim - 1)
    flat = tuple(n * CELL for n in length)
    low = (0.0,) * (dim - 1)
    speed = (velocity[0], *(0.0,) * (dim - 2), velocity[1])
    return scene_with(
        grid=Grid((*low, 0.0), CELL, (*length, 12), periodic=(True,) * (dim - 1) + (False,)),
        fills=(
            Fill(Box((*low, 0.05), (*flat, 0.3)), 2**dim, jitter=0.5),
            Fill(Box((*low, 0.3), (*flat, 0.5)), 2**dim, velocity=speed, jitter=0.5),
        ),
        scheme=scheme(**changes),
        bodies=(thin_body,),
        gravity=0.0,
        seed=2,
    )


def endless(dim=2, *, thickness=0.2, **body):
    size = (np.inf,) * (dim - 1) + (thickness * CELL,)
    return Body(Box(size=size), (0.0,) * (dim - 1) + (0.3,), **body)


@pytest.mark.parametrize("basis", ["linear", "quadratic"])
@pytest.mark.parametrize("contact", ["sticky", "separating", "bilateral"])
@pytest.mark.parametrize("dim", [2, 3])
def test_nothing_passes_through_a_blade(dim, contact, basis):
    """Material below stays at rest to the last bit; material above is stopped by the blade."""
    friction = 0.0 if contact == "sticky" else 0.3
    thin_body = endless(dim, contact=contact, friction=friction)
    sim = gr.Simulation(layers(thin_body, dim=dim, basis=basis), threads=1)
    below = sim.state.x[:, -1] < 0.3
    start = sim.state.x[below]
    before = sim.state.mass @ sim.state.v
    sim.step(60)
    state = sim.state
    assert not state.v[below].any()
    assert np.array_equal(state.x[below], start)
    assert (state.x[~below, -1] > 0.3 - 0.1 * CELL).all()
    change = state.mass @ state.v - before
    assert abs(change[-1]) > 0.3 * abs(before[-1])
    assert np.allclose(change, -sim.bodies[0].impulse, rtol=0, atol=1e-10)


@pytest.mark.parametrize("cells", [1.9, 2.1, 2.9, 3.1])
def test_nothing_passes_through_what_is_not_thin(cells):
    """Material at both faces of a body of any thickness, with common nodes up to three cells."""
    thin_body = Body(Box(size=(np.inf, cells * CELL)), (0.0, 0.4), friction=0.3)
    scene = layers(thin_body)
    top = 0.4 + 0.5 * cells * CELL
    fills = (
        Fill(Box((0.0, 0.05), (0.3, 0.4 - 0.5 * cells * CELL)), 4),
        Fill(Box((0.0, top), (0.3, top + 0.2)), 4, velocity=(0.6, -0.5)),
    )
    sim = gr.Simulation(
        scene.replace(grid=Grid((0.0, 0.0), CELL, (6, 20), periodic=(True, False)), fills=fills),
        threads=1,
    )
    below = sim.state.x[:, 1] < 0.4
    sim.step(60)
    assert not sim.state.v[below].any()


def test_a_thick_body_of_the_same_place_does_the_same():
    """Far from its plane the layer does not depend on the thickness of the body: equal impulse."""
    impulses = []
    for thickness in (0.2, 1.9):
        shape = Box(size=(np.inf, thickness * CELL), center=(0.0, -0.5 * thickness * CELL))
        scene = layers(Body(shape, (0.0, 0.3), contact="separating"))
        scene = scene.replace(fills=scene.fills[1:])
        sim = gr.Simulation(scene, threads=1)
        sim.step(120)
        impulses.append(sim.bodies[0].impulse[1])
    thick = layers(Body(Box(size=(np.inf, 0.2), center=(0.0, -0.1)), (0.0, 0.3)))
    sim = gr.Simulation(thick.replace(fills=thick.fills[1:]), threads=1)
    sim.step(120)
    assert impulses == pytest.approx([sim.bodies[0].impulse[1]] * 2, rel=1e-9)


def blade(dim=2, **body):
    """A blade that is moved and rotated through a bed, with its edges in the material."""
    turning = (3.0,) if dim == 2 else ((0.0, 3.0, 0.5),)
    motion = Motion(velocity=((0.5, *(0.1,) * (dim - 2), -0.1),), angular_velocity=turning)
    size = (0.4 * CELL, *(0.2,) * (dim - 2), 0.3)
    width = (5,) * (dim - 2)
    return scene_with(
        grid=Grid((-0.5,) * dim, CELL, (30, *(30,) * (dim - 2), 30)),
        fills=(Fill(Box((0.0,) * dim, (0.6, *(CELL * n for n in width), 0.4)), 2**dim),),
        material=body.pop("material", MuI(E=1e6)),
        scheme=body.pop("scheme", scheme()),
        bodies=(
            Body(
                Box(size=size),
                (0.2, *(0.2,) * (dim - 2), 0.26),
                motion=motion,
                friction=0.3,
                **body,
            ),
        ),
        gravity=0.0,
    )


@pytest.mark.parametrize("dim", [2, 3])
@pytest.mark.parametrize("transfer", ["flip", "apic", "tpic"])
def test_momentum_is_kept(dim, transfer):
    sim = gr.Simulation(blade(dim, scheme=scheme(transfer=transfer)), threads=1)
    before = sim.state.mass @ sim.state.v
    sim.step(150)
    impulse = sim.bodies[0].impulse
    assert np.linalg.norm(impulse) > 0.5
    assert np.allclose(sim.state.mass @ sim.state.v - before, -impulse, rtol=0, atol=1e-10)
    assert set(np.unique(sim.state.side)) == {-1.0, 0.0, 1.0}


NONLOCAL = NGF(E=1e6, mu_s=0.38, mu_2=0.64, I0=0.28, d=2e-2, rho_s=2450.0, A=0.5, t0=1e-3)


@pytest.mark.parametrize("dim", [2, 3])
def test_bits_do_not_depend_on_threads_or_restarts(dim):
    """The blade moves by several cells, with the nonlocal law in substeps."""
    fluidity = Fluidity(method="implicit", initial=1.0, substeps=2)
    scene = blade(dim, material=NONLOCAL, scheme=scheme(fluidity=fluidity), rough=True)
    one = same_bits(scene, *((130, 170) if dim == 2 else (40, 60)), threads=(2,))
    moved = np.linalg.norm(one.bodies[0].position - scene.bodies[0].position)
    assert moved > (CELL if dim == 2 else 0.3 * CELL)


def behind(g, dim, place, turned_deg, stencil, thin_bodies=1, **body):
    """Fluidity behind a thin body in a bed, after steps with that in front of it held at `g`.

    The steps are so short that nothing moves: contact ends its sweeps when all feet are right, on
    whatever side, and so carries motion in front over by a part of its error.
    """
    dt = 1e-9
    rotation = turned_deg if dim == 2 else (0.0, turned_deg, 0.6 * turned_deg)
    middle = (0.15,) * (dim - 1) + (place * CELL,)
    size = (1.0,) * (dim - 1) + (0.2 * CELL,)
    thin_body = Body(Box(size=size), middle, rotation_deg=rotation, contact="sticky", **body)
    fluidity = Fluidity(method="implicit", stencil=stencil, initial=0.1, tolerance=1e-13)
    scene = layers(endless(dim), dim=dim).replace(
        grid=Grid((0.0,) * dim, CELL, (6,) * (dim - 1) + (12,)),
        fills=(Fill(Box((0.0,) * dim, (0.3,) * (dim - 1) + (0.5,)), 4**dim, lithostatic=True),),
        material=NONLOCAL.replace(t0=2.5 * dt),
        scheme=scheme(fluidity=fluidity, dt=dt),
        bodies=(thin_body,) * thin_bodies,
        gravity=Gravity((0.0,), ((0.0,) * (dim - 1) + (-9.8,),)),
    )
    sim = gr.Simulation(scene, threads=1)
    normal = turned(thin_body.rotation_deg).apply(np.eye(3)[dim - 1])[:dim]
    before = np.append((sim.state.x - middle) @ normal > 0, False)
    for _ in range(5):
        sim.buffers["g"][0, before[sim.buffers["id"]]] = g
        sim.step(1)
    return sim.state.g[~before[:-1]]


@pytest.mark.parametrize(
    ("dim", "place", "turned_deg", "rough", "stencil"),
    [
        *((2, place, 0.0, True, "isotropic") for place in (5.0, 5.25, 5.5, 5.75)),
        (2, 5.3, 25.0, False, "isotropic"),
        (2, 5.3, 25.0, True, "faces"),
        (2, 5.3, 25.0, True, "isotropic"),
        (3, 5.3, 20.0, False, "isotropic"),
        (3, 5.3, 20.0, True, "faces"),
    ],
)
def test_fluidity_does_not_pass(dim, place, turned_deg, rough, stencil):
    """Fluidity behind a thin body is independent of that in front, wherever cells are cut."""
    quiet, loud = (behind(g, dim, place, turned_deg, stencil, rough=rough) for g in (0.01, 100.0))
    assert quiet.max() > 0.01
    np.testing.assert_allclose(loud, quiet, rtol=1e-5, atol=1e-9)
    held = behind(100.0, dim, place, turned_deg, stencil, thin_bodies=0)
    assert held.max() > 10.0 * quiet.max()


def test_what_is_not_held_is_told():
    scene = layers(endless())
    with pytest.warns(gr.StabilityWarning, match=r"bodies\[0\] has parts of 0.01 m, thinner"):
        gr.Simulation(scene)
    for changes in ({"transfer": "xpic"}, {"transfer": "tpic", "density": gr.SmoothedDensity()}):
        with pytest.raises(ValueError, match=r"bodies\[0\] has parts of 0.01 m, must be >= 0.1 m"):
            gr.Simulation(scene.replace(scheme=scheme(**changes)))
    near = Body(endless().shape, (0.0, 0.3 + 4 * CELL))
    with pytest.warns(gr.StabilityWarning, match=r"bodies\[0\] and bodies\[1\] have thin parts"):
        gr.Simulation(scene.replace(bodies=(endless(), near)))
    with pytest.warns(gr.StabilityWarning, match='transfer = "apic" with basis = "ugimp" creates'):
        gr.Simulation(scene.replace(scheme=scheme(basis="ugimp", transfer="apic")))
    rod = Body(gr.shapes.Cylinder(0.02, center=(0.0, 0.0)), (0.1, 0.3))
    pebble = Body(small_mesh(0.12), (0.1, 0.1, 0.3))
    for body in (rod, pebble):
        with pytest.warns(gr.StabilityWarning, match=r"bodies\[0\] has a part of 0.0(4|692)"):
            gr.Simulation(layers(endless(body.dim), dim=body.dim).replace(bodies=(body,)))


def small_mesh(edge):
    """An octahedron that contains a ball of diameter edge/sqrt(3)."""
    tips = 0.5 * edge * np.array([*np.eye(3), *-np.eye(3)])
    faces = [(0, 1, 2), (1, 3, 2), (3, 4, 2), (4, 0, 2), (1, 0, 5), (3, 1, 5), (4, 3, 5), (0, 4, 5)]
    return Mesh(tuple(map(tuple, tips.tolist())), tuple(faces), spacing=edge / 24)


@pytest.mark.parametrize(
    ("cells", "changes", "told"),
    [
        (2.5, {"transfer": "tpic", "density": gr.SmoothedDensity()}, "is coupled to that"),
        (2.5, {}, "separated by duplicate nodes"),
        (2.5, {"basis": "linear"}, None),
        (3.0, {"transfer": "tpic", "density": gr.SmoothedDensity()}, None),
    ],
)
def test_thin_bodies_of_two_to_three_cells(cells, changes, told):
    """Below a thickness of three cells, nodes of splines see both faces of the body."""
    scene = layers(endless(thickness=cells), **changes)
    said = [message for message in gr.scene_warnings(scene) if message.startswith("bodies")]
    assert len(said) == (told is not None)
    assert told is None or told in said[0]


def test_thick_parts_beside_thin_ones():
    """A block with a blade below it is pressed into a bed; no material enters either."""
    block, knife = Box(size=(0.3, 0.3)), Box(size=(0.3 * CELL, 0.3), center=(0.0, -0.3))
    motion = Motion(velocity=((0.0, -0.4),))
    scene = layers(endless()).replace(
        grid=Grid((0.0, 0.0), CELL, (20, 24)),
        fills=(Fill(Box((0.0, 0.0), (1.0, 0.5)), 4, lithostatic=True),),
        walls=(Wall(1, 0.0, kind="no_slip"),),
        bodies=(Body(Union((block, knife)), (0.5, 0.78), motion=motion, friction=0.3),),
        gravity=Gravity((0.0,), ((0.0, -9.8),)),
    )
    sim = gr.Simulation(scene, threads=1)
    right = sim.state.x[:, 0] > 0.5 + 0.5 * CELL
    left = sim.state.x[:, 0] < 0.5 - 0.5 * CELL
    sim.run(until=0.5, monitor=False)
    x = sim.state.x - sim.bodies[0].position
    assert sim.bodies[0].position[1] == pytest.approx(0.58, abs=1e-3)
    entered = (abs(x) < 0.15 - 0.75 * CELL).all(axis=1)
    assert not entered.any()
    facing = abs(x[:, 1] + 0.3) < 0.1
    assert (x[right & facing, 0] > -0.15 * CELL).all()
    assert (x[left & facing, 0] < 0.15 * CELL).all()


def test_a_bucket_of_thin_bodies_keeps_its_load():
    """A box of thin walls without a lid, lifted out of a bed, takes its content with it."""
    wide, tall, thin = 0.5, 0.25, 0.3 * CELL
    shape = Union(
        (
            Box(size=(wide, thin), center=(0.0, 0.0)),
            Box(size=(thin, tall), center=(-wide / 2, tall / 2)),
            Box(size=(thin, tall), center=(wide / 2, tall / 2)),
        )
    )
    motion = Motion(velocity=((0.0, 0.5),))
    scene = layers(endless()).replace(
        grid=Grid((0.0, 0.0), CELL, (20, 20)),
        fills=(Fill(Box((0.25, 0.3), (0.75, 0.5)), 4),),
        walls=(),
        bodies=(Body(shape, (0.5, 0.3), motion=motion, friction=0.3),),
        gravity=Gravity((0.0,), ((0.0, -9.8),)),
    )
    sim = gr.Simulation(scene, threads=1)
    sim.run(until=0.6, monitor=False)
    x = sim.state.x
    floor = sim.bodies[0].position[1]
    assert floor == pytest.approx(0.6, abs=1e-3)
    inside = (x[:, 1] > floor - 0.5 * CELL) & (abs(x[:, 0] - 0.5) < 0.3)
    assert inside.mean() > 0.97

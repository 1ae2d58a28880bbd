"""Inertia and contact of free bodies, given to the core directly: refused or survived."""

import contextlib

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scenes_by_hand import scene_with
from spoiled import DOCUMENTED, QUICK, WAYS, arguments, spoiled

import granular as gr
from granular import Body, Box, Motion, _core
from granular.mpm.bodies import mass_properties
from granular.mpm.rigid_contact import contact_balls, obstacles


def scene_of(dim):
    """A bed, and a block that falls on it and beside a wall."""
    cells, cell = (10, 8) if dim == 2 else (8, 8, 8), 0.05
    shape = Box(size=(0.2,) * dim)
    whole = mass_properties(shape, 1500.0)
    middle = 0.5 * cell * cells[0]
    block = Body(
        shape,
        (0.11, *(middle,) * (dim - 2), 0.29),
        motion=Motion(velocity=((-1.0, *(0.0,) * (dim - 2), -1.0),)),
        friction=0.3,
        free="xyz"[:dim],
        mass=whole.mass,
        inertia=whole.inertia,
        restitution=0.5,
    )
    size = tuple(cell * n for n in cells)
    return scene_with(
        grid=gr.Grid((0.0,) * dim, cell, cells),
        fills=[gr.Fill(gr.Box((0.0,) * dim, (*size[:-1], 0.2)), 2**dim)],
        walls=[gr.Wall(0, 0.0), gr.Wall(dim - 1, 0.0)],
        bodies=[block],
    )


@pytest.fixture(scope="module", params=[2, 3], ids=["2D", "3D"])
def parts(request):
    return parts_of(request.param)


def parts_of(dim):
    """A scene, the keywords of its engine, and what its body touches."""
    scene = scene_of(dim)
    balls = contact_balls(scene.bodies[0].shape, scene.grid.cell)
    touches = [balls, np.array([0, len(balls)]), np.array([0.5]), obstacles(scene)]
    return scene, arguments(scene), touches


def run(parts, *inertia, touches=None):
    """Make an engine, with this inertia if it is given, and some steps."""
    scene, keywords, valid = parts
    row = keywords["bodies"][0]
    if inertia:
        row = (*row[:-1], *inertia)
    engine = _core.Engine(**(keywords | {"bodies": [row]}))
    engine.touch_solids(*(valid if touches is None else touches))
    sim = gr.Simulation(scene, threads=1)
    sim._engine = engine
    sim._bind(sim.n_points)
    sim.step(20)
    return sim


def test_the_row_is_that_of_the_body(parts):
    scene, keywords, _ = parts
    assert len(keywords["bodies"][0]) == 11
    assert keywords["bodies"][0][-1].shape == (12,)
    run(parts)
    assert scene.bodies[0].inertia is not None


@pytest.mark.parametrize("how", WAYS)
def test_spoiled_inertia_is_refused(parts, how):
    inertia = spoiled(parts[1]["bodies"][0][-1], how)
    try:
        run(parts, inertia)
    except DOCUMENTED:
        return
    assert how in ("empty", "read-only")  # without numbers the body does not turn


@pytest.mark.parametrize(
    ("place", "value", "message"),
    [
        (0, np.nan, r"inertia\[0\]"),
        (1, np.inf, r"inertia\[1\]"),
        (2, 1e61, r"inertia\[2\]"),
        (0, 0.0, "moments of inertia must be > 0"),
        (1, -1.0, "moments of inertia must be > 0"),
        (4, 0.5, "orthonormal"),
        (3, np.nan, r"inertia\[3\]"),
        (11, -2.0, "orthonormal"),
    ],
)
def test_bad_moments_and_axes_are_refused(parts, place, value, message):
    inertia = parts[1]["bodies"][0][-1].copy()
    inertia[place] = value
    with pytest.raises(ValueError, match=message):
        run(parts, inertia)


@pytest.mark.parametrize("size", [1e-300, 1e-30, 1e-9, 1e9, 1e59])
def test_any_positive_moment_is_survived(parts, size):
    """A body that can hardly be turned, or at a touch: the run goes on, or ends by an exception."""
    inertia = parts[1]["bodies"][0][-1].copy()
    inertia[:3] = size
    try:
        sim = run(parts, inertia)
    except (gr.SimulationError, ValueError):
        return
    assert sim.steps == 20


@pytest.mark.parametrize("how", WAYS)
@pytest.mark.parametrize("which", range(4))
def test_spoiled_arrays_of_what_it_touches(parts, which, how):
    touches = list(parts[2])
    touches[which] = spoiled(touches[which], how)
    try:
        run(parts, touches=touches)
    except DOCUMENTED:
        return
    one = which == 2 and how in ("strided", "backwards")  # of a single number
    assert how == "read-only" or one


@QUICK
@given(data=st.data())
def test_any_number_in_them_is_survived(parts, data):
    scene, keywords, valid = parts
    touches = list(valid)
    which = data.draw(st.sampled_from([0, 1, 2, 3]))
    array = touches[which].copy()
    number = st.integers(-(2**62), 2**62) if which == 1 else st.floats()
    array.flat[data.draw(st.integers(0, array.size - 1))] = data.draw(number)
    touches[which] = array
    try:
        run((scene, keywords, touches))
    except (*DOCUMENTED, gr.SimulationError):
        return


@pytest.mark.parametrize("method", ["drive", "load"])
@pytest.mark.parametrize(
    "given",
    [
        (),
        (0,),
        (-1, (0.0,) * 6),
        (1, (0.0,) * 6),
        (2**40, (0.0,) * 6),
        ("0", (0.0,) * 6),
        (0, (0.0,) * 5),
        (0, (0.0,) * 7),
        (0, None),
        (0, (*(0.0,) * 5, np.nan)),
        (0, (np.inf, *(0.0,) * 5)),
        (0, ("x", *(0.0,) * 5)),
    ],
)
def test_bad_numbers_from_outside_are_refused(parts, method, given):
    """The body stays as it is, and the run goes on."""
    sim = run(parts)
    before = sim._engine.bodies()
    with pytest.raises(DOCUMENTED):
        getattr(sim._engine, method)(*given)
    np.testing.assert_array_equal(sim._engine.bodies(), before)
    sim.step(2)


@pytest.mark.parametrize("size", [1e-300, 1e9, 1e59])
def test_any_load_from_outside_is_survived(parts, size):
    """The run goes on, or ends by an exception that says so."""
    sim = run(parts)
    sim._engine.load(0, (size,) * 6)
    sim._engine.drive(0, (size,) * 6)
    with contextlib.suppress(gr.SimulationError, ValueError):
        sim.step(20)

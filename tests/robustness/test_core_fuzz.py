"""Wrong arguments to the core: documented exceptions only, no crash, no changed engine."""

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

import granular as gr
from granular import _core
from granular import engine as core

DOCUMENTED = (TypeError, ValueError, OverflowError, RuntimeError, MemoryError)
QUICK = settings(
    max_examples=60,
    deadline=None,
    derandomize=True,
    suppress_health_check=[HealthCheck.function_scoped_fixture, HealthCheck.too_slow],
)


class Wrapped(np.ndarray):
    """A subclass, which the core must not take for an array."""


def spoiled(array, how):
    """An array that is wrong in one way, or a thing that is no array."""
    with np.errstate(all="ignore"):
        return {
            "float32": lambda: array.astype(np.float32),
            "int32": lambda: array.astype(np.int32),
            "object": lambda: array.astype(object),
            "swapped": lambda: array.astype(array.dtype.newbyteorder()),
            "fortran": lambda: np.asfortranarray(np.stack([array, array])),
            "strided": lambda: np.repeat(array, 2, axis=-1)[..., ::2],
            "backwards": lambda: array[..., ::-1],
            "read-only": lambda: np.frombuffer(array.tobytes(), array.dtype).reshape(array.shape),
            "empty": lambda: array[..., :0],
            "short": lambda: array[..., :-1].copy(),
            "long": lambda: np.concatenate([array, array], axis=-1),
            "flat": lambda: array.ravel()[:-1].copy(),
            "deep": lambda: array[None].copy(),
            "scalar": lambda: np.array(1.0),
            "subclass": lambda: array.view(Wrapped),
            "unaligned": lambda: np.frombuffer(
                bytearray(array.nbytes + 1), np.uint8, array.nbytes, 1
            ).view(array.dtype).reshape(array.shape),
            "list": array.tolist,
            "none": lambda: None,
            "number": lambda: 3.5,
            "text": lambda: "array",
        }[how]()  # fmt: skip


WAYS = (
    "float32", "int32", "object", "swapped", "fortran", "strided", "backwards", "read-only",
    "empty", "short", "long", "flat", "deep", "scalar", "subclass", "unaligned", "list", "none",
    "number", "text",
)  # fmt: skip

numbers = st.one_of(
    st.floats(),
    st.integers(-(2**70), 2**70),
    st.sampled_from([None, "1", (), 1j, True, np.float64("nan"), 2**63, -(2**31) - 1]),
)


def arguments(scene, mean_mass=1.0):
    """The keywords with which an engine of this scene is built."""
    caught = {}

    class Catcher:
        def __init__(self, **keywords):
            caught.update(keywords)

    before, _core.Engine = _core.Engine, Catcher
    try:
        core.build(scene, mean_mass)
    finally:
        _core.Engine = before
    return caught


@pytest.fixture
def keywords(small_scene):
    return arguments(small_scene("walls", 2, ("quadratic", "tpic", "diffused")))


def law_arguments(n=3, dim=2):
    lanes = _core.build_info()["lanes"]
    return [
        "mu_i", dim, {"K": 1e6, "G": 1e6, "mu_s": 0.38, "mu_2": 0.64, "xi": 1.1}, 1e-4, 0,
        np.zeros((n, dim * dim, lanes)), np.zeros(n * lanes),
        np.zeros((4 if dim == 2 else 6, n * lanes)), np.zeros(n * lanes), "",
    ]  # fmt: skip


# ---- law_update ----


@pytest.mark.parametrize("place", [5, 6, 7, 8])
@pytest.mark.parametrize("how", WAYS)
def test_law_update_refuses_wrong_arrays(place, how):
    wrong = law_arguments()
    wrong[place] = spoiled(wrong[place], how)
    if how == "read-only" and place in (5, 6):
        _core.law_update(*wrong)  # it only reads them
        return
    if how == "long" and place == 5:
        wrong[5] = wrong[5][..., : wrong[5].shape[-1] - 1]
    with pytest.raises((TypeError, ValueError)):
        _core.law_update(*wrong)


def nonlocal_arguments(n=3, dim=2):
    """`law_arguments` of the nonlocal law, with g_star and g."""
    given = law_arguments(n, dim)
    given[0] = "ngf"
    given[2] = dict(
        K=1e6, A=0.5, G=1e6, mu_s=0.38, mu_2=0.64, I0=0.28, rho_s=2450.0, d=0.005, t0=1e-3,
        p_spread=0.0,
    )  # fmt: skip
    given[6][:] = 1e-3
    given[7][:3] = -1000.0
    return [*given, np.ones(n), np.zeros(n * _core.build_info()["lanes"])]


@pytest.mark.parametrize("place", [10, 11])
@pytest.mark.parametrize("how", WAYS)
def test_law_update_refuses_wrong_fluidities(place, how):
    wrong = nonlocal_arguments()
    wrong[place] = spoiled(wrong[place], how)
    if (how, place) == ("read-only", 10) or (how, place) == ("none", 10):
        _core.law_update(*wrong)  # it only reads it; without one it is in its local phase
        return
    with pytest.raises((TypeError, ValueError)):
        _core.law_update(*wrong)


def test_law_update_with_fluidities_that_overlap_or_lack():
    given = nonlocal_arguments()
    _core.law_update(*given)
    assert (given[11] > 0).all()
    for place, other in ((11, 8), (11, 6), (10, 11)):
        shared = nonlocal_arguments()
        shared[place] = shared[other][: len(shared[place])]
        with pytest.raises(ValueError, match="share memory"):
            _core.law_update(*shared)
    with pytest.raises(ValueError, match="g_star is given without g"):
        _core.law_update(*nonlocal_arguments()[:-1])
    with pytest.raises(ValueError, match="parameter t0 is missing"):
        given[2] = {k: v for k, v in given[2].items() if k != "t0"}
        _core.law_update(*given)
    _core.law_update(*nonlocal_arguments(0))
    _core.law_update(*nonlocal_arguments()[:-2])


@QUICK
@given(data=st.data())
def test_nonlocal_update_survives_any_number_in_its_arrays(data):
    chosen = nonlocal_arguments(2)
    for place in (5, 6, 7, 8, 10, 11):
        flat = chosen[place].reshape(-1)
        flat[:] = data.draw(
            st.lists(st.floats(), min_size=flat.size, max_size=flat.size), label=str(place)
        )
    _core.law_update(*chosen)


def test_law_update_takes_no_points_and_refuses_shared_memory():
    _core.law_update(*law_arguments(0))
    shared = law_arguments()
    shared[8] = shared[6]
    with pytest.raises(ValueError, match="share memory"):
        _core.law_update(*shared)
    shared = law_arguments()
    shared[8] = shared[7][0]
    with pytest.raises(ValueError, match="share memory"):
        _core.law_update(*shared)


@QUICK
@given(place=st.sampled_from([0, 1, 2, 3, 4, 9]), value=numbers)
def test_law_update_refuses_wrong_numbers(place, value):
    given_arguments = law_arguments()
    given_arguments[place] = value
    try:
        _core.law_update(*given_arguments)
    except DOCUMENTED:
        return
    # what is taken is a legal number in that place
    assert isinstance(value, (int, float, np.floating))


@QUICK
@given(data=st.data())
def test_law_update_survives_any_number_in_its_arrays(data):
    dim = data.draw(st.sampled_from([2, 3]))
    chosen = law_arguments(1, dim)
    law = data.draw(st.sampled_from(sorted(_core.laws())))
    chosen[0], chosen[4] = law, data.draw(st.integers(0, 1))
    chosen[2] = {name: 0.5 for name, *_ in _core.laws()[law][1]}
    for place in (5, 6, 7):
        flat = chosen[place].reshape(-1)
        flat[:] = data.draw(st.lists(st.floats(), min_size=flat.size, max_size=flat.size))
    _core.law_update(*chosen)


# ---- fluidity ----


def update_arguments(n=11):
    names = ("G", "mu_s", "mu_2", "I0", "rho_s", "d", "t0", "p_spread")
    values = (3e5, 0.38, 0.64, 0.28, 2450.0, 5e-3, 1e-3, 0.0)
    arrays = [np.full(n, 0.5) for _ in range(6)]
    return [dict(zip(names, values, strict=True)), 1e-4, *arrays, ""]


def diffuse_arguments(shape=(3, 4)):
    return {
        "method": "implicit", "stencil": "faces", "dx": 0.01, "A": 0.5, "d": 0.005, "t0": 1e-3,
        "dt": 1e-3, "steps": 2,
        "tolerance": 1e-8, "max_iterations": 100, "periodic": (True, False, True)[: len(shape)],
        "faces": np.zeros((2 * len(shape), *shape), np.uint8), "dense": np.ones(shape, bool),
        "g": np.ones(shape), "threads": 1, "isa": "",
    }  # fmt: skip


@pytest.mark.parametrize("place", range(2, 8))
@pytest.mark.parametrize("how", WAYS)
def test_fluidity_update_refuses_wrong_arrays(place, how):
    wrong = update_arguments()
    wrong[place] = spoiled(wrong[place], how)
    if how == "read-only" and place < 6:
        _core.fluidity_update(*wrong)  # it only reads them
        return
    with pytest.raises((TypeError, ValueError)):
        _core.fluidity_update(*wrong)


def test_fluidity_update_takes_no_points_and_refuses_shared_memory():
    _core.fluidity_update(*update_arguments(0))
    shared = update_arguments()
    shared[7] = shared[3]
    with pytest.raises(ValueError, match="share memory"):
        _core.fluidity_update(*shared)


@pytest.mark.parametrize("name", ["faces", "dense", "g"])
@pytest.mark.parametrize("how", WAYS)
def test_fluidity_diffuse_refuses_wrong_arrays(name, how):
    wrong = diffuse_arguments()
    wrong[name] = spoiled(wrong[name], how)
    if name != "g" and how in ("read-only", "swapped", "unaligned"):
        _core.fluidity_diffuse(**wrong)  # it only reads them; bytes have no order
        return
    with pytest.raises((TypeError, ValueError)):
        _core.fluidity_diffuse(**wrong)


@QUICK
@given(
    place=st.sampled_from([0, 1, 8, *("G", "mu_s", "mu_2", "I0", "rho_s", "d", "t0", "p_spread")]),
    value=numbers,
)
def test_fluidity_update_refuses_wrong_numbers(place, value):
    chosen = update_arguments()
    if isinstance(place, str):
        chosen[0][place] = value
    else:
        chosen[place] = value
    try:
        _core.fluidity_update(*chosen)
    except DOCUMENTED:
        return
    assert isinstance(value, (int, float, np.floating))


@QUICK
@given(name=st.sampled_from(sorted(diffuse_arguments())), value=numbers)
def test_fluidity_diffuse_refuses_wrong_numbers(name, value):
    if name == "steps" and isinstance(value, int) and value > 1000:
        return  # legal, and long
    try:
        report = _core.fluidity_diffuse(**diffuse_arguments() | {name: value})
    except DOCUMENTED:
        return
    assert isinstance(value, (int, float, np.floating))
    assert report["clamped"] == 0


@QUICK
@given(data=st.data())
def test_fluidity_diffuse_survives_any_number_in_its_arrays(data):
    shape = data.draw(st.sampled_from([(1, 1), (2, 3), (1, 2, 3)]))
    chosen = diffuse_arguments(shape)
    chosen["method"] = data.draw(st.sampled_from(["explicit", "implicit", "rkl2"]))
    chosen["stencil"] = data.draw(st.sampled_from(["faces", "isotropic"]))
    size = chosen["g"].size
    chosen["g"].flat = data.draw(st.lists(st.floats(), min_size=size, max_size=size))
    chosen["dense"].view(np.uint8).flat = data.draw(
        st.lists(st.integers(0, 255), min_size=size, max_size=size)
    )
    chosen["faces"].flat = data.draw(
        st.lists(st.integers(0, 3), min_size=chosen["faces"].size, max_size=chosen["faces"].size)
    )
    legal = (chosen["faces"] < 3).all() and ((chosen["g"] >= 0) & (chosen["g"] <= 1e60)).all()
    try:
        _core.fluidity_diffuse(**chosen)
    except DOCUMENTED:
        assert not legal
        return
    assert legal
    assert (chosen["g"] >= 0).all()
    assert np.isfinite(chosen["g"]).all()


# ---- hencky ----

HENCKY = {
    "K": 1e6, "G": 5e5, "g_min": 1e-6, "kindling": 1.0, "mu_s": 0.38, "mu_2": 0.64, "I0": 0.28,
    "rho_s": 2550.0, "d": 4e-3, "t0": 1e-4, "p_spread": 0.0,
}  # fmt: skip


def hencky_arguments(n=11, dim=2):
    arrays = [np.full(n, 1e-3), np.full((4 if dim == 2 else 6, n), -1.0), np.ones(n), np.ones(n)]
    return ["nonlocal_linear", dict(HENCKY), 1e-4, np.zeros((dim * dim, n)), *arrays, ""]


@pytest.mark.parametrize("place", range(3, 8))
@pytest.mark.parametrize("how", WAYS)
def test_hencky_update_refuses_wrong_arrays(place, how):
    wrong = hencky_arguments()
    wrong[place] = spoiled(wrong[place], how)
    if how == "read-only" and place in (3, 4):
        _core.hencky_update(*wrong)  # it only reads them
        return
    with pytest.raises((TypeError, ValueError)):
        _core.hencky_update(*wrong)


def test_hencky_update_takes_no_points_and_refuses_shared_memory():
    for dim in (2, 3):
        _core.hencky_update(*hencky_arguments(0, dim))
        for place, other in ((7, 6), (6, 4)):
            shared = hencky_arguments(dim=dim)
            shared[place] = shared[other]
            with pytest.raises(ValueError, match="share memory"):
                _core.hencky_update(*shared)


@QUICK
@given(place=st.sampled_from([0, 1, 2, 8, *HENCKY]), value=numbers)
def test_hencky_update_refuses_wrong_numbers(place, value):
    chosen = hencky_arguments()
    if isinstance(place, str):
        chosen[1][place] = value
    else:
        chosen[place] = value
    try:
        _core.hencky_update(*chosen)
    except DOCUMENTED:
        return
    assert isinstance(value, (int, float, np.floating))


@QUICK
@given(data=st.data())
def test_hencky_update_survives_any_number_in_its_arrays(data):
    dim = data.draw(st.sampled_from([2, 3]))
    chosen = hencky_arguments(data.draw(st.integers(1, 3)), dim)
    chosen[0] = data.draw(st.sampled_from(["elastic", "local_saturating", "nonlocal_saturating"]))
    for place in range(3, 8):
        size = chosen[place].size
        chosen[place].flat = data.draw(st.lists(st.floats(), min_size=size, max_size=size))
    given_arrays = [np.copy(a) for a in chosen[3:8]]
    legal = all((np.abs(a) <= 1e60).all() for a in given_arrays) and (given_arrays[4] >= 0).all()
    try:
        _core.hencky_update(*chosen)
    except DOCUMENTED:
        assert not legal
        return
    assert legal
    assert all(np.isfinite(a).all() for a in chosen[5:8])


# ---- construction ----


def test_the_caught_keywords_build_an_engine(keywords):
    assert _core.Engine(**keywords).fields()


@QUICK
@given(data=st.data())
def test_engine_refuses_wrong_keywords(keywords, data):
    wrong = dict(keywords)
    names = st.lists(st.sampled_from(sorted(keywords)), min_size=1, max_size=3, unique=True)
    for name in data.draw(names):
        value = wrong[name]
        if isinstance(value, np.ndarray):
            wrong[name] = spoiled(value, data.draw(st.sampled_from(WAYS)))
        elif isinstance(value, dict):
            inner = dict(value)
            inner[data.draw(st.sampled_from(sorted(inner)))] = data.draw(numbers)
            wrong[name] = inner
        elif isinstance(value, tuple):
            inner = list(value)
            inner[data.draw(st.integers(0, len(inner) - 1))] = data.draw(numbers)
            wrong[name] = tuple(inner[: data.draw(st.integers(0, 4))])
        else:
            wrong[name] = data.draw(numbers)
    try:
        engine = _core.Engine(**wrong)
    except DOCUMENTED:
        return
    assert engine.scalars()["step"] == 0


@QUICK
@given(row=st.tuples(*[numbers] * 7), length=st.integers(0, 8))
def test_engine_refuses_wrong_walls(keywords, row, length):
    walls = [keywords["walls"][0], row[:length], *keywords["walls"][2:]]
    try:
        _core.Engine(**(keywords | {"walls": walls}))
    except DOCUMENTED:
        return
    assert length == 7


@QUICK
@given(
    lines=st.lists(st.integers(-5, 20), max_size=8),
    basis=st.integers(-1, 4),
    n=st.integers(-3, 12),
    periodic=st.booleans(),
)
def test_node_positions_refuses_wrong_axes(lines, basis, n, periodic):
    try:
        found = _core.node_positions(basis, n, periodic, np.array(lines, dtype=np.int32))
    except DOCUMENTED:
        return
    assert (np.diff(found) > 0).all()
    assert lines == sorted(set(lines))


@pytest.mark.parametrize("how", WAYS)
def test_node_positions_refuses_wrong_creases(how):
    lines = spoiled(np.array([2, 4, 6], dtype=np.int32), how)
    if how in ("int32", "read-only", "empty", "short", "flat"):
        assert len(_core.node_positions(2, 9, False, np.ascontiguousarray(lines)))
        return
    with pytest.raises((TypeError, ValueError)):
        _core.node_positions(2, 9, False, lines)


# ---- buffers ----


def bound(scene):
    sim = gr.Simulation(scene, threads=1)
    return core.build(scene, sim._mean_mass), sim.buffers, sim.n_points


@pytest.mark.parametrize("how", WAYS)
def test_bind_refuses_wrong_buffers(small_scene, how):
    scene = small_scene("walls", 2, ("quadratic", "tpic", "diffused"))
    engine, buffers, n = bound(scene)
    for name in buffers:
        with pytest.raises((TypeError, ValueError)):
            engine.bind(buffers | {name: spoiled(buffers[name], how)}, n, True)
        rest = {k: a for k, a in buffers.items() if k != name}
        with pytest.raises(ValueError, match=name):
            engine.bind(rest, n, True)
    with pytest.raises(RuntimeError, match="bind"):
        engine.advance(1, 1.0, 1)


def test_bind_refuses_overlapping_buffers(small_scene):
    engine, buffers, n = bound(small_scene("walls", 2, ("linear", "flip", "tracked")))
    for name, other in (("x", "v"), ("mass", "log_density")):
        with pytest.raises(ValueError, match="share memory"):
            engine.bind(buffers | {name: buffers[other]}, n, True)
    both = np.zeros(2 * len(buffers["id"]) + 8)
    one = both[: buffers["mass"].size].reshape(1, -1)
    half = both[8 : 8 + buffers["mass"].size].reshape(1, -1)
    with pytest.raises(ValueError, match="share memory"):
        engine.bind(buffers | {"mass": one, "shear_rate": half}, n, True)


def test_the_ids_must_not_share_memory_either(small_scene):
    engine, buffers, n = bound(small_scene("walls", 2, ("linear", "flip", "tracked")))
    shared = buffers["mass"].view(np.int64)[0]
    with pytest.raises(ValueError, match="share memory"):
        engine.bind(buffers | {"id": shared}, n, True)


@QUICK
@given(n=numbers, fresh=numbers)
def test_bind_refuses_wrong_counts(small_scene, n, fresh):
    engine, buffers, _ = bound(small_scene("walls", 2, ("linear", "flip", "tracked")))
    try:
        engine.bind(buffers, n, fresh)
        engine.regroup()
    except DOCUMENTED:
        return
    assert 0 <= n <= len(buffers["id"])


@QUICK
@given(steps=numbers, until=numbers, threads=numbers)
def test_advance_refuses_wrong_numbers(small_scene, steps, until, threads):
    sim = gr.Simulation(small_scene("walls", 2, ("linear", "flip", "tracked")), threads=1)
    few = steps if not isinstance(steps, int) or abs(steps) < 50 else -abs(steps)
    try:
        sim._engine.advance(few, until, threads)
    except DOCUMENTED:
        assert sim.steps == 0
    sim.step()


@QUICK
@given(data=st.data())
def test_restore_refuses_wrong_scalars(small_scene, data):
    sim = gr.Simulation(small_scene("walls", 2, ("linear", "flip", "tracked")), threads=1)
    before = sim._engine.scalars()
    name = data.draw(st.sampled_from(sorted(before)))
    try:
        sim._engine.restore(before | {name: data.draw(numbers)})
    except DOCUMENTED:
        assert sim._engine.scalars() == before
        sim.step()


@QUICK
@given(data=st.data())
def test_any_number_at_a_point_is_survived(small_scene, data):
    """A step on NaN, infinity or absurd numbers ends in SimulationError or goes on."""
    combination = data.draw(
        st.sampled_from([("linear", "flip", "tracked"), ("quadratic", "tpic", "diffused")])
    )
    sim = gr.Simulation(small_scene("periodic", 2, combination), threads=1)
    at = np.flatnonzero(sim.buffers["id"] >= 0)
    for _ in range(3):
        name = data.draw(st.sampled_from(sorted(set(sim.buffers) - {"id"})))
        array = sim.buffers[name]
        component = data.draw(st.integers(0, len(array) - 1))
        array[component, at[data.draw(st.integers(0, len(at) - 1))]] = data.draw(st.floats())
    sim._engine.restore(sim._engine.scalars())
    try:
        sim.step(3)
    except (gr.SimulationError, ValueError):
        return
    assert sim.steps == 3


def test_an_engine_without_points_says_so(keywords):
    engine = _core.Engine(**keywords)
    calls = (engine.regroup, engine.scatter, engine.grid, engine.gather, engine.nodes)
    for call in (*calls, engine.cells, engine.stable_dt, lambda: engine.advance(1, 1.0, 1)):
        with pytest.raises(RuntimeError, match="bind"):
            call()
    with pytest.raises(RuntimeError, match="already"):
        engine.__init__(**keywords)
    with pytest.raises(RuntimeError, match="bind"):
        _core.Engine.__new__(_core.Engine).advance(1, 1.0, 1)

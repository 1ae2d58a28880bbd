"""Wrong arguments to laws and diffusion in the core raise documented exceptions: no crash."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from spoiled import DOCUMENTED, QUICK, WAYS, numbers, spoiled

from granular import _core


def law_arguments(n=3, dim=2):
    lanes = _core.build_info()["lanes"]
    parameters = {
        "K": 1e6, "G": 1e6, "mu_s": 0.38, "mu_2": 0.64, "xi": 1.1,
        "cohesion": 0.0, "tensile_strength": 0.0,
    }  # fmt: skip
    return [
        "mu_I", dim, parameters, 1e-4, 0,
        np.zeros((n, dim * dim, lanes)), np.zeros(n * lanes),
        np.zeros((4 if dim == 2 else 6, n * lanes)), np.zeros(n * lanes), "",
    ]  # fmt: skip


def nonlocal_arguments(n=3, dim=2):
    """Arguments of the nonlocal law: those of `law_arguments`, with g_star and g."""
    given = law_arguments(n, dim)
    given[0] = "ngf"
    given[2] = dict(
        K=1e6, A=0.5, G=1e6, mu_s=0.38, mu_2=0.64, I0=0.28, rho_s=2450.0, d=0.005, t0=1e-3,
        p_averaging=0.0,
    )  # fmt: skip
    given[6][:] = 1e-3
    given[7][:3] = -1000.0
    places = n * _core.build_info()["lanes"]
    return [*given, np.ones(places), np.zeros(places)]


def fluidity_arguments(n=11):
    names = ("G", "mu_s", "mu_2", "I0", "rho_s", "d", "t0", "p_averaging")
    values = (3e5, 0.38, 0.64, 0.28, 2450.0, 5e-3, 1e-3, 0.0)
    arrays = [np.full(n, 0.5) for _ in range(6)]
    return [dict(zip(names, values, strict=True)), 1e-4, *arrays, ""]


def hencky_arguments(n=11, dim=2):
    parameters = {
        "K": 1e6, "G": 5e5, "reconnect_fluidity": 1.0, "mu_s": 0.38, "mu_2": 0.64,
        "I0": 0.28, "rho_s": 2550.0, "d": 4e-3, "t0": 1e-4, "p_averaging": 0.0,
    }  # fmt: skip
    arrays = [np.full(n, 1e-3), np.full((4 if dim == 2 else 6, n), -1.0), np.ones(n), np.ones(n)]
    return ["linear_ngf", parameters, 1e-4, np.zeros((dim * dim, n)), *arrays, ""]


def diffuse_arguments(shape=(3, 4)):
    return {
        "method": "implicit", "stencil": "faces", "dx": 0.01, "A": 0.5, "d": 0.005, "t0": 1e-3,
        "dt": 1e-3, "steps": 2,
        "tolerance": 1e-8, "max_iterations": 100, "periodic": (True, False, True)[: len(shape)],
        "first_radius": -1.0,
        "faces": np.zeros((2 * len(shape), *shape), np.uint8), "dense": np.ones(shape, bool),
        "g": np.ones(shape), "distance": np.full(shape, 0.005), "threads": 1, "isa": "",
    }  # fmt: skip


def call(function, given):
    return function(**given) if isinstance(given, dict) else function(*given)


CALLS = {
    "law": (_core.law_update, law_arguments, (5, 6)),
    "nonlocal": (_core.law_update, nonlocal_arguments, (5, 6, 10)),
    "fluidity": (_core.fluidity_update, fluidity_arguments, (2, 3, 4, 5)),
    "hencky": (_core.hencky_update, hencky_arguments, (3, 4)),
    "diffuse": (_core.fluidity_diffuse, diffuse_arguments, ("faces", "dense", "distance")),
}
"""Function, its arguments, and the places of the arrays that are only read."""


def places(name, array):
    """Places of the arguments that are arrays, or of those that are not."""
    made = CALLS[name][1]()
    items = made.items() if isinstance(made, dict) else enumerate(made)
    return [place for place, value in items if isinstance(value, np.ndarray) == array]


@pytest.mark.parametrize(("name", "place"), [(n, k) for n in CALLS for k in places(n, True)])
@pytest.mark.parametrize("how", WAYS)
def test_wrong_arrays_are_refused(name, place, how):
    function, arguments, read = CALLS[name]
    given = arguments()
    given[place] = spoiled(given[place], how)
    fine = ["read-only"]
    if name == "diffuse" and place != "distance":
        fine += ["swapped", "unaligned"]  # byte order does not matter to single bytes
    if (name, place) in (("nonlocal", 10), ("diffuse", "distance")):
        fine += ["none"]  # without a fluidity the law is in its local phase; no rough surface
    if place in read and how in fine:
        call(function, given)
        return
    if how == "long" and np.ndim(given[place]) == 3 and name != "diffuse":
        given[place] = given[place][..., :-1]  # a whole block more would fit
    with pytest.raises((TypeError, ValueError)):
        call(function, given)


@QUICK
@given(data=st.data())
@pytest.mark.parametrize("name", CALLS)
def test_wrong_numbers_are_refused(name, data):
    function, arguments, _ = CALLS[name]
    chosen, value = arguments(), data.draw(numbers)
    parameters = next((k for k in places(name, False) if isinstance(chosen[k], dict)), None)
    inner = [] if parameters is None else sorted(chosen[parameters])
    place = data.draw(st.sampled_from([*places(name, False), *inner]))
    (chosen[parameters] if place in inner else chosen)[place] = value
    if place == "steps" and isinstance(value, int) and value > 1000:
        return  # valid, but slow
    try:
        report = call(function, chosen)
    except DOCUMENTED:
        return
    # the value is valid for that argument
    assert isinstance(value, (int, float, np.floating))
    assert name != "diffuse" or report["clamped"] == 0


@pytest.mark.parametrize(
    ("name", "place", "other"),
    [
        *(("law", 8, other) for other in (6, 7)),
        *(("nonlocal", *pair) for pair in ((11, 8), (11, 6), (10, 11))),
        ("fluidity", 7, 3),
        *(("hencky", *pair) for pair in ((7, 6), (6, 4))),
    ],
)
def test_no_points_are_taken_and_shared_memory_is_refused(name, place, other):
    function, arguments, _ = CALLS[name]
    for options in ({},) if name == "fluidity" else ({"dim": 2}, {"dim": 3}):
        function(*arguments(0, **options))
        shared = arguments(**options)
        shared[place] = shared[other].ravel()[: shared[place].size]
        with pytest.raises(ValueError, match="share memory"):
            function(*shared)


def test_fluidities_that_lack():
    given = nonlocal_arguments()
    _core.law_update(*given)
    assert (given[11] > 0).all()
    with pytest.raises(ValueError, match="g_star is given without g"):
        _core.law_update(*nonlocal_arguments()[:-1])
    with pytest.raises(ValueError, match="parameter t0 is missing"):
        given[2] = {k: v for k, v in given[2].items() if k != "t0"}
        _core.law_update(*given)
    _core.law_update(*nonlocal_arguments()[:-2])


# ---- any number ----


def fill(data, array, values=None):
    """Draw each number of an array."""
    values = st.floats() if values is None else values
    array.flat = data.draw(st.lists(values, min_size=array.size, max_size=array.size))


@QUICK
@given(data=st.data())
@pytest.mark.parametrize("name", ["law", "nonlocal"])
def test_laws_survive_any_number(name, data):
    dim = data.draw(st.sampled_from([2, 3]))
    chosen = CALLS[name][1](1 if name == "law" else 2, dim)
    if name == "law":
        law = data.draw(st.sampled_from(sorted(_core.laws())))
        chosen[0], chosen[4] = law, data.draw(st.integers(0, 1))
        chosen[2] = {parameter: 0.5 for parameter, *_ in _core.laws()[law][1]}
    for place in places(name, True):
        fill(data, chosen[place])
    if chosen[0] == "dilatant_mu_I":
        with pytest.raises(ValueError, match="bulking is not given"):
            _core.law_update(*chosen)
        chosen += [None] * (14 - len(chosen)) + [np.empty_like(chosen[6])]
        fill(data, chosen[-1])
    _core.law_update(*chosen)


@QUICK
@given(data=st.data())
def test_fluidity_diffuse_survives_any_number(data):
    shape = data.draw(st.sampled_from([(1, 1), (2, 3), (1, 2, 3)]))
    chosen = diffuse_arguments(shape)
    chosen["method"] = data.draw(st.sampled_from(["explicit", "implicit", "rkl2"]))
    chosen["stencil"] = data.draw(st.sampled_from(["faces", "isotropic"]))
    fill(data, chosen["g"])
    fill(data, chosen["dense"].view(np.uint8), st.integers(0, 255))
    fill(data, chosen["faces"], st.integers(0, 3))
    fill(data, chosen["distance"])
    legal = (chosen["faces"] < 3).all() and ((chosen["g"] >= 0) & (chosen["g"] <= 1e60)).all()
    legal &= (abs(chosen["distance"]) <= 1e60).all()
    try:
        _core.fluidity_diffuse(**chosen)
    except DOCUMENTED:
        assert not legal
        return
    assert legal
    assert (chosen["g"] >= 0).all()
    assert np.isfinite(chosen["g"]).all()


@QUICK
@given(data=st.data())
def test_hencky_update_survives_any_number(data):
    dim = data.draw(st.sampled_from([2, 3]))
    chosen = hencky_arguments(data.draw(st.integers(1, 3)), dim)
    chosen[0] = data.draw(st.sampled_from(["elastic", "mu_I", "ngf"]))
    for place in range(3, 8):
        fill(data, chosen[place])
    given_arrays = [np.copy(a) for a in chosen[3:8]]
    legal = all((np.abs(a) <= 1e60).all() for a in given_arrays) and (given_arrays[4] >= 0).all()
    try:
        _core.hencky_update(*chosen)
    except DOCUMENTED:
        assert not legal
        return
    assert legal
    assert all(np.isfinite(a).all() for a in chosen[5:8])

"""Wrong arguments to laws and diffusion in the core raise documented exceptions: no crash."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from spoiled import DOCUMENTED, QUICK, WAYS, numbers, spoiled

from granular import _core


def law_arguments(n=3, dim=2):
    lanes = _core.build_info()["lanes"]
    return [
        "mu_I", dim, {"K": 1e6, "G": 1e6, "mu_s": 0.38, "mu_2": 0.64, "xi": 1.1}, 1e-4, 0,
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
        _core.law_update(*wrong)  # the array is only read, so that the call may succeed
        return
    if how == "long" and place == 5:
        wrong[5] = wrong[5][..., : wrong[5].shape[-1] - 1]
    with pytest.raises((TypeError, ValueError)):
        _core.law_update(*wrong)


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
    return [*given, np.ones(n), np.zeros(n * _core.build_info()["lanes"])]


@pytest.mark.parametrize("place", [10, 11])
@pytest.mark.parametrize("how", WAYS)
def test_law_update_refuses_wrong_fluidities(place, how):
    wrong = nonlocal_arguments()
    wrong[place] = spoiled(wrong[place], how)
    if (how, place) == ("read-only", 10) or (how, place) == ("none", 10):
        # the array is only read; without a fluidity the law is in its local phase
        _core.law_update(*wrong)
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
    # the value is valid for that argument
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
    names = ("G", "mu_s", "mu_2", "I0", "rho_s", "d", "t0", "p_averaging")
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
        _core.fluidity_update(*wrong)  # the array is only read, so that the call may succeed
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
        # the array is only read; byte order does not matter to single bytes
        _core.fluidity_diffuse(**wrong)
        return
    with pytest.raises((TypeError, ValueError)):
        _core.fluidity_diffuse(**wrong)


@QUICK
@given(
    place=st.sampled_from(
        [0, 1, 8, *("G", "mu_s", "mu_2", "I0", "rho_s", "d", "t0", "p_averaging")]
    ),
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
        return  # valid, but slow
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
    "K": 1e6, "G": 5e5, "reconnect_fluidity": 1.0, "mu_s": 0.38, "mu_2": 0.64,
    "I0": 0.28, "rho_s": 2550.0, "d": 4e-3, "t0": 1e-4, "p_averaging": 0.0,
}  # fmt: skip


def hencky_arguments(n=11, dim=2):
    arrays = [np.full(n, 1e-3), np.full((4 if dim == 2 else 6, n), -1.0), np.ones(n), np.ones(n)]
    return ["linear_ngf", dict(HENCKY), 1e-4, np.zeros((dim * dim, n)), *arrays, ""]


@pytest.mark.parametrize("place", range(3, 8))
@pytest.mark.parametrize("how", WAYS)
def test_hencky_update_refuses_wrong_arrays(place, how):
    wrong = hencky_arguments()
    wrong[place] = spoiled(wrong[place], how)
    if how == "read-only" and place in (3, 4):
        _core.hencky_update(*wrong)  # the array is only read, so that the call may succeed
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
    chosen[0] = data.draw(st.sampled_from(["elastic", "mu_I", "ngf"]))
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

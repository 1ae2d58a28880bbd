"""Diffusion of the fluidity against exact solutions: orders in dx and dt, explicit limit."""

import itertools
import math

import numpy as np
import pytest
from oracle_fluidity import ROUGH, diffuse, faces_of, outflow

RATE = 0.25 * 0.005**2 / 1e-3
"""A^2 d^2/t0 in m^2/s with the numbers of `diffuse`."""
LENGTH = 0.2


# Shapes along one axis of [0, 1]: value at u, and the eigenvalue of -(d/du)^2.
def periodic(u, n):
    return np.cos(2 * math.pi * n * u + 0.3), (2 * math.pi * n) ** 2


def smooth(u, n):
    return np.cos(math.pi * n * u), (math.pi * n) ** 2


def rough(u, n):
    return np.sin(math.pi * n * u), (math.pi * n) ** 2


def rough_below(u, n):
    return np.sin(math.pi * (n - 0.5) * u), (math.pi * (n - 0.5)) ** 2


ENDS = {periodic: (), smooth: (), rough: ("low", "high"), rough_below: ("low",)}
CASES = [
    (rough, rough), (periodic, rough_below), (smooth, rough), (rough_below, smooth),
    (periodic, periodic, rough), (rough, smooth, rough_below), (smooth, periodic, rough),
]  # fmt: skip


def modes(case):
    """Weights and orders of the products that make the solution; the first keeps it positive."""
    constant = {periodic: 0, smooth: 0, rough: 1, rough_below: 1}
    first = tuple(constant[kind] for kind in case)
    yield 1.0, first
    for axis in range(len(case)):
        yield 0.1, tuple(n + (a == axis) for a, n in enumerate(first))
    yield 0.03, tuple(n + 1 for n in first)


def solution(case, n, t):
    """Exact field at the centres of n cells along each axis."""
    u = (np.arange(n) + 0.5) / n
    total = 0.0
    for weight, orders in modes(case):
        field, decay = np.ones(()), 0.0
        for axis, (kind, order) in enumerate(zip(case, orders, strict=True)):
            value, square = kind(u, order)
            field = field * value.reshape((-1,) + (1,) * axis)
            decay += square
        total = total + weight * math.exp(-decay * RATE * t / LENGTH**2) * field
    return total


def grid_of(case, n):
    """Faces and periodic axes of a case."""
    sides = {
        f"{name}_{end}": ROUGH
        for name, kind in zip("xyz", case, strict=False)
        for end in ENDS[kind]
    }
    return {
        "faces": faces_of((n,) * len(case), **sides),
        "periodic": tuple(kind is periodic for kind in case),
    }


def numbers(case, n):
    return grid_of(case, n) | {"dx": LENGTH / n}


def limit(case, n):
    start = solution(case, n, 0.0)
    return diffuse(start, method="explicit", dt=1e-12, steps=0, **numbers(case, n))[1]["limit"]


@pytest.mark.parametrize("stencil", ["faces", "isotropic"])
@pytest.mark.parametrize("case", CASES, ids=lambda case: "-".join(kind.__name__ for kind in case))
def test_second_order_in_the_cell_size(case, stencil):
    """rkl2 with steps so short that only the grid errs: halving dx leaves a quarter."""
    time, errors = 0.1 * LENGTH**2 / RATE / math.pi**2, []
    for n in (8, 16, 32) if len(case) == 2 else (6, 12, 24):
        steps = 64
        start = solution(case, n, 0.0)
        assert (start > 0).all()
        found, report = diffuse(
            start, method="rkl2", dt=time / steps, steps=steps, stencil=stencil, **numbers(case, n)
        )
        assert not report["clamped"]
        errors.append(abs(found - solution(case, n, time)).max())
    orders = [math.log2(a / b) for a, b in itertools.pairwise(errors)]
    assert errors[-1] < 1e-3 * start.max()
    assert orders[-1] == pytest.approx(2.0, abs=0.05)


def wave_error(n, numbers, stencil):
    """Relative error of the decay rate of a wave with given numbers of lengths along each axis."""
    place = np.indices((n,) * len(numbers))
    wave = np.cos(2 * math.pi / n * sum(m * u for m, u in zip(numbers, place[::-1], strict=True)))
    found, report = diffuse(
        1.0 + wave, method="explicit", dt=1e-6, stencil=stencil, periodic=(True,) * len(numbers),
        dx=LENGTH / n,
    )  # fmt: skip
    assert not report["clamped"]
    rate = -math.log(((found - 1.0) * wave).sum() / (wave * wave).sum()) / 1e-6
    return rate / (RATE * (2 * math.pi / LENGTH) ** 2 * sum(m * m for m in numbers)) - 1.0


def test_isotropy():
    """Spread of the decay rates of waves of one length in different directions.

    The difference is of second order with faces and of fourth with the isotropic stencil.
    """
    for waves, n in ((((5, 0), (3, 4)), 32), (((3, 0, 0), (2, 2, 1)), 20)):
        unlike = {}
        for stencil in ("faces", "isotropic"):
            for cells in (n, 2 * n):
                first, second = (wave_error(cells, wave, stencil) for wave in waves)
                unlike[stencil, cells] = abs(first - second)
        assert unlike["isotropic", n] < 0.1 * unlike["faces", n]
        orders = {
            name: math.log2(unlike[name, n] / unlike[name, 2 * n])
            for name in ("faces", "isotropic")
        }
        assert orders["faces"] == pytest.approx(2.0, abs=0.1)
        assert orders["isotropic"] == pytest.approx(4.0, abs=0.1)


def semidiscrete(case, n, time):
    """Solution on the grid that is exact in time: exp of the outflow matrix."""
    parts, start = grid_of(case, n), solution(case, n, 0.0)
    value, vectors = np.linalg.eigh(outflow(np.ones(start.shape, bool), **parts))
    decay = np.exp(-value * RATE * time * n**2 / LENGTH**2)
    return start, (vectors @ (decay * (vectors.T @ start.ravel()))).reshape(start.shape)


@pytest.mark.parametrize(
    ("method", "limits", "order"),
    [("explicit", 0.5, 1), ("implicit", 8.0, 1), ("rkl2", 2.4, 2), ("rkl2", 6.8, 2)],
)
@pytest.mark.parametrize(
    "case", CASES[:2] + CASES[-1:], ids=lambda case: f"{len(case)}d-{case[0].__name__}"
)
def test_order_in_time(method, limits, order, case):
    """Errors against the exact solution on the same grid, for a number of explicit limits and half.

    The number of rkl2 stages is the same for both (3 or 5), as the error of a step depends on it.
    """
    n = 16 if len(case) == 2 else 8
    time = 24 * limits * limit(case, n)
    start, exact = semidiscrete(case, n, time)
    errors = []
    for steps in (24, 48):
        found, report = diffuse(
            start, method=method, dt=time / steps, steps=steps, **numbers(case, n)
        )
        assert not report["clamped"]
        assert method != "rkl2" or report["iterations"] == steps * (3 if limits < 2.5 else 5)
        errors.append(abs(found - exact).max())
    assert math.log2(errors[0] / errors[1]) == pytest.approx(order, abs=0.1)
    assert errors[-1] < (1e-2 if order == 1 else 1e-4) * start.max()


@pytest.mark.parametrize("shape", [(1, 24), (14, 14), (7, 7, 7)], ids=["1d", "2d", "3d"])
def test_explicit_limit_is_sharp(shape):
    """0.98 of the limit decays; 1.02 is refused, and would grow, by eigenvalue and by trial."""
    axes = sum(n > 1 for n in shape)
    names = [f"{'xyz'[a]}_{end}" for a in range(axes) for end in ("low", "high")]
    faces = faces_of(shape, **dict.fromkeys(names, ROUGH))
    g = 1.0 + np.random.default_rng(1).random(shape)
    bulk = 0.01**2 / (2 * axes * RATE)
    assert diffuse(g, method="explicit", dt=1e-9, faces=faces)[1]["limit"] == pytest.approx(bulk)

    L = outflow(np.ones(shape, bool), faces, (False,) * len(shape))
    largest = np.linalg.eigvalsh(L)[-1]
    assert largest == pytest.approx(4 * axes, rel=1e-12)
    stable, unstable = (part * bulk * RATE / 0.01**2 for part in (0.98, 1.02))
    assert abs(1 - stable * largest) < 1 < abs(1 - unstable * largest)

    # a field that stays positive when the shortest wave is added
    value, vectors = np.linalg.eigh(L)
    shortest = vectors[:, -1].reshape(shape) / abs(vectors[:, -1]).max()
    slowest = abs(vectors[:, 0].reshape(shape))
    start = slowest / slowest.max() + 1e-3 * shortest * slowest.min() / slowest.max()
    found, report = diffuse(start, method="explicit", dt=0.98 * bulk, steps=40, faces=faces)
    assert not report["clamped"]
    decay = vectors @ ((1 - stable * value) ** 40 * (vectors.T @ start.ravel()))
    np.testing.assert_allclose(found, decay.reshape(shape), atol=1e-12)
    assert np.linalg.norm(found) < np.linalg.norm(start)

    with pytest.raises(ValueError, match="must be shorter than"):
        diffuse(g, method="explicit", dt=1.02 * bulk, faces=faces)
    grown = start.ravel()
    for _ in range(1500):
        grown = grown - unstable * (L @ grown)
    assert abs(grown).max() > 1e6

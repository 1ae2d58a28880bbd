"""Diffusion of the fluidity on a grid: plain matrices, same bits, sums, bounds, bad input."""

import math

import numpy as np
import oracle_fluidity as oracle
import pytest
from oracle_fluidity import LINKED, OPEN, ROUGH, diffuse, faces_of, number_k, random_parts

from granular import _core

METHODS = ("explicit", "implicit", "rkl2")
ISAS = oracle.available()
SHAPES = [(7, 9), (1, 12), (12, 1), (2, 5), (5, 4, 6), (1, 3, 2), (3, 1, 1)]
SHORT = 2e-3
"""Time step [s] below the explicit limit of `diffuse`, which is 4e-3 s in 2D and 2.7e-3 s in 3D."""


def random_grid(shape, seed):
    """Random faces inside and at the ends, a random mask, some axes periodic, any size."""
    rng = np.random.default_rng(seed)
    return random_parts(shape, rng), 10 ** rng.uniform(-6, 1, shape)


@pytest.mark.parametrize("isa", ISAS)
@pytest.mark.parametrize("shape", SHAPES, ids=str)
@pytest.mark.parametrize("method", METHODS)
def test_a_step_is_that_of_the_plain_matrix(method, shape, isa):
    for seed in range(8):
        parts, g = random_grid(shape, seed)
        L = oracle.outflow(**parts)
        start = np.where(parts["dense"], g, 0.0)
        limit = diffuse(g, method="explicit", dt=1e-9, steps=0, **parts)[1]["limit"]
        dt = (0.9 if method == "explicit" else 7.0) * min(limit, 4e-3)
        found, report = diffuse(g, method=method, dt=dt, isa=isa, **parts)
        plain = oracle.step(method, L, number_k(dt), start.ravel(), dt / limit).reshape(shape)
        np.testing.assert_allclose(found, np.maximum(plain, 0), atol=1e-12 * g.max())
        assert report["clamped"] == (plain < -1e-13 * g.max()).sum()
        assert not found[~parts["dense"]].any()


def test_explicit_steps_that_undershoot_are_clamped_and_counted():
    g = np.zeros((6, 6))
    g[0, 0] = 1.0
    faces = faces_of(g.shape, x_low=ROUGH, y_low=ROUGH)
    limit = 4e-3
    found, report = diffuse(g, method="explicit", dt=0.99 * limit, faces=faces)
    assert report["limit"] == pytest.approx(limit, rel=1e-14)
    assert 1 - 6 * number_k(0.99 * limit) < 0  # two links, two no-slip faces
    assert report["clamped"] == 1
    assert found[0, 0] == 0.0
    assert found[0, 1] == pytest.approx(number_k(0.99 * limit), rel=1e-14)


@pytest.mark.parametrize("shape", [(9, 11), (5, 4, 6)], ids=str)
def test_backward_euler_is_an_m_matrix(shape):
    """No new value is negative, however long the step: no entry of the inverse is negative."""
    for seed in range(6):
        parts, _ = random_grid(shape, seed)
        k = number_k(1.0)
        matrix = np.eye(parts["dense"].size)
        matrix += k * oracle.outflow(**parts)
        assert (matrix - np.diag(np.diag(matrix)) <= 0).all()
        inverse = np.linalg.inv(matrix)
        assert inverse.min() >= -1e-16
        spike = np.zeros(shape)
        where = tuple(np.argwhere(parts["dense"])[seed])
        spike[where] = 1.0
        found, _ = diffuse(spike, dt=1.0, **parts)
        assert (found >= 0).all()
        column = inverse[:, np.ravel_multi_index(where, shape)].reshape(shape)
        np.testing.assert_allclose(found, column, atol=1e-12)


def test_backward_euler_stays_positive_where_rkl2_does_not():
    g = np.zeros((15, 15))
    g[7, 7] = 1.0
    dt = 20 * 4e-3
    found, report = diffuse(g, dt=dt)
    assert report["clamped"] == 0
    assert (found > 0).all()
    undershot = [diffuse(g, method="rkl2", dt=r * 4e-3)[1]["clamped"] for r in (2, 5, 20, 60)]
    assert any(undershot)


@pytest.mark.parametrize("method", METHODS)
def test_a_fluidity_that_dies_out_is_no_error(method):
    """The fluidity of a jammed fill falls by a factor in each step; its squares underflow early."""
    parts, g = random_grid((20, 20), 1)
    expected, _ = diffuse(g, method=method, dt=SHORT, **parts)
    for exponent in np.arange(-130, -320, -0.25):
        found, _ = diffuse(g * 10.0**exponent, method=method, dt=SHORT, **parts)
        assert 0 <= found.min() <= found.max() <= g.max() * 10.0**exponent
        if exponent >= -140:
            np.testing.assert_allclose(found / 10.0**exponent, expected, atol=1e-8 * g.max())


@pytest.mark.parametrize("tolerance", [1e-2, 1e-4, 1e-8, 1e-12])
def test_tolerance_bounds_the_error_of_backward_euler(tolerance):
    parts, g = random_grid((20, 20), 1)
    L = oracle.outflow(**parts)
    dense = np.where(parts["dense"], g, 0).ravel()
    for dt in (1e-4, 0.1):  # the tolerance is relative to the change, however short the step
        k = number_k(dt)
        exact = oracle.step("implicit", L, k, dense).reshape(g.shape)
        found, _ = diffuse(g, dt=dt, tolerance=tolerance, **parts)
        size, rounding = np.linalg.norm(k * (L @ dense)), 1e-15 * np.linalg.norm(dense)
        assert np.linalg.norm(found - exact) <= tolerance * size + rounding
        assert np.linalg.norm(found - exact) > 1e-6 * tolerance * size or tolerance < 1e-10


@pytest.mark.parametrize("isa", ISAS)
@pytest.mark.parametrize("shape", [(70, 71), (17, 18, 19)], ids=str)
@pytest.mark.parametrize("method", METHODS)
def test_bits_do_not_depend_on_threads(method, shape, isa):
    parts, g = random_grid(shape, 2)
    dt = SHORT if method == "explicit" else 20 * SHORT
    runs = [
        diffuse(g, method=method, dt=dt, steps=5, threads=threads, isa=isa, **parts)
        for threads in (1, 2, 3)
    ]
    assert not (runs[0][0] == g).all()
    for found, report in runs[1:]:
        assert (found == runs[0][0]).all()
        assert report == runs[0][1]


@pytest.mark.parametrize("method", METHODS)
def test_steps_in_one_call_are_those_of_many(method):
    parts, g = random_grid((20, 30), 3)
    together, report = diffuse(g, method=method, dt=SHORT, steps=4, **parts)
    apart, iterations, clamped = g, 0, 0
    for _ in range(4):
        apart, one = diffuse(apart, method=method, dt=SHORT, **parts)
        iterations, clamped = iterations + one["iterations"], clamped + one["clamped"]
    assert (apart == together).all()
    assert (iterations, clamped) == (report["iterations"], report["clamped"])


@pytest.mark.parametrize("shape", [(40, 30), (9, 10, 11)], ids=str)
@pytest.mark.parametrize("method", METHODS)
def test_dropped_links_keep_the_sum_and_no_slip_walls_do_not(method, shape):
    parts, g = random_grid(shape, 4)
    parts["faces"][parts["faces"] == ROUGH] = OPEN
    g += 20.0  # far from zero: rkl2 undershoots, and clamping adds fluidity
    dt = SHORT if method == "explicit" else 5 * SHORT
    before = g[parts["dense"]].sum()
    found, report = diffuse(g, method=method, dt=dt, steps=10, tolerance=1e-14, **parts)
    assert not report["clamped"]
    assert abs(found - np.where(parts["dense"], g, 0)).max() > 1.0
    assert found.sum() == pytest.approx(before, rel=1e-13)
    parts["faces"][0, ..., 3][parts["dense"][..., 3]] = ROUGH
    found, _ = diffuse(g, method=method, dt=dt, steps=10, **parts)
    assert found.sum() < 0.99 * before


@pytest.mark.parametrize("method", METHODS)
def test_a_uniform_field_stays_to_the_last_bit(method):
    parts, _ = random_grid((20, 21), 5)
    parts["faces"][parts["faces"] == ROUGH] = OPEN
    g = np.where(parts["dense"], 0.1, 0.0)
    found, report = diffuse(g, method=method, dt=SHORT, steps=3, **parts)
    assert abs(found - g).max() <= (0.0 if method != "rkl2" else 1e-16)
    assert report["iterations"] == (0 if method != "rkl2" else 9)


def test_what_is_not_dense_is_left_out_and_becomes_zero():
    g = np.full((5, 5), 2.0)
    dense = np.ones((5, 5), dtype=bool)
    dense[2, :] = False
    g[:2] = 1.0
    found, _ = diffuse(g, dense=dense, dt=1.0)
    assert (found[:2] == 1.0).all()
    assert not found[2].any()
    assert (found[3:] == 2.0).all()


@pytest.mark.parametrize("method", METHODS)
def test_no_amplitude_no_diffusion(method):
    parts, g = random_grid((6, 7), 6)
    found, report = diffuse(g, method=method, A=0.0, dt=10.0, **parts)
    assert report["limit"] == math.inf
    np.testing.assert_allclose(
        found, np.where(parts["dense"], g, 0), rtol=0 if method != "rkl2" else 1e-14
    )


# ---- the limit ----


@pytest.mark.parametrize(
    ("shape", "sides", "axes"),
    [
        ((1, 30), {}, 1),
        ((1, 30), {"x_low": ROUGH, "x_high": ROUGH}, 1),
        ((1, 30), {"y_low": ROUGH}, 1.5),
        ((30, 30), {}, 2),
        ((30, 30), dict.fromkeys(("x_low", "x_high", "y_low", "y_high"), ROUGH), 2),
        ((1, 1, 9), {}, 1),
        ((9, 1, 9), {}, 2),
        ((9, 9, 9), {}, 3),
    ],
)
def test_explicit_limit(shape, sides, axes):
    faces = faces_of(shape, **sides)
    report = diffuse(np.ones(shape), method="explicit", dt=1e-9, faces=faces)[1]
    assert report["limit"] == pytest.approx(
        0.01**2 * 1e-3 / (2 * axes * 0.25 * 0.005**2), rel=1e-14
    )


def test_limit_names_the_numbers_before_any_work():
    g = np.ones((4, 4))
    with pytest.raises(
        ValueError,
        match=r"dt = 0\.005 s must be shorter than 0\.004 s, .* explicit .* dx = 0\.01 m",
    ):
        diffuse(g, method="explicit", dt=0.005)
    with pytest.raises(ValueError, match=r"dt = 1e\+09 s must be shorter than .* rkl2"):
        diffuse(g, method="rkl2", dt=1e9)
    diffuse(g, method="implicit", dt=1e9)


def test_stages_grow_with_the_root_of_the_step():
    for ratio in (0.5, 2.4, 2.6, 6.9, 7.1, 200.0, 2e5):
        report = diffuse(np.ones((4, 4)), method="rkl2", dt=ratio * 4e-3)[1]
        assert report["iterations"] == oracle.stages(ratio)


# ---- bad input ----


def test_iterations_that_do_not_suffice_are_an_error_that_leaves_the_field():
    parts, g = random_grid((20, 20), 7)
    before = g.copy()
    with pytest.raises(
        RuntimeError, match=r"did not converge to tolerance = 1e-13 in max_iterations = 2"
    ):
        diffuse(g, dt=1.0, max_iterations=2, **parts)
    assert (g == before).all()


@pytest.mark.parametrize(
    ("change", "text"),
    [
        ({"A": -1.0}, "A = -1 must be zero or positive"),
        ({"A": math.nan}, "A = nan"),
        ({"t0": 0.0}, "t0 = 0 must be positive"),
        ({"t0": -1e-3}, "t0 = -0.001 must be positive"),
        ({"d": 0.0}, "d = 0 must be positive"),
        ({"d": -1.0}, "d = -1 must be positive"),
        ({"dx": 0.0}, "dx = 0 must be positive"),
        ({"dt": -1.0}, "dt = -1 must be positive"),
        ({"dt": math.nan}, "dt = nan must be positive and finite"),
        ({"tolerance": 0.0}, "tolerance = 0 must be positive"),
        ({"tolerance": 1.0}, "tolerance must be below 1"),
        ({"max_iterations": 0}, "max_iterations = 0 must be at least 1"),
        ({"steps": -1}, "steps = -1 must not be negative"),
        ({"threads": 0}, "threads = 0 must be 1 to"),
        ({"threads": 2000}, "threads = 2000 must be 1 to 1024"),
        ({"method": "euler"}, 'no method "euler"'),
        ({"isa": "sse9"}, "not available"),
        ({"periodic": (True,)}, "periodic must be a tuple of 2"),
        ({"periodic": [True, False]}, "periodic must be a tuple of 2"),
        ({"A": 1e200}, "not valid"),
        ({"faces": np.full((4, 3, 4), 3, dtype=np.uint8)}, "faces has the value 3"),
        ({"faces": np.zeros((4, 4, 3), dtype=np.uint8)}, "axis 1 of faces has length 4"),
        ({"dense": np.ones((4, 4), dtype=bool)}, "axis 0 of dense has length 4"),
    ],
)
def test_arguments_are_checked(change, text):
    with pytest.raises(ValueError, match=text):
        diffuse(np.ones((3, 4)), **change)


def test_values_and_kinds_of_arrays_are_checked():
    for bad in (math.nan, math.inf, -1e-3, 1e61):
        g = np.ones((3, 4))
        g[1, 2] = bad
        with pytest.raises(ValueError, match=r"g\[6\] = .* is outside the range"):
            diffuse(g)
    with pytest.raises(TypeError, match="g has dtype"):
        diffuse(np.ones((3, 4), dtype=np.float32))
    with pytest.raises(TypeError, match="dense has dtype"):
        diffuse(np.ones((3, 4)), dense=np.ones((3, 4)))
    with pytest.raises(TypeError, match="faces has dtype"):
        diffuse(np.ones((3, 4)), faces=np.zeros((4, 3, 4)))
    with pytest.raises(ValueError, match="g has 1 dimensions"):
        diffuse(np.ones(3), faces=np.zeros((2, 3), np.uint8), dense=np.ones(3, bool))
    with pytest.raises(ValueError, match="g has no cells"):
        diffuse(np.ones((0, 4)))
    shared = np.zeros((4, 3, 4), dtype=np.uint8)
    with pytest.raises(ValueError, match="share memory"):
        diffuse(np.ones((3, 4)), faces=shared, dense=shared[0].view(bool))
    for change in ({"first_radius": -0.5}, {"first_radius": np.inf}):
        with pytest.raises(ValueError, match="first_radius"):
            diffuse(np.ones((3, 4)), **change)
    with pytest.raises(ValueError, match="first_radius = 0 must be"):
        diffuse(np.ones((3, 4)), first_radius=0.0, periodic=(True, False))
    with pytest.raises(TypeError):
        _core.fluidity_diffuse()


# ---- the isotropic stencil: weights, mirrors at surfaces and walls, eigenvalues ----


SHARES = {2: {1: 4 / 6, 2: 1 / 6}, 3: {1: 14 / 30, 2: 3 / 30, 3: 1 / 30}}
STIFFEST = {2: 16 / 3, 3: 92 / 15}
TINY = 1e-5
"""Time step [s] so short that the change is L g but for round-off."""


def outflow(dense, faces, periodic):
    """Matrix L of the stencil, column by column from explicit steps of single cells."""
    columns = []
    for i in range(dense.size):
        g = np.zeros(dense.size)
        g[i] = 1.0
        after, _ = diffuse(
            g.reshape(dense.shape), stencil="isotropic", method="explicit", dt=TINY,
            faces=faces, dense=dense, periodic=periodic,
        )  # fmt: skip
        columns.append((dense.ravel() * g - after.ravel()) / number_k(TINY))
    return np.array(columns).T


def mirrored(g, ends, periodic):
    """The grid with one more cell at each end: its mirror image, times -1 at no-slip ends."""
    dim = g.ndim
    for axis in range(dim):
        place = dim - 1 - axis
        if periodic[axis]:
            width = [(1, 1) if k == place else (0, 0) for k in range(dim)]
            g = np.pad(g, width, mode="wrap")
            continue
        low, high = np.take(g, [0], place), np.take(g, [-1], place)
        signs = [-1 if ends[2 * axis + side] == ROUGH else 1 for side in (0, 1)]
        g = np.concatenate([signs[0] * low, g, signs[1] * high], axis=place)
    return g


def plain_outflow(g, ends, periodic):
    """L g of a box of dense cells, computed from its mirror images."""
    wide = mirrored(g, ends, periodic)
    inner = tuple(slice(1, -1) for _ in g.shape)
    out = np.zeros_like(g)
    for step in np.ndindex((3,) * g.ndim):
        axes = sum(s != 1 for s in step)
        if axes:
            shifted = tuple(slice(s, s + n) for s, n in zip(step, g.shape, strict=True))
            out += SHARES[g.ndim][axes] * (wide[inner] - wide[shifted])
    return out


@pytest.mark.parametrize(
    "shape", [(9, 11), (1, 12), (2, 5), (4, 3, 6), (1, 3, 2), (3, 1, 1)], ids=str
)
def test_a_box_is_a_part_of_its_mirror_images(shape):
    rng = np.random.default_rng(2)
    names = [f"{axis}_{side}" for axis in "xyz"[: len(shape)] for side in ("low", "high")]
    for _ in range(8):
        ends = rng.choice([OPEN, ROUGH], 2 * len(shape))
        periodic = tuple(bool(p) for p in rng.random(len(shape)) < 0.3)
        kinds = [LINKED if periodic[k // 2] else end for k, end in enumerate(ends)]
        g = rng.random(shape)
        faces = faces_of(shape, **dict(zip(names, kinds, strict=True)))
        after, _ = diffuse(
            g, stencil="isotropic", method="explicit", dt=TINY, faces=faces, periodic=periodic
        )
        wanted = g - number_k(TINY) * plain_outflow(g, kinds, periodic)
        np.testing.assert_allclose(after, wanted, rtol=0, atol=1e-15)


def random_walls(shape, seed):
    """Random walls and dense cells; for some seeds all cells dense, or no walls."""
    shares = [(0.8, 0.1, 0.1), (1.0, 0.0, 0.0), (0.3, 0.0, 0.7)][seed % 3]
    dense = (1.0, 0.8, 0.5)[seed // 3 % 3]
    return random_parts(shape, np.random.default_rng(seed), shares, dense)


@pytest.mark.parametrize("shape", [(6, 7), (1, 5), (2, 2, 3), (3, 4, 5)], ids=str)
def test_matrix_of_any_grid(shape):
    """The matrix is symmetric, an M-matrix, and has no eigenvalue beyond the limit."""
    for seed in range(18):
        parts = random_walls(shape, seed)
        L = outflow(**parts)
        np.testing.assert_allclose(L, L.T, rtol=0, atol=1e-9)
        off = L - np.diag(np.diag(L))
        assert off.max() <= 1e-9
        assert (L.sum(axis=1) >= -1e-9).all()
        assert not L[~parts["dense"].ravel()].any()
        assert np.linalg.eigvalsh(L).max() <= STIFFEST[len(shape)] + 1e-9


@pytest.mark.parametrize(("shape", "limit"), [((8, 8), 3 / 8), ((8, 8, 8), 15 / 46)], ids=str)
def test_limit_is_that_of_the_shortest_wave(shape, limit):
    """The stiffest wave decays just below the limit; at the limit the step is refused."""
    step = limit / number_k(1.0)
    wave = sum(np.indices(shape)) % 2 * 2.0 - 1.0
    both = {"periodic": (True,) * len(shape), "stencil": "isotropic", "method": "explicit"}
    after, report = diffuse(1.0 + 0.5 * wave, dt=0.999 * step, **both)
    assert report["limit"] == pytest.approx(step, rel=1e-14)
    np.testing.assert_allclose((after - 1.0) / wave, 0.5 * (1 - 2 * 0.999), rtol=1e-12)
    with pytest.raises(ValueError, match=r'limit of the explicit .* "isotropic"'):
        diffuse(wave + 1.0, dt=step, **both)


@pytest.mark.parametrize("method", ["explicit", "implicit", "rkl2"])
@pytest.mark.parametrize("isa", ["baseline", ""])
def test_methods_and_threads(method, isa):
    """A long step of each method against the matrix; the same bits for any number of threads."""
    for shape, seed in (((5, 6), 3), ((3, 4, 5), 0), ((3, 4, 5), 1)):
        parts = random_walls(shape, seed)
        g = np.random.default_rng(seed).random(shape)
        L = outflow(**parts)
        value, vectors = np.linalg.eigh((L + L.T) / 2)
        dt = 0.9 * 0.3 / number_k(1.0) if method == "explicit" else 2e-2 / number_k(1.0)
        found, _ = diffuse(g, stencil="isotropic", method=method, dt=dt, isa=isa, **parts)
        k = number_k(dt)
        growth = {"explicit": 1 - k * value, "implicit": 1 / (1 + k * value)}.get(method)
        if growth is None:  # second-order methods
            growth = np.exp(-k * value)
        wanted = vectors @ (growth * (vectors.T @ (parts["dense"] * g).ravel()))
        error = 2e-3 if method == "rkl2" else 1e-11
        np.testing.assert_allclose(found.ravel(), np.maximum(wanted, 0), rtol=0, atol=error)
    rng = np.random.default_rng(4)
    g, dense = rng.random((20, 20, 20)), rng.random((20, 20, 20)) < 0.7
    many = [
        diffuse(g, stencil="isotropic", method=method, dt=2e-3, dense=dense, threads=t, isa=isa)[0]
        for t in (1, 2, 3)
    ]
    assert np.array_equal(many[0], many[1])
    assert np.array_equal(many[0], many[2])

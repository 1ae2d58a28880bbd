"""The isotropic stencil of the fluidity: weights, mirrors at surfaces and walls, eigenvalues."""

import numpy as np
import pytest
from oracle_fluidity import LINKED, OPEN, ROUGH, diffuse, faces_of, number_k, random_parts

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


def random_grid(shape, seed):
    """Random walls and dense cells; for some seeds all cells dense, or no walls."""
    shares = [(0.8, 0.1, 0.1), (1.0, 0.0, 0.0), (0.3, 0.0, 0.7)][seed % 3]
    dense = (1.0, 0.8, 0.5)[seed // 3 % 3]
    return random_parts(shape, np.random.default_rng(seed), shares, dense)


@pytest.mark.parametrize("shape", [(6, 7), (1, 5), (2, 2, 3), (3, 4, 5)], ids=str)
def test_matrix_of_any_grid(shape):
    """The matrix is symmetric, an M-matrix, and has no eigenvalue beyond the limit."""
    for seed in range(18):
        parts = random_grid(shape, seed)
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
        parts = random_grid(shape, seed)
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

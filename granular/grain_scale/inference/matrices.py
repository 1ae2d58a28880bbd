"""Sparse matrices of balance, stress and friction for contact forces, in 2D and 3D.

The force f of a contact acts on its first body, -f on the second. Arms x begin at the centroid of
each grain, about which the balance of moments and the average stress take their simplest form, at
rest as well as in motion: K_eq of chapter 2 of Hurley's thesis is K_m of chapter 3, and K_st is
K_s.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.sparse import coo_array, csr_array

from granular.grain_scale.inference.packing import OUTSIDE, Packing
from granular.tools.arrays import Array

MOMENTS = {2: [(0, 1)], 3: [(1, 2), (2, 0), (0, 1)]}
"""Axes of the plane of rotation of each component of x cross f."""
SHEARS = {2: [(0, 1)], 3: [(1, 2), (0, 2), (0, 1)]}
"""Axes of each shear row of the stress."""


def rows_of(dim: int) -> int:
    """Number of rows of each matrix per grain, d(d + 1)/2."""
    return dim * (dim + 1) // 2


def equilibrium_matrix(packing: Packing) -> csr_array:
    """K_eq: forces and moments on each grain (eq. 2.5; about centroids also K_m of eq. 3.7).

    Returns
    -------
    csr_array, shape (d(d+1)/2 n, d c)
        For each grain the d sums of forces, then the moment ``-x2 f1 + x1 f2`` (in 3D the three
        components of ``x cross f``).
    """
    d = packing.dim
    arms_in = np.zeros((rows_of(d), d, d))
    for row, (a, b) in enumerate(MOMENTS[d], start=d):
        arms_in[row, b, a], arms_in[row, a, b] = 1.0, -1.0
    fixed = np.zeros((rows_of(d), d))
    fixed[:d] = np.eye(d)
    return _assembled(packing, arms_in, fixed)


def stress_matrix(packing: Packing) -> csr_array:
    """K_st: sum of sym(f x) over the contacts of each grain (eq. 2.8; also K_s of eq. 3.14).

    Returns
    -------
    csr_array, shape (d(d+1)/2 n, d c)
        For each grain the rows 11, 22, 2 12, or 11, 22, 33, 2 23, 2 13, 2 12.
    """
    d = packing.dim
    arms_in = np.zeros((rows_of(d), d, d))
    for a in range(d):
        arms_in[a, a, a] = 1.0
    for row, (a, b) in enumerate(SHEARS[d], start=d):
        arms_in[row, a, b] = arms_in[row, b, a] = 1.0
    return _assembled(packing, arms_in, np.zeros((rows_of(d), d)))


def stress_vector(packing: Packing) -> Array:
    """b_st: volume times average stress, in the rows of `stress_matrix` [N m]."""
    d = packing.dim
    scaled = packing.volumes[:, None, None] * packing.stresses
    normal = [scaled[:, a, a] for a in range(d)]
    return np.stack(normal + [2 * scaled[:, a, b] for a, b in SHEARS[d]], axis=1).ravel()


def momentum_vector(packing: Packing) -> Array:
    """b_m: m (a - g) and I alpha, in the rows of `equilibrium_matrix` [N, N m].

    Quantities that the packing does not have are zero; all are in a packing at rest without
    gravity.
    """
    d, n = packing.dim, packing.n
    momenta = np.zeros((n, rows_of(d)))
    for given, sign in ((packing.accelerations, 1.0), (packing.gravity, -1.0)):
        if given is not None and packing.masses is not None:
            momenta[:, :d] += sign * packing.masses[:, None] * given
    if packing.inertias is not None and packing.angular_accelerations is not None:
        alpha = packing.angular_accelerations.reshape(n, -1)
        if packing.inertias.ndim == 1:
            momenta[:, d:] = packing.inertias[:, None] * alpha
        else:
            momenta[:, d:] = np.einsum("nab,nb->na", packing.inertias, alpha)
    return momenta.ravel()


def contact_frames(normals: Array) -> Array:
    """Orthonormal rows e, t (and a second t in 3D) of each contact, shape (c, d, d)."""
    if normals.shape[1] == 2:
        return np.stack([normals, np.stack([-normals[:, 1], normals[:, 0]], axis=1)], axis=1)
    away = np.eye(3)[np.argmin(abs(normals), axis=1)]
    first = np.cross(away, normals)
    first /= np.linalg.norm(first, axis=1)[:, None]
    return np.stack([normals, first, np.cross(normals, first)], axis=1)


def admissibility_matrix(packing: Packing, mu: ArrayLike) -> csr_array:
    """B: contacts are repulsive, and tangential forces do not exceed the friction.

    Parameters
    ----------
    mu : float or array_like, shape (c,)
        Friction coefficient of all contacts or of each; finite, >= 0.

    Returns
    -------
    csr_array, shape (3 c, d c)
        For each contact, in 2D ``-e.f, -(mu e + t).f, -(mu e - t).f``, all >= 0 (eq. 2.12);
        in 3D ``-mu e.f, t1.f, t2.f``, the first >= the length of the others (eq. 3.19).

    Raises
    ------
    TypeError, ValueError
        As `friction_of_contacts`, and if a coefficient is infinite.
    """
    frames, d = contact_frames(packing.normals), packing.dim
    mu = friction_of_contacts(packing, mu)[:, None]
    if np.isinf(mu).any():
        raise ValueError("mu must be finite for this matrix")
    e, t = frames[:, 0], frames[:, 1]
    if d == 2:
        blocks = np.stack([-e, -(mu * e + t), -(mu * e - t)], axis=1)
    else:
        blocks = np.stack([-mu * e, t, frames[:, 2]], axis=1)
    return sparse_blocks(blocks, np.arange(len(e)), np.arange(len(e)), (len(e), len(e)))


def friction_of_contacts(
    packing: Packing, mu: ArrayLike, mu_wall: float | dict[int, float] | None = None
) -> Array:
    """The friction coefficient of each contact.

    Parameters
    ----------
    mu : float or array_like, shape (c,)
        Friction coefficient of all contacts or of each, >= 0; infinite where only repulsion is
        required, 0 where tangential forces are known to be zero.
    mu_wall : float or dict of int to float, optional
        Friction coefficient of the contacts with all walls, or with some walls by their number;
        `mu` for the others.

    Returns
    -------
    ndarray, shape (c,)

    Raises
    ------
    TypeError, ValueError
        For coefficients that are negative or nan, a wrong number of them, or a wall without
        contacts.
    """
    count = len(packing.bodies)
    coefficients = _coefficients("mu", mu)
    if coefficients.ndim and coefficients.shape != (count,):
        raise ValueError(f"mu has shape {coefficients.shape}, must be () or ({count},)")
    coefficients = np.broadcast_to(coefficients, (count,)).copy()
    lowest = packing.bodies.min(axis=1)
    if isinstance(mu_wall, dict):
        for wall, value in mu_wall.items():
            if wall >= 0 or not (lowest == wall).any():
                walls = np.unique(lowest[lowest < 0]).tolist()
                raise ValueError(f"mu_wall[{wall!r}] must name one of the walls {walls}")
            coefficients[lowest == wall] = _coefficients(f"mu_wall[{wall}]", value)
    elif mu_wall is not None:
        # A grain that was left out of a subset is not a wall.
        coefficients[(lowest < 0) & (lowest != OUTSIDE)] = _coefficients("mu_wall", mu_wall)
    return coefficients


def _coefficients(name: str, value: ArrayLike) -> Array:
    try:
        coefficients = np.asarray(value, dtype=np.float64)
    except (TypeError, ValueError):
        raise TypeError(f"{name} = {value!r} must be a number >= 0 or an array of them") from None
    if not (coefficients >= 0).all():
        raise ValueError(f"{name} = {coefficients[~(coefficients >= 0)].flat[0]} must be >= 0")
    return coefficients


def _assembled(packing: Packing, arms_in: Array, fixed: Array) -> csr_array:
    """Blocks ``fixed + arms_in . x`` of each contact in the rows of its two grains."""
    parts = []
    shape = (packing.n, len(packing.bodies))
    for contacts, grains, sign, arms in packing.sides():
        blocks = sign * (fixed + np.einsum("rab,kb->kra", arms_in, arms))
        parts.append(sparse_blocks(blocks, grains, contacts, shape))
    return parts[0] + parts[1]


def sparse_blocks(
    blocks: Array, down: NDArray, across: NDArray, shape: tuple[int, int]
) -> csr_array:
    """Blocks (k, r, s) at the block rows `down` and block columns `across` of a sparse matrix."""
    _, r, s = blocks.shape
    rows = np.broadcast_to(r * down[:, None, None] + np.arange(r)[:, None], blocks.shape)
    columns = np.broadcast_to(s * across[:, None, None] + np.arange(s), blocks.shape)
    entries = (blocks.ravel(), (rows.ravel(), columns.ravel()))
    return coo_array(entries, (r * shape[0], s * shape[1])).tocsr()

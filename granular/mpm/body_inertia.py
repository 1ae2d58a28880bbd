"""Mass, centre and inertia of rigid bodies."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np

from granular.checks import finite, integer, positive, vector
from granular.mpm.body_measures import reach
from granular.mpm.body_shapes import Array, Shape

__all__ = ["MassProperties", "inertia_of", "mass_properties", "principal"]


def inertia_of(name: str, value: Any, dim: int) -> Any:
    """Return a moment of inertia about z in 2D, the tensor as a tuple of rows in 3D."""
    if dim == 2:
        return positive(name, value)
    if np.ndim(value) == 2:
        rows = tuple(vector(f"{name}[{i}]", row, 3, finite) for i, row in enumerate(value))
        if len(rows) != 3:
            raise ValueError(f"{name} = {value!r} must have 3 rows")
        tensor = np.array(rows)
    else:
        tensor = np.diag(vector(name, value, 3, positive))
    if not np.allclose(tensor, tensor.T, rtol=0, atol=1e-9 * abs(tensor).max()):
        raise ValueError(f"{name} = {value!r} must be symmetric")
    moments = np.linalg.eigvalsh(tensor)
    if not moments[0] > 0:
        raise ValueError(f"{name} = {value!r} must be positive definite")
    if moments[2] > (1 + 1e-9) * (moments[0] + moments[1]):
        raise ValueError(
            f"{name} = {value!r}: the largest principal moment, {moments[2]:.6g}, must be <= "
            f"{moments[0] + moments[1]:.6g}, the sum of the others, as in any body"
        )
    return tuple(tuple(float(x) for x in row) for row in tensor)


def principal(inertia: Any) -> Array:
    """Return the principal moments and their axes as columns for the core, shape (12,)."""
    if np.ndim(inertia) == 0:
        return np.array([inertia] * 3 + [*np.eye(3).ravel()])
    moments, axes = np.linalg.eigh(np.array(inertia))
    return np.array([*moments, *axes.ravel()])


@dataclass(frozen=True)
class MassProperties:
    """Mass, centre of mass and inertia of a homogeneous body.

    Attributes
    ----------
    mass : float
        Mass [kg; in 2D per metre of depth].
    center : tuple of float, length dim
        Centre of mass in coordinates of the body [m]. Bodies that turn must have it at the origin.
    inertia : float, or 3 x 3 tuple of floats
        About the centre of mass [kg m2; in 2D per metre of depth], for `Body`.
    """

    mass: float
    center: tuple[float, ...]
    inertia: Any


def mass_properties(shape: Shape, density: float, *, cells: int | None = None) -> MassProperties:
    """Mass, centre of mass and inertia of a homogeneous body, by quadrature of its distance.

    Parameters
    ----------
    shape : Shape
        Any shape of finite size.
    density : float
        Density [kg/m3], > 0.
    cells : int, optional
        Number of cells along an edge of the cube, centred at the origin of the shape, in which it
        is sampled, 8 to 4096. By default 1024 in 2D and 128 in 3D. A cell at the surface counts
        in part, by the distance of its centre. By default the moments of a disc and of a rectangle
        err by less than 1e-5, those of a ball by 6e-4 and those of a box of 3 : 2 : 1 by 2e-3.

    Returns
    -------
    MassProperties

    Raises
    ------
    TypeError, ValueError
        Naming argument, value and allowed range; also for an endless shape, and one that is
        so small beside its distance from the origin that no cell lies in it.
    """
    if not isinstance(shape, Shape):
        raise TypeError(f"shape = {shape!r} must be a shape of granular.bodies")
    density, far, dim = positive("density", density), reach(shape), shape.dim
    if not math.isfinite(far):
        raise ValueError(f"shape = {shape!r} must be of finite size")
    n = integer("cells", (1024 if dim == 2 else 128) if cells is None else cells, 8, 4096)
    width = 2 * far / n
    line = (np.arange(n) + 0.5) * width - far
    sums = np.zeros((dim + 1, dim + 1))  # of the products of (1, x)
    for x in line:
        rest = np.meshgrid(*[line] * (dim - 1), indexing="ij")
        at = np.stack([np.full(n ** (dim - 1), x), *(part.ravel() for part in rest)], axis=1)
        distance, normal = shape.distance(at)
        share = np.clip(0.5 - distance / (width * abs(normal).sum(axis=1)), 0, 1)
        with_one = np.concatenate([np.ones((len(at), 1)), at], axis=1)[share > 0]
        sums += (share[share > 0, None] * with_one).T @ with_one
    if not sums[0, 0] > 0:
        raise ValueError(f"cells = {n} must be more: none of them lies in the shape")
    sums *= density * width**dim
    mass = float(sums[0, 0])
    center = sums[0, 1:] / mass
    second = sums[1:, 1:] - mass * np.outer(center, center)
    second += np.eye(dim) * mass * width**2 / 12  # of a cell about its centre
    tensor = np.trace(second) * np.eye(dim) - second
    inertia = (
        float(np.trace(second)) if dim == 2 else tuple(tuple(map(float, row)) for row in tensor)
    )
    return MassProperties(mass, tuple(float(c) for c in center), inertia)

"""Mass, centre and inertia of rigid bodies."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np

from granular.shapes.measures import reach
from granular.shapes.moments import moments_of
from granular.shapes.shape import Shape
from granular.tools.arrays import Array
from granular.tools.checks import finite, in_range, positive, vector

TOLERANCE = 1e-3
TOO_MUCH = 0.01
"""Relative error from which masses are refused."""


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
    error : float
        Bound of the largest relative error: of the mass, of `inertia` over the largest moment, and
        of the centre over the radius of gyration. It is 0 where there is a formula.
    """

    mass: float
    center: tuple[float, ...]
    inertia: Any
    error: float = 0.0


def mass_properties(
    shape: Shape, density: float, *, tolerance: float = TOLERANCE
) -> MassProperties:
    """Mass, centre of mass and inertia of a homogeneous body.

    They are exact for a `Box`, `Cylinder`, `Sphere`, `Capsule` and `Torus`, for a `Polygon` and a
    `Prism` without a thickness, and for a closed `Mesh` whose parts neither overlap nor cross
    themselves, as tested at points of its surface; for unions of such shapes that are apart; and
    for differences in which such shapes are cut out of the inside of others. Shapes that overlap
    are divided into cells, and random points are counted in those at the surface. The bound of the
    error is three standard deviations, of the largest variance that such cells can have; no part is
    omitted. The position of the shape does not matter: far from the origin no digits are lost.

    A `Mesh` is integrated by its triangles, but in an operation, if it overlaps other shapes, by
    its samples, whose edges are rounded by about a spacing; the error does not include this.

    Parameters
    ----------
    shape : Shape
        Any shape of finite size.
    density : float
        Density [kg/m3], > 0.
    tolerance : float
        Relative error to be reached, from 1e-6 to 0.01, as that of `MassProperties`; it may remain
        larger, up to 1 %.
    {raises}; also for an endless shape, for an empty one, and for one
        whose error remains above 1 %.
    """
    if not isinstance(shape, Shape):
        raise TypeError(f"shape = {shape!r} must be a shape of granular.shapes")
    density = positive("density", density)
    tolerance = in_range("tolerance", tolerance, 1e-6, TOO_MUCH)
    if not math.isfinite(reach(shape)):
        raise ValueError(f"shape = {shape!r} must be of finite size")
    moments = moments_of(shape, tolerance)
    if moments is None:
        raise ValueError(f"shape = {shape!r} must have an inside: it is empty")
    if moments.error > TOO_MUCH:
        raise ValueError(
            f"shape = {shape!r}: its mass and inertia are known to {100 * moments.error:.2g} % "
            f"only, must be {100 * TOO_MUCH:g} %: it has parts too small or thin for its size"
        )
    mass, second, dim = density * moments.volume, density * moments.second, shape.dim
    trace = float(np.trace(second))
    tensor = trace * np.eye(dim) - second
    inertia = trace if dim == 2 else tuple(tuple(map(float, row)) for row in tensor)
    return MassProperties(mass, tuple(float(c) for c in moments.center), inertia, moments.error)

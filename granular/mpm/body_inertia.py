"""Mass, centre and inertia of rigid bodies."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np

from granular.checks import finite, integer, positive, vector
from granular.mpm.body_measures import reach
from granular.mpm.body_shapes import PARTS, Array, Shape

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
    """Mass, centre of mass and inertia of a homogeneous body.

    They are exact for a `Box`, `Cylinder`, `Sphere`, `Capsule` and `Torus`, by quadrature of the
    distance for other shapes.

    Parameters
    ----------
    shape : Shape
        Any shape of finite size.
    density : float
        Density [kg/m3], > 0.
    cells : int, optional
        Number of cells along an edge of the cube, centred at the origin of the shape, in which any
        shape is sampled if it is given, 8 to 4096. Shapes without a formula have 1024 in 2D and 128
        in 3D by default. A cell at the surface counts in part, by the distance of its centre. With
        these numbers the moments of a disc and of a rectangle err by less than 1e-5, those of a
        ball by 6e-4 and those of a box of 3 : 2 : 1 by 2e-3.

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
    if cells is None and (exact := _exact(shape, density)) is not None:
        return exact
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


def _exact(shape: Shape, density: float) -> MassProperties | None:
    """Return those of shapes that have a formula; None for others."""
    rows, dim = shape.rows(), shape.dim
    row, size = rows[0], rows[0, 14:]
    if len(rows) > 1 or row[1]:
        return None
    if row[0] == PARTS["box"]:
        found = _of_box(size[:dim])
    elif row[0] == PARTS["cylinder"]:
        found = _of_cylinder(size, dim)
    elif row[0] == PARTS["capsule"]:
        found = _of_capsule(size, dim)
    elif row[0] == PARTS["torus"]:
        found = _of_torus(size)
    else:
        return None
    volume, moments = found
    mass = density * volume
    center = tuple(float(c) for c in row[2 : 2 + dim])
    if dim == 2:
        return MassProperties(mass, center, mass * moments[2])
    turn = row[5:14].reshape(3, 3)
    tensor = mass * turn @ np.diag(moments) @ turn.T
    return MassProperties(mass, center, tuple(tuple(map(float, part)) for part in tensor))


def _of_box(half: Array) -> tuple[float, list[float]]:
    """Volume, and moments about the axes over the mass, from half edges; in 2D of a rectangle."""
    squares = [float(x) ** 2 / 3 for x in half] + [0.0] * (3 - len(half))
    return math.prod(2 * float(x) for x in half), [sum(squares) - square for square in squares]


def _of_cylinder(size: Array, dim: int) -> tuple[float, list[float]]:
    """The same of a cylinder about its axis, the third; in 2D of a disc."""
    radius, half = float(size[0]), float(size[1])
    if dim == 2:
        return math.pi * radius**2, [0.0, 0.0, radius**2 / 2]
    across = radius**2 / 4 + half**2 / 3
    return 2 * math.pi * radius**2 * half, [across, across, radius**2 / 2]


def _of_capsule(size: Array, dim: int) -> tuple[float, list[float]]:
    """The same of a cylinder and two half balls; in 2D of a rectangle and two half discs."""
    radius, half = float(size[0]), float(size[1])
    if dim == 2:
        straight, ends = 4 * radius * half, math.pi * radius**2
        moment = straight * (half**2 + radius**2) / 3
        moment += ends * (radius**2 / 2 + half**2 + 8 * half * radius / (3 * math.pi))
        return straight + ends, [0.0, 0.0, moment / (straight + ends)]
    straight, ends = 2 * math.pi * radius**2 * half, 4 / 3 * math.pi * radius**3
    about = straight * radius**2 / 2 + ends * 2 / 5 * radius**2
    across = straight * (radius**2 / 4 + half**2 / 3)
    across += ends * (2 / 5 * radius**2 + half**2 + 3 / 4 * half * radius)
    volume = straight + ends
    return volume, [across / volume, across / volume, about / volume]


def _of_torus(size: Array) -> tuple[float, list[float]]:
    """The same of a torus about its axis, the third."""
    radius, tube = float(size[0]), float(size[1])
    across = radius**2 / 2 + 5 / 8 * tube**2
    return 2 * math.pi**2 * radius * tube**2, [across, across, radius**2 + 3 / 4 * tube**2]

"""Measures of shapes: their extent, speed and thickness."""

from __future__ import annotations

import math
from itertools import product

import numpy as np

from granular.shapes.boxes import Box
from granular.shapes.mesh import Mesh
from granular.shapes.operations import united
from granular.shapes.round import Frustum
from granular.shapes.shape import TINY, Cover, Measure, Shape
from granular.tools.arrays import Array
from granular.tools.checks import LEAST

HULL = 256
"""Corners of a polygon about a disc, 8e-5 of the radius beyond it."""


def reach(shape: Shape) -> float:
    """Radius about the position of the body that contains the solid [m]; may be infinite."""

    def farthest(cover: Cover) -> float:
        around = math.hypot(float(np.linalg.norm(cover.half)), cover.radius)
        return float(np.linalg.norm(cover.center)) + around + cover.beyond

    return float(shape.bound(Measure(farthest, 1.0))[0])


def hull(shape: Shape) -> tuple[Array, float] | None:
    """Points (n, 3), and a distance from their convex hull within which a shape of one part lies.

    None for shapes of several parts, and endless ones.
    """
    covers = None if shape.inside or len(shape.rows()) > 1 else shape.covers()
    if covers is None or not np.isfinite(covers[0].half).all():
        return None
    cover = covers[0]
    places = np.array(list(product((-1, 1), repeat=3))) * cover.half
    if cover.radius:
        angle = 2 * math.pi * np.arange(HULL) / HULL
        circle = np.stack([np.cos(angle), np.sin(angle), np.zeros(HULL)], axis=1)
        circle *= cover.radius / math.cos(math.pi / HULL)  # a polygon about the disc
        places = (places[:, None] + circle).reshape(-1, 3)
    return np.unique(cover.center + places @ cover.axes.T, axis=0), cover.beyond


def extents(shape: Shape, rotation: Array, turning: Array) -> Array:
    """Largest distances from the position of a body to its surface along x, y and z [m].

    Parameters
    ----------
    rotation : ndarray, shape (3, 3)
        Rotation of the body at the start.
    turning : ndarray, shape (k, 3)
        Angular velocities of its motion. If they have one direction a, a point p sweeps a circle
        about a, and reaches |p.a| |a.e| + |p - (p.a) a| sqrt(1 - (a.e)^2) along e. If they have
        several, all orientations count.

    Returns
    -------
    ndarray, shape (3,)
        May be infinite.
    """
    turns = turning[(abs(turning) > LEAST).any(axis=1)]  # less has no direction: its square is 0
    if not len(turns):

        def along(cover: Cover) -> Array:
            placed = cover.turned(rotation)
            return np.array([placed.along(e) for e in np.eye(3)])

        return np.full(3, shape.bound(Measure(along, 1.0))[0])
    about = turns[0] / np.linalg.norm(turns[0])
    if np.linalg.norm(np.cross(turns, about), axis=1).max() > TINY * np.linalg.norm(turns):
        return np.full(3, reach(shape))

    def swept(cover: Cover) -> Array:
        placed = cover.turned(rotation)
        return np.array([_swept(placed, about, d) for d in range(3)])

    return np.full(3, shape.bound(Measure(swept, 1.0))[0])


def _swept(cover: Cover, about: Array, d: int) -> float:
    """The same along axis `d` in all turns about an axis; of an oblique disc, a bound."""
    half = cover.half.copy()
    cosine, sine = abs(float(about[d])), float(np.linalg.norm(np.delete(about, d)))

    def far(places: Array) -> Array:
        off = np.linalg.norm(np.cross(places, about), axis=-1)
        return cosine * abs(places @ about) + sine * off

    half[far(cover.axes.T) <= TINY] = 0.0  # an axis of rotation that is endless along itself
    if not np.isfinite(half).all():
        return math.inf
    signs = np.array(list(product((-1, 1), repeat=3)))
    tilt = float(np.linalg.norm(np.cross(cover.axes[:, 2], about)))
    box = float(far(cover.center + signs * half @ cover.axes.T).max())
    return box + cover.radius * (cosine * tilt + sine) + cover.beyond


def largest_speed(shape: Shape, rotation: Array, velocity: Array, turning: Array) -> float:
    """Bound on the speed [m/s] of the points of a body, `rotation` being that at the start.

    Velocities and angular velocities have the shape (k, 3). The speed is a convex function of
    position: its maximum over a box is at a corner.
    """
    signs = np.array(list(product((-1, 1), repeat=3)))
    fastest = float(np.linalg.norm(turning, axis=1).max())

    def in_box(cover: Cover) -> float:
        placed = cover.turned(rotation)
        half = placed.half + np.array([placed.radius, placed.radius, 0.0])
        endless = np.isinf(half)
        if np.cross(turning[:, None], placed.axes.T[endless]).any():
            return math.inf
        half[endless] = 0.0
        arms = placed.center + signs * half @ placed.axes.T
        speeds = velocity[:, None] + np.cross(turning[:, None], arms)
        return float(np.linalg.norm(speeds, axis=2).max()) + fastest * placed.beyond

    return float(shape.bound(Measure(in_box, fastest))[0])


def thicknesses(shape: Shape) -> tuple[float, float]:
    """Least edge [m] of its boxes, whose two sides are separated, and thickness of the others.

    The thickness is the diameter of the largest ball in a part, or in an operand of an operation,
    and for a mesh that of its thinnest walls; inf if there is none.
    """
    box = other = math.inf
    for part in united(shape):
        assert isinstance(part, Shape)
        if isinstance(part, Box) or (isinstance(part, Frustum) and part.walls):
            box = min(box, part.narrowest())
        else:
            other = min(other, part.narrowest())
    return box, other


def mesh_thickness(shape: Shape) -> float:
    """Thickness [m] of the thinnest walls of the meshes in a shape; inf if there is none."""
    return min((leaf.narrowest() for leaf in _meshes(shape)), default=math.inf)


def mesh_size(shape: Shape) -> float:
    """Longest edge [m] of the boxes about the meshes in a shape; 0 if there is none."""
    return max((2 * float(leaf.covers()[0].half.max()) for leaf in _meshes(shape)), default=0.0)


def _meshes(shape: Shape) -> list[Mesh]:
    return [leaf for leaf in shape.leaves() if isinstance(leaf, Mesh)]

"""A release of material that slides down terrain given by a height map, in 2D and 3D."""

from __future__ import annotations

import math
import os
from typing import Any

import numpy as np
from numpy.typing import NDArray

from granular.materials import Material
from granular.model.fill import Fill
from granular.model.grid import MAX_COUNT, Grid
from granular.model.surfaces import Heights, Layer
from granular.mpm import schemes
from granular.mpm.bodies import Body
from granular.mpm.schemes import Scheme
from granular.scenes._build import HEADROOM, MARGIN, ROUND_OFF, Parts, enough_cells, soft_beads
from granular.scenes._registry import scene_function
from granular.shapes import HeightMap
from granular.tools.arrays import Array
from granular.tools.checks import array, finite, in_range, integer, non_negative, positive, vector


@scene_function("mpm")
def landslide(
    *,
    angle_deg: float = 35.0,
    slope: float = 1.0,
    flat: float = 1.6,
    bend: float = 0.3,
    width: float = 1.0,
    length: float = 0.4,
    thickness: float = 0.08,
    at: tuple[float, ...] | None = None,
    terrain: str | os.PathLike[str] | HeightMap | None = None,
    release: NDArray | None = None,
    friction: float = 0.3,
    dim: int = 2,
    cell: float = 0.01,
    points_per_cell: int | None = None,
    jitter: float = 0.0,
    gravity: float = 9.81,
    duration: float = 2.0,
    material: Material = soft_beads,
    scheme: Scheme = schemes.default,
    seed: int = 0,
    **material_numbers: Any,
) -> Parts:
    """Landslide: material released on a slope, or on a given terrain.

    All numbers are chosen here. By default the terrain is a plane that runs out into a level plane,
    joined by an arc of a circle; x points downhill, and the two planes would meet at x = 0, z = 0.
    The release is a cap, thickest in its middle: its thickness falls as 1 - r^2 to 0 at its rim, r
    the distance from the middle over half its `length`. It starts at rest. Points that cross a side
    of the domain leave for good.

    Compare with `granular.theory.spreading_cap` while the slide is on the plane, and with
    `granular.theory.block_runout`; `granular.measure.slide_history` and `granular.measure.deposit`
    measure the slide.

    Parameters
    ----------
    angle_deg : float
        Angle of the default slope [deg], 0 < angle < 90.
    slope, flat : float
        Horizontal extents of the default terrain before and behind x = 0 [m].
    bend : float
        Radius of the arc between the planes [m]; it must end within both of them.
    width : float
        Extent of the default terrain across the slope, from -width/2 to width/2 [m]; unused in 2D.
    length, thickness : float
        Diameter, seen from above, of the released cap and its vertical thickness in the middle [m].
    at : tuple of float, length dim - 1, optional
        Horizontal position of the middle of the cap [m]; by default its upper end is 5 cells from
        the upper end of the slope. Required with a `terrain` without a `release`.
    terrain : HeightMap or path, optional
        Terrain in place of the default one, or the path of a file that `HeightMap.read` can read,
        which the parameters of the scene hold as a string. It gives the dimension and the domain,
        and replaces the five lengths and the angle of the default one.
    release : ndarray, shape (nx,) in 2D, (ny, nx) in 3D, optional
        Vertical thickness of the released material at the posts of `terrain` [m], in place of the
        cap; the spacing of the posts must be the same along x and y.
    friction : float
        Coulomb friction coefficient of the ground, >= 0.
    dim : {2, 3}
        Dimension of the default terrain.
    {common}; also if the release does not lie on the terrain.
    """
    cell, friction = positive("cell", cell), non_negative("friction", friction)
    numbers = {"slope": slope, "flat": flat, "bend": bend, "width": width}
    for name, value in numbers.items():
        positive(name, value)
    ground = _ground(terrain, angle_deg, numbers, integer("dim", dim, 2, 3), cell)
    over = _thickness(ground, release, terrain is None, at, (length, thickness), cell)
    layer = _layer(ground, over)
    counts = [
        math.floor((high - low) / cell + ROUND_OFF)
        for low, high in zip(ground.origin, ground.upper, strict=True)
    ]
    if min(counts) < 1:
        raise ValueError(f"cell = {cell} must not be larger than the terrain")
    bottom = float(ground.z.min()) - MARGIN * cell
    rows = enough_cells(max(float(ground.z.max()), layer.bounds[1][-1]) - bottom, cell) + HEADROOM
    count = 2**ground.dim if points_per_cell is None else points_per_cell
    return Parts(
        grid=Grid(
            (*ground.origin, bottom),
            cell,
            (*counts, rows),
            open_sides=frozenset(f"{axis}{end}" for axis in "xy"[: len(counts)] for end in "-+"),
        ),
        fills=(Fill(layer, count, jitter=jitter, lithostatic=True),),
        bodies=(Body(ground, (0.0,) * ground.dim, friction=friction),),
        parameters={
            "dim": ground.dim,
            **({"terrain": "given"} if isinstance(terrain, HeightMap) else {}),
            **({} if release is None else {"release": "given"}),
        },
    )


def _ground(
    terrain: str | os.PathLike[str] | HeightMap | None,
    angle_deg: float,
    of: dict[str, float],
    dim: int,
    cell: float,
) -> HeightMap:
    """Return the given terrain, or the default one with posts at half cells."""
    if isinstance(terrain, (str, os.PathLike)):
        return HeightMap.read(terrain)
    if terrain is not None:
        if not isinstance(terrain, HeightMap):
            raise TypeError(f"terrain = {terrain!r} must be a HeightMap, a path or None")
        return terrain
    angle = math.radians(in_range("angle_deg", angle_deg, 0.0, 90.0, open_low=True, open_high=True))
    tangent = of["bend"] * math.tan(angle / 2)
    if tangent > of["flat"] or tangent * math.cos(angle) > of["slope"]:
        raise ValueError(
            f"bend = {of['bend']} must end within the slope and the flat: the arc reaches "
            f"{tangent:.6g} m along both"
        )
    h = cell / 2
    before, behind = (enough_cells(of[name], cell) for name in ("slope", "flat"))
    across = enough_cells(of["width"] / 2, cell) if dim == 3 else 0
    if (2 * (before + behind) + 1) * (4 * across + 1) > MAX_COUNT:
        raise ValueError(f"cell = {cell} must make at most {MAX_COUNT} posts of the terrain")
    x = h * np.arange(-2 * before, 2 * behind + 1)
    on_arc = of["bend"] - np.sqrt(of["bend"] ** 2 - np.clip(x - tangent, -of["bend"], 0.0) ** 2)
    z = np.where(x < -tangent * math.cos(angle), -x * math.tan(angle), on_arc)
    if dim == 2:
        return HeightMap(z, h, origin=(-before * cell,))
    whole = np.tile(z, (4 * across + 1, 1))
    return HeightMap(whole, h, origin=(-before * cell, -across * cell))


def _thickness(
    ground: HeightMap,
    release: NDArray | None,
    default: bool,
    at: tuple[float, ...] | None,
    size: tuple[float, float],
    cell: float,
) -> Array:
    """Vertical thickness of the release at the posts, ordered as the heights [m]."""
    axes = ground.dim - 1
    length, highest = positive("length", size[0]), positive("thickness", size[1])
    if release is not None:
        given = array("release", release, ground.z.shape)
        if given.min() < 0 or not given.max() > 0:
            raise ValueError(
                f"release must be >= 0 and somewhere > 0, is {given.min()} to {given.max()}"
            )
        return given
    if at is None:
        if not default:
            raise ValueError("at = None must be a place on the terrain, or release be given")
        at = (ground.origin[0] + 5 * cell + length / 2, 0.0)[:axes]
    if np.ndim(at) != 1 or len(at) != axes:
        raise ValueError(f"at = {at!r} must be {axes} numbers")
    middle = (finite("at[0]", at[0]),) if axes == 1 else vector("at", at, 2)
    for low, high, place in zip(ground.origin, ground.upper, middle, strict=True):
        if place - length / 2 < low - ROUND_OFF or place + length / 2 > high + ROUND_OFF:
            raise ValueError(
                f"at = {middle} with length = {length} must keep the release on the terrain, from "
                f"{low:.6g} to {high:.6g} m"
            )
    squared = [((x - m) / (length / 2)) ** 2 for x, m in zip(_posts(ground), middle, strict=True)]
    r2 = squared[0] if axes == 1 else np.add.outer(squared[1], squared[0])
    return highest * np.maximum(1.0 - r2, 0.0)


def _posts(ground: HeightMap) -> list[Array]:
    """Coordinates of the posts along each horizontal axis [m]."""
    counts = ground.z.shape[::-1]
    return [
        np.linspace(low, high, n)
        for low, high, n in zip(ground.origin, ground.upper, counts, strict=True)
    ]


def _layer(ground: HeightMap, thickness: Array) -> Layer:
    """Region of the release, which ends at the posts around it."""
    spacing = ground.spacing if isinstance(ground.spacing, tuple) else (ground.spacing,)
    if len(set(spacing)) > 1:
        raise ValueError(f"terrain: its spacing = {spacing} must be the same along x and y")
    part: list[slice] = []
    lower: list[float] = []
    upper: list[float] = []
    for axis, x in enumerate(_posts(ground)):
        along = thickness.ndim - 1 - axis
        others = tuple(k for k in range(thickness.ndim) if k != along)
        there = np.flatnonzero(thickness.max(axis=others) > 0 if others else thickness > 0)
        first, last = max(there[0] - 1, 0), min(there[-1] + 1, len(x) - 1)
        part.insert(0, slice(first, last + 1))
        lower.append(float(x[first]))
        upper.append(float(x[last]))
    parts = [
        Heights(np.asarray(z, dtype=float)[tuple(part)].T, tuple(lower), spacing[0])
        for z in (ground.z, thickness)
    ]
    return Layer(parts[0], parts[1], tuple(lower), tuple(upper))

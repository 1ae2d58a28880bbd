"""Pressure and friction of the material along walls and bodies."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Any, cast

import numpy as np
import scipy
from numpy.typing import NDArray

from granular.measure.body import window_means
from granular.measure.result import FORCE, Result, Table
from granular.measure.surface_area import Surface, body_surface, wall_surface
from granular.model.grid import AXES
from granular.mpm.bodies import split
from granular.mpm.scene import Scene
from granular.record.reader import Trajectory
from granular.tools.arrays import Array
from granular.tools.checks import ascending, integer, one_of

CELLS = 2.0
"""Default width of a bin [cells]."""

SLANTED = 0.1
"""Least sine of the angle between a normal and a direction that has a part along the surface."""

AREA = "m2; m in 2D"


@dataclass(frozen=True, eq=False, kw_only=True)
class TractionProfile(
    Result,
    position="m",
    area=AREA,
    normal="Pa",
    normal_scatter="Pa",
    tangential="Pa",
    tangential_scatter="Pa",
):
    """Mean traction along a wall or body, over windows of time.

    Attributes
    ----------
    position : ndarray, shape (b,)
        Middles of the bins [m], or [deg] along an angle.
    area : ndarray, shape (b,)
        Area of the surface in each bin [m2; in 2D its length in m, but in an axisymmetric grid the
        area of rings in m2].
    normal, tangential : ndarray, shape (b,)
        Mean pressure [Pa], and mean tangential traction [Pa].
    normal_scatter, tangential_scatter : ndarray, shape (b,)
        Standard deviations over the windows [Pa]; nan for one window.
    friction : ndarray, shape (b,)
        Mobilised friction: tangential over normal force, each of all windows together.
    windows : int
        Number of windows.
    """

    position: Array
    area: Array
    normal: Array
    normal_scatter: Array
    tangential: Array
    tangential_scatter: Array
    friction: Array
    windows: int


@dataclass(frozen=True, eq=False, kw_only=True)
class WallTraction(
    Result, times="s", position="m", area=AREA, normal="Pa", tangential="Pa", force=FORCE
):
    """Traction of the material on a wall or body, averaged between frames and over bins.

    Attributes
    ----------
    times : ndarray, shape (k,)
        Middles of the averaging windows [s].
    position : ndarray, shape (b,)
        Middles of the bins [m], or [deg] along an angle.
    area : ndarray, shape (k, b)
        Area of the surface in each bin [m2; in 2D its length in m].
    normal : ndarray, shape (k, b)
        Pressure [Pa]: force normal to the surface, compression positive, over the area.
    tangential : ndarray, shape (k, b)
        Force along the surface over the area [Pa], positive towards larger positions.
    friction : ndarray, shape (k, b)
        Mobilised friction: force along the surface, in any direction, over the normal force; nan
        where nothing presses.
    force : ndarray, shape (k, dim)
        Force of the material on the modelled part [N; in 2D per metre of depth], the sum over all
        bins. It is that of `body_force` and `wall_force` with ``total=False``.
    along : str
        Direction of the bins.
    """

    times: Array
    position: Array
    area: Array
    normal: Array
    tangential: Array
    friction: Array
    force: Array
    along: str

    def mean(self, after: float = -np.inf, before: float = np.inf) -> TractionProfile:
        """Mean and scatter of the windows whose middles are from `after` to `before` [s].

        Raises
        ------
        ValueError
            If there are none.
        """
        keep = (self.times >= after) & (self.times <= before)
        count = int(keep.sum())
        if not count:
            raise ValueError(
                f"after = {after:g}, before = {before:g} must contain windows, of which the first "
                f"and the last are at {self.times[0]:g} and {self.times[-1]:g}"
            )
        normal, tangential = self.normal[keep], self.tangential[keep]
        pressed = np.where(normal > 0, normal, 0.0)
        rubbed = np.where(normal > 0, self.friction[keep] * pressed, 0.0)
        with np.errstate(invalid="ignore"):
            friction = rubbed.sum(axis=0) / np.where(
                pressed.any(axis=0), pressed.sum(axis=0), np.nan
            )

        def scatter(values: Array) -> Array:
            return values.std(axis=0, ddof=1) if count > 1 else np.full(values.shape[1], np.nan)

        return TractionProfile(
            position=self.position,
            area=self.area[keep].mean(axis=0),
            normal=normal.mean(axis=0),
            normal_scatter=scatter(normal),
            tangential=tangential.mean(axis=0),
            tangential_scatter=scatter(tangential),
            friction=friction,
            windows=count,
        )

    def _table(self) -> Table:
        times, position = np.meshgrid(self.times, self.position, indexing="ij")
        names = ("area", "normal", "tangential", "friction")
        columns = {name: getattr(self, name).ravel() for name in names}
        units = {**self.UNITS, "position": "deg" if self.along == "angle" else "m"}
        return Table(
            {"times": times.ravel(), "position": position.ravel(), **columns},
            {"along": self.along},
            units,
        )


def wall_traction(
    record: Trajectory,
    *,
    body: int | None = None,
    wall: int | None = None,
    along: str = "",
    bins: int | Sequence[float] | Array | None = None,
    window: int = 1,
) -> WallTraction:
    """Pressure and friction of the material along a wall, a block or a body.

    The core adds up the impulses on patches about a cell wide: the nodes of a wall or block, and
    the cells of a grid that moves with a body. A window average is a difference of impulses over
    a difference of times, hence the exact mean over all steps in between, and the sum over all bins
    is the force on the whole. A bin has the patches whose middles are in it, and their area: bins
    should be at least two cells wide.

    Parameters
    ----------
    record : Trajectory
        Of a simulation that was made with `tractions`.
    body, wall : int, optional
        Index into the bodies of the scene, or into its walls and blocks: one of the two.
    along : {"x", "y", "z", "angle"}
        Coordinate along which the bins follow one another, in the scene; by default the last one.
        For a body that moves it is the coordinate that it would have if the body had only turned
        from its first position. "angle" is the angle about the position of a body: 0 downwards,
        positive towards larger x, from -180 to 180 degrees; in 3D about the y axis through it.
    bins : int or array of float, optional
        Number of bins, >= 1, or their edges in increasing order [m or deg]. By default they are two
        cells wide, along an angle at the largest distance from the position.
    window : int
        Length of a window in intervals between frames, >= 1; windows do not overlap. The patches of
        a body that turns are where they are in the middle of a window.

    Returns
    -------
    WallTraction
        Its method `mean` returns the mean over a time, and the scatter.

    Raises
    ------
    TypeError, ValueError
        If there is no such body or wall, the record does not hold the patches, or an argument is
        out of range.
    """
    scene = cast(Scene, record.scene)
    _check_solid(record, scene, body, wall)
    along = one_of("along", along or AXES[scene.dim - 1], _directions(scene, body))
    patches, surface = _history(record, scene, body, wall), _surface(scene, body, wall)
    if not len(surface.x):
        raise ValueError(f"body = {body}, wall = {wall} has no surface within the domain")
    times, *_ = window_means(record.times, window)
    ends = np.arange(0, len(record), integer("window", window, 1))
    edges = None
    rows = []
    for first, last in pairwise(ends.tolist()):
        turn = _turning(record, body, (first, last))
        place, heading = _placed(scene, body, patches.x, turn, along)
        on_surface, _ = _placed(scene, body, surface.x, turn, along)
        if edges is None:
            edges = _edges(bins, along, on_surface, surface.x, scene.grid.cell)
        area = _summed(on_surface, surface.area, edges)
        span = record.times[last] - record.times[first]
        normal, tangential, rubbed = patches.forces(first, last, span, heading)
        sums = [_summed(place, values, edges) for values in (normal, tangential, rubbed)]
        rows.append(_per_area(area, *sums))
    assert edges is not None
    area, normal, tangential, friction = np.transpose(rows, (1, 0, 2))
    _, force = window_means(record.times, window, patches.impulse.sum(axis=1))
    return WallTraction(
        times=times,
        position=(edges[:-1] + edges[1:]) / 2,
        area=area,
        normal=normal,
        tangential=tangential,
        friction=friction,
        force=force,
        along=along,
    )


@dataclass(frozen=True, eq=False)
class _Patches:
    """Patches of a wall or body: places (n, dim), and numbers at all frames, (frames, n, ...)."""

    x: Array
    impulse: Array
    tangential: Array
    normal: Array

    def forces(self, first: int, last: int, span: float, heading: Array) -> tuple[Array, ...]:
        """Normal and tangential force on each patch between two frames, and its size."""
        impulse, tangential = ((a[last] - a[first]) / span for a in (self.impulse, self.tangential))
        normal = (self.normal[last] - self.normal[first]) / span
        across = impulse - tangential
        size = np.linalg.norm(across, axis=1, keepdims=True)
        across = np.divide(across, size, out=np.zeros_like(across), where=size > 0)
        along = heading - (heading * across).sum(axis=1, keepdims=True) * across
        length = np.linalg.norm(along, axis=1, keepdims=True)
        along = np.divide(along, length, out=np.zeros_like(along), where=length > SLANTED)
        return normal, (tangential * along).sum(axis=1), np.linalg.norm(tangential, axis=1)


def _history(record: Trajectory, scene: Scene, body: int | None, wall: int | None) -> _Patches:
    """The patches of one wall or body at all frames, in the order of the frame with most of them.

    A frame has all those of earlier frames.
    """
    number = wall if body is None else body - len(scene.bodies)
    frames = [_of_solid(frame, number) for frame in record.patches()]
    last = max(frames, key=lambda frame: len(frame["normal"]) if frame else 0)
    if not last:
        last = {"x": np.empty((0, scene.dim)), "normal": np.empty(0)}
        last |= {name: np.empty((0, scene.dim)) for name in ("impulse", "tangential")}

    place = {x.tobytes(): k for k, x in enumerate(last["x"])}
    rows = [[place[x.tobytes()] for x in frame["x"]] if frame else [] for frame in frames]

    def padded_to_last(name: str) -> Array:
        whole = np.zeros((len(frames), *last[name].shape))
        for numbers, row, frame in zip(whole, rows, frames, strict=True):
            if frame:
                numbers[row] = frame[name]
        return whole

    names = ("impulse", "tangential", "normal")
    return _Patches(last["x"], *(padded_to_last(name) for name in names))


def _of_solid(frame: dict[str, NDArray[Any]], number: int | None) -> dict[str, NDArray[Any]]:
    """The patches of one solid in a frame; none if the frame has none of it."""
    mine = frame["solid"] == number if frame else np.zeros(0, dtype=bool)
    return {name: values[mine] for name, values in frame.items()} if mine.any() else {}


def _surface(scene: Scene, body: int | None, wall: int | None) -> Surface:
    """Patches of the surface of the solid, and their area."""
    return wall_surface(scene, wall) if wall is not None else body_surface(scene, body or 0)


def _check_solid(record: Trajectory, scene: object, body: object, wall: object) -> None:
    """Refuse a record without patches, and anything but one wall or body."""
    if not isinstance(scene, Scene) or not record.has_tractions:
        raise ValueError(f"record = {record!r} must be one of a simulation with tractions")
    if (body is None) == (wall is None):
        raise ValueError(f"body = {body} or wall = {wall} must be given, and not both")
    if body is not None:
        integer("body", body, 0, len(scene.bodies) - 1)
    else:
        integer("wall", wall, 0, len(scene.walls) - 1)


def _directions(scene: Scene, body: int | None) -> tuple[str, ...]:
    axes = tuple(AXES[: scene.dim])
    return axes if body is None else (*axes, "angle")


def _turning(record: Trajectory, body: int | None, frames: tuple[int, int]) -> Array:
    """Rotation of a body from its coordinates to the scene, in the middle between two frames."""
    if body is None:
        return np.eye(3)
    first, last = (split(record.bodies[k, body], 3)["quaternion"] for k in frames)
    w, x, y, z = first + (last if first @ last > 0 else -last)
    return scipy.spatial.transform.Rotation.from_quat([x, y, z, w]).as_matrix()


def _placed(
    scene: Scene, body: int | None, x: Array, turn: Array, along: str
) -> tuple[Array, Array]:
    """Coordinates of patches along a direction, and the unit vectors in which they grow."""
    dim = scene.dim
    if body is None:
        place = x
    else:
        arm = x @ turn[:dim, :dim].T
        place = arm + np.asarray(scene.bodies[body].position)
    if along != "angle":
        axis = AXES.index(along)
        return place[:, axis], np.broadcast_to(np.eye(dim)[axis], x.shape)
    ahead, up = arm[:, 0], arm[:, -1]
    heading = np.zeros(x.shape)
    radius = np.maximum(np.hypot(ahead, up), np.finfo(float).tiny)
    heading[:, 0], heading[:, -1] = -up / radius, ahead / radius
    return np.degrees(np.arctan2(ahead, -up)), heading


def _edges(bins: object, along: str, places: Array, x: Array, cell: float) -> Array:
    """Edges of the bins, from their number or as they are given."""
    if bins is not None and not isinstance(bins, int | np.integer):
        edges = np.asarray(ascending("bins", bins))
        if len(edges) < 2:
            raise ValueError(f"bins = {bins} must have two edges at least")
        return edges
    low, high = -180.0, 180.0
    length = 2 * np.pi * np.hypot(x[:, 0], x[:, -1]).max()
    if along != "angle":  # patches are about a cell wide
        low, high = places.min() - cell / 2, places.max() + cell / 2
        length = high - low
    usual = max(round(length / (CELLS * cell)), 1)
    return np.linspace(low, high, (usual if bins is None else integer("bins", bins, 1)) + 1)


def _summed(places: Array, values: Array, edges: Array) -> Array:
    """Sums of values over bins; the last one contains its upper edge."""
    return np.histogram(places, edges, weights=values)[0]


def _per_area(area: Array, normal: Array, tangential: Array, rubbed: Array) -> list[Array]:
    """Area, pressure, tangential traction and mobilised friction of bins, nan where undefined."""
    with np.errstate(divide="ignore", invalid="ignore"):
        pressure, drag = (np.where(area > 0, sums / area, np.nan) for sums in (normal, tangential))
        friction = np.where(normal > 0, rubbed / normal, np.nan)
    return [area, pressure, drag, friction]

"""Rigid bodies in a picture: their sections, from the signed distances of their shapes."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING, Any, cast

import contourpy
import numpy as np
from matplotlib.axes import Axes
from matplotlib.lines import Line2D
from matplotlib.patches import PathPatch
from matplotlib.path import Path
from numpy.typing import NDArray

from granular.model.typing import AnyScene
from granular.mpm.body_distances import distance_at
from granular.plot.canvas import Extent, View
from granular.shapes.measures import thicknesses
from granular.tools.arrays import Array

if TYPE_CHECKING:
    from granular.mpm.bodies import Body, BodyState
    from granular.mpm.scene import Scene


STYLE = {"facecolor": "#d5d8dc", "edgecolor": "#3f4650", "linewidth": 0.9}
INTERVALS = 1200
"""Intervals along the longer side of the region in which a section is computed."""
COARSE = 128
"""The same for the boxes of sections, to which a picture is fitted."""
BLOCK = 16
"""Nodes along the side of a block; only blocks near a surface are sampled at every node."""
MARK = 0.85
"""Length of the mark of a body that turns, over the depth of its position in the solid."""
MARGIN = 1.5
"""Factor on the distance at which a block counts as near, as sampled distances have errors."""


class Section:
    """Signed distances of a body in the plane of a picture, on a regular grid of nodes.

    Parameters
    ----------
    scene : Scene
    body : Body
    view : View
    extent : ((left, right), (bottom, top))
        Region [m].
    intervals : int
        Number of intervals along its longer side.
    """

    def __init__(
        self, scene: Scene, body: Body, view: View, extent: Extent, intervals: int = INTERVALS
    ) -> None:
        self._scene, self._body, self._view = scene, body, view
        step = max(high - low for low, high in extent) / intervals
        self.x, self.y = (
            # Two intervals beyond the region, so that no outline runs along its edge.
            low + step * np.arange(-2, math.ceil((high - low) / step - 1e-9) + 3)
            for low, high in extent
        )
        self._step = step
        # Parts thinner than the intervals are drawn as thick as these.
        thickness = min(thicknesses(body.shape))
        self.level = max(0.0, 0.75 * step - 0.5 * thickness)

    def _at(self, x: NDArray, y: NDArray, pose: BodyState) -> Array:
        return distance_at(
            self._scene.grid, self._body, self._view.in_space(self._scene, x, y), pose
        )

    def distances(self, pose: BodyState) -> Array:
        """Distances [m] at the nodes, shape (y, x); far from the surface only their sign holds."""
        counts = len(self.y), len(self.x)
        starts = [np.arange(0, n, BLOCK) for n in counts]
        rows, columns = (at.ravel() for at in np.meshgrid(*starts, indexing="ij"))
        half = 0.5 * (BLOCK - 1) * self._step
        middle = self._at(self.x[columns] + half, self.y[rows] + half, pose)
        of_block = middle.reshape(len(starts[0]), len(starts[1]))
        field = np.repeat(np.repeat(of_block, BLOCK, axis=0), BLOCK, axis=1)
        field = field[: counts[0], : counts[1]]
        near = abs(middle) < MARGIN * (math.sqrt(2) * half + self._step) + self.level
        j, i = np.meshgrid(np.arange(BLOCK), np.arange(BLOCK))
        row = (rows[near][:, None] + i.ravel()).ravel()
        column = (columns[near][:, None] + j.ravel()).ravel()
        inside = (row < counts[0]) & (column < counts[1])
        row, column = row[inside], column[inside]
        field[row, column] = self._at(self.x[column], self.y[row], pose)
        return field

    def outline(self, pose: BodyState) -> Path:
        """Area of the section as a compound path, with holes; empty if there is none."""
        field = self.distances(pose)
        generator: Any = contourpy.contour_generator(
            self.x, self.y, field, fill_type=contourpy.FillType.OuterOffset
        )
        points, offsets = generator.filled(min(float(field.min()), self.level) - 1.0, self.level)
        vertices, codes = [np.zeros((0, 2))], [np.zeros(0, dtype=np.uint8)]
        for places, ends in zip(points, offsets, strict=True):
            code = np.full(len(places), Path.LINETO, dtype=np.uint8)
            code[ends[:-1]], code[ends[1:] - 1] = Path.MOVETO, Path.CLOSEPOLY
            vertices.append(places)
            codes.append(code)
        return Path(np.concatenate(vertices), np.concatenate(codes))

    def mark(self, pose: BodyState, shown: bool) -> Array:
        """Line from the position of a body in a direction that turns with it, shape (2, 2).

        Its columns are the ends; it has no length where the position is not in the solid, or the
        section is not `shown`.
        """
        axes = [self._view.across, self._view.up]
        place = np.asarray(pose.position)
        depth = -distance_at(self._scene.grid, self._body, place[None], pose)[0]
        length = MARK * depth if shown and 0.0 < depth < np.inf else 0.0
        heading = np.asarray(pose.rotation)[axes, self._view.across]
        return np.stack([place[axes], place[axes] + length * heading], axis=1)

    def boxes(self, pose: BodyState) -> Iterator[Extent]:
        """Boxes of the closed lines of the surface; those that leave the region have none."""
        generator: Any = contourpy.contour_generator(self.x, self.y, self.distances(pose))
        for line in generator.lines(self.level):
            if (line[0] == line[-1]).all():
                (left, bottom), (right, top) = line.min(axis=0), line.max(axis=0)
                yield (left, right), (bottom, top)


class Bodies:
    """The sections of the bodies of a scene in an axes, which can show another state.

    They are made anew only for bodies that have moved. A body that turns has a mark, a line from
    its position, by which its turning is seen.

    Parameters
    ----------
    ax : Axes
        Axes to draw into.
    scene : Scene
    poses : sequence of BodyState
    view : View
    extent : ((left, right), (bottom, top))
        Region to draw [m].
    intervals : int
        See `Section`.
    """

    def __init__(
        self,
        ax: Axes,
        scene: AnyScene,
        poses: Sequence[BodyState],
        view: View,
        extent: Extent,
        intervals: int = INTERVALS,
    ) -> None:
        self._poses: list[BodyState | None] = [None] * len(poses)
        # Points that lie behind one another are not hidden by the section in their middle.
        filled = dict(STYLE, zorder=1.0 if view.projects else 2.5)
        self.artists: list[PathPatch] = []
        self._sections = []
        self._mark_of = [_mark(ax) if body.turns else None for body in scene.bodies]
        self.marks = [mark for mark in self._mark_of if mark is not None]
        for body in scene.bodies:
            self._sections.append(Section(cast("Scene", scene), body, view, extent, intervals))
            self.artists.append(PathPatch(Path(np.zeros((0, 2))), **cast(Any, filled)))
            ax.add_patch(self.artists[-1])
        self.update(poses)

    def update(self, poses: Sequence[BodyState]) -> None:
        """Show the bodies in other poses."""
        for k, (pose, before) in enumerate(zip(poses, self._poses, strict=True)):
            if before is None or _has_moved(pose, before):
                outline = self._sections[k].outline(pose)
                self.artists[k].set_path(outline)
                mark = self._mark_of[k]
                if mark is not None:
                    visible = bool(np.size(outline.vertices))
                    mark.set_data(*self._sections[k].mark(pose, visible))
                self._poses[k] = pose


def _mark(ax: Axes) -> Line2D:
    """The mark of a body that turns, not placed yet."""
    (line,) = ax.plot([], [], color=cast(str, STYLE["edgecolor"]), lw=1.2, zorder=2.6)
    return line


def _has_moved(pose: BodyState, before: BodyState) -> bool:
    return not (
        np.array_equal(pose.position, before.position)
        and np.array_equal(pose.rotation, before.rotation)
    )


def boxes_of_bodies(
    scene: AnyScene, poses: Sequence[BodyState], view: View, beyond: float = 0.0
) -> Iterator[Extent]:
    """Boxes of the surfaces of bodies in the plane of a picture that close within the domain.

    They may also reach `beyond` the domain, in lengths of its longer side.
    """
    grid = scene.grid
    ends = [(grid.lower[axis], grid.upper[axis]) for axis in (view.across, view.up)]
    more = beyond * max(high - low for low, high in ends)
    (left, right), (bottom, top) = ends
    region = (left - more, right + more), (bottom - more, top + more)
    for body, pose in zip(scene.bodies, poses, strict=True):
        yield from Section(cast("Scene", scene), body, view, region, COARSE).boxes(pose)

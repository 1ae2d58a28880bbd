"""Material without support below it: ends of the grid stop points without a force."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from granular.model.grid import AXES

if TYPE_CHECKING:
    from granular.mpm.scene import Scene


def unsupported(scene: Scene) -> str | None:
    """Sentence on the first source of a scene without support against gravity; None if all have it.

    Gravity counts along its largest component. Any solid that reaches below the top of a source may
    support it: by friction, or where the material arrives. Along a periodic axis material returns
    at the top, and through an open side it should leave.
    """
    vectors = np.array(scene.gravity.vectors)
    pull = vectors[int(np.linalg.norm(vectors, axis=1).argmax())]
    axis = int(np.abs(pull).argmax())
    down = float(np.sign(pull[axis]))
    end = AXES[axis] + ("-" if down < 0 else "+")
    if not down or scene.grid.periodic[axis] or end in scene.grid.open_sides:
        return None
    lowest = max(_lower_ends(scene, axis, down), default=-np.inf)
    names = [f"fills[{i}]" for i in range(len(scene.fills))]
    names += [f"inflows[{i}]" for i in range(len(scene.inflows))]
    for name, source in zip(names, scene.sources, strict=True):
        top = min(down * corner[axis] for corner in source.region.bounds)
        if lowest <= top + scene.grid.slack * scene.grid.cell:
            at = scene.grid.lower[axis] if down < 0 else scene.grid.upper[axis]
            return (
                f"{name} has no Wall, Solid or body below it: the end of the grid stops points "
                "without a force, so that they lie there in a layer without thickness; take "
                f"walls=(gr.Wall({axis}, {at:g}),), or open_sides={{{end!r}}} if the material is "
                "to leave"
            )
    return None


def _lower_ends(scene: Scene, axis: int, down: float) -> list[float]:
    """Lower ends along an axis of the solids [m], as coordinates times `down`."""
    across = [wall.extent(scene.grid, axis) for wall in scene.walls if wall.axis in (axis, None)]
    ends = [max(down * low, down * high) for low, high in across]
    return ends + [np.inf for _ in scene.bodies]  # they may come from anywhere

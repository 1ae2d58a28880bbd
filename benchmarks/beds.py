"""A bed of grains at rest, in which many benchmarks put a body."""

from __future__ import annotations

from typing import Any

import granular as gr


def bed(
    name: str, size: tuple[float, ...], cell: float, rise: int, jitter: float = 0.0, **others: Any
) -> gr.Scene:
    """Bed in a box with smooth sides and a rough floor, which is `rise` cells higher.

    `others` are parts of the scene in addition to these or instead of them.
    """
    dim, lower = len(size), (0.0,) * len(size)
    cells = [round(side / cell) for side in size]
    ends = ((axis, at) for axis in range(dim - 1) for at in (0.0, size[axis]))
    given: dict[str, Any] = {
        "grid": gr.Grid(lower, cell, (*cells[:-1], cells[-1] + rise)),
        "fills": (gr.Fill(gr.Box(lower, size), 2**dim, jitter=jitter, lithostatic=True),),
        "material": gr.materials.glass_beads.replace(E=1e6),
        "walls": (gr.Wall(dim - 1, 0.0), *(gr.Wall(*end, kind="free_slip") for end in ends)),
        "gravity": gr.Gravity((0.0,), ((*lower[1:], -9.8),)),
        "duration": 1.0,
    }
    return gr.Scene(name=name, **given | others)

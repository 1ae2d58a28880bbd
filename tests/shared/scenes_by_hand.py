"""Scenes for tests, which name only what matters to the test."""

import numpy as np

import granular as gr


def scene_with(*, gravity=9.8, **parts):
    """A scene of one second of mu(I) material, from the parts that are given.

    `gravity` is that along the last axis [m/s2], a constant vector, or a `gr.Gravity`.
    """
    if isinstance(gravity, (int, float)):
        gravity = (*(0.0,) * (parts["grid"].dim - 1), 0.0 - gravity)
    if not isinstance(gravity, gr.Gravity):
        gravity = gr.Gravity((0.0,), (tuple(gravity),))
    given = {"name": "test", "material": gr.MuI(E=1e6), "duration": 1.0}
    return gr.Scene(gravity=gravity, **given | parts)


def two_clouds(dim, cells, wide, points_per_axis):
    """Two clouds of `wide` cells that fly through each other in a box of so many cells."""
    cell = 0.05
    middle, size = 0.5 * cells * cell, wide * cell
    boxes = [
        gr.Box((middle,) * dim, (middle + size,) * dim),
        gr.Box((middle - size,) * dim, (middle,) * dim),
    ]
    return scene_with(
        grid=gr.Grid((0.0,) * dim, cell, (cells,) * dim, periodic=(True,) + (False,) * (dim - 1)),
        fills=tuple(
            gr.Fill(box, points_per_axis**dim, jitter=1.0, density=3e3, velocity=velocity)
            for box, velocity in zip(boxes, ((9.0,) * dim, (-6.0,) * dim), strict=True)
        ),
        material=gr.MuI(E=1e5),
        gravity=0.0,
    )


def mass(scene):
    """Mass of all points of a scene at the start [kg]."""
    points = scene.points()
    return np.sum(points.volume * points.density)

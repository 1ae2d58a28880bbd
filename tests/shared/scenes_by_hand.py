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


def mass(scene):
    """Mass of all points of a scene at the start [kg]."""
    points = scene.points()
    return np.sum(points.volume * points.density)

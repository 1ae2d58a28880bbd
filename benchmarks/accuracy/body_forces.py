"""Forces on a body that moves at a constant speed, between some paths."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

import granular as gr
from granular.tools.arrays import Array

RAMP = 0.02
"""Time in which a body takes up its speed [s]."""


def ramp_to(velocity: Sequence[float]) -> gr.Motion:
    """Motion with this velocity after the ramp."""
    return gr.Motion(times=(0.0, RAMP), velocity=((0.0,) * len(velocity), tuple(velocity)))


def forces(sim: gr.Simulation, paths: Sequence[float]) -> Iterator[tuple[float, Array]]:
    """Run on from path to path of body 0 [m]; give the middle of each and the mean force [N]."""
    speed = float(np.hypot.reduce(sim.scene.bodies[0].motion.velocity[-1]))
    seen: list[tuple[float, float, Array]] = []
    for path in paths:
        sim.run(until=path / speed + RAMP / 2, monitor=False)
        moved = (sim.time - RAMP / 2) * speed
        seen.append((sim.time, moved, np.array(sim.bodies[0].impulse)))
        if len(seen) > 1:
            (t, before, impulse), (later, after, sum_) = seen[-2:]
            yield (before + after) / 2, (sum_ - impulse) / (later - t)

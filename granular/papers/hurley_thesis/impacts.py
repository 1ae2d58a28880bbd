"""Records of impacts on discs: what a camera would see, and the forces that it does not."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cache

import numpy as np
from scipy.signal import filtfilt, firwin

from granular.grain_scale.inference import OUTSIDE, Packing
from granular.papers.hurley_thesis.errors import with_noise
from granular.papers.hurley_thesis.grains import Grains, Table
from granular.papers.hurley_thesis.packings import Case, case_from
from granular.tools.arrays import Array, IndexArray

DISC = 22.225e-3
"""Radius of the discs of section 3.3 [m]."""
FRAME = 2e-4
"""Between two frames [s]: 5 kHz."""
MU = 0.6
"""Friction between the discs of chapter 3."""


@dataclass(frozen=True)
class Record:
    """Frames of grains under impact: their positions and velocities, and the positions of the
    others.

    `frames` holds the cases of those frames, numbered `touching`, that have contacts.
    """

    times: Array
    x: Array
    v: Array
    others: Array
    masses: Array
    touching: IndexArray
    frames: list[Case]


@cache
def impact(shift: float = 0.0) -> Record:
    """Six discs in a corner, hit by a heavy body at 27 degrees off the centre of the last disc."""
    gap, R = 2e-5, np.array([DISC] * 6 + [0.06])
    rise = DISC * (1 + np.sqrt(3)) + gap
    x = np.array(
        [[DISC * (2 * k + 1) + gap * k, DISC] for k in range(3)]
        + [[DISC * (2 * k + 2) + gap * k, rise] for k in range(3)]
        + [[0.0, 0.0]]
    )
    angle = np.radians(27.0)
    x[6] = x[5] + (R[5] + R[6] + 1e-4) * np.array([np.cos(angle), np.sin(angle)])
    x[:, 0] += shift
    m = 1100 * np.pi * R**2
    m[6] = 8.0
    grains = Grains(
        x, R, m, 0.0, np.inf, dim=2, kn=3e6, kt=2e6, mu=MU, dt=4e-6, damping=0.15
    )  # fmt: skip
    grains.v[6, :2] = -1.141, -0.66
    return film(grains, 6, 140, FRAME)


def film(grains: Grains, seen: int, count: int, interval: float) -> Record:
    """Record frames of the first `seen` grains; the others count as bodies from outside."""
    steps = round(interval / grains.dt)
    d = grains.dim
    x, v, others, frames, touching = [], [], [], [], []
    for k in range(count):
        x.append(grains.x[:seen, :d].copy())
        v.append(grains.v[:seen, :d].copy())
        others.append(grains.x[seen:, :d].copy())
        table = grains.contacts()
        bodies = np.where(table["bodies"] >= seen, OUTSIDE, table["bodies"])
        of_seen = bodies.max(axis=1) >= 0
        if of_seen.any():
            table = {name: array[of_seen] for name, array in (table | {"bodies": bodies}).items()}
            frames.append(moving_case(grains, table, seen))
            touching.append(k)
        grains.step(steps)
    times = interval * np.arange(float(count))
    return Record(
        times, np.array(x), np.array(v), np.array(others), grains.m[:seen], np.array(touching),
        frames,
    )  # fmt: skip


def moving_case(grains: Grains, table: Table, seen: int) -> Case:
    """Case in 2D with the exact accelerations of the centroids and the angular accelerations."""
    force, torque, _ = grains.total(0.0)
    motion = {"gravity": grains.gravity[:2]} if grains.gravity.any() else {}
    motion["accelerations"] = (force / grains.m[:, None])[:seen, :2]
    motion["angular_accelerations"] = (torque[:, 2] / grains.inertia)[:seen]
    motion |= {"masses": grains.m[:seen], "inertias": grains.inertia[:seen]}
    return case_from(table, grains.x[:seen, :2], grains.R[:seen], **motion)


def noisy_record(record: Record, seed: int) -> list[Packing]:
    """Packings as filmed at 5 kHz: stresses wrong by 10 %, centroids by 0.02 mm, no rotation.

    Accelerations of the centroids are low-pass filtered as in section 3.3.2, here at 600 Hz. Errors
    are those an experiment could state: for accelerations their size in frames without contact; for
    stresses a tenth of their size plus a hundredth of the largest one.
    """
    rng, taps = np.random.default_rng(seed), firwin(31, 600, fs=1 / FRAME, window="hamming")

    def smooth(series: Array) -> Array:
        smoothed: Array = filtfilt(taps, [1.0], series, axis=0, padtype="odd", padlen=100)
        return smoothed

    x = smooth(record.x + rng.normal(0, 2e-5, record.x.shape))
    a = smooth(np.gradient(np.gradient(x, FRAME, axis=0), FRAME, axis=0))
    idle = np.delete(a, record.touching, axis=0).std()
    packings = []
    for k, case in zip(record.touching, record.frames, strict=True):
        noisy = with_noise(case.packing, rng, bias=0.0)
        size = np.sqrt((noisy.stresses**2).mean(axis=(1, 2)))
        packings.append(
            replace(
                noisy,
                stress_errors=0.1 * size + 0.01 * size.max(),
                accelerations=a[k],
                acceleration_errors=np.full(len(size), idle),
                inertias=None,
                angular_accelerations=None,
            )
        )
    return packings

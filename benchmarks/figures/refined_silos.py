"""Differences between coarse and refined silos: pressure, vertical velocity and arch.

Part of `clogging.py`.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

import granular as gr
from granular.measure import GridField
from granular.papers import silo_clogging
from granular.papers.silo_clogging.refinement import SHOWN
from granular.papers.silo_clogging.silos import FRAME
from granular.papers.silo_clogging.velocity_slices import HEIGHTS

STATIC_FRAME, FLOWING_FRAME = (FRAME * SHOWN[ratio] for ratio in (1, 5))
"""Times of figure 9 [s], of a silo that jams and of one that flows."""
AROUND = 0.05
"""Half-width of the time window for the velocity of packings [s]."""


def window(record: gr.Trajectory, at: float, half: float) -> list[gr.State]:
    """Frames around a time."""
    near = np.flatnonzero(np.abs(record.times - at) <= half + 1e-4)
    return [record[int(i)] for i in near]


def coarsened(field: GridField) -> GridField:
    """Means of two by two cells."""
    nx, ny = (n // 2 for n in field.value.shape)

    def blocks(values: np.ndarray) -> np.ndarray:
        return values[: 2 * nx, : 2 * ny].reshape(nx, 2, ny, 2).sum(axis=(1, 3))

    w = blocks(field.weight)
    total = blocks(np.nan_to_num(field.value) * field.weight)
    mean = np.divide(total, w, out=np.full_like(total, np.nan), where=w > 0)
    axes = tuple(
        a[: 2 * n].reshape(n, 2).mean(axis=1) for a, n in zip(field.axes, (nx, ny), strict=True)
    )
    return GridField(axes, mean, w, field.frames)


def mean_field(fields: Sequence[GridField]) -> GridField:
    """Mean of fields of equal size; nan where one of them is nan."""
    weight = np.min([f.weight for f in fields], axis=0)
    value = np.mean([f.value for f in fields], axis=0)
    return GridField(fields[0].axes, value, weight, fields[0].frames)


def compare(coarse: gr.Trajectory, fine: Sequence[gr.Trajectory], ratio: float) -> dict[str, Any]:
    """Differences in pressure, vertical velocity and arch of coarse and refined records.

    If there are several refined records, their fields are averaged.

    Pressures are compared in cells that are full in both, at heights above the opening's width and
    two cells below the highest full ones, away from the surface, the rough bottom and the free
    fall. Times are as in figure 9 (350 frames of 1/240 s in a static silo, 105 in a flowing one),
    averaged over 0.05 s. Differences are relative to the largest pressure of the
    region and to the largest speed of the slice.
    """
    at = min(STATIC_FRAME if ratio < 3 else FLOWING_FRAME, 0.9 * coarse.scene.duration)
    states = [window(record, at, 0.025) for record in (coarse, *fine)]
    p = [gr.measure.frame_average(s, "pressure", weight="volume") for s in states]
    W = coarse.scene.parameters["orifice"]
    differences = pressure_difference(p[0], mean_field([coarsened(one) for one in p[1:]]), W)
    if ratio >= 3:
        return differences | slice_difference(states)
    for name, record, frames in zip(("coarse", "fine"), (coarse, *fine), states, strict=False):
        if silo_clogging.flow_verdict(record).verdict == "static":
            arch = silo_clogging.arch_outline(frames)
            differences[f"arch_{name}"] = {
                "x": arch.x.round(5).tolist(),
                "y": arch.y.round(5).tolist(),
                "relative_crown": round(arch.relative_crown, 4),
            }
    return differences


def pressure_difference(coarse: GridField, fine: GridField, W: float) -> dict[str, Any]:
    rows = min(coarse.value.shape[1], fine.value.shape[1])
    pc, pf = coarse.value[:, :rows], fine.value[:, :rows]
    full = (coarse.weight[:, :rows] > 0) & (fine.weight[:, :rows] > 0)
    top = np.array([np.flatnonzero(column).max(initial=0) for column in full])
    j = np.arange(rows)
    inside = full & (j[None, :] <= top[:, None] - 2) & (coarse.axes[1][:rows][None, :] > W)
    scale = np.nanmax(pc[inside])
    apart = np.abs(pf - pc)[inside] / scale
    local = np.abs(pf - pc)[inside] / np.maximum(pc, 0.1 * scale)[inside]
    return {
        "cells": int(inside.sum()),
        "pressure_mean": round(float((pf[inside].mean() / pc[inside].mean()) - 1), 4),
        "pressure_median": round(float(np.median(apart)), 4),
        "pressure_90": round(float(np.quantile(apart, 0.9)), 4),
        "pressure_local_median": round(float(np.median(local)), 4),
        "pressure_within_10": round(float(np.mean(local <= 0.1)), 4),
    }


def slice_difference(states: Sequence[list[gr.State]]) -> dict[str, Any]:
    """Velocities of the coarse states and mean of the others, at heights in units of coarse W."""
    W = [frames[0].scene.parameters["orifice"] for frames in states]
    coarse, *fine = (
        silo_clogging.velocity_slices(frames, np.array(HEIGHTS) * W[0] / width)
        for frames, width in zip(states, W, strict=True)
    )
    differences: dict[str, Any] = {}
    for i, height in enumerate(HEIGHTS):
        v = np.mean([np.interp(coarse.x, f.x, f.velocity[i]) for f in fine], axis=0)
        peak = np.nanmax(np.abs(coarse.velocity[i]))
        differences[f"slice_{height}W"] = {
            "peak": round(float(peak), 4),
            "peak_ratio": round(float(np.nanmax(np.abs(v)) / peak), 4),
            "mean_ratio": round(float(np.nanmean(v) / np.nanmean(coarse.velocity[i])), 4),
            "largest": round(float(np.nanmax(np.abs(v - coarse.velocity[i])) / peak), 4),
        }
    return differences

"""Figures 9 and 10: flow between cylinders, its profile, its shear band and its moment."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from matplotlib.cm import ScalarMappable
from matplotlib.colors import Normalize

from granular.materials import couette_beads
from granular.papers.figure import Drawn
from granular.papers.haeri2021.cylinders import (
    BEADS,
    COARSE,
    HIGH,
    LAYER,
    LOW,
    CylinderFlow,
    decay_length,
    recorded_flow,
)
from granular.papers.haeri2021.document import BEADS_E, figure_of_runs, softened
from granular.papers.runs import Runs
from granular.plot.canvas import Picture
from granular.record import Trajectory
from granular.tools.arrays import Array

BAND = 0.1
"""Share of the speed of the cylinder to which it falls within the shear band."""
TAIL = 0.02
"""Distance from the cylinder at which the tails are compared [m]."""


def flow(runs: Runs, name: str, **changes: Any) -> Trajectory:
    """Record of a flow in cells of a grain's size; in full size in the document's cell."""
    size = COARSE if runs.quick else HIGH if runs.full else LOW
    kind = "couette" if runs.full else "couette_shallow"
    return recorded_flow(runs, kind + name, **(size | changes))


@figure_of_runs(
    "9",
    "angular velocity at the top between cylinders by radius, nonlocal and local, with theory",
    seconds=670.0,
    paper={
        "angular velocity 20 mm from the cylinder, nonlocal": "never 0",
        "angular velocity 20 mm from the cylinder, local": "0",
        "mean error against the document's experiment [%]": 0.9,
    },
    E=BEADS_E,
)
def profile(runs: Runs) -> Drawn:
    """Run the nonlocal and the local law, and compare them with the quasi-static profile.

    In a cell of 24 mm and 1 s of the document's rate; in full size in its cell of 100 mm at four
    times its rate. The experiment is printed as a figure alone; errors are against theory. Where
    the speed is below a hundredth of the cylinder's the profile leaves the theory.
    """
    flows = {}
    with flow(runs, "") as record:
        flows["nonlocal"] = CylinderFlow.measured(record)
    with flow(runs, "_local", material=softened(runs, couette_beads.replace(A=0.0))) as record:
        flows["local (A = 0)"] = CylinderFlow.measured(record)
    nonlocal_, local = flows.values()
    errors, slow = nonlocal_.errors(nonlocal_.slow), nonlocal_.slow
    far = slow.r[0] + TAIL
    numbers = {
        "largest error against slow flow [% of the wall's speed]": 100 * float(errors.max()),
        "mean error against slow flow [% of the wall's speed]": 100 * float(errors.mean()),
        "largest error against flow at this rate [%]": 100
        * float(nonlocal_.errors(nonlocal_.driven).max()),
        "length over which the tail falls by e [mm]": 1e3
        * decay_length(nonlocal_.r, nonlocal_.omega),
        "the same in theory [mm]": 1e3 * decay_length(slow.r, slow.omega),
        "angular velocity 20 mm from the cylinder, nonlocal": float(
            np.interp(far, nonlocal_.r, nonlocal_.omega)
        ),
        "angular velocity 20 mm from the cylinder, local": float(
            np.interp(far, local.r, local.omega)
        ),
        "the same in theory, nonlocal": float(np.interp(far, slow.r, slow.omega)),
        "moment on the inner cylinder [N m]": nonlocal_.moment,
        "the same in theory, at the mean pressure [N m]": nonlocal_.moment_of_theory,
    }
    return Drawn({"": figure_9(flows), "moment": moments(flows)}, numbers)


def figure_9(flows: Mapping[str, CylinderFlow]) -> Picture:
    """Angular velocity over that of the inner cylinder, with linear and logarithmic axes."""
    picture = Picture(figsize=(7.0, 3.0), layout="compressed")
    axes = picture.subplots(1, 2)
    for ax in axes:
        for label, result in flows.items():
            ax.plot(1e3 * result.r, result.omega, "o", markersize=3, label=label)
        slow = next(iter(flows.values())).slow
        ax.plot(1e3 * slow.r, slow.omega, color="black", label="slow limit, theory")
        ax.set(xlabel="r [mm]", ylabel="angular velocity/inner cylinder")
    axes[1].set(yscale="log", ylim=(1e-5, 1.5))
    axes[0].legend()
    return picture


def moments(flows: Mapping[str, CylinderFlow]) -> Picture:
    """Moments on both cylinders over time, which are opposite in steady flow."""
    picture = Picture(figsize=(5.0, 3.0), layout="compressed")
    ax = picture.subplots()
    for k, (label, result) in enumerate(flows.items()):
        times = [window.time for window in result.windows]
        inner, outer = np.array([window.moments for window in result.windows]).T
        ax.plot(times, -inner, color=f"C{k}", label=f"{label}: drives the inner cylinder")
        ax.plot(times, outer, "--", color=f"C{k}", label=f"{label}: holds the outer cylinder")
    theory = next(iter(flows.values())).moment_of_theory
    ax.axhline(theory, color="black", linewidth=0.8, label="theory, mean pressure")
    ax.set(xlabel="end of the window [s]", ylabel="moment [N m]")
    ax.legend()
    return picture


@figure_of_runs(
    "10",
    "shear band at the top between cylinders: speed from above, and by radius",
    seconds=440.0,
    paper={"speed": "decays exponentially away from the cylinder"},
    E=BEADS_E,
)
def shear_band(runs: Runs) -> Drawn:
    """Draw the speed over the last windows, by displacements from frame to frame.

    The numbers are of the same flow as those of figure 9.
    """
    with flow(runs, "") as record:
        result = CylinderFlow.measured(record)
        late = [record[i] for i in (-2, -1)]
    last, size = late[1], late[1].scene.parameters
    wall = size["omega"] * size["inner"]
    speed = result.omega * result.r / size["inner"]
    band = float(np.interp(-np.log(BAND), -np.log(np.maximum(speed, 1e-9)), result.r))
    numbers = {
        "width in which the speed falls to a tenth of the wall's [mm]": 1e3
        * (band - size["inner"]),
        "the same over the diameter of a grain": (band - size["inner"]) / BEADS.d,
        "length over which the speed falls by e [mm]": 1e3 * decay_length(result.r, speed),
    }
    top = last.x[:, 2] > size["height"] - LAYER * last.scene.grid.cell
    moved = np.linalg.norm(last.x[top] - late[0].x[top], axis=1) / (last.time - late[0].time)
    picture = figure_10(last.x[top], moved / wall, result, speed)
    return Drawn({"": picture}, numbers)


def figure_10(x: Array, speed: Array, result: CylinderFlow, mean: Array) -> Picture:
    """Points of the top layer seen from above by their speed, and the mean speed by radius.

    Parameters
    ----------
    x, speed : ndarray, shapes (n, 3) and (n,)
        Positions [m] of the points, and their speed over that of the inner cylinder.
    result : CylinderFlow
    mean : ndarray, shape (k,)
        Speed of its rings, relative likewise.
    """
    picture = Picture(figsize=(7.0, 3.2), layout="compressed")
    left, right = picture.subplots(1, 2)
    colours, scale = Normalize(0.0, 1.0), "Reds"
    left.scatter(*(1e3 * x[:, :2].T), c=speed, s=0.4, cmap=scale, norm=colours, rasterized=True)
    left.set(xlabel="x [mm]", ylabel="y [mm]", aspect="equal", facecolor="0.93")
    picture.colorbar(ScalarMappable(colours, scale), ax=left, label="speed/inner cylinder")
    right.semilogy(1e3 * result.r, np.maximum(mean, 1e-6), "o", color="C3", label="here")
    slow = result.slow
    right.plot(1e3 * slow.r, slow.omega * slow.r / slow.r[0], color="black", label="slow limit")
    right.axhline(BAND, color="0.6", linestyle=":")
    right.set(xlabel="r [mm]", ylabel="speed/inner cylinder", ylim=(1e-5, 1.5))
    right.legend()
    return picture

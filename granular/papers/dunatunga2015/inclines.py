"""Figures 9 and 10: flow down inclines."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Self, cast

import numpy as np
from matplotlib.axes import Axes

from granular import measure, scenes, theory
from granular.materials import MuI, glass_beads
from granular.measure.stress import friction_of
from granular.model.state import State
from granular.mpm.scene import Scene
from granular.papers.dunatunga2015.document import SCHEMES, figure_of_runs
from granular.papers.dunatunga2015.panels import axes_grid, shades
from granular.papers.figure import Drawn
from granular.papers.runs import Runs
from granular.plot.canvas import Picture
from granular.tools.arrays import Array

FRAMES = 100
DURATION = {"quick": 2.0, "normal": 20.0, "full": 500.0}
"""Duration of the flows [s]; that of the document is the last."""
SHOWN = (19, 22, 25, 28, 31, 34)


def flows(runs: Runs) -> list[InclineFlow]:
    """Flows at 19 to 34 degrees."""
    until = DURATION[runs.settings.size]
    return [
        InclineFlow.measured(
            runs.frames(incline(runs, angle), until, until / FRAMES, lambda s: s, f"{angle} deg")
        )
        for angle in (SHOWN if runs.quick else range(19, 35))
    ]


def incline(runs: Runs, angle: float) -> Scene:
    """One column of cells on a plane."""
    return scenes.incline(
        angle_deg=float(angle),
        cell=0.01 if runs.quick else 0.005,
        material=runs.grains(glass_beads),
        scheme=runs.choose(SCHEMES),
    )


@figure_of_runs(
    "9",
    "friction, mean speed and mean acceleration on inclines over time",
    seconds=95.0,
    paper={
        "friction at 25 deg at the end": 0.4663,
        "friction at 34 deg at the end": 0.6435,
        "acceleration at 34 deg at the end [m/s2]": 0.2521,
    },
)
def over_time(runs: Runs) -> Drawn:
    """Run inclines of 19 to 34 degrees, for 20 s or in full size for the 500 s of the document.

    The numbers of the document are the limits that it names: tan(angle), mu_2, and g (sin(angle) -
    mu_2 cos(angle)).
    """
    measured, grains = runs.once("flows", lambda: flows(runs)), runs.grains(glass_beads)
    by_angle = {round(flow.angle_deg): flow for flow in measured}
    numbers = {
        "friction at 25 deg at the end": float(by_angle[25].friction[-1]),
        "friction at 34 deg at the end": float(by_angle[34].friction[-1]),
        "acceleration at 34 deg at the end [m/s2]": float(by_angle[34].acceleration[1][-1]),
    }
    chosen = [by_angle[angle] for angle in SHOWN]
    return Drawn({"": figure_9(chosen, mu_s=grains.mu_s, mu_2=grains.mu_2)}, numbers)


@figure_of_runs(
    "10",
    "mean speed against the angle, and the velocity profile at 25 degrees",
    seconds=115.0,
    paper={
        "error of the profile at 25 deg": "0 within the line",
        "largest error of the mean speed, 22 to 26 deg": "0 within the markers",
    },
)
def speeds(runs: Runs) -> Drawn:
    """Run the same inclines, and one of 25 degrees three times as long.

    Errors are relative to the solution of the one-dimensional equation at the same time, which the
    flow has reached below 27 degrees in 20 s.
    """
    measured = runs.once("flows", lambda: flows(runs))
    until = DURATION[runs.settings.size]
    longer = until if runs.full else 3 * until
    (state,) = runs.states_at(incline(runs, 25), (longer,), "profile at 25 deg")
    height, grains = float(state.scene.parameters["height"]), cast(MuI, state.scene.material)
    exact = theory.transient(25.0, height, grains, [state.time], 9.8)
    profile = measure.velocity_profile(state)
    off = profile.value - np.interp(profile.y, exact.y, exact.v[0])
    errors = [
        abs(flow.speed[-1] / theory.transient(
            flow.angle_deg, height, grains, [flow.times[-1]], 9.8).mean[0] - 1)
        for flow in measured
        if 22 <= flow.angle_deg <= 26
    ]  # fmt: skip
    numbers = {
        "error of the profile at 25 deg": float(
            np.linalg.norm(off) / np.linalg.norm(profile.value)
        ),
        "largest error of the mean speed, 22 to 26 deg": float(max(errors)),
    }
    return Drawn({"": figure_10(measured, state)}, numbers)


@dataclass(frozen=True)
class InclineFlow:
    """Flow down an incline over time.

    Attributes
    ----------
    angle_deg : float
        Angle of the incline [degrees].
    times : ndarray, shape (k,)
        Times of the frames [s], ascending.
    friction : ndarray, shape (k,)
        tau/p of the depth-averaged stress; nan without pressure.
    speed : ndarray, shape (k,)
        Depth average of the velocity down the slope [m/s].
    """

    angle_deg: float
    times: Array
    friction: Array
    speed: Array

    @classmethod
    def measured(cls, states: Iterable[State]) -> Self:
        """Measure the flow from states of the scene `incline`, in the order of time.

        Raises
        ------
        ValueError
            If there are fewer than two.
        """
        rows, angle = [], math.nan
        for state in states:
            angle = state.scene.parameters["angle_deg"]
            stress = np.atleast_2d(measure.depth_average(state, "stress"))
            speed = measure.depth_average(state, state.v[:, 0])
            rows.append((state.time, float(friction_of(stress)[0]), speed))
        if len(rows) < 2:
            raise ValueError(f"states: {len(rows)} given, a flow over time needs at least 2")
        return cls(float(angle), *np.array(rows).T)

    @property
    def acceleration(self) -> tuple[Array, Array]:
        """Mid-times [s] and depth-averaged acceleration [m/s2] between frames."""
        middle = (self.times[1:] + self.times[:-1]) / 2
        return middle, np.diff(self.speed) / np.diff(self.times)


def figure_9(
    flows: Sequence[InclineFlow], *, mu_s: float, mu_2: float, gravity: float = 9.8
) -> Picture:
    """Inclines: friction, depth-averaged speed and acceleration over time.

    Parameters
    ----------
    flows : sequence of InclineFlow
    mu_s, mu_2 : float
        Friction coefficients of the material. The dotted lines in the left panel are the friction
        that the flow tends to: tan(angle), or mu_2 if tan(angle) is larger. The dotted lines in
        the right panel are the acceleration that then remains.
    gravity : float
        Magnitude of gravity [m/s2].
    """
    fig, ((left, centre, right),) = axes_grid(3)
    for flow, shade in zip(flows, shades(len(flows)), strict=True):
        name = f"{flow.angle_deg:g} deg"
        left.plot(flow.times, flow.friction, color=shade, label=name)
        angle = math.radians(flow.angle_deg)
        if (slope := min(math.tan(angle), mu_2)) > mu_s:
            left.axhline(slope, color=shade, linewidth=0.9, linestyle=":")
        centre.plot(flow.times, flow.speed, color=shade, label=name)
        right.plot(*flow.acceleration, color=shade, label=name)
        late = gravity * (math.sin(angle) - mu_2 * math.cos(angle))
        if late > 0:
            right.axhline(late, color=shade, linewidth=0.9, linestyle=":")
    for value, text in ((mu_s, r"$\mu_s$"), (mu_2, r"$\mu_2$")):
        left.axhline(value, color="black", linewidth=1.0, linestyle="--")
        across = left.get_yaxis_transform()
        left.text(0.98, value, text, transform=across, ha="right", va="bottom")
    left.set(xlabel="time [s]", ylabel=r"friction $\mu$", ylim=(0.9 * mu_s, 1.08 * mu_2))
    centre.set(xlabel="time [s]", ylabel="mean speed [m/s]")
    right.set(xlabel="time [s]", ylabel="mean acceleration [m/s$^2$]")
    centre.legend()
    return fig


def figure_10(
    flows: Sequence[InclineFlow], state: State, *, at_time: bool = True, gravity: float = 9.8
) -> Picture:
    """Inclines: mean speed against the angle, and the velocity profile of one of them.

    Parameters
    ----------
    flows : sequence of InclineFlow
        Their last frames are drawn; all must have the same last time, height and material.
    state : State
        A state of the scene `incline`, for the profile.
    at_time : bool
        Also draw the transient solution (`granular.theory.transient`) at the times of the last
        frames and of the state. It takes long to reach steady flow, the longer the closer the
        slope is to mu_2.
    gravity : float
        Magnitude of gravity [m/s2].
    """
    scene = state.scene
    height, material = float(scene.parameters["height"]), cast(MuI, scene.material)
    fig, ((left, right),) = axes_grid(2)
    _speeds(left, flows, height, material, at_time, gravity)
    _profile(right, state, height, material, at_time, gravity)
    return fig


def _speeds(
    ax: Axes,
    flows: Sequence[InclineFlow],
    height: float,
    material: MuI,
    at_time: bool,
    gravity: float,
) -> None:
    unit = math.sqrt(gravity * height)
    limit = math.degrees(math.atan(material.mu_2))
    steady = np.linspace(15.0, limit - 0.3, 200)
    mean = [theory.bagnold_mean(a, height, material, gravity) for a in steady]
    ax.plot(steady, np.array(mean) / unit, color="black", label="steady, eq. 4.7")
    angles = sorted(flow.angle_deg for flow in flows)
    if at_time:
        time = float(flows[0].times[-1])
        now = [theory.transient(a, height, material, [time], gravity).mean[0] for a in angles]
        ax.plot(angles, np.array(now) / unit, "--", color="C0", label=f"transient, {time:.3g} s")
    speeds = [flow.speed[-1] / unit for flow in flows]
    ax.plot([f.angle_deg for f in flows], speeds, "o", color="C3", label="measured")
    ax.axvline(limit, color="0.6", linestyle=":", label=r"$\arctan\,\mu_2$")
    ax.set(xlabel="angle [deg]", ylabel=r"mean speed / $\sqrt{g h}$")
    ax.set_xlim(min(angles) - 1, max(angles) + 1)
    ax.set_ylim(-0.03 * max(speeds), 1.3 * max(speeds) + 1e-12)
    ax.legend()


def _profile(
    ax: Axes, state: State, height: float, material: MuI, at_time: bool, gravity: float
) -> None:
    angle = float(state.scene.parameters["angle_deg"])
    unit = math.sqrt(gravity * height)
    y = np.linspace(0.0, height, 100)
    if math.tan(math.radians(angle)) < material.mu_2:
        v = theory.bagnold_profile(y, angle, height, material, gravity)
        ax.plot(v / unit, y / height, color="black", label="steady, eq. 4.6")
    if at_time:
        now = theory.transient(angle, height, material, [state.time], gravity)
        label = f"transient, {state.time:.3g} s"
        ax.plot(now.v[0] / unit, now.y / height, "--", color="C0", label=label)
    profile = measure.velocity_profile(state)
    ax.plot(profile.value / unit, profile.y / height, ".", color="C3", label="measured")
    ax.set(xlabel=r"$v_x / \sqrt{g h}$", ylabel="y / h", title=f"{angle:g} deg")
    ax.legend()

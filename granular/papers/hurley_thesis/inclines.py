"""Figures 5.3 and 5.4: layers on periodic inclines."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property, partial
from typing import Self

import numpy as np
from matplotlib.axes import Axes

from granular import plot, scenes
from granular.model.state import State
from granular.papers.dunatunga2015.panels import axes_grid, shades
from granular.papers.figure import Drawn, Number
from granular.papers.hurley_thesis.document import PAPER
from granular.papers.hurley_thesis.sph_measures import (
    BETAS,
    decaying,
    fitted_decay,
    fitted_profile,
    rate_of_the_law,
    steady_rate,
)
from granular.papers.runs import Runs
from granular.sph import Scene, Viscoplastic
from granular.tools.arrays import Array

ANGLES = (12.0, 15.0, 18.0, 21.0, 24.0, 27.0, 30.0, 33.0)
SHOWN = (15.0, 18.0, 21.0, 24.0, 27.0)
"""Angles of the profiles of figure 5.3 [deg]."""
FLOWING = (18.0, 21.0, 24.0, 27.0)
"""Angles of steady flow [deg]."""
DURATION, EVERY, LAST = 10.0, 0.01, 1.0
"""Duration after the tilt, time between two samples, and that over which profiles are averaged [s].
The thesis takes accelerations over 0.01 s."""
AFTER = 0.02
"""Time after the tilt [s] from which accelerations are fitted, where they are largest."""


@dataclass(frozen=True)
class LayerFlow:
    """Flow of a layer after the tilt of gravity.

    Attributes
    ----------
    angle_deg : float
    times : ndarray
        Times after the tilt [s].
    speeds, slips : ndarray
        Mean velocities down the slope of all particles and of the lowest layer [m/s].
    last : sequence of State
        States of the last second.
    """

    angle_deg: float
    times: Array
    speeds: Array
    slips: Array
    last: Sequence[State]

    @classmethod
    def of(
        cls, scene: Scene, samples: Sequence[tuple[float, float, float]], last: Sequence[State]
    ) -> Self:
        """Flow of samples of `look`, from the tilt on."""
        settle = float(scene.parameters["settle"])
        times, speeds, slips = np.array(samples).T
        after = times > settle + AFTER
        return cls(
            float(scene.parameters["angle_deg"]),
            times[after] - settle,
            speeds[after],
            slips[after],
            last,
        )

    @cached_property
    def accelerations(self) -> tuple[Array, Array]:
        """Times [s] and mean accelerations by backward differences [m/s2]."""
        return self.times[1:], np.diff(self.speeds) / np.diff(self.times)

    @cached_property
    def decay(self) -> tuple[float, float, float]:
        """a, b and c of eq. 5.31."""
        return fitted_decay(*self.accelerations)

    @cached_property
    def rates(self) -> tuple[float, float, float]:
        """Shear rate [1/s], and the misfits of a line and of Bagnold's profile."""
        return steady_rate(self.last)

    @property
    def slip(self) -> float:
        """Velocity of the lowest layer in the end [m/s]."""
        return float(self.slips[self.times > self.times[-1] - LAST].mean())


def look(state: State) -> tuple[float, float, float]:
    """Time, and the mean velocities of all particles and of the lowest layer."""
    lowest = state.x[:, -1] < state.scene.grid.cell
    return state.time, float(state.v[:, 0].mean()), float(state.v[lowest, 0].mean())


def sample(late: float, state: State) -> tuple[tuple[float, float, float], State | None]:
    """Result of `look`, and the state itself after a time [s]."""
    return look(state), state if state.time > late else None


def layer(angle_deg: float, beta: float, duration: float, columns_across: int = 0) -> Scene:
    """Layer that settles and is then tilted."""
    return scenes.incline_sph(
        angle_deg=angle_deg,
        columns_across=columns_across,
        headroom=20,
        duration=duration,
        material=Viscoplastic(dilation=beta),
    )


def flows(runs: Runs, angles: Sequence[float]) -> dict[str, dict[float, LayerFlow]]:
    """Flows without and with dilation, by the angle."""
    duration, across = 3.0 if runs.quick else DURATION, 5 if runs.full else 0
    every = 5 * EVERY if runs.quick else EVERY
    flows: dict[str, dict[float, LayerFlow]] = {}
    for name, beta in BETAS.items():
        for angle in angles:
            scene = layer(angle, beta, duration, across)
            late = scene.duration - LAST
            samples = runs.frames(
                scene,
                scene.duration,
                every,
                partial(sample, late),
                f"{angle:g} deg, {name}",
            )
            last = [state for _, state in samples if state is not None]
            flow = LayerFlow.of(scene, [sample for sample, _ in samples], last)
            flows.setdefault(name, {})[angle] = flow
    return flows


# ---- figure 5.3 ----


@PAPER.figure(
    "5.3",
    "layers on inclines: state, velocity profiles, and Bagnold's profile",
    seconds=23.0,
    paper={
        f"shear rate at {angle:g} deg, {name} [1/s]": 0.0 if angle <= 15 else "flows"
        for name in BETAS
        for angle in SHOWN
    }
    | {f"misfit of Bagnold's profile at 24 deg, {name}": "excellent match" for name in BETAS},
)
def profiles(runs: Runs) -> Drawn:
    """Tilt layers, and average their profiles over the last second of 10 s.

    In 2D; in full size in 3D, five particles wide as in the thesis. Profiles are drawn as fitted
    from 20 % to 80 % of the height, Bagnold's with a slip that eq. 5.30 does not have. Misfits are
    residuals of fits to all particles over the spread of the velocities. The law of the thesis,
    whose friction does not depend on the pressure, has the same shear rate at all depths without
    dilation, which is a line.
    """
    both = flows(runs, SHOWN)
    numbers: dict[str, Number] = {}
    for name, by_angle in both.items():
        for angle, flow in by_angle.items():
            numbers[f"shear rate at {angle:g} deg, {name} [1/s]"] = flow.rates[0]
        _, line, bagnold = by_angle[24.0].rates
        numbers[f"misfit of a line at 24 deg, {name}"] = line
        numbers[f"misfit of Bagnold's profile at 24 deg, {name}"] = bagnold
    for angle in FLOWING:
        exact = rate_of_the_law(layer(angle, 0.0, DURATION), angle)
        numbers[f"shear rate of the law at {angle:g} deg, no dilation [1/s]"] = exact or np.nan
    picture, ((state, arrows), (plain, dilative)) = axes_grid(2, 2)
    typical = both["no dilation"][24.0].last[-1]
    plot.frame(typical, "speed", ax=state, title="(a) layer at 24 deg")
    draw_arrows(arrows, typical)
    for ax, (name, by_angle), letter in zip((plain, dilative), both.items(), "cd", strict=True):
        draw_profiles(ax, by_angle)
        ax.set_title(f"({letter}) {name}")
    return Drawn({"": picture}, numbers)


def binned(states: Sequence[State]) -> tuple[Array, Array]:
    """Heights [m] and mean velocities of rows one particle high [m/s]."""
    cell = states[0].scene.grid.cell
    y = np.concatenate([state.x[:, -1] for state in states])
    v = np.concatenate([state.v[:, 0] for state in states])
    row = np.floor(y / cell).astype(int)
    # Rows that particles pass only now and then are left out.
    count = np.bincount(row)
    rows = np.flatnonzero(count > 0.2 * count.max())
    means: Array = np.bincount(row, v)[rows] / count[rows]
    return cell * (rows.astype(float) + 0.5), means


def draw_arrows(ax: Axes, state: State) -> None:
    """Velocities of rows as arrows."""
    y, v = binned([state])
    ax.barh(y, v, height=0.15 * state.scene.grid.cell, color="0.6")
    ax.plot(v, y, "o", color="C0", markersize=4)
    ax.set(xlabel="velocity [m/s]", ylabel="y [m]", title="(b) profile at 24 deg")


def draw_profiles(ax: Axes, by_angle: Mapping[float, LayerFlow]) -> None:
    """Velocity profiles, with Bagnold's and straight ones."""
    for (angle, flow), color in zip(by_angle.items(), shades(len(by_angle)), strict=True):
        y, v = binned(flow.last)
        ax.plot(v, y, "o", color=color, markersize=4, label=f"{angle:g} deg")
        height = y.max() + 0.5 * flow.last[0].scene.grid.cell
        inside = (y > 0.2 * height) & (y < 0.8 * height)
        along = np.linspace(0.0, height, 50)
        for power, dashes in ((1.5, "--"), (1.0, ":")):
            fit = fitted_profile(y[inside], v[inside], height, power)
            ax.plot(fit(along), along, dashes, color=color, linewidth=1.0)
    ax.plot([], [], "--", color="0.4", linewidth=1.0, label="Bagnold")
    ax.plot([], [], ":", color="0.4", linewidth=1.0, label="line")
    ax.set(xlabel="velocity [m/s]", ylabel="y [m]")
    ax.legend(fontsize="small")


# ---- figure 5.4 ----


def left(angle: float) -> str:
    """Statement of the thesis on the acceleration that is left in the end."""
    return "0 or very close" if angle <= 27 else "tends to 0" if angle == 30 else "not 0"


@PAPER.figure(
    "5.4",
    "acceleration and slip of layers on inclines over time",
    seconds=38.0,
    paper={
        f"acceleration b left at {angle:g} deg, {name} [m/s2]": left(angle)
        for name in BETAS
        for angle in (18.0, 27.0, 30.0, 33.0)
    }
    | {f"slip grows with the angle, {name}": "yes" for name in BETAS},
)
def over_time(runs: Runs) -> Drawn:
    """Fit eq. 5.31 to the mean acceleration of layers, and average the velocity of the lowest one.

    The largest possible acceleration at 33 degrees is that of gravity less mu_h, 0.60 m/s2.
    """
    angles = (18.0, 24.0, 27.0, 30.0, 33.0) if runs.quick else ANGLES
    both = flows(runs, angles)
    numbers: dict[str, Number] = {}
    for name, by_angle in both.items():
        for angle in (18.0, 27.0, 30.0, 33.0):
            b = by_angle[angle].decay[1]
            numbers[f"acceleration b left at {angle:g} deg, {name} [m/s2]"] = b
        slips = [flow.slip for flow in by_angle.values()]
        for angle in (18.0, 27.0, 33.0):
            numbers[f"slip at {angle:g} deg, {name} [m/s]"] = by_angle[angle].slip
        grows = np.all(np.diff(slips) > -0.01)
        numbers[f"slip grows with the angle, {name}"] = "yes" if grows else "no"
    picture, ((plain, dilative), (slip, other)) = axes_grid(2, 2)
    for upper, lower, (name, by_angle) in zip(
        (plain, dilative), (slip, other), both.items(), strict=True
    ):
        draw_histories(upper, lower, by_angle)
        upper.set_title(name)
    return Drawn({"": picture}, numbers)


def draw_histories(upper: Axes, lower: Axes, by_angle: Mapping[float, LayerFlow]) -> None:
    """Fits of the accelerations with the raw ones in an inset, and slips."""
    inset = upper.inset_axes((0.55, 0.5, 0.42, 0.46))
    for (angle, flow), color in zip(by_angle.items(), shades(len(by_angle)), strict=True):
        t, acceleration = flow.accelerations
        fit = decaying(t, *flow.decay)
        upper.plot(t, fit, color=color, label=f"{angle:g} deg")
        inset.plot(t, acceleration, color=color, linewidth=0.4, alpha=0.6)
        inset.plot(t, fit, color=color, linewidth=0.9)
        lower.plot(flow.times, flow.slips, color=color)
    upper.set(xlabel="time [s]", ylabel="acceleration [m/s2]", ylim=(-0.1, None))
    inset.set(ylim=(-1.0, 2.5))
    inset.tick_params(labelsize="xx-small")
    lower.set(xlabel="time [s]", ylabel="velocity of the lowest layer [m/s]")
    upper.legend(fontsize="x-small", loc="lower right", ncols=2)

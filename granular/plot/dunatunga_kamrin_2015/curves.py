"""Figures 3, 5, 9, 10 and 13 of Dunatunga & Kamrin 2015: measured curves and reference curves.

The functions take results and simulate nothing; the runs are in `benchmarks/figures`.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Self, cast

import matplotlib
import numpy as np
from matplotlib.axes import Axes
from matplotlib.ticker import LogFormatter
from numpy.typing import ArrayLike

from granular import measure, theory
from granular.materials import MuI
from granular.measure.stress import friction_of
from granular.model.gravity import EARTH
from granular.model.state import State
from granular.plot.canvas import Picture
from granular.tools.arrays import Array

MARKERS = "osD^v<>ph"


def _axes(columns: int, rows: int = 1, height: float = 3.6) -> tuple[Picture, np.ndarray]:
    fig = Picture(figsize=(3.6 * columns if columns > 1 else 5.5, height * rows), layout="tight")
    return fig, fig.subplots(rows, columns, squeeze=False)


def _shades(count: int) -> Array:
    return matplotlib.colormaps["viridis"](np.linspace(0.0, 0.9, max(count, 1)))


def figure_3(aspects: ArrayLike, runouts: Mapping[str, Sequence[measure.Runout]]) -> Picture:
    """Run-out against aspect ratio, with the laws of table 3.

    Parameters
    ----------
    aspects : array_like, shape (k,)
        Height divided by half-width.
    runouts : mapping of str to k Runouts
        Run-outs by the name of the set, for example of a scheme. The marker shows the 99.9 %
        quantile of the mass; the bar spans all three measures.

    Raises
    ------
    ValueError
        If there is not one run-out for each aspect ratio.
    """
    aspects = np.asarray(aspects, dtype=float)
    fig, ((ax,),) = _axes(1, height=4.4)
    along = np.geomspace(0.8 * aspects.min(), 1.25 * aspects.max(), 200)
    for name, dashes in (("lube", "-."), ("lagree", ":"), ("staron", "--")):
        law = theory.RUNOUT_LAWS[name]
        ax.plot(along, law(along), dashes, color="0.5", linewidth=1.2, label=law.source)
    law = theory.RUNOUT_LAWS["dunatunga"]
    ax.plot(along, law(along), color="black", linewidth=1.8, label=law.source)
    for (name, values), shade, marker in zip(
        runouts.items(), _shades(len(runouts)), MARKERS, strict=False
    ):
        if len(values) != len(aspects):
            raise ValueError(
                f"runouts[{name!r}] holds {len(values)}, not {len(aspects)} as aspects"
            )
        ways = np.array([(r.quantile, r.toe, r.contiguous) for r in values])
        value = ways[:, 0]
        bars = (value - np.nanmin(ways, axis=1), np.nanmax(ways, axis=1) - value)
        ax.errorbar(
            aspects, value, bars, fmt=marker, color=shade, markersize=5, capsize=2, label=name
        )
    ax.set(xscale="log", yscale="log", xlabel="aspect ratio a", ylabel="run-out / half-width")
    ax.set_xticks(aspects, labels=[f"{a:g}" for a in aspects])
    ax.tick_params(axis="x", which="minor", bottom=False, labelbottom=False)
    ax.legend()
    return fig


def figure_5(
    histories: Mapping[float, measure.MassHistory],
    fit: measure.BeverlooFit,
    *,
    rho: float,
    gravity: float = EARTH,
    window: tuple[float, float] = (1200.0, 900.0),
) -> Picture:
    """Silos: remaining mass over time, and rate against orifice with Beverloo's law.

    Parameters
    ----------
    histories : mapping of float to MassHistory
        Histories by the width of the orifice [m]; a few representative ones.
    fit : BeverlooFit
        The fit, with all orifices and rates.
    rho, gravity : float
        Bulk density [kg/m3] and gravity [m/s2] of the fit.
    window : (float, float)
        Mass in the full silo [kg] between which the rates were taken (section 4.2).
    """
    fig, ((left, right),) = _axes(2)
    left.axhspan(*sorted(window), color="0.9", label="steady flow")
    for (orifice, history), shade in zip(
        sorted(histories.items()), _shades(len(histories)), strict=True
    ):
        left.plot(history.times, history.mass, color=shade, label=f"D = {100 * orifice:.3g} cm")
    left.set(xlabel="time [s]", ylabel="mass in the silo [kg/m]", ylim=(0.0, None))
    left.legend()
    along = np.geomspace(0.9 * fit.orifices.min(), 1.1 * fit.orifices.max(), 50)
    law = theory.beverloo_rate(along, rho, C=fit.C, gravity=gravity)
    free = theory.beverloo_rate(
        along, rho, C=fit.C_free, gravity=gravity, exponent=fit.exponent_free
    )
    paper = theory.beverloo_rate(along, rho, gravity=gravity)
    right.plot(along, paper, color="0.7", linewidth=3, label="paper, C = 1.42, 3/2")
    right.plot(along, law, color="black", label=f"C = {fit.C:.3f}, 3/2")
    right.plot(
        along, free, "--", color="C0", label=f"C = {fit.C_free:.3f}, {fit.exponent_free:.3f}"
    )
    right.plot(fit.orifices, fit.rates, "o", color="C3", label="measured")
    right.set(xscale="log", yscale="log", xlabel="orifice D [cm]", ylabel="rate [kg/(s m)]")
    right.set_xticks(
        fit.orifices, labels=[f"{100 * d:.3g}" for d in fit.orifices], fontsize="small"
    )
    right.tick_params(axis="x", which="minor", bottom=False, labelbottom=False)
    for axis in (right.yaxis.set_major_formatter, right.yaxis.set_minor_formatter):
        axis(LogFormatter(labelOnlyBase=False, minor_thresholds=(2, 0.5)))
    right.legend()
    return fig


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
    fig, ((left, centre, right),) = _axes(3)
    for flow, shade in zip(flows, _shades(len(flows)), strict=True):
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
    fig, ((left, right),) = _axes(2)
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


@dataclass(frozen=True)
class ConstitutivePath:
    """Stress history of a point driven by a velocity gradient with one step size.

    Attributes
    ----------
    dt : float
        Time step [s].
    times : ndarray, shape (k,)
        Times of the stresses [s].
    stress : ndarray, shape (k, 4)
        Components xx, yy, zz, xy [Pa].
    shear_rate : ndarray, shape (k,)
        Equivalent plastic shear rate [1/s].
    """

    dt: float
    times: Array
    stress: Array
    shear_rate: Array


def figure_13(
    paths: Sequence[ConstitutivePath], reference: theory.ConstitutiveReference
) -> Picture:
    """Stress update along the path of appendix B, and its error against the reference.

    Parameters
    ----------
    paths : sequence of ConstitutivePath
        Paths with different time steps.
    reference : ConstitutiveReference
        Reference solution at times that include those of all paths.

    Raises
    ------
    ValueError
        If a time of a path is not among those of the reference.
    """
    finest = min(paths, key=lambda path: path.dt)
    fig, ((stress, rate), (error, order)) = _axes(2, 2, height=3.2)
    for i, name in enumerate(("xx", "yy", "zz", "xy")):
        # xx and yy are equal until the shear begins: xx is wider, to be seen below yy.
        stress.plot(
            finest.times,
            finest.stress[:, i],
            color=f"C{i}",
            linewidth=4.0 if name == "xx" else 1.5,
            label=rf"$\sigma_{{{name}}}$",
        )
        stress.plot(reference.times, reference.stress[:, i], ":", color="black", linewidth=0.9)
    stress.set(xlabel="time [s]", ylabel="stress [Pa]", title=f"dt = {finest.dt:.3g} s")
    stress.legend(loc="lower right")
    rate.plot(finest.times, finest.shear_rate, color="C4", label="stress update")
    rate.plot(reference.times, reference.shear_rate, ":", color="black", label="Runge-Kutta")
    rate.set(xlabel="time [s]", ylabel="plastic shear rate [1/s]")
    rate.legend()
    scale = np.abs(reference.stress).max()
    largest = []
    for path, shade in zip(paths, _shades(len(paths)), strict=True):
        off = np.abs(path.stress - _at(reference, path.times)).max(axis=1) / scale
        label = f"dt = {path.dt:.3g} s"
        error.semilogy(path.times, np.maximum(off, 1e-16), color=shade, label=label)
        largest.append((path.dt, off.max()))
    error.set(xlabel="time [s]", ylabel="error / largest stress", ylim=(1e-11, None))
    error.legend(ncols=2, loc="lower right")
    steps, errors = np.array(sorted(largest)).T
    order.loglog(steps, errors, "o", color="C3", label="largest error")
    order.loglog(steps, errors[-1] * steps / steps[-1], color="black", label="first order")
    order.set_xticks(steps, labels=[f"{dt:.3g}" for dt in steps], fontsize="small")
    order.tick_params(axis="x", which="minor", bottom=False, labelbottom=False)
    order.set(xlabel="time step [s]", ylabel="error / largest stress")
    order.legend()
    return fig


def _at(reference: theory.ConstitutiveReference, times: Array) -> Array:
    """Stress of the reference at some of its times."""
    slack = 1e-9
    index = np.minimum(np.searchsorted(reference.times, times - slack), len(reference.times) - 1)
    missing = np.abs(reference.times[index] - times) > slack
    if missing.any():
        raise ValueError(f"times = {times[missing][0]} s of a path is not among the reference's")
    return reference.stress[index]

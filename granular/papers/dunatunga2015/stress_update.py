"""Figure 13: the stress update along the path of appendix B, and Runge-Kutta."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from granular import theory
from granular.materials import MuI, glass_beads
from granular.papers.dunatunga2015.document import PAPER
from granular.papers.dunatunga2015.panels import axes_grid, shades
from granular.papers.figure import Drawn
from granular.papers.runs import Runs
from granular.plot.canvas import Picture
from granular.tools.arrays import Array
from granular.verify.constitutive import DURATION, STEPS, constitutive_path

P0 = 500.0
"""Pressure at the start of the path of appendix B [Pa]."""


@PAPER.figure(
    "13",
    "stress and shear rate along the path of appendix B, and the error against Runge-Kutta",
    seconds=1.0,
    paper={"order of the error in the time step": 1.0},
    E=1e4,  # of appendix B
)
def stress_update(runs: Runs) -> Drawn:
    """Update the stress with five time steps, and integrate it with SciPy's RK45."""
    grains = runs.grains(glass_beads)
    paths = [path_of(grains, dt) for dt in (STEPS[:3] if runs.quick else STEPS)]
    finest = min(paths, key=lambda path: path.dt)
    exact = theory.reference(grains, P0, np.linspace(0.0, DURATION, len(finest.times)))
    scale = np.abs(exact.stress).max()
    largest = [float(np.abs(path.stress - _at(exact, path.times)).max() / scale) for path in paths]
    steps = [path.dt for path in paths]
    numbers = {
        "order of the error in the time step": float(
            np.polyfit(np.log(steps), np.log(largest), 1)[0]
        ),
        "largest error at a step of 1 ms, over the largest stress": largest[0],
    }
    return Drawn({"": figure_13(paths, exact)}, numbers)


def path_of(material: MuI, dt: float) -> ConstitutivePath:
    """Path of appendix B with this time step."""
    times, stress = constitutive_path(material, P0, dt)
    p = -stress[:, :3].sum(axis=1) / 3
    deviator = stress[:, :3] + p[:, None]
    tau = np.sqrt((deviator**2).sum(axis=1) / 2 + stress[:, 3] ** 2)
    return ConstitutivePath(dt, times, stress, theory.plastic_shear_rate(p, tau, material))


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
    fig, ((stress, rate), (error, order)) = axes_grid(2, 2, height=3.2)
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
    for path, shade in zip(paths, shades(len(paths)), strict=True):
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

"""Figure 12: what the volume of flowing material consists of (appendix A)."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from granular.materials import glass_beads
from granular.papers.dunatunga2015.document import PAPER
from granular.papers.dunatunga2015.panels import axes_grid
from granular.papers.figure import Drawn
from granular.papers.runs import Runs
from granular.tools.arrays import Array

DENSEST = 0.6
"""Packing fraction at which the kinetic pressure grows beyond all bounds (eq. A 5)."""
RESTITUTION = 0.7
"""Coefficient of restitution; the document names none for this figure."""
DIAMETER, SHEAR_RATE = 5e-3, 10.0
"""Diameter of the grains [m] and shear rate [1/s] of the curve, likewise."""


@PAPER.figure(
    "12",
    "inverse packing fraction against pressure: flowing part and its step, elastic part, sum",
    seconds=1.0,
    E=1e5,
)
def volumes(runs: Runs) -> Drawn:
    """Draw the three parts, for soft grains so that the elastic line has a visible slope.

    The step neglects that shear dilates the material. The number is this dilation at a pressure of
    1 kPa.
    """
    grains = runs.grains(glass_beads)
    pressure = np.geomspace(1.0, 1e4, 400)
    flowing = inverse_packing(pressure, grains.rho_s)
    elastic = -pressure / grains.K
    picture, ((left, middle, right),) = axes_grid(3)
    step = np.array([3.0, 1 / DENSEST, 1 / DENSEST]), np.array([0.0, 0.0, 1e4])
    left.plot(flowing, pressure, color="C0", label=r"$\Phi(I)$, eq. A 9")
    left.plot(*step, color="black", label="step")
    middle.plot([0.0, elastic[-1]], [0.0, pressure[-1]], color="black", label="slope $-K$")
    middle.plot([0.0, 0.3], [0.0, 0.0], color="black")
    right.plot(flowing + elastic, pressure, color="C0", label=r"$\Phi(I)$ and elastic")
    right.plot(
        [3.0, 1 / DENSEST, 1 / DENSEST + elastic[-1]], [0.0, 0.0, 1e4], color="black",
        label="step and elastic",
    )  # fmt: skip
    for ax, name in ((left, "flowing"), (middle, "elastic"), (right, "sum")):
        ax.set(xlabel=r"$\rho_s v/m$", ylabel="pressure [Pa]", title=name, ylim=(-100, 4000))
        ax.legend()
    for ax in (left, right):
        ax.set_xlim(1.4, 2.6)
    dilation = float(inverse_packing(1e3, grains.rho_s)) * DENSEST - 1
    name = f"dilation at 1 kPa and {SHEAR_RATE:g} 1/s that the step neglects"
    return Drawn({"": picture}, {name: dilation})


def inverse_packing(pressure: ArrayLike, rho_s: float) -> Array:
    """Inverse packing fraction of material in steady shear (eq. A 9).

    Parameters
    ----------
    pressure : array_like
        Pressure [Pa].
    rho_s : float
        Density of the grains [kg/m3].
    """
    inertial = SHEAR_RATE * DIAMETER * np.sqrt(rho_s / np.asarray(pressure, dtype=float))
    share = (1 + RESTITUTION) / 2
    half = inertial / 9 + 1 / DENSEST
    return 0.5 * (half + np.sqrt(half**2 + 4 * inertial / 5.4 * (2.52 * share - 1)))

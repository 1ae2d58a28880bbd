"""Steady layer with the mu(I) rheology on a rough incline: the closed form named after Bagnold."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from granular import scenes
from granular.materials import MuI
from granular.simulation import Simulation
from granular.theory import bagnold_shape
from granular.verify.external.frame import Outcome, below, case, load, near

if TYPE_CHECKING:
    from matplotlib.figure import Figure

MU_S, MU_2, I0 = 0.38, 0.64, 0.3
RHO = 1500.0
"""Bulk density [kg/m3], which is also that of I = d (du/dy) sqrt(rho/p), as in the file."""

STIFFNESS = 1e5
"""Young's modulus over rho g h: elastic waves of the start change the speed by less than 0.5 %."""


def speeds(angle_deg: float, d: float, cells: int, until: float) -> tuple[np.ndarray, np.ndarray]:
    """y/h and v/sqrt(g h) of the points of one periodic column, at a time in sqrt(h/g)."""
    material = MuI(E=STIFFNESS * RHO, mu_s=MU_S, mu_2=MU_2, I0=I0, d=d, rho_s=RHO, rho_c=RHO)
    scene = scenes.incline(
        angle_deg=angle_deg, height=1.0, cell=1.0 / cells, gravity=1.0, ramp=1.0,
        duration=until, material=material,
    )  # fmt: skip
    state = Simulation(scene, threads=1).run().state
    return state.x[:, 1], state.v[:, 0]


def picture(outcome: Outcome) -> Figure:
    """Profiles of velocity: points of the run on the lines of the closed form."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(5.0, 3.6), layout="constrained")
    axes = figure.add_subplot()
    y = np.linspace(0, 1, 101)
    for angle, curve in outcome.curves.items():
        (line,) = axes.plot(curve["surface"] * bagnold_shape(y, 1.0), y, label=f"{angle} rad")
        axes.plot(curve["v"], curve["y"], "o", ms=3, mfc="none", color=line.get_color())
    axes.set_xlabel(r"$v / \sqrt{g h}$")
    axes.set_ylabel("$y / h$")
    axes.legend(title="closed form (line), run (points)", fontsize="small")
    return figure


@case(picture)
def bagnold(quick: bool) -> Outcome:
    """Steady mu(I) layer on a periodic rough incline, from rest, against the closed form."""
    data, outcome = load("bagnold_mui_analytic"), Outcome()
    chosen = (0.5,) if quick else (0.43, 0.46, 0.5)
    for angle in chosen:
        k = int(np.flatnonzero(data["angle_rad"] == angle)[0])
        surface, mean, d = (float(data[c][k]) for c in ("u_surface", "u_mean", "d_over_h"))
        # A layer relaxes in some multiples of speed over driving acceleration.
        drive = math.sin(angle) - MU_S * math.cos(angle)
        until = 8.0 * surface / drive
        with outcome.timed():
            y, v = speeds(math.degrees(angle), d, 10 if quick else 20, until)
        miss = v - surface * bagnold_shape(y, 1.0)
        outcome.rows.append(
            near(f"mean speed over sqrt(g h), {angle} rad", float(v.mean()), mean, 0.01)
        )
        error = float(np.sqrt(np.mean(miss**2))) / mean
        outcome.rows.append(
            below(f"rms error of the profile over the mean, {angle} rad", error, 0.01)
        )
        outcome.curves[str(angle)] = {"y": y.tolist(), "v": v.tolist(), "surface": surface}
    return outcome

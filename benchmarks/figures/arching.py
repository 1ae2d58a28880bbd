"""Design charts of hoppers for cohesive material, for docs/how-to/arching.md.

The whole takes a minute.
"""

from __future__ import annotations

import math

import numpy as np
from matplotlib.axes import Axes

import granular as gr
from figures.common import BLUE, GREEN, GREY, ORANGE, panels, tell
from granular.plot import Picture

ORIFICE = 0.12
"""Width of the slot of the runs [m]; critical cohesions are proportional to it."""
MU, DENSITY, G = 0.38, 1500.0, 9.8
ANGLES = (15.0, 30.0, 45.0)
HOPPERS = (("plane hopper, 30 deg", 2, 30.0), ("cone, 15 deg", 3, 15.0))
"""Names, dimensions and half angles of the hoppers of the chart [deg]."""
HALVINGS = 5
"""Bisections between a cohesion that flows and one that arches."""


def moist(stress: float) -> float:
    """Flow function of the guide: unconfined strength for a consolidation stress [Pa]."""
    return 600.0 + 0.2 * stress


def drier(stress: float) -> float:
    """Flow function of the same powder with less moisture [Pa]."""
    return 200.0 + 0.1 * stress


def meeting(ax: Axes) -> None:
    """Where flow functions meet the stress of an arch, for a slot and a circle."""
    stress = np.linspace(0.0, 2000.0, 100)
    for powder, line, name in ((moist, "-", "moist powder"), (drier, "--", "drier powder")):
        ax.plot(stress, [powder(s) for s in stress], line, color="black", label=name)
    for (name, dim, angle), color, shift in zip(
        HOPPERS, (BLUE, ORANGE), ((-6, 5, "right"), (6, -9, "left")), strict=True
    ):
        for powder in (moist, drier):
            known = gr.theory.critical_outlet(
                powder, angle_deg=angle, wall_deg=20.0, effective_deg=40.0, density=DENSITY, dim=dim
            )
            at = known.consolidation, known.strength
            ax.plot(*at, "o", color=color)
            ax.annotate(
                f"{1e3 * known.outlet:.0f} mm", at,
                xytext=shift[:2], textcoords="offset points", color=color, ha=shift[2],
            )  # fmt: skip
        ax.plot(stress, stress / known.flow_factor, color=color, label=name)
    ax.set(xlabel="major stress of flow [Pa]", ylabel="strength, stress of an arch [Pa]")
    ax.set(xlim=(0, 2000), ylim=(0, 1800), title="least outlets of two powders")
    ax.legend(loc="upper left")


def flows(angle: float, cohesion: float, cells: int, tension: float) -> bool:
    """True if a hopper empties as gravity grows, False if the material arches."""
    mat = gr.DruckerPrager(
        E=1e6, mu=MU, cohesion=cohesion, rho_c=DENSITY, tensile_strength=tension * cohesion / MU
    )
    scene = gr.scenes.hopper(
        angle_deg=angle, orifice=ORIFICE, width=0.4, fill_height=0.4, friction=MU,
        cell=ORIFICE / cells, opens_at=0.0, ramp=1.0, material=mat,
    )  # fmt: skip
    sim = gr.Simulation(scene)
    begin = sim.state.mass.sum()
    tell(sim.run(until=1.4, monitor=False), f"{angle:g} deg, {cohesion:.0f} Pa")
    held = sim.state.mass[sim.state.x[:, 1] > 0].sum()
    return bool(held < 0.99 * begin)


def critical(angle: float, cells: int, tension: float = 1.0) -> tuple[float, float]:
    """Largest cohesion that flows and least that arches, over rho g B."""
    scale = DENSITY * G * ORIFICE
    low, high = 0.15 * scale, 1.5 * scale
    for _ in range(HALVINGS):
        middle = math.sqrt(low * high)
        if flows(angle, middle, cells, tension):
            low = middle
        else:
            high = middle
    return low / scale, high / scale


def runs(ax: Axes, quick: bool) -> None:
    """Critical cohesion over rho g B: Jenike's, and that of runs."""
    angles = np.linspace(5.0, 50.0, 10)
    unit = gr.theory.unconfined_strength(1.0, MU).coaxial
    for (name, dim, _), color in zip(HOPPERS, (BLUE, ORANGE), strict=True):
        jenike = [1 / (gr.theory.arch_factor(angle, dim=dim) * unit) for angle in angles]
        ax.plot(angles, jenike, color=color, label=f"Jenike, {name.split(',')[0]}")
    cases = (
        (6 if quick else 12, 1.0, BLUE, "o", 0.0, "runs"),
        (12, 0.1, GREEN, "s", 0.0, "runs with a tenth of the tension"),
        (6, 0.1, GREY, "d", 1.0, "the same in cells twice as large"),
    )
    for cells, tension, color, marker, shift, label in cases[: 1 if quick else None]:
        ends = np.array([critical(angle, cells, tension) for angle in ANGLES])
        middle = np.sqrt(ends.prod(axis=1))
        known = [unit * gr.theory.arch_factor(angle) for angle in ANGLES]
        print(f"{label}, over Jenike's: {np.round(ends * np.array(known)[:, None], 2).tolist()}")
        error = np.abs(ends - middle[:, None]).T
        at = np.array(ANGLES) + shift
        ax.errorbar(at, middle, yerr=error, fmt=marker, color=color, label=label)
    ax.set(xlabel="half angle [deg]", ylabel=r"critical cohesion / ($\rho\, g\, B$)", ylim=(0, 1.9))
    ax.set_title("arches form above, material flows below")
    ax.legend(loc="upper left")


def arching(quick: bool) -> Picture:
    """Draw the picture of the page."""
    made, ((left, right),) = panels(1, 2, 3.2)
    meeting(left)
    runs(right, quick)
    return made

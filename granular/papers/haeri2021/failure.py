"""Figures 14 and 15: the soil that a blade moves between walls, for several laws."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from matplotlib.cm import ScalarMappable
from matplotlib.colors import Normalize

from granular import plot
from granular.materials import HardeningDruckerPrager, grc_1, grc_1_hardening
from granular.papers.figure import Drawn
from granular.papers.haeri2021.blades import (
    FINE,
    THICK,
    THIN,
    BladeForces,
    MovedSoil,
    forces_on_width,
    plastic,
    recorded_blade,
)
from granular.papers.haeri2021.document import figure_of_runs, soft_soil, softened
from granular.papers.runs import Runs
from granular.plot.canvas import Picture


@dataclass(frozen=True)
class Law:
    """Soil that a blade moves, and the forces on it, with one law."""

    soil: MovedSoil
    forces: BladeForces


def laws(runs: Runs, cases: Mapping[str, tuple[str, Mapping[str, Any]]]) -> dict[str, Law]:
    """Run a blade 5 cm deep between walls, for each label with the name and changes of its case."""
    results = {}
    for label, (name, changes) in cases.items():
        with recorded_blade(runs, 0.05, name, **changes) as record:
            results[label] = Law(MovedSoil.measured(record), forces_on_width(record))
    return results


@figure_of_runs(
    "14",
    "speed and lower boundary of the moving soil before a blade, nonlocal and local (A = 0)",
    seconds=290.0,
    paper={
        "zone moved by the local law over that of the nonlocal one, 6 mm": "fails to match",
        "zone moved by the local law over that of the nonlocal one, 25 mm": "fails to match",
    },
)
def failure(runs: Runs) -> Drawn:
    """Run blades of 6 and 25 mm with both laws, in cells of 8.33 mm.

    The document has the failure surface of the experiment with the nonlocal law alone, and does not
    say to which side the local one misses it. Here the local law moves less soil with the thin
    blade and more with the thick one, by more than the scatter of the runs. As the length A d =
    0.14 mm is a sixtieth of a cell, neither is an effect of that length.
    """
    local = soft_soil(runs, grc_1.replace(A=0.0))
    cases = {}
    for thickness, start, sizes in (("6 mm", "thin", THIN), ("25 mm", "narrow", THICK)):
        for law, end, changes in (
            ("nonlocal", "", {}),
            ("local (A = 0)", "_local", {"material": local}),
        ):
            name = f"{start}_5{end}_fine"
            cases[f"{thickness}; {law}"] = (name, sizes | FINE | changes)
    results = laws(runs, cases)
    numbers = {}
    for thickness in ("6 mm", "25 mm"):
        areas = [
            results[f"{thickness}; {law}"].soil.area() for law in ("nonlocal", "local (A = 0)")
        ]
        name = "zone moved by the local law over that of the nonlocal one"
        numbers[f"{name}, {thickness}"] = areas[1] / areas[0]
        numbers[f"zone moved by the nonlocal law, {thickness} [cm2]"] = 1e4 * areas[0]
    return Drawn({"": moved_soil(results)}, numbers)


@figure_of_runs(
    "15",
    "the same with Drucker-Prager, of constant friction and with hardening; forces, friction angle",
    seconds=250.0,
    paper={
        "largest friction angle of the hardening law [deg]": 44.0,
        "friction angle of the hardening law at the start [deg]": 35.0,
        "heap before the blade, hardening [mm]": "no pile",
        "farthest moving soil before the blade, hardening [mm]": "untouched areas flow",
    },
)
def plasticity(runs: Runs) -> Drawn:
    """Run the blade of 25 mm with the nonlocal law, Drucker-Prager, and hardening Drucker-Prager.

    With the printed numbers the friction angle of the hardening law begins at 35 degrees and ends
    at 44, but is larger between them, with a peak at a plastic strain of 6.
    """
    hardening = softened(runs, grc_1_hardening)
    cases: dict[str, tuple[str, dict[str, Any]]] = {
        "nonlocal": ("narrow_5_fine", {}),
        "Drucker-Prager, mu_s": (
            "narrow_5_drucker_prager_fine", {"material": plastic(soft_soil(runs))}
        ),
        "hardening": ("narrow_5_hardening_fine", {"material": hardening}),
    }  # fmt: skip
    results = laws(
        runs, {label: (name, THICK | FINE | parts) for label, (name, parts) in cases.items()}
    )
    strains, angles = friction_angles(hardening)
    numbers = {
        "largest friction angle of the hardening law [deg]": float(angles.max()),
        "its plastic strain": float(strains[np.argmax(angles)]),
        "friction angle of the hardening law at the start [deg]": float(angles[0]),
    }
    for label, law in results.items():
        numbers |= {
            f"forward force, {label} [N]": law.forces.means()["forward"],
            f"heap before the blade, {label} [mm]": 1e3 * law.soil.heap(),
            f"farthest moving soil before the blade, {label} [mm]": 1e3 * law.soil.reach(),
        }
    pictures = {"": moved_soil(results), "forces": figure_15(results, hardening)}
    return Drawn(pictures, numbers)


def friction_angles(material: HardeningDruckerPrager) -> tuple[np.ndarray, np.ndarray]:
    """Friction angle [deg] against the plastic strain."""
    strains = np.linspace(0.0, 30.0, 601)
    return strains, np.array([material.friction_angle_deg(q) for q in strains])


def moved_soil(results: Mapping[str, Law]) -> Picture:
    """Mean speed before the blade at the end, and the boundary of the moving zone, by law."""
    rows = (len(results) + 1) // 2
    picture = Picture(figsize=(7.0, 1.5 * rows), layout="compressed")
    axes = picture.subplots(rows, 2, squeeze=False, sharex=True, sharey=True).ravel()
    for ax in axes[len(results) :]:
        ax.set_axis_off()
    speed = 0.0
    for ax, (label, law) in zip(axes, results.items(), strict=False):
        state, surface = law.soil.state, law.soil.surface
        grid, speed = state.scene.grid, state.scene.parameters["speed"]
        plot.frame(
            state, law.soil.speed, ax=ax, slab=(0.0, grid.upper[1]), limits=(0.0, speed), bar=False,
            extent=((grid.lower[0], grid.upper[0]), (grid.lower[2], 0.1)), title=label,
        )  # fmt: skip
        before = surface.x > law.soil.blade[0]
        ax.plot(surface.x[before], surface.z[before], color="white", lw=2.2)
        ax.plot(surface.x[before], surface.z[before], color="black")
        ax.label_outer()
    scale = ScalarMappable(Normalize(0.0, speed), "viridis")
    picture.colorbar(scale, ax=axes.tolist(), label="speed [m/s]", aspect=40)
    return picture


def figure_15(results: Mapping[str, Law], hardening: HardeningDruckerPrager) -> Picture:
    """Forward force over time for each law, and the friction angle of the hardening one."""
    picture = Picture(figsize=(7.0, 2.8), layout="compressed")
    left, right = picture.subplots(1, 2)
    for label, law in results.items():
        left.plot(law.forces.times, law.forces.forward, label=label)
    left.set(xlabel="t [s]", ylabel="forward force [N]")
    left.legend()
    right.plot(*friction_angles(hardening), color="C2", label="hardening")
    for angle in (hardening.friction_angle_deg(0.0), hardening.h0_deg):
        right.axhline(angle, color="0.5", linestyle=":")
    right.set(xlabel="norm of the plastic strain", ylabel="friction angle [deg]")
    return picture

"""Upright walls that are pushed into loose and dense sand, and the bands in which it shears."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Any, NamedTuple

import numpy as np
from shared import table

import granular as gr
from accuracy.body_forces import forces
from granular.verify.external import limit_analysis as bed

SPEED = 0.005
"""Speed of the wall [m/s]. At four times this the inertia of the sand adds a tenth to the peak."""
DENSE, LOOSE = 0.62, 0.56
PEAK = 0.54
"""Friction of the dense sands at the peak, mu_s + psi."""
PSI = (0.0, 0.14, 0.30, 0.42)
"""Dilations psi of the dense sands at the peak."""


def sand(mu: float, psi: float) -> gr.DilatantMuI:
    """Sand of the friction mu in slow flow, that of the packing `DENSE` dilating by psi."""
    steep = psi / (DENSE - gr.DilatantMuI.phi_c)
    return gr.DilatantMuI(E=3e6, mu_s=mu, mu_2=mu + 0.26, d=3e-4, dilatancy=steep)


def ridge(state: gr.State, turned_deg: float) -> tuple[float, float, float]:
    """Inclination of the band to the surface [deg]: as a whole, of its lower and its upper half.

    The line is fitted to where the band is at heights from 0.1 to 0.9 of that of the bed: to the
    mean place of the points that have sheared more than half as much as any at this height.
    """
    frame = bed.Frame(turned_deg)
    along = state.x @ frame.turned(1.0, 0.0) / bed.SIZE
    height = state.x @ frame.turned(0.0, 1.0) / bed.SIZE
    heights = np.linspace(0.1, 0.9, 17)
    middle = []
    for at in heights:
        near = np.abs(height - at) < 0.03
        strain = state.shear_strain[near]
        most = strain > strain.max() / 2
        middle.append(np.average(along[near][most], weights=strain[most]))
    halves = slice(None), slice(None, 9), slice(8, None)
    slopes = [np.polyfit(heights[half], np.array(middle)[half], 1)[0] for half in halves]
    whole, lower, upper = (math.degrees(math.atan2(1.0, slope)) for slope in slopes)
    return whole, lower, upper


PATHS = (0.0, 0.001, 0.002, 0.003, 0.004, 0.005, 0.006, 0.008, 0.01, 0.015, 0.02, 0.03, 0.04, 0.05)
"""Paths of the wall in heights of the bed, between which forces are averaged."""
SEEN = 0.02
"""Path at which the band is measured."""


class Case(NamedTuple):
    """Friction in slow flow, dilation at the packing `DENSE`, and what is done with the sand."""

    mu: float
    psi: float
    packing: float = DENSE
    passive: bool = True
    cells: int = 32
    turned_deg: float = 0.0


def scene_of(case: Case, material: gr.DilatantMuI) -> gr.Scene:
    """Smooth wall and a base with the friction of the sand at its peak."""
    friction = max(material.peak_friction(case.packing), material.mu_s)
    scene = bed.wall_scene(
        math.degrees(math.asin(friction)), passive=case.passive, rough=True,
        angle_deg=case.turned_deg, cells=case.cells, speed=SPEED,
    )  # fmt: skip
    fills = tuple(fill.replace(packing=case.packing) for fill in scene.fills)
    scheme = scene.scheme.replace(shear_strain=1)
    return scene.replace(material=material, fills=fills, scheme=scheme)


def push(case: Case, material: gr.DilatantMuI, paths: tuple[float, ...]) -> dict[str, float]:
    """Coefficients of the force over the path of the wall, and the inclination of the band."""
    sim = gr.Simulation(scene_of(case, material), threads=1)
    unit = case.packing * material.rho_s * bed.G * bed.SIZE**2 / 2
    values, band = [], (math.nan,) * 3
    for path, force in forces(sim, np.array(paths) * bed.SIZE):
        values.append((path / bed.SIZE, float(np.hypot(*force)) / unit))
        if path < SEEN * bed.SIZE:
            band = ridge(sim.state, case.turned_deg)
    of = max if case.passive else min
    at, extreme = of(values[1:], key=lambda one: one[1])
    return {
        "peak": extreme, "at": at, "last": values[-1][1],
        "band": band[0], "toe": band[1], "top": band[2],
    }  # fmt: skip


OF_PSI = {psi: Case(round(PEAK - psi, 2), psi) for psi in PSI}
SOFTER = (gr.DilatantMuI.phi_c, LOOSE)
CASES = [
    *OF_PSI.values(),
    *(case._replace(cells=16) for case in OF_PSI.values()),
    *(OF_PSI[psi]._replace(turned_deg=turn) for turn in (17.0, 30.0) for psi in (0.14, 0.42)),
    *(OF_PSI[0.14]._replace(packing=packing) for packing in SOFTER),
    *(OF_PSI[0.14]._replace(packing=packing, passive=False) for packing in (DENSE, *SOFTER)),
    OF_PSI[0.14]._replace(cells=64),
]
"""Dense sands of one peak friction by cells and turns of the bed, and looser ones."""


def walls(quick: bool) -> Iterator[dict[str, Any]]:
    """Coefficient of the force at the peak and later, and the inclination of the band."""
    for case in [OF_PSI[0.14]._replace(cells=16)] if quick else CASES:
        material = sand(case.mu, case.psi)
        friction = float(material.peak_friction(case.packing))
        here = gr.theory.earth_pressure(friction, dilation=friction - case.mu)
        slow = gr.theory.earth_pressure(case.mu)
        kind, sign = ("passive", 1) if case.passive else ("active", -1)
        yield {
            **case._asdict(),
            "psi": friction - case.mu,
            "friction_deg": here.coaxial_deg,
            "dilation_deg": here.dilation_deg,
            "rankine": getattr(here, f"{kind}_coaxial"),
            "davis": getattr(here, f"{kind}_band"),
            "critical": getattr(slow, f"{kind}_coaxial"),
            "coulomb_deg": 45 - sign * here.coaxial_deg / 2,
            "roscoe_deg": 45 - sign * here.dilation_deg / 2,
            "arthur_deg": 45 - sign * (here.coaxial_deg + here.dilation_deg) / 4,
        } | push(case, material, PATHS[:3] if quick else PATHS)


def tables(studies: dict[str, Any]) -> dict[str, list[str]]:
    """Tables of the page."""
    rows = [
        row | {"wall": "pushed" if row["passive"] else "drawn away", "way": 100 * row["at"]}
        for row in studies.get("walls", [])
    ]
    sand = {"mu_s": "{mu:g}", "packing": "{packing:g}", "psi": "{psi:.2f}"}
    mesh = {"cells": "{cells}", "turned": "{turned_deg:g}°"}
    forces_of = {
        "wall": "{wall}",
        **sand,
        **mesh,
        "K at the peak": "{peak:.2f}",
        "at a path of": "{way:.1f} %",
        "Rankine": "{rankine:.2f}",
        "Davis": "{davis:.2f}",
        "K at 4.5 %": "{last:.2f}",
        "Rankine, critical": "{critical:.2f}",
    }
    bands = {
        "mu_s": "{mu:g}",
        "psi": "{psi:.2f}",
        "nu": "{dilation_deg:.1f}°",
        **mesh,
        "band": "{band:.1f}°",
        "lower half": "{toe:.1f}°",
        "upper half": "{top:.1f}°",
        "Coulomb": "{coulomb_deg:.1f}°",
        "Arthur": "{arthur_deg:.1f}°",
        "Roscoe": "{roscoe_deg:.1f}°",
    }
    dense = [row for row in rows if row["passive"] and row["packing"] == DENSE]
    return {"walls": table(rows, forces_of), "bands": table(dense, bands)}

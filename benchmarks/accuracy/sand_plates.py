"""Plates in loose and in dense sand, against resistive force theory."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from typing import Any, NamedTuple

import numpy as np
from shared import table

import granular as gr
from accuracy.body_forces import forces, ramp_to
from accuracy.resistive_force import MEASURED, response, scale

G, SIZE, SPEED = 9.81, 0.04, 0.2
"""Gravity [m/s2], diameter or width of a plate [m], its speed [m/s]."""
THICK = 3
"""Thickness of a plate in cells."""
MU = 0.4
"""Friction coefficient of the sand in the critical state, and of the plates."""


def sand(mu: float, packing: float | None, E: float) -> gr.materials.Material:
    """Sand whose friction in slow flow is mu, of a law with a packing or without."""
    numbers: dict[str, Any] = {"E": E, "mu_s": mu, "mu_2": mu + 0.26, "I0": 0.279, "d": 3e-4}
    dilatant = gr.DilatantMuI(**numbers)
    if packing is not None:
        return dilatant
    return gr.MuI(**numbers, rho_s=dilatant.rho_s, rho_c=dilatant.rho_c)


def density(material: gr.materials.Material, packing: float | None) -> float:
    """Density of the bed [kg/m3]."""
    return material.rho_c if packing is None else packing * material.rho_s


def in_sand(
    size: tuple[float, ...], cells: int, headroom: int, material: gr.materials.Material,
    packing: float | None, bodies: tuple[gr.Body, ...], axisymmetric: bool = False,
) -> gr.Scene:  # fmt: skip
    """A bed at rest between smooth walls, of a size in widths of a plate."""
    cell, dim = SIZE / cells, len(size)
    zero = (0.0,) * dim
    shape = tuple(round(side * cells) for side in size)
    upper = tuple(n * cell for n in shape)
    sides = [(a, at) for a in range(dim - 1) for at in (0.0, upper[a])]
    return gr.Scene(
        name="plate",
        grid=gr.Grid(
            zero, cell, (*shape[:-1], shape[-1] + headroom), axisymmetric=axisymmetric
        ),
        fills=(
            gr.Fill(gr.Box(zero, upper), 2**dim, packing=packing, jitter=0.5, lithostatic=True),
        ),
        material=material,
        walls=(
            gr.Wall(dim - 1, 0.0),
            *(gr.Wall(a, at, kind="free_slip") for a, at in sides[axisymmetric:]),
        ),
        bodies=bodies,
        gravity=(*(0.0,) * (dim - 1), -G),
        duration=10.0,
    )  # fmt: skip


PACKINGS = {"mu(I)": None, "0.585": 0.585, "0.60": 0.60, "0.62": 0.62}
"""Packings by the names of the materials."""


class Disc(NamedTuple):
    """Friction of the sand, its packing by name, and what a disc is like.

    The surface is a coefficient of friction, by default that of the sand, or a kind of contact.
    """

    mu: float = MU
    name: str = "mu(I)"
    cells: int = 8
    surface: float | str | None = None
    E: float = 1e7


DEEP = 2.5
"""Depth to which a disc is pushed, in its diameters."""


def disc_scene(disc: Disc) -> gr.Scene:
    """A disc that is pushed down from the surface, with a smooth shaft as wide as the disc."""
    packing, surface = PACKINGS[disc.name], disc.mu if disc.surface is None else disc.surface
    material, level, long = sand(disc.mu, packing, disc.E), (DEEP + 3) * SIZE, (DEEP + 1) * SIZE
    thick = THICK * SIZE / disc.cells
    contact: dict[str, Any]
    contact = {"contact": surface} if isinstance(surface, str) else {"friction": surface}
    parts = (
        (gr.Box(size=(SIZE, thick), center=(0.0, thick / 2)), contact),
        (gr.Box(size=(SIZE, long), center=(0.0, thick + long / 2)), {"friction": 0.0}),
    )
    bodies = tuple(
        gr.Body(shape, (0.0, level), motion=ramp_to((0.0, -SPEED)), **how) for shape, how in parts
    )
    return in_sand((5, DEEP + 3), disc.cells, disc.cells // 2, material, packing, bodies, True)


DISCS = [
    *(Disc(name=name) for name in PACKINGS),
    *(Disc(0.6, name) for name in PACKINGS),
    Disc(E=2e6),
    Disc(surface=1.0),
    *(Disc(surface="sticky", cells=cells) for cells in (4, 8, 16)),
    *(Disc(name=name, cells=16) for name in ("mu(I)", "0.60", "0.62")),
]


def discs(quick: bool) -> Iterator[dict[str, Any]]:
    """Force on a disc over its area, its depth and rho g, at depths of 1 and 2 diameters."""
    area = math.pi * SIZE**2 / 4
    for disc in [Disc(name="0.60", cells=4, E=1e6)] if quick else DISCS:
        scene = disc_scene(disc)
        weight = density(scene.material, PACKINGS[disc.name]) * G
        paths = SIZE * np.array((0.75, 1.25, 1.75, 2.25)[: 2 if quick else 4])
        pushed = list(forces(gr.Simulation(scene, threads=1), paths))[::2]
        factors = [float(force[-1]) / (weight * area * depth) for depth, force in pushed]
        fit = scale(disc.mu) * response(0.0, 90.0, disc.mu)[1]
        shares = [factor / fit for factor in factors]
        yield {**disc._asdict(), "fit": fit, "factors": factors, "shares": shares}


MOTIONS = {
    "level, down": (0.0, 90.0),
    "upright, along": (90.0, 0.0),
    "tilted by 45°, down": (45.0, 90.0),
}
"""Tilt of a plate and direction of its motion below the level [deg]."""
BELOW = 1.5
"""Depth of the middle of a plate at the start, in its widths."""


def plate(
    packing: float | None, cells: int, tilt_deg: float, attack_deg: float, friction: float
) -> gr.Scene:
    """Half of a square plate in a bed in 3D that moves from rest, at a plane of symmetry."""
    material, attack = sand(MU, packing, 2e6), math.radians(attack_deg)
    size = (6.0, 2.5, 4.0 + math.sin(attack))
    velocity = (SPEED * math.cos(attack), 0.0, -SPEED * math.sin(attack))
    body = gr.Body(
        gr.Box(size=(SIZE, SIZE, THICK * SIZE / cells)),
        ((2.0 + math.sin(attack)) * SIZE, 0.0, (size[2] - BELOW) * SIZE),
        rotation_deg=(0.0, -tilt_deg, 0.0),
        motion=ramp_to(velocity),
        friction=friction,
    )
    return in_sand(size, cells, 6, material, packing, (body,))


PLATES = [("mu(I)", 6), ("0.60", 6), ("0.62", 6), ("mu(I)", 8)]
"""Packing, and cells in a width."""


def plates(
    quick: bool, cases: Sequence[tuple[str, int]] = PLATES, friction: float = MU
) -> Iterator[dict[str, Any]]:
    """Force on a square plate in the direction of its motion over that of the fit.

    `largest` is that of intervals of a tenth of its width, `later` the mean over the path from a
    half to one width.
    """
    cases = [("0.60", 4)] if quick else cases
    for motion, (tilt, attack) in list(MOTIONS.items())[: 1 if quick else None]:
        for name, cells in cases:
            scene = plate(PACKINGS[name], cells, tilt, attack, friction)
            weight = density(scene.material, PACKINGS[name]) * G
            against = np.array((-math.cos(math.radians(attack)), math.sin(math.radians(attack))))
            paths = SIZE * np.linspace(0.0, 0.1 if quick else 1.0, 2 if quick else 11)
            factors = []
            for path, force in forces(gr.Simulation(scene, threads=1), paths):
                depth = BELOW * SIZE + path * math.sin(math.radians(attack))
                load = 2 * float(force[[0, 2]] @ against)  # of the whole plate
                factors.append(load / (weight * SIZE**2 * depth))
            fit = scale(MU) * float(np.array(response(tilt, attack, friction)) @ against)
            later = float(np.mean(factors[len(factors) // 2 :]))
            yield {
                "motion": motion, "material": name, "friction": friction, "cells": cells,
                "fit": fit, "later": later, "share": later / fit, "largest": max(factors),
            }  # fmt: skip


def smooth_plates(quick: bool) -> Iterator[dict[str, Any]]:
    """The same without friction of the plate, which is thick and drags at its sides."""
    return plates(quick, PLATES[:1], friction=0.0)


def close_over_loose(studies: dict[str, Any]) -> Iterator[dict[str, Any]]:
    """Stress on a plate in dense sand over that in critical sand, and as measured."""
    stress: dict[str, dict[str, float]] = {"down": {}, "along": {}}
    for row in studies.get("discs", []):
        if (row["mu"], row["cells"], row["surface"], row["E"]) == (MU, 8, None, 1e7):
            stress["down"][row["name"]] = float(np.mean(row["factors"]))
    for row in studies.get("plates", []):
        if (row["motion"], row["cells"]) == ("upright, along", 6):
            stress["along"][row["material"]] = row["later"]
    for motion, factors in stress.items():
        if {"mu(I)", "0.62"} <= factors.keys():
            critical = factors["mu(I)"] * gr.DilatantMuI.phi_c
            loose, close = MEASURED[motion]
            ratios = {"ratio": factors["0.62"] * 0.62 / critical, "known": close / loose}
            yield {"motion": motion} | ratios


def tables(studies: dict[str, Any]) -> dict[str, list[str]]:
    """Tables of the page."""
    depths = ("one", "two")
    rows = []
    for row in studies.get("discs", []):
        surface = row["surface"] if row["surface"] is not None else row["mu"]
        known = {"like": surface if isinstance(surface, str) else f"friction {surface:g}"}
        for depth, factor, share in zip(depths, row["factors"], row["shares"], strict=True):
            known |= {f"at {depth}": factor, f"share {depth}": share}
        rows.append(row | known | {"MPa": row["E"] / 1e6})
    columns = {
        "friction of the sand": "{mu:g}",
        "packing": "{name}",
        "disc": "{like}",
        "E": "{MPa:g} MPa",
        "cells in a diameter": "{cells}",
        "fit": "{fit:.1f}",
    }
    for depth, spread in zip(depths, ("one diameter", "two"), strict=True):
        columns |= {
            f"at {spread}": f"{{at {depth}:.1f}}",
            f"{spread}, over the fit": f"{{share {depth}:.2f}}",
        }
    moved = {
        "plate": "{motion}",
        "packing": "{material}",
        "its friction": "{friction:g}",
        "cells in a width": "{cells}",
        "force": "{later:.1f}",
        "largest": "{largest:.1f}",
        "fit": "{fit:.1f}",
        "force over the fit": "{share:.2f}",
    }
    compared = {
        "motion": "{motion}",
        "0.62 over critical": "{ratio:.2f}",
        "measured": "{known:.2f}",
    }
    return {
        "discs": table(rows, columns),
        "plates": table([*studies.get("plates", []), *studies.get("smooth_plates", [])], moved),
        "packings": table(close_over_loose(studies), compared),
    }

"""Forces on plates, discs and spheres in a bed at rest."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import numpy as np

import granular as gr
from bodies.rows import (
    OFFSETS,
    PLACES,
    RHO,
    TURNS,
    Cases,
    G,
    Line,
    Numbers,
    Row,
    Run,
    axes,
    name_of,
    spread,
)
from granular.tools.arrays import Array


@dataclass(frozen=True)
class Bed:
    """A bed that is nearly a fluid: its internal friction is mu to 2 mu.

    A column of it above or below a body bears mu p at its sides, more or less, so that statics
    alone gives the force on the body within `left_open`.
    """

    mu: float = 0.001
    scheme: gr.Scheme = gr.schemes.default

    @property
    def material(self) -> Any:
        """Its material."""
        return gr.materials.glass_beads.replace(E=1e6, rho_c=RHO, mu_s=self.mu, mu_2=2 * self.mu)

    def left_open(self, *columns: tuple[float, float]) -> float:
        """Force that columns, between two depths each, may bear at their sides, over rho g [m2]."""
        return sum(self.mu * (below**2 - above**2) for above, below in columns)


PARTICLE = gr.Scheme(density=gr.ParticleDensity())
BEDS = {
    "": Bed(),
    "mu 0.01, ": Bed(0.01),
    "`ParticleDensity`, ": Bed(0.001, PARTICLE),
    "`ParticleDensity`, mu 0.01, ": Bed(0.01, PARTICLE),
}
"""Beds by the begin of the names of their cases."""
ROUGHER = "mu 0.1, "

K = Bed().material.K


def hydrostatic(depth: float | Array) -> Any:
    """Pressure at a depth in a fluid with the elasticity of the beds [Pa]."""
    return -K * np.log1p(-RHO * G * np.asarray(depth) / K)


def displaced(volume: float, depth: float) -> float:
    """Weight of a volume of that fluid at a depth [N]."""
    return volume * G * RHO * math.exp(float(hydrostatic(depth)) / K)


def spans(until: float) -> tuple[tuple[str, float, float], ...]:
    """Two parts of a run, the first quarter of its time and the rest: name, begin and end [s]."""
    return ("early", 0.0, until / 4), ("late", until / 4, until)


WHEN = {"early": "0 to 0.1 s", "late": "0.1 to 0.4 s"}


def in_a_bed(
    bodies: tuple[gr.Body, ...], size: tuple[float, ...], cell: float, bed: Bed
) -> gr.Scene:
    """A bed at rest in a box between smooth walls, with bodies in it."""
    dim, level = len(size), size[-1]
    shape = tuple(round(side / cell) for side in size[:-1])
    walls = [gr.Wall(a, at, kind="free_slip") for a in range(dim - 1) for at in (0.0, size[a])]
    return gr.Scene(
        name="in_a_bed",
        grid=gr.Grid((0.0,) * dim, cell, (*shape, round(level / cell) + 4)),
        fills=(gr.Fill(gr.Box((0.0,) * dim, size), 2**dim, lithostatic=True, K0=1.0),),
        material=bed.material,
        scheme=bed.scheme,
        gravity=gr.Gravity((0.0,), ((0.0,) * (dim - 1) + (-G,),)),
        walls=(*walls, gr.Wall(dim - 1, 0.0, kind="free_slip")),
        bodies=bodies,
        duration=1.0,
    )


LENGTH, HEIGHT = 0.16, 0.32
"""Length of a plate, and height and width of the bed about it [m]."""


def plate(turned_deg: float, offset: float, cells: int, until: float, bed: Bed) -> Numbers:
    """Forces on the two faces of a plate 4 cells thick, over the forces of a fluid.

    It is two bodies that overlap, so that the force on each face is known.
    """
    cell = LENGTH / cells
    center = np.full(2, HEIGHT / 2) + offset * cell
    shapes = [gr.Box(size=(LENGTH, 3 * cell), center=(0.0, side * cell / 2)) for side in (1, -1)]
    bodies = tuple(gr.Body(shape, tuple(center), rotation_deg=turned_deg) for shape in shapes)
    run = Run(in_a_bed(bodies, (HEIGHT, HEIGHT), cell, bed))
    _, n = axes(turned_deg)
    numbers: Numbers = {}
    for name, since, to in spans(until):
        run.to(to, until / 40)
        for face, force, side in zip(("upper", "lower"), run.force(since), (1, -1), strict=True):
            depth = HEIGHT - float((center + side * 2 * cell * n)[1])
            wanted = -side * float(hydrostatic(depth)) * LENGTH
            numbers[f"{face}_{name}"] = float(force @ n) / wanted
    return {**numbers, "deepest": run.deepest}


def rounded_plate(turned_deg: float, offset: float, cells: int, until: float, bed: Bed) -> Numbers:
    """Upward force on such a plate with edges rounded by 1.95 cells, over the weight displaced."""
    cell = LENGTH / cells
    radius, center = 1.95 * cell, np.full(2, HEIGHT / 2) + offset * cell
    sides = (LENGTH - 2 * radius, 4 * cell - 2 * radius)
    body = gr.Body(gr.Offset(gr.Box(size=sides), by=radius), tuple(center), rotation_deg=turned_deg)
    run = Run(in_a_bed((body,), (HEIGHT, HEIGHT), cell, bed))
    area = LENGTH * 4 * cell - (4 - math.pi) * radius**2
    weight = displaced(area, HEIGHT - center[1])
    numbers: Numbers = {}
    for name, since, to in spans(until):
        run.to(to, until / 40)
        up = run.force(since)[0] / weight
        numbers |= {name: float(up[1]), f"sideways_{name}": float(up[0])}
    return {**numbers, "deepest": run.deepest}


def plate_cases(quick: bool) -> Cases:
    if quick:
        return {"8 cells": partial(plate, 17.0, 0.25, 8, 0.04, Bed())}
    cases: Cases = {}
    for kind, bed in BEDS.items():
        for cells in (8, 16, 32):
            for at in PLACES if cells < 32 else [(turned, 0.25) for turned in TURNS]:
                name = f"{kind}{cells} cells, {name_of(*at)}"
                cases[name] = partial(plate, *at, cells, 0.4, bed)
        for at in PLACES:
            cases[f"{kind}rounded, {name_of(*at)}"] = partial(rounded_plate, *at, 16, 0.4, bed)
    for at in PLACES:
        cases[f"{ROUGHER}16 cells, {name_of(*at)}"] = partial(plate, *at, 16, 0.4, Bed(0.1))
    return cases


def of_fluid(line: Line) -> Line:
    """The line, without a criterion where friction makes the force uncertain by more than that."""
    rough = any(mark in line.quantity for mark in ("mu 0.01, ", ROUGHER))
    return replace(line, criterion="", met=None) if rough else line


def plate_lines(results: dict[str, Numbers]) -> list[Line]:
    lines = []
    sharp = [(kind, cells) for kind in BEDS for cells in (8, 16, 32)] + [(ROUGHER, 16)]
    for kind, cells in sharp:
        some = [v for name, v in results.items() if name.startswith(f"{kind}{cells} cells")]
        for when, span in WHEN.items():
            if some:
                values = [v[f"{face}_{when}"] for v in some for face in ("upper", "lower")]
                text = f"{kind}force on a face, sharp edges, {cells} cells, {span}"
                lines.append(of_fluid(spread(text, values, 1.0, 0.02)))
    for kind in BEDS:
        some = [v for name, v in results.items() if name.startswith(f"{kind}rounded")]
        for when, span in WHEN.items():
            if some:
                text = f"{kind}buoyancy, edges rounded by 2 cells, 16 cells, {span}"
                lines.append(of_fluid(spread(text, [v[when] for v in some], 1.0, 0.05)))
    thick = LENGTH / 4
    above, below = (0.0, HEIGHT / 2 - thick / 2), (HEIGHT / 2 + thick / 2, HEIGHT)
    for bed in (Bed(), BEDS["mu 0.01, "]):
        shares = (
            bed.left_open(above) / (above[1] * LENGTH),
            bed.left_open(below) / (below[0] * LENGTH),
            bed.left_open(above, below) / (LENGTH * thick),
        )
        text = f"left open by statics with mu {bed.mu:g}: upper face, lower face, buoyancy"
        lines.append(Line(text, "", _percentages(shares), None))
    return lines


def _percentages(shares: tuple[float, ...]) -> str:
    return ", ".join(f"{100 * share:.2g} %" for share in shares)


RADIUS = 0.04
"""Radius of discs and spheres [m]."""
SIZES = {2: (0.32, 0.24), 3: (0.16, 0.16, 0.16)}
"""Sizes of the beds about them [m]."""


def buoyancy(dim: int, cells: int, offset: float, until: float, bed: Bed) -> Numbers:
    """Upward force on a disc or a sphere over the weight of the fluid it displaces."""
    cell, size = RADIUS / cells, SIZES[dim]
    center = np.array(size) / 2 + cell * offset * np.array((1.0, 0.6, 0.4)[:dim])
    shape = (
        gr.Cylinder(RADIUS, center=(0.0,) * 2) if dim == 2 else gr.Sphere(RADIUS, center=(0.0,) * 3)
    )
    run = Run(in_a_bed((gr.Body(shape, tuple(center)),), size, cell, bed))
    volume = math.pi * RADIUS**2 if dim == 2 else 4 / 3 * math.pi * RADIUS**3
    weight = displaced(volume, size[-1] - center[-1])
    numbers: Numbers = {}
    for name, since, to in spans(until):
        run.to(to, until / 40)
        numbers[name] = float(run.force(since)[0][-1] / weight)
    return {**numbers, "deepest": run.deepest}


def buoyancy_cases(quick: bool) -> Cases:
    if quick:
        return {"disc, 4 cells": partial(buoyancy, 2, 4, 0.25, 0.04, Bed())}
    cases: Cases = {}
    for kind, bed in BEDS.items():
        for cells in (4, 8):
            for offset in OFFSETS:
                name = f"{kind}disc, {cells} cells, {offset:g}"
                cases[name] = partial(buoyancy, 2, cells, offset, 0.4, bed)
    for offset in OFFSETS:
        cases[f"sphere, 4 cells, {offset:g}"] = partial(buoyancy, 3, 4, offset, 0.4, Bed())
    cases["sphere, 6 cells, 0.25"] = partial(buoyancy, 3, 6, 0.25, 0.4, Bed())
    bed = BEDS["mu 0.01, "]
    cases["mu 0.01, sphere, 4 cells, 0.25"] = partial(buoyancy, 3, 4, 0.25, 0.4, bed)
    return cases


def buoyancy_lines(results: dict[str, Numbers]) -> list[Line]:
    lines = []
    discs = [f"{kind}disc, {cells}" for kind in BEDS for cells in (4, 8)]
    for kind in (*discs, "sphere, 4", "sphere, 6", "mu 0.01, sphere, 4"):
        some = [v for name, v in results.items() if name.startswith(f"{kind} cells")]
        for when, span in WHEN.items():
            if some:
                values = [v[when] for v in some]
                text = f"{kind} cells in radius, {span}"
                lines.append(of_fluid(spread(text, values, 1.0, 0.05)))
    height = SIZES[2][1]
    columns = (0.0, height / 2 - RADIUS), (height / 2 + RADIUS, height)
    beds = Bed(), BEDS["mu 0.01, "]
    shares = tuple(bed.left_open(*columns) / (math.pi * RADIUS**2) for bed in beds)
    text = "left open by statics, disc: mu 0.001, mu 0.01"
    lines.append(Line(text, "", _percentages(shares), None))
    return lines


ROWS = {
    "plate": Row("Plate in a bed at rest, internal friction mu 0.001", plate_cases, plate_lines),
    "buoyancy": Row(
        "Buoyancy of a disc and a sphere, internal friction mu 0.001",
        buoyancy_cases,
        buoyancy_lines,
    ),
}

"""Layers that flow down a base through the grid, and the flow between two cylinders."""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import partial
from typing import Any
from unittest import mock

import numpy as np

import granular as gr
from bodies.rows import (
    CELL,
    OFFSETS,
    RHO,
    Cases,
    G,
    Line,
    Numbers,
    Row,
    Run,
    name_of,
    plane,
    spread,
    within,
)
from granular.theory import bagnold_profile, chute_profile, couette_flow, stopping_height
from granular.tools.arrays import Array

PERIODS = {0.0: (40, 24), 10.0: (102, 18), 17.0: (66, 20), 30.0: (38, 22), 45.0: (26, 26)}
"""Cells of a domain whose diagonal has about this angle, in which a layer fits."""

BASES: dict[str, dict[str, Any]] = {
    "no_slip": {"contact": "sticky"},
    "holds": {"friction": 0.6},
    "slides": {"friction": 0.4},
}
"""Contact of each kind of base; the tangent of the slope is 0.466."""

ROUGH = {"contact": "sticky", "rough": True}


def chute_scene(
    turned_deg: float,
    offset: float,
    height: int,
    material: Any,
    base: dict[str, Any],
    speed: Callable[[Array], Array] | None = None,
    slope_deg: float = 25.0,
    wall: str | None = None,
    scheme: gr.Scheme = gr.schemes.default,
) -> tuple[gr.Scene, Array, Array]:
    """An endless layer in 2D down a slope, in a domain that is periodic along its diagonal.

    `wall` puts a wall of the grid of that kind instead of the body, for a base along the grid.
    Returned: the scene, the direction of flow, and the height of each point above the base, in
    cells.
    """
    periods = np.array(PERIODS[turned_deg])
    diagonal = periods * (1, 0) if turned_deg == 0.0 else periods
    long = float(np.hypot(*diagonal))
    t = diagonal / long
    n = np.array([-t[1], t[0]])
    through = np.array([0.0, 4.0 + offset]) * CELL
    columns = round(2 * long)
    spacing = np.array([long / columns, 0.5]) * CELL
    a, b = ((np.arange(k) + 0.5) * h for k, h in zip((columns, 2 * height), spacing, strict=True))
    along, above = (c.ravel() for c in np.meshgrid(a, b))
    slope = math.radians(slope_deg)
    p = RHO * G * math.cos(slope) * (height * CELL - above)
    velocity = np.zeros((len(p), 2)) if speed is None else speed(above)[:, None] * t
    cloud = gr.Cloud(
        (through + along[:, None] * t + above[:, None] * n) % (periods * CELL),
        np.full(len(p), spacing.prod()),
        velocity=velocity,
        density=RHO * np.exp(p / material.K),
    )
    bodies: tuple[gr.Body, ...] = ()
    if wall is None and turned_deg == 0.0:
        bodies = (plane(n, through, **base),)
    elif wall is None:
        # Bodies that reach farther than half a period have no images: each period has a body.
        bodies = tuple(
            gr.Body(
                gr.Box(size=(math.inf, 4 * CELL), center=(0.0, -2 * CELL)),
                (through[0], through[1] + up * CELL * periods[1]),
                rotation_deg=math.degrees(math.atan2(t[1], t[0])),
                **base,
            )
            for up in (-1, 0, 1)
        )
    walls = () if wall is None else (gr.Wall(1, float(through[1]), kind=wall, **base),)
    with mock.patch.object(gr.Body, "check", lambda *_: None):  # it asks for images
        scene = gr.Scene(
            name="chute",
            grid=gr.Grid((0.0, 0.0), CELL, tuple(periods), periodic=(True, turned_deg != 0.0)),
            fills=(gr.Fill(cloud, 4),),
            material=material,
            scheme=scheme,
            gravity=gr.Gravity((0.0,), (tuple(G * (math.sin(slope) * t - math.cos(slope) * n)),)),
            duration=10.0,
            bodies=bodies,
            walls=walls,
        )
    return scene, t, above / CELL


def profile(run: Run, t: Array, above: Array) -> tuple[float, Array]:
    """Mean speed along a direction, and that in each row of cells."""
    speed, row = run.sim.state.v @ t, np.floor(above).astype(int)
    return float(speed.mean()), np.bincount(row, speed) / np.bincount(row)


REFERENCE = {"no_slip": "no_slip", "holds": "coulomb", "slides": "coulomb"}


def incline(kind: str, turned_deg: float, offset: float, until: float, wall: bool = False) -> Any:
    """Mean speed, and the speed of each row of cells, of a layer at 25 degrees."""
    material, height = gr.materials.glass_beads.replace(E=1e6, rho_c=RHO), 10

    def steady(above: Array) -> Array:
        return bagnold_profile(above, 25.0, height * CELL, material, G)

    base = BASES[kind]
    if wall:
        base = {"friction": base["friction"]} if "friction" in base else {}
    scene, t, above = chute_scene(
        turned_deg, offset, height, material, base, steady, wall=REFERENCE[kind] if wall else None
    )
    run = Run(scene)
    before = profile(run, t, above)[0]
    run.to(until)
    mean, rows = profile(run, t, above)
    numbers = {"mean": mean, "gained": mean - before}
    numbers |= {f"row_{k}": float(v) for k, v in enumerate(rows)}
    return {**numbers, "deepest": max(run.deepest, -1.0)}


def incline_cases(quick: bool) -> Cases:
    if quick:
        return {
            f"slides, {name_of(a, 0.0)}": partial(incline, "slides", a, 0.0, 0.02)
            for a in (0.0, 17.0)
        }
    cases: Cases = {}
    for kind in BASES:
        cases[f"{kind}, wall"] = partial(incline, kind, 0.0, 0.0, 1.0, wall=True)
        for turned in PERIODS:
            for offset in OFFSETS:
                name = f"{kind}, {name_of(turned, offset)}"
                cases[name] = partial(incline, kind, turned, offset, 1.0)
    return cases


def incline_lines(results: dict[str, Numbers]) -> list[Line]:
    lines = []
    texts = {
        "no_slip": "no-slip base",
        "holds": "friction 0.6, which holds",
        "slides": "friction 0.4, on which it slides",
    }
    for kind, text in texts.items():
        reference = results.get(f"{kind}, wall")
        if reference is None:
            continue
        some = [v for name, v in results.items() if name.startswith(f"{kind}, ") and "deg" in name]
        ratios = (v["mean"] / reference["mean"] for v in some)
        lines.append(spread(f"mean speed, {text}", ratios, 1.0, 0.01))
        names = [name for name in reference if name.startswith("row_")]
        fastest = max(reference[name] for name in names)
        off = [(v[name] - reference[name]) / fastest for v in some for name in names]
        lines.append(within(f"profile, {text}", off, 0.03))
        if kind == "slides":
            slope = math.radians(25.0)
            wanted = G * (math.sin(slope) - BASES[kind]["friction"] * math.cos(slope))
            gained = [v["gained"] / wanted for v in some]
            lines.append(
                spread(f"speed gained in 1 s over the exact one, {text}", gained, 1.0, 0.01)
            )
            on_wall = (
                results["slides, wall"]["gained"] / wanted if "slides, wall" in results else 0.0
            )
            if on_wall:
                what = "the same on a Coulomb wall of the grid"
                lines.append(Line(what, "", f"{on_wall:.3f}", None))
    return lines


# ---- the height at which a layer stops ----

STEEP, RATIO, ROWS_HIGH = 27.0, 1.25, 10
GRAINS = gr.NGF(E=1e6, mu_s=0.3819, mu_2=1.5, I0=0.28, d=0.05, rho_s=2450.0, A=0.3, t0=1e-3)


def _grains(ratio: float, rows: int) -> Any:
    """Grains for which a layer of some rows of cells is `ratio` times as high as H_stop."""
    stop = stopping_height(STEEP, GRAINS.A, 1.0, GRAINS.mu_s, GRAINS.mu_2)
    return GRAINS.replace(d=rows * CELL / (ratio * float(stop)))


def stopping(
    turned_deg: float, offset: float, ratio: float, until: float, wall: bool = False
) -> Numbers:
    """H_stop whose exact steady flow has the mean speed of the run, over H_stop of the grains."""
    grains, height = _grains(ratio, ROWS_HIGH), ROWS_HIGH * CELL
    scene, t, above = chute_scene(
        turned_deg,
        offset,
        ROWS_HIGH,
        grains,
        {} if wall else ROUGH,
        slope_deg=STEEP,
        wall="no_slip" if wall else None,
        scheme=gr.Scheme(fluidity=gr.Fluidity(initial=1.0)),
    )
    run = Run(scene)
    run.to(until)
    mean, _ = profile(run, t, above)
    share = np.linspace(0.7, 1.24 * ratio / 1.25, 71)
    means = [chute_profile(STEEP, height, grains.replace(A=grains.A * q)).mean for q in share]
    stop = float(np.interp(-mean, -np.array(means), share))
    return {"stop": stop, "mean": mean, "deepest": max(run.deepest, -1.0)}


def stopping_cases(quick: bool) -> Cases:
    if quick:
        return {"1.25, 17 deg, 0": partial(stopping, 17.0, 0.0, 1.25, 0.02)}
    cases: Cases = {}
    for ratio, turns in ((1.25, (0.0, 17.0, 45.0)), (2.0, (17.0,))):
        cases[f"{ratio:g}, wall"] = partial(stopping, 0.0, 0.0, ratio, 0.6, wall=True)
        for turned in turns:
            for offset in OFFSETS:
                name = f"{ratio:g}, {name_of(turned, offset)}"
                cases[name] = partial(stopping, turned, offset, ratio, 0.6)
    return cases


def stopping_lines(results: dict[str, Numbers]) -> list[Line]:
    lines = []
    for ratio, name, limit in (("1.25", "stop", 0.02), ("2", "mean", math.inf)):
        reference = results.get(f"{ratio}, wall")
        some = [(k, v) for k, v in results.items() if k.startswith(f"{ratio}, ") and "deg" in k]
        what = "H_stop" if name == "stop" else "mean speed"
        for turned in PERIODS:
            text = f"{turned:g} deg"
            values = [v[name] for k, v in some if f", {text}" in k]
            if values and reference:
                whole = f"{what} by a layer of {ratio} H_stop, over that on a wall, {text}"
                line = spread(whole, (v / reference[name] for v in values), 1.0, limit)
                lines.append(line if limit < 1 else Line(whole, "", line.measured, None))
    return lines


# ---- between two cylinders ----

RING = {"inner": 0.1, "outer": 0.15, "height": 0.08, "pressure": 5e3}
BEADS = gr.materials.couette_beads.replace(E=1.4e5, nu=0.3, mu_2=math.inf, b=0.941, d=0.004)


def couette(fineness: float, omega: float, until: float, stiffness: float = 1.0) -> Numbers:
    """Pressure of rings a cell wide over their mean, and the torque over the theory."""
    cell, beads = BEADS.d / fineness, BEADS.replace(E=BEADS.E * stiffness)
    run = Run(gr.scenes.couette(**RING, cell=cell, omega=omega, material=beads))
    edges = np.linspace(
        RING["inner"], RING["outer"], round((RING["outer"] - RING["inner"]) / cell) + 1
    )
    seen: list[Array] = []

    def look(sim: Any) -> None:
        state = sim.state
        ring = np.digitize(np.hypot(*state.x.T), edges[1:-1])
        sums = np.bincount(ring, state.pressure * state.volume) / np.bincount(ring, state.volume)
        seen.append(sums)

    run.to(until / 2, until / 20)
    begin = [(run.sim.time, *(float(b.angular_impulse) for b in run.sim.bodies))]
    run.to(until, until / 20, look)
    begin.append((run.sim.time, *(float(b.angular_impulse) for b in run.sim.bodies)))
    rings = np.mean(seen, axis=0)
    pressure = float(np.average(rings, weights=edges[1:] ** 2 - edges[:-1] ** 2))
    (span, inside, outside), torques = np.diff(begin, axis=0)[0], {}
    if omega:
        flow = couette_flow(0.1, 0.15, beads, rate=omega, pressure=pressure, walls="smooth")
        wanted = 2 * math.pi * 0.1**2 * flow.mu_wall * pressure
        torques = {"inner": -inside / span / wanted, "outer": outside / span / wanted}
    return {
        "pressure": pressure,
        "least": float(rings.min()) / pressure,
        "largest": float(rings.max()) / pressure,
        "first": float(rings[0]) / pressure,
        "last": float(rings[-1]) / pressure,
        **torques,
        "deepest": run.deepest,
    }


def couette_cases(quick: bool) -> Cases:
    if quick:
        return {"sheared, d": partial(couette, 1.0, 1.0, 0.02)}
    cases = {f"at rest, d/{k}": partial(couette, k, 0.0, 0.2) for k in (1, 2)}
    cases |= {f"sheared, d/{k}": partial(couette, k, 1.0, 0.2) for k in (1, 2, 3)}
    for stiffness in (4, 16):
        for k in (1, 2):
            name = f"sheared, {stiffness} E, d/{k}"
            cases[name] = partial(couette, k, 1.0, 0.2, stiffness=stiffness)
    return cases


def couette_lines(results: dict[str, Numbers]) -> list[Line]:
    """Lines of beads as soft as in `RING`, and of stiffer ones, which the theory is for."""
    lines = []
    for name, v in results.items():
        text = f"pressure of rings over their mean, {name}"
        line = spread(text, (v["least"], v["largest"]), 1.0, 0.03)
        lines.append(Line(text, "", line.measured, None) if " E, " in name else line)
    for name, v in results.items():
        if "inner" in v:
            values = [v["inner"], v["outer"]]
            line = spread(f"torque over the theory, {name}", values, 1.0, 0.02)
            if not (" E, " in name and name.endswith("/2")):
                line = Line(line.quantity, "converges", line.measured, None)
            lines.append(line)
    ratios = [v["inner"] / v["first"] for v in results.values() if "inner" in v]
    if ratios:
        what = "torque on the inner one with the pressure of the ring there, in the same order"
        lines.append(Line(what, "", ", ".join(f"{value:.3f}" for value in ratios), None))
    return lines


ROWS = {
    "incline": Row(
        "Incline of 25 degrees on a base through the grid", incline_cases, incline_lines
    ),
    "stopping": Row("Stopping height, nonlocal law", stopping_cases, stopping_lines),
    "couette": Row("Between two cylinders, 2D", couette_cases, couette_lines),
}

"""Granular cases: inclines, thin layers, rest, impact, and the error of a soft material."""

from __future__ import annotations

import math
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np

import granular as gr
from granular.verify.incline import mean_speed
from stability.cells import SCHEMES, Map, at_courant, chosen, off, refuses, simulate

HEIGHT = 0.2
FEW = ("published (linear, flip)", "quadratic, apic", "default", "cell_averaged")
"""Schemes of the longer runs."""


def error_of_profile(state: gr.State, least: float = 0.0) -> float:
    """L2 error of v(y) at the points against the one-dimensional equation, relative to its size,
    or to the speed `least` [m/s] if that is larger."""
    given = state.scene.parameters
    layer = given["angle_deg"], given["height"], state.scene.material
    exact = gr.theory.transient(*layer, [state.time], 9.8, ramp=given["ramp"])
    v = np.interp(state.x[:, 1], np.r_[0.0, exact.y], np.r_[0.0, np.ravel(exact.v)])
    miss, size = (math.sqrt(np.average(u**2, weights=state.mass)) for u in (state.v[:, 0] - v, v))
    return miss / max(size, least)


def watched(sim: gr.Simulation, until: float) -> dict[str, float]:
    """Run, and return the indicators of failure."""
    return {sign.name: round(sign.value, 4) for sign in sim.run(until=until).health()}


def flow(scene: gr.Scene, until: float, least: float = 0.0) -> tuple[float, dict[str, float]]:
    """Error of v(y) after a while, and the indicators of the monitor."""
    sim = simulate(scene)
    signs = watched(sim, until)
    height = gr.measure.layer_height(sim.state) / scene.parameters["height"]
    return error_of_profile(sim.state, least), signs | {"height": round(height, 4)}


incline_map = partial(Map, quantity="relative L2 error of v(y)", rows="scheme", sound=0.05)


def incline_courant(quick: bool) -> Map:
    """Time steps that are too large but cause no NaN: one column at 25 deg."""
    result = incline_map(
        "incline_courant",
        "Too large a step without a NaN: one column of an incline of 25 deg, 10 s",
        columns="c dt/dx",
        sound=0.02,
    )
    material, cell = gr.materials.glass_beads.replace(E=1e6), 0.01
    for name in (FEW[0], "quadratic, flip", *FEW[2:]):
        for courant in chosen((0.5, 0.7, 0.75, 0.8, 0.85, 0.9, 1.0, 1.1, 1.2, 1.4), quick):
            scheme = at_courant(SCHEMES[name], courant, cell, material)
            scene = gr.scenes.incline(cell=cell, material=material, scheme=scheme)
            until, refused = 0.3 if quick else 10.0, refuses(scene)
            result.add(name, f"{courant:g}", flow, scene, until, refused=refused)
    return result


ANGLES = (22.0, 23.5, 25.0, 27.0, 29.0, 30.0, 31.5)


def angle_label(angle: float, material: gr.MuI) -> str:
    """Slope [deg] and its inertial number."""
    return f"{angle:g}: {gr.theory.scaled_inertial_number_of_slope(angle, material):.2g}"


def incline_angles(quick: bool) -> Map:
    """Inertial number x scheme: eight columns, slopes on both sides of the well-posed range."""
    result = incline_map(
        "incline_angles",
        "Two-dimensional shear flow: an incline of 8 columns, jittered, 6 s",
        columns="slope [deg] and its inertial number I/I0",
    )
    layer = {"cell": 0.01, "columns": 8, "jitter": 0.6, "seed": 4}
    layer["material"] = gr.materials.glass_beads.replace(E=1e6)
    for name in (FEW[0], "quadratic, flip", *FEW[1:]):
        for angle in chosen(ANGLES, quick):
            scene = gr.scenes.incline(angle_deg=angle, scheme=SCHEMES[name], **layer)
            label = angle_label(angle, scene.material)
            result.add(name, label, flow, scene, 0.05 if quick else 6.0)
    return result


def incline_seeding(quick: bool) -> Map:
    """Points per cell x cells over the height, default scheme, 8 columns at 25 deg."""
    result = Map(
        "incline_seeding",
        "Points per cell and thin layers: an incline of 25 deg, 8 columns, default scheme",
        "relative L2 error of v(y) at 20 times sqrt(h/g)",
        "points per cell",
        "cells over the height",
        0.05,
    )
    for points in chosen((1, 4, 9, 16), quick):
        for cells in chosen((1, 2, 3, 4, 6, 8, 12, 20), quick):
            height = 0.01 * cells
            # The ratio of weight to stiffness is the same in each, so that the bias of a soft
            # material does not vary.
            scene = gr.scenes.incline(
                height=height,
                cell=0.01,
                columns=8,
                points_per_cell=points,
                jitter=0.6,
                ramp=0.7 * math.sqrt(height / 9.8),
                material=gr.materials.glass_beads.replace(E=5e6 * height),
                seed=5,
            )
            until = (1 if quick else 20) * math.sqrt(height / 9.8)
            result.add(f"{points}", f"{cells}", flow, scene, until)
    return result


def incline_refinement(quick: bool) -> Map:
    """Slope x refinement, along the slope as well or in one column, where no wave can grow."""
    result = incline_map(
        "incline_refinement",
        "Refinement of an incline, one column or 0.08 m long, jittered, default scheme, 1 s",
        rows="columns, cells over the height",
        columns="slope [deg] and its inertial number I/I0",
    )
    layer = {"jitter": 0.6, "material": gr.materials.glass_beads.replace(E=3e6), "seed": 6}
    for cells in chosen((10, 20, 40), quick):
        for columns in (1, round(0.4 * cells)):
            for angle in chosen((22.0, 25.0, 28.0, 31.5), quick):
                scene = gr.scenes.incline(
                    angle_deg=angle, cell=HEIGHT / cells, columns=columns, **layer
                )
                label = angle_label(angle, scene.material)
                result.add(f"{columns}, {cells}", label, flow, scene, 0.05 if quick else 1.0)
    # One column first, as the result that the others should have.
    result.cells.sort(key=lambda cell: not cell.row.startswith("1,"))
    return result


def law_ends(quick: bool) -> Map:
    """Slopes near both ends of the law, mu_s = tan 20.90 deg and mu_2 = tan 32.76 deg."""
    result = incline_map(
        "law_ends",
        "The ends of the mu(I) law: one column of an incline, 4 s",
        quantity="L2 error of v(y) over max(|v|, 0.01 sqrt(g h))",
        columns="slope [deg]",
    )
    material = gr.materials.glass_beads.replace(E=1e7)
    low, high = (math.degrees(math.atan(mu)) for mu in (material.mu_s, material.mu_2))
    angles = {f"{angle:g}": angle for angle in (0.0, 19.0, 21.5, 32.0, 34.0, 40.0)}
    angles |= {"mu_s": low, "mu_2": high}
    until, least = 0.2 if quick else 4.0, 0.01 * math.sqrt(9.8 * HEIGHT)
    for name in FEW:
        for label, angle in sorted(angles.items(), key=lambda item: item[1]):
            scene = gr.scenes.incline(
                angle_deg=angle, cell=0.02, material=material, scheme=SCHEMES[name]
            )
            result.add(name, label, flow, scene, until, least)
    return result


def incline_columns(quick: bool) -> Map:
    """Columns x scheme, to find where the flow of the published scheme becomes two-dimensional."""
    title = "Columns of an incline of 25 deg, jittered, 6 s"
    result = incline_map("incline_columns", title, columns="columns")
    for name in FEW:
        for columns in chosen((1, 2, 3, 4, 8), quick):
            scene = gr.scenes.incline(
                cell=0.01,
                columns=columns,
                jitter=0.6 if columns > 1 else 0.0,
                material=gr.materials.glass_beads.replace(E=1e6),
                scheme=SCHEMES[name],
            )
            result.add(name, f"{columns}", flow, scene, 0.05 if quick else 6.0)
    return result


def layer_at_rest(scheme: gr.Scheme, angle: float, material: gr.MuI) -> gr.Scene:
    """Periodic layer 10 cells high."""
    return gr.scenes.incline(
        angle_deg=angle,
        height=REST_HEIGHT,
        cell=0.01,
        columns=4,
        jitter=0.6,
        material=material,
        scheme=scheme,
    )


def column_at_rest(scheme: gr.Scheme, material: gr.MuI) -> gr.Scene:
    """Level layer between free_slip walls instead of periodic ends."""
    scene = layer_at_rest(scheme, 0.0, material)
    walls = [gr.Wall(0, at, kind="free_slip") for at in (0.0, scene.grid.upper[0])]
    grid = replace(scene.grid, periodic=(False, False))
    return scene.replace(name="column", grid=grid, walls=(*scene.walls, *walls))


REST_HEIGHT = 0.1


def at_rest(scene: gr.Scene, waves: float) -> tuple[float, dict[str, float]]:
    """Speed in a layer after some wave times, divided by sqrt(g h), and the pressure error."""
    sim = simulate(scene)
    signs = watched(sim, waves * REST_HEIGHT / scene.material.wave_speed)
    state = sim.state
    speed = gr.measure.speed_percentile(state, q=99) / math.sqrt(9.8 * REST_HEIGHT)
    pressure = gr.measure.mean_pressure_error(state, depth_cells=2)
    return speed, {"pressure": round(pressure, 4)} | signs


def rest(quick: bool) -> list[Map]:
    """Layers that should be at rest: level, on a slope below mu_s = tan 20.9 deg, between walls."""
    title, quantity = "Rest: a layer after 10^4 wave times", "99th percentile of speed / sqrt(g h)"
    speeds = Map("rest_speed", title, quantity, "scheme", "slope [deg]", 1e-4)
    title, quantity = "Rest: cell pressure off the surface", "relative error against the weight"
    pressures = Map("rest_pressure", title, quantity, "scheme", "slope [deg]", 0.03)
    for name in FEW:
        scheme, material = SCHEMES[name], gr.materials.glass_beads.replace(E=1e6)
        scenes = {f"{angle:g}": layer_at_rest(scheme, angle, material) for angle in (0.0, 15.0)}
        scenes["0, between walls"] = column_at_rest(scheme, material)
        for column, scene in scenes.items():
            speeds.add(name, column, at_rest, scene, 20 if quick else 1e4)
            pressures.add(name, column, speeds.cells[-1].notes.get, "pressure", math.nan)
    return [speeds, pressures]


def slug(scheme: gr.Scheme, quick: bool) -> tuple[float, dict[str, Any]]:
    """Rebound speed of a disconnected slug from a wall, divided by its impact speed.

    The notes are the largest stress in flight and the change of mass, which must be zero.
    """
    scene = gr.scenes.slug(
        cell=0.02, material=gr.materials.glass_beads.replace(E=1e6), scheme=scheme
    )
    sim = simulate(scene)
    mass = sim.state.mass.sum()
    sim.run(until=0.3)
    stress = float(abs(sim.state.stress).max())
    speed = least = mean_speed(sim.state)
    for time in np.arange(0.32, 0.4 if quick else 0.6, 0.02):
        sim.run(until=time)
        least = min(least, mean_speed(sim.state))
    lost = float(abs(sim.state.mass.sum() / mass - 1))
    return max(-least / speed, 0.0), {"stress in flight": stress, "mass lost": lost}


def reconsolidation(quick: bool) -> Map:
    """Free flight and reconsolidation: no stress in flight, and hardly any rebound."""
    result = Map(
        "slug",
        "Free flight and impact: a disconnected slug meets a wall",
        "speed of rebound / speed of impact",
        "scheme",
        "",
        0.2,
    )
    for name, scheme in SCHEMES.items():
        result.add(name, "rebound", slug, scheme, quick)
    return result


# ---- softness ----


def discharge(E: float, quick: bool) -> float:
    """Discharge [kg/s] of the silo with an orifice of 0.2 m, cells of 0.02 m, default scheme."""
    material = gr.materials.glass_beads.replace(E=E)
    scene = gr.scenes.silo(orifice=0.2, cell=0.02, material=material)
    states: list[gr.State] = []
    sim = simulate(scene)
    sim.run(until=0.2 if quick else 1.2, every=1 / 60, hooks=(lambda s: states.append(s.state),))
    times = np.array([s.time for s in states])
    mass = np.array([s.mass.sum() for s in states])
    late = times > (0.12 if quick else 0.5)
    return float(-np.polyfit(times[late], mass[late], 1)[0])


def softness(quick: bool) -> Map:
    """Change of the quantity of interest due to a lower E."""
    result = Map(
        "softness",
        "Error of a softer material",
        "relative change against E = 1e7 Pa (silo), error against the equation (inclines, 10 s)",
        "case",
        "E [Pa]",
        0.02,
    )
    moduli = (1e6, 1e5) if quick else (1e7, 1e6, 1e5)
    stiff = discharge(moduli[0], quick)
    for E in moduli[1:]:
        result.add("silo, discharge at D = 0.2 m", f"{E:.0e}", off, stiff, discharge, E, quick)
    for angle in (25.0, 32.0):
        for E in moduli[1:]:
            scene = gr.scenes.incline(
                angle_deg=angle, cell=0.01, material=gr.materials.glass_beads.replace(E=E)
            )
            row = f"incline, depth average, {angle:g} deg"
            result.add(row, f"{E:.0e}", depth_average_error, scene, 0.3 if quick else 10.0)
    return result


def depth_average_error(scene: gr.Scene, until: float) -> float:
    """Relative error of the mean speed against the one-dimensional equation."""
    state = simulate(scene).run(until=until).state
    angle = scene.parameters["angle_deg"]
    exact = gr.theory.transient(angle, HEIGHT, scene.material, [state.time], 9.8).mean[0]
    return abs(mean_speed(state) / exact - 1)

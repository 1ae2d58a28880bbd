"""Elastic cases: patches, arrangements of points, waves, rotation, locking, tearing."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

import granular as gr
from stability.cells import SCHEMES, Map, at_courant, chosen, refuses, simulate

CELL = 0.1
WEIGHTLESS = gr.Gravity((0.0,), ((0.0, 0.0),))
BASES = ("linear", "ugimp", "quadratic")
ELASTIC = gr.Elastic(E=1e6)
DISC = gr.Sphere(0.43, center=(0.8, 0.8))


def places(sim: gr.Simulation) -> np.ndarray:
    """Rows of the points in the buffers, by id."""
    ids = sim.buffers["id"]
    at = np.flatnonzero(ids >= 0)
    return at[np.argsort(ids[at])]


def body(region: Any, points: int, scheme: gr.Scheme, **options: Any) -> gr.Scene:
    """A jittered elastic body in a periodic box of 16 x 16 cells, without gravity."""
    material = options.pop("material", ELASTIC)
    seed, shape = options.pop("seed", 0), options.pop("shape", (16, 16))
    still, periodic = (0.0,) * len(shape), options.pop("periodic", (True,) * len(shape))
    return gr.Scene(
        name="body",
        grid=gr.Grid(still, CELL, shape, periodic=periodic),
        fills=(gr.Fill(region, points, **({"jitter": 1.0} | options)),),
        material=material,
        scheme=scheme,
        gravity=gr.Gravity((0.0,), (still,)),
        duration=1.0,
        seed=seed,
    )


# ---- cell crossing ----


def patch_error(basis: str, points: int, jitter: float, seed: int) -> float:
    """Largest force of a uniform pressure p on a node inside, in units of p dx.

    The seeded body first flies a quarter of a cell, so that points lie on both sides of cell
    borders.
    """
    region = gr.Box((0.3, 0.3), (1.9, 1.9))
    scene = body(
        region,
        points,
        gr.Scheme(basis=basis, transfer="flip"),
        material=gr.MuI(E=1e6),
        shape=(24, 24),
        periodic=(False, False),
        jitter=jitter,
        density=1200.0,
        velocity=(1.0, 1.0),
        seed=seed,
    )
    sim = simulate(scene)
    while sim.time < 0.25 * CELL:
        sim.step()
    sim.buffers["stress"][:3, places(sim)] = -100.0
    sim._engine.p2g()
    nodes = sim._engine.nodes()
    inside = ((nodes["x"] > 0.55) & (nodes["x"] < 1.75)).all(axis=1)
    return float(abs(nodes["force"][inside]).max() / (100.0 * CELL))


def median_error(basis: str, points: int, jitter: float, seeds: int) -> float:
    """Median of the error of a patch over the seedings."""
    return float(np.median([patch_error(basis, points, jitter, seed) for seed in range(seeds)]))


def patches(quick: bool) -> Map:
    """Cell crossing."""
    result = Map(
        "patch",
        "Cell crossing: force of a uniform pressure",
        "largest nodal force / (p dx), median of 7 seedings",
        "basis",
        "points per cell, jitter",
        0.1,
    )
    seeds = 1 if quick else 7
    for basis in BASES:
        for jitter in (0.2, 1.0):
            for points in chosen((1, 4, 9, 16), quick):
                result.add(
                    basis, f"{points}, {jitter:g}", median_error, basis, points, jitter, seeds
                )
    return result


# ---- time step ----


FLIGHT = (0.02, 0.012, 0.007)
"""Velocity of a flying body, divided by the wave speed, so that its points pass through many
arrangements relative to the cells, each for a short time."""


def growth(scene: gr.Scene, steps: int, seed: int = 0, flight: tuple[float, ...] = FLIGHT) -> float:
    """Growth factor of the energy of a body in free flight, in the moving frame.

    The body flies over the cells with velocity noise of a millionth of the wave speed. The step is
    thus tested with many arrangements of points, while all strains stay in the linear range.
    """
    sim = simulate(scene)
    at, c = places(sim), scene.material.wave_speed
    noise = np.random.default_rng(seed).standard_normal((scene.dim, len(at)))
    mean = np.array(flight[: scene.dim])[:, None]
    sim.buffers["v"][:, at] = c * (mean + 1e-6 * noise)
    sim.step(20)  # noise that the grid does not resolve decays within these steps
    before = own_energy(sim.state)
    with np.errstate(over="ignore"):
        sim.step(steps)
    return own_energy(sim.state) / before


def own_energy(state: gr.State) -> float:
    """Kinetic energy about the mean velocity, plus elastic energy."""
    mean = np.average(state.v, axis=0, weights=state.mass)
    kinetic = np.sum(state.mass * np.sum((state.v - mean) ** 2, axis=1)) / 2
    return float(kinetic + gr.measure.energy(state).elastic)


def flights(name: str, title: str, rows: str, columns: str = "c dt/dx", seedings: int = 3) -> Map:
    """Map of the growth of the energy of bodies in flight."""
    quantity = f"growth of its energy, worst of {seedings} seedings"
    return Map(name, title, quantity, rows, columns, 1.5)


def add_flight(
    result: Map,
    row: str,
    courant: float,
    scheme: gr.Scheme,
    quick: bool,
    *,
    region: Any = DISC,
    points: int = 4,
    seedings: int = 3,
    flight: tuple[float, ...] = FLIGHT,
    **options: Any,
) -> None:
    """Add the largest growth over the seedings, or note that the package refuses the time step."""
    scenes = [
        body(region, points, scheme, seed=seed, **options)
        for seed in range(1 if quick else seedings)
    ]
    steps = 200 if quick else 2000
    result.add(
        row,
        f"{courant:g}",
        lambda: max(growth(scene, steps, scene.seed, flight) for scene in scenes),
        refused=refuses(scenes[0]),
    )


COURANTS = (0.1, 0.25, 0.5, 0.6, 0.7, 0.75, 0.8, 0.9, 1.0, 1.2)


def courant_points(quick: bool) -> list[Map]:
    """CFL x points per cell, one map per scheme: a disc with a ragged edge in flight."""
    maps = []
    for name, scheme in SCHEMES.items():
        result = flights(
            f"courant_{name.split()[0].strip(',').lower()}_{scheme.transfer}",
            f"Time step, {name}: a disc in flight",
            "points per cell",
        )
        for points in chosen((1, 4, 9, 16), quick):
            for courant in chosen(COURANTS, quick):
                fixed = at_courant(scheme, courant, CELL, ELASTIC)
                add_flight(result, f"{points}", courant, fixed, quick, points=points)
        maps.append(result)
    return maps


def courant_nu(quick: bool) -> Map:
    """CFL x nu with the default scheme: the wave speed is for compression waves."""
    title = "Time step and Poisson's ratio, default scheme: a disc in flight"
    result = flights("courant_nu", title, "nu")
    for nu in chosen((0.0, 0.3, 0.45, 0.49, 0.499), quick):
        material = gr.Elastic(E=1e6, nu=nu)
        bar = math.sqrt(material.E / material.rho_c)
        for courant in chosen((0.25, 0.5, 0.75, 1.0, 1.2), quick):
            fixed = at_courant(gr.schemes.default, courant, CELL, material)
            add_flight(result, f"{nu:g}", courant, fixed, quick, material=material)
        result.cells[-1].notes["c / sqrt(E/rho)"] = material.wave_speed / bar
    return result


SPACE_SCHEMES = {name: scheme for name, scheme in SCHEMES.items() if scheme.basis != "linear"}


def courant_space(quick: bool) -> Map:
    """CFL x scheme in 3D: a short cylinder in flight."""
    title = "Time step in 3D: a cylinder in flight"
    result = flights("courant_space", title, "scheme, points per cell", seedings=2)
    cylinder = {
        "region": gr.Cylinder(0.23, center=(0.4, 0.4, 0.4), axis=(0.0, 0.0, 1.0), length=0.5),
        "shape": (8, 8, 8),
        "seedings": 2,
    }
    for name, scheme in SPACE_SCHEMES.items():
        for points in chosen((1, 8), quick, few=1):
            for courant in chosen((0.5, 0.6, 0.7, 0.8, 1.0), quick):
                fixed = at_courant(scheme, courant, CELL, ELASTIC)
                row = f"{name}, {points}"
                add_flight(result, row, courant, fixed, quick, points=points, **cylinder)
    return result


def courant_speed(quick: bool) -> Map:
    """CFL x speed: the wave speed of a body in flight is c + |v|."""
    title = "Time step of a fast body, default scheme: a disc in flight"
    result = flights("courant_speed", title, "v/c", "(c + v) dt/dx")
    c = ELASTIC.wave_speed
    for speed in chosen((0.1, 0.5, 1.0, 2.0), quick):
        flight = (0.8 * speed, 0.6 * speed)
        velocity = tuple(c * v for v in flight)
        for courant in chosen((0.25, 0.5, 0.64, 0.8, 1.0, 1.5), quick):
            fixed = gr.schemes.default.replace(dt=courant * CELL / (c * (1 + speed)))
            add_flight(
                result, f"{speed:g}", courant, fixed, quick, flight=flight, velocity=velocity
            )
    return result

"""Cost of features in addition to one law: time per point-step with each feature on and off.

Two simulations of a block of 8,192 points that was thrown over a rough floor differ in one feature
alone. They make batches of steps in turns, in the order off, on, on, off, with one thread and the
default scheme. Times are of the processor, so that other programs on the machine lengthen them only
through caches and memory. The cost of a feature is the median over the rounds of the ratio of both
times per point and step, with the quartiles of the ratio for its noise. Points that have entered by
an inflow count.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Any

import numpy as np
from shared import parser_of, rounded, stored, table, write

import granular as gr
from speed.own_mu_I import MU_I_IN_C, mu_I, mu_I_by_points

CELL, DIAMETER = 0.01, 2e-3
SAND = gr.MuI(E=1e6, I0=0.279, d=DIAMETER)
LAW = {"mu_s": SAND.mu_s, "mu_2": SAND.mu_2, "xi": SAND.xi}

Pair = Callable[[int], tuple[Any, Any]]
"""Scenes without and with a feature, for a block of so many rows of cells."""


def block(rows: int, **changes: Any) -> gr.Scene:
    """Return a block of 4 points per cell, twice as long as high, that flies to the side."""
    long, high = 2 * rows * CELL, rows * CELL
    given: dict[str, Any] = {
        "name": "block",
        "grid": gr.Grid((0.0, 0.0), CELL, (4 * rows, rows + 16)),
        "fills": [gr.Fill(gr.Box((0.0, 0.0), (long, high)), 4, velocity=(1.0, 0.0))],
        "walls": [gr.Wall(1, 0.0), gr.Wall(0, 0.0, kind="free_slip")],
        "gravity": gr.Gravity((0.0,), ((0.0, -9.8),)),
        "material": SAND,
        "duration": 100.0,
    }
    return gr.Scene(**given | changes)


def of_materials(off: Any, on: Any) -> Pair:
    """Return the pair of blocks of two materials."""
    return lambda rows: (block(rows, material=off), block(rows, material=on))


def two_materials(rows: int) -> tuple[gr.Scene, gr.Scene]:
    """Left and right half of a block: of the same material, and of two."""
    half, high = rows * CELL, rows * CELL
    boxes = gr.Box((0.0, 0.0), (half, high)), gr.Box((half, 0.0), (2 * half, high))
    scenes = []
    for other in (None, SAND.replace(mu_s=0.5, mu_2=0.7)):
        first, second = (gr.Fill(box, 4, velocity=(1.0, 0.0)) for box in boxes)
        right = gr.Fill(second.region, 4, velocity=(1.0, 0.0), material=other)
        scenes.append(block(rows, fills=[first, right]))
    return scenes[0], scenes[1]


def fed(rows: int) -> tuple[gr.Scene, gr.Scene]:
    """Return a block alone, and with a spout above it."""
    top = (rows + 16) * CELL
    box = gr.Box((0.4 * top, top - 2 * CELL), (0.4 * top + 8 * CELL, top))
    return block(rows), block(rows, inflows=[gr.Inflow(box, (0.0, -1.0), 4)])


def with_body(rows: int, **free: Any) -> gr.Scene:
    """Return a block with a box half sunk into it."""
    shape, at = gr.shapes.Box(size=(8 * CELL, 8 * CELL)), (rows * CELL, rows * CELL)
    body = gr.Body(shape, at, friction=0.4, **free)
    return block(rows, bodies=[body])


def free_body(rows: int) -> tuple[gr.Scene, gr.Scene]:
    """A body at rest, and one that moves and turns freely."""
    whole = gr.bodies.mass_properties(gr.shapes.Box(size=(8 * CELL, 8 * CELL)), density=1500.0)
    motion = gr.Motion(velocity=((1.0, 0.0),))
    free = {"free": "xy", "mass": whole.mass, "inertia": whole.inertia, "motion": motion}
    return with_body(rows), with_body(rows, **free)


def fed_sph(rows: int) -> tuple[Any, Any]:
    """A bed of SPH under a jet that was thrown in at the start, and under one that is fed."""
    from granular import sph

    wide, deep = 2 * rows, rows // 2
    scenes = []
    for inflow in (False, True):
        nozzle = gr.Box(
            (0.9 * rows * CELL, (deep + 16) * CELL), (1.1 * rows * CELL, (deep + 22) * CELL)
        )
        scenes.append(
            sph.Scene(
                name="fed",
                grid=gr.Grid((0.0, 0.0), CELL, (wide, deep + 22), periodic=(True, False)),
                fills=(gr.Fill(gr.Box((0.0, 0.0), (wide * CELL, deep * CELL)), 1),),
                inflows=(gr.Inflow(nozzle, (0.0, -1.0), 1, driven=True),) * inflow,
                walls=(sph.ParticleWall(1, 0.0, 1),),
                gravity=gr.Gravity((0.0,), ((0.0, -9.8),)),
                duration=100.0,
            )
        )
    return scenes[0], scenes[1]


def own_law(function: Any, **more: Any) -> Pair:
    """Return the pair of the built-in law and the same one written by a user."""

    def pair(rows: int) -> tuple[gr.Scene, gr.Scene]:
        given = {"parameters": LAW, "E": SAND.E, "nu": SAND.nu, "rho_c": SAND.rho_c} | more
        return block(rows), block(rows, material=gr.materials.from_function(function, **given))

    return pair


REGULARISED = gr.RegularisedMuI(E=SAND.E, mu_s=SAND.mu_s, mu_2=SAND.mu_2, I0=SAND.I0, d=DIAMETER)
CASES: dict[str, tuple[str, str, Pair]] = {
    "materials": ("one material", "two materials", two_materials),
    "cohesion": ("mu(I)", "with cohesion, 50 Pa", of_materials(SAND, SAND.replace(cohesion=50.0))),
    "regularised": ("mu(I)", "partially regularised mu(I)", of_materials(SAND, REGULARISED)),
    "restitution": (
        "mu(I)",
        "with `restitution=0.5`",
        of_materials(SAND, SAND.replace(restitution=0.5)),
    ),
    "own NumPy": ("mu(I)", "user-defined mu(I), NumPy", own_law(mu_I)),
    "own numba": ("mu(I)", "user-defined mu(I), numba", own_law(mu_I_by_points, compiler="numba")),
    "own C": ("mu(I)", "user-defined mu(I), C", own_law(MU_I_IN_C)),
    "inflow": ("no inflow", "an inflow of 16 columns", fed),
    "body": ("no body", "a body at rest", lambda rows: (block(rows), with_body(rows))),
    "free body": ("a body at rest", "a free body", free_body),
    "SPH inflow": ("SPH, no inflow", "SPH, an inflow", fed_sph),
}
"""Names without and with the feature, and the scenes."""


def batch(sim: gr.Simulation, steps: int) -> float:
    """Make steps, and return their processor time per point and step [ns]."""
    before, begin = sim.n_points, time.process_time()
    sim.step(steps)
    seconds = time.process_time() - begin
    return 1e9 * seconds / (steps * 0.5 * (before + sim.n_points))


def measure(pair: Pair, rows: int, rounds: int, steps: int) -> dict[str, Any]:
    """Time both scenes in turns."""
    sims = [gr.Simulation(scene, threads=1) for scene in pair(rows)]
    for sim in sims:
        sim.step(steps)
    times = []
    for _ in range(rounds):
        turns = [batch(sims[k], steps) for k in (0, 1, 1, 0)]
        times.append((0.5 * (turns[0] + turns[3]), 0.5 * (turns[1] + turns[2])))
    off, on = np.array(times).T
    ratio = np.quantile(on / off, [0.25, 0.5, 0.75])
    return {
        "points": sims[1].n_points,
        "off": float(np.median(off)),
        "on": float(np.median(on)),
        "ratio": ratio.tolist(),
    }


def tables(results: dict[str, Any]) -> dict[str, list[str]]:
    """Table of all results in the order of the cases."""
    measured = results["rows"]
    rows = [measured[name] | {"case": case} for name, case in CASES.items() if name in measured]
    columns = {"without": "{case[0]}", "with": "{case[1]}"}
    columns |= {"without, ns": "{off:.3g}", "with, ns": "{on:.3g}"}
    columns |= {"ratio (quartiles)": "{ratio[1]:.3g} ({ratio[0]:.3g} to {ratio[2]:.3g})"}
    return {"features": table(rows, columns)}


def main(argv: list[str] | None = None) -> None:
    """Measure the cases that are named."""
    parser = parser_of(__name__, __doc__)
    parser.add_argument("--only", nargs="+", choices=CASES, default=list(CASES))
    arguments = parser.parse_args(argv)
    results = stored(arguments.out, rows={})
    rows, rounds, steps = (8, 1, 10) if arguments.quick else (32, 60, 40)
    for name in arguments.only:
        off, on, pair = CASES[name]
        row = measure(pair, rows, rounds, steps)
        results["rows"][name] = rounded(row)
        ratios = ", ".join(f"{number:.3g}" for number in row["ratio"])
        print(f"{off} / {on}: {row['off']:.3g}, {row['on']:.3g} ns, ratio {ratios}", flush=True)
        write(arguments.out, results)

"""Tools in soil at affordable sizes: runs, records and the numbers of docs/reports/three_d.md.

Its scenes and measurements are those of `granular.papers.haeri2021`, which draws the figures.
Without names it lists the cases. Numbers go to benchmarks/results/three_d.json, case by case.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
from shared import RESULTS, markdown, stored, table, write

import granular as gr
from granular.papers.haeri2021.blades import (
    BED,
    FINE,
    SOIL,
    THICK,
    THIN,
    WIDTH,
    BladeForces,
    blade_scene,
    plastic,
)
from granular.papers.haeri2021.cylinders import BEADS, HIGH, LOW, CylinderFlow
from granular.papers.haeri2021.document import EVERY
from granular.papers.haeri2021.excavation import WHOLE
from granular.papers.haeri2021.wheels import ROLL, Rolling, wheel_scene

OUT = RESULTS / "three_d.json"
RECORDS = Path("build/three_d")

LATE = SOIL.replace(t0=1e-4)
"""The t0 of the paper, of which the time step is six times as long: it takes substeps."""
SUBSTEPS = THICK["scheme"].replace(fluidity=THICK["scheme"].fluidity.replace(substeps=8))
LOCAL = {"material": SOIL.replace(A=0.0)}
STIFF = {"material": SOIL.replace(E=1.5e6)}
PLASTIC = {"material": plastic(SOIL)}
RINGS = 3
"""Number of rings (every second one from the inner cylinder on) whose time series is stored."""
LONG = ("course", "profile")
"""Entries that are not printed."""
CASES: dict[str, Callable[[], gr.Scene]] = {
    **{f"wheel_{slip}": lambda slip=slip: wheel_scene(slip, **ROLL) for slip in (20, 40, 70)},
    "wheel_70_stiff": lambda: wheel_scene(70, **STIFF, **ROLL),
    "thin_2": lambda: blade_scene(0.02, **THIN),
    "thin_5": lambda: blade_scene(0.05, **THIN),
    "thin_5_local": lambda: blade_scene(0.05, **THIN, **LOCAL),
    "thin_5_stiff": lambda: blade_scene(0.05, **THIN, **STIFF),
    "thin_5_fine": lambda: blade_scene(0.05, **THIN, **FINE),
    "thin_5_local_fine": lambda: blade_scene(0.05, **THIN, **LOCAL, **FINE),
    "narrow_2": lambda: blade_scene(0.02, **THICK),
    "narrow_5": lambda: blade_scene(0.05, **THICK),
    "narrow_5_local": lambda: blade_scene(0.05, **THICK, **LOCAL),
    "narrow_5_coarse_grains": lambda: blade_scene(0.05, material=SOIL.replace(d=0.01), **THICK),
    "narrow_5_no_length": lambda: blade_scene(0.05, material=SOIL.replace(A=1e-6), **THICK),
    "narrow_5_late": lambda: blade_scene(0.05, material=LATE, **THICK),
    "narrow_5_drucker_prager": lambda: blade_scene(0.05, **THICK, **PLASTIC),
    "narrow_5_stiff": lambda: blade_scene(0.05, **THICK, **STIFF),
    "narrow_5_thick": lambda: blade_scene(0.05, **(THICK | {"blade": (0.05, 0.05, 0.457)})),
    "narrow_5_slow": lambda: blade_scene(0.05, speed=0.02, dive_speed=0.0125, **THICK),
    "narrow_5_fine": lambda: blade_scene(0.05, **THICK, **FINE),
    "narrow_5_local_fine": lambda: blade_scene(0.05, **THICK, **LOCAL, **FINE),
    "narrow_5_drucker_prager_fine": lambda: blade_scene(0.05, **THICK, **PLASTIC, **FINE),
    "narrow_5_substeps": lambda: blade_scene(0.05, material=LATE, **(THICK | {"scheme": SUBSTEPS})),
    "narrow_5_finer": lambda: blade_scene(0.05, cell=BED["cell"] / 2, **THICK),
    "thin_5_one": lambda: blade_scene(0.05, points_per_cell=1, **THIN),
    "thin_5_coarse": lambda: blade_scene(0.05, cell=BED["cell"] * 2, **THIN),
    "excavation_2": lambda: blade_scene(0.02),
    "excavation_5": lambda: blade_scene(0.05),
    "excavation_5_fine": lambda: blade_scene(0.05, **FINE),
    "excavation_5_whole": lambda: blade_scene(0.05, **WHOLE),
    "couette": lambda: gr.scenes.couette(**HIGH),
    "couette_shallow": lambda: gr.scenes.couette(**LOW),
    "couette_shallow_8": lambda: gr.scenes.couette(**(LOW | {"duration": 0.7, "cell": 0.008})),
    "couette_shallow_6": lambda: gr.scenes.couette(**(LOW | {"duration": 0.7, "cell": 0.006})),
    "couette_shallow_local": lambda: gr.scenes.couette(
        **(LOW | {"duration": 0.5, "material": BEADS.replace(A=0.0)})
    ),
    "excavator": lambda: gr.scenes.excavator(cell=0.02),
}
"""Cases of the figures, and others that show what results depend on."""


def series(*rows: np.ndarray, digits: int) -> list[list[float]]:
    """Rows of a table of time series or profiles."""
    return np.stack(rows).round(digits).tolist()


def tool(record: gr.Trajectory) -> dict:
    """Mean forces at depth, and their time series."""
    force = BladeForces.measured(record)
    rows = force.times, force.height, force.forward, force.vertical, force.lateral
    return force.means() | {"course": series(*rows, digits=4)}


def wheel(record: gr.Trajectory) -> dict:
    """Means over the second half of the time in which the wheel rolls."""
    rolling = Rolling.measured(record)
    names = "drawbar_pull", "load", "pull_over_load", "torque", "sinkage"
    rows = (getattr(rolling.history, name) for name in ("times", "drawbar_pull", "load", "sinkage"))
    return {name: getattr(rolling, name) for name in names} | {"course": series(*rows, digits=5)}


def couette(sim: gr.Simulation) -> dict:
    """Flow between cylinders at the top, per time window, and its quasi-static limit."""
    flow = CylinderFlow.measured(frames(sim))
    errors = flow.errors(flow.slow)
    course = [[one.time, *one.moments, *one.omega[: 2 * RINGS : 2]] for one in flow.windows]
    each = flow.errors(flow.slow, flow.each).max(axis=1)
    expected = np.interp(flow.r, flow.slow.r, flow.slow.omega)
    return {
        "error": float(errors.max()),
        "window_errors": each.round(5).tolist(),
        "mean_error": float(errors.mean()),
        "error_at_rate": float(flow.errors(flow.driven).max()),
        "mu_wall": flow.slow.mu_wall,
        "profile": series(flow.r, flow.omega, expected, digits=6),
        "course": series(*np.transpose(course), digits=6),
    }


def frames(sim: gr.Simulation) -> Iterator[gr.State]:
    """States of a run, which take too much space to be recorded."""
    yield sim.state
    for k in range(1, round(sim.scene.duration / EVERY) + 1):
        yield sim.run(until=k * EVERY).state


def recorded(sim: gr.Simulation, path: Path) -> dict:
    """Run a scene into a record, and measure its quantities of interest."""
    sim.run(save=path, every=EVERY, overwrite=True)
    with gr.open(path) as record:
        return wheel(record) if sim.scene.name == "wheel" else tool(record)


def run(name: str, records: Path) -> dict:
    """Run one case, and measure it."""
    scene = CASES[name]()
    sim = gr.Simulation(scene, threads=1)
    begin = time.process_time()
    records.mkdir(parents=True, exist_ok=True)
    flow = scene.name == "couette"
    result = couette(sim) if flow else recorded(sim, records / f"{name}.h5")
    seconds = time.process_time() - begin
    return {
        "points": sim.n_points,
        "cell": scene.grid.cell,
        "steps": sim.steps,
        "seconds": round(seconds, 1),
        "nanoseconds": round(1e9 * seconds / sim.steps / sim.n_points, 1),
        "dense": float(sim.state.dense.mean()),
        "health": sim.health().rows(),
        **result,
    }


def on_width(name: str, row: dict) -> BladeForces:
    """Forces of a row, scaled to the whole width if they are those of a blade between walls."""
    between = name.startswith(("thin", "narrow"))
    return BladeForces(*np.array(row["course"])).scaled(WIDTH / 0.05 if between else 1.0)


BLADES = {
    "0.305 m wide in a bin of 0.70 m, 6 mm thick": {
        "excavation_2": "2 cm deep",
        "excavation_5": "5 cm deep",
        "excavation_5_fine": "5 cm deep, cells of 8.33 mm",
        "excavation_5_whole": "5 cm, cells of 25 mm, whole width, irregular points",
    },
    "between walls, 6 mm thick": {
        "thin_2": "2 cm deep",
        "thin_5": "5 cm deep",
        "thin_5_local": "5 cm, A = 0",
        "thin_5_coarse": "5 cm, cells of 25 mm",
        "thin_5_fine": "5 cm, cells of 8.33 mm",
        "thin_5_local_fine": "5 cm, cells of 8.33 mm, A = 0",
        "thin_5_one": "5 cm, one point per cell",
        "thin_5_stiff": "5 cm, E = 1.5 MPa",
    },
    "between walls, 25 mm thick": {
        "narrow_2": "2 cm deep",
        "narrow_5": "5 cm deep",
        "narrow_5_local": "5 cm, A = 0",
        "narrow_5_no_length": "5 cm, A = 1e-6",
        "narrow_5_late": "5 cm, t0 = 0.1 ms",
        "narrow_5_drucker_prager": "5 cm, Drucker-Prager, mu = mu_s",
        "narrow_5_coarse_grains": "5 cm, d = 10 mm",
        "narrow_5_substeps": "5 cm, t0 = 0.1 ms, 8 substeps of the fluidity",
        "narrow_5_stiff": "5 cm, E = 1.5 MPa",
        "narrow_5_fine": "5 cm, cells of 8.33 mm",
        "narrow_5_local_fine": "5 cm, cells of 8.33 mm, A = 0",
        "narrow_5_drucker_prager_fine": "5 cm, cells of 8.33 mm, Drucker-Prager, mu = mu_s",
        "narrow_5_thick": "5 cm, 50 mm thick",
    },
}
FLOWS = {
    "couette_shallow_8": "24 mm high, cells of 8 mm = 2 d",
    "couette_shallow_6": "24 mm high, cells of 6 mm",
    "couette_shallow": "24 mm high, cells of 4 mm = d, the paper's",
    "couette": "100 mm high as in the paper, cells of 4 mm, 0.1 rad/s",
}


def tables(results: dict[str, Any]) -> dict[str, list[str]]:
    """Tables of the page."""
    blades: list[tuple[str, ...]] = []
    for group, cases in BLADES.items():
        blades.append((f"**{group}**", "", "", "", ""))
        for name, words in cases.items():
            if name not in results:
                continue
            force = on_width(name, results[name])
            mean, early = force.means(), [f"{one:.1f}" for one in force.arrival()]
            forward = f"{mean['forward']:.1f} ± {mean['deviation']:.1f}"
            vertical = f"{mean['vertical']:.1f}"
            blades.append((words, forward, early[0], vertical, early[1]))
    forces = ("forward", "forward as it arrives", "vertical", "vertical as it arrives")
    wheels = [
        wheel | {"slip": slip} for slip in (20, 40, 70) if (wheel := results.get(f"wheel_{slip}"))
    ]
    flows = [results[name] | {"words": words} for name, words in FLOWS.items() if name in results]
    against = (
        "largest error",
        "the same in single windows of 0.1 s",
        "mean error",
        "largest error against `couette_flow`",
    )
    errors = "{error:.3f}", "{single}", "{mean_error:.3f}", "{error_at_rate:.3f}"
    for row in flows:
        each = row.get("window_errors")
        row["single"] = f"{min(each):.3f} to {max(each):.3f}" if each else "-"
    return {
        "blades": markdown(("blade", *(f"{force} [N]" for force in forces)), blades),
        "wheels": table(
            [row | {"mm": 1e3 * row["sinkage"]} for row in wheels],
            {
                "slip": "{slip} %",
                "drawbar pull/load": "{pull_over_load:.3f}",
                "load [N]": "{load:.2f}",
                "torque [N m]": "{torque:.2f}",
                "sinkage [mm]": "{mm:.1f}",
            },
        ),
        "flows": table(
            flows, {"cell between cylinders": "{words}"} | dict(zip(against, errors, strict=True))
        ),
    }


def main(argv: list[str] | None = None) -> None:
    """Run the requested cases."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("names", nargs="*", metavar="CASE")
    parser.add_argument("--records", type=Path, default=RECORDS)
    chosen = parser.parse_args(argv)
    unknown = [name for name in chosen.names if name not in CASES]
    if unknown:
        parser.error(f"{unknown} must be among {list(CASES)}")
    for name in chosen.names:
        row = run(name, chosen.records)
        table = {"couette": "flows", "wheel": "wheels"}.get(CASES[name]().name, "blades")
        write(OUT, stored(OUT) | {name: row}, [table])
        print(name, {key: value for key, value in row.items() if key not in LONG}, flush=True)
    if not chosen.names:
        print("\n".join(CASES))

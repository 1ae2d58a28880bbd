"""Tools in soil at sizes that can be paid for: runs, records and the numbers of docs/three_d.md.

    python benchmarks/three_d.py wheel_20 excavation_5 --records build/three_d

Without names it lists the cases. Numbers go to benchmarks/results/three_d.json, case by case.
"""

from __future__ import annotations

import argparse
import json
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np

import granular as gr

RESULTS = Path(__file__).parent / "results" / "three_d.json"
RECORDS = Path("build/three_d")

SOFT = gr.materials.grc_1.replace(E=0.15e6)
PLASTIC = gr.materials.DruckerPrager(
    E=SOFT.E, nu=SOFT.nu, rho_c=SOFT.rho_c, rho_s=SOFT.rho_s, mu=SOFT.mu_s, elasticity="hencky"
)
KINDLED = gr.scenes.excavation().scheme
SUBSTEPS = KINDLED.replace(fluidity=KINDLED.fluidity.replace(substeps=8))
"""The step is six times the t0 of the fluidity."""
BED = {"length": 0.65, "width": 0.45, "start": 0.25, "travel": 0.1, "cell": 0.0125}
"""A bed that the wedge before the blade and the heaps beside it do not fill."""
BLADE = (0.025, 0.305, 0.457)
"""Two of these cells thick, and as thick in finer cells."""
NARROW = {"width": 0.05, "blade": (0.025, 0.05, 0.457)}
"""As between glass walls: a bed as wide as the blade, in which nothing depends on y."""
ROLL = {"length": 0.5, "start": 0.1625, "duration": 7.0}


def excavation(depth: float, **changes: object) -> gr.Scene:
    """Short of the way out: the force while it dives and goes forward."""
    scene = gr.scenes.excavation(**(BED | {"depth": depth, "blade": BLADE} | changes))
    down = depth / scene.parameters["dive_speed"]
    forward = scene.parameters["travel"] / scene.parameters["speed"]
    return scene.replace(duration=scene.parameters["settle"] + down + forward)


CASES: dict[str, Callable[[], gr.Scene]] = {
    **{
        f"wheel_{slip}": lambda slip=slip: gr.scenes.wheel(slip=slip / 100, **ROLL)
        for slip in (20, 40, 70)
    },
    "wheel_70_stiff": lambda: gr.scenes.wheel(
        slip=0.7, material=gr.materials.grc_1.replace(E=1.5e6), **ROLL
    ),
    "narrow_2": lambda: excavation(0.02, **NARROW),
    "narrow_5": lambda: excavation(0.05, **NARROW),
    "narrow_5_local": lambda: excavation(0.05, material=SOFT.replace(A=0.0), **NARROW),
    "narrow_5_coarse_grains": lambda: excavation(0.05, material=SOFT.replace(d=0.01), **NARROW),
    "narrow_5_drucker_prager": lambda: excavation(0.05, material=PLASTIC, **NARROW),
    "narrow_5_stiff": lambda: excavation(0.05, material=SOFT.replace(E=1.5e6), **NARROW),
    "narrow_5_thick": lambda: excavation(0.05, width=0.05, blade=(0.05, 0.05, 0.457)),
    "narrow_5_slow": lambda: excavation(0.05, speed=0.02, dive_speed=0.0125, **NARROW),
    "narrow_5_fine": lambda: excavation(0.05, cell=BED["cell"] / 1.5, **NARROW),
    "narrow_5_local_fine": lambda: excavation(
        0.05, cell=BED["cell"] / 1.5, material=SOFT.replace(A=0.0), **NARROW
    ),
    "narrow_5_substeps": lambda: excavation(0.05, scheme=SUBSTEPS, **NARROW),
    "narrow_5_finer": lambda: excavation(0.05, cell=BED["cell"] / 2, **NARROW),
    "excavation_2": lambda: excavation(0.02),
    "excavation_5": lambda: excavation(0.05),
    "excavator": lambda: gr.scenes.excavator(cell=0.02),
}


def tool(record: gr.Trajectory) -> dict:
    """Mean forces at depth, and the course of them."""
    force = gr.measure.tool_force(record, window=2)
    level = force.position[:, 2] < 0.99 * force.position[:, 2].min()
    return {
        "forward": float(force.forward[level].mean()),
        "vertical": float(force.vertical[level].mean()),
        "deviation": float(force.forward[level].std()),
        "course": np.stack([force.times, force.position[:, 2], force.forward, force.vertical])
        .round(4)
        .tolist(),
    }


def wheel(record: gr.Trajectory) -> dict:
    """Means over the second half of the time that it rolls."""
    history = gr.measure.wheel_history(record, window=2)
    late = history.times > (record.times[-1] + record.scene.parameters["settle"]) / 2
    load = float(history.load[late].mean())
    return {
        "drawbar_pull": float(history.drawbar_pull[late].mean()),
        "load": load,
        "pull_over_load": float(history.drawbar_pull[late].mean() / load),
        "torque": float(history.torque[late].mean()),
        "sinkage": float(history.sinkage[-1]),
        "course": np.stack([history.times, history.drawbar_pull, history.load, history.sinkage])
        .round(5)
        .tolist(),
    }


def run(name: str, records: Path) -> dict:
    """Run one case, and measure it."""
    scene = CASES[name]()
    sim = gr.Simulation(scene, threads=1)
    begin = time.process_time()
    records.mkdir(parents=True, exist_ok=True)
    path = records / f"{name}.h5"
    sim.run(save=path, every=0.05, overwrite=True)
    seconds = time.process_time() - begin
    row = {
        "points": sim.n_points,
        "cell": scene.grid.cell,
        "steps": sim.steps,
        "seconds": round(seconds, 1),
        "nanoseconds": round(1e9 * seconds / sim.steps / sim.n_points, 1),
        "dense": float(sim.state.dense.mean()),
        "health": sim.health().rows(),
    }
    with gr.open(path) as record:
        return row | (wheel(record) if scene.name == "wheel" else tool(record))


def main(argv: list[str] | None = None) -> None:
    """Run what is asked for."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("names", nargs="*", metavar="CASE")
    parser.add_argument("--records", type=Path, default=RECORDS)
    chosen = parser.parse_args(argv)
    unknown = [name for name in chosen.names if name not in CASES]
    if unknown:
        parser.error(f"{unknown} must be among {list(CASES)}")
    for name in chosen.names:
        row = run(name, chosen.records)
        known = json.loads(RESULTS.read_text()) if RESULTS.exists() else {}
        RESULTS.write_text(json.dumps(known | {name: row}, indent=1) + "\n")
        print(name, {key: value for key, value in row.items() if key != "course"}, flush=True)
    if not chosen.names:
        print("\n".join(CASES))


if __name__ == "__main__":
    main()

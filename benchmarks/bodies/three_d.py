"""Tools in soil at affordable sizes: runs, records and the numbers of docs/reports/three_d.md.

Without names it lists the cases. Numbers go to benchmarks/results/three_d.json, case by case.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from shared import RESULTS, markdown, stored, table, write

import granular as gr

OUT = RESULTS / "three_d.json"
RECORDS = Path("build/three_d")

SOFT = gr.scenes.excavation().material
PLASTIC = gr.materials.DruckerPrager(
    E=SOFT.E, nu=SOFT.nu, rho_c=SOFT.rho_c, rho_s=SOFT.rho_s, mu=SOFT.mu_s, elasticity="hencky"
)
BEADS = gr.scenes.couette().material
RECONNECTED = gr.scenes.wheel().scheme
SUBSTEPS = RECONNECTED.replace(fluidity=RECONNECTED.fluidity.replace(substeps=8))
LATE = SOFT.replace(t0=1e-4)
"""The t0 of the paper, of which the time step is six times as long: it takes substeps."""
BED = {"length": 0.65, "width": 0.7, "start": 0.25, "travel": 0.1, "cell": 0.0125}
"""Bed as wide as the paper's, and so long that the wedge before the blade does not fill it."""
BLADE = (0.025, 0.305, 0.457)
"""Blade two of these cells thick; it has the same thickness with finer cells."""
NARROW = {"width": 0.05, "blade": (0.025, 0.05, 0.457)}
"""Bed as wide as the blade, as between glass walls, in which nothing depends on y."""
SIDED = {"blade": (0.006, 0.305, 0.457), "scheme": gr.scenes.excavation().scheme}
"""Blade of the paper, with a scheme that separates the material on its two sides."""
THIN = SIDED | {"width": 0.05, "blade": (0.006, 0.05, 0.457)}
"""The same blade between walls."""
LOCAL = {"material": SOFT.replace(A=0.0)}
STIFF = {"material": SOFT.replace(E=1.5e6)}
FINE = {"cell": BED["cell"] / 1.5}
ROLL = {
    **{"length": 0.49, "width": 0.1925, "headroom": 0.0525, "cell": 0.00875},
    **{"start": 0.1625, "duration": 7.0},
}
"""Cells of a tenth of the soil's depth; the bed has the width of the paper to half a millimetre."""
WINDOW = 0.1
"""Time window over which the flow between cylinders is averaged [s]."""
RINGS = 3
"""Number of rings (every second one from the inner cylinder on) whose time series is stored."""


def excavation(depth: float, **changes: object) -> gr.Scene:
    """Scene without the way out, for the force while the blade dives and moves forward."""
    known = BED | {"depth": depth, "blade": BLADE, "scheme": RECONNECTED}
    scene = gr.scenes.excavation(**(known | changes))
    down = depth / scene.parameters["dive_speed"]
    forward = scene.parameters["travel"] / scene.parameters["speed"]
    return scene.replace(duration=scene.parameters["settle"] + down + forward)


WIDTH = 0.305
"""Width of the blade [m]; forces between walls 0.05 m apart are scaled to it."""
ARRIVED = 0.5
"""Time at depth over which forces with different cells are compared [s]."""
LONG = ("course", "profile")
"""Entries that are not printed."""
CASES: dict[str, Callable[[], gr.Scene]] = {
    **{
        f"wheel_{slip}": lambda slip=slip: gr.scenes.wheel(slip=slip / 100, **ROLL)
        for slip in (20, 40, 70)
    },
    "wheel_70_stiff": lambda: gr.scenes.wheel(slip=0.7, material=SOFT.replace(E=1.5e6), **ROLL),
    "thin_2": lambda: excavation(0.02, **THIN),
    "thin_5": lambda: excavation(0.05, **THIN),
    "thin_5_local": lambda: excavation(0.05, **THIN, **LOCAL),
    "thin_5_stiff": lambda: excavation(0.05, **THIN, **STIFF),
    "thin_5_fine": lambda: excavation(0.05, **THIN, **FINE),
    "thin_5_local_fine": lambda: excavation(0.05, **THIN, **LOCAL, **FINE),
    "narrow_2": lambda: excavation(0.02, **NARROW),
    "narrow_5": lambda: excavation(0.05, **NARROW),
    "narrow_5_local": lambda: excavation(0.05, **NARROW, **LOCAL),
    "narrow_5_coarse_grains": lambda: excavation(0.05, material=SOFT.replace(d=0.01), **NARROW),
    "narrow_5_no_length": lambda: excavation(0.05, material=SOFT.replace(A=1e-6), **NARROW),
    "narrow_5_late": lambda: excavation(0.05, material=LATE, **NARROW),
    "narrow_5_drucker_prager": lambda: excavation(0.05, material=PLASTIC, **NARROW),
    "narrow_5_stiff": lambda: excavation(0.05, **NARROW, **STIFF),
    "narrow_5_thick": lambda: excavation(0.05, width=0.05, blade=(0.05, 0.05, 0.457)),
    "narrow_5_slow": lambda: excavation(0.05, speed=0.02, dive_speed=0.0125, **NARROW),
    "narrow_5_fine": lambda: excavation(0.05, **NARROW, **FINE),
    "narrow_5_local_fine": lambda: excavation(0.05, **NARROW, **LOCAL, **FINE),
    "narrow_5_drucker_prager_fine": lambda: excavation(0.05, material=PLASTIC, **NARROW, **FINE),
    "narrow_5_substeps": lambda: excavation(0.05, material=LATE, scheme=SUBSTEPS, **NARROW),
    "narrow_5_finer": lambda: excavation(0.05, cell=BED["cell"] / 2, **NARROW),
    "thin_5_one": lambda: excavation(0.05, points_per_cell=1, **THIN),
    "thin_5_coarse": lambda: excavation(0.05, cell=BED["cell"] * 2, **THIN),
    "excavation_2": lambda: excavation(0.02, **SIDED),
    "excavation_5": lambda: excavation(0.05, **SIDED),
    "excavation_5_fine": lambda: excavation(0.05, **SIDED, **FINE),
    "excavation_5_whole": lambda: excavation(
        0.05, half=False, cell=BED["cell"] * 2, jitter=0.5, **SIDED
    ),
    "couette": lambda: gr.scenes.couette(omega=0.1, duration=1.1),
    "couette_shallow": lambda: gr.scenes.couette(height=0.024, duration=1.0),
    "couette_shallow_8": lambda: gr.scenes.couette(height=0.024, duration=0.7, cell=0.008),
    "couette_shallow_6": lambda: gr.scenes.couette(height=0.024, duration=0.7, cell=0.006),
    "couette_shallow_local": lambda: gr.scenes.couette(
        height=0.024, duration=0.5, material=BEADS.replace(A=0.0)
    ),
    "excavator": lambda: gr.scenes.excavator(cell=0.02),
}


def series(*rows: np.ndarray, digits: int) -> list[list[float]]:
    """Rows of a table of time series or profiles."""
    return np.stack(rows).round(digits).tolist()


def tool(record: gr.Trajectory) -> dict:
    """Mean forces at depth, and their time series."""
    force = gr.measure.soil_tools.tool_force(record, window=2)
    height, deepest = force.position[:, 2], force.position[:, 2].min()
    level = height - deepest < 0.01 * abs(deepest)
    parts = {name: getattr(force, name) for name in ("forward", "vertical", "lateral")}
    return {name: float(part[level].mean()) for name, part in parts.items()} | {
        "deviation": float(force.forward[level].std()),
        "lateral_deviation": float(force.lateral[level].std()),
        "course": series(force.times, height, *parts.values(), digits=4),
    }


def wheel(record: gr.Trajectory) -> dict:
    """Means over the second half of the time in which the wheel rolls."""
    history = gr.measure.soil_tools.wheel_history(record, window=2)
    late = history.times > (record.times[-1] + record.scene.parameters["settle"]) / 2
    load = float(history.load[late].mean())
    return {
        "drawbar_pull": float(history.drawbar_pull[late].mean()),
        "load": load,
        "pull_over_load": float(history.drawbar_pull[late].mean() / load),
        "torque": float(history.torque[late].mean()),
        "sinkage": float(history.sinkage[-1]),
        "course": series(
            history.times, history.drawbar_pull, history.load, history.sinkage, digits=5
        ),
    }


def couette(sim: gr.Simulation) -> dict:
    """Flow between cylinders at the top, per time window, and its quasi-static limit."""
    scene, pair, windows = sim.scene, [], []
    size = scene.parameters
    top = size["height"] - 2 * scene.grid.cell

    def look(sim: gr.Simulation) -> None:
        pair.append((sim.state, sim.bodies))
        if len(pair) == 2:
            windows.append(window(pair, top))
            del pair[0]

    sim.run(every=WINDOW, hooks=(look,))
    material = scene.material
    gap = (size["inner"], size["outer"], material.replace(A=material.A or BEADS.A))
    flow = gr.theory.couette_quasi_static(*gap, walls="smooth")
    # Pressure in the middle of the evaluated layer.
    state = {"rate": size["omega"], "pressure": material.rho_c * size["gravity"] * scene.grid.cell}
    driven = gr.theory.couette_flow(*gap, **state, walls="smooth")
    course = [[one["time"], *one["moments"], *one["omega"][: 2 * RINGS : 2]] for one in windows]
    late = windows[-(len(windows) // 3) :]
    r = late[0]["r"]
    omega = np.mean([one["omega"] for one in late], axis=0) / size["omega"]
    expected, at_rate = (np.interp(r, known.r, known.omega) for known in (flow, driven))

    def off(omega: np.ndarray, known: np.ndarray) -> np.ndarray:
        """Error of the speed of each ring, over that of the wall."""
        return np.abs(omega - known) * r / size["inner"]

    each = [off(one["omega"] / size["omega"], expected).max() for one in late]
    return {
        "error": float(off(omega, expected).max()),
        "window_errors": [round(float(error), 5) for error in each],
        "mean_error": float(off(omega, expected).mean()),
        "error_at_rate": float(off(omega, at_rate).max()),
        "mu_wall": flow.mu_wall,
        "profile": series(r, omega, expected, digits=6),
        "course": series(*np.transpose(course), digits=6),
    }


def window(pair: list, top: float) -> dict:
    """Rings of one window, and the moments on both cylinders."""
    (before, earlier), (after, later) = pair
    profile = gr.measure.cylinder_profile((before, after), above=top)
    moments = [
        (now.angular_impulse - then.angular_impulse)[2] / (after.time - before.time)
        for then, now in zip(earlier, later, strict=True)
    ]
    return {"time": after.time, "r": profile.r, "omega": profile.omega, "moments": moments}


def recorded(sim: gr.Simulation, path: Path) -> dict:
    """Run a scene into a record, and measure its quantities of interest."""
    sim.run(save=path, every=0.05, overwrite=True)
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


def scale(name: str) -> float:
    """Factor from the force on a blade between walls to that on the whole width."""
    return WIDTH / 0.05 if name.startswith(("thin", "narrow")) else 1.0


def arrival(row: dict) -> tuple[float, float]:
    """Mean forward and vertical force just after the blade has reached its depth [N]."""
    times, height, forward, vertical, *_ = np.array(row["course"])
    level = height < 0.99 * height.min()
    early = level & (times < times[level][0] + ARRIVED)
    return float(forward[early].mean()), float(vertical[early].mean())


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
            row, factor = results[name], scale(name)
            early = [f"{factor * force:.1f}" for force in arrival(row)]
            forward = f"{factor * row['forward']:.1f} ± {factor * row['deviation']:.1f}"
            vertical = f"{factor * row['vertical']:.1f}"
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

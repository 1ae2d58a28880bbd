"""Do the intervals of `granular.economy.answer` contain what is known by theory or costly runs?

The known values are not used to make the intervals: they are exact, or means of runs in cells four
times finer than those of the answer's first run, with other points and four times its E. Forces on
bodies that are pushed into a bed depend more on E, and less on the cells: there it is 64 times the
E in cells twice as fine.
"""

from __future__ import annotations

import tempfile
import time
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from shared import markdown, parser_of, stored, write

import granular as gr
from granular.economy.quantities import QUANTITIES
from granular.economy.variants import Variants

TOLERANCE, BUDGET = 0.03, 30.0
SEEDS = (1, 2, 3)
"""Of the costly runs."""

Measure = Callable[[gr.record.Trajectory], float]


@dataclass(frozen=True)
class Case:
    """A number: its scene in coarse cells, its measure, and its exact value if there is one.

    Else it is known from runs with E times `stiffer` in cells `finer` times as fine.
    """

    scene: Callable[..., gr.Scene] | gr.Scene
    measure: str | Measure
    exact: float | None = None
    finer: int = 4
    stiffer: float = 4.0


def mean_height(record: gr.record.Trajectory) -> float:
    """Height of the centre of mass at the end [m]."""
    last = record[-1]
    return float(np.average(last.x[:, -1], weights=last.mass))


def mean_distance(record: gr.record.Trajectory) -> float:
    """Mean distance of the mass from the axis or plane x = 0 at the end [m]."""
    last = record[-1]
    return float(np.average(last.x[:, 0], weights=last.mass))


def late_force(record: gr.record.Trajectory, axis: int, share: float = 0.25) -> float:
    """Mean force on the first body over the last part of a run [N]."""
    force = gr.measure.body_force(record)
    late = force.times > (1.0 - share) * force.times[-1]
    return float(force.force[late, axis].mean())


def depth(record: gr.record.Trajectory) -> float:
    """Height of the first body at the end [m]."""
    return float(gr.measure.body_motion(record).position[-1, -1])


def slope_of_drum(record: gr.record.Trajectory) -> float:
    """Slope of the surface in a drum, over the last half of a run [deg]."""
    states = [record[k] for k in range(len(record) // 2, len(record))]
    return float(gr.measure.drum_flow(states).slope_deg)


def layer(cell: float = 0.0625, seed: int = 0) -> gr.Scene:
    """An elastic layer whose gravity grows: horizontal stress nu/(1 - nu) of the vertical one."""
    if abs(1.0 / cell - round(1.0 / cell)) > 1e-9:
        raise ValueError(f"cell = {cell} must divide 1 m")
    return gr.Scene(
        name="layer",
        grid=gr.Grid((0.0, 0.0), cell, (round(1.0 / cell), round(1.25 / cell)), (True, False)),
        fills=(gr.Fill(gr.Box((0.0, 0.0), (1.0, 1.0)), 4, jitter=0.1),),
        walls=(gr.Wall(1, 0.0, kind="free_slip"),),
        material=gr.materials.Elastic(E=1e6, nu=0.3, rho_c=1500.0),
        gravity=gr.Gravity((0.0, 1.0), ((0.0, 0.0), (0.0, -9.8))),
        duration=2.0,
        seed=seed,
    )


def mean_pressure(record: gr.record.Trajectory) -> float:
    """Mean horizontal stress of a layer at the end [Pa]."""
    last = record[-1]
    return float(np.average(-last.stress[:, 0], weights=last.mass / last.density))


def column(**numbers: Any) -> gr.Scene:
    """A coarse column of soft grains."""
    return gr.scenes.column_collapse(**{"E": 1e6, "points_per_cell": 4, "jitter": 0.1} | numbers)


def hopper(**numbers: Any) -> gr.Scene:
    """A coarse hopper that is open from the start."""
    usual = {"cell": 0.02, "width": 0.48, "fill_height": 0.48, "angle_deg": 45.0, "E": 1e6}
    return gr.scenes.hopper(**usual | {"opens_at": 0.0, "duration": 0.6, "jitter": 0.1} | numbers)


def incline(angle_deg: float, height: float) -> Case:
    """A layer that accelerates down a slope, and its mean speed by the 1-D equation."""
    scene = gr.scenes.incline(
        angle_deg=angle_deg, height=height, cell=height / 8, columns=4, duration=1.0, E=1e6,
        jitter=0.1,
    )  # fmt: skip
    rigid = scene.material.replace(E=1e9)
    exact = gr.theory.transient(angle_deg, height, rigid, [1.0], 9.8, 0.1).mean[-1]
    return Case(scene, "mean_speed", float(exact))


def cases() -> dict[str, Case]:
    """The numbers, by their names."""
    S = gr.scenes
    wall = partial(S.retaining_wall, cell=0.125, jitter=0.1)
    clay = gr.DruckerPrager(E=1e8, mu=0.02, cohesion=2e4, tensile_strength=2e4, rho_c=1600.0)
    K0 = 0.3 / 0.7
    known = {
        "speed of a layer at 24 degrees": incline(24.0, 0.2),
        "speed of a layer at 27 degrees": incline(27.0, 0.1),
        "horizontal stress in an elastic layer": Case(layer, mean_pressure, K0 * 0.5 * 1500 * 9.8),
        "run-out, aspect 1.5": Case(column(aspect=1.5, cell=0.0125, duration=1.3), "runout"),
        "run-out, aspect 1": Case(column(aspect=1.0, cell=0.0125, duration=1.2), "runout"),
        "run-out, aspect 2": Case(column(aspect=2.0, cell=0.0125, duration=1.5), "runout"),
        "height, aspect 0.5": Case(column(aspect=0.5, cell=0.01, duration=1.0), "height"),
        "height, aspect 1": Case(column(aspect=1.0, cell=0.02, duration=1.2), "height"),
        "centre of mass, aspect 1": Case(column(cell=0.02, duration=1.2), mean_height),
        "centre of mass, aspect 2": Case(column(aspect=2.0, cell=0.025, duration=1.5), mean_height),
        "mean distance, aspect 1": Case(column(cell=0.02, duration=1.2), mean_distance),
        "speed while falling, aspect 1": Case(column(cell=0.02, duration=0.3), "mean_speed"),
        "rate of a plane hopper": Case(hopper(orifice=0.16), "discharge"),
        "rate of a plane hopper, steep": Case(hopper(orifice=0.2, angle_deg=20.0), "discharge"),
        "rate of a conical hopper": Case(
            hopper(orifice=0.24, axisymmetric=True, points_per_cell=16), "discharge"
        ),
    }
    cylinder = partial(S.cylinder_collapse, axisymmetric=True, cell=0.02, jitter=0.1, E=1e6)
    known |= {
        "height of a cylinder": Case(cylinder(duration=1.2), "height"),
        "mean radius of a cylinder": Case(cylinder(duration=1.2), mean_distance),
        "depth of a sphere": Case(
            S.sphere_drop(axisymmetric=True, jitter=0.1), depth, finer=2, stiffer=64.0
        ),
        "force on a ball pushed in": Case(
            S.penetration(axisymmetric=True, cell=0.016, jitter=0.1),
            partial(late_force, axis=1),
            finer=2,
            stiffer=64.0
        ),
        "passive force on a wall": Case(
            wall(speed=0.04, travel=0.03),
            partial(late_force, axis=0, share=0.2),
            exact=-3.0 * 0.5 * 1600.0 * 9.8,  # Rankine, of 1 m
        ),
        "pressure on a footing on clay": Case(
            S.footing(
                material=clay, length=3.0, soil=2.0, cell=0.0625, speed=0.02, settlement=0.02,
                jitter=0.1,
            ),
            partial(late_force, axis=1, share=0.2),
            finer=2,
        ),
    }  # fmt: skip
    return known


def costly(case: Case) -> dict[str, Any]:
    """Mean and scatter of the costly runs of a case."""
    variants = Variants(case.scene)
    measure: Any = QUANTITIES.get(case.measure, case.measure)
    values, begin = [], time.process_time()
    with tempfile.TemporaryDirectory() as folder:
        for seed in SEEDS:
            scene = variants.scene(variants.cell / case.finer, 1.0 / case.stiffer, seed)
            path = Path(folder, f"{seed}.h5")
            gr.Simulation(scene, threads=1).run(save=path)
            with gr.open(path) as record:
                values.append(measure(record))
    return {
        "known": float(np.mean(values)),
        "scatter": float(np.std(values, ddof=1)),
        "core_seconds": time.process_time() - begin,
    }


def answer_of(case: Case) -> dict[str, Any]:
    """The answer of a case."""
    answer = gr.economy.answer(
        case.scene,
        case.measure,
        tolerance=TOLERANCE,
        budget=BUDGET,
        rigid=True,  # known values are of stiff grains, and of small strains of a solid
        threads=1,
        progress=False,
    )
    finest = min(answer.samples, key=lambda sample: sample.cell)
    names = ("value", "uncertainty", "of_cells", "of_stiffness", "of_scatter", "reached")
    return {name: getattr(answer, name) for name in names} | {
        "runs": len(answer.samples),
        "suspect": len(answer.suspect),
        "core_seconds": answer.core_seconds,
        "of_the_finest": answer.core_seconds / finest.core_seconds,
        "samples": [vars(sample) for sample in answer.samples],
    }


def tables(results: dict[str, Any]) -> dict[str, list[str]]:
    """Table of the page."""
    lines = []
    for name, row in results["rows"].items():
        known, answer = row["known"], row["answer"]
        off = (answer["value"] - known["known"]) / answer["uncertainty"]
        lines.append([
            name,
            f"{answer['value']:.4g} ± {answer['uncertainty']:.2g}",
            f"{known['known']:.4g}" + (f" ± {known['scatter']:.1g}" if known["scatter"] else ""),
            f"{off:.2f}",
            f"{100 * answer['uncertainty'] / abs(answer['value']):.1f}",
            f"{answer['runs']}",
            f"{answer['of_the_finest']:.1f}",
        ])  # fmt: skip
    head = ("number", "answer", "known", "difference / uncertainty", "uncertainty [%]", "runs")
    return {"numbers": markdown((*head, "cost, over that of the finest run"), lines)}


def main(argv: list[str] | None = None) -> None:
    """Find the numbers that the results lack."""
    parser = parser_of(__name__, __doc__, "the layers on slopes alone")
    parser.add_argument("--only", nargs="*", help="names of numbers")
    chosen = parser.parse_args(argv)
    rows = stored(chosen.out, rows={})["rows"]
    wanted = cases()
    if chosen.quick:
        wanted = {name: case for name, case in wanted.items() if "layer at" in name}
    for name, case in wanted.items():
        if name in rows or (chosen.only and name not in chosen.only):
            continue
        answer = answer_of(case)
        known = (
            costly(case)
            if case.exact is None
            else {"known": case.exact, "scatter": 0.0, "core_seconds": 0.0}
        )
        rows[name] = {"answer": answer, "known": known}
        print(name, answer["value"], answer["uncertainty"], known, flush=True)
        write(chosen.out, {"rows": rows})
    print("\n".join(tables({"rows": rows})["numbers"]))
    inside = [
        abs(r["answer"]["value"] - r["known"]["known"]) <= r["answer"]["uncertainty"]
        for r in rows.values()
    ]
    widths = [r["answer"]["uncertainty"] / abs(r["answer"]["value"]) for r in rows.values()]
    print(f"{sum(inside)} of {len(inside)} inside, median width {np.median(widths):.3f}")


if __name__ == "__main__":
    main()

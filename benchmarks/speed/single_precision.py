"""Single precision compared with double precision: time, and error compared with the scheme.

Each case runs in double and in single precision, and once more in double precision with cells twice
as large. The change of the quantity of a case by single precision is compared with the error of the
scheme: the difference from theory, or the change by the larger cells. The time is the processor
time of steps in turns, double, single, single, double, with one thread; its ratio is the median
over the rounds. Stiffness enlarges the rounding errors of stress: the incline runs with several E.

The picture of docs/reports/speed.md is drawn from the results with --draw,
which measures nothing.
"""

from __future__ import annotations

import json
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any, NamedTuple

import matplotlib.pyplot as plt
import numpy as np
from shared import PICTURES, RESULTS, by_scheme, parser_of, rounded, table, write

import granular as gr
from granular.verify.incline import mean_speed

OUT = RESULTS / "single_precision.json"
PICTURE = PICTURES / "single_precision.png"
SCHEMES = {
    "default": gr.schemes.default,
    "APIC": gr.Scheme(transfer="apic", density=gr.ParticleDensity()),
}


def of_theory(sim: gr.Simulation) -> float:
    """Mean speed at the points by the equation of an incline [m/s]."""
    given, state = sim.scene.parameters, sim.state
    layer = given["angle_deg"], given["height"], sim.scene.material
    exact = gr.theory.transient(*layer, [sim.time], 9.8, ramp=given["ramp"])
    v = np.interp(state.x[:, 1], np.r_[0.0, exact.y], np.r_[0.0, np.ravel(exact.v)])
    return float(np.average(v, weights=state.mass))


def front(sim: gr.Simulation) -> float:
    """Mean position of a collapsed column [m]."""
    state = sim.state
    return float(np.average(np.abs(state.x[:, 0]), weights=state.mass))


def outflow(sim: gr.Simulation) -> float:
    """Mass that has left a silo [kg]."""
    return float(gr.Simulation(sim.scene).state.mass.sum() - sim.state.mass.sum())


class Case(NamedTuple):
    """A scene of a scheme and a number of cells, its quantity, and the theory of this."""

    scene: Callable[[gr.Scheme, float], gr.Scene]
    until: float
    cell: float
    quantity: Callable[[gr.Simulation], float]
    theory: Callable[[gr.Simulation], float] | None = None
    schemes: tuple[str, ...] = ("default",)


def of_beads(
    function: Callable[..., gr.Scene], E: float, **keywords: Any
) -> Callable[[gr.Scheme, float], gr.Scene]:
    """Scene of softer glass beads by its scheme and cell."""
    material = gr.materials.glass_beads.replace(E=E)
    return lambda scheme, cell: function(cell=cell, material=material, scheme=scheme, **keywords)


def speed_of(sim: gr.Simulation) -> float:
    """Mean velocity of a layer [m/s]."""
    return mean_speed(sim.state)


def chute(scheme: gr.Scheme, cell: float) -> gr.Scene:
    """Chute of the nonlocal law at 27 deg."""
    return gr.scenes.chute_ngf(cell=cell, columns=8, scheme=scheme)


CASES = {
    **{
        f"incline of 25 deg, E = {E / 1e6:g} MPa": Case(
            of_beads(gr.scenes.incline, E, columns=8), 2.0, 0.01, speed_of, of_theory
        )
        for E in (1e6, 1e8)
    },
    "column collapse": Case(
        of_beads(gr.scenes.column_collapse, 1e7, aspect=2.0), 1.2, 0.0125, front
    ),
    "cylinder collapse, 3D": Case(
        of_beads(gr.scenes.cylinder_collapse, 1e6, aspect=1.0), 0.8, 0.025, front
    ),
    "silo": Case(of_beads(gr.scenes.silo, 1e6), 1.0, 0.0125, outflow),
    "chute, nonlocal law": Case(chute, 1.0, 0.001, speed_of, None, tuple(SCHEMES)),
}


def ratio_of_times(case: Case, scheme: gr.Scheme, rounds: int) -> float:
    """Time of a step in single precision over that in double precision, from the moving state."""
    scenes = [case.scene(s, case.cell) for s in (scheme, scheme.replace(precision="single"))]
    sims = [gr.Simulation(scene, threads=1).run(until=0.2, monitor=False) for scene in scenes]
    steps = max(1, round(2e6 / sims[0].n_points))
    spent = []
    for _ in range(rounds):
        took = [0.0, 0.0]
        for which in (0, 1, 1, 0):
            begin = time.process_time()
            sims[which].step(steps)
            took[which] += time.process_time() - begin
        spent.append(took[1] / took[0])
    return float(np.median(spent))


def measured(case: Case, scheme: gr.Scheme, quick: bool) -> dict[str, float]:
    """Quantities of a case in both precisions, their difference and the error of the scheme."""
    until = 0.1 * case.until if quick else case.until
    single = scheme.replace(precision="single")
    runs = [
        gr.Simulation(case.scene(s, cell)).run(until=until, monitor=False)
        for s, cell in ((scheme, case.cell), (single, case.cell), (scheme, 2 * case.cell))
    ]
    double, other, coarse = (case.quantity(sim) for sim in runs)
    exact = case.theory(runs[0]) if case.theory else coarse
    return {
        "double": double,
        "single": other,
        "change": abs(other / double - 1.0),
        "error": abs(double / exact - 1.0),
        "time": ratio_of_times(case, scheme, 3 if quick else 9),
    }


def tables(results: dict[str, Any]) -> dict[str, list[str]]:
    """Table of the page."""
    columns = {"case": "{case}", "scheme": "{scheme}", "change by single precision": "{change:.1e}"}
    columns |= {"error of the scheme": "{error:.1e}", "time, ratio": "{time:.2f}"}
    return {"single precision": table(by_scheme(results["cases"]), columns)}


def draw(results: dict[str, dict[str, dict[str, float]]], path: Path) -> None:
    """Draw error and change against time, both relative to double precision."""
    figure, axes = plt.subplots(figsize=(6.4, 3.8), layout="constrained")
    names = [(case, scheme) for case in results for scheme in results[case]]
    for k, (case, scheme) in enumerate(names):
        row, color = results[case][scheme], f"C{k}"
        label = case if scheme == "default" else f"{case}, {scheme}"
        axes.plot([1.0, row["time"]], [row["error"]] * 2, "-", color=color, lw=1)
        axes.plot(1.0, row["error"], "s", color=color)
        axes.plot(row["time"], row["error"], "o", color=color, label=label)
        axes.plot(row["time"], row["change"], "v", color=color, mfc="none")
    axes.plot([], [], "s", color="0.4", label="double precision")
    axes.plot([], [], "o", color="0.4", label="single precision")
    axes.plot([], [], "v", color="0.4", mfc="none", label="change by single precision")
    axes.set(yscale="log", xlim=(0.0, 1.1), xlabel="time of a step over that in double precision")
    axes.set(ylabel="relative error, relative change")
    axes.legend(loc="center left")
    figure.savefig(path)


def main() -> None:
    parser = parser_of(__name__, __doc__)
    parser.add_argument("--only", nargs="+", choices=CASES, default=list(CASES))
    parser.add_argument("--draw", action="store_true", help="draw the results, run nothing")
    arguments = parser.parse_args()
    if arguments.draw:
        draw(json.loads(OUT.read_text())["cases"], PICTURE)
        return
    results: dict[str, Any] = {}
    for name in arguments.only:
        case = CASES[name]
        results[name] = {
            s: rounded(measured(case, SCHEMES[s], arguments.quick), 8) for s in case.schemes
        }
        print(name, results[name], flush=True)
        write(arguments.out, {"cases": results})
    print(*tables({"cases": results})["single precision"], sep="\n")

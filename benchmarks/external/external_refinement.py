"""Cells, points, stiffness and method in the cases of `granular verify --external`: tables.

A study that is run replaces its rows in the file of results. `--quick` makes the first run of each
study.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Iterator
from itertools import product
from typing import Any

import numpy as np
from shared import parser_of, run_studies, table

from granular import theory
from granular.mpm import schemes
from granular.verify.external import bagnold, columns, hstop, shallow
from granular.verify.external.frame import Data, load

Row = dict[str, Any]


def timed(run: Callable[..., Any], *arguments: Any, **named: Any) -> tuple[Any, float]:
    """Result of a call and the processor time that it took [s]."""
    begin = time.process_time()
    result = run(*arguments, **named)
    return result, time.process_time() - begin


# ---- columns of discs ----

DISCS = [
    (aspect, cells, name, 16, 1e3)
    for aspect in (0.5, 1.42, 6.26)
    for name in ("default", "cell_averaged")
    for cells in (8, 16, 32)
] + [
    (0.5, 16, "default", 4, 1e3), (0.5, 16, "default", 16, 1e4), (0.5, 16, "cell_averaged", 4, 1e3),
    (1.42, 16, "default", 4, 1e3), (1.42, 16, "default", 16, 1e4),
    (6.26, 16, "default", 4, 1e3), (6.26, 16, "cell_averaged", 4, 1e3),
    (6.26, 32, "cell_averaged", 4, 1e3),
]  # fmt: skip
"""Aspect ratio, cells, scheme, points in a cell, E/(rho g H)."""


def compared(data: columns.Discs, deposit: Row) -> Row:
    """Differences of a deposit from the deposit of the discs."""
    return {
        "L1": deposit["L1"],
        "mean": deposit["mean"] / data.facts["xm"][-1] - 1.0,
        "energy": deposit["energy"] / data.facts["pe"][-1] - 1.0,
        "foot": deposit["foot"] / data.foot - 1.0,
        "runout_99": deposit["runout"][0] / data.runout("q99") - 1.0,
        "runout": deposit["runout"][1] / data.runout() - 1.0,
    }


def volume_of_fluid(data: columns.Discs) -> Iterator[Row]:
    """Rows of the runs of the same law by another method, from the file of the package."""
    known = load("lagree2011_mui_basilisk")
    mine = known["a_nominal"] == data.aspect
    for cells in sorted(set(known["cells"][mine])):
        here = mine & (known["cells"] == cells)
        deposit = data.of_deposit(known["x_over_H"][here], known["h_over_H"][here])
        yield {"aspect": data.aspect, "method": "volume of fluid", "cells": cells} | compared(
            data, deposit
        )


def discs(quick: bool) -> Iterator[Row]:
    """Deposits of the columns of discs."""
    runs = DISCS[:1] if quick else DISCS
    for aspect in sorted({run[0] for run in runs}):
        data = columns.Discs.load(aspect)
        for _, cells, name, points, stiffness in (run for run in runs if run[0] == aspect):
            deposit, seconds = timed(
                columns.collapse_of_discs, data, cells, columns.SCHEMES[name],
                points=points, stiffness=stiffness,
            )  # fmt: skip
            last = deposit | {"mean": deposit["mean"][-1], "energy": deposit["energy"][-1]}
            label = {"aspect": aspect, "method": name, "cells": cells, "points": points}
            yield label | {"stiffness": stiffness, "seconds": seconds} | compared(data, last)
        yield from volume_of_fluid(data)


PLACES = [
    (name, {"jitter": 0.3, "seed": seed} if seed else {})
    for name in ("default", "cell_averaged")
    for seed in range(4)
]
"""Scheme, and random positions of the points at the start."""


def places(quick: bool) -> Iterator[Row]:
    """Run-outs of the column of a = 0.5 in 32 cells by the initial positions of its points."""
    data = columns.Discs.load(0.5)
    for name, numbers in PLACES[:1] if quick else PLACES:
        cells = 8 if quick else 32
        deposit, _ = timed(columns.collapse_of_discs, data, cells, columns.SCHEMES[name], **numbers)
        last = deposit | {"mean": deposit["mean"][-1], "energy": deposit["energy"][-1]}
        changed = "random, seed {seed}".format(**numbers) if numbers else "regular"
        yield {"method": name, "places": changed} | compared(data, last)


# ---- bars ----

BARS = [
    (name, cell, points, "tan")
    for name in ("default", "cell_averaged")
    for cell, points in ((0.01, 16), (0.005, 16), (0.004, 16), (0.0025, 4))
] + [("default", 0.004, 16, "sin")]
"""Scheme, cell [m], points in a cell, meaning of the angle of friction."""

HEIGHTS = {"bar": 1.0, "bars_2": 2.0, "bars_3": 3.0}
"""Heights at which the positions of the surface are compared, in bars."""

MOVES = {"line_05": 0.5e-3, "line_1": 1e-3, "line_2": 2e-3, "line_4": 4e-3}
"""Displacements beyond which a point counts as moved [m]."""


def bars(quick: bool) -> Iterator[Row]:
    """Surface, foot and failure line of the column of bars; the experiment's foot first."""
    surface, line = load("bui2008_surface"), load("bui2008_failure")
    x, y = surface["x_m"], surface["y_m"]
    feet = {name: columns.toe(x, y, k * columns.BAR) for name, k in HEIGHTS.items() if k > 1}
    feet |= {"foot": columns.foot(x, y, columns.BAR), "bar": float(x.max())}
    yield {"method": "experiment"} | feet
    for name, cell, points, mu in BARS[:1] if quick else BARS:
        friction = {"sin": math.sin, "tan": math.tan}[mu](columns.PHI)
        heap, seconds = timed(
            columns.collapse_of_bars, friction, cell, columns.SCHEMES[name], points_per_cell=points
        )
        row = {"method": name, "mu": f"{mu} phi", "cell": 1e3 * cell, "points": points}
        yield row | held(heap, surface, line) | {"seconds": seconds}


def held(heap: columns.Heap, surface: Data, line: Data) -> Row:
    """Differences of a heap from the experiment, and its foot."""
    row = {"surface": 1e3 * heap.miss(surface)}
    row |= {name: heap.toe(k * columns.BAR) for name, k in HEIGHTS.items()}
    row["foot"] = heap.foot()
    row["far"] = float(np.quantile(heap.state.x[:, 0], 0.999))
    return row | {name: 1e3 * heap.line(line, moved)[1] for name, moved in MOVES.items()}


UNDAMPED = schemes.cell_averaged.replace(density=schemes.CellAveragedDensity(slow_decay=0.0))
CAUSES: dict[str, Row] = {
    "nothing": {},
    **{
        f"random positions of the points, seed {seed}": {"jitter": 0.3, "seed": seed}
        for seed in range(1, 5)
    },
    "ten times as stiff": {"E": 8.4e6},
    "a quarter as stiff": {"E": 0.21e6},
    "friction of the floor tan phi": {"floor": math.tan(columns.PHI)},
    "friction that grows with the rate": {"rate": True},
    "no damping of slow flow": {"scheme": UNDAMPED},
    "no damping, ten times as stiff": {"scheme": UNDAMPED, "E": 8.4e6},
}
"""Changes of a run by the cell-averaged density in cells of 4 mm with 16 points."""


def causes(quick: bool) -> Iterator[Row]:
    """Foot of the column of bars by positions of points, stiffness, floor, rate and damping."""
    surface, line = load("bui2008_surface"), load("bui2008_failure")
    given = {"mu": math.tan(columns.PHI), "cell": 0.004, "scheme": schemes.cell_averaged}
    for changed, numbers in list(CAUSES.items())[: 1 if quick else None]:
        heap = columns.collapse_of_bars(**(given | numbers))
        yield {"changed": changed} | held(heap, surface, line)


# ---- dam break ----

DAMS = [(10, 4.5e-3), (10, 1e-3), (10, 2.5e-4), (20, 4.5e-3), (20, 1e-3)]
"""Cells over the thickness, weight over modulus."""

TIMES = (6.0, 9.0, 15.0)
"""In sqrt(h0/g)."""


def dams(quick: bool) -> Iterator[Row]:
    """Errors of the dam break in time, for each softness."""
    mu = 0.6
    K = theory.sliding_earth_pressure(mu, shallow.DAM["mu"])
    for cells, softness in DAMS[:1] if quick else DAMS:
        wave, seconds = timed(shallow.dam, mu, K, cells, TIMES, softness)
        for scaled, errors in zip(TIMES, shallow.errors(wave), strict=True):
            row = dict(zip(shallow.TOLERANCES, errors.tolist(), strict=True))
            label = {"cells": cells, "softness": softness, "time": scaled}
            yield label | row | {"seconds": seconds}


# ---- steady layers ----

LAYERS = [(cells, name) for name in bagnold.SCHEMES for cells in (5, 10, 20)]
"""Cells over the height, scheme."""


def layers(quick: bool) -> Iterator[Row]:
    """Error of the profile of Bagnold at 0.43 rad, and the order between two rows."""
    data = load("bagnold_mui_analytic")
    before: dict[str, float] = {}
    for cells, name in LAYERS[:1] if quick else LAYERS:
        errors, seconds = timed(bagnold.layer_errors, data, 0.43, cells, bagnold.SCHEMES[name])
        row = {"method": name, "cells": cells, "speed": errors[0], "profile": errors[1]}
        if name in before:
            row["order"] = math.log2(before[name] / errors[1])
        before[name] = errors[1]
        yield row | {"seconds": seconds}


# ---- nonlocal law ----

LIMITS, SHARES = (0.6435, 0.9, 1.2, 1.5), (0.25, 0.5, 0.75)
"""Limits mu_2 of the friction, and positions of the slope between mu_s and mu_2."""


def near_limit(quick: bool) -> Iterator[Row]:
    """Mean speed of nonlocal layers of three stopping heights, by the limit of the friction."""
    for mu_2, share in list(product(LIMITS, SHARES))[: 1 if quick else None]:
        beads = hstop.BEADS.replace(mu_2=mu_2)
        slope = math.degrees(math.atan(beads.mu_s + share * (mu_2 - beads.mu_s)))
        row = {"mu_2": mu_2, "range": mu_2 - beads.mu_s, "share": share, "angle": slope}
        for name, scheme in hstop.SCHEMES.items():
            layer = hstop.Layer(slope, 3.0, 10, scheme, beads)
            froude, seconds = timed(layer.froude, layer.relaxation())
            row[name] = froude / hstop.scaled(float(layer.expected().mean)) - 1.0
            row["seconds"] = row.get("seconds", 0.0) + seconds
        yield row


STUDIES: dict[str, tuple[Callable[[bool], Iterator[Row]], dict[str, str]]] = {
    "hstop_refinement": (near_limit, {
        "mu_2": "{mu_2:g}", "mu_2 - mu_s": "{range:.2f}",
        "(tan(slope) - mu_s)/(mu_2 - mu_s)": "{share:g}", "slope [deg]": "{angle:.1f}",
        "speed, default": "{default:+0.1%}", "cell_averaged": "{cell_averaged:+0.1%}",
        "core-seconds": "{seconds:.1f}",
    }),
    "bagnold_refinement": (layers, {
        "scheme": "{method}", "cells": "{cells:d}", "mean speed": "{speed:+0.2%}",
        "rms error of the profile": "{profile:0.2%}", "order": "{order:.1f}",
        "core-seconds": "{seconds:.1f}",
    }),
    "shallow_refinement": (dams, {
        "cells": "{cells:d}", "rho g h/E": "{softness:g}", "t in sqrt(h0/g)": "{time:g}",
        "front": "{front:+0.1%}", "thickness": "{thickness:0.1%}",
        "velocity": "{velocity:0.1%}",
        "core-seconds of the run": "{seconds:.1f}",
    }),
    "bars_refinement": (bars, {
        "method": "{method}", "mu": "{mu}", "cell [mm]": "{cell:g}",
        "points in a cell": "{points:d}", "rms of the surface [mm]": "{surface:.1f}",
        "foot [m]": "{foot:.3f}", "1 bar high [m]": "{bar:.3f}", "2 bars": "{bars_2:.3f}",
        "3 bars": "{bars_3:.3f}", "rms of the line [mm], moved by 0.5 mm": "{line_05:.1f}",
        "1 mm": "{line_1:.1f}", "2 mm": "{line_2:.1f}", "4 mm": "{line_4:.1f}",
        "core-seconds": "{seconds:.1f}",
    }),
    "bars_causes": (causes, {
        "changed": "{changed}", "rms of the surface [mm]": "{surface:.1f}",
        "foot [m]": "{foot:.3f}", "1 bar high [m]": "{bar:.3f}", "2 bars": "{bars_2:.3f}",
        "3 bars": "{bars_3:.3f}", "half-width of 99.9 % of the mass [m]": "{far:.3f}",
        "rms of the line [mm], moved by 1 mm": "{line_1:.1f}",
    }),
    "contact_dynamics_places": (places, {
        "scheme": "{method}", "positions of the points": "{places}",
        "L1 of the deposit": "{L1:.3f}", "mean distance": "{mean:+0.1%}",
        "run-out to the foot": "{foot:+0.1%}", "run-out of 99 %": "{runout_99:+0.1%}",
        "of 99.9 %": "{runout:+0.1%}",
    }),
    "contact_dynamics_refinement": (discs, {
        "a": "{aspect:g}", "method": "{method}", "cells": "{cells:g}",
        "points in a cell": "{points:d}", "E/(rho g H)": "{stiffness:g}",
        "L1 of the deposit": "{L1:.3f}", "mean distance": "{mean:+0.1%}",
        "energy": "{energy:+0.1%}", "run-out of 99 %": "{runout_99:+0.1%}",
        "of 99.9 %": "{runout:+0.1%}", "core-seconds": "{seconds:.1f}",
    }),
}  # fmt: skip
"""Runs by the name of their table, and its columns."""


def tables(results: dict[str, Any]) -> dict[str, list[str]]:
    """Table of each study."""
    return {name: table(rows, STUDIES[name][1]) for name, rows in results["studies"].items()}


def main(argv: list[str] | None = None) -> None:
    parser = parser_of(__name__, __doc__, "the first run of each study")
    parser.add_argument("--only", nargs="*", choices=STUDIES, default=list(STUDIES))
    run_studies(parser.parse_args(argv), {name: study for name, (study, _) in STUDIES.items()})

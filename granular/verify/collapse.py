"""Collapse of columns (Dunatunga & Kamrin 2015, section 4.1)."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Any

import numpy as np

from granular import materials, measure, scenes
from granular.run.simulation import Simulation
from granular.theory import RUNOUT_LAWS
from granular.verify.incline import PUBLISHED
from granular.verify.rows import Row, at_least, at_most, check, holds, report, within
from granular.verify.silo import mass_is_exact

ASPECTS = (0.5, 1.0, 2.0, 3.0, 4.0, 6.0, 8.0)
"""Height over half-width. The values cover both regimes of the paper, which meet at 2.83."""

REPOSE = math.degrees(math.atan(materials.glass_beads.mu_s))
"""Steepest slope that can be at rest [deg], 20.9."""

KINK = 2.83
"""Aspect ratio at which the two regimes of the paper meet."""


def collapse(aspect: float, E: float, *, until: float = 2.0, **parameters: Any) -> Simulation:
    """Run a column; keywords as in `granular.scenes.column_collapse`."""
    material = materials.glass_beads.replace(E=E)
    scene = scenes.column_collapse(aspect=aspect, material=material, duration=until, **parameters)
    return Simulation(scene, threads=1).run()


def three(runout: measure.Runout) -> str:
    """Run-outs by mass quantile, by toe and by contiguous columns, as text."""
    return f"{runout.quantile:.2f} {runout.toe:.2f} {runout.contiguous:.2f}"


@check()
def collapse_quick() -> Iterator[Row]:
    """A column of aspect 1, cells of 0.0125 m, E = 1e6 Pa, published scheme, 1.5 s.

    The band of the run-out contains the paper's 2.28 and the results of other stiffnesses,
    seedings and transfers with this scheme. It only distinguishes a collapse from a failed run.
    """
    sim = collapse(1.0, 1e6, until=1.5, scheme=PUBLISHED)
    yield holds("mass is exact", mass_is_exact(sim.state))
    runout = measure.runout(sim.state).quantile
    yield within("run-out (99.9 % of the mass), published", runout, 2.28, 0.6)


@check()
def collapse_slope_quick() -> Iterator[Row]:
    """A column of aspect 1, cells of 0.0125 m, E = 1e6 Pa, default scheme, 1.5 s."""
    state = collapse(1.0, 1e6, until=1.5).state
    yield at_most("mean slope [deg], default", measure.repose_angle(state).mean_deg, 20.9)
    yield at_most("stress-free in the bulk, default", measure.disconnected_fraction(state), 0.05)
    yield holds("mass is exact, default", mass_is_exact(state))


@check(slow=True)
def collapse_runout() -> Iterator[Row]:
    """Run-outs of `published` for aspects 0.5 to 8, E = 1e7 Pa: quantile, toe, contiguous."""
    quantiles = []
    for aspect in ASPECTS:
        runout = measure.runout(collapse(aspect, 1e7, scheme=PUBLISHED).state)
        quantiles.append(runout.quantile)
        paper = float(RUNOUT_LAWS["dunatunga"](aspect))
        off = runout.quantile / paper - 1
        yield report(f"run-outs, a = {aspect:g}", three(runout), f"{paper:.2f}, {off:+.0%}")
    a, runouts = np.log([ASPECTS, quantiles])
    flat = np.array(ASPECTS) < KINK
    low, high = (float(np.polyfit(a[part], runouts[part], 1)[0]) for part in (flat, ~flat))
    yield within("exponent above a = 2.83", high, 0.7, 0.1)
    yield at_least("exponent below, over that above: two regimes", low / high, 1.2)


@check(slow=True)
def collapse_causes() -> Iterator[Row]:
    """Sensitivity of the run-out of `published`, a = 1: stiffness, seeding, cells, transfer."""
    cases: dict[str, tuple[float, dict[str, Any]]] = {
        "E = 1e6": (1e6, {}),
        "E = 1e7": (1e7, {}),
        "E = 1e8": (1e8, {}),
        "4 points per cell": (1e7, {"points_per_cell": 4}),
        "9 points per cell": (1e7, {"points_per_cell": 9}),
        "25 points per cell": (1e7, {"points_per_cell": 25}),
        "jitter of a spacing": (1e7, {"jitter": 1.0}),
        "cells of 0.025 m": (1e7, {"cell": 0.025}),
        "cells of 0.00625 m": (1e7, {"cell": 0.00625}),
        "uGIMP": (1e7, {"scheme": PUBLISHED.replace(basis="ugimp")}),
        "quadratic": (1e7, {"scheme": PUBLISHED.replace(basis="quadratic")}),
        "APIC": (1e7, {"scheme": PUBLISHED.replace(transfer="apic")}),
        "FLIP decaying at 20/s": (1e7, {"scheme": PUBLISHED.replace(flip_decay=20.0)}),
    }
    for name, (E, changes) in cases.items():
        state = collapse(1.0, E, **{"scheme": PUBLISHED, **changes}).state
        yield report(f"run-outs at a = 1, {name}", three(measure.runout(state)), "paper 2.28")


@check(slow=True)
def collapse_slopes() -> Iterator[Row]:
    """Slopes of the default scheme at rest, cells of 0.00625 m, E = 1e6 Pa, 2 s."""
    for aspect in (0.5, 1.0, 2.0):
        state = collapse(aspect, 1e6, cell=0.00625).state
        repose = measure.repose_angle(state)
        yield at_most(f"mean slope [deg], a = {aspect:g}", repose.mean_deg, 20.9)
        text = f"largest slope over 5 columns [deg], a = {aspect:g}"
        yield at_most(text, repose.largest_deg, 21.9)
        share, runout = measure.disconnected_fraction(state), measure.runout(state)
        yield report(f"stress-free in the bulk, a = {aspect:g}", f"{share:.4f}", "reported")
        yield report(f"run-outs, a = {aspect:g}, default", three(runout), f"{2.28 * aspect:.2f}")

"""Suggestions put to the test: the paper's scenes, made cheaper, against the published setting."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import Any, cast

import numpy as np

from granular import economy, materials, scenes
from granular.economy.bias import softening
from granular.economy.suggestion import changed, scene_function
from granular.mpm import schemes
from granular.mpm.scene import Scene
from granular.mpm.schemes import Scheme
from granular.verify.quantities import Outcome, change, quantities
from granular.verify.rows import Row, at_least, at_most, check, report

TOLERANCE = 0.02
"""Tolerance of the suggestion, which the measured change must meet."""

FOR_COLUMNS, FOR_SLUGS = 0.05, 0.04
"""Tolerances for columns and for slugs, where no smaller error is promised."""

SPARED = 10.0
"""Factor by which the cost must fall."""

STIFF = 1e8
"""Young's modulus [Pa] of the reference where 1 GPa takes too long."""


def published(name: str, scheme: Scheme, **parameters: Any) -> Scene:
    """A scene at E = 1 GPa; with the paper's scheme its time step is the paper's dt = 3e-6 s."""
    return cast(Scene, scenes.registry[name](scheme=scheme, **parameters))


def reference(scene: Scene, E: float) -> Outcome:
    """Run a scene at the lower `E` and its adaptive step, as a reference for the scene itself.

    The numerical damping of the default scheme is held constant where a suggestion does so. The
    processor time is that of the scene itself: the time of the run, times the number of steps of
    the scene over that of the run, as one step of one point costs the same at any E.
    """
    name = getattr(scene_function(scene), "__name__", "")
    run = quantities(changed(scene, {"dt": None} | softening(scene, name, E)))
    times = run.mean_dt / economy.time_step(scene)
    return replace(run, seconds=run.seconds * times, point_steps=round(run.point_steps * times))


def rows(
    name: str,
    cheaper: Outcome,
    full: Outcome,
    bounded: Sequence[str],
    *,
    timed: bool,
    tolerance: float = TOLERANCE,
) -> Iterator[Row]:
    """Rows of the change of each quantity, and of the cost that is saved."""
    for quantity, value in cheaper.numbers.items():
        moved = change(value, full.numbers[quantity])
        text = f"change of the {quantity}, {name}"
        if quantity in bounded:
            yield at_most(text, moved, tolerance)
        else:
            yield report(text, f"{moved:.3g}", "reported")
    if timed:
        yield at_least(f"core-seconds spared, {name}", full.seconds / cheaper.seconds, SPARED)
        yield report(f"core-seconds, {name}", f"{cheaper.seconds:.3g}", f"{full.seconds:.3g}")
    else:
        ratio = full.point_steps / cheaper.point_steps
        yield at_least(f"points times steps spared, {name}", ratio, SPARED)


def cheaper_run(scene: Scene, tolerance: float = TOLERANCE) -> Outcome:
    """Run the cheaper scene that `granular.economy.suggest` leads to."""
    return quantities(economy.apply(scene, economy.suggest(scene, tolerance)))


@check()
def economy_quick() -> Iterator[Row]:
    """The incline of 25 deg up to 2 s, published scheme: suggested at 2 % against the paper's."""
    scene = published("incline", schemes.dunatunga_kamrin_2015, duration=2.0)
    of_interest = ("mean velocity", "profile")
    yield from rows(
        "incline 25 deg", cheaper_run(scene), quantities(scene), of_interest, timed=False
    )


@check(slow=True)
def economy_incline() -> Iterator[Row]:
    """Inclines, 20 s, both schemes at 25 deg: suggested at 2 % against 1 GPa; cost of 3e-6 s."""
    quantities = ("mean velocity", "profile")
    for angle, scheme, name in (
        (22.0, schemes.dunatunga_kamrin_2015, "published"),
        (25.0, schemes.dunatunga_kamrin_2015, "published"),
        (30.0, schemes.dunatunga_kamrin_2015, "published"),
        (25.0, schemes.default, "default"),
    ):
        scene = published("incline", scheme, angle_deg=angle)
        full = reference(scene, materials.glass_beads.E)
        yield from rows(f"{angle:g} deg, {name}", cheaper_run(scene), full, quantities, timed=True)


@check(slow=True)
def economy_collapse() -> Iterator[Row]:
    """Columns of aspect 1, mean of three seedings: suggested at 5 % against E = 1 GPa.

    No smaller error than 4 % is promised, because the toe is 3 to 4 % further at 1 GPa than from 1
    to 100 MPa (docs/reports/economy.md). The bound allows for the standard errors of both means,
    2 % together.
    """
    cheaper, full = [], []
    for seed in (1, 2, 3):
        scene = published("column_collapse", schemes.default, aspect=1.0, jitter=0.5, seed=seed)
        cheaper.append(cheaper_run(scene, FOR_COLUMNS))
        full.append(reference(scene, materials.glass_beads.E))
    means = [np.mean([run.numbers["toe"] for run in runs]) for runs in (cheaper, full)]
    moved = float(abs(means[0] / means[1] - 1))
    yield at_most("change of the toe of the run-out, mean of 3", moved, FOR_COLUMNS + 0.02)
    spared = sum(run.seconds for run in full) / sum(run.seconds for run in cheaper)
    yield at_least("core-seconds spared, collapse", spared, SPARED)


@check(slow=True)
def economy_silo() -> Iterator[Row]:
    """Silo with an opening of 0.2 m, default scheme: suggested at 2 % against E = 1e8 Pa."""
    scene = published("silo", schemes.default, orifice=0.2)
    full = reference(scene, STIFF)
    yield from rows("silo, default", cheaper_run(scene), full, ("rate",), timed=True)


@check(slow=True)
def economy_hourglass() -> Iterator[Row]:
    """Flat hourglass, 10 s, default scheme: suggested at 2 % against E = 1e8 Pa.

    The slope is only reported, because seedings at the same E differ by as much
    (docs/reports/economy.md).
    """
    scene = published("hourglass", schemes.default)
    full = reference(scene, STIFF)
    yield from rows("hourglass, default", cheaper_run(scene), full, ("rate",), timed=True)


@check(slow=True)
def economy_slug() -> Iterator[Row]:
    """The slug, default scheme: suggested at 4 % against E = 1 GPa; its outline is random."""
    scene = published("slug", schemes.default)
    full = reference(scene, materials.glass_beads.E)
    cheaper, quantities = cheaper_run(scene, FOR_SLUGS), ("impact", "centre")
    yield from rows("slug, default", cheaper, full, quantities, timed=True, tolerance=FOR_SLUGS)

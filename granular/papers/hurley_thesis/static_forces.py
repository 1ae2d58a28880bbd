"""Figures 2.9 to 2.11 and 6.1: forces inferred in packings at rest.

The packings are made by a small discrete element method, like those of section 2.4; their radii
differ from those of the thesis, which it does not list.
"""

from __future__ import annotations

from collections.abc import Iterator
from itertools import count as numbers_from
from itertools import islice

import numpy as np

from granular import plot
from granular.grain_scale import inference
from granular.grain_scale.inference import BoundaryForce, Inference
from granular.papers.figure import Drawn, Number
from granular.papers.hurley_thesis.document import PAPER
from granular.papers.hurley_thesis.errors import (
    quietly,
    relative_error,
    standard_error,
    with_noise,
)
from granular.papers.hurley_thesis.packings import (
    BOTTOM,
    TOP,
    Case,
    pressed_discs,
    pressed_spheres,
)
from granular.papers.runs import Runs

MU = 0.5
"""Friction between the discs."""
PACKINGS, DRAWS = 10, 6
"""Packings, and draws of the noise for each, over which errors are averaged."""
WINDOW = 6
"""Grains in a window of figure 2.11."""


def discs(runs: Runs) -> list[Case]:
    """Oedometric tests of 58 discs."""
    count = 2 if runs.quick else PACKINGS
    runs.remarks.append(f"58 discs, packings: {count}")
    return pressed_discs(count, runs.settings.shift)


def load_of(case: Case) -> BoundaryForce:
    """Force on the load cell at the top."""
    known = BoundaryForce(body=TOP, direction=(0, -1), value=1.0, opposite=BOTTOM)
    value = inference.boundary_force(case.packing, case.forces, known)
    return BoundaryForce(body=TOP, direction=(0, -1), value=value, opposite=BOTTOM)


# ---- figure 2.9 ----


@PAPER.figure(
    "2.9",
    "oedometric test of 58 discs: forces by DEM and by eq. 2.13 from exact stresses",
    seconds=9.0,
    paper={
        "largest error of the forces, eq. 2.15": 0.0,
        "force on the upper wall per metre of depth [N]": 1170.0,
    },
)
def exact_forces(runs: Runs) -> Drawn:
    """Infer the forces of the packings from their exact stresses."""
    cases = discs(runs)
    inferred = [inference.infer_static(case.packing, mu=MU).forces for case in cases]
    errors = [relative_error(f, case.forces) for f, case in zip(inferred, cases, strict=True)]
    panels = {
        "discrete element method": (cases[0].packing, cases[0].forces),
        f"(2.13), error {errors[0]:.0e}": (cases[0].packing, inferred[0]),
    }
    numbers: dict[str, Number] = {
        "largest error of the forces, eq. 2.15": max(errors),
        "force on the upper wall per metre of depth [N]": load_of(cases[0]).value,
    }
    return Drawn({"": plot.force_networks(panels, columns=2)}, numbers)


# ---- figure 2.10 ----

WAYS: dict[str, Number] = {
    "(2.13)": 0.154,
    "(2.14)": 0.053,
    "(2.13) scaled by the load": "not tried",
    "(2.13) scaled by the virial, smooth walls": "not tried",
}
"""Ways to infer forces from stresses with errors, and the errors that the thesis has with them."""


@PAPER.figure(
    "2.10",
    "forces from stresses that are 15 % too large and have 10 % of noise",
    seconds=17.0,
    paper={f"mean error, {name}": error for name, error in WAYS.items()}
    | {"mean lambda of (2.14) [sqrt(m)]": 0.0714},
)
def noisy_forces(runs: Runs) -> Drawn:
    """Add noise by eq. 2.16, and infer the forces without and with the force on the upper wall.

    The errors of the thesis are those of one packing and one draw: compare them with the standard
    deviations here. Its lambda is that of norms; squares have another for the same forces.
    """
    cases, draws = discs(runs), 1 if runs.quick else DRAWS
    rng = np.random.default_rng(0)
    errors: dict[str, list[float]] = {name: [] for name in WAYS}
    lambdas: list[float] = []
    first: dict[str, Inference] = {}
    for case in cases:
        for _ in range(draws):
            ways = inferred_by_all(case, rng)
            lambdas.append(np.sqrt(ways["(2.14)"].weight_of_norms))
            for name, one in ways.items():
                errors[name].append(relative_error(one.forces, case.forces))
            first = first or ways
    panels = {"known": (cases[0].packing, cases[0].forces)}
    for name, one in first.items():
        panels[f"{name}: {errors[name][0]:.3f}"] = (one.packing, one.forces)
    numbers: dict[str, Number] = {}
    for name, values in errors.items():
        numbers[f"mean error, {name}"] = float(np.mean(values))
        numbers[f"standard deviation of the error, {name}"] = float(np.std(values, ddof=1))
    numbers["mean lambda of (2.14) [sqrt(m)]"] = float(np.nanmean(lambdas))
    return Drawn({"": plot.force_networks(panels)}, numbers)


def inferred_by_all(case: Case, rng: np.random.Generator) -> dict[str, Inference]:
    """Forces of one packing from stresses with one draw of the noise, by each of `WAYS`."""
    rough, known = with_noise(case.packing, rng), load_of(case)
    return {
        "(2.13)": quietly(inference.infer_static, rough, mu=MU),
        "(2.14)": quietly(inference.infer_with_boundary, rough, known, mu=MU),
        "(2.13) scaled by the load": quietly(
            inference.infer_with_boundary, rough, known, mu=MU, by="force"
        ),
        "(2.13) scaled by the virial, smooth walls": quietly(
            inference.infer_with_boundary, rough, known, mu=MU, mu_wall=0.0, by="virial"
        ),
    }


# ---- figure 2.11 ----


@PAPER.figure(
    "2.11",
    "forces inferred in a window of six discs",
    seconds=10.0,
    paper={"error in the window that is drawn": 0.0, "largest error of windows of full rank": 0.0},
)
def windows(runs: Runs) -> Drawn:
    """Infer the forces of six neighbours around each disc, from their stresses alone.

    Where the rows determine fewer forces than there are, the inference says so by its rank.
    """
    cases = discs(runs)
    drawn, inferred, error = window_of(cases[0], central(cases[0]))
    errors, full = [], []
    for case in cases:
        for grain in np.setdiff1d(np.arange(case.packing.n), case.packing.rattlers()):
            _, one, off = window_of(case, grain)
            errors.append(off)
            full.append(one.rank == one.unknowns)
    title = f"rank {inferred.rank} of {inferred.unknowns}: error {error:.0e}"
    whole = (cases[0].packing, cases[0].forces)
    panels = {"known": whole, title: (inferred.packing, inferred.forces)}
    numbers: dict[str, Number] = {
        "error in the window that is drawn": error,
        "share of windows of full rank": float(np.mean(full)),
        "largest error of windows of full rank": float(np.array(errors)[full].max()),
    }
    return Drawn({"": plot.force_networks(panels, columns=2, largest=drawn)}, numbers)


def central(case: Case) -> int:
    """The grain nearest to the middle that has contacts."""
    live = np.setdiff1d(np.arange(case.packing.n), case.packing.rattlers())
    middle = np.median(case.packing.centroids, axis=0)
    away = np.linalg.norm(case.packing.centroids[live] - middle, axis=1)
    return int(live[away.argmin()])


def window_of(case: Case, grain: int) -> tuple[float, Inference, float]:
    """Largest force, inference and error of a window about a grain."""
    packing = case.packing
    live = np.setdiff1d(np.arange(packing.n), packing.rattlers())
    away = np.linalg.norm(packing.centroids[live] - packing.centroids[grain], axis=1)
    window, contacts = packing.subset(live[np.argsort(away)[:WINDOW]])
    inferred = quietly(inference.infer_static, window, mu=MU)
    largest = float(np.linalg.norm(case.forces, axis=1).max())
    return largest, inferred, relative_error(inferred.forces, case.forces[contacts])


# ---- figure 6.1 ----

SPHERES = {"quick": (40, 1), "normal": (77, 3), "full": (77, 8)}
"""Numbers of spheres and of packings."""


@PAPER.figure(
    "6.1",
    "forces in compressed spheres and their distribution, for the quartz grains of the thesis",
    seconds=28.0,
    paper={
        "share of strong contacts [%]": 40.0,
        "decay b of exp(-b F/mean) above the mean": "exponential",
    },
)
def spheres(runs: Runs) -> Drawn:
    """Infer the forces of 77 spheres in a box from exact stresses (panel c).

    The load curve and the image of the quartz grains (panels a and b) are measurements of which the
    thesis has only pictures.
    """
    count, packings = SPHERES[runs.settings.size]
    runs.remarks.append(f"{count} spheres, packings: {packings}")
    cases = list(islice(packings_of(count, runs.settings.shift), packings))
    inferred = [inference.infer_static(case.packing, mu=MU).forces for case in cases]
    statistics = {
        f"packing {k + 1}": inference.force_statistics(forces) for k, forces in enumerate(inferred)
    }
    shares = [100 * one.strong_share for one in statistics.values()]
    decays = [one.decay for one in statistics.values()]
    numbers: dict[str, Number] = {
        "share of strong contacts [%]": float(np.mean(shares)),
        "standard error of the share [%]": standard_error(shares),
        "decay b of exp(-b F/mean) above the mean": float(np.mean(decays)),
        "standard error of b": standard_error(decays),
        "largest error of the forces, eq. 2.15": max(
            relative_error(f, case.forces) for f, case in zip(inferred, cases, strict=True)
        ),
    }
    pictures = {
        "": plot.force_networks({"": (cases[0].packing, inferred[0])}),
        "distribution": plot.force_distribution(statistics),
    }
    return Drawn(pictures, numbers)


def packings_of(spheres: int, shift: float) -> Iterator[Case]:
    """Packings of spheres that come to rest; some of them do not for very long."""
    for seed in numbers_from():
        try:
            yield pressed_spheres(spheres, seed, shift)
        except RuntimeError:
            continue

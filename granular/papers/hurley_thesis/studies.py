"""Figure 5.7: stiffness, friction and spacing of a column of grit, changed one at a time."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import partial
from typing import Any

from matplotlib.axes import Axes

from granular import scenes
from granular.model.state import State
from granular.papers.dunatunga2015.panels import axes_grid, shades
from granular.papers.figure import Drawn, Number
from granular.papers.hurley_thesis.columns import material
from granular.papers.hurley_thesis.document import PAPER
from granular.papers.hurley_thesis.sph_measures import far, highest
from granular.papers.runs import Runs

ASPECT, LENGTH, REACH = 0.65, 0.2, 0.8
"""Height by length, length, and length of the floor [m]: 20 cm long and 13 cm high."""
WIDTH = 0.18
"""Period across in full size [m]; otherwise columns are 2D."""
KAPPAS = (1e5, 1e6, 1e7)
FRICTIONS = ((0.74, 0.335), (0.87, 0.364), (0.625, 0.305))
"""Friction of the material and at the walls: the mean, and the ends of its measurement."""
SPACINGS = (0.01, 0.005, 0.0025)

Case = Mapping[str, Any]


def studies(quick: bool) -> dict[str, dict[str, Case]]:
    """Cases of each study: changes of the material, and the spacing."""
    made: dict[str, dict[str, Case]] = {
        "stiffness": {f"kappa = {kappa:.0e} Pa": {"kappa": kappa} for kappa in KAPPAS},
        "friction": {
            f"mu = {mu:g}, {wall:g} at walls": {"mu_l": mu, "mu_h": mu, "mu_wall": wall}
            for mu, wall in FRICTIONS
        },
        "spacing": {f"{1e3 * spacing:g} mm": {"spacing": spacing} for spacing in SPACINGS},
    }
    # The last ones take most of the time.
    short = {"stiffness": 2, "friction": 3, "spacing": 1}
    return {
        name: dict(list(cases.items())[: short[name] if quick else None])
        for name, cases in made.items()
    }


def at_rest(runs: Runs, name: str, case: Case) -> State:
    """The heap of one case."""
    changes = dict(case)
    spacing = changes.pop("spacing", 0.01)
    scene = scenes.column_collapse_sph(
        aspect=ASPECT,
        length=LENGTH,
        reach=REACH,
        width=WIDTH if runs.full else 0.0,
        spacing=spacing,
        material=material("grit", 0.0).replace(**changes),
    )
    run = partial(runs.states_at, scene, (scene.duration,), name)
    # The mean values are the first case of each study.
    (state,) = runs.once(scene.to_json(), run)
    return state


@PAPER.figure(
    "5.7",
    "heaps of grit for three stiffnesses, frictions and spacings",
    seconds=75.0,
    paper={
        "run-out of 10 MPa over that of 0.1 MPa": "no significant change",
        "run-out of the lowest friction over that of the highest": "above 1, minor",
        "run-out of the finest particles over that of the coarsest": "nearly the same",
    },
)
def heaps(runs: Runs) -> Drawn:
    """Draw the highest particles of the heaps; run-outs are distances of 99 % of the mass.

    The measured profile is in the picture of the thesis alone. The farthest particles, which the
    thesis takes, depend on the spacing.
    """
    made = studies(runs.quick)
    states = {
        study: {name: at_rest(runs, f"{study}: {name}", case) for name, case in cases.items()}
        for study, cases in made.items()
    }
    numbers: dict[str, Number] = {}
    reach: dict[str, list[float]] = {}
    for study, of_study in states.items():
        reach[study] = []
        for name, state in of_study.items():
            ends = far(state)
            reach[study].append(ends["L99"] - LENGTH)
            numbers[f"99 % of the mass within, {name} [m]"] = ends["L99"]
            numbers[f"height, {name} [m]"] = ends["H"]
    _, high, low = reach["friction"]
    numbers["run-out of the lowest friction over that of the highest"] = low / high
    if not runs.quick:
        stiff, fine = reach["stiffness"], reach["spacing"]
        numbers["run-out of 10 MPa over that of 0.1 MPa"] = stiff[-1] / stiff[0]
        numbers["run-out of the finest particles over that of the coarsest"] = fine[-1] / fine[0]
    picture, (axes,) = axes_grid(3)
    for ax, (study, of_study), letter in zip(axes, states.items(), "abc", strict=True):
        draw_heaps(ax, of_study)
        ax.set_title(f"({letter}) {study}")
    return Drawn({"": picture}, numbers)


def draw_heaps(ax: Axes, states: Mapping[str, State]) -> None:
    """Highest particles along the floor."""
    markers: Sequence[str] = "os^"
    for (name, state), color, marker in zip(
        states.items(), shades(len(states)), markers, strict=False
    ):
        ax.plot(*highest(state), marker, color=color, markersize=3, fillstyle="none", label=name)
    ax.set(xlabel="x [m]", ylabel="y [m]", xlim=(0.0, 0.45), ylim=(0.0, 0.16))
    ax.legend(fontsize="x-small")

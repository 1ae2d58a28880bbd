"""Run-out of columns and cylinders against power laws from experiments and simulations."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

import numpy as np

from granular import measure, scenes
from granular.materials import glass_beads
from granular.model.typing import AnyScene
from granular.theory import RUNOUT_LAWS
from granular.tools.arrays import Array
from granular.verify.external.columns import G, released
from granular.verify.external.frame import Comparison, Outcome, case, load

if TYPE_CHECKING:
    from matplotlib.figure import Figure

CELLS = 8
"""Cells along the lesser of height and half-width."""

HALF_WIDTH = 0.2
"""Half-width of the columns and radius of the cylinders [m]."""

LASTS = 5.0
"""Duration in sqrt(H/g); columns of Lube et al. came to rest within 3.3."""

SPREAD = 0.25
"""Scatter of experiments between materials and definitions of the front, of the file's header."""

NAMES = {
    "planar_Lube": "Lube et al. 2005, experiment",
    "planar_Lajeunesse": "Lajeunesse et al. 2005, experiment",
    "planar_Staron": "Staron & Hinch 2005, discrete elements",
    "planar_Lagree": "Lagrée et al. 2011, contact dynamics, mu(I)",
    "axisym_Lube": "Lube et al. 2004, experiment",
}


def laws(kind: str) -> tuple[Array, dict[str, Array]]:
    """Aspect ratios, and the laws of the file of a kind, with that of Staron & Hinch if planar."""
    data = load("column_runout_laws")
    columns = {name: column for name, column in data.columns.items() if name.startswith(kind)}
    if kind == "planar":
        columns["planar_Staron"] = RUNOUT_LAWS["staron"](data["a"])
    return data["a"], columns


def runouts(aspect: float, axisymmetric: bool) -> measure.Runout:
    """Run-out in half-widths of a released column in 2D, or of a cylinder in 3D."""
    height = aspect * HALF_WIDTH
    shape: dict[str, Any] = {"aspect": aspect, "cell": min(HALF_WIDTH, height) / CELLS}
    shape["duration"] = LASTS * math.sqrt(height / G)
    # As soft as the columns of the contact dynamics: 1000 times the weight.
    shape["material"] = glass_beads.replace(E=1e3 * glass_beads.rho_c * G * height)
    scene: AnyScene
    if axisymmetric:
        scene = scenes.cylinder_collapse(radius=HALF_WIDTH, **shape)
    else:
        scene = scenes.column_collapse(half_width=HALF_WIDTH, **shape)
    return measure.runout(released(scene).run().state)


def between(quantity: str, ours: float, known: Array) -> Comparison:
    """Row for a run-out within the laws, lengthened by `SPREAD` at both ends.

    The reference is their mean.
    """
    low, high = (1.0 - SPREAD) * known.min(), (1.0 + SPREAD) * known.max()
    passed = bool(low <= ours <= high)
    return Comparison(quantity, ours, float(known.mean()), f"{low:.3g} to {high:.3g}", passed)


def picture(outcome: Outcome) -> Figure:
    """Envelope of the laws, and our runs as points, for the plane and the axisymmetric case."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(7.0, 3.3), layout="constrained")
    panels = figure.subplots(1, 2, sharey=True)
    for axes, kind in zip(panels, ("planar", "axisym"), strict=True):
        aspects, curves = laws(kind)
        every = np.array(list(curves.values()))
        low, high = (1.0 - SPREAD) * np.nanmin(every, 0), (1.0 + SPREAD) * np.nanmax(every, 0)
        axes.fill_between(
            aspects, low, high, color="0.9", label=f"envelope with a scatter of {SPREAD:.0%}"
        )
        for name, values in curves.items():
            known = np.isfinite(values)
            axes.plot(aspects[known], values[known], lw=1, label=NAMES[name])
        if kind in outcome.curves:
            a, mass, toe = outcome.curves[kind]
            axes.plot(a, mass, "ko", ms=4, mfc="none", label="run, 99.9 % of the mass")
            axes.plot(a, toe, "k+", ms=5, label="run, connected columns")
        axes.set(xscale="log", yscale="log", xlabel="aspect ratio $a = H_0/L_0$")
        axes.set_title("columns, 2D" if kind == "planar" else "cylinders, 3D")
        axes.legend(loc="lower right")
    panels[0].set_ylim(0.05, 50.0)
    panels[0].set_ylabel("run-out $(L - L_0)/L_0$")
    return figure


@case(picture)
def runout_laws(quick: bool) -> Outcome:
    """Run-out of columns and cylinders of several aspect ratios against laws of other authors."""
    outcome = Outcome()
    kinds = {"planar": (0.5, 1.0, 2.0, 4.0, 8.0), "axisym": (0.5, 1.0, 2.0)}
    for kind, aspects in kinds.items():
        listed, known = laws(kind)
        curves = []
        for aspect in (1.0,) if quick else aspects:
            with outcome.timed():
                run = runouts(aspect, kind == "axisym")
            values = np.array(list(known.values()))[:, listed == aspect]
            tag = f"{'column' if kind == 'planar' else 'cylinder'}, a = {aspect:g}"
            outcome.rows.append(
                between(
                    f"run-out of 99.9 % of the mass, {tag}",
                    run.quantile,
                    values[np.isfinite(values)],
                )
            )
            curves.append((aspect, run.quantile, run.contiguous))
        outcome.curves[kind] = np.transpose(curves).tolist()
    return outcome

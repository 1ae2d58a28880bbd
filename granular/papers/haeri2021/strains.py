"""Figures 6 and 7: elastic strain, and the volume of the plastic deformation, over time."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Any, Self, cast

import numpy as np

from granular import measure, scenes
from granular.materials import NGF, couette_beads, grc_1
from granular.measure.soil_tools import StrainHistory
from granular.model.state import State
from granular.mpm.scene import Scene
from granular.papers.figure import Drawn
from granular.papers.haeri2021.blades import QUICK, THIN, WAY, blade_scene
from granular.papers.haeri2021.cylinders import COARSE
from granular.papers.haeri2021.document import PAPER, SCHEMES, chosen_scheme, soft_soil, softened
from granular.papers.runs import Runs
from granular.plot.canvas import Picture
from granular.record import Trajectory
from granular.tools.arrays import Array

FLOW, BLADE = "between cylinders", "excavation"
STEPS = {FLOW: 1e-4, BLADE: 4e-5}
"""Time steps of table 2 [s]."""
PUBLISHED = {FLOW: couette_beads, BLADE: grc_1}
DRIFT_BELOW = 1
"""Cells below the surface from which the drift of the density is measured: the cell is low."""


def records(runs: Runs) -> dict[str, Trajectory]:
    """Records of a low cell, and of a blade between walls over the whole way of the document."""
    return {FLOW: flow_record(runs), BLADE: blade_record(runs)}


def flow_record(runs: Runs) -> Trajectory:
    """Flow between cylinders in cells of 8 mm, and in full size of 4 mm as in the document."""
    size: dict[str, Any] = {"height": 0.024, "cell": 0.008, "duration": 2.0}
    if runs.quick:
        size = COARSE
    if runs.full:
        size |= {"cell": 0.004}
    scene: Scene = scenes.couette(
        material=softened(runs, couette_beads),
        scheme=chosen_scheme(runs, scenes.couette().scheme),
        **size,
    )
    return runs.record(scene, "couette_strain", every=scene.duration / 20)


def blade_record(runs: Runs) -> Trajectory:
    """Blade 5 cm deep that moves by 64 cm, in front of which soil accumulates."""
    size: dict[str, Any] = {**THIN, **WAY}
    if runs.quick:
        size |= QUICK | {"cell": 0.025}
    scene = blade_scene(
        0.05,
        material=soft_soil(runs),
        scheme=chosen_scheme(runs, scenes.excavation().scheme),
        **size,
    )
    return runs.record(scene, "thin_5_whole_way", every=scene.duration / 100)


@PAPER.figure(
    "6",
    "mean elastic strain over time between cylinders and in excavation, and its deviation",
    seconds=170.0,
    paper={
        f"strain in the last quarter over that in the second, {BLADE}": "increases",
        f"strain in the last quarter over that in the second, {FLOW}": "steady",
        f"strain in the last quarter, {BLADE} over {FLOW}": "larger",
    },
    schemes=SCHEMES,
)
def elastic_strain(runs: Runs) -> Drawn:
    """Measure the norm of the logarithmic elastic strain of dense points.

    The moduli are a hundredth of the document's, so that strains are a hundred times as large as
    with its own: their ratios can be compared.
    """
    histories = {}
    for label, record in records(runs).items():
        with record:
            histories[label] = measure.soil_tools.strain_history(record)
    ends = {label: quarter(history.norm, 3) for label, history in histories.items()}
    numbers = {f"strain in the last quarter, {label}": end for label, end in ends.items()}
    numbers |= {
        f"strain in the last quarter over that in the second, {label}": ends[label]
        / quarter(history.norm, 1)
        for label, history in histories.items()
    }
    numbers[f"strain in the last quarter, {BLADE} over {FLOW}"] = ends[BLADE] / ends[FLOW]
    return Drawn({"": figure_6(histories)}, numbers)


def quarter(values: Array, which: int) -> float:
    """Mean of the values in a quarter of the time, 0 to 3."""
    return float(np.mean(np.array_split(values, 4)[which]))


def figure_6(histories: Mapping[str, StrainHistory]) -> Picture:
    """Mean strains and one standard deviation above them, as in the document."""
    picture = Picture(figsize=(5.0, 3.2), layout="compressed")
    ax = picture.subplots()
    for k, (label, history) in enumerate(histories.items()):
        share = history.times / history.times[-1]
        style = "--" if label == FLOW else "-"
        text = f"{label}, {history.times[-1]:.3g} s"
        ax.plot(share, history.norm, style, color=f"C{k}", label=text)
        above = history.norm + history.deviation
        ax.fill_between(share, history.norm, above, color=f"C{k}", alpha=0.2, linewidth=0.0)
    ax.set(xlabel="time/duration", ylabel="norm of the elastic strain", yscale="log")
    ax.legend()
    return picture


@dataclass(frozen=True)
class PlasticVolume:
    """det F^p of the dense points over time.

    Attributes
    ----------
    times : ndarray, shape (k,)
        [s].
    stored : ndarray, shape (k, 2)
        Mean and standard deviation of ln det F^p by the stored fields: det F by the density, det
        F^e by the pressure.
    occupied : ndarray, shape (k,)
        Mean of the same with det F by the volume that points occupy, in the bulk.
    published : ndarray, shape (k, 2)
        Mean and standard deviation of ln det F^p of the published step, along the same flow.
    """

    times: Array
    stored: Array
    occupied: Array
    published: Array

    @classmethod
    def measured(cls, states: Iterable[State], dt: float) -> Self:
        """Measure states in the order of time; `dt` is the published time step [s].

        In each published step det F^p falls by the factor 1 - (dt gdot)^2/4, see
        `granular.papers.haeri2021.published_step`.
        """
        rows, lost, before = [], np.zeros(0), None
        for state in states:
            square = state.shear_rate**2
            if before is None:
                lost = np.zeros(state.n)
            else:
                span = state.time - before[0]
                lost = lost - dt / 4 * span * (square + before[1]) / 2
            before = state.time, square
            stored = plastic_volume(state)
            rows.append(
                (
                    *(state.time, stored.mean(), stored.std()),
                    measure.density_drift(state, depth_cells=DRIFT_BELOW),
                    *(lost.mean(), lost.std()),
                )
            )
        times, mean, deviation, drift, fallen, scatter = np.array(rows).T
        stored, published = np.stack([mean, deviation], 1), np.stack([fallen, scatter], 1)
        return cls(times, stored, -np.log1p(drift), published)


def plastic_volume(state: State) -> Array:
    """ln det F^p of the dense points by the stored fields.

    det F is rho_c/rho, and -ln det F^e is the Kirchhoff pressure over K.
    """
    material, dense = cast(NGF, state.scene.material), state.dense
    compression = state.log_density[dense]
    kirchhoff = state.pressure[dense] * np.exp(-compression)
    return kirchhoff / material.K - compression


@PAPER.figure(
    "7",
    "change of det F^p over time between cylinders and in excavation, and by the published step",
    seconds=170.0,
    paper={f"largest change of ln det F^p, {label}": "within bounds" for label in (FLOW, BLADE)},
    schemes=SCHEMES,
)
def plastic_deformation(runs: Runs) -> Drawn:
    """Measure det F^p, which the text of the document tracks, of the runs of figure 6.

    The package stores no F: the law has only the elastic strain, and all of F^p except for its
    volume is undetermined. That volume follows from the stored fields, and is constant because the
    pressure follows from the density. Two other numbers show what is not exact: how far densities
    drift from the volume that points occupy, and what the document's explicit step would do to det
    F^p in the same flow with its own time step. Its inverse is the same with the other sign.
    """
    histories, numbers = {}, dict[str, float]()
    for label, record in records(runs).items():
        with record:
            histories[label] = PlasticVolume.measured(record, STEPS[label])
        volume, K = histories[label], PUBLISHED[label].K
        numbers |= {
            f"largest change of ln det F^p, {label}": float(np.abs(volume.stored).max()),
            f"largest drift of the density, {label}": float(np.nanmax(np.abs(volume.occupied))),
            f"ln det F^p of the published step at the end, {label}": float(volume.published[-1, 0]),
            f"pressure that this would take at the document's K, {label} [Pa]": -K
            * float(volume.published[-1, 0]),
        }
    return Drawn({"": figure_7(histories)}, numbers)


def figure_7(histories: Mapping[str, PlasticVolume]) -> Picture:
    """Changes of ln det F^p, on a logarithmic axis."""
    picture = Picture(figsize=(7.0, 3.2), layout="compressed")
    axes = picture.subplots(1, 2, sharey=True)
    for ax, (label, volume) in zip(axes, histories.items(), strict=True):
        mean, deviation = np.abs(volume.published).T
        ax.plot(volume.times, mean, label="published step, mean")
        ax.fill_between(volume.times, mean, mean + deviation, alpha=0.2, linewidth=0.0)
        ax.plot(volume.times, np.abs(volume.occupied), label="by the volume of points, mean")
        stored = np.abs(volume.stored).max(axis=1)
        ax.plot(volume.times, stored, label="by the stored fields, mean or deviation")
        ax.set(xlabel="t [s]", title=label, yscale="log", ylim=(1e-18, 1.0))
    axes[0].set_ylabel("change of ln det F$^p$")
    axes[1].legend(loc="center right")
    return picture

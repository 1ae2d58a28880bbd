"""Figures 3.2 and 3.5, table 3.1: forces inferred while six discs are hit.

The record is synthetic: discs of the size, density and friction of section 3.3 in a corner, hit at
the velocity and angle given there, with stiffnesses that were chosen. It is filmed at 5 kHz with
errors of 0.02 mm in the centroids and 10 % in the stresses; rotations are not measured.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from granular import plot
from granular.grain_scale import inference
from granular.grain_scale.inference import OUTSIDE, Packing, ParetoFront
from granular.papers.figure import Drawn, Number
from granular.papers.hurley_thesis.document import PAPER
from granular.papers.hurley_thesis.errors import quietly, relative_error
from granular.papers.hurley_thesis.impacts import MU, Record, impact, noisy_record
from granular.papers.runs import Runs
from granular.tools.arrays import Array

SHOWN = 8
"""Number of contacts whose forces are drawn over time, as in figure 3.5d."""


def front_of(runs: Runs) -> tuple[Record, list[Packing], ParetoFront]:
    """The record, its packings with errors, and forces for weights of the balance."""
    runs.remarks.append("six discs, synthetic record")
    record = impact(runs.settings.shift)
    packings = noisy_record(record, 0)
    weights = np.logspace(-3, 3, 7 if runs.quick else 25)
    options = {"mu": MU, "mu_wall": 0.0, "weights": weights, "moments": False}
    return record, packings, quietly(inference.pareto_front, packings, **options)


@PAPER.figure(
    "3.2",
    "residuals of the balance and of the stresses, and the knee of their trade-off",
    seconds=9.0,
    paper={"error of the forces at the knee": "not given"},
)
def trade_off(runs: Runs) -> Drawn:
    """Infer the forces of the record with many weights; figure 3.2 of the thesis is a sketch."""
    record, _, front = front_of(runs)
    true = np.concatenate([case.forces for case in record.frames])
    errors = [relative_error(np.concatenate(forces), true) for forces in front.forces]
    numbers: dict[str, Number] = {
        "weight at the knee": float(front.weights[front.knee]),
        "error of the forces at the knee": errors[front.knee],
        "smallest error of all weights": min(errors),
    }
    return Drawn({"": plot.pareto_front(front, errors=errors)}, numbers)


@PAPER.figure(
    "3.5",
    "forces in six discs during an impact, inferred and true: networks, and contacts over time",
    seconds=10.0,
    paper={"error of the largest force of a contact [%]": "often below 20"},
)
def forces_over_time(runs: Runs) -> Drawn:
    """Infer the forces at the knee, and compare the histories of the eight largest contacts.

    In place of the finite elements of the thesis the true forces of the record are drawn.
    """
    record, packings, front = front_of(runs)
    inferred, true = front.forces[front.knee], [case.forces for case in record.frames]
    panels = {}
    for share in (0.2, 0.5, 0.8):
        k = int(share * len(inferred))
        title = f"{1e3 * record.times[record.touching[k]]:.1f} ms"
        panels[f"inferred, {title}"] = (packings[k], inferred[k])
        panels[f"true, {title}"] = (packings[k], true[k])
    pairs = {tuple(pair) for case in record.frames for pair in case.packing.bodies.tolist()}
    by_size = sorted(pairs, key=lambda pair: -history(record, true, pair).max())[:SHOWN]
    series, off = {}, []
    for pair in by_size:
        both = {"true": history(record, true, pair), "inferred": history(record, inferred, pair)}
        title = f"contact {pair}".replace(str(OUTSIDE), "impactor")
        series[title] = (record.times, both)
        off.append(abs(both["inferred"].max() / both["true"].max() - 1))
    numbers: dict[str, Number] = {
        "error of all forces, eq. 2.15": relative_error(
            np.concatenate(inferred), np.concatenate(true)
        ),
        "error of the largest force of a contact [%]": 100 * float(np.median(off)),
        "largest of these errors [%]": 100 * max(off),
    }
    pictures = {
        "": plot.force_networks(panels, columns=2),
        "histories": plot.force_histories(series, ylabel="force [N/m]"),
    }
    return Drawn(pictures, numbers)


def history(record: Record, forces: Sequence[Array], pair: tuple[int, ...]) -> Array:
    """Magnitude of the force at one contact over all frames; zero while it is open."""
    series = np.zeros(len(record.times))
    for k, case, f in zip(record.touching, record.frames, forces, strict=True):
        here = (case.packing.bodies == pair).all(axis=1)
        series[k] = np.linalg.norm(f[here], axis=1).sum()
    return series


THESIS = np.array(
    [
        [[0.76, 0.54], [0.28, 0.25]],
        [[0.16, 0.04], [0.12, 0.12]],
        [[0.38, 0.40], [0.07, 0.04]],
        [[0.26, 0.00], [-0.01, 0.00]],
        [[0.51, 0.47], [0.18, 0.09]],
        [[0.23, 0.21], [0.11, 0.00]],
    ]
)
"""Table 3.1 [m/s]: disc, component, and by the impulse or measured. Discs are numbered in no order,
so that single rows cannot be compared."""


def summary(changes: Array, measured: Array) -> dict[str, Number]:
    """Largest change of velocity, and errors of the changes by the impulse of the forces."""
    off = np.abs(changes - measured)
    return {
        "largest change of a component, measured [m/s]": float(np.abs(measured).max()),
        "the same by the impulse [m/s]": float(np.abs(changes).max()),
        "largest error by the impulse [m/s]": float(off.max()),
        "root mean square error [m/s]": float(np.sqrt((off**2).mean())),
    }


@PAPER.figure(
    "table_3.1",
    "changes of the velocities of six discs: by the impulse of the forces, and measured",
    seconds=8.0,
    paper=summary(THESIS[:, :, 0], THESIS[:, :, 1]),
)
def table_3_1(runs: Runs) -> Drawn:
    """Integrate the inferred forces over the impact, and compare with the change of velocity."""
    record, packings, front = front_of(runs)
    changes = velocity_changes(record, packings, front.forces[front.knee])
    return Drawn({}, summary(changes, record.v[-1] - record.v[0]))


def velocity_changes(record: Record, packings: Sequence[Packing], forces: Sequence[Array]) -> Array:
    """Impulses over masses [m/s], shape (n, 2); nothing touches in the frames between."""
    net = np.zeros((len(record.times), *record.x.shape[1:]))
    for k, packing, f in zip(record.touching, packings, forces, strict=True):
        net[k] = inference.net_forces(packing, f)
    return inference.impulses(net, record.times) / record.masses[:, None]

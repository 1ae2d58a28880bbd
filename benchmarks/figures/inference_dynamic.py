"""Figures 3.2 and 3.5 of Hurley's thesis: an impact on six discs, from noisy synthetic records."""

import numpy as np

from figures.inference_common import chosen_options, grains, quietly, relative_error

from figures.common import save  # isort: skip
from granular import plot
from granular.grain_scale import inference

MU = 0.6


def history(record: grains.Record, forces: list[np.ndarray], pair: tuple[int, int]) -> np.ndarray:
    """Magnitude of the force at one contact over all frames; zero while it is open."""
    series = np.zeros(len(record.times))
    for k, case, f in zip(record.touching, record.frames, forces, strict=True):
        here = (case.packing.bodies == pair).all(axis=1)
        series[k] = np.linalg.norm(f[here], axis=1).sum()
    return series


def main(argv: list[str] | None = None) -> None:
    chosen = chosen_options(__doc__, argv)
    record = grains.impact()
    packings = grains.noisy_record(record, 0)
    weights = np.logspace(-3, 3, 7 if chosen.quick else 25)
    options = {"mu": MU, "mu_wall": 0.0, "weights": weights, "moments": False}
    front = quietly(inference.pareto_front, packings, **options)
    true = [case.forces for case in record.frames]
    whole = np.concatenate(true)
    errors = [relative_error(np.concatenate(forces), whole) for forces in front.forces]
    save(plot.pareto_front(front, errors=errors), chosen, "inference_pareto")
    found = front.forces[front.knee]
    panels = {}
    for share in (0.2, 0.5, 0.8):
        k = int(share * len(found))
        title = f"{1e3 * record.times[record.touching[k]]:.1f} ms"
        panels[f"inferred, {title}"] = (packings[k], found[k])
        panels[f"true, {title}"] = (packings[k], true[k])
    save(plot.force_networks(panels, columns=2), chosen, "inference_impact")
    pairs = {tuple(pair) for case in record.frames for pair in case.packing.bodies.tolist()}
    largest = sorted(pairs, key=lambda pair: -history(record, true, pair).max())[:8]
    series = {
        f"contact {pair}".replace(str(inference.OUTSIDE), "impactor"): (
            record.times,
            {"true": history(record, true, pair), "inferred": history(record, found, pair)},
        )
        for pair in largest
    }
    save(plot.force_histories(series, ylabel="force [N/m]"), chosen, "inference_histories")

"""Figures 2.9 to 2.11 of Hurley's thesis, with our own packing: forces, noise, a window."""

import numpy as np

from figures.inference_common import chosen_options, grains, quietly, relative_error, with_noise

from figures.common import save  # isort: skip
from granular import plot
from granular.grain_scale import inference

MU = 0.5
WINDOW = 6


def main(argv: list[str] | None = None) -> None:
    chosen = chosen_options(__doc__, argv)
    case = grains.pressed_discs()[0]
    packing, true = case.packing, case.forces
    load = -true[packing.bodies[:, 1] == -4, 1].sum()
    known = inference.BoundaryForce(body=-4, direction=(0, -1), value=load, opposite=-3)
    exact = inference.infer_static(packing, mu=MU)
    rough = with_noise(packing, np.random.default_rng(0))
    panels = {"known": (packing, true)}
    ways = {"(2.13)": exact}
    ways["noise, (2.13)"] = inference.infer_static(rough, mu=MU)
    ways["noise, (2.14)"] = inference.infer_with_boundary(rough, known, mu=MU)
    ways["noise, virial, no wall friction"] = inference.infer_with_boundary(
        rough, known, mu=MU, mu_wall=0.0, by="virial"
    )
    for name, found in ways.items():
        error = relative_error(found.forces, true)
        panels[f"{name}: error {error:.1g}" if error < 1e-6 else f"{name}: error {error:.3f}"] = (
            packing,
            found.forces,
        )
    middle = np.median(packing.centroids, axis=0)
    live = np.setdiff1d(np.arange(packing.n), packing.rattlers())
    near = np.argsort(np.linalg.norm(packing.centroids[live] - middle, axis=1))
    window, contacts = packing.subset(live[near[:WINDOW]])
    found = quietly(inference.infer_static, window, mu=MU)
    error = relative_error(found.forces, true[contacts])
    panels[f"six grains, rank {found.rank}/{found.unknowns}: error {error:.1g}"] = (
        window,
        found.forces,
    )
    save(plot.force_networks(panels), chosen, "inference_static")
    spheres = grains.pressed_spheres()
    statistics = {
        "58 discs": inference.force_statistics(exact.forces),
        "80 spheres": inference.force_statistics(
            inference.infer_static(spheres.packing, mu=MU).forces
        ),
    }
    save(plot.force_distribution(statistics), chosen, "inference_statistics")

"""Figures 3.7 to 3.10 of Hurley's thesis, from synthetic data: a heavy disc falls into a bed.

The bed of smaller discs is that of section 3.4, apart from its depth. The stresses have an error of
10 %, and the rotations are unknown.
"""

from dataclasses import dataclass, replace

import numpy as np

from figures.inference_common import chosen_options, grains, quietly, relative_error, with_noise

from figures.common import save  # isort: skip
from granular import plot
from granular.grain_scale import inference

MU, STIFFNESS, DENSITY = 0.6, 9e6, 1100.0
RADII = (0.0127, 0.015875)
WIDTH, GRAINS, INTRUDER, SPEED = 0.81, 330, 0.1, 2.4
THICKNESS = 0.0095
"""Depth of the grains [m]; forces are inferred per metre of depth."""
FRAMES, RATE = 180, 4500.0


def bed(seed: int) -> grains.Grains:
    """Grains at rest under gravity, and an intruder that is about to touch them."""
    rng = np.random.default_rng(seed)
    R = np.append(rng.choice(RADII, GRAINS), INTRUDER)
    x = np.zeros((GRAINS + 1, 2))
    x[:-1] = grains.layered_places(GRAINS, (24,), WIDTH / 24, 2, rng)
    x[-1] = WIDTH / 2, 2.0
    m = DENSITY * np.pi * R**2
    m[-1] = 7850 * np.pi * INTRUDER**2
    system = grains.Grains(
        x, R, m, 0.0, [WIDTH, np.inf], dim=2, kn=STIFFNESS, kt=2 / 3 * STIFFNESS, mu=MU,
        dt=1 / RATE / 6, damping=0.2, drag=5.0, gravity=9.81,
    )  # fmt: skip
    for _ in range(5):
        system.step(2500)
        system.x[-1, 1], system.v[-1] = 2.0, 0.0
    system.drag = 0.0
    # The intruder is as low as possible without a contact.
    beside = abs(system.x[:-1, 0] - WIDTH / 2)
    reach = INTRUDER + R[:-1]
    near = beside < reach
    rise = np.sqrt(reach[near] ** 2 - beside[near] ** 2)
    system.x[-1, 1] = (system.x[:-1, 1][near] + rise).max()
    system.v[:] = 0.0
    system.v[-1, 1] = -SPEED
    system.search()
    return system


@dataclass(frozen=True)
class Experiment:
    """Data of an impact: record, inferred and true forces, distances from the intruder."""

    record: grains.Record
    forces: list[np.ndarray]
    true: list[np.ndarray]
    distances: list[np.ndarray]


def experiment(seed: int, every: int) -> Experiment:
    """Every `every`-th frame of an impact."""
    system, rng = bed(seed), np.random.default_rng(100 + seed)
    record = grains.film(system, GRAINS, FRAMES // every, every / RATE)
    forces, distances = [], []
    for k, case in zip(record.touching, record.frames, strict=True):
        packing = replace(
            with_noise(case.packing, rng, bias=0.0), inertias=None, angular_accelerations=None
        )
        found = quietly(inference.infer_dynamic, packing, mu=MU, mu_wall=0.0)
        forces.append(THICKNESS * found.forces)
        away = np.linalg.norm(packing.positions - record.others[k, 0], axis=1)
        distances.append(np.maximum(away - INTRUDER, 0.0))
    true = [THICKNESS * case.forces for case in record.frames]
    return Experiment(record, forces, true, distances)


def lift(one: Experiment, forces: list[np.ndarray]) -> np.ndarray:
    """Vertical force on the intruder in each frame."""
    found = np.zeros(len(one.record.times))
    for k, case, f in zip(one.record.touching, one.record.frames, forces, strict=True):
        found[k] = -f[case.packing.bodies[:, 1] == inference.OUTSIDE, 1].sum()
    return found


def main(argv: list[str] | None = None) -> None:
    chosen = chosen_options(__doc__, argv)
    every, seeds = (20, (0,)) if chosen.quick else (2, (0, 1, 2))
    found = {f"bed {seed + 1}": experiment(seed, every) for seed in seeds}
    for name, one in list(found.items())[:2]:
        frames = np.linspace(0.1, 0.9, 6) * len(one.forces)
        panels = {
            f"{1e3 * one.record.times[one.record.touching[k]]:.1f} ms": (
                one.record.frames[k].packing,
                one.forces[k],
            )
            for k in frames.astype(int)
        }
        number = name.split()[-1]
        save(plot.force_networks(panels, columns=2), chosen, f"inference_bed_{number}")
    series = {
        name: (one.record.times, {"true": lift(one, one.true), "inferred": lift(one, one.forces)})
        for name, one in found.items()
    }
    picture = plot.force_histories(series, ylabel="force on the intruder [N]")
    save(picture, chosen, "inference_intruder")
    curves = {
        name: inference.largest_by_distance(
            one.forces, one.distances, bin_width=2 * RADII[0], bins=10
        )
        for name, one in found.items()
    }
    save(plot.force_distances(curves, 2 * RADII[0]), chosen, "inference_distances")
    for name, one in found.items():
        error = relative_error(np.concatenate(one.forces), np.concatenate(one.true))
        print(f"{name}: error of all forces {error:.3f}")

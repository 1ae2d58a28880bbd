"""Figures of Hurley's thesis from synthetic data: `python benchmarks inference_pictures static`.

static: figures 2.9 to 2.11, with another packing. dynamic: 3.2 and 3.5. bed: 3.7 to 3.10.
"""

from __future__ import annotations

import argparse
import sys
import warnings
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from shared import ROOT

from figures.common import parser_of, save
from granular import plot
from granular.grain_scale import inference
from granular.grain_scale.inference import InferenceWarning, Packing

# The tests contain a small discrete element code, which is not part of the package.
sys.path.append(str(next((ROOT / "tests").rglob("grains.py")).parent))
import grains

from granular.tools.arrays import Array


def with_noise(
    packing: Packing, rng: np.random.Generator, *, bias: float = 0.15, spread: float = 0.1
) -> Packing:
    """Stresses with the noise of eq. 2.16, independent in each component."""
    noise = np.triu(1 + bias + rng.normal(0, spread, packing.stresses.shape))
    return replace(packing, stresses=packing.stresses * (noise + np.triu(noise, 1).swapaxes(1, 2)))


def relative_error(inferred: Array, true: Array) -> float:
    """Error of all forces, eq. 2.15."""
    return float(np.linalg.norm(inferred - true) / np.linalg.norm(true))


def quietly(infer: Callable[..., Any], *arguments: Any, **options: Any) -> Any:
    """Result of an inference without its warnings, as the picture shows the flags."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", InferenceWarning)
        return infer(*arguments, **options)


# ---- a packing at rest ----


def static(chosen: argparse.Namespace) -> None:
    """Forces, noise, and a window of a packing at rest."""
    case = grains.pressed_discs()[0]
    packing, true = case.packing, case.forces
    load = -true[packing.bodies[:, 1] == -4, 1].sum()
    known = inference.BoundaryForce(body=-4, direction=(0, -1), value=load, opposite=-3)
    exact = inference.infer_static(packing, mu=0.5)
    rough = with_noise(packing, np.random.default_rng(0))
    panels = {"known": (packing, true)}
    ways = {"(2.13)": exact}
    ways["noise, (2.13)"] = inference.infer_static(rough, mu=0.5)
    ways["noise, (2.14)"] = inference.infer_with_boundary(rough, known, mu=0.5)
    ways["noise, virial, no wall friction"] = inference.infer_with_boundary(
        rough, known, mu=0.5, mu_wall=0.0, by="virial"
    )
    for name, inferred in ways.items():
        error = relative_error(inferred.forces, true)
        panels[f"{name}: error {error:.1g}" if error < 1e-6 else f"{name}: error {error:.3f}"] = (
            packing,
            inferred.forces,
        )
    middle = np.median(packing.centroids, axis=0)
    live = np.setdiff1d(np.arange(packing.n), packing.rattlers())
    near = np.argsort(np.linalg.norm(packing.centroids[live] - middle, axis=1))
    window, contacts = packing.subset(live[near[:6]])
    inferred = quietly(inference.infer_static, window, mu=0.5)
    error = relative_error(inferred.forces, true[contacts])
    panels[f"six grains, rank {inferred.rank}/{inferred.unknowns}: error {error:.1g}"] = (
        window,
        inferred.forces,
    )
    save(plot.force_networks(panels), chosen, "inference_static")
    spheres = grains.pressed_spheres()
    statistics = {
        "58 discs": inference.force_statistics(exact.forces),
        "80 spheres": inference.force_statistics(
            inference.infer_static(spheres.packing, mu=0.5).forces
        ),
    }
    save(plot.force_distribution(statistics), chosen, "inference_statistics")


# ---- an impact ----


def history(record: grains.Record, forces: list[np.ndarray], pair: tuple[int, int]) -> np.ndarray:
    """Magnitude of the force at one contact over all frames; zero while it is open."""
    series = np.zeros(len(record.times))
    for k, case, f in zip(record.touching, record.frames, forces, strict=True):
        here = (case.packing.bodies == pair).all(axis=1)
        series[k] = np.linalg.norm(f[here], axis=1).sum()
    return series


def dynamic(chosen: argparse.Namespace) -> None:
    """An impact on six discs, from noisy records."""
    record = grains.impact()
    packings = grains.noisy_record(record, 0)
    weights = np.logspace(-3, 3, 7 if chosen.quick else 25)
    options = {"mu": MU, "mu_wall": 0.0, "weights": weights, "moments": False}
    front = quietly(inference.pareto_front, packings, **options)
    true = [case.forces for case in record.frames]
    whole = np.concatenate(true)
    errors = [relative_error(np.concatenate(forces), whole) for forces in front.forces]
    save(plot.pareto_front(front, errors=errors), chosen, "inference_pareto")
    inferred = front.forces[front.knee]
    panels = {}
    for share in (0.2, 0.5, 0.8):
        k = int(share * len(inferred))
        title = f"{1e3 * record.times[record.touching[k]]:.1f} ms"
        panels[f"inferred, {title}"] = (packings[k], inferred[k])
        panels[f"true, {title}"] = (packings[k], true[k])
    save(plot.force_networks(panels, columns=2), chosen, "inference_impact")
    pairs = {tuple(pair) for case in record.frames for pair in case.packing.bodies.tolist()}
    largest = sorted(pairs, key=lambda pair: -history(record, true, pair).max())[:8]
    series = {
        f"contact {pair}".replace(str(inference.OUTSIDE), "impactor"): (
            record.times,
            {"true": history(record, true, pair), "inferred": history(record, inferred, pair)},
        )
        for pair in largest
    }
    save(plot.force_histories(series, ylabel="force [N/m]"), chosen, "inference_histories")


# ---- an intruder ----

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
    offset = abs(system.x[:-1, 0] - WIDTH / 2)
    reach = INTRUDER + R[:-1]
    near = offset < reach
    rise = np.sqrt(reach[near] ** 2 - offset[near] ** 2)
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
        inferred = quietly(inference.infer_dynamic, packing, mu=MU, mu_wall=0.0)
        forces.append(THICKNESS * inferred.forces)
        away = np.linalg.norm(packing.positions - record.others[k, 0], axis=1)
        distances.append(np.maximum(away - INTRUDER, 0.0))
    true = [THICKNESS * case.forces for case in record.frames]
    return Experiment(record, forces, true, distances)


def lift(one: Experiment, forces: list[np.ndarray]) -> np.ndarray:
    """Vertical force on the intruder in each frame."""
    force = np.zeros(len(one.record.times))
    for k, case, f in zip(one.record.touching, one.record.frames, forces, strict=True):
        force[k] = -f[case.packing.bodies[:, 1] == inference.OUTSIDE, 1].sum()
    return force


def intruder(chosen: argparse.Namespace) -> None:
    """A heavy disc that falls into a bed.

    The bed of smaller discs is the one of section 3.4, apart from its depth. The stresses have an
    error of 10 %, and the rotations are unknown.
    """
    every, seeds = (20, (0,)) if chosen.quick else (2, (0, 1, 2))
    experiments = {f"bed {seed + 1}": experiment(seed, every) for seed in seeds}
    for name, one in list(experiments.items())[:2]:
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
        for name, one in experiments.items()
    }
    picture = plot.force_histories(series, ylabel="force on the intruder [N]")
    save(picture, chosen, "inference_intruder")
    curves = {
        name: inference.largest_by_distance(
            one.forces, one.distances, bin_width=2 * RADII[0], bins=10
        )
        for name, one in experiments.items()
    }
    save(plot.force_distances(curves, 2 * RADII[0]), chosen, "inference_distances")
    for name, one in experiments.items():
        error = relative_error(np.concatenate(one.forces), np.concatenate(one.true))
        print(f"{name}: error of all forces {error:.3f}")


FIGURES = {"static": static, "dynamic": dynamic, "bed": intruder}


def main(argv: list[str] | None = None) -> None:
    parser = parser_of(__doc__)
    parser.add_argument("names", nargs="*", choices=[*FIGURES, []])
    chosen = parser.parse_args(argv, argparse.Namespace(note="synthetic data"))
    for name in chosen.names or FIGURES:
        FIGURES[name](chosen)

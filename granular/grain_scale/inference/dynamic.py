"""Forces in moving packings: measured stresses are weighed against measured accelerations."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from granular.grain_scale.inference.matrices import friction_of_contacts
from granular.grain_scale.inference.packing import Packing
from granular.grain_scale.inference.problem import dynamic_problem
from granular.grain_scale.inference.result import Inference, report
from granular.grain_scale.inference.solvers import solve
from granular.tools.arrays import Array
from granular.tools.checks import positive

WEIGHTS = tuple(np.logspace(-3, 3, 13).tolist())
"""Default weights of the balance relative to the stresses, along a front."""


@dataclass(frozen=True, eq=False)
class ParetoFront:
    """Trade-off between stresses and balance (figure 3.2).

    Attributes
    ----------
    weights : ndarray, shape (k,)
        Weights of the balance, ascending.
    stress_residuals, balance_residuals : ndarray, shape (k,)
        Root mean square over the frames of the norms of (K_s f - b_s)/R and of K_m f - b_m, with
        moments divided by R [N], in 2D [N/m]. Where the errors are known, each row is divided by
        its error.
    forces : tuple of k tuples of ndarray
        For each weight the forces of each frame, shape (c, d).
    knee : int
        Index of the point farthest from the chord, on axes that both run from 0 to 1.
    inferences : tuple of Inference
        Inferences at the knee, frame by frame.
    """

    weights: Array
    stress_residuals: Array
    balance_residuals: Array
    forces: tuple[tuple[Array, ...], ...]
    knee: int
    inferences: tuple[Inference, ...]


def infer_dynamic(
    packing: Packing,
    *,
    mu: ArrayLike,
    mu_wall: float | dict[int, float] | None = None,
    weight: float = 1.0,
    moments: bool = True,
    solver: str = "auto",
) -> Inference:
    """Forces in a moving packing at one instant (Hurley's thesis, eqs 3.18, 3.19).

    The forces solve ``min |K_s f - b_s|^2/R^2 + w |K_m f - b_m|^2`` with ``B f >= 0``, where
    moments are divided by R. The normals point out of the first body, as everywhere in this
    package. The method is also useful at rest, if the contacts are known so roughly that no forces
    are exactly in balance.

    With `stress_errors` and `acceleration_errors` of the packing each row is divided by its
    standard deviation, and w = 1 is the solution of maximum likelihood. Stresses with a relative
    error then count less where they are large, and no knee is needed.

    Parameters
    ----------
    packing : Packing
        Packing with masses and accelerations, and with gravity where it acts in the plane of
        motion; preferably also with angular accelerations and errors.
    mu, mu_wall, solver
        See `infer_static`.
    weight : float
        w, > 0; `pareto_front` finds a value.
    moments : bool
        If true, the balance of moments is included. Use False if the angular accelerations are not
        known: they would be taken as zero.

    Raises
    ------
    TypeError, ValueError, ImportError, InferenceError
        As `infer_static`.

    Warns
    -----
    InferenceWarning
        For each flag of the result.
    """
    weight = positive("weight", weight)
    friction = friction_of_contacts(packing, mu, mu_wall)
    problem = dynamic_problem(packing, friction, weight, moments=moments)
    return report(packing, problem, *solve(problem, solver))


def pareto_front(
    packings: Packing | Sequence[Packing],
    *,
    mu: ArrayLike,
    mu_wall: float | dict[int, float] | None = None,
    weights: ArrayLike = WEIGHTS,
    moments: bool = True,
    solver: str = "auto",
) -> ParetoFront:
    """Solutions for many weights, and the one at the knee.

    Parameters
    ----------
    packings : Packing or sequence of Packings
        One instant, or the frames of a record, which then share one weight.
    mu, mu_wall, solver
        See `infer_static`.
    weights : array_like, shape (k,)
        Weights of the balance, ascending, > 0, at least three.
    moments : bool
        See `infer_dynamic`.

    Raises
    ------
    TypeError, ValueError, ImportError, InferenceError
        As `infer_static`; for fewer than three weights or weights that do not ascend.

    Warns
    -----
    InferenceWarning
        For each flag of the results at the knee.
    """
    frames = (packings,) if isinstance(packings, Packing) else tuple(packings)
    if not frames:
        raise ValueError("packings is empty, must hold at least one")
    chosen = np.array([positive("weights", w) for w in np.ravel(weights).tolist()])
    if len(chosen) < 3 or (np.diff(chosen) <= 0).any():
        raise ValueError(f"weights = {chosen.tolist()} must ascend and be at least three")
    problems = [
        dynamic_problem(p, friction_of_contacts(p, mu, mu_wall), 1.0, moments=moments)
        for p in frames
    ]
    solved = [[solve(p.replace(weight=w), solver) for p in problems] for w in chosen.tolist()]
    misfits = [[p.misfits(x) for p, (x, _) in zip(problems, row, strict=True)] for row in solved]
    residuals = np.sqrt(np.mean(np.square(misfits), axis=1))
    knee = knee_of(*residuals.T, weights=chosen)
    return ParetoFront(
        weights=chosen,
        stress_residuals=residuals[:, 0],
        balance_residuals=residuals[:, 1],
        forces=tuple(
            tuple(
                p.force * (p.frame @ x).reshape(-1, p.dim)
                for p, (x, _) in zip(problems, row, strict=True)
            )
            for row in solved
        ),
        knee=knee,
        inferences=tuple(
            report(packing, problem.replace(weight=chosen[knee]), *solution)
            for packing, problem, solution in zip(frames, problems, solved[knee], strict=True)
        ),
    )


def knee_of(first: Array, second: Array, *, weights: Array) -> int:
    """Index of the point farthest from the chord of a front, with both axes scaled to 0 to 1.

    If a residual does not vary, as for exact data, there is no knee; the index of the weight
    nearest to one is returned.
    """
    points = np.stack([first, second], axis=1)
    span = np.ptp(points, axis=0)
    if (span <= 1e-9 * abs(points).max()).any():
        return int(np.argmin(abs(np.log(weights))))
    scaled = (points - points.min(axis=0)) / span
    chord = scaled[-1] - scaled[0]
    away = scaled - scaled[0]
    return int(np.argmax(abs(chord[0] * away[:, 1] - chord[1] * away[:, 0])))

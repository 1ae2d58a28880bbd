"""Least squares without inequalities, and ranks, by sparse factorisation."""

from __future__ import annotations

import numpy as np
from scipy.sparse import csc_array, diags_array, vstack
from scipy.sparse.linalg import SuperLU, splu

from granular.grain_scale.inference.problem import Problem
from granular.tools.arrays import Array, BoolArray

SMALL = 1e-6
"""Singular values below this fraction of the largest count as zero."""
PENALTY = 1e3
"""Weight of the exact rows in the augmented Lagrangian, relative to that of the other rows."""
TOLERANCE = 1e-12
"""Tolerance of the gradient and of the exact rows, relative to the typical force."""
PASSES = 30


def least_squares(problem: Problem) -> Array | None:
    """Solution without the inequalities; None if the iteration fails.

    The rows that must hold exactly enter by an augmented Lagrangian. Each pass computes the
    residuals anew, so that the passes are also the iterative refinement that normal equations need.
    Rows may be linearly dependent.
    """
    soft, target = problem.soft()
    hard, fixed = problem.hard()
    ridge = problem.regularization**2
    square = csc_array(soft.T @ soft + PENALTY * (hard.T @ hard))
    top = _largest(square)
    if not top:
        return None
    factors = _factors(square, ridge + 1e-13 * top)
    x, multipliers = np.zeros(soft.shape[1]), np.zeros(hard.shape[0])
    for _ in range(PASSES):
        off = hard @ x - fixed
        multipliers += PENALTY * off
        gradient = soft.T @ (target - soft @ x) - hard.T @ (multipliers + PENALTY * off) - ridge * x
        x += factors.solve(gradient)
        if not np.isfinite(x).all():
            return None
        if abs(off).max(initial=0.0) < TOLERANCE and abs(gradient).max() < TOLERANCE * top:
            return x
    return None


def determined(problem: Problem) -> tuple[int, BoolArray]:
    """Rank of all rows together, and the contacts whose forces the rows do not determine.

    The rank follows from the signs of the pivots of ``K'K - s`` with a small s: as many of them are
    negative as there are singular values below the root of s. The contacts follow from the null
    space: ``s (K'K + s)^-1`` maps two random vectors into it, except for parts of the order of s.
    """
    stacked = vstack([problem.balance, problem.stress], format="csr")
    square = csc_array(stacked.T @ stacked)
    top = _largest(square)
    contacts = len(problem.mu)
    if not top:
        return 0, np.ones(contacts, bool)
    n, shift = square.shape[0], top * SMALL**2
    small = int(np.count_nonzero(_factors(square, -shift).U.diagonal() < 0))
    left_open = np.zeros(contacts, bool)
    if small:
        seeds = np.random.default_rng(0).normal(size=(n, 2))
        left = np.linalg.norm(shift * _factors(square, shift).solve(seeds), axis=1)
        contact = np.concatenate(
            [np.arange(contacts), np.repeat(problem.slipping, problem.dim - 1)]
        )
        np.logical_or.at(left_open, contact, left > 1e-3)
    return n - small, left_open


def _largest(square: csc_array) -> float:
    """Upper bound of the largest eigenvalue."""
    return float(abs(square).sum(axis=1).max())


def _factors(square: csc_array, shift: float) -> SuperLU:
    # Pivots stay on the diagonal, so that their signs are those of the eigenvalues.
    return splu(
        csc_array(square + shift * diags_array(np.ones(square.shape[0]))),
        permc_spec="MMD_AT_PLUS_A",
        diag_pivot_thresh=0.0,
        options={"SymmetricMode": True},
    )

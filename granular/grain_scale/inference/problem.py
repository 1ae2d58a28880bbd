"""The dimensionless convex problem of each inference.

The unknowns of a contact are its normal force ``n = -e.f`` and, unless it is frictionless, the
components of f along its tangents, all divided by a typical force f0. Let K be the rows to be
fitted with weights w_i; moments and stresses are divided by a typical radius R, and all rows by
their errors where these are known. Let L be the rows that hold exactly and l a regularisation. Then

    min  sum_i w_i |K_i x - b_i|^2 + l^2 |x|^2   s.t.  L x = c,  n >= 0,  |t| <= mu n.

The thesis has norms instead of squares; both have the same set of solutions as the weight varies,
see `weight_of_norms`.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from scipy.sparse import csr_array, diags_array, vstack

from granular.grain_scale.inference.matrices import (
    contact_frames,
    equilibrium_matrix,
    momentum_vector,
    rows_of,
    sparse_blocks,
    stress_matrix,
    stress_vector,
)
from granular.grain_scale.inference.packing import Packing
from granular.tools.arrays import Array, IndexArray


@dataclass(frozen=True, eq=False)
class Problem:
    """Scaled rows and cones.

    Attributes
    ----------
    frame : csr_array, shape (d c, x)
        Matrix from unknowns to forces divided by `force`; orthonormal columns, those of the normal
        forces first.
    mu : ndarray, shape (c,)
        Friction of each contact, 0 and infinity included.
    stress, balance : csr_array
        Rows of the average stresses and of the balance of forces and moments.
    stress_target, balance_target : ndarray
        Right-hand sides of these rows.
    stress_scale, balance_scale : ndarray
        Weights of the rows within each kind: one, or the median error divided by the error of the
        row where errors are known; the median is over both kinds.
    weight : float
        Weight of the balance in the sum of squares; infinite where it must hold exactly.
    regularization : float
        Regularisation l.
    force, length : float
        f0 [N] and R [m].
    unit : float
        Unit of scaled residuals: f0 [N], or standard deviations where errors are known.
    """

    frame: csr_array
    mu: Array
    stress: csr_array
    balance: csr_array
    stress_target: Array
    balance_target: Array
    stress_scale: Array
    balance_scale: Array
    weight: float
    regularization: float
    force: float
    length: float
    unit: float

    @property
    def dim(self) -> int:
        return self.frame.shape[0] // len(self.mu)

    @property
    def slipping(self) -> IndexArray:
        """Contacts that have tangential unknowns, in the order of the unknowns."""
        return np.flatnonzero(self.mu > 0)

    def tangents(self, x: Array) -> Array:
        """Tangential unknowns, one row for each contact of `slipping`."""
        return x[len(self.mu) :].reshape(-1, self.dim - 1)

    def soft(self) -> tuple[csr_array, Array]:
        """Rows to be fitted, multiplied by the roots of their weights, and their targets."""
        stress = diags_array(self.stress_scale) @ self.stress
        target = self.stress_scale * self.stress_target
        if np.isinf(self.weight):
            return csr_array(stress), target
        root = np.sqrt(self.weight) * self.balance_scale
        return (
            vstack([stress, diags_array(root) @ self.balance], format="csr"),
            np.concatenate([target, root * self.balance_target]),
        )

    def hard(self) -> tuple[csr_array, Array]:
        """Rows that hold exactly; none if the balance has a finite weight."""
        if np.isinf(self.weight):
            return self.balance, self.balance_target
        return csr_array((0, self.frame.shape[1])), np.zeros(0)

    def residuals(self, x: Array) -> tuple[float, float]:
        """Norms of the dimensionless residuals of stresses and balance."""
        left = self.stress @ x - self.stress_target, self.balance @ x - self.balance_target
        return float(np.linalg.norm(left[0])), float(np.linalg.norm(left[1]))

    def misfits(self, x: Array) -> tuple[float, float]:
        """Norms of the weighted residuals of stresses and balance, times `unit`."""
        stress = self.stress_scale * (self.stress @ x - self.stress_target)
        balance = self.balance_scale * (self.balance @ x - self.balance_target)
        return self.unit * float(np.linalg.norm(stress)), self.unit * float(np.linalg.norm(balance))

    def excess(self, x: Array) -> Array:
        """Distance by which each contact leaves its cone, negative inside, shape (c,)."""
        push = x[: len(self.mu)]
        distance = -push
        slip = np.linalg.norm(self.tangents(x), axis=1)
        slipping = self.slipping
        finite = np.isfinite(self.mu[slipping])
        inner = slipping[finite]
        distance[inner] = np.maximum(distance[inner], slip[finite] - self.mu[inner] * push[inner])
        return distance

    def replace(self, **changes: Any) -> Problem:
        """Copy with another weight or regularisation."""
        return replace(self, **changes)


def static_problem(packing: Packing, mu: Array, regularization: float) -> Problem:
    """Problem with exact balance and a least-squares fit of the stresses: (2.13), (2.14)."""
    return _problem(packing, mu, np.inf, regularization)


def dynamic_problem(packing: Packing, mu: Array, weight: float, *, moments: bool = True) -> Problem:
    """Problem that weighs balance against stresses: (3.18), (3.19); moments may be left out.

    Raises
    ------
    TypeError, ValueError
        If errors are known of only one of the two; if moments are left out although angular
        accelerations are given.
    """
    if not isinstance(moments, bool):
        raise TypeError(f"moments = {moments!r} must be True or False")
    if not moments and packing.inertias is not None:
        raise ValueError("moments = False must not be used with angular_accelerations")
    if (packing.stress_errors is None) != (packing.acceleration_errors is None):
        raise ValueError(
            "stress_errors and acceleration_errors must be given together: they are weighed "
            "against one another"
        )
    return _problem(packing, mu, weight, 0.0, moments)


def _problem(
    packing: Packing, mu: Array, weight: float, regularization: float, moments: bool = True
) -> Problem:
    d, R = packing.dim, packing.radius
    frame = _frame(packing, mu)
    lengths = np.tile(np.repeat([1.0, 1 / R], [d, rows_of(d) - d]), packing.n)
    mask = np.tile(np.repeat([True, moments], [d, rows_of(d) - d]), packing.n)
    stress_target = stress_vector(packing) / R
    balance_target = (lengths * momentum_vector(packing))[mask]
    force = _typical([stress_target, balance_target])
    balance = csr_array(equilibrium_matrix(packing).multiply(lengths[:, None]))[mask]
    of_stress, of_balance = _errors(packing)
    errors = of_stress if np.isinf(weight) else np.concatenate([of_stress, of_balance[mask]])
    usual = float(np.median(errors))
    known = packing.stress_errors is not None
    return Problem(
        frame=frame,
        mu=mu,
        stress=csr_array((stress_matrix(packing) / R) @ frame),
        balance=csr_array(balance @ frame),
        stress_target=stress_target / force,
        balance_target=balance_target / force,
        stress_scale=usual / of_stress,
        balance_scale=usual / of_balance[mask],
        weight=weight,
        regularization=regularization,
        force=force,
        length=R,
        unit=force / usual if known else force,
    )


def _errors(packing: Packing) -> tuple[Array, Array]:
    """Standard deviations [N] of the rows of stress and of balance; ones where unknown."""
    d, n, R = packing.dim, packing.n, packing.radius
    stress, balance = np.ones((n, rows_of(d))), np.ones((n, rows_of(d)))
    if packing.stress_errors is not None:
        stress *= (packing.volumes * packing.stress_errors / R)[:, None]
        stress[:, d:] *= 2.0
    if packing.acceleration_errors is not None and packing.masses is not None:
        balance *= (packing.masses * packing.acceleration_errors)[:, None]
        if packing.inertias is not None:
            inertias = packing.inertias
            if inertias.ndim == 3:
                inertias = np.trace(inertias, axis1=1, axis2=2) / 3
            rim = packing.acceleration_errors / packing.radii
            balance[:, d:] = (inertias * rim / R)[:, None]
    return stress.ravel(), balance.ravel()


def _typical(targets: Sequence[Array]) -> float:
    """Root mean square of the non-zero targets, so that rattlers do not lower it."""
    values = np.concatenate(targets)
    values = values[values != 0]
    return float(np.sqrt(np.mean(values**2))) if len(values) else 1.0


def _frame(packing: Packing, mu: Array) -> csr_array:
    """Columns -e of all contacts, then t of those with friction."""
    frames, d, c = contact_frames(packing.normals), packing.dim, len(mu)
    slipping = np.flatnonzero(mu > 0)
    axes = np.concatenate([-frames[:, 0], frames[slipping, 1:].reshape(-1, d)])
    contact = np.concatenate([np.arange(c), np.repeat(slipping, d - 1)])
    return sparse_blocks(axes[:, :, None], contact, np.arange(len(axes)), (c, len(axes)))


def listed(which: IndexArray) -> str:
    """List of the first few numbers, for messages."""
    text = ", ".join(str(k) for k in which[:8])
    return text + (f", ... ({len(which)} in all)" if len(which) > 8 else "")

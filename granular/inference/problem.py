"""The convex problem behind each inference, without units.

The unknowns of a contact are its push ``n = -e.f`` and, unless it is frictionless, the components
of f along its tangents, all over a typical force f0. With K the rows to be fitted (weights w_i, the
moments and stresses over a typical radius R), L those that hold exactly and a regularisation l,

    min  sum_i w_i |K_i x - b_i|^2 + l^2 |x|^2   s.t.  L x = c,  n >= 0,  |t| <= mu n.

Squares, where the thesis has norms: both run through the same solutions, see `weight_of_norms`.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_array, csr_array, vstack

from granular.inference.matrices import (
    contact_frames,
    equilibrium_matrix,
    momentum_vector,
    rows_of,
    stress_matrix,
    stress_vector,
)
from granular.inference.packing import Packing

__all__ = ["Problem", "dynamic_problem", "static_problem"]

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Problem:
    """Scaled rows and cones.

    Attributes
    ----------
    frame : csr_array, shape (d c, x)
        From unknowns to forces over `force`; orthonormal columns, pushes first.
    mu : ndarray, shape (c,)
        Friction of each contact, 0 and infinity included.
    stress, balance : csr_array
        Rows of the average stresses and of the balance of forces and moments.
    stress_target, balance_target : ndarray
        What they should give.
    weight : float
        Of the balance in the sum of squares; infinite where it must hold exactly.
    regularization : float
        l.
    force, length : float
        f0 [N] and R [m].
    """

    frame: csr_array
    mu: Array
    stress: csr_array
    balance: csr_array
    stress_target: Array
    balance_target: Array
    weight: float
    regularization: float
    force: float
    length: float

    @property
    def dim(self) -> int:
        return self.frame.shape[0] // len(self.mu)

    @property
    def slipping(self) -> NDArray[np.intp]:
        """Contacts that have tangential unknowns, in the order of these."""
        return np.flatnonzero(self.mu > 0)

    def tangents(self, x: Array) -> Array:
        """Tangential unknowns, a row for each of `slipping`."""
        return x[len(self.mu) :].reshape(-1, self.dim - 1)

    def soft(self) -> tuple[csr_array, Array]:
        """Rows to be fitted, times the roots of their weights, and their targets."""
        if np.isinf(self.weight):
            return self.stress, self.stress_target
        root = np.sqrt(self.weight)
        return (
            vstack([self.stress, root * self.balance], format="csr"),
            np.concatenate([self.stress_target, root * self.balance_target]),
        )

    def hard(self) -> tuple[csr_array, Array]:
        """Rows that hold exactly; none where the balance has a weight."""
        if np.isinf(self.weight):
            return self.balance, self.balance_target
        return csr_array((0, self.frame.shape[1])), np.zeros(0)

    def stacked(self) -> csr_array:
        """All rows without their weights: what their rank is taken of."""
        return vstack([self.balance, self.stress], format="csr")

    def residuals(self, x: Array) -> tuple[float, float]:
        """Lengths of what is left of stresses and balance, without unit."""
        left = self.stress @ x - self.stress_target, self.balance @ x - self.balance_target
        return float(np.linalg.norm(left[0])), float(np.linalg.norm(left[1]))

    def excess(self, x: Array) -> Array:
        """By how much each contact leaves its cone; negative inside, shape (c,)."""
        push = x[: len(self.mu)]
        found = -push
        slip = np.linalg.norm(self.tangents(x), axis=1)
        slipping = self.slipping
        finite = np.isfinite(self.mu[slipping])
        inner = slipping[finite]
        found[inner] = np.maximum(found[inner], slip[finite] - self.mu[inner] * push[inner])
        return found

    def replace(self, **changes: float) -> Problem:
        """The same with another weight or regularisation."""
        return replace(self, **changes)


def static_problem(packing: Packing, mu: Array, regularization: float) -> Problem:
    """Balance exactly, stresses as well as can be: (2.13), (2.14)."""
    return _problem(packing, mu, np.inf, regularization)


def dynamic_problem(packing: Packing, mu: Array, weight: float) -> Problem:
    """Balance and stresses against one another: (3.18), (3.19)."""
    return _problem(packing, mu, weight, 0.0)


def _problem(packing: Packing, mu: Array, weight: float, regularization: float) -> Problem:
    d, R = packing.dim, packing.radius
    frame = _frame(packing, mu)
    lengths = np.tile(np.repeat([1.0, 1 / R], [d, rows_of(d) - d]), packing.n)
    stress_target = stress_vector(packing) / R
    balance_target = lengths * momentum_vector(packing)
    force = _typical([stress_target, balance_target])
    balance = equilibrium_matrix(packing).multiply(lengths[:, None])
    return Problem(
        frame=frame,
        mu=mu,
        stress=csr_array((stress_matrix(packing) / R) @ frame),
        balance=csr_array(balance @ frame),
        stress_target=stress_target / force,
        balance_target=balance_target / force,
        weight=weight,
        regularization=regularization,
        force=force,
        length=R,
    )


def _typical(targets: Sequence[Array]) -> float:
    """Root mean square of what is not zero: rattlers must not make the others look large."""
    values = np.concatenate(targets)
    values = values[values != 0]
    return float(np.sqrt(np.mean(values**2))) if len(values) else 1.0


def _frame(packing: Packing, mu: Array) -> csr_array:
    """Columns -e of all contacts, then t of those with friction."""
    frames, d, c = contact_frames(packing.normals), packing.dim, len(mu)
    slipping = np.flatnonzero(mu > 0)
    axes = np.concatenate([-frames[:, 0], frames[slipping, 1:].reshape(-1, d)])
    contact = np.concatenate([np.arange(c), np.repeat(slipping, d - 1)])
    rows = d * contact[:, None] + np.arange(d)
    columns = np.broadcast_to(np.arange(len(axes))[:, None], rows.shape)
    entries = (axes.ravel(), (rows.ravel(), columns.ravel()))
    return coo_array(entries, (d * c, len(axes))).tocsr()

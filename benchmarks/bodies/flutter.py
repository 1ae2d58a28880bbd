"""Vibrations of an elastic block that slides with friction, by finite elements.

The lower side of the block stays on a rigid plane, on which it slides in one direction all the
time. A change of the normal force then changes the friction in proportion, whatever the velocity,
so that the matrix of the stiffness is not symmetric: M u'' + (K + mu T) u = 0. A pair of complex
eigenvalues is a vibration that grows (flutter).
"""

from __future__ import annotations

import math

import numpy as np
import scipy.linalg

from bodies.rows import CELL, RHO, Numbers
from granular.tools.arrays import Array

FLUTTER_HZ = 93.0
"""Frequency of the lowest vibration of the block that grows [Hz]."""

LONG, HIGH, E, NU = 10, 6, 1e6, 0.3


def _stiffness() -> tuple[Array, Array]:
    """Stiffness and lumped mass of squares of four nodes in plane strain, of the edge `CELL`."""
    lame, shear = E * NU / ((1 + NU) * (1 - 2 * NU)), E / (2 * (1 + NU))
    law = np.array([[lame + 2 * shear, lame, 0], [lame, lame + 2 * shear, 0], [0, 0, shear]])
    element = np.zeros((8, 8))
    for x, y in np.array([(a, b) for a in (-1, 1) for b in (-1, 1)]) / math.sqrt(3):
        slopes = np.array(
            [[y - 1, 1 - y, 1 + y, -1 - y], [x - 1, -1 - x, 1 + x, 1 - x]], dtype=float
        ) / (2 * CELL)
        strain = np.zeros((3, 8))
        strain[0, 0::2], strain[1, 1::2] = slopes
        strain[2, 0::2], strain[2, 1::2] = slopes[::-1]
        element += strain.T @ law @ strain * CELL**2 / 4
    n = (LONG + 1) * (HIGH + 1)
    whole, mass = np.zeros((2 * n, 2 * n)), np.zeros(2 * n)
    for row in range(HIGH):
        for column in range(LONG):
            first = row * (LONG + 1) + column
            nodes = np.array([first, first + 1, first + LONG + 2, first + LONG + 1])
            places = np.stack([2 * nodes, 2 * nodes + 1], axis=1).ravel()
            whole[np.ix_(places, places)] += element
            mass[places] += RHO * CELL**2 / 4
    return whole, mass


def flutter(friction: float) -> Numbers:
    """Growth [1/s] of the vibration next to `FLUTTER_HZ`, and the largest of all vibrations."""
    stiffness, mass = _stiffness()
    base = np.arange(LONG + 1)
    normal = 2 * base + 1
    free = np.setdiff1d(np.arange(len(mass)), normal)
    matrix = stiffness[np.ix_(free, free)]
    rows = np.searchsorted(free, 2 * base)
    matrix[rows] += friction * stiffness[np.ix_(normal, free)]
    rates = np.sqrt(-scipy.linalg.eigvals(matrix / mass[free][:, None]).astype(complex))
    rates = np.where(rates.real < 0, -rates, rates)
    hertz = abs(rates.imag) / (2 * math.pi)
    near = np.argmin(abs(hertz - FLUTTER_HZ))
    return {
        "rate": float(rates[near].real),
        "hertz": float(hertz[near]),
        "largest": float(rates.real.max()),
        "deepest": -1.0,
    }

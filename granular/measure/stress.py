"""Invariants of stress arrays with rows xx, yy, zz, xy (2D) or xx, yy, zz, xy, yz, xz (3D)."""

import numpy as np

from granular.measure.averaging_grid import values
from granular.model.state import State
from granular.tools.arrays import Array


def pressure(stress: Array) -> Array:
    """Pressure ``-tr(stress)/3`` [Pa], compression positive, shape (n,)."""
    return -stress[:, :3].sum(axis=1) / 3


def deviator_squared(stress: Array) -> Array:
    """Square ``s : s`` of the deviator s [Pa2], shape (n,); shear components count twice."""
    normal = stress[:, :3] + pressure(stress)[:, None]
    return (normal**2).sum(axis=1) + 2 * (stress[:, 3:] ** 2).sum(axis=1)


def friction_of(stress: Array) -> Array:
    """Friction coefficient ``sqrt(s : s/2)/p``, shape (n,); nan where p <= 0."""
    p = pressure(stress)
    tau = np.sqrt(deviator_squared(stress) / 2)
    return np.divide(tau, p, out=np.full_like(p, np.nan), where=p > 0)


def friction(state: State) -> Array:
    """Friction coefficient mu = tau/p of every point.

    ``tau = sqrt(s : s/2)`` with the deviator s (Dunatunga & Kamrin 2015, eq. 2.10).

    Returns
    -------
    ndarray, shape (n,)
        nan where the point is free of stress.

    Raises
    ------
    ValueError
        If the state is empty.
    """
    return friction_of(values(state, "stress"))

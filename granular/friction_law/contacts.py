"""What the contacts of one frame of a shear flow say: stress, dissipation, numbers."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from granular.checks import in_range
from granular.dem import Contacts, Frame, Grains

__all__ = ["Sample", "dissipation", "sample"]

Array = NDArray[np.float64]

_AT_LIMIT = 1.0 - 1e-3
"""Share of the largest tangential force from which on a contact is counted as slipping."""


@dataclass(frozen=True)
class Sample:
    """Sums over one frame, or over a layer of it.

    Attributes
    ----------
    time, shear_rate : float
        [s], [1/s]
    volume, solid : float
        Of the cell and of the grains in it [m3].
    grains, contacts, slipping : float
        Numbers; of the grains that share of each which is in the layer, of the contacts those
        whose point is; slipping ones are at the limit of friction (reported, used for nothing).
    stress : ndarray, shape (3, 3)
        Mean stress, tension positive [Pa], of contacts and motion; row the direction of the branch.
    kinetic : ndarray, shape (3, 3)
        The part of it that the motion relative to the mean flow carries.
    viscoelastic, sliding : float
        Dissipated power in all contacts [W]; the latter is the power of all tangential forces.
    """

    time: float
    shear_rate: float
    volume: float
    solid: float
    grains: float
    contacts: float
    slipping: float
    stress: Array
    kinetic: Array
    viscoelastic: float
    sliding: float


def dissipation(
    contacts: Contacts, radius: Array, mass: Array, grains: Grains
) -> tuple[Array, Array]:
    """Dissipated power of each contact (thesis, eq. 4.8).

    ``Gamma_n = m R gamma_n sqrt(delta) v_n^2`` with ``m = mi mj/(mi + mj)`` and
    ``R = sqrt(Ri Rj/(Ri + Rj))``; one of the two v_n is `Contacts.damped_velocity`, because that is
    what the viscous force was made with: with the same twice two per cent would be missing, more
    where grains collide hard. The tangential ``-F_t . v_t`` is taken over all contacts: over
    those that slip alone it would miss what a spring loses when its contact opens or eases. For a
    contact that sticks it also holds what the spring stores and gives back, nothing on average.

    Parameters
    ----------
    contacts : Contacts
        Of k contacts.
    radius, mass : ndarray, shape (n,)
        Of the grains [m], [kg].
    grains : Grains

    Returns
    -------
    normal, tangential : ndarray, shape (k,)
        [W]
    """
    i, j = contacts.i, contacts.j
    reduced = mass[i] * mass[j] / (mass[i] + mass[j])
    curvature = np.sqrt(radius[i] * radius[j] / (radius[i] + radius[j]))
    overlap = np.maximum(radius[i] + radius[j] - contacts.distance, 0.0)
    squared = np.einsum("ka,ka->k", contacts.normal_velocity, contacts.damped_velocity)
    normal = reduced * curvature * grains.gamma_n * np.sqrt(overlap) * squared
    tangential = -np.einsum("ka,ka->k", contacts.tangential_force, contacts.tangential_velocity)
    return normal, tangential


def sample(frame: Frame, grains: Grains, layer: tuple[float, float] | None = None) -> Sample:
    """The sums of a frame.

    Parameters
    ----------
    frame : Frame
    grains : Grains
    layer : (float, float), optional
        Lower and upper end of the layer to look at, as shares of the height between the walls. It
        is needed with walls, where the shear rate is the slope of the velocity in the layer, and
        refused without.

    Raises
    ------
    ValueError
        If the layer is missing, not wanted, empty or outside of [0, 1].
    """
    if not np.isfinite(frame.shear_rate) and layer is None:
        raise ValueError("layer = None: between walls a layer (low, high) must be given")
    if np.isfinite(frame.shear_rate) and layer is not None:
        raise ValueError(f"layer = {layer} must be None in a homogeneous cell")
    if layer is None:
        low, high = -np.inf, np.inf
        share, inside = np.ones(len(frame.id)), np.ones(len(frame.contacts.i), dtype=bool)
        volume, slope = float(frame.box.prod()), frame.shear_rate
    else:
        low, high = _heights(frame, layer)
        share = _share_between(frame.x[:, 1], frame.radius, low, high)
        share[frame.wall] = 0.0
        points = frame.contact_points[:, 1]
        inside = (points >= low) & (points < high)
        volume = float(frame.box[0] * frame.box[2] * (high - low))
        slope = np.nan
    moving = (frame.x[:, 1] >= low) & (frame.x[:, 1] < high) & ~frame.wall
    slope, relative = _relative_motion(frame, moving, slope)
    c = frame.contacts
    m = frame.mass[moving]
    kinetic = -np.einsum("n,na,nb->ab", m, relative, relative) / volume
    static = -np.einsum("ka,kb->ab", c.branch[inside], c.force[inside]) / volume
    normal, tangential = dissipation(c, frame.radius, frame.mass, grains)
    pull = np.linalg.norm(c.tangential_force, axis=1)
    slipping = pull >= _AT_LIMIT * grains.mu_p * np.abs(c.normal_force)
    return Sample(
        time=frame.time,
        shear_rate=float(slope),
        volume=volume,
        solid=float(np.sum(share * 4.0 / 3.0 * np.pi * frame.radius**3)),
        grains=float(share.sum()),
        contacts=float(np.count_nonzero(inside)),
        slipping=float(np.count_nonzero(slipping & inside)),
        stress=static + kinetic,
        kinetic=kinetic,
        viscoelastic=float(normal[inside].sum()),
        sliding=float(tangential[inside].sum()),
    )


def _heights(frame: Frame, layer: tuple[float, float]) -> tuple[float, float]:
    """Ends of a layer [m]."""
    low = in_range("layer[0]", layer[0], 0.0, 1.0)
    high = in_range("layer[1]", layer[1], 0.0, 1.0)
    if not high > low:
        raise ValueError(f"layer = {layer} must have its low end first")
    free = ~frame.wall
    bottom = float(np.min(frame.x[free, 1] - frame.radius[free]))
    top = float(np.max(frame.x[free, 1] + frame.radius[free]))
    return bottom + low * (top - bottom), bottom + high * (top - bottom)


def _share_between(y: Array, radius: Array, low: float, high: float) -> Array:
    """Share of the volume of spheres between two heights."""

    def below(height: float) -> Array:
        h = np.clip((height - y) / radius, -1.0, 1.0) + 1.0  # of a cap, in radii
        return h**2 * (3.0 - h) / 4.0

    return below(high) - below(low)


def _relative_motion(frame: Frame, moving: NDArray[np.bool_], slope: float) -> tuple[float, Array]:
    """Shear rate, fitted if it is nan, and velocities relative to that flow."""
    count = int(np.count_nonzero(moving))
    if count < 2:
        raise ValueError(f"the layer holds {count} grains, at least 2 are needed")
    m, v = frame.mass[moving], frame.v[moving]
    y = frame.x[moving, 1] - np.average(frame.x[moving, 1], weights=m)
    if np.isnan(slope):
        slope = float(np.sum(m * y * v[:, 0]) / np.sum(m * y**2))
    relative = v - np.average(v, axis=0, weights=m)
    relative[:, 0] -= slope * y
    return slope, relative

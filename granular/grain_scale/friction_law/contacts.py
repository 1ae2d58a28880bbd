"""Sums over the contacts of one frame of a shear flow: stress, dissipation, numbers."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from granular.grain_scale.dem import Contacts, Frame, Grains
from granular.tools.arrays import Array, BoolArray
from granular.tools.checks import in_range

_AT_LIMIT = 1.0 - 1e-3
"""A contact counts as slipping above this share of the largest tangential force."""


@dataclass(frozen=True)
class Sample:
    """Sums over one frame, or over a layer of it.

    Attributes
    ----------
    time, shear_rate : float
        Time [s] and shear rate [1/s].
    volume, solid : float
        Volume of the cell and of the grains in it [m3].
    grains, contacts, slipping : float
        Numbers. A grain counts by the share of its volume that is in the layer, a contact if its
        point is in the layer. Slipping contacts are at the limit of friction; their number is only
        reported.
    stress : ndarray, shape (3, 3)
        Mean stress due to contacts and motion, tension positive [Pa]; the row is the direction of
        the branch vector.
    kinetic : ndarray, shape (3, 3)
        Part of the stress that is due to the motion relative to the mean flow [Pa].
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

    The normal part is ``Gamma_n = m R gamma_n sqrt(delta) v_n^2`` with ``m = mi mj/(mi + mj)`` and
    ``R = sqrt(Ri Rj/(Ri + Rj))``. One of the two v_n is `Contacts.damped_velocity`, from which the
    viscous force was computed; with the same v_n twice, two per cent would be missing, more
    where grains collide hard. The tangential part ``-F_t . v_t`` includes all contacts: with only
    the slipping ones it would miss the energy that a spring loses as its contact opens or unloads.
    For sticking contacts it also contains the energy that the spring stores and returns, which is
    zero on average.

    Parameters
    ----------
    contacts : Contacts
        The k contacts.
    radius, mass : ndarray, shape (n,)
        Radii [m] and masses [kg] of the grains.

    Returns
    -------
    normal, tangential : ndarray, shape (k,)
        Dissipated powers [W].
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
    """Compute the sums of a frame.

    Parameters
    ----------
    layer : (float, float), optional
        Layer to evaluate in a flow between walls: its ends as fractions of the height. Its shear
        rate is the slope of the velocity in the layer. By default the whole flow is evaluated;
        between walls the shear rate then follows from their speeds and distance.

    Raises
    ------
    ValueError
        If the layer is empty or outside [0, 1], or given for a flow without walls; without a layer,
        if there is only one wall.
    """
    if layer is not None and not frame.wall.any():
        raise ValueError(f"layer = {layer} must be None in a flow without walls")
    part = _whole(frame) if layer is None else _layer(frame, layer)
    inside, volume = part.contacts, part.volume
    moving = (frame.x[:, 1] >= part.low) & (frame.x[:, 1] < part.high) & ~frame.wall
    slope, relative = _relative_motion(frame, moving, part.shear_rate)
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
        solid=float(np.sum(part.share * 4.0 / 3.0 * np.pi * frame.radius**3)),
        grains=float(part.share.sum()),
        contacts=float(np.count_nonzero(inside)),
        slipping=float(np.count_nonzero(slipping & inside)),
        stress=static + kinetic,
        kinetic=kinetic,
        viscoelastic=float(normal[inside].sum()),
        sliding=float(tangential[inside].sum()),
    )


@dataclass(frozen=True)
class _Part:
    """Part of a frame to evaluate: heights, grains, contacts, and the shear rate if it is known."""

    low: float
    high: float
    volume: float
    share: Array
    contacts: BoolArray
    shear_rate: float


def _whole(frame: Frame) -> _Part:
    """The whole cell, or the whole flow between the walls."""
    free, every = ~frame.wall, np.ones(len(frame.contacts.i), dtype=bool)
    if free.all():
        volume, rate = float(frame.box.prod()), frame.shear_rate
        return _Part(-np.inf, np.inf, volume, free.astype(float), every, rate)
    low, high = _gap(frame)
    upper = frame.wall & (frame.x[:, 1] > 0.5 * (low + high))
    lower = frame.wall & ~upper
    if not (upper.any() and lower.any()):
        raise ValueError("the frame has a wall on one side only: give the layer to evaluate")
    speed = float(frame.v[upper, 0].mean() - frame.v[lower, 0].mean())
    volume = float(frame.box[0] * frame.box[2] * (high - low))
    return _Part(-np.inf, np.inf, volume, free.astype(float), every, speed / (high - low))


def _layer(frame: Frame, layer: tuple[float, float]) -> _Part:
    """A layer between walls."""
    first = in_range("layer[0]", layer[0], 0.0, 1.0)
    last = in_range("layer[1]", layer[1], 0.0, 1.0)
    if not last > first:
        raise ValueError(f"layer = {layer} must have its low end first")
    bottom, top = _gap(frame)
    low, high = bottom + first * (top - bottom), bottom + last * (top - bottom)
    share = _share_between(frame.x[:, 1], frame.radius, low, high)
    share[frame.wall] = 0.0
    y = frame.contact_points[:, 1]
    volume = float(frame.box[0] * frame.box[2] * (high - low))
    return _Part(low, high, volume, share, (y >= low) & (y < high), np.nan)


def _gap(frame: Frame) -> tuple[float, float]:
    """Ends of the material between walls [m]."""
    free = ~frame.wall
    bottom = float(np.min(frame.x[free, 1] - frame.radius[free]))
    return bottom, float(np.max(frame.x[free, 1] + frame.radius[free]))


def _share_between(y: Array, radius: Array, low: float, high: float) -> Array:
    """Share of the volume of each sphere that lies between two heights."""

    def below(height: float) -> Array:
        h = np.clip((height - y) / radius, -1.0, 1.0) + 1.0  # height of the cap, in radii
        return h**2 * (3.0 - h) / 4.0

    return below(high) - below(low)


def _relative_motion(frame: Frame, moving: BoolArray, slope: float) -> tuple[float, Array]:
    """Shear rate (fitted if `slope` is nan), and velocities relative to that shear flow."""
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

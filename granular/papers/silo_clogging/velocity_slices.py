"""Vertical velocity across a flowing silo, and a diffusing Gaussian fitted to it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import scipy
from numpy.typing import ArrayLike

from granular.measure.averages import frame_average
from granular.measure.opening import Opening, each_state, opening_of
from granular.measure.result import Result, Table
from granular.model.state import States
from granular.tools.arrays import Array
from granular.tools.checks import positive

HEIGHTS = (1.5, 2.0, 2.5)
"""Heights of the slices in the paper, in widths of the opening."""

_SCAN = 40
"""Number of values of B tried before the minimum is refined."""


@dataclass(frozen=True)
class VelocitySlices(Result, x="m", heights="m", velocity="m/s", d="m"):
    """Vertical velocity along horizontal lines.

    Attributes
    ----------
    x : ndarray, shape (k,)
        Distance from the middle of the opening [m].
    heights : ndarray, shape (m,)
        Heights above the bottom [m].
    velocity : ndarray, shape (m, k)
        Vertical velocity, upwards positive [m/s]; nan where there is no material.
    d : float or None
        Grain diameter [m], if the material defines it.
    frames : int
        Number of frames averaged over.
    """

    x: Array
    heights: Array
    velocity: Array
    d: float | None
    frames: int

    def _table(self) -> Table:
        height, x = (part.ravel() for part in np.meshgrid(self.heights, self.x, indexing="ij"))
        columns = {"height": height, "x": x, "velocity": self.velocity.ravel()}
        constants = {"d": self.d, "frames": self.frames}
        return Table(columns, constants, {**self.UNITS, "height": "m"})


@dataclass(frozen=True)
class GaussianFit(Result, B="m", B_error="m", amplitude="m/s", offset="m/s", B_each="m", rms="m/s"):
    """Fit of ``v = C exp(-x**2/(4 B y)) + offset`` over several heights y, with one common B.

    Attributes
    ----------
    B : float
        Diffusion length [m].
    B_error : float
        Standard error of B in the regression [m]. It is a lower bound: the errors of neighbouring
        nodes are not independent, because they share points.
    B_over_d : float or None
        B in grain diameters, if d is known.
    amplitude : ndarray, shape (m,)
        C at each height [m/s].
    offset : ndarray, shape (m,)
        Offset at each height [m/s].
    B_each : ndarray, shape (m,)
        B of each height fitted alone [m]. All are equal if the square of the width is proportional
        to the height. nan where a height alone has no best B in the range of `gaussian_fit`.
    r_squared : float
        One minus the residual sum of squares divided by that about the mean of each height.
    rms : float
        Root mean square of the residuals [m/s].
    """

    B: float
    B_error: float
    B_over_d: float | None
    amplitude: Array
    offset: Array
    B_each: Array
    r_squared: float
    rms: float


def velocity_slices(
    states: States, heights: ArrayLike = HEIGHTS, *, opening: Opening | None = None
) -> VelocitySlices:
    """Vertical velocity across a silo at some heights, averaged over frames.

    The velocity is the mass-weighted mean at the nodes (`frame_average`), interpolated linearly
    between rows of nodes. Averaging and interpolating change it by at most ``cell**2/6`` and
    ``cell**2/8`` times a second derivative of the velocity. The variance 2 B y of a Gaussian grows
    by cell**2/6.

    Parameters
    ----------
    states : State or iterable of State
    heights : array_like, shape (m,)
        Heights above the bottom, in widths of the opening, ascending (Dunatunga & Kamrin, Modelling
        silo clogging, figures 6 and 7).

    Raises
    ------
    TypeError, ValueError
        As `frame_average`; also if the heights are not positive and ascending, one is not within
        the grid, or there is no material.
    """
    states = list(each_state(states))
    where = opening_of(states[0], opening)
    up = np.atleast_1d(np.asarray(heights, dtype=float))
    if up.ndim != 1 or not len(up) or not (np.all(up > 0) and np.all(np.diff(up) > 0)):
        raise ValueError(f"heights = {heights!r} must be positive and ascending, at least one")
    up = up * where.width
    mean = frame_average(states, lambda state: state.v[:, 1], at="nodes")
    x, y = mean.axes[0] - where.axis, mean.axes[1] - where.floor
    if not up[-1] <= y[-1] + 1e-9 * (y[1] - y[0]):
        raise ValueError(f"heights = {heights!r} reach {up[-1]:.6g} m, the grid {y[-1]:.6g} m")
    velocity = np.stack([_row(mean.value, y, height) for height in up])
    for height, row in zip(up, velocity, strict=True):
        if not np.isfinite(row).any():
            raise ValueError(f"heights = {heights!r}: no material at {height:.6g} m")
    d = getattr(states[0].scene.material, "d", None)
    return VelocitySlices(x, up, velocity, d, mean.frames)


def _row(nodal: Array, y: Array, height: float) -> Array:
    """Interpolate linearly in y between rows of nodes; at a row, use it alone.

    The other row may be empty there.
    """
    at = (height - y[0]) / (y[1] - y[0])
    low = int(np.clip(np.floor(at + 1e-9), 0, len(y) - 1))
    share = at - low
    if abs(share) < 1e-9:
        return nodal[:, low]
    return (1 - share) * nodal[:, low] + share * nodal[:, low + 1]


def gaussian_fit(slices: VelocitySlices, *, d: float | None = None) -> GaussianFit:
    """Fit the diffusing Gaussian to slices of vertical velocity, all heights jointly.

    The law is ``v = C exp(-x**2/(4 B y)) + offset``, where x is measured from the middle and y from
    the bottom of the opening. B is common to all heights; C and the offset are fitted at each
    height. The offset allows for free-slip walls, along which the material at the sides sinks too
    (Dunatunga & Kamrin, Modelling silo clogging, section 7.2 and figure 7, where B = 0.6 d at
    A = 0.5, W/d = 5). C is negative where the flow is downwards. The fit is by least squares with
    equal weights of all nodes.

    Parameters
    ----------
    d : float, optional
        Grain diameter [m]; by default that of the slices.

    Raises
    ------
    TypeError, ValueError
        If a height has fewer than 4 nodes with material, or the best B is out of range. The range
        is such that ``sqrt(4 B y)`` is at least half the spacing of nodes at the top height, and at
        most twice the largest distance at the lowest height. Equal velocities have no best B.
    """
    if not isinstance(slices, VelocitySlices):
        raise TypeError(f"slices = {slices!r} must be VelocitySlices")
    d = slices.d if d is None else positive("d", d)
    rows = []
    for height, v in zip(slices.heights, slices.velocity, strict=True):
        known = np.isfinite(v)
        if known.sum() < 4:
            raise ValueError(
                f"slices have {known.sum()} nodes with material at height {height:.6g} m, at least "
                "4 are needed"
            )
        rows.append((slices.x[known] ** 2 / (4 * height), v[known]))
    tried = _tried(slices)
    B = _best(rows, tried)
    if B is None:
        raise ValueError(
            f"slices: B must be between {tried[0]:.3g} and {tried[-1]:.3g} m, the best fit is not"
        )
    parts = np.array([_linear(row, B)[0] for row in rows])
    squares = _left(np.log(B), rows)
    about = np.concatenate([v - v.mean() for _, v in rows])
    alone = [_best([row], tried) for row in rows]
    return GaussianFit(
        B=B,
        B_error=_standard_error(rows, B, parts, squares),
        B_over_d=None if d is None else B / d,
        amplitude=parts[:, 0],
        offset=parts[:, 1],
        B_each=np.array([np.nan if each is None else each for each in alone]),
        r_squared=float(1 - squares / np.sum(about**2)),
        rms=float(np.sqrt(squares / len(about))),
    )


Row = tuple[Array, Array]
"""``x**2/(4 y)`` and the velocity of the nodes at one height."""


def _tried(slices: VelocitySlices) -> Array:
    """Values of B of Gaussians that the nodes resolve: wider than one node, narrower than all."""
    low = np.diff(slices.x).min() ** 2 / (16 * slices.heights.max())
    high = np.abs(slices.x).max() ** 2 / slices.heights.min()
    return np.geomspace(low, high, _SCAN)


def _linear(row: Row, B: float) -> tuple[Array, float]:
    """C and offset of one height at a given B, and the residual sum of squares."""
    matrix = np.stack([np.exp(-row[0] / B), np.ones_like(row[0])], axis=1)
    part = np.linalg.lstsq(matrix, row[1], rcond=None)[0]
    return part, float(np.sum((row[1] - matrix @ part) ** 2))


def _left(log_B: float, rows: Sequence[Row]) -> float:
    return sum(_linear(row, np.exp(log_B))[1] for row in rows)


def _best(rows: Sequence[Row], tried: Array) -> float | None:
    """B with the least residual sum of squares; None if it is not within the range tried.

    C and the offsets enter linearly, so that only B has to be searched for.
    """
    if max(float(np.ptp(v)) for _, v in rows) <= 1e-12 * max(np.abs(v).max() for _, v in rows):
        return None
    log_B = np.log(tried)
    i = int(np.argmin([_left(at, rows) for at in log_B]))
    if i in (0, len(tried) - 1):
        return None
    minimum = scipy.optimize.minimize_scalar(
        _left, args=(rows,), bounds=log_B[[i - 1, i + 1]], method="bounded", options={"xatol": 1e-9}
    )
    return float(np.exp(minimum.x))


def _standard_error(rows: Sequence[Row], B: float, parts: Array, squares: float) -> float:
    """Standard error of B, from the derivatives with respect to all parameters.

    The derivative with respect to B is first made orthogonal to those with respect to C and the
    offset of each height.
    """
    alone = 0.0
    for (s, _), (C, _) in zip(rows, parts, strict=True):
        slope = C * np.exp(-s / B) * s / B**2
        alone += _linear((s, slope), B)[1]
    free = sum(len(s) for s, _ in rows) - 1 - parts.size
    return float(np.sqrt(squares / free / alone))

"""Flow of a dense layer down a rough incline: steady profile and transient.

Axes as in Dunatunga & Kamrin 2015, figure 8: x down the slope, y normal to it, y = 0 at the
rough base, y = height at the free surface.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
import scipy
from numpy.typing import ArrayLike

from granular.materials import MuI, RegularisedMuI
from granular.model.gravity import EARTH
from granular.tools.arrays import Array
from granular.tools.checks import in_range, integer, non_negative, positive

# Alexander's (1977) L-stable, stiffly accurate SDIRK method of order 3: the diagonal is the root
# of x^3 - 3x^2 + 3x/2 - 1/6 in (1/6, 1/2). The first two stages alone give a rule of order 2.
_DIAGONAL = 0.435866521508458999416
_NODES = (_DIAGONAL, (1 + _DIAGONAL) / 2, 1.0)
_STAGES = (
    (),
    ((1 - _DIAGONAL) / 2,),
    (-(6 * _DIAGONAL**2 - 16 * _DIAGONAL + 1) / 4, (6 * _DIAGONAL**2 - 20 * _DIAGONAL + 5) / 4),
)
_LOW_2 = (0.5 - _NODES[0]) / (_NODES[1] - _NODES[0])
_ERROR_WEIGHTS = (_STAGES[2][0] - (1 - _LOW_2), _STAGES[2][1] - _LOW_2, _DIAGONAL)


def bagnold_profile(
    y: ArrayLike, angle_deg: float, height: float, material: MuI, gravity: float = EARTH
) -> Array:
    """Steady velocity down a rough incline (Dunatunga & Kamrin 2015, eq. 4.6).

    ``v(y) = (2/3) xi A sqrt(rho g cos t) [h^1.5 - (h - y)^1.5]`` with
    ``A = (tan t - mu_s)/(mu_2 - tan t)`` and the bulk density ``rho = rho_c``.

    Parameters
    ----------
    y : array_like
        Distance from the base [m], any shape, within [0, height].
    angle_deg : float
        Inclination [degrees], in [0, 90).
    height : float
        Thickness of the layer, normal to the base [m], > 0.
    material : MuI
        Or any object with ``mu_s``, ``mu_2``, ``xi`` [1/sqrt(kg/m)] and ``rho_c`` [kg/m3].

    Returns
    -------
    ndarray
        Velocity [m/s], of the shape of `y`; zero at or below the angle atan(mu_s).

    Raises
    ------
    TypeError, ValueError
        If an argument is out of range, the angle is at or above atan(mu_2), where no steady flow
        exists, `y` is outside the layer, or the material has a cohesion or another law than mu(I).
    """
    shape = bagnold_shape(y, height)
    scale = _steady_scale(angle_deg, material, gravity)
    return (2 / 3) * scale * height**1.5 * shape


def bagnold_shape(y: ArrayLike, height: float) -> Array:
    """`bagnold_profile` divided by its value at the surface, ``1 - (1 - y/h)^1.5``.

    It does not depend on the material. `y` and `height` are those of `bagnold_profile`; the result
    has the shape of `y`.

    Raises
    ------
    TypeError, ValueError
        If `height` is not positive, or `y` is outside the layer.
    """
    return 1 - relative_depth(y, height) ** 1.5


def relative_depth(y: ArrayLike, height: float) -> Array:
    """Relative depth ``1 - y/height`` within the layer, 1 at the base and 0 at the surface.

    Raises
    ------
    TypeError, ValueError
        If `height` is not positive, or `y` is outside the layer.
    """
    y = np.asarray(y, dtype=float)
    positive("height", height)
    # Round-off of mid-points and of linspace must not count as outside.
    slack = 1e-12 * height
    if y.size and not (np.min(y) >= -slack and np.max(y) <= height + slack):
        raise ValueError(f"y in [{np.min(y)}, {np.max(y)}] must lie within [0, height = {height}]")
    return np.clip(1 - y / height, 0.0, 1.0)


def bagnold_mean(angle_deg: float, height: float, material: MuI, gravity: float = EARTH) -> float:
    """Depth-averaged steady velocity [m/s] (Dunatunga & Kamrin 2015, eq. 4.7).

    ``vbar = (2/5) xi A sqrt(rho g cos t) h^1.5`` is the mean of `bagnold_profile` over the height;
    arguments and errors are the same.
    """
    positive("height", height)
    return 0.4 * _steady_scale(angle_deg, material, gravity) * height**1.5


def _steady_scale(angle_deg: float, material: MuI, gravity: float) -> float:
    """xi A sqrt(rho g cos t): the shear rate at unit depth [1/(s sqrt(m))]."""
    check_mu_I(material)
    angle = _angle(angle_deg)
    positive("gravity", gravity)
    slope = math.tan(angle)
    if slope >= material.mu_2:
        limit = math.degrees(math.atan(material.mu_2))
        raise ValueError(
            f"angle_deg = {angle_deg} must be below atan(mu_2) = {limit:.6g}: "
            "the flow accelerates without end"
        )
    if slope <= material.mu_s:
        return 0.0
    ratio = (slope - material.mu_s) / (material.mu_2 - slope)
    return material.xi * ratio * math.sqrt(material.rho_c * gravity * math.cos(angle))


def check_mu_I(material: Any) -> None:
    """Refuse a material of another law: these solutions are of mu(I) without cohesion."""
    check_not_regularised(material)
    check_not_dilating(material)
    if getattr(material, "rheology", "mu_I") == "linear_mu_I":
        raise ValueError('rheology = "linear_mu_I" must be "mu_I": this is a solution of mu(I)')
    check_cohesionless(material)


def check_cohesionless(material: Any) -> None:
    """Refuse a material with cohesion: its friction tau/p is not a function of I alone."""
    if cohesion := getattr(material, "cohesion", 0.0):
        raise ValueError(f"cohesion = {cohesion} of the material must be 0 for this theory")


def check_not_dilating(material: Any) -> None:
    """Refuse material that dilates: its density changes with the rate, and its friction with it."""
    if getattr(material, "dilates", False):
        raise TypeError(f"material = {material!r} must be of a law without dilation")


def check_not_regularised(material: Any) -> None:
    """Refuse the regularised mu(I): it has no yield stress, and its mu_s is not that of mu(I)."""
    if isinstance(material, RegularisedMuI):
        raise TypeError(f"material = {material!r} must be of a law with a yield stress")


def _angle(angle_deg: float) -> float:
    return math.radians(in_range("angle_deg", angle_deg, 0.0, 90.0, open_high=True))


@dataclass(frozen=True)
class InclineTransient:
    """Velocity of the layer over time.

    Attributes
    ----------
    y : ndarray, shape (cells + 1,)
        Distance of the nodes from the base [m].
    times : ndarray, shape (nt,)
        Output times [s].
    v : ndarray, shape (nt, cells + 1)
        Velocity down the slope at the nodes [m/s].
    mean : ndarray, shape (nt,)
        Depth average of `v` [m/s].
    y_mid : ndarray, shape (cells,)
        Distance of the cell centres from the base [m].
    shear_rate, shear_stress : ndarray, shape (nt, cells)
        dv/dy [1/s] and tau [Pa] at the cell centres; both zero at t = 0, before gravity acts.
    """

    y: Array
    times: Array
    v: Array
    mean: Array
    y_mid: Array
    shear_rate: Array
    shear_stress: Array


def transient(
    angle_deg: float,
    height: float,
    material: MuI,
    times: ArrayLike,
    gravity: float = EARTH,
    ramp: float = 0.1,
    cells: int = 200,
    rtol: float = 1e-6,
) -> InclineTransient:
    """Start-up of the layer from rest, a one-dimensional momentum balance.

    The equation is ``rho dv/dt = dtau/dy + rho g sin t`` with ``p = rho g cos t (h - y)``, v = 0 at
    the base and tau = 0 at the surface. Gravity rises linearly over `ramp` seconds. The law is the
    rigid-plastic mu(I) law (Dunatunga & Kamrin 2015, eq. 2.13).

    In this law tau is not a function of the shear rate: below yield tau is undetermined and the
    shear rate is exactly zero. Instead of being regularised, the law is parametrised by a
    coordinate z along its graph::

        shear rate = xi sqrt(p) max(z, 0)
        tau/p      = mu_s + (mu_2 - mu_s) (z if z < 0 else z/(1 + z))

    A layer below mu_s therefore has exactly zero flow, and mu_2 is never reached. The scheme is
    staggered and of second order in the cell size. In time it is of third order (Alexander's
    L-stable SDIRK method with step control). If the layer starts from rest, tau is never negative,
    so that the branch of reversed shear is not needed.

    Parameters
    ----------
    angle_deg, height, material, gravity
        As in `bagnold_profile`; any angle in [0, 90).
    times : array_like, shape (nt,)
        Output times [s], not decreasing, >= 0.
    ramp : float
        Duration of the gravity ramp [s]; 0 for full gravity from the start.
    cells : int
        Number of cells over the height, at least 2.
    rtol : float
        Tolerance of a time step, > 0, relative to the largest velocity reached.

    Raises
    ------
    TypeError, ValueError
        If an argument is out of range, or the material has a cohesion or another law than mu(I).
    RuntimeError
        If the step size falls to round-off.
    """
    times = output_times(times)
    layer = _Layer(
        _angle(angle_deg),
        positive("height", height),
        material,
        positive("gravity", gravity),
        non_negative("ramp", ramp),
        integer("cells", cells, 2),
    )
    positive("rtol", rtol)
    shear_rate, z = map(np.array, zip(*_march(layer, times, rtol), strict=True))
    v = layer.velocity(shear_rate)
    return InclineTransient(
        y=np.linspace(0.0, height, cells + 1),
        times=times,
        v=v,
        mean=(v[:, 1:] + v[:, :-1]).mean(axis=1) / 2,
        y_mid=height - layer.depth,
        shear_rate=shear_rate,
        shear_stress=layer.friction(z)
        * (layer.pressure(times) * (times > 0))[:, None]
        * layer.depth,
    )


def output_times(times: ArrayLike) -> Array:
    """Return `times` as an array [s]; ValueError unless finite, >= 0 and not decreasing."""
    times = np.atleast_1d(np.asarray(times, dtype=float))
    if times.ndim != 1 or times.size == 0 or not np.all(np.isfinite(times)):
        raise ValueError(f"times = {times} must be a non-empty list of finite seconds")
    if times[0] < 0 or np.any(np.diff(times) < 0):
        raise ValueError(f"times = {times} must be >= 0 and must not decrease")
    return times


class _Layer:
    """Discretisation of the layer over its depth.

    The unknown is dv/dy at the cell centres, with rho d(dv/dy)/dt = d2tau/dy2.
    """

    def __init__(
        self, angle: float, height: float, material: MuI, gravity: float, ramp: float, cells: int
    ) -> None:
        check_mu_I(material)
        self.cells, self.ramp = cells, ramp
        self.dy = height / cells
        self.depth = height - self.dy * (np.arange(cells, dtype=float) + 0.5)
        self.weight = material.rho_c * gravity * math.cos(angle)  # dp/d(depth) [Pa/m]
        self.push = gravity * math.sin(angle)
        self.mu_s, self.span = material.mu_s, material.mu_2 - material.mu_s
        self.xi = material.xi
        # Bands of the operator tau -> (1/rho) d2tau/dy2. The node at the base has no acceleration;
        # the node at the surface carries half a cell of mass and no stress above it.
        bands = np.ones((3, cells))
        bands[1] = -2.0
        bands[1, 0], bands[1, -1] = -1.0, -3.0
        bands /= material.rho_c * self.dy**2
        self.bands = bands

    def ramp_factor(self, time: ArrayLike) -> Array:
        time = np.asarray(time, dtype=float)
        return np.minimum(time / self.ramp, 1.0) if self.ramp > 0 else np.ones_like(time)

    def pressure(self, time: ArrayLike) -> Array:
        """Gradient of the pressure with depth at a time [Pa/m]."""
        return self.weight * self.ramp_factor(time)

    def friction(self, z: Array) -> Array:
        return self.mu_s + self.span * np.where(z < 0, z, z / (1 + np.maximum(z, 0)))

    def velocity(self, shear_rate: Array) -> Array:
        v = np.zeros((*shear_rate.shape[:-1], self.cells + 1))
        np.cumsum(shear_rate * self.dy, axis=-1, out=v[..., 1:])
        return v

    def solve(self, time: float, step: float, known: Array, z: Array) -> tuple[Array, Array] | None:
        """Solve ``rate - step (d2tau/dy2)/rho - step * base forcing = known`` for z.

        Newton's method is applied to the graph coordinate; its matrix is a column-scaled M-matrix,
        hence never singular. Returns (shear rate, z), or None if it does not converge.
        """
        p = self.pressure(time) * self.depth
        per_z = self.xi * np.sqrt(p)
        source = known.copy()
        # Gravity acts on node 1, while the base node is fixed.
        source[0] += step * self.push * float(self.ramp_factor(time)) / self.dy
        scale = np.max(np.abs(source)) + np.max(per_z) * 1e-3
        for _ in range(40):
            tau = p * self.friction(z)
            flow = np.maximum(z, 0.0)
            residual = per_z * flow - step * self._laplacian(tau) - source
            slope = p * self.span / (1 + flow) ** 2
            matrix = -step * self.bands * slope
            matrix[1] += per_z * (z > 0)
            change = scipy.linalg.solve_banded((1, 1), matrix, residual)
            z = z - change
            if not np.all(np.isfinite(z)):
                return None
            if np.max(np.abs(change) / (1 + np.abs(z))) < 1e-12:
                return per_z * np.maximum(z, 0.0), z
        # Round-off may keep the last digits from settling: accept a residual of that size.
        return (per_z * flow, z) if np.max(np.abs(residual)) < 1e-10 * scale else None

    def _laplacian(self, tau: Array) -> Array:
        out = self.bands[1] * tau
        out[:-1] += self.bands[0, 1:] * tau[1:]
        out[1:] += self.bands[2, :-1] * tau[:-1]
        return out


def _march(layer: _Layer, times: Array, rtol: float) -> Iterator[tuple[Array, Array]]:
    """Yield (shear rate, z) at each output time."""
    time, rate = 0.0, np.zeros(layer.cells)
    z = np.full(layer.cells, -1.0)
    stops = np.unique(np.append(times, layer.ramp))
    proposal = max(layer.ramp, 1e-3) / 20
    floor = 1e-3 * rtol * math.sqrt(layer.push * layer.dy * layer.cells) + 1e-300
    for k in range(times.size):
        while time < times[k]:
            stop = stops[np.searchsorted(stops, time, side="right")]
            step = min(proposal, stop - time)
            trial = _step(layer, time, step, rate, z)
            error = math.inf
            if trial is not None:
                fastest = max(np.max(layer.velocity(trial[0])), np.max(layer.velocity(rate)))
                error = np.max(np.abs(layer.velocity(trial[2]))) / (rtol * fastest + floor)
            grow = 4.0 if error == 0 else min(4.0, max(0.2, 0.9 * error ** (-1 / 3)))
            if trial is not None and error <= 1:
                # A step cut short by an output time does not limit the next step.
                proposal = max(proposal, step * grow) if step < proposal else step * grow
                time = stop if step == stop - time else time + step
                rate, z = trial[0], trial[1]
            else:
                proposal = step * grow
                if proposal < 1e-13 * max(time, layer.ramp, 1e-3):
                    raise RuntimeError(f"time step fell to {proposal} s at t = {time} s")
        yield rate, z


def _step(
    layer: _Layer, time: float, step: float, rate: Array, z: Array
) -> tuple[Array, Array, Array] | None:
    """Make one SDIRK step; return (shear rate, z, error of the shear rate), or None if it fails."""
    slopes: list[Array] = []
    for node, weights in zip(_NODES, _STAGES, strict=True):
        known = rate + step * sum((w * s for w, s in zip(weights, slopes, strict=True)), 0.0)
        stage = layer.solve(time + node * step, _DIAGONAL * step, known, z)
        if stage is None:
            return None
        new, z = stage
        slopes.append((new - known) / (_DIAGONAL * step))
    error = step * sum(
        (w * s for w, s in zip(_ERROR_WEIGHTS, slopes, strict=True)), np.zeros_like(rate)
    )
    return new, z, error

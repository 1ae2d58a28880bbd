"""Flow of a layer down a rough incline by the nonlocal law: one equation over the depth.

The equation is the one of nonlocal granular fluidity (Dunatunga & Kamrin, "Modeling silo clogging
with nonlocal granular rheology", eqs 2.1 and 2.2), with the stress in a layer on a slope of angle
t, mu = tan t and p = rho_c g cos t z:

    t0 dg/dt = A^2 d^2 d2g/dz2 + lambda g - b sqrt(rho_s d^2/p) mu g^2,    dv/dy = g mu,

with lambda as in `granular.theory.stopping`, dg/dz = 0 at the free surface z = 0, and g = 0 at the
base. The stress is in static balance with gravity at every time, as in a layer whose speed changes
slowly, or in a simulation long after its start. y = height - z is the distance from the base.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import scipy
from numpy.typing import ArrayLike

from granular.materials import NGF
from granular.model.gravity import EARTH
from granular.theory.incline import output_times
from granular.theory.stopping import fluidity_growth, limiting_friction, stopping_height
from granular.tools.arrays import Array
from granular.tools.checks import in_range, integer, non_negative, positive


@dataclass(frozen=True)
class ChuteFlow:
    """Flow of a layer by the nonlocal law; if there are several times, they are the first axis.

    Attributes
    ----------
    y : ndarray, shape (cells + 1,)
        Distance of the faces of the cells from the base [m], closely spaced at base and surface.
    y_mid : ndarray, shape (cells,)
        Distance from the base of the points at which `g` is given, one in each cell [m].
    g, shear_rate : ndarray, shape (..., cells)
        Fluidity and dv/dy = g mu at `y_mid` [1/s].
    v : ndarray, shape (..., cells + 1)
        Velocity down the slope at the faces [m/s].
    mean : ndarray, shape (...)
        Depth average of `v` [m/s].
    error : float
        Largest change of `v`, divided by its largest value, between this solution and one with half
        the cells (and a ten times larger `rtol`). The error itself is about a third of it.
    """

    y: Array
    y_mid: Array
    g: Array
    shear_rate: Array
    v: Array
    mean: Array
    error: float


def chute_profile(
    angle_deg: float, height: float, material: NGF, gravity: float = EARTH, cells: int = 400
) -> ChuteFlow:
    """Stable steady flow of a layer.

    The shape of the profile, and the ratio of its speed to that of `bagnold_profile`, are functions
    of H/H_stop alone: with g = lambda w sqrt(p/rho_s)/(b d mu sqrt(s)) and s = z/H,
    ``(2 H_stop/(pi H))^2 d2w/ds2 + w - w^2/sqrt(s) = 0``. The error is of second order in
    1/`cells`.

    Parameters
    ----------
    angle_deg : float
        Inclination [degrees], in [0, 90).
    height : float
        Thickness of the layer, normal to the base [m], > 0.
    material : NGF
        Of either `rheology`: ``mu_2`` counts as infinite with "linear_mu_I". ``A = 0`` is the
        local law. ``t0`` has no effect.
    cells : int
        Number of cells over the height, even, 8 to 100 000.

    Returns
    -------
    ChuteFlow
        Zero everywhere if the layer is not thicker than `stopping_height`.

    Raises
    ------
    TypeError, ValueError
        If an argument is out of range, or the angle is at or above atan(mu_2), where no steady flow
        exists.
    RuntimeError
        If the iteration does not converge.
    """
    fine, half = _layers(angle_deg, height, material, gravity, cells)
    m, limit = material, limiting_friction(material)
    if height <= stopping_height(angle_deg, m.A, m.d, m.mu_s, limit):
        return fine.flow(np.zeros(cells), 0.0)
    u = fine.steady()
    return fine.flow(u, _change(fine.velocity(u), half.velocity(half.steady())))


def chute_transient(
    angle_deg: float,
    height: float,
    material: NGF,
    times: ArrayLike,
    g0: float | Callable[[Array], ArrayLike],
    gravity: float = EARTH,
    cells: int = 200,
    rtol: float = 1e-6,
) -> ChuteFlow:
    """Growth or decay of the fluidity, and hence of the flow, from a given initial fluidity.

    The error is of second order in 1/`cells`. Time is integrated by SciPy's implicit method of
    order five with step control (Radau IIA, which damps the fastest modes at any step size).

    Parameters
    ----------
    angle_deg, height, material, gravity, cells
        As in `chute_profile`; layers too thin to flow are allowed as well.
    times : array_like, shape (nt,)
        Output times [s], not decreasing, >= 0.
    g0 : float or callable
        Fluidity at t = 0 [1/s], >= 0: a uniform value, or a function of y [m]. A fluidity that is 0
        everywhere remains 0.
    rtol : float
        Tolerance of a time step, relative to the local fluidity. A fluidity that has decayed by a
        factor of 1e-9 `rtol` is no longer resolved.

    Returns
    -------
    ChuteFlow
        Arrays of shape (nt, ...).

    Raises
    ------
    TypeError, ValueError
        If an argument is out of range, or the angle is at or above atan(mu_2), where the law gives
        no fluidity.
    RuntimeError
        If the integration in time fails.
    """
    times = output_times(times)
    positive("rtol", rtol)
    fine, half = _layers(angle_deg, height, material, gravity, cells)
    u = fine.march(fine.start(g0), times, rtol)
    half_u = half.march(half.start(g0), times, 10 * rtol)
    return fine.flow(u, _change(fine.velocity(u), half.velocity(half_u)))


def _layers(
    angle_deg: float, height: float, material: NGF, gravity: float, cells: int
) -> tuple[Layer, Layer]:
    """Return the layer, and one of half as many cells for the estimate of the error."""
    if integer("cells", cells, 8, 100_000) % 2:
        raise ValueError(f"cells = {cells} must be even: the error is estimated with half of them")
    fine, half = (Layer(angle_deg, height, material, gravity, n) for n in (cells, cells // 2))
    return fine, half


def _change(v: Array, half_v: Array) -> float:
    """Largest change at the faces common to both grids, divided by the largest value."""
    top = np.max(v)
    return float(np.max(np.abs(v[..., ::2] - half_v)) / top) if top > 0 else 0.0


class Layer:
    """Discretisation of the layer over its depth.

    The unknown is u = g b d sqrt(rho_s/p) sqrt(s), s = z/H, which obeys

        t0 du/dt = (A d/H)^2 d2u/ds2 + lambda u - mu u^2/sqrt(s).

    It is solved by finite volumes with faces at y/H = sin^2(pi j/(2 cells)). Near the surface u is
    a series in powers of sqrt(s), hence smooth in j. At the base the cells resolve the distance
    A d/sqrt(lambda) over which a wall acts in thick layers. 1/sqrt(s) enters by its exact mean over
    a cell, which is finite in the uppermost cell too, although the pressure is zero at its face.

    Attributes
    ----------
    y, y_mid : ndarray, shapes (cells + 1,) and (cells,)
        Distance of faces and unknowns from the base [m].
    growth : float
        lambda, without unit.
    """

    def __init__(
        self, angle_deg: float, height: float, material: NGF, gravity: float, cells: int
    ) -> None:
        angle_deg = in_range("angle_deg", angle_deg, 0.0, 90.0, open_high=True)
        self.height, self.cells = positive("height", height), cells
        angle = math.radians(angle_deg)
        self.slope, m = math.tan(angle), material
        self.growth = float(fluidity_growth(self.slope, m.mu_s, limiting_friction(m)))
        if math.isinf(self.growth):
            limit = math.degrees(math.atan(m.mu_2))
            raise ValueError(
                f"angle_deg = {angle_deg} must be below atan(mu_2) = {limit:.6g}: "
                "the law has no friction to hold the layer"
            )
        self.t0 = positive("t0", m.t0)
        diffusion = (non_negative("A", m.A) * positive("d", m.d) / self.height) ** 2
        weight = positive("rho_c", m.rho_c) * positive("gravity", gravity) * math.cos(angle)
        grain = m.d * math.sqrt(positive("rho_s", m.rho_s))
        self.per_u = math.sqrt(weight * self.height) / (positive("b", m.b) * grain)

        half_step = math.pi / (4 * cells)
        face = 2 * half_step * np.arange(cells + 1)
        middle = face[:-1] + half_step
        self.y, self.y_mid = self.height * np.sin(face) ** 2, self.height * np.sin(middle) ** 2
        # sin^2 a - sin^2 b = sin(a + b) sin(a - b) avoids cancellation.
        self.width = np.sin(2 * middle) * math.sin(2 * half_step)
        self.sink = 2 * self.slope / (np.cos(face[1:]) + np.cos(face[:-1]))
        across = np.zeros(cells + 1)
        across[0] = diffusion / math.sin(half_step) ** 2
        across[1:-1] = diffusion / (np.sin(2 * face[1:-1]) * math.sin(2 * half_step))
        self.across = across

    def rate(self, u: Array) -> Array:
        """``t0 du/dt``, shape (cells,)."""
        flux = self.across * np.diff(u, prepend=0.0, append=0.0)
        return np.diff(flux) / self.width + (self.growth - self.sink * u) * u

    def jacobian(self, u: Array) -> Array:
        """Derivative of `rate`, shape (3, cells), in the banded form of `solve_banded`."""
        bands = np.zeros((3, self.cells))
        bands[0, 1:] = self.across[1:-1] / self.width[:-1]
        bands[2, :-1] = self.across[1:-1] / self.width[1:]
        bands[1] = -(self.across[1:] + self.across[:-1]) / self.width
        bands[1] += self.growth - 2 * self.sink * u
        return bands

    def steady(self) -> Array:
        """Positive u at which `rate` is 0, by Newton's method, for layers that flow.

        `rate` is concave and the initial u = lambda/mu is above the solution, so that the iterates
        decrease towards it.
        """
        u = np.full(self.cells, self.growth / self.slope)
        for _ in range(100):
            change = scipy.linalg.solve_banded((1, 1), self.jacobian(u), self.rate(u))
            u = u - change
            if np.max(np.abs(change)) <= 1e-12 * np.max(u):
                return u
        raise RuntimeError(
            f"no convergence to a steady flow in 100 iterations, last change {change}"
        )

    def start(self, g0: float | Callable[[Array], ArrayLike]) -> Array:
        """Initial u from a fluidity `g0` as in `chute_transient`."""
        if not callable(g0):
            return np.full(self.cells, non_negative("g0", g0) / self.per_u)
        g = np.asarray(g0(self.y_mid), dtype=float)
        if g.shape != self.y_mid.shape or not np.all((g >= 0) & np.isfinite(g)):
            raise ValueError(f"g0(y) = {g} must be finite and >= 0, one value for each y")
        return g / self.per_u

    def march(self, u: Array, times: Array, rtol: float) -> Array:
        """Integrate in time; return u at `times`, shape (nt, cells)."""
        stops, where = np.unique(np.append(times, 0.0), return_inverse=True)
        scale = np.max(u)
        if stops[-1] == 0.0 or scale == 0.0:
            return np.tile(u, (times.size, 1))

        def jacobian(_: float, u: Array) -> scipy.sparse.csc_array:
            bands = self.jacobian(u) / self.t0
            return scipy.sparse.csc_array(
                scipy.sparse.diags_array(
                    [bands[0, 1:], bands[1], bands[2, :-1]], offsets=[1, 0, -1]
                )
            )

        solution = scipy.integrate.solve_ivp(
            lambda _, u: self.rate(u) / self.t0,
            (0.0, stops[-1]),
            u,
            "Radau",
            stops,
            jac=jacobian,
            rtol=rtol,
            atol=1e-9 * rtol * scale,
        )
        if not solution.success:
            raise RuntimeError(f"no solution up to t = {stops[-1]} s: {solution.message}")
        return solution.y.T[where[:-1]]

    def velocity(self, u: Array) -> Array:
        """Velocity at the faces [m/s], shape (..., cells + 1)."""
        v = np.zeros((*u.shape[:-1], self.cells + 1))
        each = self.per_u * self.slope * self.height * self.width
        np.cumsum(u * each, axis=-1, out=v[..., 1:])
        return v

    def flow(self, u: Array, error: float) -> ChuteFlow:
        """Result for u of shape (..., cells)."""
        g, v = self.per_u * u, self.velocity(u)
        return ChuteFlow(
            y=self.y,
            y_mid=self.y_mid,
            g=g,
            shear_rate=g * self.slope,
            v=v,
            mean=np.trapezoid(v, self.y) / self.height,
            error=error,
        )

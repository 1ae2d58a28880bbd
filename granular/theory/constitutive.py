"""Reference solution of the mu(I) hypoelastic-plastic law under a given velocity gradient.

The rate law of Dunatunga & Kamrin 2015 (eqs 2.4-2.15) in plane strain, integrated with an
adaptive Runge-Kutta method to a tolerance far below that of any stepping scheme (appendix B).
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import cycle, pairwise
from typing import Any

import numpy as np
import scipy
from numpy.typing import ArrayLike

from granular.materials import MuI
from granular.theory.incline import check_mu_I
from granular.tools.arrays import Array, BoolArray
from granular.tools.checks import finite, non_negative, one_of, positive

VelocityGradient = Callable[[float], ArrayLike]

#: Kinks of the velocity gradient of appendix B [s], first and last time included.
APPENDIX_B_BREAKPOINTS = (0.0, 0.25, 0.375, 0.5, 0.75, 0.875, 1.0, 1.25)

# Pressures below this fraction of K count as the moment of contact itself: one implicit step
# passes through them. The error of the stress is of this size.
_CONTACT = 1e-9


@dataclass(frozen=True)
class Event:
    """A change between the dense and the disconnected state.

    Attributes
    ----------
    time : float
        Time [s].
    kind : {"reconnect", "disconnect"}
        Direction of the change.
    """

    time: float
    kind: str


@dataclass(frozen=True)
class ConstitutiveReference:
    """Stress history of one material point.

    Attributes
    ----------
    times : ndarray, shape (nt,)
        Times [s].
    stress : ndarray, shape (nt, 4)
        Components xx, yy, zz, xy [Pa], tension positive.
    log_density : ndarray, shape (nt,)
        ln(rho/rho_c).
    dense : ndarray of bool, shape (nt,)
        True where the point is under stress.
    shear_rate : ndarray, shape (nt,)
        Equivalent plastic shear rate [1/s].
    events : tuple of Event
        Reconnections and disconnections in the order of time.
    """

    times: Array
    stress: Array
    log_density: Array
    dense: BoolArray
    shear_rate: Array
    events: tuple[Event, ...]


def appendix_b_velocity_gradient(t: ArrayLike) -> Array:
    """Velocity gradient of the verification test (Dunatunga & Kamrin 2015, eqs B1, B2).

    Parameters
    ----------
    t : array_like
        Time [s], any shape.

    Returns
    -------
    ndarray, shape t.shape + (2, 2)
        In-plane components [1/s]: steady simple shear of 0.05/s, in-plane compression for t in
        (0.25, 0.5) s, and the opposite expansion in (0.75, 1) s.
    """
    t = np.asarray(t, dtype=float)
    gradient = np.zeros((*t.shape, 2, 2))
    volumetric = np.where((t > 0.25) & (t < 0.5), abs(8 * t - 3) - 1, 0.0)
    volumetric = volumetric + np.where((t > 0.75) & (t < 1.0), 1 - abs(8 * t - 7), 0.0)
    gradient[..., 0, 0] = gradient[..., 1, 1] = volumetric
    gradient[..., 0, 1] = 0.05
    return gradient


def plastic_shear_rate(p: ArrayLike, tau: ArrayLike, material: MuI) -> Array:
    """Equivalent plastic shear rate [1/s] of the mu(I) law (eqs 2.11-2.13, solved for it).

    It is ``xi sqrt(p) (mu - mu_s)/(mu_2 - mu)`` with ``mu = tau/p``, and zero at and below mu_s and
    where p <= 0. Stress states at or beyond mu_2 are outside the law; for them the rate at a
    distance of 1e-12 p from mu_2 is returned, so that an adaptive integrator rejects such a trial.

    Parameters
    ----------
    p, tau : array_like
        Pressure and equivalent shear stress [Pa], broadcast together.
    material : MuI
        Or any object with ``mu_s``, ``mu_2``, ``xi``.

    Raises
    ------
    TypeError, ValueError
        If the material has a cohesion or another law than mu(I).
    """
    check_mu_I(material)
    p, tau = np.broadcast_arrays(np.asarray(p, dtype=float), np.asarray(tau, dtype=float))
    pressed = np.maximum(p, 0.0)
    over = np.maximum(tau - material.mu_s * pressed, 0.0)
    below = np.maximum(material.mu_2 * pressed - tau, 1e-12 * pressed)
    flowing = (pressed > 0) & (over > 0)
    ratio = np.divide(over, below, out=np.zeros(p.shape), where=flowing)
    return material.xi * np.sqrt(pressed) * ratio


def elastic_stress_rate(stress: Array, gradient: Array, material: MuI) -> Array:
    """Time derivative of the stress without plastic flow, ``W sigma - sigma W + C:D``.

    The arguments are as of `stress_rate` (eqs 2.8, 2.9).
    """
    sxx, syy, _, sxy = stress
    dxx, dyy = gradient[0, 0], gradient[1, 1]
    spin = (gradient[0, 1] - gradient[1, 0]) / 2
    rate = 2 * material.G * np.array([dxx, dyy, 0.0, (gradient[0, 1] + gradient[1, 0]) / 2])
    rate[:3] += (material.K - 2 * material.G / 3) * (dxx + dyy)
    return rate + spin * np.array([2 * sxy, -2 * sxy, 0.0, syy - sxx])


def stress_rate(stress: Array, gradient: Array, material: MuI) -> Array:
    """Time derivative of the stress of a dense point (eqs 2.8, 2.9, 2.15).

    The rate is ``dsigma/dt = W sigma - sigma W + C:D - G gp s/tau``: with the deviator s,
    ``C:Dp = 2G gp s/(2 tau)``, because plastic flow preserves volume (eq. 2.6).

    Parameters
    ----------
    stress : ndarray, shape (4,)
        Components xx, yy, zz, xy [Pa].
    gradient : ndarray, shape (2, 2)
        Velocity gradient [1/s].
    material : MuI
        Or any object with ``mu_s``, ``mu_2``, ``xi``, ``K``, ``G``.

    Returns
    -------
    ndarray, shape (4,)
        Rate of the components xx, yy, zz, xy [Pa/s].

    Raises
    ------
    TypeError, ValueError
        As in `plastic_shear_rate`.
    """
    rate = elastic_stress_rate(stress, gradient, material)
    p, deviator, tau = _invariants(stress)
    if tau > 0:
        rate -= material.G * float(plastic_shear_rate(p, tau, material)) * deviator / tau
    return rate


def _invariants(stress: Array) -> tuple[Array, Array, Array]:
    """Pressure, deviator and equivalent shear stress of stresses (..., 4)."""
    p = -stress[..., :3].sum(axis=-1) / 3
    deviator = stress.copy()
    deviator[..., :3] += p[..., None]
    tau = np.sqrt((deviator[..., :3] ** 2).sum(axis=-1) / 2 + deviator[..., 3] ** 2)
    return p, deviator, tau


def reference(
    material: MuI,
    p0: float,
    times: ArrayLike,
    log_density0: float | None = None,
    velocity_gradient: VelocityGradient = appendix_b_velocity_gradient,
    breakpoints: Sequence[float] = APPENDIX_B_BREAKPOINTS,
    solver: str = "auto",
    rtol: float = 1e-9,
) -> ConstitutiveReference:
    """Stress history of a point under a given velocity gradient (appendix B).

    The density follows from ``d ln(rho)/dt = -tr L`` alone, and while the point is dense the
    pressure of the rate law is ``K ln(rho/rho_c)``. The times at which the point disconnects or
    reconnects are therefore known before the stress is integrated. Between these times and the
    breakpoints of L the stress is integrated by an adaptive Runge-Kutta method. While rho < rho_c
    the stress is zero, and it restarts from zero.

    Parameters
    ----------
    material : MuI
        Or any object with ``mu_s``, ``mu_2``, ``xi``, ``K``, ``G``.
    p0 : float
        Initial isotropic pressure [Pa], >= 0; 0 for a stress-free start.
    times : array_like, shape (nt,)
        Output times [s], not decreasing, not before ``breakpoints[0]``, the last one after it.
    log_density0 : float, optional
        Initial ln(rho/rho_c). If p0 = 0 it must be given and be negative. Otherwise it is p0/K, the
        only density consistent with the pressure.
    velocity_gradient : callable
        Function of the time [s] that returns the velocity gradient [1/s], shape (2, 2).
    breakpoints : sequence of float
        Increasing times [s] between which `velocity_gradient` is smooth; it may jump at them.
        The first is the initial time.
    solver : {"auto", "RK45", "Radau"}
        "auto" uses RK45, but Radau at small pressure, where the flow rule is stiff. Fast shear
        (of order xi sqrt(p) and more) is stiff too; for it "Radau" throughout saves time.
    rtol : float
        Relative tolerance of a step.

    Raises
    ------
    TypeError, ValueError
        If an argument is out of range, the material has a cohesion or another law than mu(I), or
        the start is ill-posed. A start is ill-posed at rho_c
        without pressure, because round-off then decides if there is stress, and with a pressure
        that does not match the density.
    RuntimeError
        If the integrator fails.
    """
    check_mu_I(material)
    times, ends = _time_arrays(times, breakpoints)
    one_of("solver", solver, ("auto", "RK45", "Radau"))
    positive("rtol", rtol)
    history = _DensityHistory(velocity_gradient, ends, _start(material, p0, log_density0))
    stiff = _stiff_pressure(material, ends[-1] - ends[0]) / material.K
    log_density = history(times)
    # The absolute tolerance follows from the largest |K ln(rho/rho_c)|, also below rho_c.
    largest = max(p0, material.K * np.max(np.abs(log_density)))
    stress, now = np.zeros((times.size, 4)), np.array([-p0, -p0, -p0, 0.0])
    for a, b in history.pieces((0.0, _CONTACT, stiff)):
        middle = float(history((a + b) / 2))
        smooth = _one_sided(velocity_gradient, a, b)
        if middle < 0:
            now = np.zeros(4)
        elif middle < _CONTACT:
            now = _contact_step(now, smooth((a + b) / 2), b - a, material)
        else:
            method = solver if solver != "auto" else "Radau" if middle < stiff else "RK45"
            inside = (times >= a) & (times <= b)
            stress[inside], now = _integrate(
                smooth, material, (a, b), now, times[inside], method, (rtol, 1e-3 * rtol * largest)
            )
    p, _, tau = _invariants(stress)
    return ConstitutiveReference(
        times=times,
        stress=stress,
        log_density=log_density,
        dense=log_density > 0,
        shear_rate=plastic_shear_rate(p, tau, material),
        events=history.events(),
    )


def _time_arrays(times: ArrayLike, breakpoints: Sequence[float]) -> tuple[Array, Array]:
    times = np.atleast_1d(np.asarray(times, dtype=float))
    ends = np.asarray(breakpoints, dtype=float)
    if ends.ndim != 1 or ends.size < 1 or not np.all(np.diff(ends) > 0):
        raise ValueError(f"breakpoints = {ends} must be an increasing list of times")
    if times.ndim != 1 or times.size == 0 or not np.all(np.diff(times) >= 0):
        raise ValueError(f"times = {times} must be a non-empty list that does not decrease")
    if not times[0] >= ends[0]:
        raise ValueError(f"times = {times} must not begin before breakpoints[0] = {ends[0]}")
    if not ends[0] < times[-1] < math.inf:
        raise ValueError(f"times = {times} must end after breakpoints[0] = {ends[0]}")
    inner = ends[ends < times[-1]]
    return times, np.append(inner, times[-1])


def _start(material: MuI, p0: float, log_density0: float | None) -> float:
    """Initial ln(rho/rho_c), consistent with the pressure."""
    non_negative("p0", p0)
    if log_density0 is None:
        log_density0 = p0 / material.K
    finite("log_density0", log_density0)
    if p0 == 0 and log_density0 >= 0:
        raise ValueError(
            f"log_density0 = {log_density0} must be negative where p0 = 0: "
            "a dense point without pressure is ill-posed"
        )
    if p0 > 0 and not math.isclose(material.K * log_density0, p0, rel_tol=1e-9):
        raise ValueError(
            f"log_density0 = {log_density0} must be p0/K = {p0 / material.K} where p0 > 0"
        )
    return log_density0


class _DensityHistory:
    """ln(rho/rho_c) over time, from a quadrature of -tr L between the breakpoints."""

    def __init__(self, gradient: VelocityGradient, breakpoints: Array, start: float) -> None:
        self._gradient, self._edges, self._parts = gradient, breakpoints, []
        for a, b in pairwise(breakpoints):
            smooth = _one_sided(gradient, a, b)
            part = scipy.integrate.solve_ivp(
                lambda t, _, smooth=smooth: [-np.trace(smooth(t))],
                (a, b),
                [start],
                method="DOP853",
                rtol=1e-12,
                atol=1e-15,
                max_step=(b - a) / 16,
                dense_output=True,
            )
            self._parts.append(part)
            start = part.y[0, -1]

    def __call__(self, t: ArrayLike) -> Array:
        t = np.asarray(t, dtype=float)
        which = np.clip(np.searchsorted(self._edges, t, side="right") - 1, 0, len(self._parts) - 1)
        values = np.empty(t.shape)
        for k in np.unique(which):
            values[which == k] = self._parts[k].sol(t[which == k])[0]
        return values

    def crossings(self, level: float) -> list[float]:
        """Times at which ln(rho/rho_c) passes through a level, in order."""
        roots = []
        for part in self._parts:

            def above(t: float, part: Any = part) -> float:
                return part.sol(t)[0] - level

            # The steps are short (1/16 of a smooth piece); a root is searched for in each.
            side = part.y[0] > level
            for k in np.flatnonzero(side[1:] != side[:-1]):
                roots.append(scipy.optimize.brentq(above, part.t[k], part.t[k + 1], xtol=1e-15))
        return roots

    def events(self) -> tuple[Event, ...]:
        """Times at which the density passes through rho_c, and the kind of each passage."""
        kinds = ("reconnect", "disconnect")
        dense = float(self(self._edges[0])) > 0
        return tuple(map(Event, self.crossings(0.0), cycle(kinds[::-1] if dense else kinds)))

    def pieces(self, levels: Sequence[float]) -> list[tuple[float, float]]:
        """Intervals in which L is smooth and ln(rho/rho_c) on one side of every level."""
        cuts = list(self._edges)
        for level in levels:
            cuts.extend(self.crossings(level))
        return list(pairwise(np.unique(cuts)))


def _one_sided(gradient: VelocityGradient, a: float, b: float) -> Callable[[float], Array]:
    """Return the gradient in [a, b], with its limits from inside at the ends, where it may jump."""
    first, last = np.nextafter(a, b), np.nextafter(b, a)
    return lambda t: np.asarray(gradient(min(max(t, first), last)), dtype=float)


def _stiff_pressure(material: MuI, duration: float) -> float:
    """Pressure [Pa] below which the flow rule relaxes more than 1e4 times in `duration`.

    The relaxation rate of tau just above yield is ``xi G/(sqrt(p) (mu_2 - mu_s))``.
    """
    rate = material.xi * material.G / (material.mu_2 - material.mu_s)
    return (rate * duration / 1e4) ** 2


def _integrate(
    smooth: Callable[[float], Array],
    material: MuI,
    span: tuple[float, float],
    stress: Array,
    times: Array,
    method: str,
    tolerance: tuple[float, float],
) -> tuple[Array, Array]:
    """Stress at `times` and at the end of a dense piece."""
    wanted = np.append(times, span[1])
    solution = scipy.integrate.solve_ivp(
        lambda t, s: stress_rate(s, smooth(t), material),
        span,
        stress,
        method=method,
        rtol=tolerance[0],
        atol=tolerance[1],
        t_eval=np.unique(wanted),
    )
    if not solution.success:
        raise RuntimeError(
            f"{method} failed between t = {span[0]} and {span[1]}: {solution.message}"
        )
    values = solution.y.T[np.searchsorted(solution.t, wanted)]
    return values[:-1], values[-1]


def _contact_step(stress: Array, gradient: Array, step: float, material: MuI) -> Array:
    """One implicit step of the law (eqs 3.10-3.16), for the instant of contact.

    In the limit p -> 0 the rate law determines no direction of stress, and a start from zero stress
    may lie beyond mu_2. The implicit step finds the admissible stress directly.
    """
    trial = stress + step * elastic_stress_rate(stress, gradient, material)
    p, deviator, tau = _invariants(trial)
    if p <= 0:
        return np.zeros(4)
    if tau <= material.mu_s * p:
        return trial
    alpha = material.xi * material.G * step * math.sqrt(p)
    s2 = material.mu_2 * p
    b = s2 + tau + alpha
    h = s2 * tau + material.mu_s * p * alpha
    # The discriminant b^2 - 4h as a sum of non-negative terms.
    root = math.sqrt((tau - s2 + alpha) ** 2 + 4 * alpha * (material.mu_2 - material.mu_s) * p)
    new = deviator * (2 * h / (b + root) / tau)
    new[:3] -= p
    return new

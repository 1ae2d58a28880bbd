"""Flow between two coaxial cylinders, the inner of which turns, by the nonlocal law.

The balance of moments gives tau = tau_w (R_i/r)^2; if the pressure is uniform it gives
mu = mu_w (R_i/r)^2. For nonlocal granular fluidity (Haeri & Skonieczny 2021, eq. 6, for an infinite
mu_2; Dunatunga & Kamrin, "Modeling silo clogging with nonlocal granular rheology", eq. 2.1, for a
finite one) the steady state is

    A^2 d^2 (g'' + g'/r) + lambda(mu) g - b sqrt(rho_s d^2/p) mu g^2 = 0,    -r domega/dr = g mu,

with lambda as in `granular.theory.stopping`: mu - mu_s for an infinite mu_2. In slow flows the
last term is negligible: any multiple of a solution g is a solution, and mu_w is the eigenvalue for
which one exists.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
import scipy
from numpy.typing import ArrayLike

from granular.materials import NGF
from granular.theory.stopping import fluidity_growth, limiting_friction
from granular.tools.arrays import Array
from granular.tools.checks import integer, one_of, positive

WALLS = ("rough", "smooth")
"""Boundary conditions of the fluidity at the cylinders: g = 0 (rough) or dg/dr = 0 (smooth)."""
POINTS = (101, 100_001)
"""Least and largest number of radii."""


@dataclass(frozen=True)
class CouetteFlow:
    """Steady flow between cylinders.

    Attributes
    ----------
    r : ndarray, shape (n,)
        Radii [m], R_i and R_o included.
    omega : ndarray, shape (n,)
        Angular velocity divided by that of the inner cylinder, from 1 to 0.
    g, shear_rate : ndarray, shape (n,)
        Fluidity and -r domega/dr = g mu [1/s].
    mu : ndarray, shape (n,)
        Friction coefficient.
    mu_wall : float
        Friction coefficient at the inner cylinder. The moment on it, per unit height, is
        2 pi R_i^2 mu_wall p.
    error : float
        Largest change of `omega` between this solution and one with half the points, or with a
        thousand times larger tolerances.
    """

    r: Array
    omega: Array
    g: Array
    shear_rate: Array
    mu: Array
    mu_wall: float
    error: float


def couette_decay_length(mu: ArrayLike, material: NGF) -> Array:
    """Length over which the fluidity falls by a factor e where mu < mu_s.

    It is ``A d/sqrt(-lambda(mu))``. Far from the inner cylinder mu tends to 0 and the length to
    ``A d/sqrt(mu_s)`` if mu_2 is infinite, and to ``A d sqrt(mu_2/(mu_s (mu_2 - mu_s)))``
    otherwise.

    Parameters
    ----------
    mu : array_like
        Friction coefficient, any shape, >= 0.
    material : NGF
        Of either `rheology`: ``mu_2`` counts as infinite with "linear_mu_I". Or any object with
        ``mu_s``, ``mu_2`` (may be infinite), ``A``, ``d``.

    Returns
    -------
    ndarray
        Length [m], of the shape of `mu`; infinite from mu_s on.
    {raises}.
    """
    mu = np.asarray(mu, dtype=float)
    if not np.all(mu >= 0):
        raise ValueError(f"mu = {mu} must be >= 0")
    decay = -fluidity_growth(mu, material.mu_s, limiting_friction(material))
    reach = positive("A", material.A) * positive("d", material.d)
    return np.where(decay > 0, reach / np.sqrt(np.where(decay > 0, decay, 1.0)), np.inf)[()]


def couette_quasi_static(
    inner: float,
    outer: float,
    material: NGF,
    *,
    rate: float = 1.0,
    walls: str = "rough",
    points: int = 2001,
) -> CouetteFlow:
    """Quasi-static flow, so slow that its shape does not depend on the rate.

    In x = -ln r the equation is g'' + Q g = 0 with Q = lambda r^2/(A d)^2. It is integrated from
    the outer cylinder inwards, the direction in which g grows. The unknowns are Pruefer's angle a
    and the logarithm of q, where g = q sin(a) and g' = q cos(a), so that no digit of the tail is
    lost, however small it becomes. The angle at the inner cylinder grows with mu_w; the solution is
    the least mu_w for which it is pi (rough) or pi/2 (smooth).

    Parameters
    ----------
    inner, outer : float
        Radii R_i < R_o [m].
    material : NGF
        Of either `rheology`: ``mu_2`` counts as infinite with "linear_mu_I". Or any object with
        ``mu_s``, ``mu_2`` (may be infinite), ``A`` > 0, ``d``.
    rate : float
        Angular velocity of the inner cylinder [rad/s], > 0, which sets the scale of `g`.
    walls : {"rough", "smooth"}
        Boundary condition at both cylinders: g = 0, or dg/dr = 0.
    points : int
        Number of radii, 101 to 100 001.
    {raises}.
    RuntimeError
        If there is no solution with mu_w below mu_2, as in a gap of a few A d.
    """
    gap = _Gap(inner, outer, material, walls, integer("points", points, *POINTS))
    mu_wall = gap.slowest_friction()
    g, omega = gap.slowest(mu_wall)
    scale, rough = positive("rate", rate) / omega[0], gap.slowest(mu_wall, 1e-8)[1]
    error = np.max(np.abs(omega / omega[0] - rough / rough[0]))
    return gap.flow(g * scale, omega * scale, mu_wall, float(error))


def couette_flow(
    inner: float,
    outer: float,
    material: NGF,
    *,
    rate: float,
    pressure: float,
    walls: str = "rough",
    points: int = 2001,
) -> CouetteFlow:
    """Flow at any rate, by finite differences of second order in 1/`points`.

    For each mu_w Newton's method converges from above to the only positive g. The angular velocity
    grows with mu_w, which is determined by a search for the given rate.

    Parameters
    ----------
    inner, outer, walls
        As in `couette_quasi_static`.
    points : int
        Number of radii, odd, because the error is estimated with every other one, 101 to 100 001.
    material : NGF
        As in `couette_quasi_static`, with ``rho_s`` and ``b`` in addition.
    rate : float
        Angular velocity of the inner cylinder [rad/s], > 0.
    pressure : float
        Uniform pressure p [Pa], > 0.
    {raises}.
    RuntimeError
        If there is no solution with mu_w below mu_2.
    """
    if integer("points", points, *POINTS) % 2 == 0:
        raise ValueError(
            f"points = {points} must be odd: the error is estimated with every other one"
        )
    pressure, rate = positive("pressure", pressure), positive("rate", rate)
    fine = _Gap(inner, outer, material, walls, points).driven(rate, pressure)
    rough = _Gap(inner, outer, material, walls, (points + 1) // 2).driven(rate, pressure)
    error = float(np.max(np.abs(fine.omega[::2] - rough.omega)))
    return replace(fine, error=error)


class _Gap:
    """The annulus on a grid that is uniform in ln r."""

    def __init__(self, inner: float, outer: float, material: NGF, walls: str, points: int) -> None:
        inner, m = positive("inner", inner), material
        if positive("outer", outer) <= inner:
            raise ValueError(f"outer = {outer} must exceed inner = {inner}")
        self.rough, self.material = one_of("walls", walls, WALLS) == "rough", material
        self.x, self.step = np.linspace(0.0, math.log(outer / inner), points, retstep=True)
        self.r = inner * np.exp(self.x)
        self.share = np.exp(-2 * self.x)  # mu/mu_wall
        self.limit = limiting_friction(m)
        self.reach = positive("A", m.A) * positive("d", m.d)
        fluidity_growth(0.0, m.mu_s, self.limit)  # checks both

    def growth(self, mu: Array) -> Array:
        """``lambda(mu) (r/(A d))^2`` on the grid."""
        lam = fluidity_growth(mu, self.material.mu_s, self.limit)
        return lam * (self.r / self.reach) ** 2

    # ---- slow ----

    def angle(
        self, mu_wall: float, rtol: float = 1e-11, *, everywhere: bool = False
    ) -> tuple[Array, Array, Array]:
        """Pruefer's angle, ln q and omega/q, from the inner cylinder outwards.

        They are given at the two cylinders or, with `everywhere`, on the grid.
        """
        m, end, scale = self.material, self.x[-1], (self.r[-1] / self.reach) ** 2
        span = self.limit - m.mu_s

        def rates(z: float, y: Array) -> Array:
            a, _, turn = y
            share = math.exp(2 * (z - end))
            mu = mu_wall * share
            over = mu - m.mu_s  # lambda as in fluidity_growth, which would take ten times longer
            Q = over / (1 - over / span) * scale * math.exp(-2 * z)
            sine, cosine = math.sin(a), math.cos(a)
            grow = (1 - Q) * sine * cosine
            return np.array([cosine**2 + Q * sine**2, grow, mu * sine - grow * turn])

        start = [0.0 if self.rough else math.pi / 2, 0.0, 0.0]
        stops = end - self.x[::-1] if everywhere else [0.0, end]
        # The interpolation between steps is of lower order than the steps.
        longest = end / 400 if everywhere else math.inf
        solution = scipy.integrate.solve_ivp(
            rates, (0.0, end), start, "DOP853", stops, rtol=rtol, atol=1e-14, max_step=longest
        )
        if not solution.success:
            raise RuntimeError(f"no fluidity for mu_wall = {mu_wall}: {solution.message}")
        return tuple(solution.y[:, ::-1])

    def friction(self, u: float) -> float:
        """Friction coefficient as a function of u: from mu_s at u = 0 to its limit at infinity."""
        m = self.material
        span = self.limit - m.mu_s
        return m.mu_s + (u * m.mu_s if math.isinf(span) else span * u / (1 + u))

    def least_excess(self, excess: Callable[[float], float]) -> float:
        """Zero u > 0 of an increasing function."""
        high = 0.1
        while excess(high) < 0:
            high *= 2
            if high > 1e4:
                raise RuntimeError(
                    f"no friction up to mu_wall = {self.friction(high):.6g} makes this flow "
                    f"in a gap of {self.r[-1] - self.r[0]:.6g} m with A d = {self.reach:.6g} m"
                )
        return scipy.optimize.brentq(excess, 0.0, high, xtol=1e-15, rtol=1e-13)

    def slowest_friction(self) -> float:
        """mu_w in the limit of slow flow."""
        target = math.pi if self.rough else math.pi / 2
        return self.friction(
            self.least_excess(lambda u: self.angle(self.friction(u))[0][0] - target)
        )

    def slowest(self, mu_wall: float, rtol: float = 1e-11) -> tuple[Array, Array]:
        """g and omega of slow flow, up to a common factor."""
        angle, log_q, turn = self.angle(mu_wall, rtol, everywhere=True)
        q = np.exp(log_q - np.max(log_q))
        g = q * np.sin(angle)
        if self.rough:
            g[[0, -1]] = 0.0
        return g, q * turn

    # ---- at any rate ----

    def driven(self, rate: float, pressure: float) -> CouetteFlow:
        """Flow at this angular velocity; `error` is nan."""
        m = self.material
        grain = m.d * math.sqrt(positive("rho_s", m.rho_s) / pressure)
        sink = positive("b", m.b) * grain * self.share * (self.r / self.reach) ** 2

        def excess(u: float) -> float:
            return self.turn(self.steady(self.friction(u), sink, rate), self.friction(u))[0] - rate

        mu_wall = self.friction(self.least_excess(excess))
        g = self.steady(mu_wall, sink, rate)
        omega = self.turn(g, mu_wall)
        return self.flow(g, omega, mu_wall, math.nan)

    def turn(self, g: Array, mu_wall: float) -> Array:
        """Angular velocity [rad/s]: the integral of g mu from the outer cylinder inwards."""
        rate = (g * mu_wall * self.share)[::-1]
        return scipy.integrate.cumulative_trapezoid(rate, dx=self.step, initial=0.0)[::-1]

    def steady(self, mu_wall: float, sink: Array, rate: float) -> Array:
        """Positive g for a given mu_wall, by Newton's method.

        The equation is concave and the initial g = max(lambda/(b d sqrt(rho_s/p) mu)) is above the
        solution, so that the iterates decrease towards it. They stop when the inner cylinder turns
        slower than a thousandth of `rate`.
        """
        growth, sink, across = self.growth(mu_wall * self.share), mu_wall * sink, 1 / self.step**2
        inside = slice(1, -1) if self.rough else slice(None)
        g = np.full(self.x.size, np.max(growth / sink))
        if self.rough:
            g[[0, -1]] = 0.0
        bands = np.full((3, self.x.size), across)
        if not self.rough:
            bands[0, 1] *= 2
            bands[2, -2] *= 2
        for _ in range(200):
            bent = np.diff(g, prepend=g[1], append=g[-2])
            residual = np.diff(bent) * across + (growth - sink * g) * g
            bands[1] = growth - 2 * sink * g - 2 * across
            g = g.copy()
            change = scipy.linalg.solve_banded((1, 1), bands[:, inside], residual[inside])
            g[inside] -= change
            done = np.max(np.abs(change)) <= 1e-11 * np.max(g)
            if done or self.turn(g, mu_wall)[0] < 1e-3 * rate:
                return g
        raise RuntimeError(f"no convergence in 200 iterations for mu_wall = {mu_wall}")

    def flow(self, g: Array, omega: Array, mu_wall: float, error: float) -> CouetteFlow:
        mu = mu_wall * self.share
        return CouetteFlow(
            r=self.r,
            omega=omega / omega[0],
            g=g,
            shear_rate=g * mu,
            mu=mu,
            mu_wall=mu_wall,
            error=error,
        )

"""The grains of a discrete-element simulation: spheres with the contact law of the thesis."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Self

import numpy as np
from scipy.integrate import solve_ivp
from scipy.optimize import brentq

from granular.tools.checks import in_range, non_negative, positive

_LARGEST_DAMPING = 1e3
"""Largest dimensionless contact damping of a binary collision; the restitution is then below
1e-3."""


@dataclass(frozen=True, kw_only=True)
class Grains:
    """Spheres of two sizes with Hertzian, viscoelastic and frictional contacts.

    Hurley's thesis, section 4.3.1. With the overlap ``delta``, ``R = sqrt(Ri Rj/(Ri + Rj))`` and
    the reduced mass ``m``, the normal force is ``R (kn delta^1.5 + m gamma_n sqrt(delta) v_n)``
    (v_n the speed of approach); the tangential one ``R kt sqrt(delta)`` times the tangential
    displacement, at most ``mu_p`` times the normal one. There is no tangential contact damping.

    Parameters
    ----------
    d : float
        Mean diameter [m], > 0.
    spread : float
        Half of the grains have the diameter (1 - spread) d, half (1 + spread) d; in [0, 0.9].
    rho_s : float
        Density of the grains [kg/m3], > 0.
    kn, kt : float
        Normal and tangential stiffness [Pa], > 0 and >= 0; kt is kn/2 unless given.
    gamma_n : float
        Contact damping [1/(m s)], >= 0: see `restitution` and `with_restitution`.
    mu_p : float
        Friction coefficient of a contact, >= 0.
    {raises}.
    """

    d: float = 1e-3
    spread: float = 0.2
    rho_s: float = 2500.0
    kn: float = 1e9
    kt: float = None  # type: ignore[assignment]  # a float once made
    gamma_n: float = 0.0
    mu_p: float = 0.3

    def __post_init__(self) -> None:
        for name in ("d", "rho_s", "kn"):
            object.__setattr__(self, name, positive(name, getattr(self, name)))
        kt = 0.5 * self.kn if self.kt is None else self.kt
        object.__setattr__(self, "kt", non_negative("kt", kt))
        object.__setattr__(self, "spread", in_range("spread", self.spread, 0.0, 0.9))
        for name in ("gamma_n", "mu_p"):
            object.__setattr__(self, name, non_negative(name, getattr(self, name)))

    @property
    def diameters(self) -> tuple[float, float]:
        """Diameters of the small and the large grains [m]."""
        return (1.0 - self.spread) * self.d, (1.0 + self.spread) * self.d

    @property
    def d_volume(self) -> float:
        """Diameter ``<D^3>^(1/3)`` [m] of eq. 4.5, that of a sphere of the mean volume."""
        return self.d * math.cbrt(1.0 + 3.0 * self.spread**2)

    def contact(self, d: float | None = None) -> tuple[float, float]:
        """Reduced mass [kg] and R [sqrt(m)] of two equal grains of the diameter `d`, by default
        the mean diameter."""
        d = self.d if d is None else d
        return self.rho_s * math.pi * d**3 / 12.0, 0.5 * math.sqrt(d)

    def overlap_scale(self, speed: float, d: float | None = None) -> float:
        """Length ``(m v^2/(R kn))^(2/5)`` [m] for two equal grains. The largest overlap of an
        elastic impact at this speed is ``(5/4)^(2/5)`` times as large."""
        mass, radius = self.contact(d)
        return (mass * speed**2 / (radius * self.kn)) ** 0.4

    def _damping_number(self, speed: float) -> float:
        """Dimensionless contact damping of a collision, which alone determines the restitution."""
        radius = self.contact()[1]
        return self.gamma_n * radius * self.overlap_scale(speed) ** 1.5 / speed

    def restitution(self, speed: float) -> float:
        """Coefficient of restitution of a head-on collision of two grains of the mean diameter.

        It is the relative speed after the collision divided by that before, and decreases with the
        impact speed. The contact ends when the overlap is zero.

        Parameters
        ----------
        speed : float
            Relative speed at the impact [m/s], > 0.
        """
        return _rebound(self._damping_number(positive("speed", speed)))

    def with_restitution(self, restitution: float, speed: float) -> Self:
        """Copy of the grains with the contact damping that gives this restitution at this speed.

        Parameters
        ----------
        restitution : float
            Coefficient of restitution, in (0.01, 1].
        speed : float
            Relative speed at the impact [m/s], > 0.
        """
        wanted = in_range("restitution", restitution, 0.01, 1.0, open_low=True)
        speed = positive("speed", speed)
        if wanted == 1.0:
            return replace(self, gamma_n=0.0)
        number = brentq(lambda b: _rebound(b) - wanted, 0.0, _LARGEST_DAMPING, xtol=1e-12)
        return replace(self, gamma_n=number / replace(self, gamma_n=1.0)._damping_number(speed))


def _rebound(damping: float) -> float:
    """Restitution of ``x'' = -x^1.5 - damping sqrt(x) x'``, x(0) = 0, x'(0) = 1."""
    if damping == 0.0:
        return 1.0

    def rate(_: float, y: np.ndarray) -> tuple[float, float]:
        root = math.sqrt(max(y[0], 0.0))
        return y[1], -root * (max(y[0], 0.0) + damping * y[1])

    def parted(_: float, y: np.ndarray) -> float:
        return y[0]

    parted.terminal, parted.direction = True, -1.0  # type: ignore[attr-defined]  # for SciPy
    end = 1e3 * (1.0 + damping)
    path = solve_ivp(rate, (0.0, end), (0.0, 1.0), "LSODA", events=parted, rtol=1e-10, atol=1e-13)
    return -float(path.y_events[0][0][1]) if len(path.y_events[0]) else 0.0

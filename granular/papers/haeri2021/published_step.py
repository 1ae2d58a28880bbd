"""The published step of F and F^p, which loses pressure in shear."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from granular.materials import NGF, couette_beads
from granular.papers.figure import Drawn
from granular.papers.haeri2021.document import PAPER
from granular.papers.runs import Runs
from granular.plot.canvas import Picture
from granular.tools.arrays import Array

P0 = 800.0
"""Pressure at the start [Pa]."""
DT = 1e-4
"""Time step of the document between cylinders [s]."""
SHEARED = {0.3: 3.0, 1.0: 2.0, 5.0: 0.2}
"""Shear rates [1/s] and times [s]."""
ROWS = 100
"""Steps between the points of a curve, at the most."""


class PublishedPoint:
    """One point stepped as the document does: F and F^p, eqs. 18-31, and the pressure from F^e.

    Parameters
    ----------
    material : NGF
        Its fluidity is not diffused: this is the local limit of the law.
    p0 : float
        Pressure at the start [Pa], of a compression equal in all directions.

    Attributes
    ----------
    p : float
        Pressure [Pa]; 0 while the point is disconnected.
    F, Fp : ndarray, shape (3, 3)
        Deformation gradient and its plastic part.
    g, mu : float
        Fluidity [1/s] and friction tau/p.
    """

    def __init__(self, material: NGF, p0: float) -> None:
        self.material, self.p = material, p0
        self.F = np.eye(3) * math.exp(-p0 / material.K / 3)
        self.Fp = np.eye(3)
        self.g, self.mu = 1.0, 0.0

    def step(self, L: Array, dt: float) -> tuple[float, float]:
        """Take a step with this velocity gradient [1/s]; return pressure and shear stress [Pa]."""
        m = self.material
        self.F = (np.eye(3) + dt * L) @ self.F
        Fe = self.F @ np.linalg.inv(self.Fp)
        E = _logarithm(Fe.T @ Fe) / 2
        p = -m.K * float(np.trace(E))
        if p <= 0 or np.linalg.det(self.F) >= 1:
            self.p = 0.0
            return 0.0, 0.0
        self.g = max(self.g + dt / m.t0 * self._growth(), 0.0)
        trial = 2 * m.G * (E - np.trace(E) / 3 * np.eye(3))
        tau = math.sqrt((trial * trial).sum() / 2)
        after = tau * p / (p + m.G * dt * self.g)
        self.mu, self.p = after / p, p
        direction = trial / (math.sqrt(2) * tau) if tau else np.zeros((3, 3))
        self.Fp = (np.eye(3) + dt * self.mu * self.g / math.sqrt(2) * direction) @ self.Fp
        return p, after

    def _growth(self) -> float:
        """t0 times the rate of the fluidity, without its diffusion (eq. 24)."""
        m = self.material
        grain = m.d * math.sqrt(m.rho_s / self.p) if self.p else 0.0
        return (self.mu - m.mu_s) * self.g - m.b * grain * self.mu * self.g**2


def _logarithm(a: Array) -> Array:
    """Logarithm of a symmetric matrix."""
    value, vector = np.linalg.eigh(a)
    return (vector * np.log(value)) @ vector.T


@dataclass(frozen=True)
class ShearedPoint:
    """A point in simple shear, by the published step.

    Attributes
    ----------
    times, pressure, plastic_volume : ndarray, shape (k,)
        Times [s], pressure [Pa] and det F^p. They end where the point disconnects.
    """

    times: Array
    pressure: Array
    plastic_volume: Array


def sheared(
    material: NGF, rate: float, until: float, *, dt: float = DT, p0: float = P0
) -> ShearedPoint:
    """Shear a point at a constant rate [1/s] and volume."""
    point, L, rows = PublishedPoint(material, p0), np.zeros((3, 3)), [(0.0, p0, 1.0)]
    L[0, 1] = rate
    steps = round(until / dt)
    for step in range(1, steps + 1):
        p, _ = point.step(L, dt)
        if step % ROWS == 0 or step == steps or p == 0:
            rows.append((step * dt, p, float(np.linalg.det(point.Fp))))
        if p == 0:
            break
    return ShearedPoint(*np.array(rows).T)


def predicted_pressure(material: NGF, rate: float, times: Array) -> Array:
    """Pressure p0 - K dt rate^2 t/4 that the loss of det F^p leaves [Pa].

    A step multiplies det F^p by det(1 + e N) = 1 - e^2/2, where N is the direction of flow and
    e = dt rate/sqrt(2), while det F is constant.
    """
    return np.maximum(P0 - material.K * DT * rate**2 * times / 4, 0.0)


@PAPER.figure(
    "published_step",
    "not in the document: pressure in shear at constant volume by its explicit step of F and F^p",
    seconds=4.0,
)
def published_step(runs: Runs) -> Drawn:
    """Shear the beads of table 1 at three rates; in the package's law 800 Pa remain 800 Pa."""
    material = runs.grains(couette_beads)
    picture = Picture(figsize=(5.0, 3.0), layout="compressed")
    ax, numbers = picture.subplots(), {}
    for k, (rate, until) in enumerate(SHEARED.items()):
        path = sheared(material, rate, until)
        ax.plot(path.times, path.pressure, color=f"C{k}", label=f"{rate:g} 1/s")
        predicted = predicted_pressure(material, rate, path.times)
        ax.plot(path.times, predicted, ":", color="black", label="theory" if k == 2 else None)
        name = f"pressure left of 800 Pa at {rate:g} 1/s after {until:g} s [Pa]"
        numbers[name] = float(path.pressure[-1])
        if path.pressure[-1] == 0:
            numbers[f"time until nothing is left at {rate:g} 1/s [s]"] = float(path.times[-1])
    ax.axhline(P0, color="0.6", linewidth=0.8, zorder=0)
    ax.set(xlabel="time [s]", ylabel="pressure [Pa]", ylim=(0.0, None))
    ax.legend()
    return Drawn({"": picture}, numbers)

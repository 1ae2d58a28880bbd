"""Hooks of `Simulation.run` that end a run at rest, or in steady flow."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from granular.tools.checks import integer, non_negative, one_of, positive

if TYPE_CHECKING:
    from granular.run.recorder import Hook
    from granular.run.simulation import Simulation

__all__ = ["at_rest", "steady"]

LEAST_FRAMES = 8
"""Frames within the time over which a mean is taken, at least: four in each half."""

Number = float | NDArray[np.float64]


def at_rest(speed: float = 1e-3, *, over: float = 0.1) -> Hook:
    """Return a hook that ends a run when the material has come to rest.

    Parameters
    ----------
    speed : float
        Root mean square of the speeds of the points by mass [m/s], > 0, below which they rest.
    over : float
        Time for which they must rest [s], >= 0. Material that has not begun to move rests, too:
        choose a time longer than that.
    {raises}.

    Examples
    --------
    >>> sim = gr.Simulation(gr.scenes.column_collapse(cell=0.05, E=1e6))
    >>> _ = sim.run(until=10.0, hooks=(gr.stop.at_rest(0.01),))
    """
    return _AtRest(positive("speed", speed), non_negative("over", over))


@dataclass
class _AtRest:
    """Hook of `at_rest`, which processes of a sweep can receive."""

    speed: float
    over: float
    since: float | None = None

    def __call__(self, sim: Simulation) -> bool:
        if _kinetic_energy(sim) > 0.5 * self.speed**2 * _mass(sim):
            self.since = None
        elif self.since is None:
            self.since = sim.time
        return self.since is not None and sim.time - self.since >= self.over


def steady(
    of: str | Callable[[Any], float] = "kinetic_energy",
    *,
    over: float,
    tolerance: float = 0.02,
    after: float = 0.0,
    body: int = 0,
) -> Hook:
    """Return a hook that ends a run when a quantity has become steady.

    It is steady when its means over the two halves of the last seconds differ by less than a
    tolerance. What oscillates more slowly than that, or drifts by less, counts as steady.

    Parameters
    ----------
    of : {"kinetic_energy", "discharge", "force"} or callable
        The kinetic energy of the material; the mass that leaves the domain by time, less what
        enters; the force on a body; or a function of the simulation that returns a number.
    over : float
        Time over which the means are taken [s], > 0, in which there must be 8 frames (`every`).
    tolerance : float
        Largest difference of the means, relative to the larger one, > 0.
    after : float
        Time before which nothing is steady [s], >= 0, such as the filling of a silo.
    body : int
        Index of the body for "force".

    Raises
    ------
    TypeError, ValueError
        If an argument is out of range; in the run, if there are fewer frames, or no such body.
    """
    over, tolerance = positive("over", over), positive("tolerance", tolerance)
    after, body = non_negative("after", after), integer("body", body, 0)
    if not callable(of):
        of = one_of("of", of, ("kinetic_energy", "discharge", "force"))
    return _Steady(of, over, tolerance, after, body)


@dataclass
class _Steady:
    """Hook of `steady`, which processes of a sweep can receive."""

    of: str | Callable[[Any], float]
    over: float
    tolerance: float
    after: float
    body: int
    samples: deque[tuple[float, NDArray[np.float64]]] = field(default_factory=deque)

    def __call__(self, sim: Simulation) -> bool:
        samples = self.samples
        samples.append((sim.time, np.asarray(self._value(sim), dtype=float)))
        begin = sim.time - self.over
        while len(samples) > 1 and samples[1][0] <= begin:
            samples.popleft()
        if samples[0][0] > begin or sim.time < self.after:
            return False
        if len(samples) <= LEAST_FRAMES:
            raise ValueError(
                f"over = {self.over} must have at least {LEAST_FRAMES} frames, "
                f"not {len(samples) - 1}: take a smaller every"
            )
        # The discharge and the force are exact means: differences of the mass and of the impulse.
        first, second = _means(samples, self.of in ("discharge", "force"))
        change, size = np.linalg.norm(second - first), np.linalg.norm([first, second], axis=-1)
        return bool(change <= self.tolerance * np.max(size))

    def _value(self, sim: Simulation) -> Number:
        if self.of == "discharge":
            return -_mass(sim)
        if self.of == "force":
            bodies = sim.bodies  # type: ignore[attr-defined]
            if self.body >= len(bodies):
                raise ValueError(
                    f"body = {self.body} must be < {len(bodies)}, the bodies there are"
                )
            return bodies[self.body].impulse
        return self.of(sim) if callable(self.of) else _kinetic_energy(sim)


def _means(
    samples: deque[tuple[float, NDArray[np.float64]]], is_sum: bool
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Means over the two halves of some samples, of which sums are differentiated."""
    times, values = map(np.array, zip(*samples, strict=True))
    middle = len(times) // 2
    if is_sum:
        spans = np.diff(times[[0, middle, -1]])
        first, second = (np.diff(values[[0, middle, -1]], axis=0).T / spans).T
    else:
        first, second = values[:middle].mean(axis=0), values[middle:].mean(axis=0)
    return np.atleast_1d(first), np.atleast_1d(second)


def _mass(sim: Simulation) -> float:
    return float(sim.state.mass.sum())


def _kinetic_energy(sim: Simulation) -> float:
    state = sim.state
    return float(0.5 * state.mass @ (state.v**2).sum(axis=1))

"""Runs until a flow has come to rest, that is until its profile is frozen."""

from __future__ import annotations

import math

import numpy as np

from granular.model.state import State
from granular.run.recorder import Hook
from granular.run.simulation import Simulation
from granular.tools.checks import in_range, non_negative, positive


def _speed(state: State) -> float:
    """Root mean square of the speed [m/s], weighted by mass; 0 without particles."""
    if not state.n:
        return 0.0
    return float(np.sqrt(np.average((state.v**2).sum(axis=1), weights=state.mass)))


def run_to_rest(
    simulation: Simulation,
    *,
    after: float = 0.0,
    interval: float = 0.1,
    share: float = 0.1,
    until: float | None = None,
    hooks: tuple[Hook, ...] = (),
) -> float | None:
    """Run until the profile of a heap is frozen.

    The profile counts as frozen when the root mean square speed of the particles is below a
    fraction of its largest value so far. Hurley's thesis stops when the kinetic energy is below
    1e-5 J/m3. This is not reached: a few particles on the surface of a heap keep moving, and
    without a spring (`Viscoplastic.nu` = 0.5) a slope creeps for ever, at a rate in proportion to
    the time step.

    Parameters
    ----------
    after : float
        Time before which speeds do not count [s], such as the time at which a gate opens.
    interval : float
        Time between two samples of the speed [s].
    share : float
        Fraction of the largest speed, 0 to 1.
    until : float or None
        Time to stop at in any case [s]; None for the scene's duration.
    hooks : tuple of callables
        Called with the simulation at each sample.

    Returns
    -------
    float or None
        Time at which the profile was frozen [s]; None if it was not.
    {raises}.
    """
    after, interval = non_negative("after", after), positive("interval", interval)
    share = in_range("share", share, 0.0, 1.0)
    until = simulation.scene.duration if until is None else positive("until", until)
    if after > simulation.time:
        simulation.run(min(after, until), every=interval, hooks=hooks)
    largest = 0.0
    while simulation.time < until:
        # Samples are taken at the times at which hooks are called.
        sample = interval * (math.floor(simulation.time / interval) + 1)
        simulation.run(min(sample, until), every=interval, hooks=hooks)
        now = _speed(simulation.state)
        largest = max(largest, now)
        if now < share * largest:
            return simulation.time
    return None

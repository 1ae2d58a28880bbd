"""The layer on a rough incline (Dunatunga & Kamrin 2015, section 4.4), one periodic column."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from typing import cast

import numpy as np

from granular import materials, scenes
from granular.materials import MuI
from granular.model.gravity import DUNATUNGA_KAMRIN
from granular.model.state import State
from granular.mpm import schemes
from granular.run.simulation import Simulation
from granular.theory import bagnold_profile, transient
from granular.verify.rows import Row, at_least, at_most, check, holds, within

HEIGHT = 0.2
"""Height of the layer [m]."""

ANGLES = tuple(range(19, 35))
"""Inclinations [deg]."""

PUBLISHED = schemes.dunatunga_kamrin_2015.replace(dt=None)
"""The published scheme with a time step of half its limit, close to the paper's 3e-6 s."""

MOVING = 1e-3
"""Mean velocity [m/s] below which a layer is at rest; elastic waves cause less than this."""


def states(angle_deg: float, E: float, times: Sequence[float]) -> Iterator[State]:
    """States of one column at the given times, with the published scheme and resolution."""
    material = materials.glass_beads.replace(E=E)
    scene = scenes.incline(
        angle_deg=angle_deg, height=HEIGHT, material=material, scheme=PUBLISHED, duration=times[-1]
    )
    sim = Simulation(scene, threads=1)
    for time in times:
        sim.run(until=time)
        yield sim.state


def mean_speed(state: State) -> float:
    """Depth average of the velocity down the slope [m/s]."""
    return float(np.average(state.v[:, 0], weights=state.mass))


def profile_error(state: State) -> float:
    """Relative L2 error of v(y) at the points against the steady profile (eq. 4.6)."""
    exact = bagnold_profile(
        state.x[:, 1],
        state.scene.parameters["angle_deg"],
        HEIGHT,
        cast(MuI, state.scene.material),
        DUNATUNGA_KAMRIN,
    )
    miss = state.v[:, 0] - exact
    return float(np.sqrt(np.sum(state.mass * miss**2) / np.sum(state.mass * exact**2)))


def transient_errors(angle_deg: float, E: float, times: Sequence[float]) -> np.ndarray:
    """Mean velocities and their errors against the one-dimensional PDE, shape (nt, 2).

    The error is relative, except for a layer at rest: there it is the mean velocity itself.
    """
    runs = list(states(angle_deg, E, times))
    means = np.array([mean_speed(state) for state in runs])
    # The PDE is evaluated at the times of the states, which are those of the first step at or
    # after the requested time.
    times = [state.time for state in runs]
    exact = transient(angle_deg, HEIGHT, materials.glass_beads, times, DUNATUNGA_KAMRIN).mean
    scale = np.where(exact > MOVING, exact, 1.0)
    return np.stack([means, (means - exact) / scale], axis=1)


@check()
def incline_quick() -> Iterator[Row]:
    """One column at 25 deg up to 0.5 s, E = 1e7 and 1e8 Pa (the paper's is 1e9 Pa).

    vbar has an offset that persists in time and falls as 1/sqrt(E) or faster, which is asserted.
    It is probably caused by elastic waves of the gravity ramp: the layer slips while they lower
    its pressure. The other bounds are twice the values measured when this check was written.
    """
    soft, stiff = (transient_errors(25.0, E, (0.2, 0.5))[:, 1] for E in (1e7, 1e8))
    yield at_most("error of vbar at 0.2 s, E = 1e8", abs(stiff[0]), 8e-3)
    yield at_most("error of vbar at 0.5 s, E = 1e8", abs(stiff[1]), 3.6e-3)
    gain = float(np.min(np.abs(soft / stiff)))
    yield at_least("gain of E = 1e8 over E = 1e7", gain, math.sqrt(10))


@check(slow=True)
def incline_steady() -> Iterator[Row]:
    """One column at 25 deg, E = 1e9 Pa: the transient to 11.5 s, the steady profile at 45 s."""
    times = (0.5, 6.0, 11.5, 45.0)
    runs = list(states(25.0, 1e9, times))
    at = [s.time for s in runs]
    exact = transient(25.0, HEIGHT, materials.glass_beads, at, DUNATUNGA_KAMRIN).mean
    for time, state, theory in zip(times[:3], runs, exact, strict=False):
        mean = mean_speed(state)
        name = f"error of vbar = {mean:.5f} m/s at {time:g} s"
        yield at_most(name, abs(mean / theory - 1), 1e-3)
    yield at_most("L2 error of v(y) at 45 s", profile_error(runs[-1]), 5e-4)


@check()
def incline_thresholds_quick() -> Iterator[Row]:
    """Rest at 20 deg, flow at 21 deg; one column, E = 1e7 Pa, 1 s."""
    slow, fast = (abs(transient_errors(angle, 1e7, (1.0,))[0, 0]) for angle in (20.0, 21.0))
    yield at_most("|vbar| at 20 deg [m/s]", slow, MOVING)
    yield holds("flow at 21 deg", fast > MOVING)


def modulus(angle_deg: int) -> float:
    """Young's modulus [Pa] with which the offset of `incline_quick` is below 1 % at 0.5 s.

    Close to the angle of flow a stiffer layer is needed, because the driving tan(angle) - mu_s is
    small there and the offset is relative to it.
    """
    return {21: 3e10, 22: 1e9}.get(angle_deg, 1e8)


@check(slow=True)
def incline_angles() -> Iterator[Row]:
    """19 to 34 deg in steps of 1 deg, one column: vbar against the PDE from 0.5 to 20 s."""
    times = tuple(np.arange(0.5, 20.1, 0.5))
    moving = []
    for angle in ANGLES:
        E = modulus(angle)
        runs = transient_errors(float(angle), E, times)
        largest = float(np.abs(runs[:, 1]).max())
        if abs(runs[-1, 0]) > MOVING:
            moving.append(angle)
            yield at_most(f"largest error of vbar, {angle} deg, E = {E:.0e}", largest, 0.01)
        else:
            yield at_most(f"largest |vbar| [m/s], {angle} deg, E = {E:.0e}", largest, MOVING)
    yield within("flow starts between 20 and this angle [deg]", min(moving), 21, 0)

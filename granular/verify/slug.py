"""The slug in free flight (Dunatunga & Kamrin 2015, section 4.5)."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from granular import materials, measure, scenes
from granular.model.state import State
from granular.mpm import schemes
from granular.mpm.schemes import Scheme
from granular.run.simulation import Simulation
from granular.tools.arrays import Array
from granular.verify.hourglass import PHASE_TOLERANCE
from granular.verify.rows import Row, at_least, at_most, check, holds, report
from granular.verify.silo import mass_is_exact

FLIGHT = 0.25
"""Duration of the flight that is checked [s]; the slug meets the wall after a third of a second."""

ROUND_OFF = float(np.finfo(float).eps)
"""Round-off of a step, in units of the largest velocity or distance."""


def parabola(start: State, now: State) -> tuple[Array, Array]:
    """Positions and velocities of the integrator after n steps of fixed dt, in closed form.

    A step is v += dt g, then x += dt v. Hence ``v_n = v_0 + n dt g`` and
    ``x_n = x_0 + n dt v_0 + n(n+1)/2 dt^2 g``.
    """
    n, dt = now.step, now.dt
    g = np.array(start.scene.gravity.at(0.0))
    x = start.x + n * dt * start.v + 0.5 * n * (n + 1) * dt**2 * g
    return x, start.v + n * dt * g


def fly(scheme: Scheme, E: float, until: float) -> tuple[State, State]:
    """States of the slug at the start and at `until`, with a fixed time step of half the limit."""
    material = materials.glass_beads.replace(E=E)
    scene = scenes.slug(material=material)
    fixed = scheme.replace(dt=0.4 * scene.grid.cell / material.wave_speed)
    sim = Simulation(scene.replace(scheme=fixed), threads=1)
    start = sim.state
    sim.run(until=until)
    return start, sim.state


def flight(scheme: Scheme, name: str) -> Iterator[Row]:
    """Rows of a flight: points on the parabola, no stress, exact mass."""
    start, now = fly(scheme, 1e6, FLIGHT)
    x, v = parabola(start, now)
    miss = max(np.abs(now.x - x).max() / np.abs(x).max(), np.abs(now.v - v).max() / np.abs(v).max())
    yield at_most(f"off the discrete parabola, {name}, over steps", miss / now.step, ROUND_OFF)
    yield holds(f"no stress in flight, {name}", not now.stress.any())
    yield holds(f"mass is exact, {name}", mass_is_exact(now))


@check()
def slug_flight() -> Iterator[Row]:
    """The slug until it meets the wall: it leaves the discrete parabola by round-off only."""
    yield from flight(schemes.dunatunga_kamrin_2015, "published")
    yield from flight(schemes.default, "default")


@check(slow=True)
def slug_at_rest() -> Iterator[Row]:
    """The slug after 2 s, E = 1e6 Pa: with the default scheme it is dense again and at rest."""
    now = fly(schemes.default, 1e6, 2.0)[1]
    yield at_least("share under stress, default", float(now.dense.mean()), 0.9)
    share = measure.disconnected_fraction(now)
    yield at_most("stress-free in the bulk, default", share, 0.05)
    speed = measure.speed_percentile(now)
    yield at_most("99th percentile of speed [m/s], default", speed, 0.01)
    yield holds("mass is exact, default", mass_is_exact(now))
    now = fly(schemes.dunatunga_kamrin_2015, 1e6, 2.0)[1]
    phase = float(measure.phase(now, tolerance=PHASE_TOLERANCE).mean())
    yield report("dense by nodal density, published", f"{phase:.3f}", "all")
    yield report("share under stress, published", f"{float(now.dense.mean()):.3f}", "all")
    yield holds("mass is exact, published", mass_is_exact(now))

"""Invariants, bitwise or to round-off: threads, restarts, mass, momentum, energy of the grid."""

from __future__ import annotations

from collections.abc import Iterator
from typing import cast

import numpy as np

from granular import materials, measure, scenes
from granular.model.fill import Fill
from granular.model.gravity import Gravity
from granular.model.grid import Grid
from granular.model.state import State
from granular.mpm import schemes
from granular.mpm.engine import averaging_interval
from granular.mpm.scene import Scene
from granular.mpm.schemes import Scheme
from granular.run.simulation import Simulation
from granular.shapes import Box
from granular.tools.arrays import Array
from granular.verify.incline import PUBLISHED
from granular.verify.rows import Row, at_most, check, holds, report
from granular.verify.silo import mass_is_exact

SOFT = materials.glass_beads.replace(E=1e6)

SCHEMES = {"published": PUBLISHED, "default": schemes.default}

STEPS = 240
"""Number of steps of the runs compared bitwise, with a restart at each quarter."""


def same_bits(a: State, b: State) -> bool:
    """True if two states agree bitwise in time and in all fields."""
    return (
        a.time == b.time
        and a.step == b.step
        and a.fields.keys() == b.fields.keys()
        and all(a.fields[name].tobytes() == b.fields[name].tobytes() for name in a.fields)
    )


def _silo(scheme: Scheme) -> Scene:
    """A small silo whose orifice opens early in the run, so that points leave it."""
    return scenes.silo(
        orifice=0.08,
        width=0.32,
        height=0.2,
        cell=0.02,
        opens_at=0.01,
        ramp=0.005,
        material=SOFT,
        scheme=scheme,
    )


@check()
def threads_and_restart() -> Iterator[Row]:
    """A small silo that points leave: 1, 2 and 3 threads, and restarts at three times."""
    for name, scheme in SCHEMES.items():
        scene = _silo(scheme)
        whole = Simulation(scene, threads=1)
        stops = []
        for _ in range(3):
            whole.step(STEPS // 4)
            stops.append(whole.checkpoint())
        whole.step(STEPS // 4)
        end = whole.state
        for threads in (2, 3):
            sim = Simulation(scene, threads=threads)
            sim.step(STEPS)
            yield holds(f"same bits with {threads} threads, {name}", same_bits(sim.state, end))
        resumed = []
        for stop in stops:
            again = Simulation.from_checkpoint(scene, stop, threads=1)
            again.step(STEPS - again.steps)
            resumed.append(same_bits(again.state, end))
        yield holds(f"same bits after 3 restarts, {name}", all(resumed))
        yield holds(f"points left meanwhile, {name}", end.n < Simulation(scene).n_points)


def closed_system(scheme: Scheme) -> Scene:
    """Material that fills a periodic box without gravity or walls, set in motion at the start."""
    cell, shape = 0.02, (8, 8)
    side = cell * shape[0]
    return Scene(
        name="closed",
        grid=Grid((0.0, 0.0), cell, shape, periodic=(True, True)),
        fills=(
            Fill(Box((0.0, 0.0), (side / 2, side)), 4, jitter=0.5, velocity=(0.3, -0.2)),
            Fill(Box((side / 2, 0.0), (side, side)), 4, jitter=0.5, velocity=(-0.5, 0.1)),
        ),
        material=SOFT,
        scheme=scheme,
        gravity=Gravity((0.0,), ((0.0, 0.0),)),
        walls=(),
        duration=10.0,
    )


def momentum(state: State) -> Array:
    """Momentum of the points [kg m/s].

    It excludes the momentum correction of the particle shifting, which the next step takes back.
    """
    averaged = (state.step - 1) % averaging_interval(cast(Scene, state.scene)) == 0
    shift_velocity = state.fields.get("shift_velocity", 0.0) if averaged else 0.0
    return state.mass @ (state.v - shift_velocity)


def momentum_drift(scheme: Scheme, steps: int = 10_000) -> tuple[float, State]:
    """Change of the total momentum of the closed system over the sum of |m v| at the start."""
    sim = Simulation(closed_system(scheme), threads=1)
    start = sim.state
    sim.step(steps)
    change = momentum(sim.state) - momentum(start)
    return float(np.abs(change).max() / (start.mass @ np.abs(start.v)).max()), sim.state


@check()
def conservation() -> Iterator[Row]:
    """Mass and momentum of a closed system, two colliding halves, over 10^4 steps."""
    for name, scheme in SCHEMES.items():
        drift, state = momentum_drift(scheme)
        yield holds(f"mass is exact, {name}", mass_is_exact(state))
        yield at_most(f"drift of momentum, {name}", drift, 1e-12)


@check()
def energy() -> Iterator[Row]:
    """Energy of a small collapse, 300 steps: the balance of the grid, and each loss."""
    for name, scheme in SCHEMES.items():
        scene = scenes.column_collapse(aspect=1.0, cell=0.025, material=SOFT, scheme=scheme)
        sim = Simulation(cast(Scene, scene), threads=1)
        sim.run(until=0.2)
        steps = [measure.step_budget(sim) for _ in range(300)]
        off = max(abs(s.grid_residual) / s.grid_kinetic_before for s in steps)
        yield at_most(f"residual of the grid over its energy, {name}", off, 1e-13)
        released = sum(s.external_work for s in steps)
        # With FLIP the points keep the energy that the grid cannot carry and that walls take from
        # the grid, and return it in the next step. Only the sum of the three terms is a loss.
        for title, value in {
            "loss of transfers and walls": sum(
                s.p2g_loss + s.g2p_loss - s.wall_work for s in steps
            ),
            "loss by disconnection": sum(s.disconnection_loss for s in steps),
            "plastic dissipation": sum(s.plastic_dissipation for s in steps),
        }.items():
            yield report(f"{title}, {name}", f"{value / released:.3g}", "over gravity work")

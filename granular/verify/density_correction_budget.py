"""Energy and momentum that the density correction itself adds in a step."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import cast

import numpy as np

from granular import materials, measure
from granular.measure.energy import plastic_power
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
from granular.verify.layers import JITTER, MODULUS, layer
from granular.verify.rows import Row, at_most, check, holds, report

IDLE = dict.fromkeys(
    (
        *("diffusion", "strain_diffusion", "relaxation", "compression_rate", "shifting"),
        *("weight_correction", "weight_correction_decay"),
    ),
    0.0,
)
"""Changes that switch the density correction of a scheme off and leave the rest as it is."""

ENOUGH = 100
"""Number of sampled steps from which the mean of the added energy is significant."""


@dataclass(frozen=True)
class Given:
    """Energy and momentum that the density correction of one step adds.

    The momentum correction of the particle shifting, which the next step takes back, is included
    together with its return.

    Attributes
    ----------
    energy : float
        Kinetic and elastic energy, less the work of gravity [J/m].
    momentum : float
        The larger component of the momentum, divided by the sum of |m v|.
    angular : float
        Angular momentum about the base, divided by the sum of m |v| y.
    plastic : float
        Plastic work of the steps between two averagings of the density [J/m].
    """

    energy: float
    momentum: float
    angular: float
    plastic: float


def _two_steps(sim: Simulation, first: Scheme, second: Scheme) -> State:
    """State after two steps, the first with the scheme `first`, the second with `second`."""
    stop = sim.checkpoint()
    for scheme in (first, second):
        one = Simulation.from_checkpoint(sim.scene.replace(scheme=scheme), stop, threads=1)
        one.step()
        stop = one.checkpoint()
    return one.state


def given(sim: Simulation) -> Given:
    """Compare a step with the density correction with the same step without it.

    The simulation first advances to a step that averages the density. Both runs then make a second
    step without the density correction, in which the momentum correction of the particle shifting
    is taken back.
    """
    scene = cast(Scene, sim.scene)
    scheme = scene.scheme
    interval = averaging_interval(scene) if scheme.density.name == "smoothed" else 1
    if sim.steps % interval:
        sim.step(interval - sim.steps % interval)
    corrected = scheme.replace(dt=sim.dt)  # the same time step for all four steps
    off = {name: value for name, value in IDLE.items() if name in scheme.density.units}
    idle = corrected.replace(density=scheme.density.replace(**off))
    a, b = _two_steps(sim, corrected, idle), _two_steps(sim, idle, idle)
    grid, m = a.scene.grid, a.mass
    length = np.array(grid.shape) * grid.cell
    moved = a.x - b.x
    moved -= np.where(grid.periodic, np.round(moved / length) * length, 0.0)
    first, second = measure.energy(a), measure.energy(b)
    stored = first.kinetic + first.elastic - second.kinetic - second.elastic
    speed = np.linalg.norm(b.v, axis=1)
    x = b.x + moved  # not folded into the period
    spin = m @ (x[:, 0] * a.v[:, 1] - b.x[:, 0] * b.v[:, 1])
    spin -= m @ (x[:, 1] * a.v[:, 0] - b.x[:, 1] * b.v[:, 0])
    return Given(
        energy=stored - float(m @ (moved @ a.scene.gravity.at(a.time))),
        momentum=float(np.abs(m @ (a.v - b.v)).max() / (m @ speed)),
        angular=float(spin / (m @ (speed * b.x[:, 1]))),
        plastic=plastic_power(b) * b.dt * interval,
    )


def collision(scheme: Scheme) -> Scene:
    """Two blocks that meet and slide past each other without walls and gravity."""
    cell, shape = 0.02, (30, 30)
    return Scene(
        name="collision",
        grid=Grid((0.0, 0.0), cell, shape),
        fills=(
            Fill(Box((0.2, 0.2), (0.3, 0.4)), 4, jitter=JITTER, velocity=(0.5, 0.5)),
            Fill(Box((0.3, 0.2), (0.4, 0.4)), 4, jitter=JITTER, velocity=(-0.5, -0.5)),
        ),
        material=materials.glass_beads.replace(E=MODULUS),
        scheme=scheme,
        walls=(),
        gravity=Gravity((0.0,), ((0.0, 0.0),)),
        duration=0.2,
    )


def sampled(sim: Simulation, samples: int, until: float) -> list[Given]:
    """`Given` of `samples` steps of a run, evenly spaced in time."""
    times = np.linspace(sim.time, until, samples + 1)[1:]
    return [given(sim.run(until=float(time))) for time in times]


def lost_by_all(scheme: Scheme, until: float, readings: int) -> float:
    """Energy that density correction and transfer together take from a flowing layer.

    It is the work of gravity, less the change of the stored energy, less the plastic work, divided
    by the plastic work. Both works are integrals of rates sampled at `readings` times.
    """
    sim = layer(steady=True, scheme=scheme).run(until=0.5)
    start, begin = measure.energy(sim.state), sim.time
    plastic = gravity = 0.0
    for time in np.linspace(begin, until, readings + 1)[1:]:
        state = sim.run(until=float(time)).state
        plastic += plastic_power(state) / readings
        gravity += float(state.mass @ (state.v @ state.scene.gravity.at(state.time))) / readings
    end = measure.energy(state)
    stored = end.kinetic + end.elastic - start.kinetic - start.elastic
    return (gravity - stored / (sim.time - begin)) / plastic - 1.0


def budget(samples: int, until: float, scheme: Scheme) -> Iterator[Row]:
    """Rows of the energy added to a flowing layer and of the momentum added to colliding blocks.

    The density correction must not create energy: the mean added energy, less twice its standard
    error, must not be positive.
    """
    additions = sampled(layer(steady=True, scheme=scheme), samples, until)
    work = np.mean([f.plastic for f in additions])
    energy = np.array([f.energy for f in additions]) / work
    spread = float(energy.std(ddof=1) / np.sqrt(samples))
    text = f"{energy.mean():+.2g} +- {spread:.1g}"
    made = bool(energy.mean() > 2 * spread) if samples >= ENOUGH else None
    expected = "reported" if made is None else "0 or less"
    passed = None if made is None else not made
    yield Row("energy given by the density correction over plastic work", text, expected, passed)
    lost = lost_by_all(scheme, until / 2, 5 * samples)
    yield report("lost by density correction and transfer together", f"{lost:+.2g}", "reported")
    additions = sampled(Simulation(collision(scheme), threads=1), samples, 0.1)
    yield holds("the colliding blocks flow", sum(f.plastic for f in additions) > 0)
    yield at_most("momentum given in a step, over m |v|", max(f.momentum for f in additions), 1e-12)
    spin = max(abs(f.angular) for f in additions)
    yield report("angular momentum given in a step, over m |v| y", f"{spin:.2g}", "reported")
    mean = sum(f.angular for f in additions) / samples
    yield report("the same, mean with its sign", f"{mean:+.2g}", "reported")


@check()
def density_correction_budget_quick(scheme: Scheme = schemes.default) -> Iterator[Row]:
    """A layer at 25 deg for 2 s, colliding blocks for 0.1 s: 20 sampled steps of each."""
    yield from budget(20, 2.0, scheme)


@check(slow=True)
def density_correction_budget(scheme: Scheme = schemes.default) -> Iterator[Row]:
    """A layer at 25 deg for 20 s, colliding blocks for 0.1 s: 400 sampled steps of each."""
    yield from budget(400, 20.0, scheme)

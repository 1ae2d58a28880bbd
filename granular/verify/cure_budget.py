"""What the cure itself does to energy and momentum, step by step."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from granular import measure, schemes
from granular.schemes import Scheme
from granular.simulation import Simulation
from granular.state import State
from granular.verify.layers import layer
from granular.verify.rows import Row, at_most, beside, check

IDLE = {"diffusion": 0.0, "shear_diffusion": 0.0, "feedback": 0.0, "shift": 0.0}
"""Changes of a scheme without which it is its own twin that does not cure."""


@dataclass(frozen=True)
class Given:
    """What the cure of one step gives to a layer, with what is lent and taken back.

    Attributes
    ----------
    energy : float
        Kinetic and elastic, less the work of gravity [J/m].
    momentum : float
        The larger of the components, over the sum of |m v|.
    angular : float
        Angular momentum about the base, over sum m |v| y.
    plastic : float
        Plastic work of the step [J/m].
    """

    energy: float
    momentum: float
    angular: float
    plastic: float


def _two_steps(sim: Simulation, first: Scheme, second: Scheme) -> State:
    """The state two steps on, each with a scheme of its own."""
    stop = sim.checkpoint()
    for scheme in (first, second):
        one = Simulation.from_checkpoint(sim.scene.replace(scheme=scheme), stop, threads=1)
        one.step()
        stop = one.checkpoint()
    return one.state


def given(sim: Simulation) -> Given:
    """Compare a step with the cure with the same step without it.

    A second step, without the cure for both, takes back what the shift had lent.
    """
    cured = sim.scene.scheme.replace(dt=sim.dt)  # the same for all four steps
    idle = cured.replace(**IDLE)
    a, b = _two_steps(sim, cured, idle), _two_steps(sim, idle, idle)
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
        plastic=float(np.sum(b.volume * b.tau * b.shear_rate) * b.dt),
    )


def budget(sim: Simulation, samples: int, until: float) -> Iterator[Row]:
    """Rows of what the cure gives, from `samples` steps of a run."""
    found = []
    for time in np.linspace(sim.time, until, samples + 1)[1:]:
        found.append(given(sim.run(until=float(time))))
    work = sum(f.plastic for f in found)
    energy = sum(f.energy for f in found) / work
    yield at_most("energy given by the cure over plastic work", energy, 0.0)
    yield at_most("momentum given in a step, over m |v|", max(f.momentum for f in found), 1e-12)
    spin = max(abs(f.angular) for f in found)
    yield beside("angular momentum given in a step, over m |v| y", f"{spin:.2g}", "reported")


@check()
def cure_budget_quick(scheme: Scheme = schemes.default) -> Iterator[Row]:
    """Eight columns at 25 deg, from the steady flow: 20 steps of 2 s."""
    yield from budget(layer(steady=True, scheme=scheme), 20, 2.0)


@check(slow=True)
def cure_budget(scheme: Scheme = schemes.default) -> Iterator[Row]:
    """Eight columns at 25 deg, from the steady flow: 400 steps of 20 s."""
    yield from budget(layer(steady=True, scheme=scheme), 400, 20.0)

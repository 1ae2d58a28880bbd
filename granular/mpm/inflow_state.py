"""Account of the material that has entered a simulation."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from granular.measure.energy import elastic_of, kinetic_of
from granular.model.inflow import InflowState
from granular.model.state import State
from granular.tools.arrays import Array, IntArray

if TYPE_CHECKING:
    from granular.mpm.scene import Scene


def account(
    scene: Scene, fields: Mapping[str, NDArray], state: IntArray, row: Array
) -> InflowState:
    """Make the account of an inflow.

    Parameters
    ----------
    fields : mapping of str to ndarray
        Fields of the points that enter at the sites.
    state : ndarray of int64
        Numbers of the core: points that were due and missed, and for each site those that have
        entered and whether one waits.
    row : ndarray, shape (9,)
        Impulse and work of the nodes of a driven inflow, as of a wall.
    """
    n = len(fields["mass"])
    entered = state[2 : 2 + n]
    one = State(
        scene=scene, time=0.0, step=0, dt=0.0, fields={"stress": np.zeros((n, 4)), **fields}
    )
    mass = entered * fields["mass"]
    # Gravity works on entered material from its position at the inlet on.
    below = (np.array(scene.grid.lower) - fields["x"]) @ scene.gravity.vectors[-1]
    return InflowState(
        points=int(entered.sum()),
        missed=int(state[1]),
        mass=float(mass.sum()),
        momentum=mass @ fields["v"],
        energy=float(entered @ (kinetic_of(one) + elastic_of(one))),
        height_energy=float(mass @ below),
        impulse=-row[: scene.dim],
        work=float(row[7]),
    )

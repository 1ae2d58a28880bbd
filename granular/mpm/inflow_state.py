"""Account of what has entered a simulation."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from granular.measure.energy import elastic_of, kinetic_of
from granular.state import State

if TYPE_CHECKING:
    from granular.mpm.scene import Scene

__all__ = ["InflowState", "account"]


@dataclass(frozen=True, eq=False, kw_only=True)
class InflowState:
    """Account of an inflow since the start of the run.

    Attributes
    ----------
    points : int
        Number of points that have entered.
    missed : int
        Number of points that were due and did not enter because their places were taken.
    mass : float
        Mass that has entered [kg; in 2D per metre of depth].
    momentum : ndarray, shape (dim,)
        Momentum that has entered with it [N s].
    energy : float
        Kinetic and elastic energy that has entered with it [J].
    height_energy : float
        Gravitational energy of it at the inlet, under the last gravity of the scene [J]; it is zero
        at the lower corner of the grid.
    impulse : ndarray, shape (dim,)
        Impulse of the nodes of a driven inflow on the material [N s]; 0 for others.
    work : float
        Work of these nodes on the material [J].
    """

    points: int
    missed: int
    mass: float
    momentum: NDArray[np.float64]
    energy: float
    height_energy: float
    impulse: NDArray[np.float64]
    work: float


def account(
    scene: Scene, fields: Mapping[str, NDArray], state: NDArray[np.int64], row: NDArray[np.float64]
) -> InflowState:
    """Make the account of an inflow.

    Parameters
    ----------
    scene : Scene
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
    # Gravity works on what has entered from its place at the inlet on; see `diagnostics`.
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

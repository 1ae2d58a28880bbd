"""Types that are shared by modules which know scenes and states but no method."""

from collections.abc import Callable, Iterable
from typing import TYPE_CHECKING, TypeAlias

from numpy.typing import ArrayLike

from granular.state import State

if TYPE_CHECKING:
    from granular.mpm.scene import Scene as MpmScene
    from granular.mpm.simulation import Simulation as MpmSimulation
    from granular.sph.scene import Scene as SphScene
    from granular.sph.simulation import Simulation as SphSimulation

__all__ = ["AnyScene", "AnySimulation", "PointField", "States"]

AnyScene: TypeAlias = "MpmScene | SphScene"
"""A scene of either method."""

AnySimulation: TypeAlias = "MpmSimulation | SphSimulation"
"""A simulation by either method."""

States: TypeAlias = State | Iterable[State]
"""A state, or several: a trajectory or a sequence of states."""

PointField: TypeAlias = str | ArrayLike | Callable[[State], ArrayLike]
"""Values at the points: the name of a field, an array, or a function of a state."""

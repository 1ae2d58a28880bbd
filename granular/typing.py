"""Types that are shared by modules which know scenes and states but no method."""

from collections.abc import Iterable
from typing import TYPE_CHECKING, TypeAlias

from granular.state import State

if TYPE_CHECKING:
    from granular.mpm.scene import Scene as MpmScene
    from granular.sph.scene import Scene as SphScene

__all__ = ["AnyScene", "States"]

AnyScene: TypeAlias = "MpmScene | SphScene"
"""A scene of either method."""

States: TypeAlias = State | Iterable[State]
"""A state, or several: a trajectory or a sequence of states."""

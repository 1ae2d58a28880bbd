"""Type of the scenes, for modules that do not depend on a method."""

from typing import TYPE_CHECKING, TypeAlias

if TYPE_CHECKING:
    from granular.mpm.scene import Scene as MpmScene
    from granular.sph.scene import Scene as SphScene


AnyScene: TypeAlias = "MpmScene | SphScene"
"""A scene of either method."""

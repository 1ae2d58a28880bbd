"""The opening of a 2D silo, the reference of the heights, distances and rates of its flow."""

from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from typing import Self, cast

import numpy as np

from granular.model.state import State, States
from granular.model.symmetric import modelled_share
from granular.model.typing import AnyScene
from granular.tools.arrays import Array
from granular.tools.checks import finite, positive


@dataclass(frozen=True)
class Opening:
    """Position and width of the opening of a 2D silo.

    Parameters
    ----------
    width : float
        Full width W [m], also where half a silo is modelled.
    axis : float
        Position of its middle along x [m]; for half a silo this is the plane of symmetry.
    floor : float
        Elevation of the bottom that contains it [m].
    half : bool
        True if only one side of the axis is modelled.
    {raises}.
    """

    width: float
    axis: float = 0.0
    floor: float = 0.0
    half: bool = False

    def __post_init__(self) -> None:
        positive("width", self.width)
        finite("axis", self.axis)
        finite("floor", self.floor)
        if not isinstance(self.half, (bool, np.bool_)):
            raise TypeError(f"half = {self.half!r} must be True or False")

    @classmethod
    def of(cls, scene: AnyScene) -> Self:
        """Opening of a scene, from its parameters ``orifice`` and ``half``.

        The bottom is at elevation 0. The axis is the left side of the grid for half a silo and for
        a round one in an axisymmetric grid, and the middle of the grid for a whole one.

        Parameters
        ----------
        scene : Scene or sph.Scene

        Raises
        ------
        ValueError
            If the scene is not 2D or has no parameter ``orifice``.
        """
        grid, half = scene.grid, modelled_share(scene) < 1.0
        if len(grid.shape) != 2:
            raise ValueError(f"scene {scene.name!r} has {len(grid.shape)} dimensions, must have 2")
        if "orifice" not in scene.parameters:
            raise ValueError(
                f"scene {scene.name!r} has no parameter orifice: give opening = Opening(width=...)"
            )
        middle = grid.lower[0] + (0.0 if half or grid.has_axis else grid.cell * grid.shape[0] / 2)
        return cls(float(scene.parameters["orifice"]), float(middle), half=half)

    @property
    def share(self) -> float:
        """Part of the full silo that is modelled, 1 or 1/2."""
        return 0.5 if self.half else 1.0

    def places(self, state: State) -> Array:
        """Positions of the points relative to the middle of the opening [m], shape (n, 2)."""
        return np.asarray(state.x, dtype=float) - (self.axis, self.floor)


def opening_of(state: State, given: Opening | None) -> Opening:
    """Return the given opening, or else the opening of the state's scene.

    Raises
    ------
    TypeError, ValueError
        If `given` is not an `Opening`, or the scene is not 2D or has no parameter ``orifice``.
    """
    if given is None:
        return Opening.of(state.scene)
    if not isinstance(given, Opening):
        raise TypeError(f"opening = {given!r} must be an Opening, not {type(given).__name__}")
    if len(state.scene.grid.shape) != 2:
        raise ValueError(f"state has {len(state.scene.grid.shape)} dimensions, must have 2")
    return given


def each_state(states: States) -> Iterator[State]:
    """Iterate over the states of an iterable, or over a single state.

    There must be at least one state, and all must lie on the same grid.

    Raises
    ------
    TypeError
        If `states` is neither a state nor an iterable.
    ValueError
        If there is no state, or the states do not lie on the same grid.
    """
    if not hasattr(states, "mass") and not isinstance(states, Iterable):
        raise TypeError(f"states = {states!r} must be a State or an iterable of them")
    first = None
    several = cast(Iterable[State], (states,) if hasattr(states, "mass") else states)
    for state in several:
        grid = state.scene.grid
        place = (tuple(grid.lower), grid.cell, tuple(grid.shape), tuple(grid.periodic))
        first = place if first is None else first
        if place != first:
            raise ValueError(f"states lie on different grids: {first} and {place}")
        yield state
    if first is None:
        raise ValueError("states has 0 frames, at least 1 is needed")

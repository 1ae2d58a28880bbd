"""A scene in other cells, with softer grains, and with other points."""

from __future__ import annotations

import inspect
from collections.abc import Callable, Sequence
from fractions import Fraction
from typing import Any

from granular.economy.bias import held_decay
from granular.economy.suggestion import changed, rebuilt, scene_function
from granular.mpm.scene import Scene
from granular.tools.checks import positive

JITTER = 0.1
"""Least jitter of the points of further seeds, over their spacing: without any, seeds are alike."""

SAME = 1e-9
"""Relative difference of two sizes of cells that are the same."""

NEAR_HALF = tuple(map(Fraction, ("3/2", "8/5", "5/3", "4/3", "7/5", "5/4", "7/4", "6/5")))
NEAR_TWO = tuple(map(Fraction, ("2", "9/4", "5/2", "7/4")))
FINER = tuple(map(Fraction, ("2/3", "5/8", "3/5", "3/4", "4/5", "1/2")))
"""Ratios of cells, the first that fits is taken: the lengths of a scene are often whole cells."""


class Variants:
    """Variants of a scene: a ready one, or what a function of a user makes.

    Parameters
    ----------
    scene : Scene or callable
        See `answer`.
    """

    def __init__(self, scene: Scene | Callable[..., Scene]) -> None:
        if isinstance(scene, Scene):
            if scene_function(scene) is None:
                raise ValueError(
                    f"scene {scene.name!r} was made or changed by hand, so that it is not known in "
                    "other cells: give a function that makes it, with the keywords cell and seed"
                )
            self._make: Callable[..., Scene] = _rebuilding(scene)
        elif callable(scene):
            if not {"cell", "seed"} <= inspect.signature(scene).parameters.keys():
                raise ValueError(f"scene = {scene!r} must have the keywords cell and seed")
            self._make = scene
            scene = scene()
            if not isinstance(scene, Scene):
                raise TypeError(f"scene() = {scene!r} must be a Scene")
        else:
            raise TypeError(f"scene = {scene!r} must be a Scene, or a function that makes one")
        self.first = scene

    @property
    def cell(self) -> float:
        """Size of the cells of the scene as it was given [m]."""
        return self.first.grid.cell

    def scene(self, cell: float, softness: float = 1.0, seed: int = 0) -> Scene:
        """The scene in cells of a size [m], with E divided by `softness`.

        Its points are those of the scene as given with the seed 0, else irregular ones.

        Raises
        ------
        ValueError
            If the scene does not fit into such cells.
        """
        given: dict[str, Any] = {"cell": cell}
        if seed:
            given["seed"] = self.first.seed + seed
        made = self._make(**given)
        if abs(made.grid.cell / cell - 1.0) > SAME:
            raise TypeError(
                f"scene(cell={cell:g}) has cells of {made.grid.cell:g} m, must have those asked for"
            )
        if softness == 1.0:
            return made
        E = made.material.E / softness
        return changed(made, {"E": E} | held_decay(made, E))

    def coarser(self, cell: float) -> tuple[float, float]:
        """Two larger sizes of cells in which the scene fits [m].

        Raises
        ------
        ValueError
            If there are none.
        """
        middle = self._fitting(cell, NEAR_HALF)
        wide = [ratio for ratio in NEAR_TWO if ratio * cell > 1.1 * middle]
        return middle, self._fitting(cell, wide)

    def finer(self, cell: float) -> float:
        """The next smaller size of cells in which the scene fits [m]."""
        return self._fitting(cell, FINER)

    def _fitting(self, cell: float, ratios: Sequence[Fraction]) -> float:
        reason: Exception | None = None
        for ratio in ratios:
            try:
                self.scene(float(ratio * Fraction(cell).limit_denominator(10**9)))
            except ValueError as error:
                reason = reason or error
            else:
                return float(ratio * Fraction(cell).limit_denominator(10**9))
        raise ValueError(
            f"cell = {cell:g} must be one of which {', '.join(map(str, ratios))} times fits the "
            f"scene as well, at least one of them: {reason}"
        ) from reason


def _rebuilding(scene: Scene) -> Callable[..., Scene]:
    """Function that makes a ready scene with another cell and seed."""

    def make(cell: float, seed: int | None = None) -> Scene:
        given: dict[str, Any] = {"cell": positive("cell", cell)}
        if seed is not None:
            given["seed"] = seed
            if "jitter" in scene.parameters:
                given["jitter"] = max(float(scene.parameters["jitter"]), JITTER)
        return rebuilt(scene, **given)

    return make

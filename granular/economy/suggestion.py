"""A piece of suggestion, a list of them, and the scene that they lead to."""

from __future__ import annotations

import inspect
import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, fields
from types import MappingProxyType
from typing import Any, overload

from granular.economy.cost import cost
from granular.economy.symmetry import mirror_half
from granular.mpm.scene import Scene
from granular.notebook import table
from granular.scenes import registry

__all__ = ["Suggestion", "Suggestions", "apply", "rebuilt", "scene_function"]


@dataclass(frozen=True, kw_only=True)
class Suggestion:
    """What one part of a scene could be, and what that would cost in accuracy.

    Attributes
    ----------
    topic : str
        "dimension", "basis", "resolution", "time step", "stiffness", "rate", "grains" or "fields".
    reason : str
        In words: what is advised or refused, and why.
    error : float
        Expected change of the quantity of interest, relative; nan where nothing is known.
    saving : float
        The factor by which it lowers the cost, 1 if it does not.
    changes : mapping
        What `apply` changes, by name; empty where the scene should stay as it is.
    scene : Scene
        The one it was given for.
    """

    topic: str
    reason: str
    error: float = 0.0
    saving: float = 1.0
    changes: Mapping[str, Any] = field(default_factory=dict)
    scene: Scene = field(repr=False)

    def __post_init__(self) -> None:
        object.__setattr__(self, "changes", MappingProxyType(dict(self.changes)))

    def __str__(self) -> str:
        known = "error not known" if math.isnan(self.error) else f"error {self.error:.2g}"
        what = ", ".join(
            f"{name} = {value:.4g}" if isinstance(value, float) else f"{name} = {value}"
            for name, value in self.changes.items()
        )
        head = f"{what}: {known}, {self.saving:.3g} times cheaper" if what else "as it is"
        return f"{self.topic}: {head}. {self.reason}"


class Suggestions(Sequence[Suggestion]):
    """Pieces of suggestion, in the order in which they were considered; prints as a table."""

    def __init__(self, items: Iterable[Suggestion]) -> None:
        self._items = tuple(items)

    @overload
    def __getitem__(self, index: int) -> Suggestion: ...
    @overload
    def __getitem__(self, index: slice) -> Suggestions: ...
    def __getitem__(self, index: int | slice) -> Suggestion | Suggestions:
        if isinstance(index, slice):
            return Suggestions(self._items[index])
        return self._items[index]

    def __len__(self) -> int:
        return len(self._items)

    def about(self, topic: str) -> Suggestion:
        """The piece on a topic.

        Raises
        ------
        KeyError
            If there is none.
        """
        for item in self._items:
            if item.topic == topic:
                return item
        raise KeyError(topic)

    @property
    def error(self) -> float:
        """Sum of the expected errors of what would be changed."""
        return math.fsum(item.error for item in self._items if item.changes)

    @property
    def saving(self) -> float:
        """The factor by which all of it together lowers the cost."""
        return math.prod(item.saving for item in self._items)

    def __str__(self) -> str:
        total = f"together: error {self.error:.2g}, {self.saving:.3g} times cheaper"
        return "\n".join([*map(str, self._items), total])

    def __repr__(self) -> str:
        return f"Suggestions({list(self._items)!r})"

    def _repr_html_(self) -> str:
        return table(
            "Suggestion", {item.topic: str(item).partition(": ")[2] for item in self._items}
        )


def scene_function(scene: Scene) -> Callable[..., Scene] | None:
    """The function that made a ready scene; None for one made by hand, or changed by hand since.

    Another material, scheme, duration or seed is no change: functions take them as arguments.
    """
    names = [n for n in registry if scene.name == n or scene.name.startswith(f"{n}_")]
    if not names:
        return None
    function = registry[max(names, key=len)]
    try:
        made = function(**_arguments(scene, function))
    except (TypeError, ValueError):
        return None  # only the name is that of a ready scene
    return function if made == scene else None


def _arguments(scene: Scene, function: Callable[..., Scene]) -> dict[str, Any]:
    """What a scene function was called with."""
    known = inspect.signature(function).parameters
    called = {name: value for name, value in scene.parameters.items() if name in known}
    return called | {
        "material": scene.material,
        "scheme": scene.scheme,
        "seed": scene.seed,
        "duration": scene.duration,
    }


def rebuilt(scene: Scene, **changes: Any) -> Scene:
    """The scene made anew by its function, with other arguments.

    Raises
    ------
    ValueError
        If no scene function made it, or it was changed since.
    """
    function = scene_function(scene)
    if function is None:
        raise ValueError(
            f"scene {scene.name!r} must be as one of {tuple(registry)} made it, not by hand"
        )
    return function(**(_arguments(scene, function) | changes))


def apply(scene: Scene, suggestion: Suggestion | Iterable[Suggestion]) -> Scene:
    """The cheaper scene that suggestions lead to; the one given is left as it is.

    Parameters
    ----------
    scene : Scene
    suggestion : Suggestion or iterable of Suggestion
        All of what `suggest` said, or the pieces that are wanted.

    Raises
    ------
    ValueError
        If a piece was given for another scene.
    TypeError
        If it is no suggestion.
    """
    changes: dict[str, Any] = {}
    for item in (suggestion,) if isinstance(suggestion, Suggestion) else suggestion:
        if not isinstance(item, Suggestion):
            raise TypeError(f"suggestion: {item!r} must be an Suggestion")
        if item.scene != scene:
            raise ValueError(
                f"the suggestion on {item.topic} was given for another scene: ask anew"
            )
        changes |= item.changes
    return changed(scene, changes)


def changed(scene: Scene, changes: Mapping[str, Any]) -> Scene:
    """A scene with the changes that suggestions name."""
    rest = dict(changes)
    if rest.pop("half", False):
        scene = mirror_half(scene)
    material, scheme = scene.material, scene.scheme
    if "E" in rest:
        material = material.replace(E=rest.pop("E"))
    own = {f.name for f in fields(scheme)}
    scheme = scheme.replace(**{name: rest.pop(name) for name in tuple(rest) if name in own})
    if rest:
        scene = rebuilt(scene, **rest)
    return scene.replace(material=material, scheme=scheme)


def saving(scene: Scene, changes: Mapping[str, Any]) -> float:
    """The factor by which changes lower the cost of a scene."""
    return cost(scene).seconds / cost(changed(scene, changes)).seconds

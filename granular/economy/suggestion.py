"""A suggestion, a list of suggestions, and the scene that they lead to."""

from __future__ import annotations

import inspect
import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, fields, replace
from types import MappingProxyType
from typing import Any, overload

from granular.economy.symmetry import mirror_half
from granular.mpm.scene import Scene
from granular.scenes import names, registry
from granular.tools.notebook import table


@dataclass(frozen=True, kw_only=True)
class Suggestion:
    """A suggestion on one aspect of a scene, with its expected error.

    Attributes
    ----------
    topic : str
        "dimension", "basis", "resolution", "time step", "stiffness", "rate", "grains" or "fields".
    reason : str
        Explanation why a change is suggested or not.
    error : float
        Expected relative change of the quantity of interest; nan where it is unknown.
    saving : float
        Factor by which the changes lower the cost, 1 if there are none.
    changes : mapping
        Changes that `apply` makes, by name; empty if the scene should stay as it is.
    scene : Scene
        Scene for which the suggestion was made.
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
    """Suggestions in the order in which they were considered; they print as a table."""

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
        """The suggestion on a topic, see `Suggestion.topic`.

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
        """Sum of the expected errors of all suggested changes."""
        return math.fsum(item.error for item in self._items if item.changes)

    @property
    def saving(self) -> float:
        """Factor by which all suggestions together lower the cost."""
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


def scene_function(scene: Scene) -> Callable[..., Any] | None:
    """Function that made a ready-made scene; None for a scene made or changed by hand.

    A scene with another material, scheme, duration or seed does not count as changed, because the
    functions take these as arguments.
    """
    alike = [n for n in names("mpm") if scene.name == n or scene.name.startswith(f"{n}_")]
    if not alike or "given" in scene.parameters.values():
        return None  # "given" stands for an array or a map, which the parameters do not hold
    function = registry[max(alike, key=len)]
    try:
        made = function(**_arguments(scene, function))
    except (TypeError, ValueError, OSError):
        return None  # only the name is that of a ready-made scene, or its terrain file is gone
    return function if made == scene else None


def _arguments(scene: Scene, function: Callable[..., object]) -> dict[str, Any]:
    """Arguments with which a scene function was called."""
    known = inspect.signature(function).parameters
    called = {name: value for name, value in scene.parameters.items() if name in known}
    return called | {
        "material": scene.material,
        "scheme": scene.scheme,
        "seed": scene.seed,
        "duration": scene.duration,
    }


def rebuilt(scene: Scene, **changes: Any) -> Scene:
    """Make the scene anew by its function, with some other arguments.

    Raises
    ------
    ValueError
        If the scene was not made by a scene function, or was changed since.
    """
    function = scene_function(scene)
    if function is None:
        raise ValueError(
            f"scene {scene.name!r} must be as one of {names('mpm')} made it, not by hand"
        )
    made: Scene = function(**(_arguments(scene, function) | changes))
    return made


def apply(scene: Scene, suggestion: Suggestion | Iterable[Suggestion]) -> Scene:
    """Make the cheaper scene of some suggestions; the given scene is not changed.

    Parameters
    ----------
    suggestion : Suggestion or iterable of Suggestion
        All suggestions of `suggest`, or some of them.

    Raises
    ------
    ValueError
        If a suggestion was made for another scene.
    TypeError
        If an item is not a `Suggestion`.
    """
    changes: dict[str, Any] = {}
    for item in (suggestion,) if isinstance(suggestion, Suggestion) else suggestion:
        if not isinstance(item, Suggestion):
            raise TypeError(f"suggestion: {item!r} must be a Suggestion")
        if item.scene != scene:
            raise ValueError(
                f"the suggestion on {item.topic} was given for another scene: ask anew"
            )
        changes |= item.changes
    return changed(scene, changes)


def changed(scene: Scene, changes: Mapping[str, Any]) -> Scene:
    """Copy of a scene with some changes, by name."""
    rest = dict(changes)
    if rest.pop("half", False):
        scene = mirror_half(scene)
    material, scheme = scene.material, scene.scheme
    if "E" in rest:
        ratio = rest["E"] / material.E
        material = material.replace(E=rest.pop("E"))
        scene = scene.replace(
            fills=[
                replace(fill, material=part and part.replace(E=ratio * part.E))
                for fill in scene.fills
                for part in (fill.material,)
            ],
            inflows=[
                replace(inflow, material=part and part.replace(E=ratio * part.E))
                for inflow in scene.inflows
                for part in (inflow.material,)
            ],
        )
    names = {f.name for f in fields(scheme)}
    scheme = scheme.replace(**{name: rest.pop(name) for name in tuple(rest) if name in names})
    if rest:
        scene = rebuilt(scene, **rest)
    return scene.replace(material=material, scheme=scheme)

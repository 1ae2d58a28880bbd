"""Settings of a run that its record stores, for a run that continues it."""

from __future__ import annotations

import warnings
from collections.abc import Callable, Collection
from pathlib import Path
from typing import TYPE_CHECKING

from granular import _core
from granular.materials.own import difference
from granular.measure.derived import check_derived, derived
from granular.model.state import State
from granular.mpm.scene import Scene as MpmScene
from granular.record.layout import RecordError
from granular.run.running import EVERY
from granular.tools.buffers import default_isa
from granular.tools.checks import integer, one_of, positive

if TYPE_CHECKING:
    from granular.model.typing import AnyScene


DOUBLE = "double"
PRECISIONS = (DOUBLE, "single")
"""Precisions in which frames are stored."""


def _kind(scene: AnyScene) -> dict[str, object]:
    """Parts of a scene that determine the content of its checkpoints."""
    parts: dict[str, object] = {
        "grid": scene.grid,
        "material": type(scene.material).__name__,
        "walls": len(scene.walls),
        "inflows": scene.inflows,  # the material that has entered follows from their rates
    }
    if isinstance(scene, MpmScene):
        parts |= {
            "material.elasticity": scene.material.elasticity,
            "materials": len(scene.materials),
            "scheme.basis": scene.scheme.basis,
            "scheme.transfer": scene.scheme.transfer,
            "scheme.density": type(scene.scheme.density).__name__,
            "bodies": len(scene.bodies),
        }
        for k, material in enumerate(scene.materials):
            parts[f"materials[{k}]"] = type(material).__name__
            parts[f"materials[{k}].source"] = getattr(material, "source", None)
            parts[f"materials[{k}].history"] = (*getattr(material, "history", ()),)  # in its order
        for i, body in enumerate(scene.bodies):
            names = ("shape", "position", "rotation_deg")
            parts |= {f"bodies[{i}].{name}": getattr(body, name) for name in names}
    return parts


def check_alike(before: AnyScene, scene: AnyScene) -> None:
    """Refuse a scene into which the points of another one do not fit."""
    if type(scene) is not type(before):
        raise TypeError(f"scene = {scene!r} must be a scene of the method {before.method!r}")
    now = _kind(scene)
    for name, part in _kind(before).items():
        if now[name] == part:
            continue
        if name.endswith(".source"):
            differences = difference(str(part), str(now[name]))
            raise ValueError(
                f"scene: {name} must be that of the record (-), it differs in{differences}"
            )
        raise ValueError(f"scene: {name} = {now[name]} must be {part}, as in the record")


def settings_of(path: Path, provenance: object) -> tuple[float, str | None, tuple[str, ...], str]:
    """Time between frames [s], instruction set, derived fields and precision of a record."""
    if not isinstance(provenance, dict):
        raise RecordError(f"{path}: damaged record: its provenance must be an object of JSON")
    isa = provenance.get("isa")
    try:
        every = positive("every", provenance.get("every", EVERY))
        if isa is not None and not isinstance(isa, str):
            raise TypeError(f"isa = {isa!r} must be a string")
        fields = check_derived("fields", provenance.get("fields", ()))
        precision = one_of("precision", provenance.get("precision", DOUBLE), PRECISIONS)
    except (TypeError, ValueError) as error:
        raise RecordError(f"{path}: damaged record: {error}") from None
    return every, isa, fields, precision


def fields_to_store(
    given: object, before: tuple[str, ...], *, goes_on: bool, state: Callable[[], State]
) -> tuple[str, ...]:
    """Derived fields of the frames of a run: those `given`, or those of the run before it.

    Raises
    ------
    TypeError, ValueError
        If they are not names of `granular.measure.derived.DERIVED`, the scene lacks a number that
        one needs, or the run goes on with a record that has others.
    """
    if given is None:
        return before
    names = check_derived("fields", given)
    if goes_on and names != before:
        raise ValueError(f"fields = {names} must be None or those of the record, {before}")
    if names:
        first = state()
        for name in names:
            try:
                derived(first, name)
            except ValueError as error:
                raise ValueError(
                    f"fields: {name!r} needs more than the scene has: {error}"
                ) from None
    return names


def precision_to_store(given: str | None, before: str, *, goes_on: bool) -> str:
    """Precision of the frames of a run: that `given`, or that of the run before it.

    Raises
    ------
    TypeError, ValueError
        If there is no such precision, or the run goes on with a record that has another one.
    """
    if given is None:
        return before
    precision = one_of("precision", given, PRECISIONS)
    if goes_on and precision != before:
        raise ValueError(f"precision = {given!r} must be None or that of the record, {before!r}")
    return precision


def frames_to_a_checkpoint(checkpoints: object) -> int:
    """Frames from one stored checkpoint to the next; 0 for none."""
    if checkpoints is None:
        return 0
    if isinstance(checkpoints, str):
        one_of("checkpoints", checkpoints, ("all",))
        return 1
    return integer("checkpoints", checkpoints, 1)


def usable_isa(isa: str | None, path: Path, same_bits: Collection[str]) -> str | None:
    """Return the instruction set with which a recorded run goes on to the last bit.

    It is that of the machine if both are among `same_bits`, else the recorded one; or None with a
    warning if the machine lacks that.
    """
    if isa is None:
        return None
    available = _core.build_info(default_isa())["isa"]
    if isa in same_bits and available in same_bits:
        return available
    try:
        return _core.build_info(isa)["isa"]
    except ValueError:
        pass
    warnings.warn(
        f"{path} was made with the instruction set {isa!r}, which this machine does not have: the "
        f"run continues with {available!r}, not to the last bit as if it had never stopped",
        stacklevel=3,
    )
    return None

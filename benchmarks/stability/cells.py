"""Maps and their cells, and functions that lift the limits of the package to look beyond them."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Any
from unittest import mock

import granular as gr
from granular.mpm import limits

STABLE, DEGRADED, REFUSED = "stable", "degraded", "refused"


@dataclass
class Cell:
    """One measured case: its result and the verdict."""

    row: str
    column: str
    value: float
    verdict: str
    seconds: float
    notes: dict[str, float | str] = field(default_factory=dict)


@dataclass
class Map:
    """Cases over two parameters.

    `sound` is the largest value that counts as stable (the smallest one if `least`).
    """

    name: str
    title: str
    quantity: str
    rows: str
    columns: str
    sound: float
    least: bool = False
    cells: list[Cell] = field(default_factory=list)

    def verdict(self, value: float) -> str:
        """Stable or degraded; a run that stopped or has no number is degraded."""
        if math.isnan(value):
            return DEGRADED
        good = value >= self.sound if self.least else value <= self.sound
        return STABLE if good else DEGRADED

    def add(
        self,
        row: str,
        column: str,
        case: Callable[..., float | tuple[float, dict[str, Any]]],
        *arguments: Any,
        refused: bool = False,
    ) -> None:
        """Measure a case; a run that stops with an error has the value nan and a note."""
        begin, notes = time.process_time(), {}
        try:
            value = case(*arguments)
            if isinstance(value, tuple):
                value, notes = value
        except gr.SimulationError as error:
            value, notes = math.nan, {"stopped": str(error)}
        verdict = REFUSED if refused else self.verdict(value)
        seconds = time.process_time() - begin
        self.cells.append(Cell(row, column, float(value), verdict, round(seconds, 2), notes))


def off(reference: float, case: Callable[..., float], *arguments: Any) -> float:
    """Relative difference of the result of a case from a reference."""
    return abs(case(*arguments) / reference - 1)


def refuses(scene: gr.Scene) -> bool:
    """True if the package refuses a scene."""
    try:
        gr.Simulation(scene, threads=1)
    except ValueError:
        return True
    return False


def simulate(scene: gr.Scene) -> gr.Simulation:
    """Simulation with one thread and without the limits of the time step, to show their effect."""
    with mock.patch.object(limits, "courant_limit", lambda scene: math.inf):
        return gr.Simulation(scene, threads=1)


def at_courant(scheme: gr.Scheme, courant: float, cell: float, material: Any) -> gr.Scheme:
    """A scheme with the fixed time step courant dx/c."""
    return scheme.replace(dt=courant * cell / material.wave_speed)


SCHEMES = {
    "published (linear, flip)": gr.Scheme(basis="linear"),
    "uGIMP, flip": gr.Scheme(basis="ugimp"),
    "quadratic, flip": gr.Scheme(basis="quadratic", transfer="flip"),
    "quadratic, apic": gr.Scheme(basis="quadratic", transfer="apic"),
    "default": gr.schemes.default,
    "cell_averaged": gr.schemes.cell_averaged,
}
"""The schemes of most maps."""


def chosen(values: Sequence[Any], quick: bool, few: int = 2) -> Sequence[Any]:
    """All values, or only the first and last ones if `quick`."""
    return values if not quick or len(values) <= few else (values[0], values[-1])

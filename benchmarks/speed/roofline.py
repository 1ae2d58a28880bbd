"""Limits of the kernels: their bytes and operations against the capability of the machine.

Measures on one core: the bandwidth of a sum into a third array, in the cache and in memory, and the
rate of a loop of multiply-adds. Also prints the time of a particle-step of the plain linear scheme
if it were bound by either alone, and its measured time.
"""

from __future__ import annotations

from typing import Any

from shared import markdown, parser_of, write

import granular as gr
from speed.machine import capability
from speed.speed import MATERIAL, best_time

COMPONENTS = 9
"""Numbers read and written per point: x, v, four stresses, log-density; the mass is only read."""
OPERATIONS = {"gather": 45, "law": 75, "scatter": 80}
"""Additions and multiplications per point in 2D with linear shape functions, counted by hand; the
law also has three square roots and a division."""
POINTS_PER_CELL, NODE_SUMS = 16, 4 * 5


def measured(cell: float) -> tuple[int, float]:
    """Number of points of a column, and time per particle-step of the plain linear scheme [s]."""
    scheme = gr.Scheme(basis="linear")
    scene = gr.scenes.column_collapse(aspect=2.0, cell=cell, material=MATERIAL, scheme=scheme)
    sim = gr.Simulation(scene, threads=1)
    sim.step(5)
    return sim.n_points, best_time(sim, 1, 12)


BOUNDS = {
    "multiply-adds": ("multiply-adds [Gflop/s]", "bound by operations [ns]"),
    "second-level cache (c = a + b)": ("second-level cache [GB/s]", "bound by the cache [ns]"),
    "memory": ("memory [GB/s]", "bound by the memory [ns]"),
}
"""Names of a rate of the machine, with its unit, and of the time of a particle-step at it."""


def tables(results: dict[str, Any]) -> dict[str, list[str]]:
    """Table of the page: the capability of the machine, and the time of a particle-step."""
    lines = [
        (name, f"{results[rate]:.0f} {rate[rate.index('[') + 1 : -1]}", f"{results[bound]:.1f} ns")
        for name, (rate, bound) in BOUNDS.items()
    ]
    lines += [
        (f"measured, {int(name.split()[1]):,} points", "", f"{ns:.1f} ns")
        for name, ns in results.items()
        if name.startswith("measured")
    ]
    return {"roofline": markdown(("", "the machine", "a particle-step alone"), lines)}


def main(argv: list[str] | None = None) -> None:
    arguments = parser_of(__name__, __doc__).parse_args(argv)
    cells = (0.025,) if arguments.quick else (0.0125, 0.0025)
    bytes_moved = 8 * (2 * COMPONENTS + 1 + 2 * NODE_SUMS / POINTS_PER_CELL)
    operations = sum(OPERATIONS.values())
    rates = capability(arguments.quick)
    results: dict[str, float] = {
        "bytes a particle-step": bytes_moved,
        "operations a particle-step": operations,
        **rates,
    }
    amounts = (operations, bytes_moved, bytes_moved)
    for (rate, bound), amount in zip(BOUNDS.values(), amounts, strict=True):
        results[bound] = amount / rates[rate]  # 1e9 a second is one a nanosecond
    for cell in cells:
        points, seconds = measured(cell)
        results[f"measured, {points} points [ns]"] = seconds * 1e9
    for name, value in results.items():
        print(f"{name:34s}{value:8.1f}")
    write(arguments.out, results)

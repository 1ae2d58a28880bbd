"""Would it pay to split points in cells that have few, and to merge them in cells that have many?

Points are split here between steps, by way of checkpoints, so that the core has no part in it. In a
cell whose neighbours all hold points, and that holds fewer than `least`, the heaviest connected
point becomes two halves, a quarter of its width to both sides along the axis with the larger gap.
Mass, momentum and angular momentum stay the same. What merging could save is counted: the points
beyond 2.5 times the seeded number of a cell.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from shared import markdown, parser_of, stored, write

import granular as gr

EVERY = 100
"""Steps between two splittings."""
SEEDS = (1, 2, 3)
VARIANTS = ((4, 0), (4, 2), (4, 4), (9, 0), (16, 0))
"""Points per cell as seeded, and least number in a cell; 0: no splitting."""
MANY = 2.5

History = list[tuple[float, gr.State]]


@dataclass(frozen=True)
class Case:
    """A scene by its points per cell and its seed, and a number from its states."""

    scene: Callable[..., gr.Scene]
    measure: Callable[[History], float]
    until: float


def rate(history: History) -> float:
    """Slope of the mass above the opening over the second half of a run."""
    late = [(t, s.mass[s.x[:, 1] > 0.0].sum()) for t, s in history if t > 0.4 * history[-1][0]]
    times, mass = np.array(late).T
    return -float(np.polyfit(times, mass, 1)[0])


def distance(history: History) -> float:
    """Mean distance of the mass from the axis, or plane of symmetry, at the end."""
    last = history[-1][1]
    return float(np.average(last.x[:, 0], weights=last.mass))


def cases() -> dict[str, Case]:
    """The cases, by their names."""
    S = gr.scenes
    soft = {"E": 1e6, "jitter": 0.1}

    def hopper(**numbers: Any) -> gr.Scene:
        return S.hopper(
            axisymmetric=True, cell=0.0125, width=0.48, fill_height=0.4875, orifice=0.15,
            angle_deg=45.0, opens_at=0.0, **soft, **numbers,
        )  # fmt: skip

    def orifice(**numbers: Any) -> gr.Scene:
        return S.silo(
            axisymmetric=True, cell=0.0125, width=0.3, height=0.4, orifice=0.1, opens_at=0.0,
            **soft, **numbers,
        )  # fmt: skip

    def slot(**numbers: Any) -> gr.Scene:
        return S.silo(
            cell=0.0125, width=0.5, height=0.5, orifice=0.1, opens_at=0.0, **soft, **numbers
        )

    def column(**numbers: Any) -> gr.Scene:
        return S.column_collapse(aspect=2.0, cell=0.02, **soft, **numbers)

    def cylinder(**numbers: Any) -> gr.Scene:
        return S.cylinder_collapse(aspect=1.0, axisymmetric=True, cell=0.0125, **soft, **numbers)

    return {
        "conical hopper, rate": Case(hopper, rate, 0.5),
        "orifice of 8 cells in a round silo, rate": Case(orifice, rate, 1.1),
        "slot of 8 cells, rate": Case(slot, rate, 1.1),
        "column, aspect 2, mean distance": Case(column, distance, 1.2),
        "cylinder, aspect 1, mean radius": Case(cylinder, distance, 1.2),
    }


def cells_of(state: gr.State) -> tuple[np.ndarray, tuple[int, ...]]:
    """Cell of each point, and the shape of the grid."""
    grid = state.scene.grid
    at = np.floor((state.x - grid.lower) / grid.cell).astype(int)
    return np.ravel_multi_index(tuple(at.T), grid.shape, mode="clip"), grid.shape


def surplus(state: gr.State, seeded: int) -> float:
    """Share of the points that are beyond `MANY` times the seeded number of their cell."""
    cell, shape = cells_of(state)
    count = np.bincount(cell, minlength=math.prod(shape))
    return float(np.maximum(count - MANY * seeded, 0.0).sum() / len(cell))


def inner_cells(cell: np.ndarray, shape: tuple[int, ...], least: int) -> np.ndarray:
    """Cells with some points, but fewer than `least`, whose neighbours all have points."""
    count = np.bincount(cell, minlength=math.prod(shape)).reshape(shape)
    full = np.pad(count > 0, 1, mode="edge")
    around = [full[i : i + shape[0], k : k + shape[1]] for i in range(3) for k in range(3)]
    return np.flatnonzero((count < least) & np.logical_and.reduce(around))


def gaps(x: np.ndarray, p: int, width: float, cell: float) -> list[float]:
    """Distance from a point to the next one along each axis, within its width across it."""
    apart = np.abs(x - x[p])
    apart[p] = np.inf
    across = apart[:, ::-1] < width
    return [float(min(apart[across[:, k], k], default=2.0 * cell)) for k in range(2)]


def split(sim: gr.Simulation, least: int) -> tuple[gr.Simulation, int]:
    """Simulation with points split, and their number."""
    state = sim.state
    grid, (cell, shape) = state.scene.grid, cells_of(state)
    section = np.asarray(state.section if grid.axisymmetric else state.volume)
    chosen, moves = [], []
    above = state.x[:, 1] > grid.lower[1] + 2 * grid.cell  # not in the stream that leaves
    connected = state.density > 0.98 * state.scene.material.rho_c
    for index in inner_cells(cell, shape, least):
        here = np.flatnonzero((cell == index) & above & connected)
        if not len(here):
            continue
        p = here[np.argmax(section[here])]
        width = math.sqrt(section[p])
        if section[p] > grid.cell**2 / (2 * least):
            along = int(np.argmax(gaps(state.x, p, width / 2, grid.cell)))
            chosen.append(p)
            within = 0.5 * (state.x[p, along] - grid.lower[along])  # not across the axis
            moves.append(np.eye(2)[along] * min(width / 4, within))
    if not chosen:
        return sim, 0
    return halved(sim, np.array(chosen), np.array(moves).T), len(chosen)


def halved(sim: gr.Simulation, chosen: np.ndarray, moves: np.ndarray) -> gr.Simulation:
    """Simulation in which some points are two halves, displaced to both sides."""
    start = sim.checkpoint()
    chosen = np.argsort(start.arrays["id"])[chosen]  # states are in the order of ids
    number = len(start.arrays["id"])
    arrays = {
        name: np.concatenate([array, array[..., chosen]], axis=-1)
        if array.shape[-1] == number
        else array
        for name, array in start.arrays.items()
    }
    for part, sign in ((chosen, -1.0), (slice(number, None), 1.0)):
        arrays["x"][:, part] += sign * moves
        arrays["mass"][..., part] *= 0.5
    arrays["id"][number:] = arrays["id"].max() + 1 + np.arange(len(chosen))
    scalars = {**start.scalars, "n_points": number + len(chosen)}
    return gr.Simulation.from_checkpoint(
        sim.scene, replace(start, arrays=arrays, scalars=scalars), threads=1
    )


def run(case: Case, per_cell: int, least: int, seed: int) -> dict[str, float]:
    """Result of a run, its steps' time, and the numbers of points that were split or are many."""
    scene = case.scene(points_per_cell=per_cell, seed=seed, duration=case.until)
    sim, history, splits, spent = gr.Simulation(scene, threads=1), [], 0, 0.0
    while sim.time < case.until:
        begin = time.process_time()
        sim.step(EVERY)
        spent += time.process_time() - begin
        if least:
            sim, new = split(sim, least)
            splits += new
        history.append((sim.time, sim.state))
    return {
        "value": case.measure(history),
        "splits": splits,
        "surplus": float(np.mean([surplus(state, per_cell) for _, state in history])),
        "seconds": spent,
    }


def tables(results: dict[str, Any]) -> dict[str, list[str]]:
    """Table of the page."""
    lines = []
    for name, variants in results["rows"].items():
        for variant, runs in variants.items():
            value, splits, many, seconds = (
                np.array([r[key] for r in runs])
                for key in ("value", "splits", "surplus", "seconds")
            )
            lines.append([
                name, variant, f"{value.mean():.4g} ± {value.std(ddof=1):.1g}",
                f"{splits.mean():.0f}", f"{100 * many.mean():.2f}", f"{seconds.mean():.2g}",
            ])  # fmt: skip
    head = ("number", "points per cell", "mean and scatter of three seeds", "points split")
    head = (*head, "points that could merge [%]", "time of the steps [s]")
    return {"points": markdown(head, lines)}


def main(argv: list[str] | None = None) -> None:
    """Run the cases that the results lack."""
    chosen = parser_of(__name__, __doc__, "one seed of the round orifice").parse_args(argv)
    rows = stored(chosen.out, rows={})["rows"]
    for name, case in cases().items():
        if chosen.quick and "orifice" not in name:
            continue
        for per_cell, least in VARIANTS[1:2] if chosen.quick else VARIANTS:
            variant = f"{per_cell}" + (f", at least {least}" if least else "")
            if variant in rows.setdefault(name, {}):
                continue
            seeds = SEEDS[:2] if chosen.quick else SEEDS
            rows[name][variant] = [run(case, per_cell, least, seed) for seed in seeds]
            write(chosen.out, {"rows": rows})
    print("\n".join(tables({"rows": rows})["points"]))


if __name__ == "__main__":
    main()

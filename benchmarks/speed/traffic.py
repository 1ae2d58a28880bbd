"""Bytes that a step moves, array by array and stage by stage, and its time.

Which numbers of a point a stage reads and writes is found out, not listed by hand: each field is
changed a little before the stage, and is read by it if a result changes; it is written if its own
values change. This is repeated in each step of a cycle of averages. Spare slots count, as kernels
move whole rows of eight. The sums, nodes and mesh are counted by their sizes.

The number of bytes over the bandwidth of the memory, which is measured in the same run, is a bound
of the time of states that do not fit the caches.
"""

from __future__ import annotations

import time
from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np
from shared import markdown, parser_of, write

import granular as gr
from speed.machine import bandwidth
from speed.speed import FLOWS, best_time, scene_of, started
from speed.speed import SCHEMES as ALL

NAMES = ("linear flip", "quadratic apic", "cell averaged", "default", "default, single precision")
SCHEMES = {name: ALL[name] for name in NAMES}
CYCLE = 8
"""Steps that are looked at: twice the interval of the averages."""
LANES = 8
CELL, ADDEND, INDEX = 48, 40, 4
"""Bytes of a cell, of what a run adds to a row of nodes, and of the index of a node
(csrc/mpm/engine.h)."""
STAGES = ("p2g", "g2p")


def slots_of(buffers: Mapping[str, np.ndarray]) -> np.ndarray:
    """Slots of the points in the order of their numbers, which stay when points change slots."""
    used = np.flatnonzero(buffers["id"] >= 0)
    return used[np.argsort(buffers["id"][used])]


def numbers_of(buffers: Mapping[str, np.ndarray], at: np.ndarray) -> dict[str, np.ndarray]:
    """Fields in the slots `at`."""
    return {name: values[..., at].copy() for name, values in buffers.items()}


def differ(a: dict[str, np.ndarray], b: dict[str, np.ndarray]) -> set[str]:
    """Fields that are not the same."""
    return {name for name in a if a[name].tobytes() != b[name].tobytes()}


def disturb(name: str, values: np.ndarray, at: np.ndarray, cell: float) -> None:
    """Change a field in the slots `at` by less than a step would."""
    if name == "id":
        values[at] += 1000
    elif name == "x":
        values[:, at] += 1e-9 * cell
    else:
        values[:, at] = values[:, at] * (1 + 1e-3) + 1e-6 * (abs(values).max() or 1.0)


def after_step(
    scene: gr.Scene, start: gr.Checkpoint, disturbed: str = "", stage: str = ""
) -> tuple:
    """Fields of the points before the last stage of a step and after it, and before the step.

    A field is disturbed for one stage alone.
    """
    sim = gr.Simulation.from_checkpoint(scene, start, threads=1)
    buffers = sim.buffers
    at = slots_of(buffers)
    before = numbers_of(buffers, at)
    if stage == "p2g":
        disturb(disturbed, buffers[disturbed], at, scene.grid.cell)
    sim._engine.grid()  # after P2G
    for name, values in before.items():
        buffers[name][..., at] = values
    if stage == "g2p":
        disturb(disturbed, buffers[disturbed], at, scene.grid.cell)
    ready = numbers_of(buffers, at)
    sim._engine.g2p()
    return ready, numbers_of(buffers, slots_of(buffers)), before


def touched(scene: gr.Scene, start: gr.Checkpoint) -> dict[str, dict[str, set[str]]]:
    """Fields that the stages of the next step read and write: stage: {"read", "write"}.

    A field whose disturbance is there after a stage as it was before was neither read nor written,
    unless another field shows it.
    """
    _, after, before = after_step(scene, start)
    found: dict[str, dict[str, set[str]]] = {s: {"read": set(), "write": set()} for s in STAGES}
    found["g2p"]["write"] = differ(before, after)
    for name in before:
        if differ(after_step(scene, start, name, "p2g")[1], after):
            found["p2g"]["read"].add(name)
        ready, other, _ = after_step(scene, start, name, "g2p")
        updated = name in differ(other, after) and name in differ(other, ready)
        if updated or differ(other, after) - {name}:
            found["g2p"]["read"].add(name)
    return found


def cycle(scene: gr.Scene, start: gr.Checkpoint) -> Iterator[dict[str, dict[str, set[str]]]]:
    """Fields that the stages read and write in the steps of a cycle."""
    sim = gr.Simulation.from_checkpoint(scene, start, threads=1)
    for _ in range(CYCLE):
        yield touched(scene, sim.checkpoint())
        sim.step()


def rows_of_points(sim: gr.Simulation) -> float:
    """Slots that kernels move for each point: the rows of tiles, spare slots included."""
    count = sim._engine.cells()[1]
    tiles = np.pad(count, (0, -len(count) % LANES)).reshape(-1, LANES)
    return float(LANES * tiles.max(axis=1).sum() / count.sum())


def bytes_of_points(sim: gr.Simulation, steps: list[dict]) -> list[dict[str, Any]]:
    """Bytes of each field that each stage moves, per point and step, as a mean over the steps."""
    rows, slots = [], rows_of_points(sim)
    for name, values in sim.buffers.items():
        size = slots * values.itemsize * (values.size // sim.buffers["id"].size)
        row: dict[str, Any] = {"array": name}
        for stage in STAGES:
            for way in ("read", "write"):
                share = np.mean([name in step[stage][way] for step in steps])
                row[f"{stage} {way}"] = size * float(share)
        rows.append(row)
    return rows


def bytes_of_grid(sim: gr.Simulation, averaging: float) -> list[dict[str, Any]]:
    """Bytes of the sums, the nodes and the mesh, per point and step.

    A processor reads a line of the sums before it writes to it, unless they are stored past the
    caches. A tile counts as one run of cells: the second tail of those that a row of cells ends in
    is left out. `averaging` is the share of the steps that average the density. The forces of
    averaged cells, which follow when the masses of the nodes are known, count as a part of the grid
    stage.
    """
    scheme, dim, n = sim.scene.scheme, sim.scene.dim, sim.n_points
    averaged = scheme.density.name == "cell_averaged"
    single = scheme.precision == "single"
    local = 2 if scheme.basis == "linear" else 3
    rows = local ** (dim - 1)
    per_tile = len(sim._engine.cells()[1]) / LANES / n
    per_node = len(sim._engine.nodes()["x"]) / n
    per_cell = LANES * per_tile
    sums = per_tile * (4 if single else 8)
    row, tail = LANES * rows, (1 if local == 2 else 4) * rows  # numbers of a sum
    moments, forces = 1 + dim, dim + averaged  # with cell averages also the damping
    motion = (moments + forces) * (row + tail)
    of_cells = (
        LANES * averaged * (local**dim + 2 + (3 if dim == 2 else 6))
    )  # masses, enum gr_cell_sum
    density = averaging * ((3 + dim) * (row + tail) + LANES)  # enum gr_density_sum, and the content
    state = averaged * (6 + 2 * dim) + averaging * 2  # enum gr_average
    seen = 2 * dim + averaged + averaging * (4 + dim)  # GR_NODE_FIELDS
    later = averaged * (forces * (row + tail) + moments * tail)
    return [
        {
            "array": "sums",
            "p2g write": sums * (motion - averaged * forces * row + of_cells + density),
            "grid read": sums * (motion + averaged * (row + moments * tail) + of_cells + density),
            "grid write": sums * later,
        },
        {
            "array": "state of cells",
            "grid write": 8 * state * per_cell,
            "g2p read": 8 * state * per_cell,
        },
        {
            "array": "nodes",
            "grid write": per_node * (seen * (12 if single else 8) + 8 * averaging + 8),
            "g2p read": per_node * seen * (4 if single else 8),
        },
        {"array": "cells", "g2p read": CELL * per_cell, "p2g read": CELL * per_cell},
        {"array": "nodes of cells", "g2p read": INDEX * rows * per_cell},
        {"array": "addends", "grid read": ADDEND * rows * per_tile},
    ]


def from_memory(row: dict[str, Any]) -> float:
    """Bytes of an array that come from the memory or go there in a step.

    P2G of a tile follows G2P of the same points, which are in the cache then.
    """
    again = "p2g read" if row.get("g2p read") or row.get("g2p write") else ""
    return sum(row.get(column, 0.0) for column in COLUMNS if column != again)


COLUMNS = ("g2p read", "g2p write", "p2g read", "p2g write", "grid read", "grid write")


def measured(name: str, points: float, dim: int, fall: float, small: float) -> dict[str, Any]:
    """Bytes and time of a scheme in a state of about so many points.

    What the stages touch is found in a flow of about `small` points, where no number is written
    that was the same before.
    """
    scheme = SCHEMES[name]
    few = scene_of(scheme, small, dim, 2**dim)
    steps = list(cycle(few, started(few, FLOWS)))
    scene = scene_of(scheme, points, dim, 2**dim)
    sim = gr.Simulation.from_checkpoint(scene, started(scene, fall), threads=1)
    sim.step(3)
    averaging = float(np.mean(["density_gradient" in step["g2p"]["write"] for step in steps]))
    arrays = bytes_of_points(sim, steps) + bytes_of_grid(sim, averaging)
    moved = {column: sum(row.get(column, 0.0) for row in arrays) for column in COLUMNS}
    return {
        "scheme": name,
        "dim": dim,
        "points": sim.n_points,
        "state": f"after {fall:g} s" if fall else "seeded",
        "slots": rows_of_points(sim),
        "ns": 1e9 * best_time(sim, 1, 5),
        "bytes": sum(from_memory(row) for row in arrays),
        "moved": moved,
        "arrays": [
            {key: round(v, 1) if isinstance(v, float) else v for key, v in row.items()}
            for row in arrays
        ],
    }


def tables(results: dict[str, Any]) -> dict[str, list[str]]:
    """Tables of the page: bytes of each stage, and of each array for the default scheme in 2D."""
    lines = [
        (
            row["scheme"],
            f"{row['dim']}D, {row['points']:,}, {row['state']}",
            *(f"{row['moved'][column]:.0f}" for column in COLUMNS),
            f"{row['bytes']:.0f}",
            f"{row['ns']:.1f}",
            f"{row['bytes'] / row['ns']:.1f}",
        )
        for row in results["rows"]
    ]
    head = ("scheme", "points", *COLUMNS, "bytes", "ns", "GB/s")
    default = next(row for row in results["rows"] if row["scheme"] == "default")
    arrays = [
        (row["array"], *(f"{row[c]:.0f}" if row.get(c) else "" for c in COLUMNS))
        for row in default["arrays"]
        if any(row.get(column) for column in COLUMNS)
    ]
    return {
        "stages": markdown(head, lines),
        "arrays": markdown(("array", *COLUMNS), arrays),
    }


def main(argv: list[str] | None = None) -> None:
    arguments = parser_of(__name__, __doc__).parse_args(argv)
    quick = arguments.quick
    cases = [(2, 25e3, 0.0), (2, 1e5, 0.0), (2, 1e5, FLOWS), (3, 1e5, 0.0)]
    if quick:
        cases = [(2, 1500, 0.0)]
    megabytes = (3.0, 0.3) if quick else (300.0, 0.3)
    begin = time.perf_counter()
    results: dict[str, Any] = {
        "memory [GB/s]": bandwidth(megabytes[0]) / 1e9,
        "cache [GB/s]": bandwidth(megabytes[1]) / 1e9,
        "rows": [],
    }
    for dim, points, fall in cases:
        for name in SCHEMES if not quick else ("default",):
            row = measured(name, points, dim, fall, min(points, 1500.0 if dim == 2 else 4000.0))
            results["rows"].append(row)
            print(
                f"{name:26s}{dim}D {row['points']:8d} {row['state']:14s}"
                f"{row['bytes']:8.0f} bytes {row['ns']:7.1f} ns",
                flush=True,
            )
    print(f"memory {results['memory [GB/s]']:.1f} GB/s; {time.perf_counter() - begin:.0f} s")
    write(arguments.out, results)

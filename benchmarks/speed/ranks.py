"""Time of a step by one and two ranks and by threads; their messages; a model of more ranks.

Each case runs in a process of its own, or in as many as there are ranks, started by mpiexec: a
process without ranks, one rank, two threads, two ranks, in turns. The times are the least of all
turns. A model of these times says what more ranks can gain.
"""

from __future__ import annotations

import atexit
import json
import os
import resource
import shutil
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

import matplotlib.pyplot as plt
import numpy as np
from shared import PICTURES, markdown, parser_of, python, rounded, stored, write

import granular as gr

SCENES = {
    "2D": lambda size: gr.scenes.column_collapse(
        cell=0.4 / size, points_per_cell=4, E=1e6, half_width=0.2, aspect=1.0
    ),
    "3D": lambda size: gr.scenes.cylinder_collapse(cell=0.2 / size, points_per_cell=8, E=1e6),
    "3D, wheel": lambda size: gr.scenes.wheel(cell=0.8 / size),
}
SIZES = {"2D": 500, "3D": 56, "3D, wheel": 128}
QUICK = {"2D": 20, "3D": 6, "3D, wheel": 64}
CASES = {
    "no ranks": (0, 1),
    "1 rank": (1, 1),
    "2 threads": (0, 2),
    "2 ranks": (2, 1),
}
"""Ranks, 0 for a process without any, and threads."""
NETWORK, LATENCY = 20e9, 2e-6
"""Bytes and messages of a network that the model assumes [1/s, s]: not measured here."""
CORES = 32
"""Threads of a rank of the model."""
MEMORY = {"2D": 2000, "3D": 108}
"""Sizes of the scenes, of four million points, whose memory is measured."""
MEMORY_QUICK = {"2D": 40, "3D": 10}


def child(scene: str, size: int, steps: int, repeats: int, ranks: int, threads: int) -> None:
    """Print the least time of a step, and what messages took [s]."""
    options: dict[str, Any] = {"threads": threads}
    if ranks:
        from mpi4py import MPI

        options["comm"] = MPI.COMM_WORLD
    sim: Any = gr.Simulation(SCENES[scene](size), **options)
    sim.step(steps)
    before = sim.traffic if ranks else []
    begin, seconds = time.perf_counter(), np.inf
    for _ in range(repeats):
        start = time.perf_counter()
        sim.step(steps)
        seconds = min(seconds, (time.perf_counter() - start) / steps)
    row = {"seconds": seconds, "points": sim.n_points}
    if ranks > 1:
        made = steps * repeats
        for key in ("sent_bytes", "seconds_waiting", "seconds_copying"):
            change = [a[key] - b[key] for a, b in zip(sim.traffic, before, strict=True)]
            row[key] = float(np.mean(change)) / made
        row["sent_cells"] = float(np.mean([part["sent_cells"] for part in sim.traffic]))
        row["mean_seconds"] = (time.perf_counter() - begin) / made
    print(json.dumps(row))


def memory_child(scene: str, size: int, ranks: int) -> None:
    """Make 20 steps and a record; each rank prints its largest memory when it ends [kB]."""
    options: dict[str, Any] = {"threads": 1}
    if ranks:
        from mpi4py import MPI

        options["comm"] = MPI.COMM_WORLD
    rank = options["comm"].rank if ranks else 0

    def tell() -> None:
        peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
        line = json.dumps({"rank": rank, "peak": peak}) + "\n"
        os.write(sys.stdout.fileno(), line.encode())  # at once: ranks end at the same time

    atexit.register(tell)
    sim: Any = gr.Simulation(SCENES[scene](size), **options)
    begin = time.perf_counter()
    sim.step(20)
    stepped = time.perf_counter()
    with tempfile.TemporaryDirectory() as folder:
        sim.run(until=sim.time, save=Path(folder) / "run.h5")
    recorded = time.perf_counter()
    times = {"steps": stepped - begin, "record": recorded - stepped}
    print(json.dumps({"points": sim.n_points, **times}), flush=True)


def started(words: list[Any], ranks: int) -> list[str]:
    """Output of a child, in as many processes as there are ranks."""
    command = [*python("ranks"), *map(str, words)]
    if ranks:
        folder = str(Path(sys.executable).parent)
        mpiexec = shutil.which("mpiexec", path=folder) or shutil.which("mpiexec")
        if mpiexec is None:
            raise SystemExit("ranks: mpiexec is not there: pip install mpich mpi4py")
        command = [mpiexec, "-n", str(ranks), *command]
    done = subprocess.run(command, capture_output=True, text=True, check=True)
    return done.stdout.splitlines()


def memory_of(scene: str, size: int, ranks: int) -> dict[str, Any]:
    """Largest memory of rank 0 and of the others, over the points of the scene [bytes]."""
    lines = [json.loads(line) for line in started(["--memory", scene, size, ranks], ranks)]
    row = next(line for line in lines if "points" in line)
    peaks = {line["rank"]: 1024 * line["peak"] for line in lines if "rank" in line}
    others = [peak for rank, peak in peaks.items() if rank]
    return {
        "scene": scene,
        "ranks": ranks,
        **row,
        "rank 0": peaks[0] / row["points"],
        "others": float(np.max(others)) / row["points"] if others else None,
    }


def run(scene: str, size: int, steps: int, repeats: int, case: str) -> dict[str, float]:
    ranks, threads = CASES[case]
    words = ["--child", scene, size, steps, repeats, ranks, threads]
    row: dict[str, float] = json.loads(started(words, ranks)[-1])
    return row


def weak(rows: list[dict[str, Any]]) -> list[dict[str, Any]]:
    """Efficiency of many ranks in 3D by the measured times: each has a cube of cells.

    A step takes the points, the copies of ghost cells and their bytes over the network, and six
    exchanges with a latency and a call of Python each.
    """
    by = {row["case"]: row for row in rows if row["scene"] == "3D"}
    one, two = by["no ranks"], by["2 ranks"]
    point = one["seconds"] / one["points"] / CORES
    per_cell = two["sent_bytes"] / two["sent_cells"]
    copying = two["seconds_copying"] / two["sent_cells"] / CORES
    call = max(by["1 rank"]["seconds"] - one["seconds"], 0.0)
    model = []
    for points in (1e5, 1e6, 4e6, 1e7):
        edge, reach = (points / 8) ** (1 / 3), 3
        for nodes in (1, 4, 16, 64, 256):
            ghosts = 0.0 if nodes == 1 else (edge + 2 * reach) ** 3 - edge**3
            messages = 6 * (LATENCY * np.log2(max(nodes, 2)) + call / 6) if nodes > 1 else 0.0
            seconds = points * point + ghosts * (copying + per_cell / NETWORK) + messages
            model.append(
                {
                    "points": points,
                    "ranks": nodes,
                    "all points": points * nodes,
                    "seconds": seconds,
                    "efficiency": points * point / seconds,
                }
            )
    return model


def draw(model: list[dict[str, Any]]) -> None:
    figure, axes = plt.subplots(figsize=(5.0, 3.2))
    for points in sorted({row["points"] for row in model}):
        part = [row for row in model if row["points"] == points]
        axes.plot(
            [row["ranks"] for row in part],
            [row["efficiency"] for row in part],
            "o-",
            label=f"{points:.0e} points".replace("e+0", "e"),
        )
    axes.set(xscale="log", xlabel="ranks", ylabel="efficiency", ylim=(0, 1.05))
    axes.set_xticks([1, 4, 16, 64, 256], ["1", "4", "16", "64", "256"])
    axes.legend(title="of each rank")
    figure.savefig(PICTURES / "report_ranks.png")
    plt.close(figure)


def tables(results: dict[str, Any]) -> dict[str, list[str]]:
    """Tables of the page on speed."""
    rows = []
    for row in results["rows"]:
        ns = 1e9 * row["seconds"] / row["points"]
        first = next(r for r in results["rows"] if r["scene"] == row["scene"])
        messages = ""
        if "sent_bytes" in row:
            messages = f"{row['sent_bytes'] / row['sent_cells']:.0f}"
        times = f"{row['seconds'] / first['seconds']:.3f}"
        rows.append(
            (row["scene"], f"{row['points']:.0f}", row["case"], f"{ns:.1f}", times, messages)
        )
    head = ("scene", "points", "case", "ns a point-step", "of no ranks", "bytes a ghost cell")
    rows_of_memory = [
        (
            row["scene"],
            f"{row['points']:.0f}",
            str(row["ranks"] or "no ranks"),
            f"{row['rank 0']:.0f}",
            f"{row['others']:.0f}" if row["others"] else "",
        )
        for row in results["memory"]
    ]
    head_of_memory = ("scene", "points", "ranks", "bytes a point, rank 0", "largest other rank")
    weak_head = ("points of a rank", "ranks", "points in all", "ms a step", "efficiency")
    return {
        "steps": markdown(head, rows),
        "memory": markdown(head_of_memory, rows_of_memory),
        "weak": markdown(
            weak_head,
            [
                (
                    f"{row['points']:.0e}",
                    str(row["ranks"]),
                    f"{row['all points']:.0e}",
                    f"{1e3 * row['seconds']:.2f}",
                    f"{row['efficiency']:.2f}",
                )
                for row in results["weak"]
            ],
        ),
    }


def main(argv: list[str] | None = None) -> None:
    parser = parser_of(__name__, __doc__)
    parser.add_argument(
        "--only", nargs="+", choices=("steps", "memory"), default=["steps", "memory"]
    )
    parser.add_argument("--child", nargs=6, help="a case, in a process of its own")
    parser.add_argument("--memory", nargs=3, help="scene, size and ranks of one of memory")
    chosen = parser.parse_args(argv)
    if chosen.memory:
        scene, *numbers = chosen.memory
        memory_child(scene, *map(int, numbers))
        return
    if chosen.child:
        scene, *numbers = chosen.child
        child(scene, *map(int, numbers))
        return
    results = stored(chosen.out, rows=[], memory=[], weak=[])
    if "steps" in chosen.only:
        results["rows"] = [rounded(row) for row in measured_steps(chosen.quick)]
        results["weak"] = [rounded(row) for row in weak(results["rows"])]
        if chosen.out:
            draw(results["weak"])
    if "memory" in chosen.only:
        results["memory"] = [rounded(row, 4) for row in measured_memory(chosen.quick)]
    names = {"steps": ("steps", "weak"), "memory": ("memory",)}
    write(chosen.out, results, [name for study in chosen.only for name in names[study]])


def measured_steps(quick: bool) -> list[dict[str, Any]]:
    """Times of steps of all cases, in turns."""
    turns, steps, repeats = (1, 5, 1) if quick else (3, 10, 4)
    rows: list[dict[str, Any]] = []
    for scene, size in (QUICK if quick else SIZES).items():
        best: dict[str, dict[str, Any]] = {}
        for _ in range(turns):
            for case in CASES:
                row = run(scene, size, steps, repeats, case)
                if case not in best or row["seconds"] < best[case]["seconds"]:
                    best[case] = {"scene": scene, "case": case, **row}
        rows += best.values()
        for row in best.values():
            print(rounded(row, 4), flush=True)
    return rows


def measured_memory(quick: bool) -> list[dict[str, Any]]:
    """Largest memory of runs."""
    memory = []
    for scene, size in (MEMORY_QUICK if quick else MEMORY).items():
        for ranks in (0, 1, 4):
            memory.append(memory_of(scene, size, ranks))
            print(rounded(memory[-1], 4), flush=True)
    return memory

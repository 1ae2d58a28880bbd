"""Share of a step that one thread does alone, in states that flow.

A block of grains is thrown over a rough floor: 100,000 points in 2D and a million in 3D with the
default scheme. The steps are run with one thread under `perf record` (Linux, package linux-perf).
Every sample of the clock has the functions that were active: those within `make_steps` are of a
step, and of these the ones within `gr_team_run` are of work that a team divides. The rest is
serial. perf cannot follow the frames of kernels, whose samples break off: they are of divided work,
too, unless they are of `gr_migrate`. With s the serial share, n threads are at most
1/(s + (1 - s)/n) times as fast as one.
"""

from __future__ import annotations

import argparse
import subprocess
import tempfile
from collections import Counter
from pathlib import Path
from typing import Any

from shared import parser_of, python, rounded, table, write

import granular as gr

CELL, SPEED = 0.01, 1.0
FREQUENCY = 199
STACK = 65528
"""Bytes of the stack that perf keeps of each sample: frames of the kernels are large."""
CASES = {2: (100_000, 16, 100, 2000), 3: (1_000_000, 8, 20, 60)}
"""By dimension: points, points per cell, steps before the measurement and in it."""
THREADS = 32


def scene(dim: int, points: int, per_cell: int) -> gr.Scene:
    """Return a block, twice as long as high, that flies to the side."""
    high = max(round((points / per_cell / 2) ** (1 / dim)), 2)
    sides = (2 * high, *[high] * (dim - 1))
    throw = (SPEED, *[0.5 * SPEED] * (dim - 2), 0.0)
    box = gr.Box((0.0,) * dim, tuple(n * CELL for n in sides))
    return gr.Scene(
        name="block",
        grid=gr.Grid((0.0,) * dim, CELL, (*(2 * n for n in sides[:-1]), high + 8)),
        fills=[gr.Fill(box, per_cell, velocity=throw)],
        walls=[
            gr.Wall(dim - 1, 0.0, kind="no_slip"),
            *(gr.Wall(axis, 0.0, kind="free_slip") for axis in range(dim - 1)),
        ],
        gravity=gr.Gravity((0.0,), ((*[0.0] * (dim - 1), -9.8),)),
        material=gr.materials.glass_beads.replace(E=1e6),
        duration=10.0,
    )


def run(dim: int, points: int, per_cell: int, before: int, steps: int, control: Path) -> None:
    """Run a case, and let perf take samples of the last steps only."""
    sim = gr.Simulation(scene(dim, points, per_cell), threads=1)
    sim.step(before)
    control.write_text("enable\n")
    sim.step(steps)
    control.write_text("disable\n")
    print(sim.n_points)


def count(samples: str) -> tuple[Counter[str], int]:
    """Count the samples of steps: the serial ones by function, and all."""
    serial: Counter[str] = Counter()
    all_samples = 0
    for sample in samples.split("\n\n"):
        functions = [line.split()[1].split("+")[0] for line in sample.splitlines() if line]
        whole = "make_steps" in functions
        if not whole and functions[-1:] != ["[unknown]"]:
            continue
        all_samples += 1
        if "gr_team_run" in functions or not (whole or "gr_migrate" in functions):
            continue
        stages = functions[: functions.index("make_steps" if whole else "gr_migrate") + 1]
        serial[stages[-2] if whole and len(stages) > 1 else stages[-1]] += 1
    return serial, all_samples


def measure(dim: int, case: tuple[int, ...]) -> dict[str, object]:
    """Take samples of a case in a separate process."""
    with tempfile.TemporaryDirectory() as name:
        data, control = Path(name, "perf.data"), Path(name, "control")
        subprocess.run(["mkfifo", str(control)], check=True)
        command = ["perf", "record", "--quiet", "--delay=-1", f"--control=fifo:{control}"]
        command += ["-F", str(FREQUENCY), "--call-graph", f"dwarf,{STACK}", "-o", str(data)]
        program = [*python("serial_share"), "--case", *map(str, (dim, *case)), str(control)]
        child = subprocess.run([*command, *program], check=True, stdout=subprocess.PIPE, text=True)
        script = ["perf", "script", "-i", str(data), "-F", "ip,sym"]
        samples = subprocess.run(
            script, check=True, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True
        ).stdout
    serial, total = count(samples)
    share = sum(serial.values()) / max(total, 1)
    return {
        "dim": dim,
        "points": int(child.stdout.split()[-1]),
        "samples": total,
        "serial_share": share,
        "serial": {name: n / total for name, n in serial.most_common(8)},
        "most": 1 / (share + (1 - share) / THREADS),
    }


def tables(results: dict[str, Any]) -> dict[str, list[str]]:
    """Table of the page."""
    columns = {"": "{dim}D", "points": "{points:,}", "samples": "{samples}"}
    columns |= {"serial share": "{serial_share:.2%}"}
    columns |= {f"{THREADS} threads over one, at most": "{most:.1f}"}
    return {"serial": table(results["rows"], columns)}


def main(argv: list[str] | None = None) -> None:
    parser = parser_of(__name__, __doc__)
    parser.add_argument("--case", nargs=6, help=argparse.SUPPRESS)
    arguments = parser.parse_args(argv)
    if arguments.case:
        run(*map(int, arguments.case[:-1]), Path(arguments.case[-1]))
        return
    rows = []
    for dim, case in CASES.items():
        rows.append(measure(dim, (2_000, case[1], 5, 400) if arguments.quick else case))
        for name, value in rows[-1].items():
            print(f"{name:24s}{value}")
    write(arguments.out, {"rows": rounded(rows, 4)})

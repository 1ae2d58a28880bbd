"""All figures of Dunatunga & Kamrin (2015), as cheap as a tolerance allows.

    python benchmarks/paper_in_half_an_hour.py [--tolerance 0.02] [--workers 2] [--quick]

Runs the scripts of `benchmarks/figures/` from the paper's own settings (E = 1 GPa) with the
suggestions of `gr.economy`. Each runs in a separate process with one thread, the longest first. The
time of each is printed. The pictures go to build/figures, the table to --table.
"""

from __future__ import annotations

import argparse
import importlib
import sys
import time
from concurrent.futures import ProcessPoolExecutor, as_completed
from multiprocessing import get_context
from pathlib import Path

from shared import write

FIGURES = Path(__file__).parent / "figures"

SCRIPTS = (
    "figure_5",
    "figure_3",
    "figure_4",
    "figures_6_7",
    "figure_2",
    "figures_9_10",
    "figure_11",
    "figure_13",
)
"""Scripts, the longest first, so that no worker waits long for the other at the end."""

LEAST = {"figure_2": 0.03, "figure_3": 0.13, "figure_11": 0.04}
"""Smallest tolerances that can be promised for run-outs (default scheme; both schemes) and for the
slug, see docs/reports/economy.md."""

WITHOUT_RUNS = ("figure_13",)
"""Scripts that simulate nothing, so that no cost can be saved."""


def draw(script: str, arguments: list[str]) -> dict[str, float | str]:
    """Run a script in this process and return its processor and wall time [s]."""
    sys.path.insert(0, str(FIGURES))
    begin, wall = time.process_time(), time.perf_counter()
    importlib.import_module(script).main(arguments)
    return {
        "script": script,
        "seconds": round(time.process_time() - begin, 1),
        "wall": round(time.perf_counter() - wall, 1),
    }


def arguments_of(script: str, chosen: argparse.Namespace) -> list[str]:
    """Command line of a script."""
    words = ["--out", str(chosen.out)] + (["--quick"] if chosen.quick else [])
    if script in WITHOUT_RUNS:
        return words
    tolerance = max(chosen.tolerance, LEAST.get(script, 0.0))
    return [*words, "--threads", "1", "--tolerance", str(tolerance)]


def main(argv: list[str] | None = None) -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--tolerance", type=float, default=0.02, help="of the quantities (0.02)")
    parser.add_argument("--workers", type=int, default=2, help="processes at a time (2)")
    parser.add_argument("--quick", action="store_true", help="coarse and short, to see it run")
    parser.add_argument("--only", nargs="+", choices=SCRIPTS, default=SCRIPTS)
    parser.add_argument("--out", type=Path, default=Path("build/figures"))
    parser.add_argument("--table", type=Path, help="write the table as JSON")
    chosen = parser.parse_args(argv)
    begin, rows = time.perf_counter(), []
    # spawn: a child that is forked would inherit the threads of the core.
    with ProcessPoolExecutor(chosen.workers, mp_context=get_context("spawn")) as pool:
        jobs = [
            pool.submit(draw, script, arguments_of(script, chosen))
            for script in SCRIPTS
            if script in chosen.only
        ]
        for job in as_completed(jobs):
            rows.append(job.result())
            print("{script:14s}{seconds:8.1f} s of a core".format(**rows[-1]), flush=True)
    total = sum(row["seconds"] for row in rows)
    wall = time.perf_counter() - begin
    print(f"{'together':14s}{total:8.1f} s of a core, {wall:.0f} s with {chosen.workers} workers")
    head = {"tolerance": chosen.tolerance, "workers": chosen.workers}
    head |= {"core_seconds": round(total, 1), "wall": round(wall, 1)}
    rows.sort(key=lambda row: SCRIPTS.index(row["script"]))
    write(chosen.table, head | {"rows": rows})


if __name__ == "__main__":
    main()

"""All figures of Dunatunga & Kamrin (2015), as cheap as a tolerance allows.

Draws the figures of `dunatunga_kamrin_2015` from the settings of the paper (E = 1 GPa) with the
suggestions of `gr.economy`. Each is drawn in a separate process with one thread, the longest first,
and its time is printed. The pictures go to build/figures, the table to --table.
"""

from __future__ import annotations

import argparse
import time
from concurrent.futures import ProcessPoolExecutor, as_completed
from multiprocessing import get_context
from pathlib import Path

from shared import write

from figures import dunatunga_kamrin_2015 as paper

SCRIPTS = tuple(paper.FIGURES)
LEAST = {"figure_2": 0.03, "figure_3": 0.13, "figure_11": 0.04}
"""Smallest tolerances that can be promised for run-outs (default scheme; both schemes) and for the
slug, see docs/reports/economy.md."""

WITHOUT_RUNS = ("figure_13",)
"""Figures that simulate nothing, so that no cost can be saved."""


def draw(script: str, arguments: list[str]) -> dict[str, float | str]:
    """Draw a figure in this process and return its processor and wall time [s]."""
    begin, wall = time.process_time(), time.perf_counter()
    paper.main([script, *arguments])
    return {
        "script": script,
        "seconds": round(time.process_time() - begin, 1),
        "wall": round(time.perf_counter() - wall, 1),
    }


def arguments_of(script: str, chosen: argparse.Namespace) -> list[str]:
    """Options of a figure."""
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

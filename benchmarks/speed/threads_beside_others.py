"""Two threads together with other programs that need the processors.

A column of 8,192 points is run with one thread and with two in turns, alone and together with
programs that keep a processor busy each. The times are of the wall clock, the mean of all turns:
with other programs the operating system decides, so that the fastest turn says nothing.
"""

from __future__ import annotations

import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager

from shared import parser_of, write

import granular as gr

BUSY = "while True: pass"


@contextmanager
def busy_programs(number: int) -> Iterator[None]:
    """Programs that compute without end while the context lasts."""
    programs = [subprocess.Popen([sys.executable, "-c", BUSY]) for _ in range(number)]
    try:
        time.sleep(0.5)
        yield
    finally:
        for program in programs:
            program.kill()
            program.wait()


def main(argv: list[str] | None = None) -> None:
    arguments = parser_of(__name__, __doc__).parse_args(argv)
    turns, steps = (2, 20) if arguments.quick else (40, 300)
    scene = gr.scenes.column_collapse(
        aspect=2.0, cell=0.0125, points_per_cell=16, material=gr.materials.glass_beads
    )
    sims = {threads: gr.Simulation(scene, threads=threads) for threads in (1, 2)}
    rows = []
    print(f"{'other programs':>15s}{'1 thread, s':>13s}{'2 threads, s':>14s}{'ratio':>7s}")
    for others in (0, 1, 2):
        seconds = dict.fromkeys(sims, 0.0)
        with busy_programs(others):
            for _ in range(turns):
                for threads, sim in sims.items():
                    begin = time.perf_counter()
                    sim.step(steps)
                    seconds[threads] += (time.perf_counter() - begin) / turns
        one, two = seconds.values()
        print(f"{others:15d}{one:13.3f}{two:14.3f}{two / one:7.2f}")
        rows.append({"others": others, "steps": steps, "points": sim.n_points, "seconds": seconds})
    write(arguments.out, {"rows": rows})

"""Processor time per particle and step of SPH, with one thread.

    python benchmarks sph_speed [--isa avx512] [--repeats 5]

The cases are beds at rest under their weight and layers that flow, in 2D and 3D; the least of the
repeats counts. Particles of the material, of walls and of the gas are counted alike.
"""

from __future__ import annotations

import argparse

from shared import least_time

from granular import scenes, sph

CASES = {
    "2D at rest": (dict(angle_deg=0.0, columns=100, height=1.0), 0.01, 300),
    "2D flow": (dict(angle_deg=24.0, columns=100, height=0.4), 1.0, 300),
    "3D at rest": (dict(angle_deg=0.0, columns=40, columns_across=5, height=0.3), 0.01, 40),
    "3D flow": (dict(angle_deg=24.0, columns=20, columns_across=5, height=0.15), 0.8, 40),
    "2D gas": (dict(depth=0.25), 0.005, 200),
    "3D gas": (dict(depth=0.25, across=0.1, spacing=0.0125), 0.002, 20),
}


def nanoseconds(arguments: dict, seconds: float, steps: int, isa: str, repeats: int) -> float:
    """Processor time per particle and step after `seconds` of the scene [ns]."""
    make = scenes.jet_on_bed if "depth" in arguments else scenes.incline_sph
    simulation = sph.Simulation(make(**arguments), isa=isa)
    simulation.run(seconds)
    points = simulation.n_points + simulation.walls.n
    points += simulation.gas.n if simulation.scene.gas else 0
    return 1e9 * least_time(lambda: simulation.step(steps), repeats) / steps / points


def main() -> None:
    """Print a table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--isa", default="", help="instruction set; the best of the machine")
    parser.add_argument("--repeats", type=int, default=5)
    given = parser.parse_args()
    print("| case | ns per point and step |\n|---|---|")
    for name, case in CASES.items():
        print(f"| {name} | {nanoseconds(*case, given.isa, given.repeats):.0f} |")

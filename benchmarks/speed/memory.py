"""Peak memory of scenes that are built, stepped and recorded, and the estimate that refuses.

    PYTHONPATH=. python benchmarks memory [most points, default 300000]

Each scene runs in a separate process, whose largest resident memory counts: blocks of material
with every kind of scheme, and other shapes, laws and fills with two of them. The estimate must not
be below the peak of a recorded run. The modules `memory` of the two methods have the fits.
"""

from __future__ import annotations

import argparse
import subprocess
import sys
import tempfile
from pathlib import Path

import granular as gr

FOLDER = Path(__file__).parents[1]
CHILD = f"import sys; sys.path.insert(0, {str(FOLDER)!r}); from speed import memory; memory.main()"
"""A child begins without what `python benchmarks` imports to draw pictures."""

PARTICLE = gr.ParticleDensity()
SCHEMES = {
    "default": gr.Scheme(),
    "single": gr.Scheme(precision="single"),
    "cell_averaged": gr.schemes.cell_averaged,
    "linear flip": gr.Scheme(basis="linear", transfer="flip", density=PARTICLE),
    "linear apic": gr.Scheme(basis="linear", transfer="apic", density=PARTICLE),
    "ugimp flip": gr.Scheme(basis="ugimp", transfer="flip", density=PARTICLE),
    "quadratic flip": gr.Scheme(basis="quadratic", transfer="flip", density=PARTICLE),
    "quadratic apic": gr.Scheme(basis="quadratic", transfer="apic", density=PARTICLE),
    "quadratic apic single": gr.Scheme(
        basis="quadratic", transfer="apic", density=PARTICLE, precision="single"
    ),
}
KINDS = ("thin", "disc", "slope", "nonlocal", "body", "lithostatic", "jitter", "hencky", "elastic")
PER_AXIS = {2: (1, 2, 4), 3: (1, 2, 3)}
CELL = 0.01


def shape_of(kind: str, dim: int, cells: float) -> tuple[int, ...]:
    """Cells along each axis of a cube, or of a layer of six cells."""
    if kind in ("thin", "slope"):
        return (*(max(round((cells / 6) ** (1 / (dim - 1))), 4),) * (dim - 1), 6)
    return (max(round(cells ** (1 / dim)), 4),) * dim


def region_of(kind: str, dim: int, upper: tuple[float, ...]) -> gr.Box | gr.Layer:
    middle = upper[0] / 2
    if kind == "disc" and dim == 2:
        return gr.Sphere(middle, center=(middle, middle))
    if kind == "disc":
        return gr.Cylinder(
            middle, center=(middle, middle, 0.5 * upper[2]), axis=(0.0, 0.0, 1.0), length=upper[2]
        )
    if kind == "slope":
        return gr.Layer(
            (lambda x: 0.5 * x) if dim == 2 else (lambda x, y: 0.5 * x + 0 * y),
            6 * CELL, (0.0,) * (dim - 1), upper[:-1], spacing=CELL,
        )  # fmt: skip
    return gr.Box((0.0,) * dim, upper)


def scene(scheme: str, kind: str, dim: int, per_axis: int, count: int) -> gr.Scene:
    shape = shape_of(kind, dim, count / per_axis**dim)
    upper = tuple(n * CELL for n in shape)
    rise = shape[0] // 2 if kind == "slope" else shape[-1] // 3
    material = {
        "nonlocal": gr.NGF(E=1e6, d=0.2 * CELL),
        "hencky": gr.MuI(E=1e6, elasticity="hencky"),
        "elastic": gr.Elastic(E=1e6),
    }.get(kind, gr.MuI(E=1e6))
    bodies = ()
    if kind == "body":
        box = gr.shapes.Box(size=(0.4 * upper[0],) * dim)
        bodies = (gr.Body(box, tuple(0.5 * end for end in upper)),)
    fill = gr.Fill(
        region_of(kind, dim, upper),
        per_axis**dim,
        lithostatic=kind == "lithostatic",
        jitter=0.5 if kind == "jitter" else 0.0,
    )
    return gr.Scene(
        name=kind,
        grid=gr.Grid((0.0,) * dim, CELL, (*shape[:-1], shape[-1] + rise + 20)),
        fills=(fill,),
        material=material,
        scheme=SCHEMES[scheme],
        bodies=bodies,
        gravity=gr.Gravity((0.0,), ((0.0,) * (dim - 1) + (-9.8,),)),
        duration=1.0,
    )


def peak() -> float:
    """Largest resident memory of this process so far [bytes].

    In getrusage that of the process that began this one counts, too.
    """
    status = Path("/proc/self/status").read_text().splitlines()
    return next(float(line.split()[1]) * 1024 for line in status if line.startswith("VmHWM"))


def measure(scheme: str, kind: str, dim: int, per_axis: int, count: int) -> None:
    """Print one row of the table."""
    one = scene(scheme, kind, dim, per_axis, count)
    sim = gr.Simulation(one, threads=1, force=True)
    sim.step(3)
    stepped = peak()
    with tempfile.TemporaryDirectory() as folder:
        until = sim.time + 3.5 * sim.dt
        sim.run(until=until, save=Path(folder, "a.h5"), every=sim.dt)
    recorded, estimate = peak(), gr.economy.cost(one).memory
    print(
        f"| {scheme} | {kind} | {dim} | {per_axis**dim} | {sim.n_points} | {stepped / 2**20:.0f} "
        f"| {recorded / 2**20:.0f} | {estimate / 2**20:.0f} | {estimate / stepped:.2f} "
        f"| {estimate / recorded:.2f} |",
        flush=True,
    )


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("most", type=int, nargs="?", default=300_000)
    parser.add_argument("--one", nargs=4, metavar=("SCHEME", "KIND", "DIM", "PER_AXIS"))
    arguments = parser.parse_args()
    if arguments.one:
        scheme, kind, dim, per_axis = arguments.one
        measure(scheme, kind, int(dim), int(per_axis), arguments.most)
        return
    print("| scheme | kind | dim | per cell | points | stepped, recorded, estimate [MB] | | | | |")
    print("| --- | --- | --- | --- | --- | --- | --- | --- | --- | --- |", flush=True)
    cases = [(scheme, "block") for scheme in SCHEMES]
    cases += [(scheme, kind) for kind in KINDS for scheme in ("default", "cell_averaged")]
    for dim in (2, 3):
        for scheme, kind in cases:
            for per_axis in PER_AXIS[dim][kind != "block" :]:
                words = [str(arguments.most), "--one", scheme, kind, str(dim), str(per_axis)]
                subprocess.run([sys.executable, "-c", CHILD, *words], check=True)

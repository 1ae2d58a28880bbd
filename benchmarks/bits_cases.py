"""Digests of state and checkpoint of every quick scene; `benchmarks/bits.py` compares two commits.

    python benchmarks/bits_cases.py --out digests.json [--only WORD]
    python benchmarks/bits_cases.py --between [--only WORD]

Every case is run with each instruction set of the machine, by one thread and by two. Digests hold
for one machine and one build: elementary functions come from its C library.

With --between every case is run with the instruction sets that have a fused multiply-add and on the
emulated device, which all have the same bits; the exit status is 1 where they differ.
"""

from __future__ import annotations

import argparse
import hashlib
import importlib.util
import json
import sys
import time
import warnings
from collections.abc import Iterator
from itertools import product
from pathlib import Path

import numpy as np

import granular as gr
from granular import materials, scenes
from granular.mpm import schemes
from granular.mpm.schemes import Fluidity

TESTS = Path(__file__).resolve().parents[1] / "tests"
ISAS = ("one_lane", "baseline", "avx2", "avx512")

READY = {
    "column_collapse": {"cell": 0.05, "points_per_cell": 4},
    "silo": {"cell": 0.05, "jitter": 0.3},
    "hourglass": {"fill_height": 0.1, "drop": 0.2},
    "hopper": {"cell": 0.025, "opens_at": 0.0},
    "rotating_drum": {"cell": 0.02, "width": 0.04},
    "incline": {"columns": 3, "jitter": 0.4},
    "slug": {"cell": 0.03},
    "cylinder_collapse": {"cell": 0.1},
    "chute_ngf": {"columns": 2},
    "clogging_silo": {"points_per_cell": 4},
    "silo_3d": {"cell": 0.0125},
    "couette": {"cell": 0.02},
    "excavation": {"cell": 0.025},
    "wheel": {},
    "excavator": {"cell": 0.025},
    "landslide": {"cell": 0.04},
    "flexible_barrier": {"cell": 0.025},
    "cohesive_cliff": {"cell": 0.05},
    "obstacle": {"cell": 0.05},
    "penetration": {"cell": 0.04},
    "sphere_drop": {"cell": 0.008},
    "rolling_wheel": {"cell": 0.02},
    "tumbling_block": {"cell": 0.02},
    "conveyor": {"cell": 0.025},
    "conveyor_heap": {"cell": 0.02, "duration": 0.5},
    "chute_fed": {"cell": 0.02, "duration": 0.5},
    "silo_fed": {"cell": 0.02, "duration": 0.3},
    "settling_bed": {"drop": 0.01, "duration": 0.3},
}
"""Ready-made MPM scenes, coarse."""

READY_SPH = {
    "slump_sph": {"length": 0.1, "height": 0.06, "orifice": 0.03, "dilation": 0.2},
    "incline_sph": {"height": 0.05},
    "inclined_collapse": {"length": 0.06, "height": 0.06, "width": 0.06, "reach": 0.15},
    "fluidised_bed": {"height": 0.05, "plenum": 0.05, "columns": 4},
    "jet_on_bed": {"width": 0.2, "depth": 0.1, "headroom": 0.1, "nozzle": 0.05, "spacing": 0.025},
    "column_collapse_sph": {"spacing": 0.03},
}


DENSITY = {
    "tpic_decay": 0.03,
    "diffusion": 0.0,
    "strain_diffusion": 20.0,
    "relaxation": 0.3,
    "relaxation_limit": 1.0,
    "dead_band": 0.03,
    "compression_rate": 3.0,
    "shifting": 8.0,
}
"""Numbers of small scenes with a cell-averaged density: defaults may change."""


def _tests() -> object:
    """The module of the tests that makes small scenes in every scheme."""
    sys.path.insert(0, f"{TESTS}/shared")
    spec = importlib.util.spec_from_file_location("scenes_of_tests", TESTS / "conftest.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def _ngf(E: float = 1e6, **changes: object) -> materials.NGF:
    return materials.NGF(E=E, d=0.02, A=0.5, t0=1e-2, **changes)


def small() -> Iterator[tuple[str, gr.Scene, int]]:
    """Every scheme; every law, both elasticities, and every way to diffuse the fluidity."""
    tests = _tests()

    def make(kind: str, dim: int, scheme: tuple[str, str, str], **more: float) -> gr.Scene:
        numbers = DENSITY if scheme[2] == "cell_averaged" else {}
        return tests.make_scene(kind, dim, scheme, **more, **numbers)

    numbered = list(enumerate(tests.COMBINATIONS))  # numbers: their names may change
    for (k, scheme), kind, dim in product(numbered, tests.KINDS, (2, 3)):
        yield f"scheme {k} {kind} {dim}D", make(kind, dim, scheme, E=1e5), 60
    of_rings = [row for row in numbered if row[1][0] != "ugimp" and row[1][2] != "cell_averaged"]
    for (k, scheme), kind in product(of_rings, tests.OF_RINGS):
        yield f"scheme {k} {kind}", make(kind, 2, scheme, E=1e5), 60
    grains = {
        "elastic": materials.Elastic(E=1e5),
        "drucker-prager": materials.DruckerPrager(E=1e5),
        "regularised mu(I)": materials.RegularisedMuI(E=1e5),
        "hencky elastic": materials.Elastic(E=1e5, elasticity="hencky"),
        "hencky drucker-prager": materials.DruckerPrager(E=1e5, elasticity="hencky"),
        "hencky mu(I)": materials.MuI(E=1e5, elasticity="hencky"),
        "hardening": materials.HardeningDruckerPrager(E=1e5),
        "hencky linear": materials.NGF(
            E=1e5, A=0.0, elasticity="hencky", rheology="linear_mu_I", mu_2=np.inf, b=1.0
        ),
    }
    for (label, material), (k, scheme), dim in product(grains.items(), numbered[-2:], (2, 3)):
        scene = make("walls", dim, scheme).replace(material=material)
        yield f"{label} scheme {k} {dim}D", scene, 60
    dilates = materials.DilatantMuI(E=1e5)
    for (k, scheme), dim in product(numbered, (2, 3)):
        if scheme[2] != "cell_averaged":
            scene = make("walls", dim, scheme)
            fills = tuple(fill.replace(packing=0.61) for fill in scene.fills)
            scene = scene.replace(material=dilates, fills=fills)
            yield f"dilatant mu(I) scheme {k} {dim}D", scene, 60
    laws = {
        "ngf": _ngf(1e5),
        "hencky ngf": _ngf(1e5, elasticity="hencky"),
        "hencky linear ngf": _ngf(1e5, elasticity="hencky", rheology="linear_mu_I"),
    }
    ways = list(product(("explicit", "implicit", "rkl2"), ("faces", "isotropic"), (1, 3)))
    chosen = (numbered[0], *numbered[-2:])
    for (label, material), way, (k, basis) in product(laws.items(), ways, chosen):
        method, stencil, substeps = way
        dim = 3 if stencil == "isotropic" and substeps == 3 else 2
        diffusion = Fluidity(method=method, stencil=stencil, substeps=substeps, initial=0.5)
        scene = make("walls", dim, basis)
        scheme = scene.scheme.replace(fluidity=diffusion, dt=2e-4)
        scene = scene.replace(material=material, scheme=scheme)
        yield f"{label} {method} {stencil} {substeps} scheme {k} {dim}D", scene, 40


def ready() -> Iterator[tuple[str, object, int]]:
    """The ready-made scenes of both methods, with the scheme of each and with others."""
    for name, numbers in READY.items():
        yield name, scenes.registry[name](**numbers), 100
    for label, scheme in {
        "published": schemes.dunatunga_kamrin_2015.replace(dt=None),
        "cell averaged": schemes.cell_averaged,
    }.items():
        for name in ("column_collapse", "silo", "hourglass"):
            yield f"{name} {label}", scenes.registry[name](**READY[name], scheme=scheme), 100
    for name, numbers in READY_SPH.items():
        yield name, scenes.registry[name](**numbers), 60
    column = scenes.column_collapse(**READY["column_collapse"], method="sph")
    yield "column_collapse both", column, 60


def digest(array: np.ndarray) -> str:
    """Digest of the bits of an array, its type and its shape."""
    array = np.ascontiguousarray(array)
    head = f"{array.dtype.str} {array.shape}".encode()
    return hashlib.sha256(head + array.tobytes()).hexdigest()[:20]


def digests(
    scene: object, steps: int, threads: int, isa: str | None, device: str | None = None
) -> dict[str, str]:
    """Digest of each field of the state, and of each number and array of the checkpoint.

    Some schemes are known to fail; then the step and the point of the failure are included.
    """
    machine = {} if device is None else {"device": device}
    sim = gr.Simulation(scene, threads=threads, isa=isa, **machine)
    table = {}
    try:
        sim.step(steps)
    except gr.SimulationError as error:
        table["failure"] = f"step {error.step}, point {error.point}"
    state, checkpoint = sim.state, sim.checkpoint()
    table |= {f"state {name}": digest(values) for name, values in state.fields.items()}
    for name, values in getattr(getattr(state, "gas", None), "fields", {}).items():
        table[f"gas {name}"] = digest(values)
    for name, value in checkpoint.scalars.items():
        table[f"number {name}"] = digest(np.array(value))
    return table | {f"array {name}": digest(a) for name, a in checkpoint.arrays.items()}


def available() -> list[str]:
    """Instruction sets of this machine."""
    names = []
    for isa in ISAS:
        try:
            gr._core.build_info(isa)
        except ValueError:
            continue
        names.append(isa)
    return names


def between(only: str) -> int:
    """Compare instruction sets and the emulated device; return the number of cases that differ."""
    sets = [isa for isa in available() if isa != "baseline"]
    begin, compared, on_device, different = time.perf_counter(), 0, 0, []
    for make in (small, ready):
        for name, scene, steps in make():
            if only not in name or isinstance(scene, gr.sph.Scene):
                continue  # in SPH lanes are neighbours, over which sums go
            tables = [digests(scene, steps, 1, isa) for isa in sets]
            try:
                tables.append(digests(scene, steps, 2, None, "emulated"))
                on_device += 1
            except ValueError as error:
                if "does not have" not in str(error):
                    raise
            compared += 1
            if any(table != tables[0] for table in tables):
                different.append(name)
    print(
        f"{compared} cases with {', '.join(sets)}, {on_device} of them on the emulated device: "
        f"{len(different)} differ, {time.perf_counter() - begin:.0f} s"
    )
    print(*different, sep="\n")
    return len(different)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--out", type=Path, help="digests of this build")
    parser.add_argument("--between", action="store_true", help="compare sets and the device")
    parser.add_argument("--only", default="", help="cases whose name holds this word")
    options = parser.parse_args()
    warnings.simplefilter("ignore")
    if options.between:
        sys.exit(between(options.only) > 0)
    if not options.out:
        parser.error("give --out or --between")
    begin, table = time.perf_counter(), {}
    for make in (small, ready):
        for name, scene, steps in make():
            if options.only not in name:
                continue
            for isa, threads in product(available(), (1, 2)):
                table[f"{name}, {isa}, {threads}"] = digests(scene, steps, threads, isa)
    options.out.write_text(json.dumps(table, indent=1))
    print(f"{len(table)} runs, {time.perf_counter() - begin:.0f} s")


if __name__ == "__main__":
    main()

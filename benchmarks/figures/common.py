"""Options, runs and saving, shared by the scripts of the figures. See docs/reports/figures.md."""

from __future__ import annotations

import argparse
from collections.abc import Collection, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from tqdm.auto import tqdm

import granular as gr
from granular.plot import Picture

OUT = Path("build/figures")
"""Folder of the pictures, which git ignores."""
BLUE, ORANGE, GREEN, RED, GREY = "#0072b2", "#e69f00", "#009e73", "#d55e00", "#8a8f98"
WEIGHT = gr.Gravity((0.0,), ((0.0, -9.8),))
PUBLISHED_E = 1e9
"""Young's modulus of the paper [Pa]."""

SCHEMES = {
    "default": gr.schemes.default,
    # The published step of 3e-6 s is for 1 GPa; softer material does not need so small a one.
    "published": gr.schemes.dunatunga_kamrin_2015.replace(dt=None),
}


RUN = ("scheme", "threads", "tolerance")
"""Options of `options` that concern runs."""


def panels(rows: int, columns: int, height: float, **options: object) -> tuple[Picture, np.ndarray]:
    """Empty picture of this height [inches] with panels."""
    made = Picture(figsize=(7.0, height), layout="compressed")
    return made, made.subplots(rows, columns, squeeze=False, **options)


def parser_of(doc: str | None) -> argparse.ArgumentParser:
    """Parser of a script with --quick and --out."""
    parser = argparse.ArgumentParser(description=doc)
    parser.add_argument("--quick", action="store_true", help="coarse and short, to look at")
    parser.add_argument("--out", type=Path, default=OUT, help=f"folder of the PNG ({OUT})")
    return parser


def options(
    doc: str,
    argv: Sequence[str] | None,
    *,
    E: float = 1e7,
    quick_E: float = 1e6,
    without: Collection[str] = (),
    schemes: Mapping[str, gr.Scheme] = SCHEMES,
    grains: gr.materials.Material = gr.materials.glass_beads,
) -> argparse.Namespace:
    """Parse the command line, and make the requested material and scheme.

    Parameters
    ----------
    doc : str
        Description of the script.
    argv : sequence of str or None
        Arguments; of the process if None.
    E, quick_E : float
        Default of --E, Young's modulus [Pa], without and with --quick.
    without : collection of str
        Options that the script does not have, such as `RUN`.
    schemes : mapping of str to Scheme
        Schemes by the names of --scheme; the first is the default.
    grains : Material
        Material whose E is replaced.
    """
    parser = parser_of(doc)
    parser.add_argument("--E", type=float, help=f"Young's modulus [Pa] ({E:g}, quick {quick_E:g})")
    if "scheme" not in without:
        parser.add_argument("--scheme", choices=tuple(schemes), default=next(iter(schemes)))
    if "threads" not in without:
        parser.add_argument("--threads", type=int, help="of the core; no result depends on it")
    if "tolerance" not in without:
        parser.add_argument(
            "--tolerance",
            type=float,
            help=f"start from {PUBLISHED_E:g} Pa, or from --E, and apply what gr.economy suggests",
        )
    chosen = parser.parse_args(argv)
    tolerance = getattr(chosen, "tolerance", None)
    if chosen.E is None:
        softer = quick_E if chosen.quick else E
        chosen.E = softer if tolerance is None else PUBLISHED_E
    chosen.material = grains.replace(E=chosen.E)
    chosen.settings = {"material": chosen.material}  # keywords of the scenes
    chosen.note = f"E = {chosen.E:g} Pa"
    if tolerance is not None:
        chosen.note = f"as suggested at {tolerance:g} for {chosen.note}"
    if "scheme" not in without:
        chosen.note = f"{chosen.scheme} scheme, {chosen.note}"
        chosen.scheme = chosen.settings["scheme"] = schemes[chosen.scheme]
    return chosen


def simulation_of(scene: gr.Scene, chosen: argparse.Namespace) -> gr.Simulation:
    """Simulation of the scene, or with --tolerance of the cheaper scene that is suggested."""
    if getattr(chosen, "tolerance", None) is not None:
        suggestion = gr.economy.suggest(scene, chosen.tolerance)
        scene = gr.economy.apply(scene, suggestion)
    return gr.Simulation(scene, threads=chosen.threads)


def tell(simulation: gr.Simulation, name: str = "") -> gr.Simulation:
    """Print the verdict on a run, and return the simulation."""
    tqdm.write(f"{name or simulation.scene.name}: {simulation.health().verdict}")
    return simulation


def states_at(
    scene: gr.Scene, times: Sequence[float], chosen: argparse.Namespace, *, name: str = ""
) -> list[gr.State]:
    """States of a run at ascending times, each of the first step at or after its time."""
    simulation = simulation_of(scene, chosen)
    states = []
    for time in tqdm(times, desc=name or scene.name, unit="state"):
        if time > 0:
            simulation.run(until=time)
        states.append(simulation.state)
    tell(simulation, name)
    return states


def frames(
    scene: gr.Scene,
    until: float,
    every: float,
    measure: Any,
    chosen: argparse.Namespace,
    *,
    name: str = "",
) -> list[Any]:
    """Results of `measure` for the state at each frame of a run; the states are not stored."""
    results: list[Any] = []
    simulation = simulation_of(scene, chosen)
    with tqdm(total=until, desc=name or scene.name, unit="s", leave=False) as bar:

        def look(running: gr.Simulation) -> None:
            results.append(measure(running.state))
            bar.update(min(running.time, until) - bar.n)

        simulation.run(until=until, every=every, hooks=(look,))
    tell(simulation, name)
    return results


def save(picture: Picture, chosen: argparse.Namespace, name: str) -> None:
    """Write the PNG, with its settings (if any) noted in the corner, and print its path."""
    note = getattr(chosen, "note", "")
    picture.text(0.995, 0.005, note, ha="right", va="bottom", fontsize=6, color="0.4")
    chosen.out.mkdir(parents=True, exist_ok=True)
    path = chosen.out / f"{name}.png"
    picture.savefig(path)
    tqdm.write(str(path))


def draw_pages(
    doc: str, argv: Sequence[str] | None, pages: Mapping[str, Any], prefix: str = ""
) -> None:
    """Draw the pictures that the command line names, by default all."""
    parser = parser_of(doc)
    parser.add_argument("names", nargs="*", help=f"of {', '.join(pages)}; all by default")
    chosen = parser.parse_args(argv)
    for name in set(chosen.names) - pages.keys():
        parser.error(f"{name!r} must be one of {', '.join(pages)}")
    for name in chosen.names or pages:
        save(pages[name](chosen.quick), chosen, f"{prefix}{name}")

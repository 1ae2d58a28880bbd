"""Options and saving, shared by the scripts of the figures."""

from __future__ import annotations

import argparse
from collections.abc import Mapping, Sequence
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


def tell(simulation: gr.Simulation, name: str = "") -> gr.Simulation:
    """Print the verdict on a run, and return the simulation."""
    tqdm.write(f"{name or simulation.scene.name}: {simulation.health().verdict}")
    return simulation


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

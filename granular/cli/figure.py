"""The command `granular figure`: figures of the documents that the package implements."""

from __future__ import annotations

import argparse
import json
import math
import os
import textwrap
from pathlib import Path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from granular.papers import Document, Drawn, Figure

ALL = "all"


def add_figure(commands: Any, add_command: Any) -> None:
    """Add the command and its options."""
    text = "draw a figure of one of the four documents, and compare its numbers"
    command = add_command(commands, "figure", text)
    command.add_argument("document", nargs="?", metavar="DOCUMENT", help="name; see --list")
    text = f"number, such as 5, 4a or table_3, or {ALL}; without it, list those of the document"
    command.add_argument("figure", nargs="?", metavar="FIGURE", help=text)
    command.add_argument("--list", action="store_true", help="print what all documents have")
    size = command.add_mutually_exclusive_group()
    size.add_argument("--quick", action="store_true", help="coarse and short, to look at")
    text = "sizes and times of the document where they are reduced otherwise"
    size.add_argument("--full", action="store_true", help=text)
    command.add_argument("--scheme", metavar="NAME", help="scheme, such as published")
    command.add_argument("--E", type=float, metavar="E", help="Young's modulus [Pa]")
    text = (
        "start from the document's modulus, or from --E, and apply what granular.economy suggests"
    )
    command.add_argument("--tolerance", type=float, metavar="T", help=text)
    text = "threads of each simulation; no result depends on it"
    command.add_argument("--threads", type=int, metavar="N", help=text)
    text = "displace all points at the start, to see how far numbers are determined"
    command.add_argument("--shift", type=float, default=0.0, metavar="M", help=text)
    text = "folder of the pictures and of the records of long runs; default ."
    command.add_argument("-o", "--output", type=Path, default=Path(), metavar="FOLDER", help=text)
    command.add_argument(
        "--numbers", type=Path, metavar="JSON", help="file to write the numbers to"
    )
    command.set_defaults(command=figure)


def figure(arguments: argparse.Namespace) -> int:
    """Draw a figure, or list what there is."""
    from granular.papers import DOCUMENTS, document

    if arguments.list or arguments.document is None:
        for name in [arguments.document] if arguments.document else DOCUMENTS:
            print(listing(document(name)))
        return 0
    paper = document(arguments.document)
    if arguments.figure is None:
        print(listing(paper))
        return 0
    drawn = [one.name for one in paper.figures.values() if one.function]
    results = {}
    for name in drawn if arguments.figure == ALL else [arguments.figure]:
        results[name] = _draw(paper, name, arguments)
    if arguments.numbers:
        arguments.numbers.write_text(json.dumps(results, indent=1) + "\n", encoding="utf-8")
    return 0


def _draw(paper: Document, name: str, arguments: argparse.Namespace) -> dict[str, Any]:
    """Draw one figure, save its pictures, print its numbers, and return them with the cost."""
    from matplotlib import style

    from granular.papers import Settings, draw

    size = "quick" if arguments.quick else "full" if arguments.full else "normal"
    settings = Settings(
        size=size,
        scheme=arguments.scheme,
        E=arguments.E,
        tolerance=arguments.tolerance,
        threads=arguments.threads,
        shift=arguments.shift,
        folder=arguments.output / "records",
    )
    begin = _spent()
    with style.context("granular.plot.pages"):
        drawn = draw(paper.name, name, settings)
        _save(drawn, paper.name, name, arguments.output)
    seconds = _spent() - begin
    print(verdicts(drawn))
    print(numbers_table(paper.figures[name], drawn))
    return {"numbers": dict(drawn.numbers), "seconds": round(seconds, 1)}


def _spent() -> float:
    """Processor time of this process and of those that it started and that have ended [s]."""
    times = os.times()
    return times.user + times.system + times.children_user + times.children_system


def _save(drawn: Drawn, document: str, name: str, folder: Path) -> None:
    """Save the pictures of a figure, and print their paths."""
    folder.mkdir(parents=True, exist_ok=True)
    label = name if name.startswith("table") else f"figure_{name}"
    for part, picture in drawn.pictures.items():
        stem = "_".join(filter(None, (document, label, part)))
        path = folder / f"{stem}.png"
        picture.savefig(path, bbox_inches="tight")
        print(path)


def verdicts(drawn: Drawn) -> str:
    """Runs whose verdict is not ok, and the number of the others."""
    lines = [f"{run}: {verdict}" for run, verdict in drawn.runs.items() if verdict != "ok"]
    if ok := len(drawn.runs) - len(lines):
        lines.append(f"{ok} of {len(drawn.runs)} runs are ok")
    return "\n".join(lines)


def numbers_table(figure: Figure, drawn: Drawn) -> str:
    """Numbers of a figure compared with those of the document."""
    names = list(dict.fromkeys([*drawn.numbers, *figure.paper]))
    if not names:
        return ""
    here, there = ({n: _text(part.get(n, "")) for n in names} for part in
                   (drawn.numbers, figure.paper))  # fmt: skip
    width, middle = (max(map(len, part)) for part in (names, here.values()))
    head = f"{'':{width}s}  {'here':{middle}s}  document"
    return "\n".join([head, *(f"{n:{width}s}  {here[n]:{middle}s}  {there[n]}" for n in names)])


def _text(number: float | str) -> str:
    return number if isinstance(number, str) else f"{number:.4g}"


def listing(paper: Document) -> str:
    """Figures and tables of a document: what they show, their state, cost and numbers."""
    lines = [f"{paper.name}: {paper.citation}"]
    indent = " " * 36
    for one in paper.figures.values():
        cost = "" if math.isnan(one.seconds) else f"{max(one.seconds, 1):.0f} s"
        reason = f" ({one.reason})" if one.reason else ""
        lines.append(f"  {one.name:8s} {one.state:16s} {cost:>7s}  {one.title}{reason}")
        numbers = "; ".join(f"{name}: {_text(number)}" for name, number in one.paper.items())
        lines += textwrap.wrap(numbers, 100, initial_indent=indent, subsequent_indent=indent)
    return "\n".join(lines) + "\n"

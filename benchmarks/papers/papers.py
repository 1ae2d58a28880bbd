"""Numbers of all figures of the documents that the package implements, with their scatter.

Each figure is drawn by `granular figure` in a separate process with one thread, and a second time
with all points displaced by 1 µm at the start: the difference of a number is its scatter. A run
that several figures need is made once, and its time is that of the first of them. Figures
that are already in the file are not drawn again, so that a series can be stopped and continued.
"""

from __future__ import annotations

import json
import math
import subprocess
import sys
import tempfile
import time
from concurrent.futures import ThreadPoolExecutor, as_completed
from pathlib import Path
from typing import Any

from shared import markdown, parser_of, rounded, stored, write

from granular.papers import DOCUMENTS, document

SHIFT = 1e-6
"""Displacement of all points in the second run [m]."""
PICTURES = Path("build/figures")


def numbers_of(name: str, figure: str, words: list[str]) -> dict[str, Any]:
    """Numbers of a figure, and the processor time that it took."""
    with tempfile.TemporaryDirectory() as folder:
        out = Path(folder, "numbers.json")
        command = [sys.executable, "-m", "granular", "figure", name, figure, "--threads", "1"]
        command += [*words, "--numbers", str(out)]
        done = subprocess.run(command, capture_output=True, text=True)
        if done.returncode:
            raise RuntimeError(f"{name} {figure}: {done.stderr.strip()}")
        numbers: dict[str, Any] = json.loads(out.read_text())[figure]
        return numbers


def row_of(name: str, figure: str, words: list[str], pictures: Path) -> dict[str, Any]:
    """Numbers of a figure and their scatter."""
    first = numbers_of(name, figure, [*words, "-o", str(pictures)])
    # Figures that share runs read their records here, too.
    words = [*words, "-o", str(pictures / "displaced")]
    scatter = scatter_of(name, figure, words, first["numbers"])
    numbers = rounded({"numbers": first["numbers"], "scatter": scatter}, 6)
    return {"document": name, "figure": figure, **numbers, "seconds": first["seconds"]}


def scatter_of(
    name: str, figure: str, words: list[str], numbers: dict[str, Any]
) -> dict[str, float]:
    """Changes of the numbers of a figure by a displacement of all points."""
    second = numbers_of(name, figure, [*words, "--shift", str(SHIFT)])
    return {
        key: abs(value - second["numbers"][key])
        for key, value in numbers.items()
        if not isinstance(value, str)
    }


def tables(results: dict[str, Any]) -> dict[str, list[str]]:
    """Tables of the pages: numbers of each document, and those of each of its figures."""
    by_document: dict[str, list[dict[str, Any]]] = {}
    for row in results["rows"]:
        by_document.setdefault(row["document"], []).append(row)
    made = {}
    for name, rows in by_document.items():
        order = list(document(name).figures)
        rows.sort(key=lambda row: order.index(row["figure"]))
        lines = [line for row in rows for line in lines_of(row)]
        made[name] = markdown(HEAD, lines)
        for row in rows:
            made[f"{name} {row['figure']}"] = markdown(HEAD, lines_of(row))
        costs = [(row["figure"].replace("_", " "), f"{row['seconds']:.0f} s") for row in rows]
        total = sum(row["seconds"] for row in rows)
        made[f"{name} cost"] = markdown(("figure", "one core"), [*costs, ("all", f"{total:.0f} s")])
    return made


HEAD = ("figure", "number", "here", "scatter", "document")


def lines_of(row: dict[str, Any]) -> list[tuple[str, ...]]:
    """Lines of a table: the numbers of a figure."""
    paper = document(row["document"]).figures[row["figure"]].paper
    figure = row["figure"].replace("_", " ")
    return [
        (figure, name, text(value), text(row["scatter"].get(name, "")), text(paper.get(name, "")))
        for name, value in row["numbers"].items()
    ]


def text(number: float | str) -> str:
    if isinstance(number, str):
        return number
    return "none" if math.isnan(number) else f"{number:.3g}"


def main(argv: list[str] | None = None) -> None:
    parser = parser_of(__name__, __doc__)
    parser.add_argument("documents", nargs="*", help=f"of {', '.join(DOCUMENTS)}; all by default")
    parser.add_argument("--only", nargs="+", help="figures of one document")
    parser.add_argument("--workers", type=int, default=2, help="processes at a time (2)")
    parser.add_argument("--pictures", type=Path, default=PICTURES, help=f"folder ({PICTURES})")
    chosen = parser.parse_args(argv)
    results = stored(chosen.out, rows=[])
    there = {(row["document"], row["figure"]) for row in results["rows"]}
    jobs = [
        (name, figure.name)
        for name in chosen.documents or DOCUMENTS
        for figure in sorted(document(name).figures.values(), key=lambda f: -f.seconds)
        if figure.function and (name, figure.name) not in there
        if not chosen.only or figure.name in chosen.only
    ]
    begin = time.perf_counter()
    with ThreadPoolExecutor(chosen.workers) as pool:
        words = ["--quick"] * chosen.quick
        running = [pool.submit(row_of, *job, words, chosen.pictures) for job in jobs]
        for job in as_completed(running):
            row = job.result()
            results["rows"].append(row)
            label = f"{row['document']} {row['figure']}"
            print(f"{label:28s}{row['seconds']:8.1f} s of a core", flush=True)
            write(chosen.out, results, [label])
    total = sum(row["seconds"] for row in results["rows"])
    print(f"{total:.0f} s of a core, {time.perf_counter() - begin:.0f} s now")

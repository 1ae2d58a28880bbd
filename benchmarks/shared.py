"""Options, timing and tables, shared by the scripts of this folder."""

from __future__ import annotations

import argparse
import json
import platform
import shlex
import subprocess
import sys
import time
from collections.abc import Callable, Iterable, Mapping, Sequence
from datetime import date
from pathlib import Path
from typing import Any

import numpy as np

import granular as gr
from granular.record.provenance import cpu_name

ROOT = Path(__file__).parents[1]


def parser_of(doc: str, quick: str = "small sizes, to see that it runs") -> argparse.ArgumentParser:
    """Parser of a script with --quick and --out."""
    parser = argparse.ArgumentParser(description=doc.splitlines()[0])
    parser.add_argument("--quick", action="store_true", help=quick)
    parser.add_argument("--out", type=Path, help="write the table as JSON")
    return parser


def machine() -> dict[str, Any]:
    """Machine and build, on which the times in a table depend."""
    return {"machine": platform.machine(), "build": gr.show_config()}


def commit() -> str:
    """Commit of the working tree, with a + if files have changed since."""
    command = ["git", "-C", str(ROOT), "describe", "--always", "--dirty=+"]
    return subprocess.run(command, capture_output=True, text=True).stdout.strip() or "unknown"


def stamp() -> dict[str, str]:
    """Commit, command, processor and date of a result, which its page shows."""
    script = Path(sys.argv[0]).resolve()
    if script.is_relative_to(ROOT):
        script = script.relative_to(ROOT)
    return {
        "commit": commit(),
        "command": shlex.join(["python", str(script), *sys.argv[1:]]),
        "processor": cpu_name(),
        "date": date.today().isoformat(),
    }


def write(out: Path | None, results: Mapping[str, Any], tables: Iterable[str] = ()) -> None:
    """Write results as JSON, if a file is given, with a stamp.

    Results that are measured table by table have a stamp for each: `tables` are those that are new.
    """
    if out:
        now = stamp()
        stamps = results.get("stamps", {}) | dict.fromkeys(tables, now)
        stamped = {**results, "stamp": now} | ({"stamps": stamps} if stamps else {})
        out.parent.mkdir(parents=True, exist_ok=True)
        out.write_text(json.dumps(stamped, indent=1, default=str) + "\n")


def least_time(
    work: Callable[[], object], repeats: int, clock: Callable[[], float] = time.process_time
) -> float:
    """Seconds of the fastest of several calls, by default processor time."""
    best = np.inf
    for _ in range(repeats):
        begin = clock()
        work()
        best = min(best, clock() - begin)
    return best


def rounded(value: Any, digits: int = 6) -> Any:
    """Value with its numbers rounded, as computed results have no more digits."""
    if isinstance(value, Mapping):
        return {name: rounded(v, digits) for name, v in value.items()}
    if isinstance(value, (list, tuple)):
        return [rounded(v, digits) for v in value]
    return float(f"{value:.{digits}g}") if isinstance(value, float) else value


def markdown(header: Sequence[object], rows: Iterable[Sequence[object]]) -> list[str]:
    """Table in Markdown, line by line."""
    head, *body = ("| " + " | ".join(map(str, row)) + " |" for row in (header, *rows))
    return [head, "|---" * len(header) + "|", *body]


def write_tables(page: Path, tables: Mapping[str, Sequence[str]]) -> None:
    """Replace the lines between the two marks of each table of a page.

    The marks of a table are `<!-- table NAME: begin -->` and `<!-- table NAME: end -->`. The only
    table of a page may have the name "", and no space for it in its marks.
    """
    text = page.read_text()
    for name, lines in tables.items():
        word = f"table {name}".rstrip()
        begin, end = f"<!-- {word}: begin -->", f"<!-- {word}: end -->"
        before, rest = text.split(begin)
        _, after = rest.split(end)
        text = before + "\n".join([begin, "", *lines, "", end]) + after
    page.write_text(text)

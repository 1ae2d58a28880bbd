"""Options, timing and tables, shared by the scripts of this folder."""

from __future__ import annotations

import argparse
import json
import os
import shlex
import sys
import time
import warnings
from collections.abc import Callable, Iterable, Mapping, Sequence
from datetime import date
from importlib import import_module
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np

import granular as gr
from granular.record.provenance import cpu_name
from granular.tools.version import commit

ROOT = Path(__file__).parents[1]
warnings.simplefilter("ignore", gr.StabilityWarning)  # many runs are at a limit on purpose

RESULTS = Path(__file__).parent / "results"
PICTURES = ROOT / "docs" / "pictures"


def scripts() -> dict[str, str]:
    """First line of the description of each script, by its name."""
    titles = {}
    for path in sorted(Path(__file__).parent.glob("*/*.py")):
        text = path.read_text(encoding="utf-8")
        if "\ndef main(" in text:
            titles[path.stem] = text[3:].partition("\n")[0].removesuffix('"""')
    return titles


def module(name: str) -> ModuleType:
    """Module of this name, with its folder where the name alone is not enough."""
    (path,) = Path(__file__).parent.rglob(name.replace(".", "/") + ".py")
    at_the_top = path.parent == Path(__file__).parent
    return import_module(path.stem if at_the_top else f"{path.parent.name}.{path.stem}")


def python(name: str) -> list[str]:
    """Command that runs a script in another process."""
    return [sys.executable, str(Path(__file__).parent), name]


class Parser(argparse.ArgumentParser):
    """Parser of a script, whose results go to its file in `results`, or to --out.

    A run with --quick stores nothing without --out.
    """

    def __init__(self, name: str, doc: str, quick: str) -> None:
        super().__init__(description=doc.splitlines()[0])
        self.file = RESULTS / f"{name.rpartition('.')[2]}.json"
        self.add_argument("--quick", action="store_true", help=quick)
        self.add_argument("--out", type=Path, help=f"JSON file ({self.file.relative_to(ROOT)})")

    def parse_args(self, argv: list[str] | None = None) -> argparse.Namespace:  # type: ignore
        """Options; without --out and --quick the file is named after the script."""
        chosen = super().parse_args(argv)
        if not (chosen.out or chosen.quick):
            chosen.out = self.file
        return chosen


def parser_of(
    name: str, doc: str, quick: str = "small sizes, to see that it runs; stores nothing"
) -> Parser:
    """Parser of the script of this name, with --quick and --out."""
    return Parser(name, doc, quick)


def stamp() -> dict[str, Any]:
    """Commit, command, processor, build and date of a result."""
    return {
        "commit": commit("benchmarks/*.py"),
        "command": " ".join(["python", sys.argv[0], shlex.join(sys.argv[1:])]).strip(),
        "processor": cpu_name(),
        "build": gr.show_config(),
        "date": date.today().isoformat(),
    }


def stored(out: Path | None, **empty: Any) -> dict[str, Any]:
    """Results in a file, or the empty ones without a file."""
    return json.loads(out.read_text()) if out and out.exists() else empty


def text_of(results: Mapping[str, Any]) -> str:
    """Results as JSON, with each row of a list and each entry of a dictionary on one line."""
    parts = []
    for name, value in results.items():
        text = json.dumps(value, default=str)
        if isinstance(value, list) and value:
            text = "[\n" + ",\n".join(json.dumps(row, default=str) for row in value) + "\n]"
        elif isinstance(value, dict) and value:
            lines = (json.dumps({key: row}, default=str)[1:-1] for key, row in value.items())
            text = "{\n" + ",\n".join(lines) + "\n}"
        parts.append(f"{json.dumps(name)}: {text}")
    return "{\n" + ",\n".join(parts) + "\n}\n"


def write(out: Path | None, results: dict[str, Any], tables: Iterable[str] = ()) -> None:
    """Write results as JSON with a stamp, which pages show below their tables, if a file is given.

    Results that are measured table by table have a stamp for each: `tables` are those that are new.
    """
    if out:
        stamps = results.pop("stamps", {})
        results.pop("stamp", None)  # both come last in the file
        results["stamp"] = stamp()
        if stamps := stamps | dict.fromkeys(tables, results["stamp"]):
            results["stamps"] = stamps
        out.parent.mkdir(parents=True, exist_ok=True)
        partial = out.with_suffix(".part")
        partial.write_text(text_of(results))
        os.replace(partial, out)


def run_studies(
    chosen: argparse.Namespace, studies: Mapping[str, Callable[[bool], Iterable[Mapping[str, Any]]]]
) -> None:
    """Run studies, which give their rows for --quick, and store each row as it ends."""
    results = stored(chosen.out, studies={})
    for name in chosen.only:
        rows = results["studies"][name] = []
        for row in studies[name](chosen.quick):
            rows.append(rounded(row))
            print(name, rounded(row, 4), flush=True)
            write(chosen.out, results, [name] if len(rows) == 1 else ())


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


def by_scheme(cases: Mapping[str, Mapping[str, Any]]) -> list[dict[str, Any]]:
    """Rows of results that are stored by case and scheme."""
    return [
        {"case": case, "scheme": scheme, **row}
        for case, of_schemes in cases.items()
        for scheme, row in of_schemes.items()
    ]


def table(rows: Iterable[Mapping[str, Any]], columns: Mapping[str, str]) -> list[str]:
    """Table in Markdown of rows, by the heading of each column and its text.

    A text is a template of `str.format` with the entries of a row, as "{seconds:.1f} s"; it is left
    blank if the row lacks an entry.
    """

    def cell(row: Mapping[str, Any], text: str) -> str:
        try:
            return text.format_map(row)
        except KeyError:
            return ""

    return markdown(list(columns), ([cell(row, text) for text in columns.values()] for row in rows))


def markdown(header: Sequence[object], rows: Iterable[Sequence[object]]) -> list[str]:
    """Table in Markdown, line by line."""
    head, *body = ("| " + " | ".join(map(str, row)) + " |" for row in (header, *rows))
    return [head, "|---" * len(header) + "|", *body]

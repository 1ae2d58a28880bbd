"""Compare two commits to the last bit: build both, run every quick scene, compare digests.

    python benchmarks/bits.py BEFORE [AFTER] [--gone NAME ...] [--only WORD]

BEFORE and AFTER are commits, or JSON files of `benchmarks/bits_cases.py`; AFTER is the working tree
by default. Each commit is built in a temporary folder and runs its own `bits_cases.py`, so that
names may have changed between them. Entries with another name but the same bits in every case count
as renamed and are listed; entries that AFTER lacks must be named by --gone. The exit status is 1
where bits differ.

A change of form (names, folders, files) must leave every digest as it was.
"""

from __future__ import annotations

import argparse
import json
import os
import subprocess
import sys
import tempfile
from collections import defaultdict
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]

Digests = dict[str, dict[str, str]]


def unpack(commit: str | None, folder: Path) -> None:
    """The files of a commit, or of the working tree, in an empty folder."""

    def output(*command: str, cwd: Path = ROOT, given: bytes = b"") -> bytes:
        return subprocess.run(
            command, cwd=cwd, check=True, input=given, stdout=subprocess.PIPE
        ).stdout

    if commit is None:
        names = output("git", "ls-files", "-z", "--cached", "--others", "--exclude-standard")
        there = [name for name in names.split(b"\0") if (ROOT / os.fsdecode(name)).is_file()]
        packed = output("tar", "--null", "-T", "-", "-c", given=b"\0".join(there))
    else:
        packed = output("git", "archive", commit)
    output("tar", "-x", cwd=folder, given=packed)


def digests_of(source: str | None, only: str) -> Digests:
    """Digests of a commit, of the working tree (None) or of a file."""
    if source and source.endswith(".json"):
        table = json.loads(Path(source).read_text())
        return {case: names for case, names in table.items() if only in case}
    with tempfile.TemporaryDirectory() as name:
        tree, site, out = (Path(name, part) for part in ("tree", "site", "digests.json"))
        tree.mkdir()
        unpack(source, tree)
        install = [sys.executable, "-m", "pip", "install", "--quiet", "--no-deps"]
        subprocess.run([*install, "--target", str(site), str(tree)], check=True)
        environment = os.environ | {"PYTHONPATH": str(site), "PYTHONSAFEPATH": "1"}
        script = [sys.executable, str(tree / "benchmarks" / "bits_cases.py")]
        arguments = ["--out", str(out), "--only", only]
        subprocess.run([*script, *arguments], check=True, env=environment, cwd=name)
        return json.loads(out.read_text())


def renamed(before: Digests, after: Digests) -> dict[str, str]:
    """Names that AFTER lacks, each with the new name that has its bits in every case."""
    old, new = ({name for case in table.values() for name in case} for table in (before, after))
    names = {}
    for name in sorted(old - new):
        holders = [case for case in before if name in before[case] and case in after]
        fits = [
            other
            for other in sorted(new - old)
            if all(after[case].get(other) == before[case][name] for case in holders)
            and not any(other in after[case] for case in set(after) - set(holders))
        ]
        if fits:
            names[name] = fits[0]
    return names


def compare(before: Digests, after: Digests, gone: list[str]) -> int:
    """Print the differences and return their number."""
    names = renamed(before, after)
    for old, new in names.items():
        print(f"renamed: {old} -> {new}")
    differ: dict[str, list[str]] = defaultdict(list)
    for case in sorted(set(before) | set(after)):
        if case not in before or case not in after:
            differ["(a case of one side alone)"].append(case)
            continue
        for name, value in before[case].items():
            if name not in gone and after[case].get(names.get(name, name)) != value:
                differ[name].append(case)
    for name, cases in differ.items():
        print(f"differs: {name} in {len(cases)} of {len(before)} runs, first in {cases[0]}")
    if not differ:
        print(f"the same bits in {len(before)} runs")
    return len(differ)


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("before")
    parser.add_argument("after", nargs="?", help="the working tree by default")
    parser.add_argument("--gone", nargs="*", default=[], help="names that AFTER may lack")
    parser.add_argument("--only", default="", help="cases whose name holds this word")
    options = parser.parse_args()
    before = digests_of(options.before, options.only)
    return bool(compare(before, digests_of(options.after, options.only), options.gone))


if __name__ == "__main__":
    sys.exit(main())

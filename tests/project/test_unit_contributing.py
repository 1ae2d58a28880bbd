"""The page for contributors names files and functions of today."""

import re
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
PAGE = ROOT / "docs" / "contributing.md"
FOLDERS = ("csrc/", "granular/", "tests/", "benchmarks/", "docs/", "notebooks/")


def test_files_exist():
    named = re.findall(
        r"`((?:csrc|granular|tests|benchmarks|docs|notebooks)/[^`\s]*)`", PAGE.read_text()
    )
    assert len(named) > 25
    missing = [name for name in named if not set("<*") & set(name) and not (ROOT / name).exists()]
    assert not missing


@pytest.mark.parametrize("route", ["From the P2G equation", "From a keyword of a scene"])
def test_routes_name_what_stands_in_their_files(route):
    """Five steps; each name beside a file, in backticks, is in that file."""
    section = PAGE.read_text().split(f"### {route}")[1].split("\n#")[0]
    steps = re.findall(r"^\d\. (.*(?:\n   .*)*)", section, re.M)
    assert len(steps) == 5
    for step in steps:
        names = re.findall(r"`([^`]+)`", step)
        files = [name for name in names if name.startswith(FOLDERS)]
        text = "\n".join((ROOT / name).read_text() for name in files)
        for name in set(names) - set(files):
            if re.fullmatch(r"\w+|struct \w+", name) and len(name) > 1:
                assert re.search(rf"\b{name}\b", text), (name, files)

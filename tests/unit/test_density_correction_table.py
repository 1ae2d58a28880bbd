"""The script of the density correction table keeps its rows and writes them into a page."""

import importlib
import json
from pathlib import Path

import pytest

from granular import verify
from granular.verify.rows import Check, at_most

PAGE = "before\n<!-- table: begin -->\nold\n<!-- table: end -->\nafter\n"


@pytest.fixture
def script(monkeypatch):
    """The script, with a single fast check that knows the scheme it is given."""
    monkeypatch.syspath_prepend(Path(__file__).parents[2] / "benchmarks")

    def rows(scheme):
        yield at_most("nodes | along an axis", 3.0 if scheme.basis == "quadratic" else 2.0, 2.5)
        if scheme.transfer == "apic":
            raise RuntimeError("went wrong")

    fake = Check("density_correction_box", True, rows)
    monkeypatch.setitem(verify.checks, "density_correction_box", fake)
    return importlib.import_module("density_correction_table")


def test_rows_are_kept_and_written(script, tmp_path):
    out, page = tmp_path / "new" / "table.json", tmp_path / "page.md"
    page.write_text(PAGE)
    common = ["--checks", "density_correction_box", "--out", str(out), "--schemes"]
    script.main([*common, "default", "quadratic APIC"])
    script.main([*common, "default", "published", "--page", str(page)])
    results = json.loads(out.read_text())
    assert [r["scheme"] for r in results] == ["quadratic APIC", "default", "published"]
    assert results[0]["rows"][1][:2] == ["RuntimeError: went wrong", "stopped"]
    assert results[1]["rows"] == [["nodes | along an axis", "3", "<= 2.5", False]]
    assert {"commit", "compiler", "isa", "machine", "seconds"} <= results[1].keys()
    text = page.read_text()
    assert text.startswith("before\n") and text.endswith("after\n") and "old" not in text
    assert "| nodes \\| along an axis | <= 2.5 | 3 **!** | 2 | 3 **!** |" in text
    assert "| quantity | asked | default | published | quadratic APIC |" in text
    script.write_page(page, results)
    assert page.read_text() == text


def test_every_check_is_offered(script):
    assert set(script.CHECKS) == {
        name for name in verify.checks if name.startswith("density_correction_")
    }

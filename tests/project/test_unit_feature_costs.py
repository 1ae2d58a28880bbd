"""The script that measures the cost of features runs, and writes its table."""

import json

PAGE = "before\n<!-- table features: begin -->\nold\n<!-- table features: end -->\nafter\n"


def test_a_quick_table_of_features_is_written(module, tmp_path, capsys):
    """Two features are measured in turns; the page gets a row for each, in their order."""
    script, out, page = module("features"), tmp_path / "features.json", tmp_path / "page.md"
    page.write_text(PAGE)
    script.main(["--quick", "--only", "cohesion", "SPH inflow", "--out", str(out)])
    assert len(capsys.readouterr().out.splitlines()) == 2
    script.main(["--out", str(out), "--page", str(page)])
    rows = json.loads(out.read_text())["rows"]
    assert list(rows) == ["cohesion", "SPH inflow"]
    assert all(1.0 < row["off"] < 1e5 and 0.1 < row["ratio"][1] < 10.0 for row in rows.values())
    text = page.read_text()
    assert "old" not in text and text.index("with cohesion") < text.index("SPH, an inflow")

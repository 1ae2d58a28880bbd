"""The script that measures the cost of features runs, and writes its table."""

import json


def test_a_quick_table_of_features_is_written(module, tmp_path, capsys):
    """Two features are measured in turns; the table has a row for each, in their order."""
    script, out = module("features"), tmp_path / "features.json"
    script.main(["--quick", "--only", "cohesion", "SPH inflow", "--out", str(out)])
    assert len(capsys.readouterr().out.splitlines()) == 2
    results = json.loads(out.read_text())
    rows = results["rows"]
    assert list(rows) == ["cohesion", "SPH inflow"]
    assert all(1.0 < row["off"] < 1e5 and 0.1 < row["ratio"][1] < 10.0 for row in rows.values())
    text = "\n".join(script.tables(results)["features"])
    assert text.index("with cohesion") < text.index("SPH, an inflow")

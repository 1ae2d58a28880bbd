"""The script that measures free bodies."""

import json


def test_quick_tables_of_free_bodies_are_written(module, tmp_path, capsys):
    """A second call measures nothing; each table has a stamp of its own."""
    script, out = module("free_bodies"), tmp_path / "table.json"
    names = ("light", "craters")
    script.main([*names, "--quick", "--out", str(out)])
    assert len(capsys.readouterr().out.splitlines()) == 2
    script.main([*names, "--quick", "--out", str(out)])
    assert capsys.readouterr().out == ""
    results = json.loads(out.read_text())
    assert results["stamps"].keys() == set(names)
    made = script.tables(results)
    assert made["light"][0] == "| mass over that of a cell | radius of 4 cells |"
    assert made["craters"][2].startswith("| 0.2 | 2.5 |")

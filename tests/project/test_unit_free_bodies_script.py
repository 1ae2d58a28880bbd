"""The script that measures free bodies."""


def test_quick_tables_of_free_bodies_are_written(module, tmp_path, capsys):
    """A second call measures nothing, and renews the page."""
    script, out, page = module("free_bodies"), tmp_path / "table.json", tmp_path / "page.md"
    names = ("light", "craters")
    script.main([*names, "--quick", "--out", str(out)])
    assert len(capsys.readouterr().out.splitlines()) == 2
    marks = (f"<!-- table free {n}: begin -->\nold\n<!-- table free {n}: end -->" for n in names)
    page.write_text("before\n" + "\n".join(marks) + "\nafter\n")
    script.main([*names, "--quick", "--out", str(out), "--page", str(page)])
    assert capsys.readouterr().out == ""
    text = page.read_text()
    assert text.startswith("before") and text.endswith("after\n") and "old" not in text
    assert "| mass over that of a cell | radius of 4 cells |" in text and "| 0.2 | 2.5 |" in text

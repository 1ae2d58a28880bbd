"""Results of measurements as tables and in short: units, columns, files."""

import dataclasses
import inspect
import re

import numpy as np
import pytest

import granular as gr
from granular.measure.result import Result, Table

UNIT = re.compile(r"\[((?:1/)?[^\]0-9][^\]]*)\]")


def subclasses(base=Result):
    return [part for one in base.__subclasses__() for part in (one, *subclasses(one))]


def documented(cls):
    """Units of the fields of a class by its docstring."""
    head, _, body = inspect.getdoc(cls).partition("Attributes\n----------\n")
    usual = UNIT.search(head)
    units = {}
    for entry in re.split(r"\n(?=\S)", body):
        names, _, text = entry.partition(" : ")
        found = UNIT.findall(text) or ([usual[1]] if usual else [])
        for k, name in enumerate(names.split(", ")):
            if found:
                units[name] = re.split("[;,]| per ", found[min(k, len(found) - 1)])[0]
    return units


def plain(unit):
    """The unit in 3D, or the part of one that a docstring has in front of "per metre"."""
    return unit.partition(";")[0]


def test_units_are_those_of_the_docstrings():
    found = subclasses()
    assert len(found) >= 30
    for cls in found:
        fields = {field.name for field in dataclasses.fields(cls)}
        assert set(cls.UNITS) <= fields, cls
        wanted = {name: unit for name, unit in documented(cls).items() if name in cls.UNITS}
        missing = set(cls.UNITS) - set(wanted)
        assert not missing, (cls, missing)
        for name, unit in wanted.items():
            assert plain(cls.UNITS[name]) == unit, (cls, name)


@pytest.fixture(scope="module")
def record(tmp_path_factory):
    path = tmp_path_factory.mktemp("result") / "a.h5"
    scene = gr.scenes.column_collapse(cell=0.05, E=1e6, duration=0.06)
    gr.Simulation(scene, threads=1).run(save=path, every=0.02)
    with gr.open(path) as opened:
        yield opened


def results(record):
    """Results of all kinds: of numbers, of columns, of vectors, on meshes, of pieces."""
    measure = gr.measure
    return [
        measure.runout(record[-1]),
        measure.surface(record[-1]),
        measure.mass_history(record),
        measure.slide_history(record),
        measure.deposit(record[-1]),
        measure.frame_average(record, "v"),
        measure.cell_average(record[-1], "stress"),
        measure.contours(measure.frame_average(record, "pressure", at="nodes"), [500.0])[0],
        gr.Simulation(record.scene).health(),
    ]


def test_a_file_for_spreadsheets_has_the_table_and_its_units(record, tmp_path):
    pandas = pytest.importorskip("pandas")
    for k, result in enumerate(results(record)):
        table, path = result.to_dataframe().reset_index(drop=k < 8), tmp_path / f"{k}.csv"
        result.to_csv(path)
        found = pandas.read_csv(path, comment="#")
        assert [name.partition(" [")[0] for name in found] == list(table), result
        units = table.attrs.get("units", {})
        for title, name in zip(found, table, strict=True):
            assert title == (f"{name} [{units[name]}]" if name in units else name)
            if table[name].dtype.kind in "fi":
                assert np.array_equal(found[title], table[name], equal_nan=True)
        with pytest.raises(FileExistsError):
            result.to_csv(path)
        result.to_csv(path, overwrite=True)
        assert repr(result).count("\n") <= 12


def test_columns_are_components_and_places(record):
    pytest.importorskip("pandas")
    slide = gr.measure.slide_history(record)
    table = slide.to_dataframe()
    assert np.array_equal(table["velocity_y"], slide.velocity[:, 1])
    assert table.attrs["units"]["velocity_y"] == "m/s"
    field = gr.measure.frame_average(record, "v")
    table = field.to_dataframe()
    for row in (0, len(table) // 2, len(table) - 1):
        i, j = np.unravel_index(row, field.weight.shape)
        assert table["x"][row] == field.axes[0][i] and table["y"][row] == field.axes[1][j]
        assert np.array_equal(table["value_y"][row], field.value[i, j, 1], equal_nan=True)
    surface = gr.measure.surface(record[-1])
    assert surface.to_dataframe().attrs["width"] == surface.width
    assert re.search(r"width +0\.05 m", repr(surface))


def test_tables_of_results_within_results_and_of_none():
    class Inner(Result, width="m"):
        def __init__(self):
            self.width = 2.0

    table = gr.measure.result.table_of(
        {"times": (0.0, 1.0), "opening": Inner(), "limit": None}, {"times": "s"}
    )
    assert table == Table(
        {"times_0": [0.0], "times_1": [1.0], "opening_width": [2.0], "limit": [None]},
        {},
        {"times_0": "s", "times_1": "s", "opening_width": "m"},
    )

"""Derived fields in records, and records as ParaView, h5py, pandas, xarray and pyvista see them."""

import sys

import h5py
import numpy as np
import pytest
from paraview_reader import as_array, paraview
from scenes_by_hand import scene_with

import granular as gr
from granular import Body, Box, Motion
from granular.record import RecordError

SOFT = gr.MuI(E=1e5, xi=None, I0=0.279, d=1e-3)
ASKED = ("pressure", "speed", "density", "inertial_number", "phase")


def block(dim):
    """A block that collapses beside a plate that moves."""
    level = (0.2,) * (dim - 2)
    plate = Motion(velocity=((0.1, *(0.0 for _ in level), 0.05),))
    position = (0.5, *(0.1 for _ in level), 0.2)
    return scene_with(
        grid=gr.Grid((0.0,) * dim, 0.05, (12, *(4 for _ in level), 8)),
        fills=[gr.Fill(gr.Box((0.0,) * dim, (0.2, *level, 0.2)), 2**dim)],
        walls=[gr.Wall(dim - 1, 0.0), gr.Wall(0, 0.0)], material=SOFT, duration=0.04,
        bodies=[Body(Box(size=(0.1,) * dim), position, motion=plate)],
    )  # fmt: skip


@pytest.fixture(scope="module", params=[2, 3])
def record(request, tmp_path_factory):
    path = tmp_path_factory.mktemp("fields") / f"block{request.param}.vtkhdf"
    gr.Simulation(block(request.param), threads=1).run(save=path, every=0.02, fields=ASKED)
    with gr.open(path) as found:
        yield found


@pytest.fixture(scope="module")
def blown(tmp_path_factory):
    """A record with gas in the later frames."""
    path = tmp_path_factory.mktemp("gas") / "gas.vtkhdf"
    scene = gr.scenes.fluidised_bed(duration=2e-3)
    gr.Simulation(scene, threads=1).run(save=path, every=1e-3, fields=("pressure", "speed"))
    with gr.open(path) as found:
        yield found


def pressure_of(stress):
    return -stress[:, :3].sum(axis=1) / 3


def test_paraview_shows_the_fields_that_were_asked_for(record):
    for (time, data), state in zip(paraview(record.path), record, strict=True):
        assert time == state.time
        points = data.GetPointData()
        found = {name: as_array(points.GetArray(name)) for name in ASKED}
        assert np.array_equal(found["pressure"], pressure_of(state.stress))
        assert np.array_equal(found["speed"], np.linalg.norm(state.v, axis=1))
        assert np.array_equal(found["density"], SOFT.rho_c * np.exp(state.log_density))
        assert np.array_equal(found["phase"], gr.measure.phase(state))
        expected = gr.measure.inertial_number(state)
        assert np.array_equal(found["inertial_number"], expected, equal_nan=True)
    with h5py.File(record.path, locking=False) as file:
        data = file["VTKHDF/PointData"]
        assert set(ASKED) < set(data)
        assert data["pressure"].dtype == "<f8"
    assert record.damage() == []


def test_gas_and_points_of_sph_have_pressure_and_speed(blown):
    assert blown.has_gas
    with h5py.File(blown.path, locking=False) as file:
        assert {"pressure", "speed"} < set(file["VTKHDF/PointData"])
        assert {"pressure", "density", "porosity"} < set(file["granular/gas/VTKHDF/PointData"])
    _, data = list(paraview(blown.path))[-1]
    assert np.array_equal(as_array(data.GetPointData().GetArray("speed")), blown[-1].speed)


def test_fields_change_no_step_and_a_run_that_goes_on_keeps_them(tmp_path):
    path = tmp_path / "a.vtkhdf"
    whole = gr.Simulation(block(2), threads=1).run(every=0.02)
    gr.Simulation(block(2), threads=1).run(0.02, save=path, every=0.02, fields=["speed"])
    again = gr.Simulation.resume(path, threads=1)
    with pytest.raises(ValueError, match=r"fields = \('mu',\) must be None or those of the record"):
        again.run(fields=["mu"])
    again.run()
    assert all(np.array_equal(whole.state.fields[k], v) for k, v in again.state.fields.items())
    with gr.open(path) as record:
        assert [np.array_equal(s.fields["speed"], s.speed) for s in record] == [True] * 3


@pytest.mark.parametrize(
    ("fields", "error", "message"),
    [
        ("speed", TypeError, "fields = 'speed' must be a sequence of names"),
        (3, TypeError, "fields = 3"),
        (["speed", "presure"], ValueError, "fields: 'presure' must be one of pressure, "),
        ([["v"]], TypeError, "fields = "),
    ],
)
def test_unknown_fields_are_named_before_the_run(tmp_path, fields, error, message):
    sim = gr.Simulation(block(2), threads=1)
    with pytest.raises(error, match=message):
        sim.run(save=tmp_path / "a.vtkhdf", fields=fields)
    assert not list(tmp_path.iterdir())
    for call in (gr.export.to_dataframe, gr.export.to_pyvista):
        with pytest.raises(error, match=message):
            call(sim.state, fields=fields)


def test_a_field_that_the_scene_cannot_have_is_named(tmp_path):
    sim = gr.Simulation(block(2).replace(material=gr.materials.Elastic(E=1e5)), threads=1)
    with pytest.raises((ValueError, TypeError), match="fields: 'inertial_number' needs more"):
        sim.run(save=tmp_path / "a.vtkhdf", fields=["inertial_number"])
    assert not list(tmp_path.iterdir())


def test_a_table_has_a_row_for_each_point(record):
    pytest.importorskip("pandas")
    state = record[-1]
    table = gr.export.to_dataframe(state)
    assert list(table.index) == list(state.id)
    up = "y" if state.dim == 2 else "z"
    assert np.array_equal(table[up], state.x[:, -1])
    assert np.array_equal(table[f"v_{up}"], state.v[:, -1])
    assert np.array_equal(table["stress_xy"], state.stress[:, 3])
    for name in ("pressure", "shear_stress", "density", "speed"):
        assert np.array_equal(table[name], getattr(state, name))
    units = table.attrs.pop("units")
    assert table.attrs == {"scene": "test", "time": state.time, "step": state.step}
    assert units["mass"] == {2: "kg/m", 3: "kg"}[state.dim] and units[f"v_{up}"] == "m/s"
    assert "mu" in gr.export.to_dataframe(state, fields=["mu"])


def test_a_data_set_has_points_by_time_and_id_and_the_bodies(record):
    pytest.importorskip("xarray")
    data = gr.export.to_xarray(record)
    last = record[-1]
    assert data.sizes["time"] == len(record) == 3
    found = data.isel(time=-1).sel(id=last.id)
    assert np.array_equal(found["x"], last.x)
    assert np.array_equal(found["pressure"], last.pressure)
    assert np.array_equal(found["stress"].sel(component="xx"), last.stress[:, 0])
    assert data["speed"].attrs["units"] == "m/s"
    (body,) = last.bodies
    place = found["body_position"].isel(body=0).values[: last.dim]
    assert np.array_equal(place, body.position)
    assert data["body_work"].dims == ("time", "body")
    assert data["body_work"].attrs["units"] == {2: "J/m", 3: "J"}[last.dim]
    assert np.array_equal(data["time"], record.times)
    with pytest.raises(ValueError, match="must have frames"):
        gr.export.to_xarray(record[:0])


def test_points_that_have_left_are_nan(tmp_path):
    pytest.importorskip("xarray")
    grid = gr.Grid((0.0, 0.0), 0.05, (12, 8), open_sides={"x+"})
    fast = gr.Fill(gr.Box((0.4, 0.1), (0.6, 0.2)), 4, velocity=(3.0, 0.0))
    scene = block(2).replace(grid=grid, fills=[fast], bodies=())
    gr.Simulation(scene, threads=1).run(save=tmp_path / "a.vtkhdf", every=0.02)
    with gr.open(tmp_path / "a.vtkhdf") as record:
        data = gr.export.to_xarray(record)
        counts = np.isfinite(data["mass"]).sum("id")
        assert list(counts) == [state.n for state in record]
        assert counts[-1] < counts[0]


def test_meshes_of_pyvista_have_points_gas_and_bodies(record, blown):
    pytest.importorskip("pyvista")
    state, found = record[1], gr.export.to_pyvista(record[1])
    assert found.keys() == ["material", "body0"]
    cloud = found["material"]
    assert np.array_equal(cloud.points[:, : state.dim], state.x)
    assert cloud["v"].shape == (state.n, 3)
    assert np.array_equal(cloud["pressure"], state.pressure)
    low, high = np.reshape(found["body0"].bounds, (3, 2)).T
    middle = 0.5 * (low + high)[: state.dim]
    assert middle == pytest.approx(state.bodies[0].position)
    assert (high - low)[: state.dim] == pytest.approx(0.1)
    gas = gr.export.to_pyvista(blown[-1])["gas"]
    assert np.array_equal(gas["pressure"], blown[-1].gas.pressure)
    data = pytest.importorskip("xarray") and gr.export.to_xarray(blown)
    assert np.array_equal(data["gas_pressure"].isel(time=-1), blown[-1].gas.pressure)


def of_vtk(path):
    *_, (_, data) = paraview(path)
    return {name: as_array(data.GetPointData().GetArray(name)) for name in ("pressure", "speed")}


def steps_of_pyvista(path):
    """Data of each step; the class of pyvista leaves the choice of a step to its VTK reader."""
    reader = pytest.importorskip("pyvista").get_reader(str(path))
    reader.reader.UpdateInformation()
    for step in range(reader.reader.GetNumberOfSteps()):
        reader.reader.SetStep(step)
        yield reader.read().copy()


def of_pyvista(path):
    *_, data = steps_of_pyvista(path)
    return {name: np.asarray(data.point_data[name]) for name in ("pressure", "speed")}


def of_h5py(path):
    with h5py.File(path, locking=False) as file:
        data = file["VTKHDF"]
        first = data["Steps/PointOffsets"][-1]
        rows = slice(first, first + data["NumberOfPoints"][-1])
        return {name: data["PointData"][name][rows] for name in ("pressure", "speed")}


def of_xarray(path):
    pytest.importorskip("xarray")
    with gr.open(path) as record:
        last = gr.export.to_xarray(record).isel(time=-1).sel(id=record[-1].id)
    return {name: last[name].values for name in ("pressure", "speed")}


@pytest.mark.parametrize("read", [of_vtk, of_pyvista, of_h5py, of_xarray])
def test_every_reader_finds_pressure_and_speed(record, blown, read):
    """In 2D, in 3D, and of SPH particles with a gas."""
    for found in (record, blown):
        state, seen = found[-1], read(found.path)
        assert np.array_equal(seen["pressure"], state.pressure)
        assert np.array_equal(seen["speed"], state.speed)


def test_pyvista_reads_the_bodies_beside_the_record(record):
    beside = record.path.with_name(f"{record.path.stem}_bodies.vtkhdf")
    for data, state in zip(steps_of_pyvista(beside), record, strict=True):
        low, high = np.reshape(data.bounds, (3, 2)).T
        middle = 0.5 * (low + high)[: state.dim]
        assert middle == pytest.approx(state.bodies[0].position)


@pytest.mark.parametrize(
    ("package", "extra", "call"),
    [
        ("pandas", "tables", lambda record: gr.export.to_dataframe(record[0])),
        ("xarray", "tables", lambda record: gr.export.to_xarray(record)),
        ("pyvista", "pictures3d", lambda record: gr.export.to_pyvista(record[0])),
    ],
)
def test_a_package_that_is_missing_is_named(record, monkeypatch, package, extra, call):
    monkeypatch.setitem(sys.modules, package, None)
    with pytest.raises(ModuleNotFoundError, match=rf"pip install 'granular-flow\[{extra}\]'"):
        call(record)


def test_a_record_with_unknown_fields_in_its_settings_is_damaged():
    from pathlib import Path

    from granular.record.settings import settings_of

    assert settings_of(Path("a"), {"fields": ["speed"]})[2] == ("speed",)
    for wrong in ("speed", ["speeed"], 3):
        with pytest.raises(RecordError, match="damaged record: fields"):
            settings_of(Path("a"), {"fields": wrong})

"""A record returns what was written to the last bit, here and in the reader of ParaView."""

import json
import platform
import sys
from dataclasses import dataclass
from types import ModuleType

import h5py
import numpy as np
import pytest
from paraview_reader import as_array, paraview

from granular import open_trajectory
from granular.record import Checkpoint, RecordError, TrajectoryWriter, info
from granular.record.chunks import Packed, Packer, corners
from granular.record.fresh import Fresh


@dataclass(frozen=True)
class SceneDouble:
    """Stand-in with the members of a Scene that a record uses."""

    name: str = "heap"
    bodies = ()

    @property
    def parameters(self):
        return {}

    def to_json(self):
        return json.dumps({"name": self.name})

    @staticmethod
    def from_json(text):
        return SceneDouble(**json.loads(text))


@dataclass(frozen=True, kw_only=True)
class StateDouble:
    """Stand-in with the members of a State that a record uses."""

    scene: SceneDouble
    time: float
    step: int
    dt: float
    fields: dict


@pytest.fixture(autouse=True)
def doubles(monkeypatch):
    """Test the record by itself, without the scene and the state of the package."""
    for name, attribute, double in (
        ("granular.tools.serializable", "Serializable", SceneDouble),
        ("granular.model.state", "State", StateDouble),
    ):
        module = ModuleType(name)
        setattr(module, attribute, double)
        monkeypatch.setitem(sys.modules, name, module)


def make_state(i, n, dim=2, **changes):
    rng = np.random.default_rng(1000 * i + n)
    fields = {
        "x": rng.random((n, dim)),
        "v": rng.normal(size=(n, dim)),
        "stress": rng.normal(size=(n, 4 if dim == 2 else 6)),
        "log_density": rng.normal(size=n),
        "mass": rng.random(n),
        "id": rng.permutation(n).astype(np.int64),
        "shear_rate": np.zeros(n),
        "one_column": rng.random((n, 1)),
    }
    fields["log_density"][: min(n, 4)] = [np.nan, -0.0, np.inf, 5e-324][:n]
    time = np.nextafter(0.1 * i, 1)
    return StateDouble(
        scene=SceneDouble(), time=time, step=10 * i, dt=1 / 3e5, fields=fields | changes
    )


def write(path, states, **options):
    with TrajectoryWriter(path, SceneDouble(), **options) as writer:
        for state in states:
            writer.append(state)


def assert_same(got, expected):
    assert (got.time, got.step, got.dt) == (expected.time, expected.step, expected.dt)
    assert set(got.fields) == set(expected.fields)
    for name, array in expected.fields.items():
        stored = got.fields[name]
        assert (stored.dtype, stored.shape) == (array.dtype, array.shape), name
        assert stored.tobytes() == array.tobytes(), name


def assert_holds(path, states):
    """The record at a path has these frames; return it, closed."""
    with open_trajectory(path) as record:
        for got, expected in zip(record, states, strict=True):
            assert_same(got, expected)
    return record


# points leave, arrive and vanish; 70000 exceeds the largest chunk
COUNTS = ([50, 50, 47, 1, 0, 60, 200], [0, 3], [70000, 60000, 12])


@pytest.mark.parametrize("counts", COUNTS)
def test_round_trip_is_bitwise(tmp_path, dim, counts):
    states = [make_state(i, n, dim) for i, n in enumerate(counts)]
    write(tmp_path / "a.h5", states)
    assert [path.name for path in tmp_path.iterdir()] == ["a.h5"]
    assert_holds(tmp_path / "a.h5", states)


def test_unfinished_record_reads_the_same_and_is_not_touched(tmp_path):
    states = [make_state(i, 30 - i) for i in range(3)]
    writer = TrajectoryWriter(tmp_path / "a.h5", SceneDouble("silo"))
    for state in states:
        writer.append(state)
    before = {path: path.stat().st_mtime_ns for path in tmp_path.rglob("*")}
    record = assert_holds(tmp_path / "a.h5", states)
    assert not record.finished and record.scene == SceneDouble("silo")
    assert {path: path.stat().st_mtime_ns for path in tmp_path.rglob("*")} == before
    writer.close()
    assert assert_holds(tmp_path / "a.h5", states).finished


def test_sequence_series_and_summary(tmp_path):
    states = [make_state(i, 20 - i) for i in range(5)]
    write(tmp_path / "a.h5", states, provenance={"threads": 2})
    with open_trajectory(tmp_path / "a.h5") as record:
        assert_same(record[-1], states[4])
        assert_same(record[np.int64(1)], states[1])
        assert [s.step for s in record[::-2]] == [40, 20, 0]
        assert record[1:3].times.tolist() == [states[1].time, states[2].time]
        for index in (5, -6):
            with pytest.raises(IndexError, match=r"must be in \[-5, 4\]"):
                record[index]
        assert record.series["n"].tolist() == [20, 19, 18, 17, 16]
        masses = [s.fields["mass"].sum() for s in states]
        np.testing.assert_allclose(record.series["mass"], masses, rtol=1e-14)
        assert record.provenance["threads"] == 2
        assert record.provenance["numpy"] == np.__version__
        assert record.provenance["start"].endswith("+00:00")
        assert platform.node() not in record.provenance.values()
        assert "5" in record._repr_html_()
        assert "heap" in record._repr_html_()
    summary = info(tmp_path / "a.h5")
    expected = {"frames": 5, "n": (20, 16), "steps": (0, 40), "scene": "heap"}
    assert summary["digest_ok"] and summary["checkpoint_step"] is None
    assert {name: summary[name] for name in expected} == expected


def make_checkpoint(seed=0):
    rng = np.random.default_rng(seed)
    arrays = {
        "x": np.asfortranarray(rng.random((2, 7))),
        "cells": rng.integers(-(2**63), 2**63 - 1, (3, 2, 2)),
        "empty": np.zeros((0, 4)),
        "nothing": np.array(np.nan),
    }
    scalars = {"energy": 0.1 + 0.2, "seed": -(2**63), "lost": -0.0, "worst": float("nan")}
    return Checkpoint(time=1 / 3, step=2**40, dt=5e-324, scalars=scalars, arrays=arrays)


def assert_same_checkpoint(got, expected):
    assert (got.time, got.step, got.dt) == (expected.time, expected.step, expected.dt)
    assert set(got.scalars) == set(expected.scalars)
    for name, value in expected.scalars.items():
        assert type(got.scalars[name]) is type(value)
        assert np.array(got.scalars[name]).tobytes() == np.array(value).tobytes()
    assert set(got.arrays) == set(expected.arrays)
    for name, array in expected.arrays.items():
        stored = got.arrays[name]
        assert (stored.dtype, stored.shape) == (array.dtype, array.shape)
        assert stored.tobytes() == array.tobytes()


def test_the_last_checkpoint_comes_back_bitwise(tmp_path):
    with TrajectoryWriter(tmp_path / "a.h5", SceneDouble()) as writer:
        writer.append(make_state(0, 5))
        writer.checkpoint(make_checkpoint(1))
        writer.checkpoint(make_checkpoint(2))
        with open_trajectory(tmp_path / "a.h5") as record:
            assert_same_checkpoint(record.checkpoint(), make_checkpoint(2))
    with open_trajectory(tmp_path / "a.h5") as record:
        assert_same_checkpoint(record.checkpoint(), make_checkpoint(2))


def test_what_is_stored_does_not_change_with_the_state(tmp_path):
    """Also not by way of a column that is not packed again because it has not changed."""
    state = make_state(1, 5, shear_rate=np.zeros(5))
    with TrajectoryWriter(tmp_path / "a.h5", SceneDouble()) as writer:
        writer.append(state)
        for name in ("v", "shear_rate"):
            state.fields[name][:] = 7.0
        later = StateDouble(**(state.__dict__ | {"step": 20}))
        writer.append(later)
    with open_trajectory(tmp_path / "a.h5") as record:
        assert_same(record[0], make_state(1, 5))
        assert_same(record[1], later)


@pytest.mark.parametrize("order", ["C", "F"])
def test_frames_in_single_precision(tmp_path, order):
    """They take less space, and read as double precision; positions and checkpoints are exact."""
    sizes, counts = {}, (40000, 33000, 12)
    for single in (False, True):
        path = tmp_path / f"{single}.h5"
        with TrajectoryWriter(path, SceneDouble()) as writer:
            for i, n in enumerate(counts):
                state = make_state(i, n)
                for name, array in state.fields.items():
                    state.fields[name] = array.copy(order=order)
                state.fields["mass"][:1] = 1e300
                writer.append(state, single=single)
            writer.checkpoint(make_checkpoint())
        sizes[single] = path.stat().st_size
    assert sizes[True] < 0.7 * sizes[False]
    with TrajectoryWriter.resume(path) as writer:
        writer.append(state, single=True)  # recognised
        assert writer.frames == 3
        with pytest.raises(ValueError, match="must be those of frame 0"):
            writer.append(make_state(4, 5))
    with open_trajectory(tmp_path / "False.h5") as exact, open_trajectory(path) as record:
        assert record.damage() == [] and len(record) == 3
        assert_same_checkpoint(record.checkpoint(), make_checkpoint())
        for state, wanted in zip(record, exact, strict=True):
            for name, array in wanted.fields.items():
                with np.errstate(over="ignore"):
                    rounds = array.dtype.kind == "f" and name != "x"
                    rounded = array.astype("<f4") if rounds else array
                found = state.fields[name]
                assert found.dtype == array.dtype
                assert np.array_equal(found, rounded.astype(array.dtype), equal_nan=True)
    with h5py.File(path) as file:
        assert file["VTKHDF/PointData/v"].dtype == "<f4" and file["VTKHDF/Points"].dtype == "<f8"
        assert file["VTKHDF/PointData/id"].dtype == "<i8"
    *_, (time, data) = paraview(path)
    assert time == make_state(2, 1).time
    points = as_array(data.GetPoints().GetData())
    assert np.array_equal(points[:, :2], make_state(2, 12).fields["x"])


def test_columns_that_change_their_nature_come_back_as_they_were():
    """A column is constant, then noise, then constant, for enough frames to be examined again."""
    rng, packer, n = np.random.default_rng(0), Packer(), 300
    noise = [rng.random(n) for _ in range(Packer.PATIENCE + 2)]
    same, zero = np.full(n, 0.1), np.where(np.arange(n) == 7, -0.0, 0.0)
    for column in (same, same, zero, -zero, *noise, *[same] * (Packer.PATIENCE + 1), zero):
        fresh = Fresh(column, 256, packer, "v", False)
        chunks = [fresh.raw(corner) for corner in corners(n, 256, 0)]
        packed = Packed(fresh.dtype, 0, 256, n, [(mask, bytes(raw)) for mask, raw in chunks])
        assert packed.read(0, n).tobytes() == column.tobytes()
    assert sum(len(raw) for _, raw in chunks) < 100  # compressed again in the end


@pytest.mark.parametrize("value", [np.nan, -np.nan, -0.0, np.inf])
def test_strange_numbers_survive_the_log(tmp_path, value):
    """JSON, in which the entries of the log are written, would lose the sign of a NaN."""
    scalars = {"strange": float(value)}
    point = Checkpoint(time=1.0, step=10, dt=1e-3, scalars=scalars, arrays={})
    state = make_state(1, 5, mass=np.full(5, value))
    writer = TrajectoryWriter(tmp_path / "a.h5", SceneDouble())
    writer.append(state)
    writer.checkpoint(point)
    for _ in range(2):  # by the log, then from the file
        with open_trajectory(tmp_path / "a.h5") as record:
            assert_same(record[0], state)
            assert_same_checkpoint(record.checkpoint(), point)
        writer.close()


def test_a_checkpoint_alone_is_a_record_and_none_is_said(tmp_path):
    with TrajectoryWriter(tmp_path / "b.h5", SceneDouble()) as writer:
        writer.checkpoint(make_checkpoint())
    with open_trajectory(tmp_path / "b.h5") as record:
        assert len(record) == 0
        assert_same_checkpoint(record.checkpoint(), make_checkpoint())
    write(tmp_path / "a.h5", [make_state(0, 5)])
    record = open_trajectory(tmp_path / "a.h5")
    with record, pytest.raises(RecordError, match=r"a\.h5: holds no checkpoint"):
        record.checkpoint()


@pytest.mark.parametrize(
    ("scalars", "arrays", "error"),
    [
        ({"a": True}, {}, TypeError),
        ({"a": "text"}, {}, TypeError),
        ({"a": 2**63}, {}, ValueError),
        ({"a/b": 1}, {}, ValueError),
        ({}, {"a": np.zeros(2, np.float32)}, TypeError),
        ({}, {"a": [1.0]}, TypeError),
        ({}, {"": np.zeros(2)}, ValueError),
    ],
)
def test_checkpoint_refuses_what_it_cannot_keep(scalars, arrays, error):
    with pytest.raises(error):
        Checkpoint(time=0.0, step=0, dt=1.0, scalars=scalars, arrays=arrays)


def test_frames_must_advance_and_agree(tmp_path):
    with TrajectoryWriter(tmp_path / "a.h5", SceneDouble()) as writer:
        assert writer.frames == 0
        assert writer, "callers ask `if writer:`"
        writer.append(make_state(1, 5))
        writer.append(make_state(1, 5))  # the same frame again counts as the recorded one
        assert writer.frames == 1
        for step in (10, 5):
            late = StateDouble(**(make_state(3, 5).__dict__ | {"step": step}))
            with pytest.raises(ValueError, match=f"step = {step} must exceed the last"):
                writer.append(late)
        with pytest.raises(ValueError, match="must be those of frame 0"):
            writer.append(make_state(2, 5, extra=np.zeros(5)))
        with pytest.raises(TypeError, match="mass has type float16"):
            writer.append(make_state(2, 5, mass=np.zeros(5, np.float16)))
        with pytest.raises(ValueError, match="mass has 4 rows, x has 5"):
            writer.append(make_state(2, 5, mass=np.zeros(4)))
        writer.append(make_state(2, 4))
    with pytest.raises(ValueError, match="closed"):
        writer.append(make_state(3, 4))
    with open_trajectory(tmp_path / "a.h5") as record:
        assert record.series["step"].tolist() == [10, 20]


def test_resume_appends_and_recognises_frames_made_again(tmp_path):
    path = tmp_path / "a.h5"
    states = [make_state(i, 9 - i) for i in range(6)]
    with TrajectoryWriter(path, SceneDouble()) as writer:
        for state in states[:4]:
            writer.append(state)
        writer.checkpoint(make_checkpoint())
    with TrajectoryWriter.resume(path) as writer:
        for state in states[2:]:  # the checkpoint was made before frame 2
            writer.append(state)
    assert_holds(path, states)
    with open_trajectory(path) as record:
        assert record.provenance["parent"] == make_checkpoint().digest.hex()
        assert len(record.provenance["earlier"]) == 1
        assert record.provenance["earlier"][0]["parent"] is None
        assert_same_checkpoint(record.checkpoint(), make_checkpoint())


@pytest.mark.parametrize("close", [True, False])
def test_a_different_frame_supersedes_what_followed(tmp_path, close):
    path = tmp_path / "a.h5"
    write(path, [make_state(i, 9) for i in range(5)])
    writer = TrajectoryWriter.resume(path)
    writer.append(make_state(1, 9))
    other = StateDouble(**(make_state(7, 8).__dict__ | {"step": 25}))
    writer.append(other)
    if close:
        writer.close()
    with open_trajectory(path) as record:
        assert record.series["step"].tolist() == [0, 10, 20, 25]
        assert_same(record[3], other)
    writer.close()


def test_a_frame_with_gas_supersedes_the_same_without(tmp_path):
    """The frame is also recognised when it is made again."""
    path, states = tmp_path / "a.h5", [make_state(i, 20) for i in range(3)]
    write(path, states)
    gas = {"x": np.random.default_rng(3).random((7, 2)), "mass": np.ones(7)}
    for _ in range(2):
        with TrajectoryWriter.resume(path) as writer:
            writer.append(states[1], others={"gas": gas})
        with open_trajectory(path) as record:
            frames = record._contents.frames
            assert len(frames) == 2 and record.has_gas and not frames[0].others
            assert {k: a.tobytes() for k, a in frames[1].others["gas"].read().items()} == {
                k: a.tobytes() for k, a in gas.items()
            }
            assert record.damage() == []


def test_wrong_gas_is_refused(tmp_path):
    states, x = [make_state(i, 20) for i in range(3)], np.zeros((7, 2))
    with TrajectoryWriter(tmp_path / "a.h5", SceneDouble()) as writer:
        with pytest.raises(ValueError, match="must have mass"):
            writer.append(states[0], others={"gas": {"x": x}})
        writer.append(states[0], others={"gas": {"x": x, "mass": np.ones(7)}})
        with pytest.raises(ValueError, match="must be those of frame 0"):
            writer.append(
                states[1], others={"gas": {"x": x, "mass": np.ones(7), "rho": np.ones(7)}}
            )
        writer.append(states[1])
        writer.append(states[2], others={"gas": {"x": x[:3], "mass": np.ones(3)}})
    with open_trajectory(tmp_path / "a.h5") as record:
        assert [f.others["gas"].n if f.others else None for f in record._contents.frames] == [
            7,
            None,
            3,
        ]


def test_the_file_is_what_the_vtkhdf_specification_asks(tmp_path):
    states = [make_state(i, n) for i, n in enumerate([5, 4])]
    write(tmp_path / "a.h5", states)
    with h5py.File(tmp_path / "a.h5") as file:
        vtk = file["VTKHDF"]
        assert vtk.attrs["Version"].tolist() == [2, 0]
        kind = vtk.attrs.get_id("Type").get_type()
        assert not kind.is_variable_str()
        assert kind.get_cset() == h5py.h5t.CSET_ASCII
        assert vtk.attrs["Type"] == b"PolyData"
        assert vtk["Steps"].attrs["NSteps"] == 2
        assert vtk["NumberOfPoints"][:].tolist() == [5, 4]
        start = vtk["Steps/PointOffsets"][1]
        assert np.array_equal(vtk["Points"][start : start + 4, :2], states[1].fields["x"])
        assert not vtk["Points"][:, 2].any()
        assert "x" not in vtk["PointData"]  # frames are stored once


def test_paraviews_reader_sees_every_frame(tmp_path, dim):
    states = [make_state(i, n, dim) for i, n in enumerate([12, 12, 7, 0, 30])]
    write(tmp_path / "a.h5", states)
    for state, (time, data) in zip(states, paraview(tmp_path / "a.h5"), strict=True):
        assert time == state.time
        n = len(state.fields["x"])
        assert (data.GetNumberOfPoints(), data.GetNumberOfVerts()) == (n, n)
        if n == 0:
            continue
        points = as_array(data.GetPoints().GetData())
        assert np.array_equal(points[:, :dim], state.fields["x"])
        assert not points[:, dim:].any()
        vertices = as_array(data.GetVerts().GetConnectivityArray())
        assert np.array_equal(vertices, np.arange(n))
        for name in set(state.fields) - {"x"}:
            seen = as_array(data.GetPointData().GetArray(name)).reshape(n, -1)
            field = state.fields[name].reshape(n, -1)
            assert seen.shape[1] == (3 if name == "v" else field.shape[1])
            assert np.array_equal(seen[:, : field.shape[1]], field, equal_nan=True), name

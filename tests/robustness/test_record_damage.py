"""Damaged, foreign and hostile files are refused by name: no crash, no hang, no wrong data."""

import json
import subprocess
import sys
import textwrap
from pathlib import Path
from types import SimpleNamespace

import h5py
import numpy as np
import pytest

from granular.record import (
    Checkpoint,
    RecordError,
    TrajectoryWriter,
    layout,
    merge,
    open_trajectory,
)

SCENE = SimpleNamespace(to_json=lambda: '{"name": "heap"}')


def make_state(i, n=40):
    rng = np.random.default_rng(i)
    fields = {
        "x": rng.random((n, 2)),
        "v": rng.normal(size=(n, 2)),
        "stress": rng.normal(size=(n, 4)),
        "mass": np.full(n, 0.25),
        "id": np.arange(n),
    }
    return SimpleNamespace(time=0.1 * i, step=10 * i, dt=1e-4, fields=fields)


def make_checkpoint(i):
    arrays = {"x": np.random.default_rng(i).random((2, 50)), "offsets": np.arange(9)}
    return Checkpoint(time=0.1 * i, step=10 * i, dt=1e-4, scalars={"lost": i}, arrays=arrays)


def content(path):
    """Everything that a user can read from the file and that must not change."""
    with open_trajectory(path) as record:
        frames = [
            (f.step, f.time, {k: a.tobytes() for k, a in f.read().items()})
            for with_gas in record._contents.frames
            for f in (with_gas, with_gas.gas)
            if f
        ]
        checkpoint = record.checkpoint().digest if record._contents.has_checkpoint else None
        texts = record._contents.texts
    return frames, checkpoint, texts


MUTANTS = textwrap.dedent("""
    import json, random, shutil, sys
    from pathlib import Path
    sys.path[:0] = sys.argv[4:]
    from test_record_damage import RecordError, content
    path, target, count = Path(sys.argv[1]), Path(sys.argv[2]), int(sys.argv[3])
    truth, good = content(path), target.read_bytes()
    chance, found = random.Random(7), {"refused": 0, "same": 0, "wrong": [], "other": []}
    for k in range(count):
        bad = bytearray(good)
        kind = chance.randrange(8)
        at = chance.randrange(len(bad))
        if kind == 0:
            del bad[at:]
        elif kind == 1:
            end = min(len(bad), at + chance.randrange(1, 600))
            bad[at:end] = bytes(end - at)
        elif kind == 2:
            del bad[at : at + chance.randrange(1, 9)]
        elif kind == 3:
            bad[at] ^= 1 << chance.randrange(8)
        else:
            for _ in range(chance.randrange(1, 9)):
                bad[chance.randrange(len(bad))] = chance.randrange(256)
        target.write_bytes(bad)
        try:
            if content(path) == truth:
                found["same"] += 1
            else:
                found["wrong"].append(k)
        except RecordError as error:
            found["refused"] += 1
            assert str(target) in str(error) or str(path) in str(error)
        except Exception as error:
            found["other"].append(f"{k}: {error!r}")
    print(json.dumps(found))
""")


def make_record(path, frames=3):
    with TrajectoryWriter(path, SCENE) as writer:
        for i in range(frames):
            writer.append(make_state(i))


def unfinished(path, gas=0):
    """An unfinished record whose frames hold this number of gas particles."""
    writer = TrajectoryWriter(path, SCENE)
    for i in range(2):
        more = {"gas": make_state(i + 5, n=gas - i).fields} if gas else {}
        writer.append(make_state(i, n=12), **more)
    writer.checkpoint(make_checkpoint(1))
    return writer


@pytest.mark.parametrize(
    ("member", "count", "gas"),
    [
        ("a.h5", 80, 0),
        ("a.h5", 80, 9),
        ("head.part", 20, 0),
        ("frames-00000001.part", 40, 0),
        ("frames-00000001.part", 40, 9),
        ("checkpoint.part", 20, 0),
    ],
)
def test_mutants_are_refused_or_harmless(tmp_path, member, count, gas):
    """Damaged files are read in a separate process, so that a crash or hang of HDF5 is noticed."""
    path = tmp_path / "a.h5"
    writer = unfinished(path, gas)
    if member == "a.h5":
        writer.close()
        target = path
    else:
        target = tmp_path / "a.h5.parts" / member
    folders = [str(Path(__file__).parent)]
    run = subprocess.run(
        [sys.executable, "-c", MUTANTS, str(path), str(target), str(count), *folders],
        capture_output=True,
        text=True,
        timeout=60,
        check=False,
    )
    assert run.returncode == 0, run.stderr[-2000:]
    found = json.loads(run.stdout)
    assert found["wrong"] == []
    assert found["other"] == []
    assert found["refused"] > count / 4


PNG = b"\x89PNG\r\n\x1a\n" + bytes(100)


@pytest.mark.parametrize("data", [b"", b"a, b\n1, 2\n", PNG, b"\x89HDF\r\n\x1a\n" + bytes(500)])
def test_foreign_files_are_refused_by_name(tmp_path, data):
    path = tmp_path / "foreign.h5"
    path.write_bytes(data)
    with pytest.raises(RecordError, match=r"foreign\.h5: "):
        open_trajectory(path)
    with pytest.raises(RecordError, match=r"foreign\.h5: "):
        TrajectoryWriter.resume(path)
    assert path.read_bytes() == data


def test_other_hdf5_files_are_refused(tmp_path):
    path = tmp_path / "other.h5"
    with h5py.File(path, "w") as file:
        file["VTKHDF/Points"] = np.zeros((3, 3))
    with pytest.raises(RecordError, match=r"other\.h5: not a granular record"):
        open_trajectory(path)
    with pytest.raises(FileNotFoundError):
        open_trajectory(tmp_path / "none.h5")
    with pytest.raises(IsADirectoryError):
        open_trajectory(tmp_path)


def test_newer_versions_are_refused_with_a_message(tmp_path):
    path = tmp_path / "a.h5"
    make_record(path)
    with h5py.File(path, "r+") as file:
        file["granular"].attrs["format"] = layout.FORMAT + 1
    with pytest.raises(RecordError, match=r"format version 3 is newer than 2.*update granular"):
        open_trajectory(path)


def replace_by_link(file, link):
    del file["VTKHDF/PointData/v"]
    file["VTKHDF/PointData/v"] = link


def external_storage(file, folder):
    raw = folder / "secret.bin"
    raw.write_bytes(bytes(8 * 40))
    del file["VTKHDF/PointData/mass"]
    data = file["VTKHDF/PointData"].create_dataset(
        "mass", (40,), "<f8", external=[(str(raw), 0, 8 * 40)]
    )
    data.attrs["columns"] = 0


def virtual(file, folder):
    layout = h5py.VirtualLayout((40,), "<f8")
    layout[:] = h5py.VirtualSource(str(folder / "b.h5"), "mass", (40,))
    del file["VTKHDF/PointData/mass"]
    file["VTKHDF/PointData"].create_virtual_dataset("mass", layout).attrs["columns"] = 0


def enormous(file, folder):
    file["VTKHDF/PointData/mass"].resize((10**15,))


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda f, d: replace_by_link(f, h5py.ExternalLink("b.h5", "v")), "is missing or a link"),
        (lambda f, d: replace_by_link(f, h5py.SoftLink("/VTKHDF/Points")), "missing or a link"),
        (external_storage, "outside of the file"),
        (virtual, "outside of the file"),
        (enormous, "more than the file can hold"),
    ],
)
def test_links_outside_data_and_false_sizes_are_refused(tmp_path, change, message):
    path = tmp_path / "a.h5"
    make_record(path, 1)
    with h5py.File(path, "r+") as file:
        change(file, tmp_path)
    with open_trajectory(path) as record:
        assert message in record.damage()[0]
        assert str(path) in record.damage()[0]


def test_other_frames_survive_a_damaged_one(tmp_path):
    path = tmp_path / "a.h5"
    make_record(path)
    with h5py.File(path, "r+") as file:
        start = file["VTKHDF/Steps/PointOffsets"][1]
        file["VTKHDF/PointData/stress"][start + 3, 1] += 1e-9
    with open_trajectory(path) as record:
        frames = record._contents.frames
        with pytest.raises(RecordError, match="frame of step 10 does not match its digest"):
            frames[1].read()
        for i in (0, 2):
            assert frames[i].read()["stress"].tobytes() == make_state(i).fields["stress"].tobytes()
        assert len(record.damage()) == 1


def test_a_missing_or_strange_segment_is_reported(tmp_path):
    path, other = tmp_path / "a.h5", tmp_path / "b.h5"
    writers = unfinished(path), unfinished(other)
    parts = tmp_path / "a.h5.parts"
    good = (parts / "frames-00000000.part").read_bytes()
    (parts / "frames-00000000.part").unlink()
    with pytest.raises(RecordError, match="a segment is missing"):
        open_trajectory(path)
    (tmp_path / "b.h5.parts" / "frames-00000000.part").rename(parts / "frames-00000000.part")
    with pytest.raises(RecordError, match="of another record"):
        open_trajectory(path)
    (parts / "frames-00000000.part").write_bytes(good)
    with open_trajectory(path) as record:
        assert len(record) == 2
    assert len(writers) == 2


def test_merging_holds_one_frame_at_a_time(tmp_path, monkeypatch):
    """Segments are opened one after another and closed again."""
    path = tmp_path / "a.h5"
    writer = TrajectoryWriter(path, SCENE)
    for i in range(6):
        writer.append(make_state(i))
    most, real = [0], merge.chunks.copy

    def copy(*args):
        most[0] = max(most[0], len(h5py.h5f.get_obj_ids(types=h5py.h5f.OBJ_FILE)))
        real(*args)

    monkeypatch.setattr(merge.chunks, "copy", copy)
    writer.close()
    assert 1 <= most[0] <= 3

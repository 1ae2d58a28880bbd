"""Damaged, foreign and hostile files are refused by name: no crash, no hang, no wrong data."""

import json
import subprocess
import sys
import textwrap
from pathlib import Path

import h5py
import numpy as np
import pytest
import records
from records import SCENE, make_checkpoint, make_record, make_state

from granular.record import RecordError, TrajectoryWriter, layout, merge, open_trajectory

MUTANTS = textwrap.dedent("""
    import json, random, sys
    from pathlib import Path
    sys.path.insert(0, sys.argv[1])
    from granular.record import RecordError, open_trajectory
    from records import content

    def everything(path):
        with open_trajectory(path) as record:
            digest = record._contents.has_checkpoint and record.checkpoint().digest
            return content(path), digest, record._contents.texts

    def damaged(good, chance):
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
        return bad

    for path, target, count in json.loads(sys.argv[2]):
        truth, good, chance = everything(path), Path(target).read_bytes(), random.Random(7)
        found = {"target": target, "share": 0.0, "wrong": [], "other": []}
        for k in range(count):
            Path(target).write_bytes(damaged(good, chance))
            try:
                if everything(path) != truth:
                    found["wrong"].append(k)
            except RecordError as error:
                found["share"] += 1 / count
                assert target in str(error) or path in str(error)
            except Exception as error:
                found["other"].append(f"{k}: {error!r}")
        print(json.dumps(found), flush=True)
""")


def unfinished(path, gas=0):
    """An unfinished record whose frames hold this number of gas particles."""
    writer = TrajectoryWriter(path, SCENE)
    for i in range(2):
        more = {"gas": make_state(i + 5, n=gas - i).fields} if gas else {}
        writer.append(make_state(i, n=12), **more)
    writer.checkpoint(make_checkpoint(1))
    return writer


def test_mutants_are_refused_or_harmless(tmp_path):
    """Damaged files are read in a separate process, so that a crash or hang of HDF5 is noticed."""
    cases, writers = [], []
    for k, (member, count, gas) in enumerate([
        ("", 80, 0), ("", 80, 9), ("head.part", 20, 0), ("frames-00000001.part", 40, 0),
        ("frames-00000001.part", 40, 9), ("checkpoint.part", 20, 0),
    ]):  # fmt: skip
        path = tmp_path / f"{k}.h5"
        writers.append(unfinished(path, gas))
        if not member:
            writers[-1].close()
        target = tmp_path / f"{k}.h5.parts" / member if member else path
        cases.append((str(path), str(target), count))
    folder = str(Path(records.__file__).parent)
    run = subprocess.run(
        [sys.executable, "-c", MUTANTS, folder, json.dumps(cases)],
        capture_output=True,
        text=True,
        timeout=60,
        check=False,
    )
    assert run.returncode == 0, run.stdout + run.stderr[-2000:]
    found = [json.loads(line) for line in run.stdout.splitlines()]
    assert len(found) == len(cases)
    for case in found:
        assert case["wrong"] == case["other"] == [], case
        assert case["share"] > 0.25, case


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

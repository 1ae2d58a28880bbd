"""Damaged, foreign and hostile files are refused by name: no crash, no hang, no wrong data."""

import errno
import json
import os
import random
import shutil
import subprocess
import sys
import textwrap
import tracemalloc
from dataclasses import replace
from pathlib import Path

import h5py
import numpy as np
import pytest
from processes import command
from records import abandon, content, make_checkpoint, make_record, make_state, unfinished

import granular as gr
from granular import open_trajectory
from granular.record import RecordError, TrajectoryWriter, layout
from granular.record.growing import DATA, LOG
from granular.record.index import parts_folder
from granular.record.log import read_log
from granular.record.sealed import MAGIC, unsealed

MUTANTS = """
    import json, random, sys
    from pathlib import Path
    from granular.record import RecordError, open_trajectory
    from records import content

    def everything(path):
        with open_trajectory(path) as record:
            digest = record._contents.has_checkpoint and record.checkpoint().digest
            return (content(path), digest, record._contents.texts), record.damage()

    def as_if_killed_earlier(found, truth):
        (frames, checkpoint), *rest = found
        return (truth[0][0][: len(frames)], checkpoint) == found[0] and tuple(rest) == truth[1:]

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

    for path, target, count in json.loads(sys.argv[1]):
        (truth, _), good, chance = everything(path), Path(target).read_bytes(), random.Random(7)
        found = {"target": target, "share": 0.0, "wrong": [], "other": []}
        for k in range(count):
            bad = damaged(good, chance)
            Path(target).write_bytes(bad)
            try:
                now, said = everything(path)
                cut = target.endswith("log") and as_if_killed_earlier(now, truth)
                if now != truth and not (cut and (said or good.startswith(bad))):
                    found["wrong"].append(k)
            except RecordError as error:
                found["share"] += 1 / count
                assert target in str(error) or path in str(error)
            except Exception as error:
                found["other"].append(f"{k}: {error!r}")
        print(json.dumps(found), flush=True)
"""


def test_mutants_are_refused_or_harmless(tmp_path):
    """Damaged files are read in a separate process, so that a crash or hang of HDF5 is noticed."""
    cases, writers = [], []
    for k, (member, count, gas) in enumerate([
        ("", 50, 0), ("", 50, 9), ("log", 30, 0), ("log", 30, 9), ("*.data", 30, 0),
        ("*.data", 30, 9), ("*.restart", 20, 0),
    ]):  # fmt: skip
        path = tmp_path / f"{k}.h5"
        writers.append(unfinished(path, gas))
        if not member:
            writers[-1].close()
        target = next(parts_folder(path).glob(member)) if member else path
        cases.append((str(path), str(target), count))
    run = subprocess.run(
        command(MUTANTS, json.dumps(cases)), capture_output=True, text=True, timeout=60, check=False
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
    with pytest.raises(RecordError, match=r"format version 5 is newer than 4.*update granular"):
        open_trajectory(path)
    with h5py.File(path, "r+") as file:
        file["granular"].attrs["format"] = layout.FORMAT - 1
    with pytest.raises(RecordError, match=r"format version 3 must be 4"):
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


def test_damage_of_the_last_entry_of_a_log_is_reported(tmp_path):
    """Any byte of it, here every third; what a writer that was killed leaves of it is none."""
    path = tmp_path / "a.h5"
    abandon(unfinished(path))
    log, chance = parts_folder(path) / LOG, random.Random(3)
    good = log.read_bytes()
    last = good.rindex(MAGIC)
    for at in (*range(last, len(good) - 1, 3), len(good) - 1):
        bad = bytearray(good)
        bad[at] ^= 1 << chance.randrange(8)
        for spoilt in (bad, good[:at] + good[at + 1 :] if at + 1 < len(good) else bad):
            log.write_bytes(spoilt)
            _, frames, said = read_log(log, DATA)
            assert len(frames) == 1 and len(said) == 1, at
        log.write_bytes(good[:at])
        assert len(read_log(log, DATA)[1]) == 1 and not read_log(log, DATA)[2]
    log.write_bytes(bad)
    with open_trajectory(path) as record:
        (said,) = record.damage()
        assert str(log) in said and "of frame 1, is damaged" in said
    with pytest.warns(RuntimeWarning, match="unless the run makes it again"):
        TrajectoryWriter.resume(path).close()


def test_what_is_missing_of_an_unfinished_record_is_reported(tmp_path):
    path = tmp_path / "a.h5"
    abandon(unfinished(path))
    log, (data,) = parts_folder(path) / LOG, parts_folder(path).glob("*.data")
    good = log.read_bytes()
    _, first = unsealed(memoryview(good))
    _, second = unsealed(memoryview(good)[first:])
    for spoilt in (good[:first] + good[first + second // 2 :], good[: first + 99] + good[first:]):
        log.write_bytes(spoilt)  # an entry in the middle is not whole
        with pytest.raises(RecordError, match=r"log: damaged record: entry 0 is damaged"):
            open_trajectory(path)
    log.write_bytes(good[:first] + good[first + second :])
    with open_trajectory(path) as record:
        assert len(record) == 1 and record.damage() == []
    log.write_bytes(good)
    data.rename(data.with_suffix(".moved"))
    with pytest.raises(RecordError, match=r"\.data is missing"):
        open_trajectory(path)


def test_a_missing_chunk_is_damage(tmp_path):
    """HDF5 would read zeros in its place, of which a file may claim any number."""
    path = tmp_path / "a.h5"
    make_record(path, 2)
    with h5py.File(path, "r+") as file:
        mass = file["VTKHDF/PointData/mass"]
        mass.resize((40,))
        mass.resize((80,))
    with open_trajectory(path) as record:
        (said,) = record.damage()
    assert "chunk storage is not allocated" in said


def test_chunks_that_hdf5_writes_are_read(tmp_path):
    """It deflates also what becomes larger by it."""
    path = tmp_path / "a.h5"
    make_record(path)
    before = content(path)
    with h5py.File(path, "r+") as file:
        group = file["VTKHDF/PointData"]
        for data in (file["VTKHDF/Points"], *(group[name] for name in group)):
            data[...] = data[...]
        _, raw = group["stress"].id.read_direct_chunk((0, 1))
    assert len(raw) > 8 * 40
    assert content(path) == before


def test_a_large_id_takes_no_memory(small_scene):
    sim = gr.Simulation(small_scene("walls", 2, ("linear", "flip", "particle")), threads=1)
    sim.step(3)
    before, checkpoint = sim.state, sim.checkpoint()
    arrays = dict(checkpoint.arrays)
    arrays["id"] = np.where(arrays["id"] == 5, 30_000_000, arrays["id"])
    tracemalloc.start()
    far = gr.Simulation.from_checkpoint(sim.scene, replace(checkpoint, arrays=arrays)).state
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert peak < 20e6
    assert far.fields["id"][-1] == 30_000_000
    assert far.x[-1].tobytes() == before.x[5].tobytes()
    assert np.delete(before.x, 5, axis=0).tobytes() == far.x[:-1].tobytes()
    for wrong in (-3, 7):
        arrays["id"] = np.where(checkpoint.arrays["id"] == 5, wrong, checkpoint.arrays["id"])
        with pytest.raises(ValueError, match=r"must be (distinct|from 0)"):
            gr.Simulation.from_checkpoint(sim.scene, replace(checkpoint, arrays=arrays))


def test_a_checkpoint_that_does_not_fit_is_damage(small_scene, tmp_path):
    path = tmp_path / "a.h5"
    scene = small_scene("walls", 2, ("linear", "flip", "particle"))
    with TrajectoryWriter(path, scene) as writer:
        writer.checkpoint(make_checkpoint(1))
    with pytest.raises(RecordError, match=r"a\.h5: the run cannot be resumed"):
        gr.Simulation.resume(path)
    with pytest.raises(ValueError, match="threads = 0") as caught:
        gr.Simulation.resume(path, threads=0)
    assert not isinstance(caught.value, RecordError)


# --- errors of the system are no damage ------------------------------------------------------

SHIM = """
    #define _GNU_SOURCE
    #include <dlfcn.h>
    #include <errno.h>
    #include <stdlib.h>
    #include <unistd.h>
    ssize_t pread64(int fd, void *to, size_t size, off64_t from)
    {
        const char *first = getenv("FAIL_FROM");
        if (first && from >= atol(first)) return errno = atoi(getenv("FAIL_CODE")), -1;
        ssize_t (*real)(int, void *, size_t, off64_t) = dlsym(RTLD_NEXT, "pread64");
        return real(fd, to, size, from);
    }
    ssize_t pread(int fd, void *to, size_t size, off_t from) { return pread64(fd, to, size, from); }
"""

READERS = """
    import collections, ctypes, os, sys
    from records import content
    for code in (5, 12):
        os.environ["FAIL_CODE"], found = str(code), collections.Counter()
        for first in range(0, os.path.getsize(sys.argv[1]), 400):
            os.environ["FAIL_FROM"] = str(first)
            try:
                content(sys.argv[1])
            except Exception as error:
                found[type(error).__name__, getattr(error, "errno", None)] += 1
        print(dict(found))
        del os.environ["FAIL_FROM"]
"""


@pytest.mark.skipif(sys.platform != "linux" or not shutil.which("cc"), reason="needs LD_PRELOAD")
def test_a_disk_that_cannot_be_read_is_no_damage(tmp_path):
    """Reading fails in the system, below HDF5."""
    path, source, library = tmp_path / "a.h5", tmp_path / "shim.c", tmp_path / "shim.so"
    make_record(path)
    source.write_text(textwrap.dedent(SHIM))
    subprocess.run(["cc", "-shared", "-fPIC", source, "-o", library, "-ldl"], check=True)
    run = subprocess.run(
        command(READERS, path),
        env=os.environ | {"LD_PRELOAD": str(library)},
        capture_output=True,
        text=True,
        check=True,
    )
    first, second = map(eval, run.stdout.splitlines())
    assert list(first) == [("OSError", errno.EIO)] and first["OSError", errno.EIO] > 20
    assert list(second) == [("MemoryError", None)]


@pytest.mark.parametrize("code", [errno.EIO, errno.ENOMEM, errno.EACCES, errno.ESTALE])
def test_a_log_that_cannot_be_read_is_no_damage(tmp_path, monkeypatch, code):
    writer = unfinished(tmp_path / "a.h5")

    def refuse(*_, **__):
        raise OSError(code, os.strerror(code))

    with monkeypatch.context() as patch:
        patch.setattr(Path, "read_bytes", refuse)
        with pytest.raises(MemoryError if code == errno.ENOMEM else OSError) as caught:
            open_trajectory(tmp_path / "a.h5")
    assert code in (getattr(caught.value, "errno", None), errno.ENOMEM)
    writer.close()


def test_hdf5_that_has_no_memory_is_no_damage(tmp_path, monkeypatch):
    """If there is memory for what a valid file holds, its sizes were false; else there is none."""
    for left, kind in ((True, RecordError), (False, MemoryError)):
        monkeypatch.setattr(layout, "_memory_left", lambda left=left: left)
        with pytest.raises(kind, match=r"a\.h5"), layout.reading(tmp_path / "a.h5"):
            raise OSError("Can't read data (memory allocation failed for filter pipeline)")

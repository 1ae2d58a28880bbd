"""Health, volumes, contacts and energy of states whose values follow from a line of algebra."""

import numpy as np
import pytest
from refusals import refused
from synthetic import RHO_C, XI, isotropic, material, regular_points, scene, state

from granular import Gravity, Simulation, State, scenes, theory
from granular.materials import glass_beads
from granular.measure import (
    density_drift,
    disconnected_fraction,
    energy,
    energy_budget,
    gap_fraction,
    ill_posed_fraction,
    layer_height,
    mean_pressure_error,
    occupied_area,
    speed_percentile,
    string_fraction,
)

CELL = 0.01


def pool(*, shape=(5, 20), gravity=None, **fields):
    """Points up to 0.1 m under hydrostatic pressure, or with the given fields."""
    s = scene(shape, CELL, gravity=gravity)
    s.walls = ()
    x = regular_points(s, 2, lambda x: x[:, -1] < 0.1 - 1e-9)
    stress = isotropic(RHO_C * 9.8 * (0.1 - x[:, -1]), len(shape))
    return state(s, x, **({"per_cell": 2 ** len(shape), "stress": stress} | fields))


def freed(free):
    points = pool()
    return pool(stress=np.where(free(points.x[:, 1])[:, None], 0.0, points.stress))


def test_what_is_not_bulk_does_not_count_as_disconnected():
    assert disconnected_fraction(pool()) == 0
    # the bulk is the eight rows of cells below 0.08, which hold sixteen rows of points
    assert disconnected_fraction(freed(lambda y: y > 0.08)) == 0
    row = freed(lambda y: np.isclose(y, 0.0525))
    assert disconnected_fraction(row) == pytest.approx(1 / 16)
    assert disconnected_fraction(row, depth_cells=0) == pytest.approx(1 / 20)
    assert disconnected_fraction(freed(lambda y: y < 1)) == 1
    # sprays and falling streams
    points = pool(shape=(5, 40))
    stream = regular_points(points.scene, 1, lambda x: (x[:, 1] > 0.15) & (x[:, 0] < 0.02))
    x = np.vstack([points.x, stream])
    stress = np.vstack([points.stress, np.zeros((len(stream), 4))])
    assert disconnected_fraction(state(points.scene, x, stress=stress)) == 0
    # the upper heap of an hourglass has its own surface
    s = scene((5, 40), CELL)
    x = regular_points(s, 2, lambda x: (x[:, 1] < 0.05) | ((x[:, 1] > 0.2) & (x[:, 1] < 0.25)))
    p = np.where((x[:, 1] > 0.23) | (x[:, 1] < 0.05) & (x[:, 1] > 0.03), 0.0, 100.0)
    assert disconnected_fraction(state(s, x, stress=isotropic(p))) == 0


def test_strings_and_gaps():
    # cells that are full and empty in turn are strings
    points = pool(shape=(12, 20))
    assert string_fraction(points) == 0
    drawn = points.x.copy()
    drawn[:, 0] -= CELL * (np.floor(drawn[:, 0] / CELL) % 2)  # the points of two cells in one
    assert string_fraction(state(points.scene, drawn, per_cell=4)) > 0.9
    between_walls = pool(shape=(2, 20))  # beyond the ends of the grid it goes on
    assert string_fraction(between_walls) == 0
    # gaps are empty cells in a stressed body
    points = pool()
    assert gap_fraction(points) == 0
    column = (points.x[:, 0] > 0.02) & (points.x[:, 0] < 0.03)
    torn = state(points.scene, points.x[~column], stress=points.stress[~column])
    assert gap_fraction(torn) == pytest.approx(10 / 40)
    calm = state(points.scene, points.x[~column])
    assert np.isnan(gap_fraction(calm))


def test_material_along_a_slope_takes_no_memory_for_the_box_around_it():
    """A line of cells through a square of 900 million."""
    s = scene((30_000, 30_000), CELL)
    s.walls = ()
    x = (np.arange(30_000)[:, None] + 0.5) * CELL + np.zeros((1, 2))
    line = state(s, x, per_cell=1)
    assert np.isnan(string_fraction(line)) and np.isnan(gap_fraction(line))
    with pytest.raises(ValueError, match="no point lies more than"):
        density_drift(line)
    assert density_drift(line, depth_cells=0, packed=0.0) == pytest.approx(0.0, abs=1e-3)


def test_speeds_areas_and_heights():
    points = pool()
    v = np.zeros((points.n, 2))
    v[0] = (3.0, 4.0)
    moving = state(points.scene, points.x, v=v)
    assert speed_percentile(moving, q=100) == pytest.approx(5)
    assert speed_percentile(moving, q=50) == 0
    assert occupied_area(points) == pytest.approx(0.05 * 0.1)
    spray = state(points.scene, np.vstack([points.x, [[0.005, 0.195]]]))
    assert occupied_area(spray) == pytest.approx(0.05 * 0.1 + CELL**2)
    assert occupied_area(spray, filled=0.5) == pytest.approx(0.05 * 0.1)
    assert layer_height(points) == pytest.approx(0.1)
    assert layer_height(points, base=-0.1) == pytest.approx(0.3)


@pytest.mark.parametrize("shape", [(5, 20), (3, 4, 20)])
def test_hydrostatic_pressure_has_no_error(shape):
    points = pool(shape=shape)
    assert mean_pressure_error(points) < 1e-12
    assert mean_pressure_error(points, of="pressure", per_column=True) < 1e-12
    assert mean_pressure_error(points, depth_cells=0) < 1e-12
    heavy = state(points.scene, points.x, stress=1.1 * points.stress, per_cell=2**points.dim)
    assert mean_pressure_error(heavy) == pytest.approx(0.1)


def test_columns_of_different_height_have_their_own_overburden():
    """A box at rest balances by its normal stress and not by its pressure."""
    points = pool()
    weight = points.pressure
    stress = isotropic(weight)
    # uniaxial strain: the sideways stress is nu/(1 - nu) of the weight, nu = 0.3
    stress[:, [0, 2]] *= 3 / 7
    rest = state(points.scene, points.x, stress=stress)
    assert mean_pressure_error(rest) < 1e-12
    assert mean_pressure_error(rest, of="pressure") == pytest.approx(1 - 13 / 21)
    s = scene((10, 20), CELL)
    height = 0.1
    x = regular_points(s, 2, lambda x: x[:, 1] < height + 0.05 * (x[:, 0] > 0.05))
    p = RHO_C * 9.8 * (height + 0.05 * (x[:, 0] > 0.05) - x[:, 1])
    heap = state(s, x, stress=isotropic(p))
    assert mean_pressure_error(heap, per_column=True) < 1e-12
    assert mean_pressure_error(heap) > 0.1


def test_density_drift_is_that_of_the_bulk():
    assert density_drift(pool()) == pytest.approx(0, abs=1e-12)
    # twice the mass at twice the density takes the same volume
    mass = RHO_C * CELL**2 / 2
    assert density_drift(pool(mass=mass, rho=2 * RHO_C)) == pytest.approx(0, abs=1e-12)
    # a point that was flung away has the volume of 10^5 cells
    rho = np.full(200, RHO_C)
    rho[90] = 1e-5 * RHO_C
    assert abs(density_drift(pool(rho=rho))) < 0.1
    points = pool()
    rho = np.where(points.x[:, 1] > 0.09, RHO_C / 2, RHO_C)  # the surface has become less dense
    assert density_drift(pool(rho=rho)) == pytest.approx(0, abs=1e-12)
    assert density_drift(pool(rho=rho), depth_cells=0) > 0.01


@pytest.mark.parametrize("factor", [1.5, 3.0])
def test_drift_is_point_volume_over_available_volume(factor):
    """A layer collapsed to 1/factor of its height, while its particle density has not changed."""
    compressed = pool(mass=factor * RHO_C * CELL**2 / 4)
    assert density_drift(compressed) == pytest.approx(factor - 1)


def test_uneven_particles_of_sph_have_not_collapsed_into_one_another():
    """Empty cells between particles count: without them this bed seems to lose 0.2 of its volume.
    Of the slump without a spring, particles lie in strings while it creeps."""
    slump = scenes.slump_sph(
        phi_deg=30.0, length=0.3, height=0.15, orifice=0.06, settle=0.4, duration=1.0
    )
    creeping = slump.replace(material=slump.material.replace(nu=0.5))
    bed = Simulation(creeping, threads=1).run(monitor=False).state
    assert abs(density_drift(bed)) < 0.05
    fields = bed.fields | {"x": bed.x * (1.0, 0.7)}
    fallen = State(scene=creeping, time=bed.time, step=bed.step, dt=bed.dt, fields=fields)
    assert density_drift(fallen) > 0.2


def test_disconnected_flight_is_not_a_lost_contact():
    """At 0.8 rho_c a body is rightly free of stress, whatever its size; at rho_c it is not."""
    flying = pool(mass=0.8 * RHO_C * CELL**2 / 4, rho=0.8 * RHO_C, stress=np.zeros((800, 4))[:200])
    assert disconnected_fraction(flying) == 1
    with pytest.raises(ValueError, match=r"packed = 0\.9"):
        disconnected_fraction(flying, packed=0.9)
    dense = pool(stress=np.zeros((200, 4)))
    assert disconnected_fraction(dense, packed=0.9) == 1
    assert disconnected_fraction(dense, packed=0.9, pressed=1.0) == 0  # nothing is pressed about it


def test_ill_posed_fraction_counts_flowing_mass():
    low, high = theory.well_posed_range(glass_beads)
    scaled = np.array([1e-4, low * 0.9, low * 1.1, high * 0.9, high * 1.1, 1.0])
    s = scene((5, 20), CELL)
    x = np.linspace(0.001, 0.04, 12).reshape(6, 2)
    p = np.array([100.0, 100, 100, 100, 100, 0])  # the last point is free of stress
    rate = scaled * XI * np.sqrt(100.0)
    points = state(s, x, mass=[9.0, 1, 2, 3, 4, 9], shear_rate=rate, stress=isotropic(p))
    # the first does not flow; of mass 1 + 2 + 3 + 4, that below and above the range is ill posed
    assert ill_posed_fraction(points) == pytest.approx(5 / 10)
    still = state(s, x, shear_rate=0.0, stress=isotropic(p))
    assert np.isnan(ill_posed_fraction(still))


def test_bad_health_and_budgets_are_refused():
    points = pool()
    for measure in (disconnected_fraction, mean_pressure_error, density_drift):
        with pytest.raises(ValueError, match="depth_cells = 30"):
            measure(points, depth_cells=30)
    refused(
        ("packed = -1", lambda: density_drift(points, packed=-1.0)),
        ("must be negative", lambda: mean_pressure_error(pool(gravity=(0.0, 0.0)))),
        ("of = 'shear'", lambda: mean_pressure_error(points, of="shear")),
        ("q = -1", lambda: speed_percentile(points, q=-1.0)),
    )
    for measure in (disconnected_fraction, speed_percentile, layer_height, energy):
        with pytest.raises(ValueError, match="0 points"):
            measure(state(points.scene, np.empty((0, 2))))
    one = fall(np.arange(2), [0.0], scene((1, 10), 1.0))
    with pytest.raises(ValueError, match="1 frame"):
        energy_budget(one)
    with pytest.raises(ValueError, match="0 frames"):
        energy_budget([])


def test_the_energies_of_one_point_in_2d_and_3d():
    s = scene((4, 4), 1.0)
    stress = [[-3000.0, -6000.0, -3000.0, 2000.0]]
    one = state(s, [[1.0, 2.0]], mass=3.0, v=[[3.0, 4.0]], stress=stress, rho=1500.0)
    result = energy(one)
    assert result.kinetic == pytest.approx(3 * 25 / 2)
    assert result.gravitational == pytest.approx(3 * 9.8 * 2)
    # the compliance of Hooke's law: (s_ij s_ij (1 + nu) - nu (tr s)^2)/(2 E), by hand
    E, nu = 1e7, 0.3
    square, trace = 9e6 + 36e6 + 9e6 + 2 * 4e6, -12000.0
    density = ((1 + nu) * square - nu * trace**2) / (2 * E)
    assert result.elastic == pytest.approx(3 / 1500 * density, rel=1e-12)
    assert result.total == result.kinetic + result.gravitational + result.elastic
    s = scene((1, 1, 1), 1.0, grains=material())
    one = state(s, [[0.5] * 3], mass=1500.0, stress=[[0, 0, 0, 1e3, 2e3, 2e3]])
    assert energy(one).elastic == pytest.approx(9e6 / (2 * s.material.G))


def fall(ids, times, s):
    frames = []
    for t in times:
        x = np.stack([0.5 + 0 * ids, 9 - 4.9 * t**2 - 0.1 * ids], axis=1)
        v = np.tile([0.0, -9.8 * t], (len(ids), 1))
        frames.append(state(s, x, mass=2.0, v=v, time=t, ids=ids))
    return frames


def test_free_fall_dissipates_nothing():
    frames = fall(np.arange(5), np.linspace(0, 1, 6), scene((1, 10), 1.0))
    budget = energy_budget(frames)
    assert budget.gravity_work[-1] == pytest.approx(5 * 2 * 9.8 * 4.9)
    assert np.allclose(budget.kinetic, budget.gravity_work)
    assert np.abs(budget.dissipated).max() < 1e-10
    totals = [energy(frame).total for frame in frames]
    assert np.allclose(totals, totals[0])


@pytest.mark.parametrize(("times", "error"), [([0.0, 0.2], 1e-12), ([0.0, 0.5], 0.02)])
def test_work_of_a_gravity_that_is_switched_on(times, error):
    """A free fall from rest while gravity grows to 9.8 m/s2 in 0.2 s, and beyond."""
    s = scene((1, 10), 1.0)
    s.gravity = Gravity((0.0, 0.2), ((0.0, 0.0), (0.0, -9.8)))
    frames = []
    for t in times:
        ramp, after = min(t, 0.2), max(t - 0.2, 0.0)
        v = 9.8 * (ramp**2 / 0.4 + after)
        fallen = 9.8 * (ramp**3 / 1.2 + 0.1 * after + after**2 / 2)
        frames.append(state(s, [[0.5, 9 - fallen]], mass=2.0, v=[[0.0, -v]], time=t))
    budget = energy_budget(frames)
    assert budget.gravity_work[-1] == pytest.approx(budget.kinetic[-1], rel=error)


def test_what_leaves_stops_or_wraps_around_in_the_budget():
    s = scene((1, 10), 1.0)
    first, second = fall(np.arange(5), [0.5, 1.0], s)
    kept = fall(np.arange(1, 5), [1.0], s)[0]
    budget = energy_budget([first, kept])
    assert budget.outflow[-1] == pytest.approx(2 * (9.8 * 0.5) ** 2 / 2)
    assert budget.dissipated[-1] == pytest.approx(0, abs=1e-10)
    second.v = np.zeros_like(second.v)
    assert energy_budget([first, second]).dissipated[-1] == pytest.approx(5 * 2 * 9.8 * 4.9)
    # work along a periodic axis survives the wrap
    s = scene((1, 4), 1.0, periodic=(True, False), gravity=(5.0, -9.0))
    frames = [
        state(s, [[(0.3 + 2.5 * t**2) % 1.0, 1.0]], mass=2.0, v=[[5 * t, 0.0]], time=t)
        for t in np.linspace(0, 2, 5)
    ]
    budget = energy_budget(frames)
    assert np.allclose(budget.gravity_work, budget.kinetic)
    assert np.abs(budget.dissipated).max() < 1e-10
    assert energy(frames[-1]).gravitational == pytest.approx(2 * 9 * 1.0)

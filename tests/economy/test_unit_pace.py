"""The estimated time of a step: what it depends on, and how."""

import pytest
from scenes_by_hand import scene_with

import granular as gr
from granular.economy import cost, pace


@pytest.fixture(autouse=True)
def machine(monkeypatch):
    """A machine that is as fast as that of the table."""
    monkeypatch.setattr(pace, "slowness", lambda: 1.0)


def bed(per_cell=4, cells=(40, 10), **parts):
    grid = gr.Grid((0.0, 0.0), 0.025, (cells[0], cells[1] + 8))
    region = gr.Box((0.0, 0.0), tuple(n * 0.025 for n in cells))
    given = {"fills": (gr.Fill(region, per_cell),), "walls": (gr.Wall(1, 0.0),)}
    return scene_with(grid=grid, **given | parts)


def each(scene):
    found = cost(scene)
    return 1e9 * found.seconds / found.point_steps


def test_times_between_the_measured_ones_are_linear_in_cells_per_point_and_in_the_log_of_points():
    scheme, table = gr.schemes.default, pace._measured()["2"]["default"]
    (few, first), (_, second) = table["4"][:2]
    (least, ns), *_ = table["16"]
    between = pace.nanoseconds(scheme, 2, (few * table["4"][1][0]) ** 0.5, 4)
    assert between == pytest.approx((first + second) / 2, rel=1e-12)
    # 6.4 in a cell are half-way in cells per point; fewer points than were measured are as many
    points = min(few, least) / 2
    assert pace.nanoseconds(scheme, 2, points, 6.4) == pytest.approx((first + ns) / 2, rel=1e-12)
    one = pace.nanoseconds(scheme, 2, points, 1)
    assert one - first == pytest.approx(4 * (first - ns), rel=1e-12)  # three cells more, not 3/4


def test_what_was_not_measured_is_estimated_from_what_is_like_it():
    xpic = gr.Scheme(basis="linear", transfer="xpic")
    flip = pace.nanoseconds(xpic.replace(transfer="flip"), 3)
    assert pace.nanoseconds(xpic, 3) == pytest.approx(pace._CARRIED * flip)
    apic = gr.Scheme(basis="quadratic", transfer="apic")
    default = gr.schemes.default
    times = [
        pace.nanoseconds(scheme.replace(precision=precision), 2)
        for scheme in (apic, default)
        for precision in ("single", "double")
    ]
    assert times[0] / times[1] == pytest.approx(times[2] / times[3])
    averaged = gr.schemes.cell_averaged
    assert pace.nanoseconds(averaged, 2) < pace.nanoseconds(default, 2)


def test_bodies_take_time_for_contact_and_for_their_motion():
    still = gr.Body(gr.HalfSpace((0.0, 1.0)), (0.0, 0.1))
    fills = (gr.Fill(gr.Box((0.0, 0.1), (1.0, 0.3)), 4),)
    lid = gr.Box(size=(0.5, 0.05), center=(0.0, 0.0))
    moving = gr.Body(lid, (0.5, 0.36), motion=gr.Motion(velocity=(0.0, -0.1)))
    ball, spin = gr.Sphere(0.05, center=(0.0, 0.0)), gr.Motion(angular_velocity=1.0)
    turning = gr.Body(ball, (0.5, 0.37), motion=spin)
    times = [
        cost(bed(fills=fills, bodies=bodies)).seconds
        for bodies in ((), (still,), (still, turning), (still, moving))
    ]
    assert times[0] < times[1] < times[3]
    assert times[2] == pytest.approx(times[1], rel=0.05)  # a ball that turns takes the same space


def test_laws_of_ones_own_take_the_time_of_their_language():
    def law(dt, parameters, gradient, log_density, stress, shear_rate, history):
        stress[:] = 0.0

    own = gr.materials.from_function(law, E=1e6)
    assert each(bed(material=own)) - each(bed()) == pytest.approx(400.0, rel=1e-6)


def test_the_machine_is_measured_once(monkeypatch):
    monkeypatch.undo()
    first = pace.slowness()
    assert first == pace.slowness() and 0.2 < first < 20.0

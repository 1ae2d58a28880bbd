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


def test_fewer_points_in_a_cell_take_longer_each_and_more_so_out_of_the_cache():
    """As measured by `python benchmarks pace`, within a fifth."""
    small = {count: each(bed(count, (56, 56))) for count in (4, 16)}
    assert small[4] == pytest.approx(44.0, rel=0.2) and small[16] == pytest.approx(28.0, rel=0.2)
    large = each(bed(4, (320, 160)))
    assert 1.8 < large / small[4] < 2.6


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

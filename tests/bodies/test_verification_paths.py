"""Motions through given positions, from arrays and from files; wheels with grousers."""

import numpy as np
import pytest
from scenes_by_hand import scene_with

import granular as gr

TIMES = np.array([0.0, 0.013, 0.05, 0.08, 0.11])
PLANE = np.array([[0.2, 0.3], [0.21, 0.28], [0.3, 0.25], [0.3, 0.25], [0.27, 0.31]])
ANGLES = np.array([0.0, 30.0, 200.0, 400.0, 380.0])


def moved(motion, dim, start):
    """Position and rotation of a body with this motion at the steps nearest to `TIMES`."""
    grid = gr.Grid((0.0,) * dim, 0.05, (12,) * dim)
    fill = gr.Fill(gr.Box((0.0,) * dim, (0.05,) * dim), 1)
    body = gr.Body(gr.Sphere(0.03, center=(0.0,) * dim), tuple(start), motion=motion)
    scene = scene_with(grid=grid, fills=(fill,), bodies=(body,), gravity=0.0, duration=0.2)
    scene = scene.replace(scheme=scene.scheme.replace(dt=1e-4))
    sim, found = gr.Simulation(scene), []
    for time in TIMES:
        if time:
            sim.step(round(time / 1e-4) - sim.steps)
        (state,) = sim.bodies
        found.append((sim.time, state.position, state.rotation))
    sim.run(until=0.19)
    return found, sim.bodies[0]


@pytest.mark.parametrize("dim", [2, 3])
@pytest.mark.parametrize("stops", [True, False])
def test_a_body_meets_the_positions_of_its_path(dim, stops):
    places = PLANE if dim == 2 else np.insert(PLANE, 1, 0.3, axis=1)
    motion = gr.Motion.through(TIMES, places, angles_deg=ANGLES, stops=stops)
    found, end = moved(motion, dim, places[0])
    assert [time for time, *_ in found] == pytest.approx(list(TIMES), abs=1e-12)
    for (_, position, rotation), wanted, angle in zip(found, places, ANGLES, strict=True):
        np.testing.assert_allclose(position, wanted, atol=1e-13)
        cosine, sine = np.cos(np.radians(angle)), np.sin(np.radians(angle))
        turned = [[cosine, -sine], [sine, cosine]]
        if dim == 3:  # about y
            turned = [[cosine, 0, sine], [0, 1, 0], [-sine, 0, cosine]]
        np.testing.assert_allclose(rotation, turned, atol=1e-12)
    still = np.allclose(end.position, places[-1], atol=1e-13)
    assert still == stops


def test_a_path_does_not_turn_back_between_its_positions():
    rng = np.random.default_rng(1)
    for _ in range(50):
        times = np.cumsum(rng.uniform(0.01, 1.0, 8))
        motion = gr.Motion.through(times, rng.normal(size=(8, 2)), stops=rng.random() < 0.5)
        knots, velocity = np.array(motion.times), np.array(motion.velocity)
        steps = np.diff(knots)[:, None] * (velocity[:-1] + velocity[1:]) / 2
        whole = np.sign(steps[::2] + steps[1::2])
        assert np.all(whole * velocity[1::2] >= -1e-12)  # in the middle
        assert np.all(whole * velocity[:-1:2] >= -1e-12)  # and at both ends
        assert np.all(whole * velocity[2::2] >= -1e-12)


def test_a_path_from_a_file_is_that_of_its_arrays(tmp_path):
    path = tmp_path / "path.csv"
    lines = [f"{t},{a},{x},{y}" for t, (x, y), a in zip(TIMES, PLANE, ANGLES, strict=True)]
    path.write_text("\n".join(["# a remark", "Time [s],angle [deg], x [m],y [m]", *lines]))
    assert gr.Motion.read(path) == gr.Motion.through(TIMES, PLANE, angles_deg=ANGLES)
    assert gr.Motion.read(path, stops=False) != gr.Motion.read(path)


def test_units_and_separators_of_spreadsheets_are_understood(tmp_path):
    path = tmp_path / "path.csv"
    lines = [
        f"{1e3 * t:.17g};{np.radians(a):.17g};{1e3 * x:.17g};{1e2 * y:.17g}".replace(".", ",")
        for t, (x, y), a in zip(TIMES, PLANE, ANGLES, strict=True)
    ]
    path.write_text("\n".join(["t [ms];angle [rad];x [mm];y [cm]", *lines]))
    read, known = gr.Motion.read(path), gr.Motion.through(TIMES, PLANE, angles_deg=ANGLES)
    for name in ("times", "velocity", "angular_velocity"):
        np.testing.assert_allclose(
            getattr(read, name), getattr(known, name), rtol=1e-12, atol=1e-12
        )


@pytest.mark.parametrize("axis", [None, (0.0, 1.0, 0.0), (1.0, 0.0, -1.0)], ids=["2D", "y", "xz"])
def test_the_recorded_path_of_a_body_can_be_read(tmp_path, axis):
    """It moves and turns as in the record, by more than a whole turn."""
    dim = 2 if axis is None else 3
    places = np.array(PLANE) if dim == 2 else np.insert(PLANE, 1, 0.3, axis=1)
    turns = 5.0 * np.array(ANGLES)
    options = {} if axis is None else {"axis": axis}
    motion = gr.Motion.through(TIMES, places, angles_deg=turns, **options)
    grid = gr.Grid((0.0,) * dim, 0.05, (12,) * dim)
    fill = gr.Fill(gr.Box((0.0,) * dim, (0.05,) * dim), 1)
    body = gr.Body(gr.Box(size=(0.1,) * dim), tuple(places[0]), motion=motion)
    scene = scene_with(grid=grid, fills=(fill,), bodies=(body,), duration=float(TIMES[-1]))
    gr.Simulation(scene).run(save=tmp_path / "a.h5", every=0.002)
    gr.measure.body_motion(gr.open(tmp_path / "a.h5")).to_csv(tmp_path / "path.csv")
    again = scene.replace(bodies=(body.replace(motion=gr.Motion.read(tmp_path / "path.csv")),))
    one, other = gr.Simulation(scene), gr.Simulation(again)
    fastest = 2 * np.max(np.abs(motion.velocity)), 2 * np.max(np.abs(motion.angular_velocity))
    for time in np.linspace(0.0, scene.duration, 12)[1:]:
        poses = [sim.run(until=float(time), monitor=False).bodies[0] for sim in (one, other)]
        apart = abs(one.time - other.time)  # by a part of a step
        # Between two frames the paths differ by the second order of 2 ms.
        np.testing.assert_allclose(
            poses[1].position, poses[0].position, atol=1e-4 + fastest[0] * apart
        )
        np.testing.assert_allclose(
            poses[1].rotation, poses[0].rotation, atol=2e-3 + fastest[1] * apart
        )


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("time,x\n0,0\n1,1\n", "column y is missing"),
        ("x,y\n0,0\n1,1\n", "column time is missing"),
        ("time,x,y\n0,0,0\n", "at least two"),
        ("time,x,y\n0,0,0\n1,a,0\n", "column 'x' must have a number in each row"),
        ("time,x,y\n0,0,0\n1,1\n", "column 'y' must have a number in each row"),
        ("time,x,y\n0,0,0\n0,1,1\n", "times"),
        ("time,x,y\n0,0,nan\n1,1,1\n", "positions"),
        ("time [h],x,y\n0,0,0\n1,1,1\n", r"'time \[h\]' must have one of the units s, ms, min"),
        ("time,x [in],y\n0,0,0\n1,1,1\n", r"'x \[in\]' must have one of the units m, cm, mm"),
        ("time,x,y,angle [turns]\n0,0,0,0\n1,1,1,1\n", "one of the units deg, °, rad"),
        ("time,x,y,position_x\n0,0,0,0\n1,1,1,1\n", "must be the only one of x"),
        (
            "time,x,y,z,quaternion_w,quaternion_x,quaternion_y,quaternion_z\n"
            "0,0,0,0,1,0,0,0\n1,1,1,0,0.8,0.6,0,0\n2,1,1,0,0.8,0,0.6,0\n",
            "about several axes",
        ),
    ],
)
def test_bad_files_of_paths_are_named(tmp_path, text, message):
    (tmp_path / "p.csv").write_text(text)
    with pytest.raises(ValueError, match=message):
        gr.Motion.read(tmp_path / "p.csv")
    with pytest.raises(FileNotFoundError):
        gr.Motion.read(tmp_path / "none.csv")


@pytest.mark.parametrize(
    ("arguments", "options", "message"),
    [
        (((0.0,), [[0.0, 0.0]]), {}, "must be at least two"),
        (((0.0, 1.0), [[0.0], [1.0]]), {}, "positions has shape"),
        (((0.0, 1.0), PLANE), {}, "positions"),
        ((TIMES, PLANE), {"angles_deg": [0.0]}, "angles_deg"),
        ((TIMES, PLANE), {"axis": (0.0, 0.0, 0.0)}, "axis = .* must not be zero"),
        ((-TIMES, PLANE), {}, "times"),
    ],
)
def test_bad_paths_are_named(arguments, options, message):
    with pytest.raises(ValueError, match=message):
        gr.Motion.through(*arguments, **options)


def test_constant_motions_need_no_list_of_times():
    assert gr.Motion(velocity=(0, 1)) == gr.Motion(velocity=((0.0, 1.0),))
    assert gr.Motion(angular_velocity=2) == gr.Motion(angular_velocity=(2.0,))
    turning = gr.Motion(velocity=(0, 0, 1), angular_velocity=(0, 2, 0))
    assert turning == gr.Motion(velocity=((0, 0, 1),), angular_velocity=((0, 2, 0),))
    with pytest.raises(ValueError, match=r"velocity = \(0, 1\) must be one value for each of the"):
        gr.Motion(times=(0, 1), velocity=(0, 1))


@pytest.mark.parametrize("dim", [2, 3])
def test_a_wheel_with_grousers(dim):
    """Their area is that of the sectors beyond the tread; the first one points downwards."""
    radius, height, thick, count = 0.2, 0.05, 0.03, 8
    shape = gr.shapes.wheel(
        radius, 0.1 if dim == 3 else None, grousers=count, height=height, thickness=thick
    )
    assert shape.bounds[0][-1] == pytest.approx(-radius - height)
    rng = np.random.default_rng(2)
    x = rng.uniform(-0.3, 0.3, (200_000, dim))
    if dim == 3:
        x[:, 1] = 0.0
    inside = shape.distance(x)[0] < 0
    area = inside.mean() * 0.36
    bar, step = np.linspace(-thick / 2, thick / 2, 1001, retstep=True)
    beyond = np.sum(radius + height - np.sqrt(radius**2 - bar**2)) * step
    assert area == pytest.approx(np.pi * radius**2 + count * beyond, rel=0.01)
    assert gr.shapes.wheel(radius) == gr.Cylinder(radius, center=(0.0, 0.0))
    for bad in (
        {"grousers": 4},
        {"height": 0.1},
        {"grousers": -1},
        {"grousers": 100, "height": 0.1, "thickness": 0.05},
        {"width": 0.0},
    ):
        with pytest.raises(ValueError):
            gr.shapes.wheel(radius, **bad)

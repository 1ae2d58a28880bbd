"""Rigid bodies in pictures: outlines against closed forms, poses, sections, domains."""

import numpy as np
import pytest
from matplotlib.figure import Figure
from scenes_by_hand import scene_with

import granular as gr
from granular import Body, Box, Cylinder, HalfSpace, Motion, Polygon, Sphere, plot
from granular.plot.bodies import Bodies, boxes_of_bodies
from granular.plot.canvas import View

EXTENT = ((0.0, 1.0), (0.0, 1.0))


def scene_of(*bodies, dim=2, **options):
    grid = gr.Grid((0.0,) * dim, 0.05, (20,) * dim, **options)
    corner = gr.Box((0.4,) * dim, (0.6,) * dim)
    return scene_with(
        grid=grid, fills=[gr.Fill(corner, 4 if dim == 2 else 8)], bodies=bodies,
        material=gr.MuI(E=1e5),
    )  # fmt: skip


def start(scene):
    """State at the start, of positions only."""
    return gr.State(scene=scene, time=0.0, step=0, dt=1.0, fields={"x": scene.points().x})


def drawing(state, view, extent):
    return Bodies(Figure().add_subplot(), state.scene, state.bodies, view, extent)


def areas(state, view=None, extent=EXTENT):
    """Area of each body in the extent, from its outline with holes."""
    drawn = drawing(state, view or View(state.dim), extent)
    return [area_of(artist.get_path()) for artist in drawn.artists]


def area_of(path):
    """Area by the trapezium rule; holes run the other way round and count as negative."""
    found = 0.0
    for x in path.to_polygons():
        found += 0.5 * float(np.sum(x[:-1, 0] * x[1:, 1] - x[1:, 0] * x[:-1, 1]))
    return found


def test_outlines_of_solids_drums_and_what_fills_half_the_space():
    triangle = Polygon(((0.0, 0.0), (0.3, 0.0), (0.0, 0.2)))
    drum = Cylinder(0.45, center=(0.0, 0.0), inside=True)
    floor = HalfSpace((0.0, 1.0))
    scene = scene_of(
        Body(Box(size=(0.1, 0.2)), (0.2, 0.2), rotation_deg=30.0), Body(triangle, (0.65, 0.05)),
        Body(drum, (0.5, 0.5)), Body(floor, (0.0, 0.13)),
    )  # fmt: skip
    expected = [0.02, 0.03, 1 - np.pi * 0.45**2, 0.13]
    assert areas(start(scene)) == pytest.approx(expected, abs=8e-3)
    # a thin blade is still seen
    (area,) = areas(start(scene_of(Body(Box(size=(1e-5, 0.5)), (0.203, 0.5)))))
    assert 0.0005 < area < 0.003
    # a body across a periodic side is seen on both
    scene = scene_of(Body(Cylinder(0.1, center=(0.0, 0.0)), (1.0, 0.2)), periodic=(True, False))
    (area,) = areas(start(scene))
    assert area == pytest.approx(np.pi * 0.1**2, rel=0.03)


def test_bodies_are_where_they_are_at_the_time():
    gate = Motion(velocity=((0.0, 2.0),), angular_velocity=(3.0,))
    scene = scene_of(
        Body(Box(size=(0.1, 0.3)), (0.2, 0.3), motion=gate), Body(Box(size=(0.1, 0.1)), (0.8, 0.2))
    )
    sim = gr.Simulation(scene, threads=1)
    drawn = drawing(sim.state, View(2), EXTENT)
    kept = [artist.get_path() for artist in drawn.artists]
    sim.run(until=0.1)
    drawn.update(sim.state.bodies)
    moved, still = (artist.get_path() for artist in drawn.artists)
    assert still is kept[1]  # made once
    middle = moved.vertices[:-1].mean(axis=0)
    assert middle == pytest.approx([0.2, 0.3 + 2.0 * sim.time], abs=0.005)
    tall = np.ptp(moved.vertices[:, 1])
    turn = 3.0 * sim.time
    assert tall == pytest.approx(0.3 * np.cos(turn) + 0.1 * np.sin(turn), abs=0.003)


def test_a_record_has_the_bodies_of_its_frames(tmp_path):
    slide = Motion(velocity=((0.5, 0.0),), angular_velocity=(1.0,))
    sim = gr.Simulation(scene_of(Body(Box(size=(0.1, 0.1)), (0.2, 0.8), motion=slide)), threads=1)
    seen = []
    sim.run(
        until=0.1,
        every=0.05,
        save=tmp_path / "a.h5",
        hooks=(lambda s: seen.append(s.state.bodies),),
    )
    for state, (body,) in zip(gr.open(tmp_path / "a.h5"), seen, strict=True):
        (found,) = state.bodies
        for name in ("position", "rotation", "velocity", "impulse"):
            assert np.array_equal(getattr(found, name), getattr(body, name))
    assert seen[0][0].position[0] < seen[-1][0].position[0] - 0.04
    with pytest.raises(ValueError, match="bodies: 2 must be as many"):
        gr.State(
            scene=sim.scene, time=0, step=0, dt=1, fields=state.fields, bodies=2 * state.bodies
        )


def test_the_section_of_a_ball_is_halfway_through_the_slab():
    scene = scene_of(Body(Sphere(0.2, center=(0.0, 0.0, 0.0)), (0.2, 0.5, 0.2)), dim=3)
    state = start(scene)
    for slab, radius in (
        ((0.5, 0.5001), 0.2),
        ((0.2, 0.5), np.sqrt(0.2**2 - 0.15**2)),
        (None, 0.2),
    ):
        (area,) = areas(state, View(3, (0, 2), slab))
        assert area == pytest.approx(np.pi * radius**2, abs=2e-3)
    assert areas(state, View(3, (0, 2), (0.9, 1.0))) == [0.0]


def test_a_picture_shows_all_of_a_body_that_closes_within_the_domain():
    drum = Body(Cylinder(0.45, center=(0.0, 0.0), inside=True), (0.5, 0.5))
    state = start(scene_of(drum, Body(HalfSpace((0.0, 1.0)), (0.0, 0.1))))
    (box,) = boxes_of_bodies(state.scene, state.bodies, View(2))
    assert np.ravel(box) == pytest.approx([0.05, 0.95, 0.05, 0.95], abs=0.005)
    ax = plot.frame(gr.Simulation(state.scene, threads=1).state).axes[0]
    assert ax.get_xlim()[0] < 0.05 < 0.95 < ax.get_xlim()[1]


def test_pixels_of_a_body_are_grey_in_pictures_and_movies(tmp_path):
    fall = Motion(velocity=((0.0, -1.0),))
    sim = gr.Simulation(scene_of(Body(Box(size=(0.3, 0.2)), (0.2, 0.8), motion=fall)), threads=1)
    states = [sim.state, sim.run(until=0.3).state]
    heights = []
    from PIL import Image

    with Image.open(plot.movie(states, tmp_path / "a.gif", extent=EXTENT)) as gif:
        for k in range(2):
            gif.seek(k)
            picture = np.asarray(gif.convert("RGB")).astype(int)
            grey = (abs(picture - [0xD5, 0xD8, 0xDC]) < 6).all(axis=2)
            heights.append(np.nonzero(grey)[0].mean())
            assert grey.sum() > 1000
    pixel = 500 / 1.0  # the axes are some 500 pixels wide
    assert heights[1] - heights[0] == pytest.approx(0.3 * pixel, rel=0.15)

"""3D pictures: their content for a state, a run and a record, and refused input."""

import sys

import matplotlib.image
import numpy as np
import pytest
from PIL import Image

import granular as gr
from granular.plot import view_3d
from granular.plot.fields import Brush
from granular.plot.volume import filled_volume


@pytest.fixture(scope="module")
def sim():
    scene = gr.scenes.excavation(
        width=0.05, blade=(0.05, 0.05, 0.457), length=0.6, cell=0.025, travel=0.05, speed=0.2,
        dive_speed=0.1, settle=0.02, ramp=0.01, start=0.2,
    )  # fmt: skip
    sim = gr.Simulation(scene, threads=1)
    sim.step(3)
    return sim


def pixels(path):
    return matplotlib.image.imread(path)[..., :3]


def parts(picture):
    """Fractions of the picture covered by bodies (grey in any light) and points (coloured)."""
    low, high = picture.min(axis=2), picture.max(axis=2)
    grey = (high - low < 0.06) & (high < 0.85) & (low > 0.2)
    return grey.mean(), (high - low > 0.15).mean()


def test_material_and_bodies_are_there(sim, tmp_path):
    pytest.importorskip("pyvista")
    shares, alone = {}, gr.Simulation(sim.scene.replace(bodies=()), threads=1)
    for name, source, options in (
        ("all", sim, {}),
        ("state", sim.state, {}),
        ("no bodies", alone, {}),
        ("clear", sim, {"opacity": 0.0}),
        ("points", sim, {"style": "points"}),
        ("slice", sim, {"slab": ("x", 0.0, 0.2)}),
    ):
        path = gr.plot.view(
            source, tmp_path / "a.png", "pressure", camera="xz", window=(320, 240), **options
        )
        picture = pixels(path)
        assert picture.shape == (240, 320, 3)
        shares[name] = parts(picture)
    assert shares["all"] == shares["state"]
    for less in ("no bodies", "clear"):
        assert shares["all"][0] > shares[less][0] + 0.01
    assert shares["all"][1] > 0.05
    assert shares["points"][1] == pytest.approx(shares["all"][1], rel=0.3)
    assert shares["slice"][1] < 0.8 * shares["all"][1]


def test_the_surface_of_a_cylinder_is_where_its_volume_says():
    pytest.importorskip("pyvista")
    errors = []
    for cell in (0.04, 0.02):
        start = alone_at(gr.Simulation(gr.scenes.cylinder_collapse(cell=cell), threads=1), 0.0)
        values = np.full(start.n, 7.0)
        brush = Brush.fitted([start], values, limits=(0.0, 10.0))
        mesh = filled_volume(start, values, brush, None)
        errors.append(1 - mesh.volume / start.volume.sum())
    assert 0 < errors[1] < 0.025
    assert errors[0] / errors[1] > 2**1.7  # second order: edges are rounded
    sides = np.array([[0.0, 0.2], [0.0, 0.2], [0.0, 0.1]])
    assert np.reshape(mesh.bounds, (3, 2)) == pytest.approx(sides, abs=1e-3)
    assert np.asarray(mesh[brush.quantity.title]) == pytest.approx(7.0)
    top = 0.1
    low = filled_volume(start, values, brush, ("z", 0.0, 0.5 * top))
    assert low.bounds[5] == pytest.approx(0.5 * top)
    assert low.bounds[:4:2] == pytest.approx(mesh.bounds[:4:2])
    assert filled_volume(start, start.mass, brush, ("z", 5 * top, 6 * top)) is None


def test_a_movie_has_a_picture_for_each_state(sim, tmp_path):
    pytest.importorskip("pyvista")
    states = [sim.state, alone_at(sim, 0.05), alone_at(sim, 0.1)]
    made = gr.plot.view_movie(states, tmp_path / "a.gif", "speed", window=(161, 120))
    with Image.open(made) as gif:
        assert gif.size == (160, 120)
        seen = []
        for k in range(gif.n_frames):
            gif.seek(k)
            seen.append(np.asarray(gif.convert("RGB")))
    assert len(seen) == 3
    assert not np.array_equal(seen[0], seen[2])
    with pytest.raises(FileExistsError):
        gr.plot.view_movie(states, tmp_path / "a.gif")
    with pytest.raises(ValueError, match="0 frames"):
        gr.plot.view_movie([], tmp_path / "b.gif")


def alone_at(sim, time):
    """A state of the same scene, with its material lifted and a later time."""
    state = sim.state
    fields = {name: array.copy() for name, array in state.fields.items()}
    fields["x"][:, 2] += time
    return gr.State(scene=state.scene, time=time, step=1, dt=1e-4, fields=fields)


def test_a_record_shows_its_bodies_where_they_were(tmp_path):
    pytest.importorskip("pyvista")
    scene = gr.scenes.excavation(
        width=0.1, blade=(0.05, 0.1, 0.3), length=0.6, cell=0.05, travel=0.1, speed=0.5, soil=0.15,
        dive_speed=0.5, settle=0.02, ramp=0.01, start=0.2, headroom=0.35,
    )  # fmt: skip
    sim = gr.Simulation(scene, threads=1)
    sim.run(until=0.3, save=tmp_path / "run.h5", every=0.3, monitor=False)
    record = gr.open(tmp_path / "run.h5")
    first, last, now = (
        pixels(gr.plot.view(source, tmp_path / "x.png", "mass", window=(200, 200), **options))
        for source, options in ((record, {"frame": 0}), (record, {}), (sim, {}))
    )
    assert np.array_equal(last, now)
    assert np.mean(np.any(abs(first - last) > 0.1, axis=2)) > 0.01


@pytest.mark.parametrize(
    ("options", "error", "message"),
    [
        ({"slab": ("w", 0.0, 1.0)}, ValueError, r"slab\[0\] = 'w'"),
        ({"slab": ("x", 1.0, 0.0)}, ValueError, "must ascend"),
        ({"camera": "up"}, ValueError, "camera = 'up'"),
        ({"camera": (0.0, 0.0, 0.0)}, ValueError, "camera = "),
        ({"window": (3, 100)}, ValueError, r"window\[0\] = 3"),
        ({"style": "fog"}, ValueError, "style = 'fog'"),
        ({"opacity": 2.0}, ValueError, "opacity = 2.0"),
        ({"color": "none"}, ValueError, "color = 'none'"),
    ],
)
def test_bad_arguments_are_named(sim, tmp_path, options, error, message):
    pytest.importorskip("pyvista")
    with pytest.raises(error, match=message):
        gr.plot.view(sim, tmp_path / "x.png", **options)


def test_runs_and_records_have_the_view(sim, tmp_path, monkeypatch):
    pyvista = pytest.importorskip("pyvista")
    options = {"color": "pressure", "window": (160, 120)}
    drawn = pixels(gr.plot.view(sim, tmp_path / "a.png", **options))
    assert np.array_equal(pixels(gr.plot.view(sim.state, tmp_path / "b.png", **options)), drawn)
    copy = gr.Simulation(sim.scene, threads=1).run(
        until=sim.dt, save=tmp_path / "r.h5", every=sim.dt, monitor=False
    )
    record, first = gr.open(copy.record), gr.Simulation(sim.scene, threads=1)
    for frame, source in ((0, first), (-1, copy)):
        shown = pixels(gr.plot.view(record, tmp_path / "c.png", frame=frame, **options))
        assert np.array_equal(shown, pixels(gr.plot.view(source, tmp_path / "d.png", **options)))
    monkeypatch.setattr(pyvista, "OFF_SCREEN", False)
    for name in ("DISPLAY", "WAYLAND_DISPLAY"):
        monkeypatch.delenv(name, raising=False)
    if sys.platform.startswith("linux"):
        with pytest.raises(RuntimeError, match="no display: give a path"):
            gr.plot.view(sim)
    monkeypatch.setattr(pyvista, "OFF_SCREEN", True)
    assert gr.plot.view(sim, window=(160, 120)) is None


def test_a_notebook_without_trame_names_the_extra(sim, monkeypatch):
    pytest.importorskip("pyvista")
    monkeypatch.setattr(view_3d, "in_notebook", lambda: True)
    monkeypatch.setattr(view_3d, "find_spec", lambda name: None)
    with pytest.raises(ModuleNotFoundError, match=r"pip install 'granular-flow\[notebook\]'"):
        gr.plot.view(sim)


def test_2d_is_refused(tmp_path):
    pytest.importorskip("pyvista")
    flat = gr.Simulation(gr.scenes.column_collapse(cell=0.05), threads=1)
    with pytest.raises(ValueError, match="source of dimension 2 must have 3"):
        gr.plot.view(flat, tmp_path / "x.png")


def test_without_pyvista_the_extra_is_named(sim, tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "pyvista", None)
    with pytest.raises(ModuleNotFoundError, match=r"pip install 'granular-flow\[pictures3d\]'"):
        gr.plot.view(sim, tmp_path / "x.png")

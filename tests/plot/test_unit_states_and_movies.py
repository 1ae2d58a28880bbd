"""Pictures: values and scales, positions of what is drawn, movies."""

import base64
import os
import stat
import sys

import numpy as np
import pytest
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.colors import to_rgba, to_rgba_array
from matplotlib.figure import Figure
from PIL import Image

import granular as gr
from granular import plot
from granular.plot.canvas import View
from granular.plot.fields import PHASES, Brush, values
from granular.plot.material import Material, Raster
from granular.plot.scenery import OUTLET_STYLE, WALL_STYLES, scenery

SOFT = gr.materials.glass_beads.replace(E=1e5)


def small(**parameters):
    return gr.scenes.column_collapse(
        aspect=1.0, cell=0.05, points_per_cell=4, material=SOFT, **parameters
    )


def moved(scene, **fields):
    """Initial state of a scene with some fields replaced."""
    start = gr.Simulation(scene, threads=1).state
    kept = {name: array.copy() for name, array in start.fields.items()}
    return gr.State(scene=scene, time=0.5, step=1, dt=1e-4, fields=kept | fields)


@pytest.fixture(scope="module")
def state():
    scene = small()
    n = scene.n_points
    stress = np.tile([-300.0, -600.0, -900.0, 40.0], (n, 1))
    v = np.column_stack([np.full(n, 3.0), np.full(n, -4.0)])
    return moved(scene, stress=stress, v=v, shear_rate=np.geomspace(1e-3, 1e2, n))


@pytest.mark.parametrize(
    ("color", "expected"),
    [("pressure", 600.0), ("speed", 5.0), ("v_y", -4.0), ("stress_xy", 40.0), ("density", 1500.0)],
)
def test_values_by_name(state, color, expected):
    assert values(state, color) == pytest.approx(np.full(state.n, expected))


def test_smoothing_keeps_a_uniform_field(state):
    assert values(state, "pressure", smooth=True) == pytest.approx(np.full(state.n, 600.0))


def test_scales_of_rates_signed_fields_and_missing_values(state):
    # a logarithmic scale on which zero is the low end
    still = moved(state.scene, shear_rate=np.zeros(state.n))
    brush = Brush.fitted([still, state], "shear_rate")
    assert (brush.norm.vmin, brush.norm.vmax) == pytest.approx((1e-2, 1e2))
    assert np.asarray(brush.norm(brush.paint(still))) == pytest.approx(np.zeros(state.n))
    # symmetric about zero
    v = np.column_stack([np.linspace(-1.0, 3.0, state.n), np.zeros(state.n)])
    brush = Brush.fitted([moved(state.scene, v=v)], "v_x")
    assert brush.norm.vmin == -brush.norm.vmax == pytest.approx(-3.0, rel=0.02)
    assert brush.quantity.title == "velocity along x [m/s]"
    assert Brush.fitted([moved(state.scene, v=0 * v)], "v_y").norm.vmax == 1.0
    assert (brush.cmap.name, Brush.fitted([state], "v_x", limits=(0, 1)).cmap.name) == (
        "coolwarm",
        "viridis",
    )
    # points without a value are masked
    mu = np.where(np.arange(state.n) < 3, np.nan, 0.4)
    assert Brush.fitted([state], mu).paint(state).mask.sum() == 3


def test_a_frame_has_axes_a_bar_and_a_title(state):
    figure = plot.frame(state, "pressure")
    assert isinstance(figure, Figure)
    assert figure.axes[0].get_title() == "t = 0.5 s"
    assert figure.axes[1].get_ylabel() == "pressure [Pa]"
    assert figure._repr_png_().startswith(b"\x89PNG")
    with pytest.raises(TypeError, match=r"such as `simulation.state`"):
        plot.frame(gr.Simulation(state.scene, threads=1))


def material_of(state, extent, view=None, **options):
    view = View(state.dim) if view is None else view
    brush = Brush.fitted([state], np.zeros(state.n), limits=(0.0, 1.0))
    return Material(Figure().add_subplot(), state, brush, view, extent, **options)


WHOLE = ((-0.05, 0.5), (-0.05, 0.5))


def test_material_covers_the_area_of_its_volume_without_gaps(state):
    """A square column of 0.2 m beside the plane of symmetry x = 0, on the floor y = 0."""
    material = material_of(state, WHOLE)
    shown, pixel = material.rows(state), material.raster.pixel
    (left, _), (bottom, _) = WHOLE
    row, column = np.nonzero(shown >= 0)
    x, y = left + (column + 0.5) * pixel, bottom + (row + 0.5) * pixel
    within = (x > 0) & (y > 0)
    assert within.sum() * pixel**2 == pytest.approx(state.volume.sum(), rel=0.03)
    inner = shown[(row.min() + row.max()) // 2, column.min() : column.max() - 1]
    assert (inner >= 0).all()
    # Each place has the colour of the nearest point.
    away = np.linalg.norm(
        np.column_stack([x, y])[within] - state.x[shown[row, column][within]], axis=1
    )
    assert away.max() < 0.025 * np.sqrt(0.5) + 2 * pixel


def test_gaps_are_closed_and_single_points_are_discs_of_their_volume():
    raster = Raster(((0.0, 1.0), (0.0, 1.0)), 0.002)
    spacing, radius = 0.05, 0.05 / np.sqrt(np.pi)
    strings = np.array([[x, y] for x in np.arange(0.1, 0.5, 0.01) for y in (0.2, 0.28, 0.36)])
    flying = np.array([[0.8, 0.8]])
    shown = raster.area(np.concatenate([strings, flying]), radius, 0.06)
    alone = shown == len(strings)
    assert alone.sum() * 0.002**2 == pytest.approx(spacing**2, rel=0.05)
    # strings a gap of 0.08 apart are one area, whose surface is `radius` from its points
    columns = shown[:, 100:240]
    edge = np.nonzero(columns.any(axis=1) & (columns >= 0).all(axis=1))[0]
    assert np.diff(edge).max() == 1
    assert edge[[0, -1]] * 0.002 == pytest.approx([0.2 - radius, 0.36 + radius], abs=0.006)
    apart = raster.area(strings, radius, 0.03)[:, 150]
    assert (np.diff(np.nonzero(apart >= 0)[0]) > 1).sum() == 2


def test_points_are_discs_of_a_given_size(state):
    material = material_of(state, WHOLE, size=0.01)
    area = (material.rows(state) >= 0).sum() * material.raster.pixel**2
    assert area == pytest.approx(state.n * np.pi * 0.005**2, rel=0.1)
    with pytest.raises(ValueError, match=r"size = 0.0"):
        plot.frame(state, size=0.0)


def test_frame_into_given_axes_leaves_pyplot_alone(state, monkeypatch):
    monkeypatch.delitem(sys.modules, "matplotlib.pyplot", raising=False)  # another test may need it
    ax = Figure().add_subplot()
    assert plot.frame(state, ax=ax, bar=False, title="here") is ax.figure
    assert ax.get_title() == "here"
    assert "matplotlib.pyplot" not in sys.modules


def test_the_middle_of_a_picture_has_the_colour_of_its_value(state):
    """Pixels lie where the points are: material in the lower left, none in the upper right."""
    figure = plot.frame(state, np.ones(state.n), limits=(0.0, 1.0), cmap="viridis")
    canvas = FigureCanvasAgg(figure)
    canvas.draw()
    ax, pixels = figure.axes[0], np.asarray(canvas.buffer_rgba())
    column, up = ax.transData.transform((0.0875, 0.0875)).astype(int)
    assert pixels[len(pixels) - up, column, :3] == pytest.approx([253, 231, 37], abs=2)
    column, up = ax.transData.transform((0.22, 0.22)).astype(int)
    assert pixels[len(pixels) - up, column, :3].tolist() == [255, 255, 255]


def test_colours_are_interpolated_and_points_keep_their_values(state):
    """A linear field is drawn as it is, alternating noise in full, whole numbers as they are."""
    start = gr.Simulation(state.scene, threads=1).state
    height = start.x[:, 1]
    column = np.round(start.x[:, 0] / (0.5 * state.scene.grid.cell) - 0.5).astype(int) % 2

    def shades(color):
        brush = Brush.fitted([start], color, limits=(0.0, 1.0), cmap="gray")
        assert brush.blends != (color is column)
        material = Material(Figure().add_subplot(), start, brush, View(2), ((0.05, 0.15),) * 2)
        _, _, bottom, top = material.raster.extent
        shade = np.asarray(material.artist.get_array())[..., 0] / 255
        rows = bottom + (np.arange(len(shade)) + 0.5) * (top - bottom) / len(shade)
        inner = slice(len(shade) // 5, -len(shade) // 5)  # the mean ends at the edge of the region
        return shade[inner, inner], rows[inner]

    shade, rows = shades(height)
    assert np.abs(shade - rows[:, None]).max() < 1.5 / 255  # levels of grey
    shade, _ = shades(column.astype(float))
    assert shade.min() < 0.06 and shade.max() > 0.94 and len(np.unique(shade)) > 10
    shade, _ = shades(column)
    assert set(np.unique(shade)) == {0.0, 1.0}


def test_walls_are_drawn_where_they_are_and_outlets_when_they_open():
    scene = gr.scenes.silo(orifice=0.2, cell=0.05, material=SOFT)
    parts = scenery(Figure().add_subplot(), scene, View(2))
    lines = {(begin, end): line for line, begin, end in parts}
    bottom = [line for line, _, end in parts if end == np.inf and line.get_linewidth() == 2.5]
    assert [list(line.get_xdata()) for line in bottom] == [pytest.approx([0.15, 0.5])]
    lid, outlet = lines[(-np.inf, 0.1)], lines[(0.1, np.inf)]
    assert lid.get_xdata() == pytest.approx([0.0, 0.15])
    assert outlet.get_xdata() == pytest.approx([0.0, 0.15])
    symmetry = [line for line, *_ in parts if list(line.get_xdata()) == [0.0, 0.0]]
    assert [line.get_linestyle() for line in symmetry] == ["--"]


def test_an_outlet_has_the_colour_of_no_phase_and_the_frame_that_of_no_wall(state):
    phases = {tuple(color) for color in to_rgba_array(PHASES.colors)}
    assert to_rgba(OUTLET_STYLE["color"]) not in phases
    ax = plot.frame(state).axes[0]
    frame = {to_rgba(spine.get_edgecolor()) for spine in ax.spines.values()}
    walls = {to_rgba(style["color"]) for style in WALL_STYLES.values()}
    assert not frame & walls


def test_blocks_are_drawn():
    scene = gr.scenes.hourglass(
        kind="sloped", cell=0.05, orifice_radius=0.05, material=SOFT, fill_height=0.25
    )
    ax = Figure().add_subplot()
    scenery(ax, scene, View(2))
    blocks = [wall for wall in scene.walls if hasattr(wall, "upper")]
    drawn = [(patch.get_x(), patch.get_y()) for patch in ax.patches]
    assert drawn == [block.lower for block in blocks]
    assert blocks


@pytest.fixture(scope="module")
def solid():
    scene = gr.scenes.cylinder_collapse(cell=0.05, material=SOFT)
    return gr.Simulation(scene, threads=1).state


def test_a_projection_has_the_nearest_points_on_top(solid):
    material = material_of(solid, View(3).extent([solid]))
    shown = material.rows(solid)
    # the nearest in each pixel, by a search through all points
    raster, radius = material.raster, material._radius
    for row, column in np.argwhere(shown >= 0)[::4001]:
        place = raster.origin + (np.array([column, row]) + 0.5) * raster.pixel
        away = abs(solid.x[:, ::2] - place).max(axis=1)
        sure = np.linalg.norm(solid.x[:, ::2] - place, axis=1) < radius - 2 * raster.pixel
        assert away[shown[row, column]] <= radius + 2 * raster.pixel
        assert solid.x[shown[row, column], 1] <= solid.x[sure, 1].min(initial=np.inf)


def test_a_slice_has_the_points_within(solid):
    view = View(3, (0, 1), (0.0, 0.03))
    shown = material_of(solid, view.extent([solid]), view).rows(solid)
    inside = solid.x[:, 2] <= 0.03
    assert 0 < inside.sum() < solid.n
    assert set(np.unique(shown)) - {-1} <= set(np.flatnonzero(inside))
    # a whole section of the cylinder, or the half of it that is simulated
    middle = shown[tuple(slice(n // 8, n // 3) for n in shown.shape)]
    assert (middle >= 0).mean() > 0.9


NO_NUMBER = ("hue", "v", "stress", "v_z", "scene", "time", np.zeros(3), "x")


@pytest.mark.parametrize(
    ("options", "message"),
    [
        *(({"color": color}, "one number for each") for color in NO_NUMBER),
        *(({"limits": (low, 1.0)}, "limits = ") for low in (1.0, 2.0, 0.0, -1.0)),
        ({"cmap": "mud"}, "cmap = 'mud'"),
        ({"extent": ((1.0, 0.0), (0.0, 1.0))}, "must have left < right"),
        ({"extent": (0.0, 1.0)}, "extent = "),
        ({"extent": ((0.0, np.inf), (0.0, 1.0))}, "extent = "),
        ({"view": (0, 0)}, "two different"),
        ({"view": (0, 5)}, "view"),
        ({"slab": (1.0, 0.0)}, "low"),
    ],
)
def test_bad_options_are_refused(state, solid, options, message):
    with pytest.raises(ValueError, match=message):
        plot.frame(solid if {"view", "slab"} & options.keys() else state, **options)


def falling(n=4):
    """States that fall by two point spacings per frame."""
    scene = small()
    start = gr.Simulation(scene, threads=1).state
    return [moved(scene, x=start.x + np.array([0.05 * k, 0.0])) for k in range(n)]


def test_movie_has_a_picture_for_each_frame_that_moves(tmp_path):
    states = falling()
    square = ((0.0, 0.4), (0.0, 0.4))
    path = plot.movie(states, tmp_path / "a.gif", color="speed", fps=20, extent=square)
    with Image.open(path) as gif:
        assert gif.n_frames == len(states)
        assert gif.info["duration"] == 50
        assert gif.info["loop"] == 0
        pictures = []
        for k in range(gif.n_frames):
            gif.seek(k)
            pictures.append(np.asarray(gif.convert("RGB")).astype(int))
    # At rest the material has the lowest colour of viridis; the bar is in the right quarter.
    middle = []
    for picture in pictures:
        axes = picture[:, : picture.shape[1] * 3 // 4]
        material = (abs(axes - [68, 1, 84]) < 12).all(axis=2)
        assert material.sum() > 1000
        middle.append(np.nonzero(material)[1].mean())
    # the same motion from frame to frame, to a pixel
    assert np.diff(middle) == pytest.approx(np.full(3, np.diff(middle).mean()), abs=1.5)
    assert middle[1] - middle[0] > 5
    assert [p.name for p in tmp_path.iterdir()] == ["a.gif"]
    assert stat.S_IMODE(path.path.stat().st_mode) & 0o400


def test_movie_of_a_domain_that_empties(tmp_path):
    states = falling(2)
    nothing = {name: array[:0] for name, array in states[0].fields.items()}
    empty = gr.State(scene=states[0].scene, time=1.0, step=9, dt=1e-4, fields=nothing)
    path = plot.movie([*states, empty], tmp_path / "a.gif", color="phase")
    with Image.open(path) as gif:
        assert gif.n_frames == 3


@pytest.mark.parametrize(
    ("name", "options", "error"),
    [
        ("a.avi", {}, ValueError),
        ("a.gif", {"fps": 0.0}, ValueError),
        ("a.gif", {"fps": 60.0}, ValueError),
        ("a.gif", {"color": "hue"}, ValueError),
        ("no/a.gif", {}, FileNotFoundError),
    ],
)
def test_movies_that_cannot_be_are_refused_and_leave_nothing(tmp_path, name, options, error):
    with pytest.raises(error):
        plot.movie(falling(2), tmp_path / name, **options)
    with pytest.raises(ValueError, match="0 frames"):
        plot.movie([], tmp_path / "a.gif")
    assert list(tmp_path.iterdir()) == []


def test_an_existing_movie_is_kept(tmp_path):
    path = tmp_path / "a.gif"
    path.write_text("precious")
    with pytest.raises(FileExistsError, match=r"a\.gif"):
        plot.movie(falling(2), path)
    assert path.read_text() == "precious"
    plot.movie(falling(2), path, overwrite=True)
    assert path.read_bytes().startswith(b"GIF89a")


def test_mp4_without_ffmpeg_says_so(tmp_path, monkeypatch):
    monkeypatch.setenv("PATH", str(tmp_path))
    monkeypatch.setitem(sys.modules, "imageio_ffmpeg", None)
    with pytest.raises(ValueError, match=r"needs ffmpeg.*pip install 'granular-flow\[movies\]'"):
        plot.movie(falling(2), tmp_path / "a.mp4")
    assert plot.movie(falling(2)).content.startswith(b"GIF89a")


def test_mp4_of_the_extra_plays_in_a_notebook(tmp_path, monkeypatch):
    pytest.importorskip("imageio_ffmpeg")
    monkeypatch.setenv("PATH", str(tmp_path))
    made = plot.movie(falling(3))
    assert made.content[4:8] == b"ftyp"
    html = made._repr_html_()
    assert html.startswith("<video controls")
    assert base64.b64encode(made.content).decode() in html
    with pytest.raises(ValueError, match="in memory"):
        os.fspath(made)
    kept = plot.movie(falling(3), tmp_path / "a.mp4")
    assert kept.path == tmp_path / "a.mp4"
    assert len(kept.content) > 1000


def test_a_gif_of_a_record_plays_in_a_notebook(tmp_path):
    sim = gr.Simulation(small(), threads=1).run(until=0.1, every=0.05, save=tmp_path / "a.h5")
    record = gr.open(sim.record)
    made = gr.plot.movie(record, tmp_path / "a.gif", color="speed")
    assert made._repr_html_().startswith("<img alt='movie' src='data:image/gif;base64,R0lGODlh")
    with Image.open(made) as gif:
        assert gif.n_frames == len(record) == 3


@pytest.fixture
def ffmpeg(tmp_path, monkeypatch):
    """A stand-in for ffmpeg that keeps the raw pictures, or fails."""

    def install(script):
        folder = tmp_path / "bin"
        folder.mkdir()
        (folder / "ffmpeg").write_text(f"#!/bin/sh\n{script}\n")
        (folder / "ffmpeg").chmod(0o755)
        monkeypatch.setenv("PATH", f"{folder}:/usr/bin:/bin")

    return install


def test_mp4_hands_all_pictures_to_ffmpeg(tmp_path, ffmpeg):
    ffmpeg('for last; do :; done; cat > "$last"; echo "$@" >> "$last"')
    path = plot.movie(falling(3), tmp_path / "a.mp4", fps=30)
    raw, _, words = path.content.rpartition(b"-y ")
    width, height = map(int, words.split(b"-s ")[1].split()[0].split(b"x"))
    assert b"-r 30" in words
    assert width % 2 == height % 2 == 0
    assert len(raw) == 3 * width * height * 3


def test_a_failing_ffmpeg_is_reported_and_leaves_nothing(tmp_path, ffmpeg):
    ffmpeg("echo no such codec >&2; exit 3")
    with pytest.raises(RuntimeError, match="no such codec"):
        plot.movie(falling(2), tmp_path / "a.mp4")
    assert [p.name for p in tmp_path.iterdir()] == ["bin"]

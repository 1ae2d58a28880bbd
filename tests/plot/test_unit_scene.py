"""Pictures of scenes before they are run: what is where, and what the legend says."""

import numpy as np
import pytest
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.colors import to_rgb
from matplotlib.figure import Figure

import granular as gr
from granular import Body, Box, Cylinder, Motion, plot
from granular.plot.scene import FILLS, MOVING
from granular.plot.scenery import BLOCK

LEFT = gr.Box((0.0, 0.0), (0.4, 0.3))
RIGHT = gr.Box((0.7, 0.0), (1.0, 0.5))


def scene_of(**options):
    given = {
        "name": "two heaps", "grid": gr.Grid((0.0, 0.0), 0.05, (20, 20), open_sides={"y+"}),
        "fills": [gr.Fill(LEFT, 4), gr.Fill(RIGHT, 4, velocity=(3.0, 4.0))],
        "walls": [
            gr.Wall(1, 0.0), gr.Wall(0, 0.0, kind="free_slip"),
            gr.Wall(0, 1.0, kind="coulomb", friction=0.3),
            gr.Wall(0, 0.4, span=((0.0, 0.5),), opens_at=0.2),
            gr.mpm.walls.Solid((0.5, 0.0), (0.6, 0.2)),
        ],
        "bodies": [
            Body(Box(size=(0.1, 0.1)), (0.2, 0.8), motion=Motion(velocity=((1.0, 0.0),))),
            Body(Cylinder(0.1, center=(0.0, 0.0)), (0.8, 0.8)),
        ],
        "material": gr.MuI(E=1e5), "gravity": gr.Gravity(), "duration": 1.0,
    }  # fmt: skip
    return gr.Scene(**(given | options))


def words(figure):
    (legend,) = figure.legends or [ax.get_legend() for ax in figure.axes]
    return [text.get_text() for text in legend.get_texts()]


def test_the_legend_names_all_that_is_there():
    figure = plot.scene(scene_of())
    assert words(figure) == [
        "fills[0]", "fills[1], 5 m/s", "body that moves", "body at rest", "no-slip wall",
        "free-slip wall", "Coulomb wall, friction 0.3", "no-slip wall, opens at 0.2 s",
        "block, no-slip", "open side",
    ]  # fmt: skip
    assert figure.axes[0].get_title() == "two heaps: 20 x 20 cells of 0.05 m"
    assert [text.get_text() for text in figure.axes[0].texts if text.get_text()] == [
        "g = 9.8 m/s$^2$"
    ]
    assert figure.axes[0].get_xlabel() == "x [m]"
    rings = gr.scenes.silo(axisymmetric=True, cell=0.025, orifice=0.1)
    labels = plot.scene(rings).axes[0]
    assert (labels.get_xlabel(), labels.get_ylabel()) == ("r [m]", "z [m]")
    periodic = scene_of(grid=gr.Grid((0.0, 0.0), 0.05, (20, 20), periodic=(True, False)), walls=())
    assert {"periodic side", "closed side"} < set(words(plot.scene(periodic)))


def test_pixels_lie_where_things_are():
    figure = plot.scene(scene_of())
    canvas = FigureCanvasAgg(figure)
    canvas.draw()
    ax, pixels = figure.axes[0], np.asarray(canvas.buffer_rgba())[..., :3] / 255
    for place, colour in (
        ((0.2, 0.15), FILLS[0]), ((0.9, 0.45), FILLS[1]), ((0.55, 0.1), BLOCK),
        ((0.2, 0.55), "white"),
        ((0.17, 0.77), MOVING["facecolor"]), ((0.8, 0.87), "#d5d8dc"),
    ):  # fmt: skip
        column, up = ax.transData.transform(place).astype(int)
        assert pixels[len(pixels) - up, column] == pytest.approx(to_rgb(colour), abs=0.01), place


def test_a_body_beyond_the_domain_is_in_the_picture():
    high = Body(Box(size=(0.2, 0.2)), (0.5, 1.2))
    ax = plot.scene(scene_of(bodies=[high])).axes[0]
    assert ax.get_ylim()[1] > 1.3
    assert (
        plot.scene(scene_of(bodies=[high]), extent=((0.0, 1.0), (0.0, 0.5))).axes[0].get_ylim()[1]
        < 0.6
    )


def test_scenes_of_sph_in_3d_and_in_a_notebook():
    assert "wall of particles" in " ".join(words(plot.scene(gr.scenes.slump_sph())))
    solid = gr.scenes.excavation()
    assert "body that moves" in words(plot.scene(solid))
    ax = Figure().add_subplot()
    assert plot.scene(solid, ax=ax, view=(1, 2), title="from behind") is ax.figure
    assert ax.get_title() == "from behind"
    html = scene_of()._repr_html_()
    assert "<table>" in html
    assert "<img alt='picture' src='data:image/png;base64,iVBOR" in html


@pytest.mark.parametrize(
    ("options", "error", "message"),
    [
        ({"view": (0, 0)}, ValueError, "two different"),
        ({"slab": (0.0, 1.0)}, ValueError, "must be None in 2D"),
        ({"scene": 3}, TypeError, "scene = 3 must be a scene"),
    ],
)
def test_bad_arguments_are_named(options, error, message):
    with pytest.raises(error, match=message):
        plot.scene(**({"scene": scene_of()} | options))

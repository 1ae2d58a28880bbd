"""Pictures against stored ones, with a tolerance, and without text, which depends on fonts.

`python tests/plot/test_unit_stored_pictures.py` draws the stored ones anew; look at them before
a commit.
"""

from pathlib import Path

import numpy as np
import pytest
from matplotlib.testing.compare import compare_images
from matplotlib.testing.decorators import remove_ticks_and_titles
from scenes_by_hand import scene_with

import granular as gr

FOLDER = Path(__file__).with_name("pictures")
TOLERANCE = 4.0
"""Root mean square of the difference of pixels, of 255: some edges may be drawn otherwise."""


def at_start(scene):
    return gr.Simulation(scene, threads=1).state


def hopper():
    return gr.scenes.hopper(angle_deg=30.0, orifice=0.16, width=0.5, fill_height=0.6, cell=0.02)


def heap():
    """Rows that have been stretched, with gaps that a picture closes, and a point in flight."""
    rows = [(x, y) for y in np.arange(0.01, 0.2, 0.02) for x in np.arange(0.0, 0.5 - 2 * y, 0.014)]
    points = np.array([*rows, (0.45, 0.18)])
    grid = gr.Grid((0.0, 0.0), 0.02, (30, 12))
    region = gr.Cloud(points, np.full(len(points), 0.014 * 0.02))
    return at_start(
        scene_with(
            grid=grid, fills=[gr.Fill(region, 4)], walls=[gr.Wall(1, 0.0)],
            gravity=gr.Gravity()
        )
    )  # fmt: skip


def blade():
    scene = gr.scenes.excavation(
        depth=0.05, travel=0.1, speed=0.2, dive_speed=0.1, settle=0.15, length=0.8, width=0.5,
        cell=0.025,
    )  # fmt: skip
    return at_start(scene)


NEAR = ((0.15, 0.45), (-0.15, 0.05))
"""Part of the picture of the blade."""


def by_height(state, **options):
    return gr.plot.frame(state, state.x[:, -1], label="", **options)


PICTURES = {
    "hopper": lambda: by_height(at_start(hopper())),
    "scene": lambda: gr.plot.scene(hopper()),
    "heap": lambda: by_height(heap()),
    "slab": lambda: by_height(blade(), slab=(0.0, 0.05), extent=NEAR),
}


def write(figure, path):
    remove_ticks_and_titles(figure)
    for legend in (*figure.legends, *(ax.get_legend() for ax in figure.axes)):
        if legend is not None:
            legend.remove()
    for ax in figure.axes:
        ax.set(xlabel="", ylabel="")
        for text in ax.texts:
            text.set_text("")
    figure.savefig(path, dpi=50)
    return path


@pytest.mark.parametrize("name", PICTURES)
def test_a_picture_is_as_it_was(name, tmp_path):
    made = write(PICTURES[name](), tmp_path / f"{name}.png")
    assert compare_images(FOLDER / f"{name}.png", made, TOLERANCE) is None


@pytest.mark.parametrize(
    ("name", "wrong"),
    [
        ("hopper", lambda: by_height(at_start(hopper().replace(bodies=())))),
        ("hopper", lambda: gr.plot.frame(at_start(hopper()), "pressure", label="")),
        ("scene", lambda: gr.plot.scene(hopper().replace(bodies=()))),
        ("heap", lambda: by_height(heap(), size=0.01)),
        ("slab", lambda: by_height(blade(), slab=(0.3, 0.35), extent=NEAR)),
    ],
)
def test_the_tolerance_is_less_than_what_a_fault_makes(name, wrong, tmp_path):
    made = write(wrong(), tmp_path / f"{name}.png")
    assert "RMS" in compare_images(FOLDER / f"{name}.png", made, 2 * TOLERANCE)


if __name__ == "__main__":
    FOLDER.mkdir(exist_ok=True)
    for name, draw in PICTURES.items():
        print(write(draw(), FOLDER / f"{name}.png"))

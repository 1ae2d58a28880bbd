"""3D pictures: their content for a state, a run and a record, and refused input."""

import sys

import matplotlib.image
import numpy as np
import pytest

import granular as gr


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


def test_points_and_bodies_are_there(sim, tmp_path):
    pytest.importorskip("pyvista")
    shares = {}
    for name, options in {
        "all": {},
        "state": {"bodies": sim.bodies},
        "no_bodies": {"bodies": ()},
        "slice": {"bodies": sim.bodies, "slab": ("x", 0.0, 0.2)},
    }.items():
        source = sim if name == "all" else sim.state
        path = gr.plot.view(
            source, tmp_path / f"{name}.png", "pressure", camera="xz", window=(320, 240), **options
        )
        picture = pixels(path)
        assert picture.shape == (240, 320, 3)
        shares[name] = parts(picture)
    assert shares["all"] == shares["state"]
    # a blade of aspect ratio 1:9 in a quarter of the picture
    assert shares["all"][0] > shares["no_bodies"][0] + 0.01
    assert shares["all"][1] > 0.05
    assert shares["slice"][1] < 0.8 * shares["all"][1]


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
        ({"opacity": 2.0}, ValueError, "opacity = 2.0"),
        ({"color": "none"}, ValueError, "color = 'none'"),
    ],
)
def test_bad_arguments_are_named(sim, tmp_path, options, error, message):
    pytest.importorskip("pyvista")
    with pytest.raises(error, match=message):
        gr.plot.view(sim, tmp_path / "x.png", **options)
    with pytest.raises(ValueError, match="bodies: 2 must be as many"):
        gr.plot.view(sim.state, tmp_path / "x.png", bodies=sim.bodies * 2)


def test_2d_is_refused(tmp_path):
    pytest.importorskip("pyvista")
    flat = gr.Simulation(gr.scenes.column_collapse(cell=0.05), threads=1)
    with pytest.raises(ValueError, match="source of dimension 2 must have 3"):
        gr.plot.view(flat, tmp_path / "x.png")


def test_without_pyvista_the_extra_is_named(sim, tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "pyvista", None)
    with pytest.raises(ModuleNotFoundError, match=r"pip install 'granular\[pictures3d\]'"):
        gr.plot.view(sim, tmp_path / "x.png")

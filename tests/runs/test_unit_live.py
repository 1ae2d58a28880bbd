"""Pictures of a run that goes on: files, and what a notebook shows."""

from itertools import pairwise

import numpy as np
import pytest
from PIL import Image

import granular as gr

WIDGET = "application/vnd.jupyter.widget-view+json"


@pytest.fixture
def sim():
    scene = gr.scenes.column_collapse(aspect=1.0, E=1e6, cell=0.05, points_per_cell=4)
    return gr.Simulation(scene, threads=1)


def test_the_file_shows_the_first_of_every_n_frames(sim, tmp_path):
    path, seen = tmp_path / "now.png", []
    live = gr.plot.Live("speed", every=2, path=path, limits=(0.0, 1.0))

    def look(sim):
        with Image.open(path) as picture:
            seen.append(np.asarray(picture))

    sim.run(until=0.4, every=0.1, hooks=(live, look))
    changed = [not np.array_equal(a, b) for a, b in pairwise(seen)]
    assert changed == [False, True, False, True]
    expected = tmp_path / "frame.png"
    gr.plot.frame(sim.state, "speed", limits=(0.0, 1.0)).savefig(expected)
    with Image.open(expected) as picture:
        assert np.array_equal(seen[-1], np.asarray(picture))
    assert sorted(tmp_path.iterdir()) == [expected, path]  # nothing half written is left


def test_a_picture_that_fails_leaves_the_last_one(sim, tmp_path):
    path = tmp_path / "now.png"
    sim.run(until=0.01, every=0.01, hooks=(gr.plot.Live("speed", path=path),))
    before = path.read_bytes()
    with pytest.raises(ValueError, match="color = 'none'"):
        sim.run(until=0.02, hooks=(gr.plot.Live("none", path=path),))
    assert path.read_bytes() == before
    assert list(tmp_path.iterdir()) == [path]


def test_bad_arguments_are_named(tmp_path):
    with pytest.raises(ValueError, match="path = None must name a picture"):
        gr.plot.Live("speed")
    with pytest.raises(FileNotFoundError, match="not a folder"):
        gr.plot.Live("speed", path=tmp_path / "none" / "now.png")
    with pytest.raises(ValueError, match="every = 0"):
        gr.plot.Live("speed", every=0, path=tmp_path / "now.png")


SCENE = """
import granular as gr
scene = gr.scenes.cylinder_collapse(E=1e6, cell=0.1, points_per_cell=1)
sim = gr.Simulation(scene, threads=1)
"""
RUN = "_ = sim.run(until=0.02, every=0.005, progress=True, hooks=[gr.plot.Live('speed', every=2)])"


def outputs(*code):
    """Outputs of the last of some cells."""
    for name in ("nbclient", "ipykernel", "ipywidgets", "trame_pyvista"):
        pytest.importorskip(name, reason="needs the extra: notebook")
    from nbformat import v4
    from run_notebooks import execute

    notebook = v4.new_notebook(cells=[v4.new_code_cell(source) for source in code])
    execute(notebook)
    return notebook.cells[-1].outputs


def count(found, kind):
    return sum(kind in out.get("data", {}) for out in found)


@pytest.mark.filterwarnings("default")  # of the notebook machinery; the kernel is another process
def test_a_notebook_shows_a_bar_and_one_picture():
    """The bar is a widget, and the pictures of the run replace each other."""
    found = outputs(SCENE, RUN)
    assert count(found, WIDGET) == 1
    assert count(found, "image/png") == 1
    assert len(found) == 2  # not one more, such as a bar as text


@pytest.mark.slow
@pytest.mark.filterwarnings("default")
def test_a_notebook_shows_a_view():
    """The view can be turned, or is a picture if the user has asked pyvista for pictures."""
    assert count(outputs(SCENE, "gr.plot.view(sim, window=(80, 60))"), WIDGET) == 1
    still = (
        "import pyvista\npyvista.set_jupyter_backend('static')\ngr.plot.view(sim, window=(80, 60))"
    )
    assert count(outputs(SCENE, still), "image/png") == 1

"""The scripts of the figures run to their end and write pictures to the folder they are given."""

from pathlib import Path

import pytest
from PIL import Image

FOLDER = Path(__file__).parents[2] / "benchmarks" / "figures"
PICTURES = {
    "explanations": [
        f"explain_{page}"
        for page in ("bodies", "core", "density_correction", "determinism", "fluidity", "laws")
    ]
    + ["explain_transfers"],
    "guides": [
        f"guide_{page}"
        for page in (
            *(
                "calibrate_friction",
                "choose_a_scheme",
                "choose_a_stiffness",
                "dem_runs",
                "error_bar",
            ),
            *("fill_regions", "meshes", "own_material"),
            *("own_scene", "paraview", "read_the_verdict", "restart"),
            *("scale_a_model", "scene_files", "shear_cell", "sweep", "walls", "watch_a_run"),
        )
    ],
}


def test_every_script_is_known(module):
    found = {
        p.stem for name in ("figure", "explanations", "guides") for p in FOLDER.glob(f"*{name}*.py")
    }
    assert found == PICTURES.keys()


@pytest.mark.slow
@pytest.mark.parametrize("name", PICTURES)
def test_a_quick_figure_is_written(module, name, tmp_path):
    module(name).main(["--quick", "--out", str(tmp_path / "new")])
    written = sorted(path.stem for path in (tmp_path / "new").iterdir())
    assert written == PICTURES[name]
    for stem in written:
        with Image.open(tmp_path / "new" / f"{stem}.png") as picture:
            assert min(picture.size) >= 500


@pytest.mark.slow
def test_the_moving_picture_is_written(module, tmp_path):
    module("moving_hourglass").main(["--quick", "--out", str(tmp_path)])
    with Image.open(tmp_path / "hourglass.gif") as picture:
        assert picture.n_frames >= 5


def test_pictures_go_to_a_folder_that_git_ignores(module):
    ignored = (FOLDER.parents[1] / ".gitignore").read_text().split()
    assert module("common").OUT.parts[0] + "/" in ignored

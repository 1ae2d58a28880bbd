"""The scripts of the figures run to their end and write pictures to the folder they are given."""

import json
from pathlib import Path

import pytest
from PIL import Image

FOLDER = Path(__file__).parents[2] / "benchmarks" / "figures"
PICTURES = {
    "figure_2": ["figure_2"],
    "ngf_figure_2": ["ngf_figure_2"],
    "figure_3": ["figure_3"],
    "figure_4": ["figure_4"],
    "figure_5": ["figure_5"],
    "figures_6_7": ["figure_6", "figure_7", "figure_7_stress"],
    "figures_9_10": ["figure_10", "figure_9"],
    "figure_11": ["figure_11"],
    "figure_13": ["figure_13"],
    "ngf_figures_4_10": [
        "ngf_figure_10",
        *(f"ngf_figure_{name}" for name in ("4a", "4b", "5", "6", "7", "8", "9")),
    ],
    "inference_static": ["inference_static", "inference_statistics"],
    "inference_dynamic": ["inference_histories", "inference_impact", "inference_pareto"],
    "explanations": [
        f"explain_{page}"
        for page in ("bodies", "core", "density_correction", "determinism", "fluidity", "laws")
    ]
    + ["explain_transfers"],
    "guides": [
        f"guide_{page}"
        for page in (
            *("calibrate_friction", "choose_a_scheme", "choose_a_stiffness", "dem_runs"),
            *("extrapolate_to_fine_cells", "fill_regions", "meshes", "own_material"),
            *("own_scene", "paraview", "read_the_verdict", "restart"),
            *("scale_a_model", "scene_files", "shear_cell", "sweep", "walls", "watch_a_run"),
        )
    ],
    "inference_bed": ["inference_bed_1", "inference_distances", "inference_intruder"],
}
FAST = ("figure_13",)
"""A figure that takes about a second."""


def test_every_script_is_known(module):
    found = {
        p.stem for name in ("figure", "explanations", "guides") for p in FOLDER.glob(f"*{name}*.py")
    }
    found |= module("dunatunga_kamrin_2015").FIGURES.keys()
    found |= {f"inference_{name}" for name in module("inference_pictures").FIGURES}
    assert found == PICTURES.keys()


@pytest.mark.parametrize(
    "name",
    [pytest.param(n, marks=() if n in FAST else pytest.mark.slow) for n in PICTURES],
)
@pytest.mark.filterwarnings("ignore::granular.grain_scale.inference.InferenceWarning")
def test_a_quick_figure_is_written(module, name, tmp_path):
    if name.startswith("inference"):
        pytest.importorskip("clarabel")
    paper = module("dunatunga_kamrin_2015")
    words = ["--quick", "--out", str(tmp_path / "new")]
    if name in paper.FIGURES:
        paper.main([name, *words])
    elif name.startswith("inference"):
        module("inference_pictures").main([name.removeprefix("inference_"), *words])
    else:
        module(name).main(words)
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


def test_every_layer_of_the_nonlocal_figure_was_on_its_side(module):
    """The saved layers are on their sides of the threshold; one on the wrong side is reported."""
    figure = module("ngf_figure_2")
    rows = json.loads(figure.OUT.read_text())["rows"]
    assert len(rows) >= 40
    assert figure.wrong(rows) == []
    near = min(rows, key=lambda row: abs(row["over_stopping"] - 1.06))
    turned = {"flowing": "static", "static": "flowing"}[near["verdict"]]
    assert len(figure.wrong([near | {"verdict": turned}])) == 1


def test_options_say_what_a_picture_was_made_with_and_where_it_goes(module):
    """Pictures go by default into a folder `build`, which .gitignore names."""
    ignored = (FOLDER.parents[1] / ".gitignore").read_text().split()
    assert module("common").OUT.parts[0] + "/" in ignored
    chosen = module("common").options("", ["--scheme", "published"], E=2e6)
    assert chosen.note == "published scheme, E = 2e+06 Pa"
    assert chosen.scheme.basis == "linear"
    assert chosen.material.E == 2e6
    assert module("common").options("", ["--quick"]).E == 1e6
    assert module("common").options("", ["--E", "3e6"], E=2e6).E == 3e6


def test_an_option_that_means_nothing_is_refused(module, capsys):
    """Figure 3 always shows both schemes, figure 13 needs no run."""
    for name in ("figure_3", "figure_13"):
        with pytest.raises(SystemExit):
            module("dunatunga_kamrin_2015").main([name, "--scheme", "published"])
        assert "--scheme" in capsys.readouterr().err

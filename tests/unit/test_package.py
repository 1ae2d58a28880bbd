"""The package as a whole: its public names, and what a checkout without a compiled core says."""

import os
import shutil
import subprocess
import sys
from pathlib import Path

import granular as gr


def test_public_names_are_there():
    for name in gr.__all__:
        assert getattr(gr, name) is not None
    nouns = {"Grid", "Fill", "Box", "Wall", "Solid", "Gravity", "Body", "MuI", "NGF", "Scene"}
    assert nouns <= set(gr.__all__)


def test_a_scene_needs_no_scheme():
    scene = gr.Scene(
        name="block",
        grid=gr.Grid((0.0, 0.0), 0.1, (4, 4)),
        fills=[gr.Fill(gr.Box((0.0, 0.0), (0.2, 0.2)), 9)],
        walls=[gr.Wall(1, 0.0)],
        material=gr.MuI(E=1e7),
        gravity=gr.Gravity(),
        duration=1,
    )
    assert scene.scheme == gr.Scheme()
    assert gr.scene_warnings(scene) == scene.known_failures()


def test_a_checkout_without_its_core_says_what_to_do(tmp_path):
    """In the folder of the repository Python finds the sources before the installed package."""
    (tmp_path / "granular").mkdir()
    shutil.copy(Path(gr.__file__), tmp_path / "granular" / "__init__.py")
    environment = {k: v for k, v in os.environ.items() if k != "PYTHONSAFEPATH"}
    run = subprocess.run(
        [sys.executable, "-c", "import granular"],
        cwd=tmp_path,
        env=environment | {"PYTHONPATH": ""},
        capture_output=True,
        text=True,
    )
    assert run.returncode == 1
    (said,) = [line for line in run.stderr.splitlines() if line.startswith("ImportError")]
    assert "run Python in another folder" in said and str(tmp_path / "granular") in said

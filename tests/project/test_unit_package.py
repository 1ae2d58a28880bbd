"""The package as a whole: public names, versions and pins, a checkout without a compiled core."""

import os
import re
import shutil
import subprocess
import sys
import tomllib
from pathlib import Path

import pytest

import granular as gr

ROOT = Path(__file__).parents[2]
CONDA_NAMES = {"matplotlib": "matplotlib-base"}


def test_public_names_are_there():
    for name in gr.__all__:
        assert getattr(gr, name) is not None
    nouns = {"Grid", "Fill", "Box", "Wall", "Solid", "Gravity", "Body", "MuI", "NGF", "Scene"}
    assert nouns <= set(gr.__all__)
    whole = gr.bodies.mass_properties(gr.shapes.Box(size=(1.0, 1.0)), 1.0)
    assert type(whole) is gr.bodies.MassProperties and "MassProperties" in gr.bodies.__all__


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


@pytest.fixture(scope="module")
def project():
    return tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]


def found(pattern, file):
    """The groups of a pattern in a file, wherever a line matches it."""
    return re.findall(pattern, (ROOT / file).read_text(), re.M)


def test_one_version_of_package_and_linters(project):
    """pyproject.toml has it; the citation, the recipe and the tag of a release agree."""
    version = project["version"]
    assert gr.__version__ in (version, "unknown")
    assert found(r"^version: (\S+)$", "CITATION.cff") == [version]
    assert found(r'^  version: "(\S+)"$', ".ci/conda/recipe.yaml") == [version]
    assert found(r"^## (\d\S*)", "CHANGELOG.md")[0] == version
    if (ROOT / ".git").exists() and shutil.which("git"):
        run = ["git", "-C", str(ROOT), "tag", "--points-at", "HEAD", "v*"]
        tags = subprocess.run(run, capture_output=True, text=True).stdout.split()
        assert tags in ([], [f"v{version}"])
    # of each linter
    pins = dict(re.findall(r"(\S+)==(\S+)", "\n".join(project["optional-dependencies"]["dev"])))
    hooks = dict(
        found(
            r"repo: \S+/(?:mirrors-)?(\S+?)(?:-pre-commit)?\n +rev: v(\S+)$",
            ".pre-commit-config.yaml",
        )
    )
    assert hooks == {name: pins[name] for name in ("ruff", "clang-format")}


def test_the_recipe_needs_what_the_package_needs(project):
    """In its run section, with the lower bounds of pyproject.toml and the names of conda."""
    (section,) = found(r"^  run:\n((?:    - .*\n)+)", ".ci/conda/recipe.yaml")
    asked = [re.fullmatch(r"([\w-]+)(.*)", entry).groups() for entry in project["dependencies"]]
    expected = [f"{CONDA_NAMES.get(name, name)} {bound}" for name, bound in asked]
    expected.append(f"python {project['requires-python']}")
    assert sorted(re.findall(r"- (.*)", section)) == sorted(expected)
    assert found(r"^  license: (.*)$", ".ci/conda/recipe.yaml") == [project["license"]]


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

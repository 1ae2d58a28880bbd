"""Run notebooks and store their outputs: ``python notebooks/run_notebooks.py [notebook ...]``.

It needs ``pip install '.[notebook,movies]'`` and the optional parts that the notebooks name.
"""

import base64
import io
import json
import os
import sys
import tempfile
from pathlib import Path
from typing import Any

import nbformat
from jupyter_client.kernelspec import KernelSpecManager
from jupyter_client.manager import AsyncKernelManager
from nbclient import NotebookClient
from PIL import Image

FOLDER = Path(__file__).parent
LESSONS = sorted(FOLDER.glob("[0-9][0-9]_*.ipynb"))
COLOURS = 96
"""Colours of a stored picture: with so many it is half as large and looks the same."""


def execute(notebook: Any, timeout: float = 120.0) -> None:
    """Run a notebook by this interpreter, with its packages; the outputs are put into it.

    The kernel is registered nowhere else, and writes to a temporary folder.

    Raises
    ------
    nbclient.exceptions.CellExecutionError
        If a cell raises an exception.
    """
    with tempfile.TemporaryDirectory() as place:
        kernel = Path(place, "here")
        kernel.mkdir()
        command = [sys.executable, "-m", "ipykernel_launcher", "-f", "{connection_file}"]
        spec = {"argv": command, "display_name": "here", "language": "python"}
        (kernel / "kernel.json").write_text(json.dumps(spec))
        manager = AsyncKernelManager(
            kernel_name=kernel.name,
            kernel_spec_manager=KernelSpecManager(kernel_dirs=[place]),
            connection_file=str(kernel / "connection.json"),
        )
        client = NotebookClient(
            notebook, km=manager, timeout=timeout, record_timing=False,
            resources={"metadata": {"path": place}},
        )  # fmt: skip
        path = os.pathsep.join(filter(None, sys.path))
        client.execute(cleanup_kc=True, env=os.environ | {"PYTHONPATH": path, "IPYTHONDIR": place})


def smaller(png: str) -> str:
    """PNG picture, in base64, with fewer colours."""
    with Image.open(io.BytesIO(base64.b64decode(png))) as picture:
        content = io.BytesIO()
        picture.convert("RGB").quantize(COLOURS, dither=Image.Dither.NONE).save(
            content, format="png", optimize=True
        )
    return base64.b64encode(content.getvalue()).decode("ascii")


def worth_storing(out: Any) -> bool:
    """False for what VTK says on a machine without a display; other warnings are errors."""
    if out.get("name") != "stderr":
        return True
    if "bad X server connection" not in out.text:
        raise ValueError(f"a cell warns: {out.text}")
    return False


def store(path: Path) -> None:
    """Run a notebook and store it with its outputs."""
    notebook = nbformat.read(path, as_version=4)
    execute(notebook)
    for cell in notebook.cells:
        if cell.cell_type != "code":
            continue
        cell.outputs = list(filter(worth_storing, cell.outputs))
        for out in cell.outputs:
            if "image/png" in out.get("data", {}):
                out.data["image/png"] = smaller(out.data["image/png"])
    notebook.metadata = {
        "kernelspec": {"display_name": "Python 3", "language": "python", "name": "python3"},
        "language_info": {"name": "python"},
    }
    nbformat.write(notebook, path)
    print(f"{path.name}: {path.stat().st_size / 1000:.0f} kB")


if __name__ == "__main__":
    for path in map(Path, sys.argv[1:] or LESSONS):
        store(path)

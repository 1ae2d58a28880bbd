"""Lessons of the folder `notebooks` as pages: each is copied with its outputs, and its thumbnail.

The copies are not kept under version control. A thumbnail is the first picture of the cell with
the tag "thumbnail".
"""

from __future__ import annotations

import base64
import json
from pathlib import Path

from sphinx.application import Sphinx
from sphinx.config import Config
from sphinx.errors import ExtensionError

NOTEBOOKS = Path(__file__).parents[2] / "notebooks"
FOLDER = Path(__file__).parents[1] / "lessons"


def thumbnail(notebook: dict) -> bytes:
    """PNG picture that stands for a notebook."""
    for cell in notebook["cells"]:
        if "thumbnail" in cell["metadata"].get("tags", ()):
            for out in cell["outputs"]:
                if "image/png" in out.get("data", {}):
                    return base64.b64decode("".join(out["data"]["image/png"]))
    raise ExtensionError("a lesson has no picture in a cell with the tag 'thumbnail'")


def write(path: Path, content: bytes) -> None:
    """Write a file if it is not there already, so that unchanged pages are not made anew."""
    if not path.exists() or path.read_bytes() != content:
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_bytes(content)


def copy_lessons(app: Sphinx, config: Config) -> None:
    """Copy the notebooks; links to pages lead from there to the same pages."""
    for path in sorted(NOTEBOOKS.glob("*.ipynb")):
        text = path.read_text(encoding="utf-8")
        write(FOLDER / path.name, text.replace("](../docs/", "](../").encode())
        write(FOLDER / "thumbnails" / f"{path.stem}.png", thumbnail(json.loads(text)))


def setup(app: Sphinx) -> dict[str, bool]:
    app.connect("config-inited", copy_lessons)
    return {"parallel_read_safe": True, "parallel_write_safe": True}

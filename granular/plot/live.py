"""A picture of a run that changes while the run goes on."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Any

from granular.plot.encoding import replacing
from granular.plot.frame import frame
from granular.run.simulation import Simulation
from granular.tools.checks import integer
from granular.tools.notebook import in_notebook


class Live:
    """Picture of the present state, drawn again while a simulation runs.

    It is a hook of `Simulation.run`: ``sim.run(hooks=[gr.plot.Live("speed", every=10)])``. In a
    notebook the picture stands below the cell and changes in place; with a path it is a file, which
    is replaced as a whole, so that a viewer never reads an incomplete one.

    Parameters
    ----------
    color : str
        See `granular.plot.frame`.
    every : int
        Draw the first of each so many frames; the times of frames are set by `Simulation.run`.
    path : path, optional
        Picture to write, in the format given by its ending, such as ".png"; by default the
        picture is shown in the notebook.
    **options
        See `granular.plot.frame`: `limits` and `extent` keep the scale and the region the same in
        all pictures.
    {raises}; ValueError if neither a path is given nor a
        notebook runs.
    FileNotFoundError
        If the folder of the picture does not exist.
    """

    def __init__(
        self,
        color: str = "shear_rate",
        *,
        every: int = 1,
        path: str | os.PathLike[str] | None = None,
        **options: Any,
    ) -> None:
        self._color, self._options = color, options
        self._every = integer("every", every, 1)
        self._path = None if path is None else Path(path)
        self._frames = 0
        self._display: Any = None
        if self._path is None and not in_notebook():
            raise ValueError("path = None must name a picture to write outside a notebook")
        if self._path is not None and not self._path.parent.is_dir():
            raise FileNotFoundError(f"{self._path.parent} is not a folder")

    def __call__(self, sim: Simulation) -> None:
        """Count a frame, and draw the state if it is the first of `every`."""
        due = self._frames % self._every == 0
        self._frames += 1
        if not due:
            return
        picture = frame(sim.state, self._color, **self._options)
        if self._path is not None:
            with replacing(self._path) as target:
                picture.savefig(target)
        elif self._display is None:
            from IPython.display import display  # there is one, as a notebook runs

            self._display = display(picture, display_id=True)
        else:
            self._display.update(picture)

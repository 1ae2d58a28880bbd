"""Movies: one canvas, on which only the points and walls are drawn again for each frame."""

import math
import os
from collections.abc import Callable, Sequence

import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from numpy.typing import ArrayLike, NDArray

from granular.model.state import State
from granular.plot.canvas import Extent, View, checked_extent, color_bar, figure_of
from granular.plot.encoding import Movie, check_movie, make_movie, sampled
from granular.plot.fields import Brush, Color
from granular.plot.frame import Drawing, bar_side, fitted_extent, new_axes
from granular.record import Trajectory
from granular.tools.checks import integer


def movie(
    record: Sequence[State] | Trajectory,
    path: str | os.PathLike[str] | None = None,
    *,
    color: str | Callable[[State], ArrayLike] | Sequence[ArrayLike] = "shear_rate",
    fps: float = 25.0,
    limits: tuple[float, float] | None = None,
    log: bool | None = None,
    cmap: str | None = None,
    label: str | None = None,
    smooth: bool = False,
    size: float | None = None,
    extent: Extent | None = None,
    view: tuple[int, int] | None = None,
    slab: tuple[float, float] | None = None,
    dpi: int = 100,
    overwrite: bool = False,
    progress: bool = False,
) -> Movie:
    """Make an animated GIF or an MP4 with every frame of a record.

    MP4 needs ffmpeg: one of the system, or the one from ``pip install 'granular-flow[movies]'``. To
    leave out frames, slice the record: `movie(record[::2], ...)`.

    Parameters
    ----------
    record : Trajectory or sequence of State
    path : path, optional
        File to write, ending in .gif or .mp4. It appears when it is complete. Without a path the
        movie is stored in memory, for a notebook: as MP4 if there is an ffmpeg, else as GIF.
    color, limits, log, cmap, label, smooth, size, extent, view, slab
        As in `frame`, but `color` is a name, a function of a state, or a sequence with the numbers
        of the points of each frame. Scale and extent are the same for all frames; by default they
        are fitted to 16 of them.
    fps : float
        Frames per second, > 0, at most 240, and at most 50 in a GIF, where the time of a frame is
        rounded to whole hundredths of a second.
    dpi : int
        Pixels per inch, 20 to 600; the picture is 7 inches wide.
    overwrite : bool
        True to replace an existing file.
    progress : bool
        Show a progress bar.

    Returns
    -------
    Movie
        It plays where a notebook shows it; `path` is the path of its file.

    Raises
    ------
    FileExistsError
        If the file exists and `overwrite` is not set.
    FileNotFoundError
        If the folder of the file does not exist.
    TypeError, ValueError
        If the record is empty, the path ends otherwise, .mp4 is asked for without ffmpeg, or an
        argument is out of range.
    RuntimeError
        If ffmpeg fails.
    """
    check_movie(path, fps=fps, overwrite=overwrite)
    sample = [record[i] for i in sampled(len(record))]
    of_each = _of_each(record, color)
    brush = Brush.fitted(
        sample, of_each, limits=limits, log=log, cmap=cmap, label=label, smooth=smooth
    )
    window = View(sample[0].dim, view, slab)
    stage = _Stage(
        sample[0],
        brush,
        window,
        extent=fitted_extent(sample, window) if extent is None else checked_extent(extent),
        size=size,
        dpi=integer("dpi", dpi, 20, 600),
    )

    def shot(i: int) -> NDArray[np.uint8]:
        return stage.shot(record[i])

    return make_movie(path, len(record), shot, fps=fps, overwrite=overwrite, progress=progress)


def _of_each(
    record: Sequence[State] | Trajectory,
    color: str | Callable[[State], ArrayLike] | Sequence[ArrayLike],
) -> Color:
    """The color, where it is a sequence as a function of a state, found by its step."""
    if isinstance(color, str) or callable(color):
        return color
    if len(color) != len(record):
        raise ValueError(f"color has {len(color)} entries, must have one for each of {len(record)}")
    if isinstance(record, Trajectory):
        steps = record.series["step"].tolist()
    else:
        steps = [state.step for state in record]
    of_step = dict(zip(steps, color, strict=True))
    return lambda state: of_step[state.step]


class _Stage:
    """Canvas of movies: fixed parts are drawn once, and only the others again for each frame."""

    def __init__(
        self,
        state: State,
        brush: Brush,
        view: View,
        *,
        extent: Extent,
        size: float | None,
        dpi: int,
    ) -> None:
        self._ax = ax = new_axes(extent)
        figure = figure_of(ax)
        figure.set_dpi(dpi)
        self._canvas = FigureCanvasAgg(figure)
        view.set_up(ax, extent, state.scene.grid)
        self._title = ax.set_title("t = 0 s")
        color_bar(figure, brush, ax=ax, location=bar_side(extent))
        self._canvas.draw()  # the layout is computed with everything in it
        box = ax.get_window_extent()
        pixels = math.ceil(max(box.width, box.height))
        self._drawing = Drawing(ax, state, brush, view, extent, size=size, pixels=pixels)
        self._moving = [*self._drawing.artists, self._title]
        for artist in self._moving:
            artist.set_animated(True)
        self._canvas.draw()
        self._background = self._canvas.copy_from_bbox(figure.bbox)

    def shot(self, state: State) -> NDArray[np.uint8]:
        """Draw a state; return its pixels, shape (height, width, 3), height and width even."""
        self._canvas.restore_region(self._background)
        self._title.set_text(f"t = {state.time:.3f} s")
        self._drawing.update(state)
        for artist in self._moving:
            self._ax.draw_artist(artist)
        pixels = np.asarray(self._canvas.buffer_rgba())
        height, width = (n - n % 2 for n in pixels.shape[:2])
        return np.ascontiguousarray(pixels[:height, :width, :3])

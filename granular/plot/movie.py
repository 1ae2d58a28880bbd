"""Movies: one canvas, on which only the points and walls are drawn again for each frame."""

import math
import os
import shutil
import subprocess
import tempfile
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path

import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from numpy.typing import NDArray
from PIL import Image
from tqdm.auto import tqdm

from granular.checks import in_range, integer
from granular.plot.canvas import Extent, View, color_bar, figure_of
from granular.plot.fields import Brush
from granular.plot.frame import Drawing, beside, fitted_extent, new_axes
from granular.record import Trajectory
from granular.state import State

SCANNED = 16
"""Number of frames to which the colour scale and the extent are fitted."""
MAX_FPS = {".gif": 50.0, ".mp4": 240.0}
"""Largest frames per second. A GIF counts hundredths of a second, and viewers show a frame for at
least two."""


def movie(
    record: Sequence[State] | Trajectory,
    path: str | os.PathLike[str],
    *,
    color: str = "shear_rate",
    fps: float = 25.0,
    limits: tuple[float, float] | None = None,
    log: bool | None = None,
    cmap: str | None = None,
    smooth: bool = False,
    size: float | None = None,
    extent: Extent | None = None,
    view: tuple[int, int] | None = None,
    slab: tuple[float, float] | None = None,
    dpi: int = 100,
    overwrite: bool = False,
    progress: bool = False,
) -> Path:
    """Write an animated GIF, or an MP4 if ffmpeg is installed, with every frame of a record.

    To leave out frames, slice the record: `movie(record[::2], ...)`.

    Parameters
    ----------
    record : Trajectory or sequence of State
    path : path
        File to write, ending in .gif or .mp4. It appears when it is complete.
    color, limits, log, cmap, smooth, size, extent, view, slab
        As in `frame`, but `color` must be a name. Scale and extent are the same for all frames; by
        default they are fitted to 16 of them.
    fps : float
        Frames per second, at most 50 in a GIF, where the time of a frame is rounded to whole
        hundredths of a second.
    dpi : int
        Pixels per inch; the picture is 7 inches wide.
    overwrite : bool
        True to replace an existing file.
    progress : bool
        Show a progress bar.

    Returns
    -------
    Path
        Path of the file.

    Raises
    ------
    FileExistsError
        If the file exists and `overwrite` is not set.
    ValueError
        If the record is empty, the path ends otherwise, or .mp4 is asked for without ffmpeg.
    RuntimeError
        If ffmpeg fails.
    """
    path = check_movie(path, overwrite=overwrite)
    fps = in_range("fps", fps, 0.0, MAX_FPS[path.suffix.lower()], open_low=True)
    if len(record) == 0:
        raise ValueError("record has 0 frames, a movie needs at least 1")
    some = np.unique(np.linspace(0, len(record) - 1, SCANNED).astype(int))
    sample = [record[int(i)] for i in some]
    brush = Brush.fitted(sample, color, limits=limits, log=log, cmap=cmap, smooth=smooth)
    seen = View(sample[0].dim, view, slab)
    stage = _Stage(
        sample[0],
        brush,
        seen,
        extent=fitted_extent(sample, seen) if extent is None else extent,
        size=size,
        dpi=integer("dpi", dpi, 20, 600),
    )
    bar = tqdm(record, desc=path.name, unit="frame", disable=not progress)
    with _replacing(path) as target:
        if path.suffix.lower() == ".gif":
            _write_gif(target, [stage.shot(s) for s in sample], (stage.shot(s) for s in bar), fps)
        else:
            _write_mp4(target, (stage.shot(s) for s in bar), fps)
    return path


def check_movie(path: str | os.PathLike[str], *, overwrite: bool = False) -> Path:
    """Check that a movie can be written, before the work is done.

    Raises
    ------
    FileExistsError, FileNotFoundError, ValueError
        As `movie`; FileNotFoundError if the folder does not exist.
    """
    path = Path(path)
    ending = path.suffix.lower()
    if ending not in MAX_FPS:
        raise ValueError(f"path = {str(path)!r} must end in .gif or .mp4")
    if ending == ".mp4" and shutil.which("ffmpeg") is None:
        raise ValueError(f"path = {str(path)!r} must end in .gif: .mp4 needs ffmpeg, not found")
    if not path.parent.is_dir():
        raise FileNotFoundError(f"{path.parent} is not a folder")
    if path.exists() and not overwrite:
        raise FileExistsError(f"{path} exists already; overwrite=True replaces it")
    return path


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
        view.set_up(ax, extent, state.scene.grid.cell)
        self._title = ax.set_title("t = 0 s")
        color_bar(figure, brush, ax=ax, location=beside(extent))
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


def _write_gif(
    target: Path,
    sample: Sequence[NDArray[np.uint8]],
    shots: Iterator[NDArray[np.uint8]],
    fps: float,
) -> None:
    # One palette for all frames, without dithering: pixels at rest do not change and cost nothing.
    palette = Image.fromarray(np.concatenate(sample[:: max(1, len(sample) // 4)])).quantize(255)
    frames = (
        Image.fromarray(shot).quantize(palette=palette, dither=Image.Dither.NONE) for shot in shots
    )
    next(frames).save(
        target,
        format="GIF",
        save_all=True,
        append_images=frames,
        duration=10 * round(100 / fps),
        loop=0,
    )


def _write_mp4(target: Path, shots: Iterator[NDArray[np.uint8]], fps: float) -> None:
    first = next(shots)
    height, width = first.shape[:2]
    command = [
        *("ffmpeg", "-y", "-loglevel", "error", "-f", "rawvideo", "-pix_fmt", "rgb24"),
        *("-s", f"{width}x{height}", "-r", f"{fps:g}", "-i", "-", "-an"),
        *("-pix_fmt", "yuv420p", "-f", "mp4", str(target)),
    ]
    with tempfile.TemporaryFile() as messages:
        process = subprocess.Popen(command, stdin=subprocess.PIPE, stderr=messages, bufsize=0)
        try:
            # If ffmpeg fails it closes its end of the pipe; its message is raised below.
            assert process.stdin is not None
            with suppress(BrokenPipeError), process.stdin as pipe:
                pipe.write(first.tobytes())
                for shot in shots:
                    pipe.write(shot.tobytes())
        except BaseException:
            process.kill()
            process.wait()
            raise
        if process.wait() != 0:
            messages.seek(0)
            said = messages.read().decode(errors="replace").strip().splitlines()
            raise RuntimeError(f"ffmpeg failed: {said[-1] if said else 'without a word'}")


@contextmanager
def _replacing(path: Path) -> Iterator[Path]:
    """Yield a temporary path that replaces `path` on success and is deleted on failure."""
    handle, name = tempfile.mkstemp(prefix=f".{path.name}.", suffix=path.suffix, dir=path.parent)
    os.close(handle)
    target = Path(name)
    try:
        yield target
        # mkstemp makes private files; the movie gets the permissions of any new file.
        mask = os.umask(0)
        os.umask(mask)
        target.chmod(0o666 & ~mask)
        target.replace(path)
    except BaseException:
        target.unlink(missing_ok=True)
        raise

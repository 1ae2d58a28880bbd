"""Movies of pictures: animated GIF, and MP4 by ffmpeg."""

from __future__ import annotations

import os
import shutil
import subprocess
import tempfile
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from granular.tools.checks import in_range
from granular.tools.files import check_file
from granular.tools.notebook import embedded
from granular.tools.progress import bar

SCANNED = 16
"""Number of frames to which the colour scale, the extent and the palette are fitted."""
MAX_FPS = {".gif": 50.0, ".mp4": 240.0}
"""Largest frames per second. A GIF counts hundredths of a second, and viewers show a frame for at
least two."""


def ffmpeg() -> str | None:
    """Path of ffmpeg, of the system or else of imageio-ffmpeg; None if there is none."""
    path = shutil.which("ffmpeg")
    if path is None:
        # RuntimeError: the package is there, but brought no program for this machine.
        with suppress(ImportError, RuntimeError):
            import imageio_ffmpeg

            path = imageio_ffmpeg.get_ffmpeg_exe()
    return path


def sampled(count: int) -> list[int]:
    """Indices of the frames to which a movie of a number of frames is fitted."""
    if count == 0:
        raise ValueError("record has 0 frames, a movie needs at least 1")
    return [int(i) for i in np.unique(np.linspace(0, count - 1, SCANNED).astype(int))]


def check_movie(
    path: str | os.PathLike[str] | None, *, fps: float = 25.0, overwrite: bool = False
) -> None:
    """Check that a movie can be written, before the work is done.

    Parameters
    ----------
    path, fps, overwrite
        See `granular.plot.movie`.

    Raises
    ------
    FileExistsError, FileNotFoundError, TypeError, ValueError
        As `granular.plot.movie`.
    """
    path = Path(_ending() if path is None else path)
    ending = path.suffix.lower()
    if ending not in MAX_FPS:
        raise ValueError(f"path = {str(path)!r} must end in .gif or .mp4")
    if ending == ".mp4" and ffmpeg() is None:
        raise ValueError(
            f"path = {str(path)!r} must end in .gif: .mp4 needs ffmpeg, of the system or by "
            "pip install 'granular-flow[movies]'"
        )
    in_range("fps", fps, 0.0, MAX_FPS[ending], open_low=True)
    if not path.parent.is_dir():
        raise FileNotFoundError(f"{path.parent} is not a folder")
    if path.exists():
        check_file(path)
        if not overwrite:
            raise FileExistsError(f"{path} exists already; overwrite=True replaces it")


def _ending() -> str:
    """Name of a movie in memory."""
    return "movie.gif" if ffmpeg() is None else "movie.mp4"


def make_movie(
    path: str | os.PathLike[str] | None,
    count: int,
    shot: Callable[[int], NDArray[np.uint8]],
    *,
    fps: float,
    overwrite: bool,
    progress: bool,
) -> Movie:
    """Write the pictures `shot(i)` of `count` frames to a file, or without a path store them in
    memory.

    The pictures have the shape (height, width, 3), height and width even.
    """
    check_movie(path, fps=fps, overwrite=overwrite)
    if path is None:
        with tempfile.TemporaryDirectory() as folder:
            target = Path(folder, _ending())
            make_movie(target, count, shot, fps=fps, overwrite=False, progress=progress)
            return Movie(None, target.suffix, target.read_bytes())
    path = Path(path)
    frames: Iterable[int] = range(count)
    if progress:
        frames = bar(iterable=frames, desc=path.name, unit="frame")
    shots = (shot(i) for i in frames)
    with replacing(path) as target:
        if path.suffix.lower() == ".gif":
            _write_gif(target, [shot(i) for i in sampled(count)], shots, fps)
        else:
            _write_mp4(target, shots, fps)
    return Movie(path, path.suffix.lower())


@dataclass(frozen=True)
class Movie:
    """A movie, which plays where a notebook shows it.

    Attributes
    ----------
    path : Path or None
        Its file; None for a movie in memory.
    """

    path: Path | None
    _ending: str = field(repr=False)
    _content: bytes = field(default=b"", repr=False)

    @property
    def content(self) -> bytes:
        """Content of the file."""
        return self._content if self.path is None else self.path.read_bytes()

    def __fspath__(self) -> str:
        if self.path is None:
            raise ValueError("a movie in memory has no file: give a path to make one")
        return str(self.path)

    def _repr_html_(self) -> str:
        if self._ending == ".gif":
            return f"<img alt='movie' src='{embedded(self.content, 'image/gif')}'>"
        source = embedded(self.content, "video/mp4")
        return f"<video controls autoplay loop muted playsinline src='{source}'></video>"


def _write_gif(
    target: Path,
    sample: Sequence[NDArray[np.uint8]],
    shots: Iterator[NDArray[np.uint8]],
    fps: float,
) -> None:
    """Write pictures as an animated GIF, with a palette that suits the pictures of a sample."""
    # One palette for all frames, without dithering: pixels at rest do not change and take no space.
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
    """Write pictures as an MP4 that browsers play.

    Raises
    ------
    RuntimeError
        If ffmpeg fails.
    """
    first, program = next(shots), ffmpeg() or "ffmpeg"
    height, width = first.shape[:2]
    command = [
        *(program, "-y", "-loglevel", "error", "-f", "rawvideo", "-pix_fmt", "rgb24"),
        *("-s", f"{width}x{height}", "-r", f"{fps:g}", "-i", "-", "-an"),
        *("-pix_fmt", "yuv420p", "-movflags", "+faststart", "-f", "mp4", str(target)),
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
            lines = messages.read().decode(errors="replace").strip().splitlines()
            raise RuntimeError(f"ffmpeg failed: {lines[-1] if lines else 'without a word'}")


@contextmanager
def replacing(path: Path) -> Iterator[Path]:
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

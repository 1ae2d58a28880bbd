"""Reading of records, finished or not, lazily and with verification."""

import json
import os
from collections.abc import Iterator
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any, Self, overload

import numpy as np

from granular.model.symmetric import modelled_share
from granular.record import older_checkpoints
from granular.record.checkpoint import Checkpoint
from granular.record.frame import BODY, NUMBERED, SCALARS, WALL, Frame, names_of, samples_of
from granular.record.index import Contents, load
from granular.record.layout import FORMAT, RecordError, reading
from granular.tools.checks import truth
from granular.tools.notebook import table
from granular.tools.resources import Resource

if TYPE_CHECKING:
    from granular.model.state import State
    from granular.model.typing import AnyScene
    from granular.mpm.bodies import BodyState
    from granular.run.diagnostics import Health
    from granular.sph.gas import GasState


class Trajectory(Resource):
    """A sequence of states in a record; each state is read and verified on access.

    `open_trajectory` makes one. A slice is a trajectory too, over the same file.
    """

    _instead = "open the record again, by its path; a slice of it, record[:], shares its file"

    def __init__(self, contents: Contents, frames: list[Frame] | None = None) -> None:
        self._contents = contents
        self._frames = contents.frames if frames is None else frames

    @property
    def path(self) -> Path:
        """Path of the file."""
        return self._contents.path

    @property
    def finished(self) -> bool:
        """True if the record is one closed file; otherwise its writer is running or was killed."""
        return self._contents.finished

    @property
    def has_checkpoint(self) -> bool:
        """True if a run can be resumed from this record."""
        return self._contents.has_checkpoint

    @property
    def has_gas(self) -> bool:
        """True if there are frames with gas particles, the attribute `gas` of a state."""
        return any("gas" in frame.others for frame in self._frames)

    @property
    def has_tractions(self) -> bool:
        """True if there are frames with patches of walls and bodies."""
        return any("patches" in frame.others for frame in self._frames)

    @cached_property
    def scene(self) -> "AnyScene":
        """The scene of the run, of the class that belongs to its method (MPM or SPH)."""
        # Imported here: a scene needs the whole package, a record does not.
        from granular.tools.serializable import Serializable

        with reading(self.path, "the scene cannot be read"):
            scene: Any = Serializable.from_json(self._contents.texts.scene)
        return scene

    @cached_property
    def provenance(self) -> dict[str, Any]:
        """Versions, build, machine, start (UTC), ``parent`` and ``earlier`` sessions."""
        return json.loads(self._contents.texts.provenance)

    @cached_property
    def series(self) -> dict[str, np.ndarray]:
        """Scalars of every frame: time [s], step, dt [s], n, total mass [kg]; shape (frames,)."""
        return {name: np.array([getattr(f, name) for f in self._frames]) for name in SCALARS}

    @cached_property
    def samples(self) -> dict[str, np.ndarray]:
        """Values of the indicators of failure of the run up to every frame, by their names.

        Each has shape (frames,), with nan where there is no value; "samples" is the number of
        samples of the monitor by then. The mapping is empty without a monitor.
        """
        columns = samples_of(self._frames)
        return {name: column for name, column in columns.items() if not NUMBERED.fullmatch(name)}

    @cached_property
    def bodies(self) -> np.ndarray:
        """Numbers that describe the rigid bodies at every frame, shape (frames, bodies, 20).

        See `granular.measure.body_motion` and `granular.measure.body_force`.
        """
        return self._rows_of(BODY)

    @cached_property
    def walls(self) -> np.ndarray:
        """Numbers of the walls and blocks at every frame, shape (frames, walls, 9).

        Impulse, angular impulse and, for moving walls, the numbers of
        `granular.mpm.walls.WallState`. There are no walls unless the simulation was made with
        `wall_forces`, or has such a wall. See `granular.measure.wall_force`.
        """
        return self._rows_of(WALL)

    def _rows_of(self, prefix: str) -> np.ndarray:
        """Numbers of bodies or walls at every frame, shape (frames, count, numbers)."""
        samples = samples_of(self._frames)
        parts = [match.groups() for name in samples if (match := NUMBERED.fullmatch(name))]
        which = [(int(i), int(k)) for kind, i, k in parts if kind == prefix]
        count, numbers = np.max(which, axis=0) + 1 if which else (0, 0)
        with reading(self.path):
            columns = [samples[name] for name in names_of(prefix, count, numbers)]
        return np.array(columns).reshape(count, numbers, len(self)).transpose(2, 0, 1)

    def patches(self) -> list[dict[str, np.ndarray]]:
        """Read the patches of walls and bodies at every frame, of a simulation with `tractions`.

        Later frames have those of earlier ones first, in the same order. See
        `granular.mpm.patches.patch_fields` for the fields; frames before the first contact have
        none.
        """
        frames = (frame.others.get("patches") for frame in self._frames)
        return [self._fields(frame) if frame else {} for frame in frames]

    def health(self) -> "Health":
        """Judge the run up to the last of these frames, as the simulation itself did.

        A run that was not monitored is judged by that frame. The indicators that need more than a
        frame have no value then.
        """
        # Imported here: reading a record does not need the whole package.
        from granular.run.diagnostics import health, health_of_frame

        last = {name: float(column[-1]) for name, column in self.samples.items() if len(column)}
        if len(self) and np.isnan(last.get("samples", np.nan)):
            return health_of_frame(self[-1])
        return health(self.scene, last)

    @property
    def times(self) -> np.ndarray:
        """Times of the frames [s], shape (frames,)."""
        return self.series["time"]

    def __len__(self) -> int:
        return len(self._frames)

    @overload
    def __getitem__(self, index: int) -> "State": ...
    @overload
    def __getitem__(self, index: slice) -> "Trajectory": ...
    def __getitem__(self, index: int | slice) -> "State | Trajectory":
        if isinstance(index, slice):
            return Trajectory(self._contents, self._frames[index])
        try:
            frame = self._frames[index]
        except IndexError:
            raise IndexError(f"frame {index} must be in [{-len(self)}, {len(self) - 1}]") from None
        from granular.model.state import State

        scene, fields = self.scene, self._fields(frame)
        extra: dict[str, Any] = {}
        if "gas" in frame.others:
            extra["gas"] = self._gas(frame.others["gas"])
        if scene.bodies:
            extra["bodies"] = self._body_states(frame)
        with reading(self.path):
            return State(
                scene=scene, time=frame.time, step=frame.step, dt=frame.dt, fields=fields, **extra
            )

    def _fields(self, frame: Frame) -> dict[str, np.ndarray]:
        """Read the fields of a frame, in double precision however they are stored."""
        return {
            name: array.astype(float) if array.dtype.kind == "f" else array
            for name, array in self._contents.read(frame).items()
        }

    def _body_states(self, frame: Frame) -> "list[BodyState]":
        # Imported here: a record need not have bodies.
        from granular.mpm.bodies import NUMBERS, state_of

        names = names_of(BODY, len(self.scene.bodies), NUMBERS)
        with reading(self.path):
            rows = np.array([frame.samples[name] for name in names]).reshape(-1, NUMBERS)
        return [state_of(row, self.scene.dim) for row in rows]

    def _gas(self, frame: Frame) -> "GasState":
        # Imported here: only records with gas need it.
        from granular.sph.gas import GasState

        fields = self._fields(frame)
        with reading(self.path):
            return GasState(time=frame.time, **fields)

    def __iter__(self) -> "Iterator[State]":
        for i in range(len(self)):
            yield self[i]

    def checkpoint(self, frame: int | None = None) -> Checkpoint:
        """Read and verify the newest restart state, or that of a frame.

        Parameters
        ----------
        frame : int, optional
            Index of a frame, one of `checkpoint_frames`; by default the newest restart state.

        Raises
        ------
        ValueError
            If none was stored of the frame.
        RecordError
            If there is none, or it is damaged.
        """
        if frame is None:
            return self._contents.checkpoint()
        frames = self.checkpoint_frames
        index = range(len(self))[frame] if -len(self) <= frame < len(self) else frame
        if index not in frames:
            raise ValueError(f"frame = {frame} must be one of those stored: {frames or 'none'}")
        return older_checkpoints.read(self.path, self._frames[index])

    @property
    def checkpoint_frames(self) -> list[int]:
        """Indices of the frames with stored checkpoints, for `Simulation.resume`."""
        return older_checkpoints.frames_with(self.path, self._frames)

    def damage(self) -> list[str]:
        """Read everything; return one message for each damaged part, none if all is well."""
        messages = list(self._contents.spoilt)
        for frame in self._frames:
            try:
                for part in frame.each():
                    self._contents.read(part)
            except RecordError as error:
                messages.append(str(error))
        try:
            if self.has_checkpoint:
                self.checkpoint()
        except RecordError as error:
            messages.append(str(error))
        return messages

    def close(self) -> None:
        """Close the file, also for the slices of this trajectory."""
        self._contents.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def __repr__(self) -> str:
        span = f", t = {self.times[0]:g} .. {self.times[-1]:g} s" if len(self) else ""
        state = "" if self.finished else ", unfinished"
        return f"<Trajectory {self.path.name}: {len(self)} frames{span}{state}>"

    def _repr_html_(self) -> str:
        n = self.series["n"]
        rows = {
            "file": self.path.name + ("" if self.finished else " (unfinished)"),
            "frames": len(self),
            "time [s]": f"{self.times[0]:g} to {self.times[-1]:g}" if len(self) else "",
            "points": f"{n.min()} to {n.max()}" if len(self) else "",
            "checkpoint": "yes" if self.has_checkpoint else "no",
            "granular": self.provenance.get("granular"),
        }
        return table(f"Trajectory of {self.scene.name}", rows)


def open_trajectory(path: str | os.PathLike[str]) -> Trajectory:
    """Open a record, finished or not, for reading; nothing is written.

    Parameters
    ----------
    path : path
        File of the record, as given to `Simulation.run` by `save`.

    Raises
    ------
    FileNotFoundError
        If there is no such record.
    FileExistsError
        If there is an unfinished record, and at its path a file that does not belong to it.
    RecordError
        If the file is not a record, is damaged, or is newer than this version.
    """
    return Trajectory(load(Path(path)))


def info(path: str | os.PathLike[str], *, total: bool = True) -> dict[str, Any]:
    """Read and verify a whole record and return a summary.

    Parameters
    ----------
    path : path-like
    total : bool
        True for the mass of the whole set-up, also where planes of symmetry leave a part of it
        (`granular.model.symmetric`); False for that of the modelled part, whose points ``n``
        counts.

    Returns
    -------
    dict
        ``path``, ``format``, ``scene`` (name), ``frames``, ``times`` (first, last) [s], ``n``
        (first, last), ``mass`` (first, last) [kg; in 2D per metre of depth] and ``share``, the part
        of the whole set-up that is modelled, ``steps`` (first, last), ``checkpoint_step`` (None: no
        checkpoint), ``finished``, ``provenance``, ``digest_ok``, ``damage`` (messages). The pairs
        are None for a record without frames.

    Raises
    ------
    FileNotFoundError, RecordError
        As `open_trajectory`.
    """
    with open_trajectory(path) as record:
        damage = record.damage()

        def ends(name: str) -> tuple[Any, Any] | None:
            column = record.series[name]
            return (column[0].item(), column[-1].item()) if len(column) else None

        share, mass = modelled_share(record.scene), ends("mass")
        if mass is not None and truth("total", total):
            mass = (mass[0] / share, mass[1] / share)
        try:
            step = record.checkpoint().step
        except RecordError:
            step = None
        return {
            "path": str(record.path),
            "format": FORMAT,
            "scene": record.scene.name,
            "frames": len(record),
            "times": ends("time"),
            "n": ends("n"),
            "mass": mass,
            "share": share,
            "steps": ends("step"),
            "checkpoint_step": step,
            "finished": record.finished,
            "provenance": record.provenance,
            "digest_ok": not damage,
            "damage": damage,
        }

"""Base class of simulations: step, run, record, stop and resume, the same for all methods."""

from __future__ import annotations

import os
from collections.abc import Collection, Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any, Literal, Self, cast, overload

import numpy as np

from granular import _core
from granular.record import Checkpoint
from granular.record.checkpoint import CheckpointRows
from granular.record.session import Session
from granular.record.settings import DOUBLE
from granular.run.interrupts import DeferredSignals
from granular.run.machine import Machine
from granular.run.recorder import Hook, Recorded, Recorder
from granular.run.resuming import resumed
from granular.run.running import (
    CHECKPOINT_MINUTES,
    EVERY,
    MOST_STEPS,
    Chunks,
    Soundness,
    warn_of_threads,
)
from granular.run.sampled import Sampled
from granular.run.turns import Turns, alone
from granular.tools.checks import integer, positive
from granular.tools.progress import progress_bar

if TYPE_CHECKING:
    from granular.model.typing import AnyScene
    from granular.mpm.scene import Scene as MpmScene
    from granular.mpm.simulation import Simulation as MpmSimulation
    from granular.sph.scene import Scene as SphScene
    from granular.sph.simulation import Simulation as SphSimulation


SimulationError = _core.SimulationError


class Simulation(Sampled):
    """Advance the points of a scene in time, by the method of the scene.

    A `granular.Scene` is solved by the material point method (`granular.mpm.simulation`), a
    `granular.sph.Scene` by SPH, smoothed particle hydrodynamics (`granular.sph`).

    Parameters
    ----------
    scene : Scene or sph.Scene
    threads : int, optional
        Threads of the core; by default all processors that the process may use, and one for scenes
        of at most 4000 points. The results do not depend on it, to the last bit.
    isa : str, optional
        Instruction set of the kernels, "baseline", "avx2" or "avx512", or "one_lane", which has the
        bits of the latter two and is slow; by default the environment variable GRANULAR_ISA, else
        the best that the machine has.
    device : {"gpu", "emulated"}, optional
        What makes the steps of the material point method instead of the processor, with the bits of
        `isa="one_lane"`, "avx2" and "avx512": the first GPU of the machine, or for tests threads of
        the processor in its place; see :doc:`/how-to/gpu`.
    force : bool
        If True, try also a scene that needs more memory than there is, by the estimate of
        `granular.economy.cost`.
    wall_forces : bool
        For the material point method: add up the impulses on walls and blocks, see
        `granular.measure.wall_force`.
    tractions : bool
        For the material point method: add up the impulses on patches of walls and bodies, too, see
        `granular.measure.wall_traction`.
    comm : mpi4py.MPI.Comm, optional
        Processes that share the run, of the material point method: rank 0 has the simulation, and
        the same call lets all others work for it until it ends; see `granular.ranks`.

    Raises
    ------
    TypeError
        If `scene` is not a scene.
    ValueError
        If the time step exceeds its limit, the scene cannot be built, it needs more memory than
        there is (of the GPU, if that makes the steps), `threads`, `isa` or `device` is out of
        range, or the device does not have a part of the scene.
    RuntimeError
        If there is no GPU, driver or kernel for ``device="gpu"``, or one of them is too old.

    Warns
    -----
    StabilityWarning
        For settings that are known to fail without an error, see `granular.scene_warnings`.
    """

    @overload
    def __new__(
        cls,
        scene: MpmScene,
        *,
        threads: int | None = None,
        isa: str | None = None,
        device: str | None = None,
        force: bool = False,
        wall_forces: bool = False,
        tractions: bool = False,
        comm: Any = None,
    ) -> MpmSimulation: ...
    @overload
    def __new__(
        cls,
        scene: SphScene,
        *,
        threads: int | None = None,
        isa: str | None = None,
        device: str | None = None,
        force: bool = False,
        comm: Any = None,
    ) -> SphSimulation: ...
    def __new__(cls, scene: object = None, *, comm: Any = None, **_: Any) -> Simulation:
        method = cls._of(scene)
        return super().__new__(method if comm is None else method._shared())

    def _start(self, scene: AnyScene, engine: _core.Engine | _core.Sph, machine: Machine) -> None:
        """Set the attributes that every simulation has; subclasses make engine and buffers."""
        self.scene = scene
        self._engine = engine
        self._threads = machine.threads
        self._chunks = Chunks()
        self._session = Session()
        self._every = EVERY
        self._stored: tuple[str, ...] = ()  # derived fields of frames
        self._precision = DOUBLE  # of frames
        self._keeps = 0  # frames from one stored checkpoint to the next; 0 for none
        self._soundness = Soundness()
        self._due: int | None = None  # step of a frame that could not be taken or stored
        self._ended_by: Hook | None = None
        self._watch(scene)
        self._turns = Turns()
        self._recorder: Recorder | None = None  # of `recording`

    @property
    def ended_by(self) -> Hook | None:
        """The hook that ended the last run; None if no hook did."""
        return self._ended_by

    # ---- stepping ----

    @alone
    def step(self, n: int = 1) -> None:
        """Make `n` steps, at least 1; errors as in `run`. Frames are stored within `recording`."""
        target = self.steps + integer("n", n, 1, MOST_STEPS - self.steps)
        if self._recorder:
            self._recorder.advance(np.inf, target)
            return
        for _ in self._chunks.advance(self, np.inf, target):
            pass

    def _advance(self, max_steps: int, until: float) -> None:
        """Call the core; signals wait until the steps are complete."""
        with DeferredSignals(), self._soundness:
            self._make_steps(max_steps, until)
            refused = self._engine.refused_threads
        if refused and "threads" not in self._warned:
            self._warned.add("threads")
            warn_of_threads(self.threads, refused)

    @alone
    def run(
        self,
        until: float | None = None,
        *,
        save: str | os.PathLike | None = None,
        every: float | None = None,
        fields: Collection[str] | None = None,
        precision: str | None = None,
        checkpoint_minutes: float = CHECKPOINT_MINUTES,
        checkpoints: int | Literal["all"] | None = None,
        overwrite: bool = False,
        progress: bool = False,
        hooks: tuple[Hook, ...] = (),
        monitor: bool = True,
        gas: bool = True,
        time_limit: float | None = None,
    ) -> Self:
        """Run to a time and record frames on the way.

        If all points have left the domain, time and frames go on without them.

        Parameters
        ----------
        until : float, optional
            Time to stop at [s]; by default the duration of the scene. The last step is the first
            one at or past it.
        save : path, optional
            HDF5 record to write; ParaView opens it if its name ends in ".vtkhdf", and then the
            surfaces of bodies are written to ``<name>_bodies.vtkhdf`` when the run ends. A
            simulation that was resumed continues its own record.
        every : float, optional
            Time between frames [s]; a frame is the first step at or past its time. By default the
            interval of the previous run, which is also stored in a record, and 1/60 s in the first
            run.
        fields : collection of str, optional
            Quantities that the frames of the record hold in addition, so that ParaView shows them
            at once: "pressure", "speed", "density", "shear_stress", "mu", "inertial_number",
            "volume", "nodal_density", ..., see `granular.measure.derived`. Each makes frames larger
            by a number per point. By default the fields of the previous run; none in the first run.
        precision : {"double", "single"}, optional
            Precision of the frames of the record. In single precision all but the positions of the
            points are rounded, and they take little more than half of the space; checkpoints, and
            with them the results of resumed runs, remain exact. By default that of the previous
            run; double in the first run.
        checkpoint_minutes : float
            Wall-clock time between two checkpoints of the record [min], > 0, may be infinite. One
            is also stored at the beginning and at the end of a run, and when it is interrupted or
            an error ends it, except a `SimulationError`.
        checkpoints : int or "all", optional
            Store the checkpoints of all frames, or of each so many, so that `resume` can begin with
            them, in the folder ``<save>.checkpoints``; by default only the newest is stored, in the
            record. Each takes about twice as much space as a frame.
        overwrite : bool
            If True, replace an existing record.
        progress : bool
            Show a progress bar; in a notebook a widget, if ipywidgets is installed
            (``pip install 'granular-flow[notebook]'``).
        hooks : sequence of callables
            Called with the simulation at each frame. One that returns True ends the run, such as
            those of `granular.stop`, and is `ended_by` then; so does an exception. They may read
            it, and write to its `buffers`, but not step or run it: that raises RuntimeError.
            `granular.plot.Live` is one that shows the run.
        monitor : bool
            Take samples for the indicators of failure, see `health`; the record stores these for
            each frame. All samples take as long as some hundred steps (`granular.run.monitor`).
        gas : bool
            For scenes with a gas, store it in the frames of the record; checkpoints hold it in any
            case.
        time_limit : float, optional
            Wall-clock time after which the run ends [s], > 0, between two steps and with a
            checkpoint. Its `time` is then less than `until`, and another run goes on exactly.

        Raises
        ------
        TypeError, ValueError
            For arguments out of range, `fields` that the scene does not have, and `fields` or a
            `precision` other than those of a record that goes on.
        FileExistsError
            If the record, or the file of its bodies, exists and `overwrite` is not set.
        BlockingIOError
            If another run is writing the record.
        OSError
            If the record cannot be written; an existing record is intact. The next run of this
            object continues the record, and stores the missing frame.
        SimulationError
            If a point is not finite or moved too far in a step; the attributes `point` and `step`
            name it. If a free body has met an end of the domain without a wall, or is pressed into
            another solid by prescribed motions; the attributes are `body` and `step`. The record
            holds the frames before, and the last checkpoint.
        RuntimeError
            If this simulation makes steps already: in a hook of its run, or in another thread.
        KeyboardInterrupt
            On Ctrl-C, and on SIGTERM and SIGUSR1, by which batch systems end a job, unless the
            program handles them; the simulation and the record stay valid and can be continued. The
            same holds for any exception of a signal handler: handlers run between steps, within
            about 0.05 s.

        Warns
        -----
        StabilityWarning
            At the end, for each indicator that is suspect by the samples of the run, with a remedy;
            see `health`. Once for each indicator, if the run is continued.
        RuntimeWarning
            If the system refuses threads; the run goes on with fewer, and the same results.
        """
        until = self.scene.duration if until is None else positive("until", until)
        limit = np.inf if time_limit is None else positive("time_limit", time_limit)
        options = Recorded(
            save=save,
            every=every,
            fields=fields,
            precision=precision,
            checkpoint_minutes=checkpoint_minutes,
            checkpoints=checkpoints,
            overwrite=overwrite,
            monitor=monitor,
            gas=gas,
        )
        with (
            self._recorder_for(options, until, hooks) as recorder,
            progress_bar(self.scene.name, self.time, until, progress) as bar,
        ):
            recorder.advance(until, MOST_STEPS, hooks, lambda time: bar.update(time - bar.n), limit)
        if monitor and not self._recorder:
            self._warn_of_health()
        return self

    @contextmanager
    def recording(
        self,
        save: str | os.PathLike | None = None,
        *,
        every: float | None = None,
        fields: Collection[str] | None = None,
        precision: str | None = None,
        checkpoint_minutes: float = CHECKPOINT_MINUTES,
        checkpoints: int | Literal["all"] | None = None,
        overwrite: bool = False,
        monitor: bool = True,
        gas: bool = True,
    ) -> Iterator[Self]:
        """Record the steps and runs of a ``with`` block, which may do other things between them.

        The record is that of a single run: frames at the multiples of `every`, checkpoints at the
        beginning, at the end and now and then. A program that exchanges forces and velocities with
        the simulation uses it, see `granular.mpm.simulation.Simulation.set_motion`. Within the
        block `run` takes its `hooks` and `progress` alone.

        Parameters
        ----------
        save, every, fields, precision, checkpoint_minutes, checkpoints, overwrite, monitor, gas
            As of `run`. Without `save` the record of an earlier run goes on.

        Raises
        ------
        TypeError, ValueError, FileExistsError, BlockingIOError, OSError
            As by `run`.
        RuntimeError
            Within such a block.

        Examples
        --------
        >>> sim = gr.Simulation(gr.scenes.column_collapse(cell=0.05, E=1e6))
        >>> with sim.recording("column.h5", every=0.01):
        ...     while sim.time < 0.05:
        ...         sim.step(10)
        """
        options = Recorded(
            save=save,
            every=every,
            fields=fields,
            precision=precision,
            checkpoint_minutes=checkpoint_minutes,
            checkpoints=checkpoints,
            overwrite=overwrite,
            monitor=monitor,
            gas=gas,
        )
        if self._recorder:
            raise RuntimeError("recording: the simulation is recorded already, in another block")
        with options.opened(self, self.time) as self._recorder:
            try:
                yield self
            finally:
                self._recorder = None
        if monitor:
            self._warn_of_health()

    @contextmanager
    def _recorder_for(
        self, options: Recorded, end: float, hooks: tuple[Hook, ...]
    ) -> Iterator[Recorder]:
        """Yield what advances a run: of the block of `recording` around it, or its own."""
        if self._recorder is None:
            with options.opened(self, end, hooks) as recorder:
                yield recorder
            return
        if options != Recorded():
            raise ValueError("run: what is recorded is set by the block of `recording` around it")
        yield self._recorder

    # ---- restart ----

    def checkpoint(self) -> Checkpoint:
        """Return all data of a bitwise restart: points in the order of rows, time and step.

        Raises
        ------
        SimulationError
            If one has ended a step of this simulation.
        """
        return self._checkpoint_rows().whole()

    def _checkpoint_rows(self) -> CheckpointRows:
        """Return a checkpoint to be stored before the next step."""
        self._soundness.check()
        scalars, arrays = self._checkpoint_data()
        return CheckpointRows(
            time=scalars["time"],
            step=int(scalars["step"]),
            dt=scalars["dt"],
            scalars=scalars,
            arrays=arrays | self._monitor.arrays(),
        )

    @classmethod
    def from_checkpoint(
        cls,
        scene: AnyScene,
        checkpoint: Checkpoint,
        *,
        threads: int | None = None,
        isa: str | None = None,
        device: str | None = None,
        comm: Any = None,
    ) -> Self:
        """Return a simulation that continues from a checkpoint as if it had never stopped.

        Parameters
        ----------
        scene, threads, isa, device, comm
            See `Simulation`.
        checkpoint : Checkpoint
            Result of `checkpoint` or `Trajectory.checkpoint` for this scene.

        Raises
        ------
        TypeError, ValueError
            If `scene` is not a scene, or the checkpoint does not fit it.
        """
        method, machine = cls._of(scene), Machine(threads, isa, device)
        if comm is None:
            return method._restored(scene, checkpoint, machine)
        shared, ranks = method._shared(), cls._attend(comm)
        return cast("Self", shared._restored_by(ranks, scene, checkpoint, machine))

    @classmethod
    def resume(
        cls,
        path: str | os.PathLike,
        *,
        scene: AnyScene | None = None,
        frame: int | None = None,
        threads: int | None = None,
        isa: str | None = None,
        device: str | None = None,
        trust_code: bool = False,
        comm: Any = None,
    ) -> Self:
        """Continue a record from its checkpoint, bitwise as if the run had never stopped.

        Parameters
        ----------
        path : path
            Record of the run.
        scene : Scene or sph.Scene, optional
            A changed scene with which the run goes on, such as
            ``gr.open(path).scene.replace(gravity=...)``: other gravity, numbers of the material or
            the scheme, walls, motions of bodies. The grid, the laws, the basis, the transfer and
            the kind of density of the scheme, the inflows, the numbers of walls and bodies, and the
            shapes and initial positions of the bodies must be as before. The stress of a
            hypoelastic material does not change, and its density follows from it; that of a Hencky
            material follows from its strain. The record of the run is not changed: name another one
            in `run`.
        frame : int, optional
            Index of the frame to begin with, one of `Trajectory.checkpoint_frames`; by default the
            newest checkpoint. Frames that equal the recorded ones are not stored again; from the
            first one that differs, the record is replaced.
        threads : int, optional
            See `Simulation`.
        isa : str, optional
            Instruction set of the kernels; by default the one that the record was made with, since
            the last bits depend on it, or another one with the same bits.
        device : str, optional
            See `Simulation`; the record may be of a processor, and the other way round.
        trust_code : bool
            Run the C code of a law that the record holds, see `granular.materials.trust_code`.
        comm : mpi4py.MPI.Comm, optional
            Processes that share the run, as of `Simulation`; the record may be of any number.

        Raises
        ------
        FileNotFoundError
            If there is no such record.
        RecordError
            If the file is damaged or holds no checkpoint, or one that does not fit its scene.
        TypeError, ValueError
            If the points of the record do not fit into the changed scene, no checkpoint of the
            frame was stored, or `threads`, `isa` or `device` is out of range.

        Warns
        -----
        UserWarning
            If this machine does not have the instruction set of the record. The run then continues
            with another one, and differs from an unbroken run by rounding errors, which grow.
        """
        ranks = None if comm is None else cls._attend(comm)
        machine = Machine(threads, isa, device)
        return cast("Self", resumed(cls, path, scene, frame, machine, trust_code, ranks))

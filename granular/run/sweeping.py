"""Sweeps: many scenes run by an executor, each with its own record, so that a sweep can resume."""

from __future__ import annotations

import os
import pickle
import re
import shutil
import tempfile
import warnings
import weakref
from collections.abc import (
    Callable,
    Collection,
    Generator,
    Hashable,
    Iterable,
    Iterator,
    Mapping,
    Sequence,
)
from concurrent.futures import Future, ProcessPoolExecutor, as_completed
from contextlib import closing, contextmanager, suppress
from dataclasses import fields, is_dataclass
from functools import partial
from inspect import signature
from multiprocessing import get_context
from numbers import Real
from pathlib import Path
from typing import Any, Protocol

from granular.measure.result import Result, Table
from granular.model.typing import AnyScene
from granular.record import RecordError, open_trajectory
from granular.run.cases import (
    Case,
    Failure,
    Measure,
    Options,
    enlist,
    run_case,
    run_in_pool,
    stage_of,
)
from granular.run.recorder import Hook
from granular.run.running import CHECKPOINT_MINUTES
from granular.run.simulation import Simulation
from granular.tools.checks import integer, positive, truth
from granular.tools.extras import imported
from granular.tools.progress import bar
from granular.tools.serializable import Serializable

__all__ = ["Executor", "Sweep", "sweep"]

NAME = re.compile(r"[A-Za-z0-9_+-][A-Za-z0-9_+=,.-]{0,199}")
"""File names of records, without suffix, that every file system accepts."""


class Executor(Protocol):
    """Protocol of the object that runs the cases: `submit` as in `concurrent.futures`."""

    def submit(self, function: Callable[..., Any], /, *arguments: Any) -> Future:
        """Schedule a call of the function with these arguments and return its future."""


class Sweep(Sequence):
    """The results of a sweep, in the order of its cases; None for a case that failed.

    Without a `measure` the results are the records (`Trajectory`), each opened on access.

    Attributes
    ----------
    keys : tuple
        Keys of the cases: those of the mapping, or 0, 1, 2, ...
    paths : tuple of Path
        Paths of the records.
    errors : dict
        Exceptions by the keys of the cases that failed; empty if none failed.
    """

    def __init__(self, cases: Sequence[Case]) -> None:
        self.keys = tuple(case.key for case in cases)
        self.paths = tuple(case.path for case in cases)
        self.errors: dict[Hashable, Exception] = {}
        self._measured = cases[0].measure is not None
        self._values: list[Any] = [None] * len(cases)

    def _take(self, index: int, outcome: Any) -> None:
        if not isinstance(outcome, Failure):
            self._values[index] = outcome
            return
        key, error = self.keys[index], outcome.error
        self.errors[key] = error
        # stacklevel: this method, `sweep`, its caller
        warnings.warn(
            f"case {key!r} failed: {type(error).__name__}: {error}", RuntimeWarning, stacklevel=3
        )

    def __len__(self) -> int:
        return len(self.keys)

    def __getitem__(self, index: int | slice) -> Any:
        if isinstance(index, slice):
            return [self[i] for i in range(len(self))[index]]
        try:
            key = self.keys[index]
        except IndexError:
            raise IndexError(f"case {index} must be in [{-len(self)}, {len(self) - 1}]") from None
        if self._measured or key in self.errors:
            return self._values[index]
        return open_trajectory(self.paths[index])

    def to_dataframe(self, names: Sequence[str] | None = None) -> Any:
        """Return the results as a `pandas.DataFrame` with a row for each case.

        Its method ``to_xarray`` makes a data set of it, with a dimension for each part of the keys.

        Parameters
        ----------
        names : sequence of str, optional
            Names of the parts of the keys, one if the keys are no tuples. By default "case", or
            "key_0", "key_1" and so on for tuples.

        Returns
        -------
        pandas.DataFrame
            The keys are its index. A result that is a mapping or a dataclass has a column for each
            of its entries; other results are the column "result". Cases that failed have nan, and
            their errors are the column "error", which is there if a case failed. The units of
            results of `granular.measure` are in ``attrs["units"]``.

        Raises
        ------
        ModuleNotFoundError
            Without pandas: ``pip install 'granular-flow[tables]'``.
        ValueError
            If the sweep was made without a `measure`, or `names` do not fit the keys.
        """
        pandas = imported("pandas", "tables")
        labels = self._labels(names)
        index = (
            pandas.MultiIndex.from_tuples(self.keys, names=labels)
            if isinstance(self.keys[0], tuple)
            else pandas.Index(self.keys, name=labels[0])
        )
        table = pandas.DataFrame(self._rows(), index=index)
        table.attrs["units"] = self._units()
        return table

    def to_csv(
        self,
        path: str | os.PathLike[str],
        names: Sequence[str] | None = None,
        *,
        overwrite: bool = False,
    ) -> None:
        """Write the results as text with commas, which spreadsheets open: a row for each case.

        The columns are the parts of the keys and those of `to_dataframe`, with their units.

        Parameters
        ----------
        path : path
            File to write.
        names : sequence of str, optional
            As of `to_dataframe`.
        overwrite : bool
            If True, replace an existing file.

        Raises
        ------
        FileExistsError
            If the file exists and `overwrite` is not set.
        ValueError
            As by `to_dataframe`.
        """
        labels, rows = self._labels(names), self._rows()
        keys = [key if isinstance(key, tuple) else (key,) for key in self.keys]
        columns = dict(zip(labels, zip(*keys, strict=True), strict=True))
        for name in dict.fromkeys(name for row in rows for name in row):
            columns[name] = tuple(row.get(name) for row in rows)
        Table(columns, {}, self._units()).to_csv(path, overwrite)

    def _labels(self, names: Sequence[str] | None) -> list[str]:
        """Names of the parts of the keys."""
        if not self._measured:
            raise ValueError("measure = None: a table needs a sweep with a measure")
        parts = {len(key) if isinstance(key, tuple) else 0 for key in self.keys}
        if len(parts) > 1:
            raise ValueError(f"keys = {self.keys} must be tuples of one length for a table")
        (count,) = parts
        usual = [f"key_{k}" for k in range(count)] if count else ["case"]
        labels = usual if names is None else list(names)
        if len(labels) != len(usual):
            raise ValueError(f"names = {labels} must name {len(usual)} parts of the keys")
        return labels

    def _rows(self) -> list[dict[str, Any]]:
        """Columns of each result, with the error of each case if one failed."""
        rows = [_row(value) for value in self._values]
        if self.errors:
            for row, key in zip(rows, self.keys, strict=True):
                error = self.errors.get(key)
                row["error"] = None if error is None else f"{type(error).__name__}: {error}"
        return rows

    def _units(self) -> dict[str, str]:
        """Units of the columns of results of `granular.measure`."""
        known = [value.UNITS for value in self._values if isinstance(value, Result)]
        return dict(known[0]) if known else {}

    def __repr__(self) -> str:
        return f"<Sweep of {len(self)} cases, {len(self.errors)} failed>"


def _row(value: Any) -> dict[str, Any]:
    """Columns of a result; none for that of a case that failed."""
    if value is None:
        return {}
    if isinstance(value, Mapping):
        return {str(name): part for name, part in value.items()}
    if is_dataclass(value) and not isinstance(value, type):
        return {part.name: getattr(value, part.name) for part in fields(value)}
    return {"result": value}


def sweep(
    cases: Iterable[AnyScene] | Mapping[Hashable, AnyScene],
    executor: Executor | None = None,
    *,
    measure: Measure | None = None,
    folder: str | os.PathLike[str] | None = None,
    every: float | None = None,
    workers: int | None = None,
    hooks: Sequence[Hook] = (),
    fields: Collection[str] | None = None,
    precision: str | None = None,
    checkpoint_minutes: float = CHECKPOINT_MINUTES,
    wall_forces: bool = False,
    tractions: bool = False,
    progress: bool = True,
    strict: bool = False,
) -> Sweep:
    """Run many scenes to their durations, with one thread each, and record each in its own file.

    Ctrl-C ends the sweep. With a `folder`, the same call resumes it: a case whose record is
    complete is not run again. One that was begun, or that failed, continues from its checkpoint,
    with the same bits as if it had not stopped.

    Parameters
    ----------
    cases : iterable of Scene, or mapping to Scene
        The keys of a mapping name the records: strings, numbers, or tuples of them, such as
        ``(width, A)``. Without a mapping the keys are 0, 1, 2, ...; give a mapping if the sweep
        may be resumed later with another list of scenes.
    executor : object with ``submit``, optional
        Its ``submit`` returns a `concurrent.futures.Future`, as with ``ProcessPoolExecutor``, the
        ``MPIPoolExecutor`` of mpi4py.futures, and the executor that ``Client.get_executor()`` of
        dask returns. By default processes of this machine run the cases. They import the script
        again, which must therefore start the sweep under ``if __name__ == "__main__":``.
    measure : callable, optional
        Function of the finished record of a case, a `Trajectory`, called in the process that ran
        the case; it returns the result of the case. It must be picklable: a function of a module,
        or a `functools.partial` of one.
    folder : path, optional
        Folder of the records, which all workers can access; it is made if necessary. By default a
        temporary folder of this machine, which is removed with the object returned.
    every : float, optional
        Time between frames [s], > 0, see `Simulation.run`. Records that are complete are not
        changed.
    workers : int, optional
        Number of processes if no executor is given, >= 1; by default that of the processors that
        this process may use. There are never more than cases.
    hooks : sequence of callables
        As of `Simulation.run`, such as those of `granular.stop`: each case has its own copies, in
        the process that runs it. They must be picklable, as `measure`. A case that one of them has
        ended is complete; the file ``<name>.stopped`` next to its record says so. In a case that is
        resumed they begin anew.
    fields, precision, checkpoint_minutes
        As of `Simulation.run`, for the records of cases that are begun.
    wall_forces, tractions : bool
        As of `Simulation`; for scenes of the material point method.
    progress : bool
        Show a progress bar that counts cases.
    strict : bool
        Raise an exception in the end if cases failed.

    Returns
    -------
    Sweep
        A sequence of the records, or of the values of `measure`, in the order of the cases; its
        ``errors`` names the cases that failed.

    Raises
    ------
    TypeError, ValueError
        If an argument is out of range, a case is not a scene, a key does not make a file name,
        `measure` or a hook cannot be sent to the workers, or the record of a case belongs to
        another scene. No case has run then.
    NotADirectoryError
        If `folder` is not a folder.
    ExceptionGroup
        With `strict`: the errors of all cases that failed.
    KeyboardInterrupt
        On Ctrl-C; the records stay valid. Cases that already run in a given `executor` may run to
        their end.

    Warns
    -----
    RuntimeWarning
        For each case that failed, with its key and its error; the other cases go on.
    """
    scenes = _scenes(cases)
    names = _names(list(scenes))
    _check_executor(executor, workers)
    if measure is not None:
        _check_sent("measure", measure, executor)
    for index, hook in enumerate(hooks):
        _check_sent(f"hooks[{index}]", hook, executor)
    options = Options(
        every=None if every is None else positive("every", every),
        hooks=tuple(hooks),
        fields=fields,
        precision=precision,
        checkpoint_minutes=positive("checkpoint_minutes", checkpoint_minutes, allow_inf=True),
        watched=_watched(scenes, wall_forces=wall_forces, tractions=tractions),
    )
    place, made = _folder(folder)
    jobs = [
        Case(key, scene, place / f"{name}.h5", options, measure)
        for name, (key, scene) in zip(names, scenes.items(), strict=True)
    ]
    results = Sweep(jobs)
    if made:
        weakref.finalize(results, shutil.rmtree, place, ignore_errors=True)
    for job in jobs:
        with suppress(RecordError, OSError):  # the run of this case will report it
            stage_of(job)
    with (
        bar(total=len(jobs), desc="sweep", unit="case", disable=not progress) as done,
        _submitter(executor, workers, len(jobs)) as submit,
        closing(_outcomes(jobs, submit)) as outcomes,
    ):
        for index, outcome in outcomes:
            results._take(index, outcome)
            done.update()
    if strict and results.errors:
        errors = list(results.errors.values())
        raise ExceptionGroup(f"{len(errors)} of {len(jobs)} cases failed", errors)
    return results


# ---- checks of the arguments ----


def _scenes(cases: object) -> dict[Hashable, AnyScene]:
    wanted = "an iterable of Scene or a mapping to Scene"
    if isinstance(cases, (str, bytes)) or not isinstance(cases, Iterable):
        raise TypeError(f"cases = {cases!r} must be {wanted}")
    scenes = dict(cases if isinstance(cases, Mapping) else enumerate(cases))
    if not scenes:
        raise ValueError(f"cases = {cases!r} must hold at least one Scene")
    for key, scene in scenes.items():
        if not isinstance(scene, Serializable):
            raise TypeError(f"cases[{key!r}] = {scene!r} must be a Scene")
    return scenes


def _names(keys: Sequence[Hashable]) -> list[str]:
    """Make the names of the records from the keys; no two are equal on any file system."""
    key_of: dict[str, Hashable] = {}
    names = []
    for key in keys:
        parts = key if isinstance(key, tuple) else (key,)
        if not parts or not all(isinstance(part, (str, Real)) for part in parts):
            raise TypeError(f"key {key!r} of cases must be a string, a number or a tuple of them")
        name = "_".join(map(str, parts))
        if not NAME.fullmatch(name):
            raise ValueError(
                f"key {key!r} of cases must make a file name: 1 to 200 letters, digits or "
                f"any of _+-=,. with none of =,. in front, and not {name!r}"
            )
        other = key_of.setdefault(name.casefold(), key)
        if other is not key:
            raise ValueError(f"key {key!r} of cases makes the file name of {other!r}, {name!r}")
        names.append(name)
    return names


def _check_executor(executor: object, workers: object) -> None:
    if executor is not None and not callable(getattr(executor, "submit", None)):
        raise TypeError(f"executor = {executor!r} must have a method submit")
    if workers is not None:
        integer("workers", workers, 1)
        if executor is not None:
            raise ValueError(f"workers = {workers} must be None where an executor is given")


def _check_sent(name: str, function: object, executor: object) -> None:
    """Refuse a function that the processes of the cases cannot receive."""
    if not callable(function):
        raise TypeError(f"{name} = {function!r} must be callable")
    try:
        data = pickle.dumps(function)
    except Exception as error:
        raise TypeError(
            f"{name} = {function!r} must be picklable, as a function of a module is: {error}"
        ) from error
    import __main__

    # The processes import the script again; they cannot find objects of an interactive session.
    script = Path(getattr(__main__, "__file__", "")).is_file()
    if executor is None and b"__main__" in data and not script:
        raise TypeError(f"{name} = {function!r} must be in a module that the workers can import")


def _watched(scenes: Mapping[Hashable, AnyScene], **options: object) -> tuple[str, ...]:
    """Names of the options of `Simulation` that are set; only those of one method have them."""
    names = tuple(name for name, value in options.items() if truth(name, value))
    for key, scene in scenes.items():
        known = signature(Simulation._of(scene).__init__).parameters
        for name in names:
            if name not in known:
                raise ValueError(
                    f"{name} = True must be False: the method of cases[{key!r}] does not have it"
                )
    return names


def _folder(folder: object) -> tuple[Path, bool]:
    """Return the folder of the records, and True if it is temporary."""
    if folder is None:
        return Path(tempfile.mkdtemp(prefix="granular-sweep-")), True
    if not isinstance(folder, (str, os.PathLike)):
        raise TypeError(f"folder = {folder!r} must be a path, not {type(folder).__name__}")
    place = Path(folder)
    if place.exists() and not place.is_dir():
        raise NotADirectoryError(f"folder = {folder} must be a folder")
    place.mkdir(parents=True, exist_ok=True)
    return place.resolve(), False  # workers may have another working folder


# ---- all cases ----


def _outcomes(
    cases: Sequence[Case], submit: Callable[[Case], Future]
) -> Generator[tuple[int, Any], None, None]:
    """Yield index and outcome of each case as they complete."""
    futures: dict[Future, int] = {}
    try:
        for index, case in enumerate(cases):
            future = submit(case)
            if not isinstance(future, Future):
                raise TypeError(
                    f"executor.submit returned {future!r}, must be a concurrent.futures.Future"
                )
            if future.done():  # the executor works within submit: show progress
                yield index, _outcome(future)
            else:
                futures[future] = index
        for future in as_completed(futures):
            yield futures[future], _outcome(future)
    finally:
        for future in futures:
            future.cancel()


def _outcome(future: Future) -> Any:
    try:
        return future.result()
    except Exception as error:  # of the executor: a dead worker, an unpicklable result
        return Failure(error)


@contextmanager
def _submitter(
    executor: Executor | None, workers: int | None, most: int
) -> Iterator[Callable[[Case], Future]]:
    """Provide the function that submits a case, to the given executor or to an own pool."""
    if executor is not None:
        yield partial(executor.submit, run_case)
        return
    affinity = getattr(os, "sched_getaffinity", None)  # Linux: the processors of this process
    count = workers or (len(affinity(0)) if affinity else os.cpu_count() or 1)
    context = get_context("spawn")  # a fork would inherit the threads of the core
    receiver, sender = context.Pipe(duplex=False)
    pool = ProcessPoolExecutor(min(count, most), context, enlist, (receiver,))
    try:
        yield lambda case: pool.submit(run_in_pool, case)
    except BaseException:
        sender.close()
        raise
    finally:
        pool.shutdown(cancel_futures=True)
        sender.close()
        receiver.close()

"""A frame: its scalars, its digest and the position of its fields; and the table of all frames."""

import json
import math
import re
from collections.abc import Iterator, Mapping, Sequence
from contextlib import AbstractContextManager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Protocol

import numpy as np

from granular.record.chunks import Field
from granular.record.layout import RecordError, checksums, frame_digest, reading, seal


class Source(Protocol):
    """Storage of the fields of frames."""

    @property
    def path(self) -> Path:
        """Path of the file."""

    def fields(self) -> AbstractContextManager[Mapping[str, Field]]:
        """Return the fields by name."""


SCALARS = {"time": "<f8", "step": "<i8", "dt": "<f8", "n": "<i8", "mass": "<f8"}
"""Scalars of a frame, with the types in which they are stored."""


@dataclass(frozen=True, kw_only=True)
class Frame:
    """One frame: its scalars, and its position, ``n`` rows from ``row`` of ``source``.

    ``samples`` are the values of the monitor, if it sampled this frame, and the numbers
    of its bodies and walls by the names of `names_of`. ``others`` are frames at the same time of
    other sets of points, by the names of `granular.record.layout.OTHERS`.
    """

    time: float
    step: int
    dt: float
    mass: float
    n: int
    digest: bytes
    row: int
    source: Source
    samples: Mapping[str, float] = field(default_factory=dict)
    others: "Mapping[str, Frame]" = field(default_factory=dict)

    @property
    def mark(self) -> bytes:
        """Digest of all that is stored for this time."""
        return b"".join(frame.digest for frame in self.each())

    def each(self) -> "Iterator[Frame]":
        """This frame, and those of the other sets in the order of their names."""
        yield self
        for name in sorted(self.others):
            yield self.others[name]

    def digest_of(self, fields: Mapping[str, bytes]) -> bytes:
        """Digest of a frame with these scalars, and with fields of these `checksums`."""
        return frame_digest(self.time, self.step, self.dt, self.mass, fields)

    def read(self) -> dict[str, np.ndarray]:
        """Read and verify all fields.

        Raises
        ------
        RecordError
            If the stored frame is damaged or does not match its digest.
        """
        with reading(self.source.path), self.source.fields() as stored:
            fields = {name: field.read(self.row, self.n) for name, field in stored.items()}
        if self.digest != self.digest_of({k: checksums(a.T) for k, a in fields.items()}):
            raise RecordError(
                f"{self.source.path}: the frame of step {self.step} does not match its digest"
            )
        return fields


@dataclass(frozen=True)
class Texts:
    """Texts in the header of a record: its identifier, scene (JSON) and provenance (JSON)."""

    record: str
    scene: str
    provenance: str

    def __post_init__(self) -> None:
        for name in ("record", "scene", "provenance"):
            if not isinstance(getattr(self, name), str):
                raise ValueError(f"{name} is not a text")
        entries = json.loads(self.provenance)
        if not isinstance(entries, dict) or not isinstance(entries.get("earlier", []), list):
            raise ValueError("the provenance is not one of a record")


@dataclass(frozen=True)
class Head:
    """Head of an unfinished record.

    ``name`` is that of the files that belong to it. ``replaces`` is the `identity` of the file that
    it replaces when it is finished; None if there was none when it was begun.
    """

    texts: Texts
    name: str
    replaces: tuple[int, int] | None = None


@dataclass(frozen=True)
class Table:
    """Columns with one entry per frame of a finished file, and the digest over them."""

    time: np.ndarray
    n: np.ndarray
    row: np.ndarray
    step: np.ndarray
    dt: np.ndarray
    mass: np.ndarray
    digest: np.ndarray
    samples: Mapping[str, np.ndarray]

    def sample(self, i: int) -> dict[str, float]:
        """Values of the monitor at a frame; empty if it did not sample it."""
        row = {name: float(column[i]) for name, column in self.samples.items()}
        return {} if all(math.isnan(value) for value in row.values()) else row

    @property
    def columns(self) -> tuple[np.ndarray, ...]:
        """All columns except the samples."""
        return (self.time, self.n, self.row, self.step, self.dt, self.mass, self.digest)

    def seal(self, texts: Texts, checkpoint: bytes, others: "Mapping[str, Table]") -> bytes:
        """Digest of everything in the file that no other digest covers."""
        texts_of = (texts.record, texts.scene, texts.provenance)
        samples = [part for name in sorted(self.samples) for part in (name, self.samples[name])]
        more: list[str | np.ndarray] = []
        for name in sorted(others):
            more += [name, *others[name].columns]
        return seal(*texts_of, checkpoint, *self.columns, *samples, *more)


BODY, WALL = "body", "wall"
"""Prefixes of the names under which the numbers of bodies and walls are stored."""

NUMBERED = re.compile(rf"({BODY}|{WALL})(\d+)_(\d+)")
"""Such a name: prefix, index of the body or wall, number. Indicators may begin with a prefix."""


def names_of(prefix: str, count: int, numbers: int) -> list[str]:
    """Names under which the numbers of bodies or walls are stored, one after the other."""
    return [f"{prefix}{i}_{k:02d}" for i in range(count) for k in range(numbers)]


def samples_of(frames: Sequence[Frame]) -> dict[str, np.ndarray]:
    """Values of the monitor, one column per name; nan where there are none."""
    names = sorted({name for frame in frames for name in frame.samples})
    return {name: np.array([f.samples.get(name, math.nan) for f in frames]) for name in names}

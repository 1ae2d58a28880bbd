"""Flow or clogging of a silo: outflow and dense velocity over time, and two verdicts."""

import math
from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from granular.measure.averaging_grid import only_material
from granular.measure.opening import Opening, each_state, opening_of
from granular.measure.result import Result
from granular.model.state import State
from granular.tools.arrays import Array, BoolArray
from granular.tools.checks import in_range, positive

VERDICTS = ("static", "flowing", "unsure")

LATE = 0.1
"""Share of the time, at its end, over which the flow is judged."""

_BEFORE = (0.45, 0.55)
"""Interval, as shares of the time, with whose speed the late speed is compared."""

_CROSSED = (0.5, 0.9)
_LEFT = (1.0, 10.0)
"""Limits of the published rule: time of the last zero crossing, points lost per frame."""

_ROUNDING = 1e-9


@dataclass(frozen=True)
class SiloHistory(
    Result,
    times="s",
    mass="kg/m",
    velocity="m/s",
    head="m",
    width="m",
    rho_c="kg/m3",
    gravity="m/s2",
):
    """Quantities at every frame by which the flow of a silo is judged.

    Attributes
    ----------
    times : ndarray, shape (k,)
        Times of the frames [s], ascending.
    mass : ndarray, shape (k,)
        Mass of the full silo, also where half is modelled [kg/m].
    points : ndarray, shape (k,)
        Number of points of the full silo.
    velocity : ndarray, shape (k,)
        Mass-weighted mean vertical velocity of the dense points above the bottom, upwards positive
        [m/s]; nan where there are none.
    head : ndarray, shape (k,)
        Height to which the mass above the opening, at rho_c, would fill a column of the opening's
        width [m].
    width : float
        Width of the opening [m].
    rho_c : float
        Critical density of the material [kg/m3].
    gravity : float
        Magnitude of gravity at the end [m/s2].
    """

    times: Array
    mass: Array
    points: Array
    velocity: Array
    head: Array
    width: float
    rho_c: float
    gravity: float

    def __post_init__(self) -> None:
        columns = ("times", "mass", "points", "velocity", "head")
        shapes = {name: np.shape(getattr(self, name)) for name in columns}
        if len(set(shapes.values())) != 1 or len(shapes["times"]) != 1:
            raise ValueError(f"shapes {shapes} must be equal and one-dimensional")
        if not np.all(np.diff(self.times) > 0):
            raise ValueError(f"times = {self.times} must ascend")
        for name in ("width", "rho_c", "gravity"):
            positive(name, getattr(self, name))

    @property
    def free_fall(self) -> float:
        """Scale of the outflow, ``rho_c sqrt(g) W**(3/2)`` [kg/(s m)]."""
        return self.rho_c * math.sqrt(self.gravity) * self.width**1.5


@dataclass(frozen=True)
class FlowVerdict(Result, outflow="kg/(s m)", speed="m/s", speed_floor="m/s", drained_at="s"):
    """Verdict on the flow of a silo, by two rules.

    Attributes
    ----------
    verdict : {"static", "flowing", "unsure"}
        Verdict by outflow and decay.
    outflow : float
        Late outflow of the full silo [kg/(s m)].
    relative_outflow : float
        `outflow` divided by `SiloHistory.free_fall`.
    speed : float
        Late downward speed of the dense material [m/s]; nan if there is none.
    decay : float
        Speed in the slower half of the late time divided by the speed half-way through the time.
        Neither speed is taken as less than the floor.
    speed_floor : float
        Speed below which material counts as at rest [m/s].
    drained_at : float or None
        Time from which the material above the opening was less high than the opening is wide [s];
        later frames were not judged.
    published : {"static", "flowing", "unsure"}
        Verdict by the rule of the paper.
    last_crossing : float
        Time at which the vertical velocity last crossed zero, as a share of the whole time; 0 if
        never.
    points_per_frame : float
        Late number of points that the full silo loses per frame.
    """

    verdict: str
    outflow: float
    relative_outflow: float
    speed: float
    decay: float
    speed_floor: float
    drained_at: float | None
    published: str
    last_crossing: float
    points_per_frame: float


def silo_history(trajectory: Iterable[State], *, opening: Opening | None = None) -> SiloHistory:
    """Mass, dense velocity and fill above the opening of a plane silo, frame by frame.

    Parameters
    ----------
    trajectory : iterable of State
        Every frame is read once.

    Raises
    ------
    TypeError, ValueError
        If there are no frames, their times do not ascend or their grids differ, or the scene is
        not a 2D silo or has several materials.
    """
    rows = []
    for state in each_state(trajectory):
        where = opening_of(state, opening)
        material, scene = only_material(state), state.scene
        x, y = where.places(state).T
        mass = np.asarray(state.mass, dtype=float)
        dense = np.asarray(state.dense, dtype=bool) & (y > 0)
        v = np.average(state.v[dense, 1], weights=mass[dense]) if dense.any() else math.nan
        above = mass[(y > 0) & (np.abs(x) <= where.width / 2)].sum()
        head = above / (material.rho_c * where.share * where.width)
        rows.append((state.time, mass.sum() / where.share, len(mass) / where.share, v, head))
    gravity = float(np.linalg.norm(scene.gravity.at(scene.duration)))
    times, mass, points, velocity, fill = np.array(rows, dtype=float).T
    return SiloHistory(times, mass, points, velocity, fill, where.width, material.rho_c, gravity)


def flow_verdict(
    trajectory: Iterable[State] | SiloHistory,
    *,
    opening: Opening | None = None,
    quiet: float = 0.01,
    steady: float = 0.1,
    persistence: float = 0.5,
    speed_floor: float | None = None,
    frame: float = 1 / 240,
) -> FlowVerdict:
    """Decide whether a silo flows, has come to rest, or neither can be determined.

    The time judged ends when the material above the opening becomes less high than the opening is
    wide. The verdict is by the last tenth of this time, which is split into two halves. The speed
    is that at which the dense material sinks: minus its mean vertical velocity, averaged over the
    frames.

    - *static*: in both halves the outflow is at most `quiet` times that of free fall. In addition,
      either the speed is at most the floor in both halves, up or down, or the velocity crosses zero
      within the last tenth, as in elastic waves.
    - *flowing*: in both halves the outflow is at least `steady` times that of free fall and the
      speed is above the floor. Half-way (0.45 to 0.55 of the time) the speed was above the floor as
      well, and in both halves it is at least `persistence` times the speed half-way.
    - *unsure*: all other cases. A flow that has stopped is recognised if it stopped before the last
      ``LATE persistence/2`` of the time, a fortieth by default.

    The published rule (Dunatunga & Kamrin, Modelling silo clogging, section 7.2) is evaluated as
    well. It has two votes that must agree. The mean vertical velocity of the dense material crosses
    zero at a frame where it is zero or does not have the sign of the frame before, the first frame
    excepted. A last crossing within the last tenth of the whole time is a vote for static; a last
    crossing before half of it, or none, is a vote for flowing. A loss of at most 1 point per frame
    in the last tenth is a vote for static, a loss of more than 10 for flowing. This rule has no
    floor of the speed: material that creeps at 1e-5 m/s does not cross zero. Its count of points
    depends on their mass.

    Parameters
    ----------
    trajectory : iterable of State, or SiloHistory
    quiet, steady : float
        Outflows as shares of ``rho_c sqrt(g) W**(3/2)``: 0 <= quiet <= steady, 0 < steady <= 1.
    persistence : float
        Least share of its speed half-way that a flow must retain, 0 to 1.
    speed_floor : float, optional
        Speed below which material counts as at rest [m/s], > 0; by default ``1e-3 sqrt(g W)``.
    frame : float
        Time between two frames of the published rule [s]; the loss of points is converted to such
        frames.

    Raises
    ------
    TypeError, ValueError
        As `silo_history`; also if the material above the opening is never as high as the opening is
        wide, one of the two halves holds fewer than two frames, or a limit is out of range.
    """
    in_range("steady", steady, 0.0, 1.0, open_low=True)
    in_range("quiet", quiet, 0.0, steady)
    in_range("persistence", persistence, 0.0, 1.0)
    positive("frame", frame)
    if isinstance(trajectory, SiloHistory):
        history = trajectory
    else:
        history = silo_history(trajectory, opening=opening)
    floor = 1e-3 * math.sqrt(history.gravity * history.width)
    floor = floor if speed_floor is None else positive("speed_floor", speed_floor)
    end = _drained(history)
    middle = 1 - LATE / 2
    halves = np.array([_window(history, end, *ends) for ends in ((1 - LATE, middle), (middle, 1))])
    flows, speeds = halves[:, 0] / history.free_fall, halves[:, 1]
    outflow, late = _window(history, end, 1 - LATE, 1)
    before = _window(history, end, *_BEFORE)[1]
    decay = float(np.maximum(speeds.min(), floor) / np.maximum(before, floor))
    verdict = "unsure"  # comparisons with nan (no dense points) are false
    swings = _last_crossing(history, end) >= 1 - LATE
    if flows.max() <= quiet and (np.abs(speeds).max() <= floor or swings):
        verdict = "static"
    elif flows.min() >= steady and np.min([*speeds, before]) > floor and decay >= persistence:
        verdict = "flowing"
    crossing, lost = _last_crossing(history, len(history.times)), _points_lost(history, frame)
    return FlowVerdict(
        verdict=verdict,
        outflow=outflow,
        relative_outflow=outflow / history.free_fall,
        speed=late,
        decay=decay,
        speed_floor=floor,
        drained_at=None if end == len(history.times) else float(history.times[end]),
        published=_published(crossing, lost),
        last_crossing=crossing,
        points_per_frame=lost,
    )


def _drained(history: SiloHistory) -> int:
    """Index after the last frame with material above the opening as high as it is wide."""
    full = np.flatnonzero(history.head >= history.width)
    if not len(full):
        raise ValueError(
            f"head is at most {history.head.max():.6g} m, a silo is judged while it is at least "
            f"the width {history.width:.6g} m of the opening"
        )
    return int(full[-1]) + 1


def _window(history: SiloHistory, end: int, start: float, stop: float) -> tuple[float, float]:
    """Outflow [kg/s] and mean downward speed [m/s] between two shares of the judged time."""
    times = history.times[:end]
    a, b = times[0] + np.array((start, stop)) * (times[-1] - times[0])
    slack = _ROUNDING * (times[-1] - times[0])
    inside = (times >= a - slack) & (times <= b + slack)
    if inside.sum() < 2 or not b > a:
        raise ValueError(
            f"{len(times)} frames until {times[-1]:.6g} s leave {inside.sum()} between "
            f"{start:g} and {stop:g} of that time, at least 2 are needed"
        )
    high, low = np.interp((a, b), times, history.mass[:end])
    speed = -history.velocity[:end][inside]
    known = np.isfinite(speed)
    return float((high - low) / (b - a)), float(speed[known].mean()) if known.any() else math.nan


def _last_crossing(history: SiloHistory, end: int) -> float:
    """Time of the last zero crossing, as a share of the time until frame `end`; 0 if never."""
    times, velocity = history.times[:end], history.velocity[:end]
    known = np.isfinite(velocity)
    sign = np.sign(velocity[known])
    crossed: BoolArray = (sign[1:] == 0) | (sign[1:] * sign[:-1] < 0)
    if not crossed.any():
        return 0.0
    return float((times[known][1:][crossed][-1] - times[0]) / (times[-1] - times[0]))


def _points_lost(history: SiloHistory, frame: float) -> float:
    times = history.times
    first = int(np.searchsorted(times, times[-1] - (LATE + _ROUNDING) * (times[-1] - times[0])))
    lost = history.points[first] - history.points[-1]
    return float(lost / (times[-1] - times[first]) * frame)


def _published(crossing: float, lost: float) -> str:
    def vote(static: bool, flowing: bool) -> str:
        return "static" if static else "flowing" if flowing else "unsure"

    votes = {
        vote(crossing >= _CROSSED[1], crossing < _CROSSED[0]),
        vote(lost <= _LEFT[0] * (1 + _ROUNDING), lost > _LEFT[1] * (1 + _ROUNDING)),
    }
    return votes.pop() if len(votes) == 1 else "unsure"

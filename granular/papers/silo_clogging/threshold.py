"""Lines through the origin of a phase diagram that separate static from flowing cases."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from granular.measure.result import Result
from granular.papers.silo_clogging.flow import VERDICTS
from granular.tools.arrays import Array
from granular.tools.checks import one_of


@dataclass(frozen=True)
class FlowThreshold(Result):
    """Slopes ``c = (W/d)/A`` of the lines that bound the static and the flowing cases.

    Cases that are neither static nor flowing are unsure.

    Attributes
    ----------
    static_below : float
        c1: all cases below ``W/d = c1 A`` are static. nan if all cases are static, or if no static
        case has a smaller slope than all the others.
    flowing_above : float
        c2: all cases above ``W/d = c2 A`` flow. nan if all cases flow, or if no flowing case has a
        larger slope than all the others.
    static_bracket, flowing_bracket : (float, float)
        Slopes of the two cases half-way between which each line passes; the threshold is known to
        this accuracy only. (0, least) and (largest, inf) if there is no case on one side.
    overlap : bool
        True if a static case has a slope not less than that of a flowing one, so that the slope
        alone does not decide.
    """

    static_below: float
    flowing_above: float
    static_bracket: tuple[float, float]
    flowing_bracket: tuple[float, float]
    overlap: bool


def flow_threshold(A: ArrayLike, ratio: ArrayLike, verdicts: Sequence[str]) -> FlowThreshold:
    """Slopes of the lines ``W/d = c A`` below which all cases are static and above which all flow.

    Dunatunga & Kamrin, Modelling silo clogging, figure 4a: A d/W alone nearly decides, because A
    and d appear as a product except in the term of g**2.

    Parameters
    ----------
    A : array_like, shape (k,)
        Nonlocal amplitudes, > 0.
    ratio : array_like, shape (k,)
        Openings in grain diameters W/d, > 0.
    verdicts : sequence of k str
        "static", "flowing" or "unsure".

    Raises
    ------
    TypeError, ValueError
        If the three are not of one length of at least one, a number is not finite and positive,
        or a verdict is none of the three.
    """
    across, up = phase_points(A, ratio, verdicts, names=("A", "ratio"))
    for name, array in (("A", across), ("ratio", up)):
        if not np.all(array > 0):
            raise ValueError(f"{name} = {array} must all be > 0")
    slope, verdict = up / across, np.array(verdicts)
    static, flowing = slope[verdict == "static"], slope[verdict == "flowing"]
    least = slope[verdict != "static"].min(initial=np.inf)
    largest = slope[verdict != "flowing"].max(initial=0.0)
    # Rounding of (W/d)/A must not separate cases of equal slope.
    below = static[static < least * (1 - 1e-9)].max(initial=0.0)
    above = flowing[flowing > largest * (1 + 1e-9)].min(initial=np.inf)
    return FlowThreshold(
        static_below=_half_way(below, least),
        flowing_above=_half_way(largest, above),
        static_bracket=(float(below), float(least)),
        flowing_bracket=(float(largest), float(above)),
        overlap=bool(len(static) and len(flowing) and static.max() >= flowing.min() * (1 - 1e-9)),
    )


def _half_way(low: float, high: float) -> float:
    return float((low + high) / 2) if 0 < low and np.isfinite(high) else float("nan")


def phase_points(
    x: ArrayLike, y: ArrayLike, verdicts: Sequence[str], *, names: tuple[str, str]
) -> tuple[Array, Array]:
    """Return the coordinates of a phase diagram as arrays, checked against its verdicts.

    Parameters
    ----------
    x, y : array_like, shape (k,)
        Coordinates of the cases.
    verdicts : sequence of k str
        "static", "flowing" or "unsure".
    names : (str, str)
        Names of the coordinates for messages.

    Raises
    ------
    TypeError, ValueError
        As `flow_threshold`, except that numbers need not be positive.
    """
    for i, verdict in enumerate(verdicts):
        one_of(f"verdicts[{i}]", str(verdict), VERDICTS)
    arrays = [np.asarray(a, dtype=float) for a in (x, y)]
    for name, array in zip(names, arrays, strict=True):
        if array.shape != (len(verdicts),) or not len(verdicts):
            raise ValueError(
                f"{name} has shape {array.shape}, must have one number for each of the "
                f"{len(verdicts)} verdicts, and at least one"
            )
        if not np.all(np.isfinite(array)):
            raise ValueError(f"{name} = {array} must all be finite")
    return arrays[0], arrays[1]

"""Silos: the remaining mass, the discharge rate, Beverloo's law."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, cast

import numpy as np
from numpy.typing import ArrayLike

from granular.measure.effective_opening import EffectiveOpening
from granular.measure.result import MASS, RATE, Result
from granular.model.gravity import EARTH
from granular.model.state import State
from granular.model.symmetric import modelled_share
from granular.tools.arrays import Array
from granular.tools.checks import integer, non_negative, positive, truth

WINDOW = (1200.0, 900.0)
"""Remaining mass of the full silo [kg per metre of depth] in the steady part of the flow."""

_PARTS = ((0.0, 0.5), (0.25, 0.75), (0.5, 1.0))
"""Parts of the window whose rates are compared, as shares of it."""


@dataclass(frozen=True)
class MassHistory(Result, times="s", mass=MASS):
    """Mass in the domain at every frame.

    Attributes
    ----------
    times : ndarray, shape (k,)
        Times of the frames [s].
    mass : ndarray, shape (k,)
        Mass of the full silo, also where a part is modelled, or that of the modelled part [kg; in
        2D per metre of depth].
    share : float
        Part of the full silo that is modelled: 1, or 1/2 or 1/4 between planes of symmetry.
    total : bool
        True if `mass` is the mass of the full silo.
    opening : EffectiveOpening or None
        Effective width of the opening, if that is known.
    """

    times: Array
    mass: Array
    share: float
    total: bool = True
    opening: EffectiveOpening | None = None


@dataclass(frozen=True)
class Discharge(
    Result,
    rate=RATE,
    standard_error=RATE,
    window_spread=RATE,
    times="s",
    mass=MASS,
    corrected=RATE,
    corrected_uncertainty=RATE,
):
    """Rate of discharge in a window of mass.

    Attributes
    ----------
    rate : float
        Rate of discharge, positive outwards [kg/s; in 2D per metre of depth].
    standard_error : float
        Standard error of the regression [kg/s]; it does not include slow changes of the rate.
    window_spread : float
        Largest minus smallest rate over three overlapping halves of the window [kg/s]. It measures
        how much the rate depends on the choice of the window; nan if a half holds fewer than three
        frames.
    frames : int
        Number of frames in the window.
    times : (float, float)
        Times of the first and the last of them [s].
    mass : (float, float)
        Mass in the silo at these times [kg; in 2D per metre of depth], of the same part as the
        rate.
    opening : EffectiveOpening or None
        Effective width of the opening in these cells; None where that was not measured.
    corrected : float
        Rate of an opening whose effective width is that between its edges, ``opening.width``:
        `rate` times ``opening.factor`` [kg/s]; nan where that is not known.
    corrected_uncertainty : float
        Uncertainty of `corrected` by that of the effective opening and by half of `window_spread`,
        added in squares [kg/s].
    """

    rate: float
    standard_error: float
    window_spread: float
    frames: int
    times: tuple[float, float]
    mass: tuple[float, float]
    opening: EffectiveOpening | None
    corrected: float
    corrected_uncertainty: float


@dataclass(frozen=True)
class BeverlooFit(Result, orifices="m", rates=RATE):
    """Beverloo's law with k = 0, ``Q = C rho sqrt(g) D**(dim - 1/2)``, fitted to rates.

    Attributes
    ----------
    C : float
        Coefficient at the exponent dim - 1/2.
    C_free, exponent_free : float
        Coefficient and exponent fitted together, with D in metres.
    residuals, residuals_free : ndarray, shape (k,)
        ``ln Q - ln fit`` of the two fits.
    orifices : ndarray, shape (k,)
        Widths or diameters D of the orifices [m].
    rates : ndarray, shape (k,)
        Rates Q [kg/s; in 2D per metre of depth].
    dim : {2, 3}
        2 for slots, 3 for round orifices.
    """

    C: float
    C_free: float
    exponent_free: float
    residuals: Array
    residuals_free: Array
    orifices: Array
    rates: Array
    dim: int


def mass_history(trajectory: Iterable[State], *, total: bool = True) -> MassHistory:
    """Mass in the domain at every frame.

    Parameters
    ----------
    trajectory : iterable of State
        If it has a ``series`` with ``time`` and ``mass``, no frame is read.
    total : bool
        True for the mass of the full silo: where planes of symmetry leave a half or a quarter of it
        (`granular.model.symmetric`), the mass is multiplied by 2 or 4. False for that of the
        modelled part.

    Raises
    ------
    ValueError
        If the trajectory has no frames.
    """
    series = getattr(trajectory, "series", None)
    rows: Sequence[Any]
    if isinstance(series, Mapping) and {"time", "mass"} <= series.keys() and len(series["time"]):
        scene, rows = cast(Any, trajectory).scene, (series["time"], series["mass"])
    else:
        frames = [(state.time, np.sum(state.mass), state.scene) for state in trajectory]
        if not frames:
            raise ValueError("trajectory has 0 frames, at least 1 is needed")
        *rows, scenes = zip(*frames, strict=True)
        scene = scenes[0]
    share = modelled_share(scene)
    times, mass = (np.array(row, dtype=float) for row in rows)
    opening = EffectiveOpening.of(scene)
    given = mass / share if truth("total", total) else mass
    return MassHistory(times, given, share, total, opening)


def discharge(
    trajectory: Iterable[State] | MassHistory,
    *,
    window: tuple[float, float] = WINDOW,
    total: bool = True,
) -> Discharge:
    """Rate of discharge by linear regression of the mass over time, within a window of mass.

    Dunatunga & Kamrin 2015, section 4.2, take the frames at which the full silo holds 1200 to
    900 kg. An opening acts wider or narrower than it is by a part of a cell; the rate that is
    corrected for this comes with its uncertainty.

    Parameters
    ----------
    trajectory : iterable of State, or MassHistory
    window : (float, float)
        Mass in the full silo [kg; in 2D per metre of depth], from the larger to the smaller, >= 0.
    total : bool
        True for the rate and the masses of the full silo, False for those of the modelled part.
        The window is in masses of the full silo in either case.

    Raises
    ------
    TypeError, ValueError
        If the window does not go from the larger mass to the smaller, or holds fewer than 3
        frames, or the trajectory has none.
    """
    upper, lower = (non_negative(f"window[{i}]", mass) for i, mass in enumerate(window))
    if not upper > lower:
        raise ValueError(f"window = {window} must fall, from the larger mass to the smaller")
    history = trajectory if isinstance(trajectory, MassHistory) else mass_history(trajectory)
    full = history.mass if history.total else history.mass / history.share
    inside = (full <= upper) & (full >= lower)
    times, mass = history.times[inside], full[inside]
    if len(times) < 3:
        raise ValueError(
            f"window = {window}: {len(times)} frames lie in it, a rate needs at least 3; "
            f"the mass goes from {full.max():.6g} to {full.min():.6g} kg"
        )
    rate, error = _regression(times, mass)
    factor = 1.0 if truth("total", total) else history.share
    rate, error = factor * rate, factor * error
    spread = factor * _window_spread(times, mass, upper, lower)
    opening, corrected, uncertainty = history.opening, math.nan, math.nan
    if opening is not None:
        corrected = opening.factor * rate
        of_window = 0.5 * opening.factor * (spread if math.isfinite(spread) else error)
        uncertainty = math.hypot(opening.relative_uncertainty * corrected, of_window)
    return Discharge(
        rate=rate,
        standard_error=error,
        window_spread=spread,
        frames=len(times),
        times=(float(times[0]), float(times[-1])),
        mass=(factor * float(mass[0]), factor * float(mass[-1])),
        opening=opening,
        corrected=corrected,
        corrected_uncertainty=uncertainty,
    )


def _regression(times: Array, mass: Array) -> tuple[float, float]:
    """Rate of mass loss (minus the slope of the mass) and its standard error."""
    t = times - times.mean()
    spread = np.sum(t**2)
    slope = np.sum(t * mass) / spread
    residual = mass - mass.mean() - slope * t
    return -float(slope), math.sqrt(np.sum(residual**2) / (len(t) - 2) / spread)


def _window_spread(times: Array, mass: Array, upper: float, lower: float) -> float:
    rates = []
    for start, end in _PARTS:
        high, low = upper - start * (upper - lower), upper - end * (upper - lower)
        part = (mass <= high) & (mass >= low)
        if np.count_nonzero(part) >= 3:
            rates.append(_regression(times[part], mass[part])[0])
    return max(rates) - min(rates) if len(rates) == len(_PARTS) else math.nan


def beverloo(
    cases: ArrayLike | Sequence[Any] | Iterable[Any],
    rates: ArrayLike | None = None,
    *,
    rho: float | None = None,
    gravity: float = EARTH,
    dim: int = 2,
    window: tuple[float, float] = WINDOW,
) -> BeverlooFit:
    """Fit Beverloo's law, with the exponent dim - 1/2 and with a free exponent.

    The fit is by least squares of the logarithms (Dunatunga & Kamrin 2015, eqs. 4.4-4.5, with
    k = 0 as for every local law). ``beverloo(orifices, rates, rho=...)`` takes numbers;
    ``beverloo(trajectories)`` takes the orifice, rho_c, the final gravity and the dimension from
    each scene, and the rate from its `discharge`.

    Parameters
    ----------
    cases : array_like, shape (k,), or iterable of trajectories
        Widths or diameters D of the orifices [m], or the runs.
    rates : array_like, shape (k,), optional
        Rates Q of the full silo [kg/s; in 2D per metre of depth], with orifices only.
    rho : float, optional
        Bulk density [kg/m3], with orifices only.
    gravity : float
        Magnitude of gravity [m/s2], with orifices only.
    dim : {2, 3}
        2 for slots, 3 for round orifices, with orifices only.
    window : (float, float)
        Of `discharge`, with trajectories only: masses in the full silo [kg; in 2D per metre of
        depth] between which the rates are taken. The default is that of silos of the size of
        Dunatunga & Kamrin 2015.

    Raises
    ------
    TypeError, ValueError
        If there are fewer than two different orifices, a size or rate is not positive, rates are
        given without rho, the scene of a trajectory has no parameter ``orifice``, or scenes in 2D
        and in 3D are mixed; also as `discharge`.
    """
    if rates is None:
        orifice, rate, scale, dim = _measured(cast(Iterable[Any], cases), window)
    else:
        if rho is None:
            raise ValueError("rho = None: the bulk density in kg/m3 must come with the rates")
        orifice, rate = np.asarray(cases, dtype=float), np.asarray(rates, dtype=float)
        scale = np.full(
            orifice.shape, positive("rho", rho) * math.sqrt(positive("gravity", gravity))
        )
    return _fit(orifice, rate, scale, integer("dim", dim, 2, 3))


def _measured(cases: Iterable[Any], window: tuple[float, float]) -> tuple[Array, Array, Array, int]:
    """Orifices, rates and ``rho_c sqrt(g)`` of several runs, and their dimension."""
    rows, dims = [], {}
    for case in cases:
        if not hasattr(case, "scene"):
            raise TypeError(
                f"cases holds a {type(case).__name__}: give trajectories, or rates with orifices"
            )
        scene = case.scene
        if "orifice" not in scene.parameters:
            raise ValueError(f"scene {scene.name!r} has no parameter orifice")
        g = float(np.linalg.norm(scene.gravity.at(scene.duration)))
        scale = scene.material.rho_c * math.sqrt(g)
        rows.append((scene.parameters["orifice"], discharge(case, window=window).rate, scale))
        dims[scene.grid.dim_of_whole] = scene.name
    if len(dims) > 1:
        raise ValueError(f"cases holds {dims[2]!r} in 2D and {dims[3]!r} in 3D: fit them apart")
    orifice, rate, scale = np.array(rows, dtype=float).reshape(-1, 3).T
    return orifice, rate, scale, next(iter(dims), 2)


def _fit(orifice: Array, rate: Array, scale: Array, dim: int) -> BeverlooFit:
    if orifice.ndim != 1 or orifice.shape != rate.shape:
        raise ValueError(
            f"orifices have shape {orifice.shape}, rates {rate.shape}: "
            "both must be one-dimensional and of equal length"
        )
    for name, array in (("orifices", orifice), ("rates", rate)):
        if not np.all((array > 0) & np.isfinite(array)):
            raise ValueError(f"{name} = {array} must all be finite and > 0")
    if len(np.unique(orifice)) < 2:
        raise ValueError(f"orifices = {orifice}: at least 2 different ones are needed")
    size, flow = np.log(orifice), np.log(rate / scale)
    fixed = flow - (dim - 0.5) * size
    exponent, level = np.polyfit(size, flow, 1)
    return BeverlooFit(
        C=float(np.exp(fixed.mean())),
        C_free=float(np.exp(level)),
        exponent_free=float(exponent),
        residuals=fixed - fixed.mean(),
        residuals_free=flow - exponent * size - level,
        orifices=orifice,
        rates=rate,
        dim=dim,
    )

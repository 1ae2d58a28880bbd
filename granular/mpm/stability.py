"""Factor of safety of a scene, by reduction of the strength of its material."""

from __future__ import annotations

import math
import warnings
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from granular.measure.displacement import displacement
from granular.measure.result import Result
from granular.model.state import State
from granular.mpm.scene import Scene
from granular.run.simulation import Simulation
from granular.tools.arrays import Array, BoolArray
from granular.tools.checks import in_range, instance, non_negative, positive

if TYPE_CHECKING:
    from granular.materials.base import Material

__all__ = ["FactorOfSafety", "factor_of_safety", "reduced"]

STRENGTHS = ("mu", "mu_s", "mu_2", "cohesion", "tensile_strength")
"""Numbers of materials that are divided by the factor."""

MOVED = 0.01
"""Displacement from which a slope counts as failed, over the height of the material. At the limit
the displacement of a slope rises from 0.1 % of its height to 6 % within a change of the factor by
4 % (docs/how-to/slope_stability.md)."""

SHARE = 0.99
"""Quantile of the displacements that is compared with it."""

STEP = 1.3
"""Ratio of the factors that are tried until one stands and one fails."""

MOST = 64.0
"""Largest factor that is tried; its inverse is the least."""


@dataclass(frozen=True, eq=False, kw_only=True)
class FactorOfSafety(Result, displacements="m"):
    """Factor by which the strength of a material can be divided before it fails.

    Attributes
    ----------
    lower, upper : float
        Largest factor with which it stands, and smallest with which it fails.
    factors : ndarray, shape (k,)
        All factors tried, ascending.
    displacements : ndarray, shape (k,)
        Displacement with each of them [m], of the points that move farthest, at the end of the run
        or where it was ended because they had moved too far.
    failed : ndarray of bool, shape (k,)
        Whether the material failed.
    """

    lower: float
    upper: float
    factors: Array
    displacements: Array
    failed: BoolArray

    @property
    def value(self) -> float:
        """Middle of the interval, by ratios."""
        return math.sqrt(self.lower * self.upper)


def reduced(material: Material, factor: float) -> Material:
    """Return a material whose friction coefficients and cohesion are divided by a factor.

    Parameters
    ----------
    material : Material
    factor : float
        Factor, > 0.

    Raises
    ------
    ValueError
        If the material has neither.
    """
    factor = positive("factor", factor)
    names = [name for name in STRENGTHS if isinstance(getattr(material, name, None), float)]
    if not {"mu", "mu_s"} & set(names):
        raise ValueError(f"material = {material!r} must have a friction coefficient to reduce")
    return material.replace(**{name: getattr(material, name) / factor for name in names})


def factor_of_safety(
    scene: Scene,
    *,
    tolerance: float = 0.03,
    start: float = 1.0,
    moved: float | None = None,
    after: float | None = None,
    threads: int | None = None,
) -> FactorOfSafety:
    """Find the factor of safety of a scene by strength reduction.

    The friction coefficients and the cohesion of all materials are divided by a factor, and the
    scene is run to its duration. It fails if points move farther than `moved` (Griffiths & Lane
    1999, Geotechnique 49, 387, look for such a jump of the displacement). Factors are tried in
    steps of 1.3 until one stands and one fails, and between them by bisection.

    The duration of the scene must be long enough for a failure to show: several times
    sqrt(2 H/g) of a slope of the height H, after its weight has been applied.

    Parameters
    ----------
    scene : Scene
        Scene of the material point method, such as `granular.scenes.slope`. Friction at walls and
        bodies is not reduced.
    tolerance : float
        Largest ratio of the ends of the interval less 1, from 0.001 to 1.
    start : float
        First factor, > 0.
    moved : float, optional
        Displacement from which the material has failed [m], > 0; by default a hundredth of its
        extent along gravity. It is that which 1 % of the points exceed.
    after : float, optional
        Time from which displacements count [s], >= 0; by default when gravity becomes constant.
    threads : int, optional
        See `Simulation`.

    Returns
    -------
    FactorOfSafety
        Its `lower` and `upper` are the interval.

    Raises
    ------
    TypeError, ValueError
        If an argument is out of range, a material has no friction, or the material stands, or
        fails, with all factors from 1/64 to 64.

    Examples
    --------
    >>> safety = gr.stability.factor_of_safety(gr.scenes.slope(cell=0.5))
    >>> safety.lower, safety.upper  # doctest: +SKIP
    (1.39, 1.43)
    """
    instance("scene", scene, Scene)
    tolerance = in_range("tolerance", tolerance, 0.001, 1.0)
    begin = scene.gravity.times[-1] if after is None else non_negative("after", after)
    if begin >= scene.duration:
        raise ValueError(f"after = {begin} must be less than the duration of {scene.duration} s")
    limit = MOVED * _height(scene) if moved is None else positive("moved", moved)
    tried: dict[float, float] = {}

    def fails(factor: float) -> bool:
        tried[factor] = _moved_by(_weakened(scene, factor), begin, limit, threads)
        return tried[factor] >= limit

    lower, upper = _bracket(fails, positive("start", start))
    while upper / lower > 1.0 + tolerance:
        middle = math.sqrt(lower * upper)
        lower, upper = (lower, middle) if fails(middle) else (middle, upper)
    factors = np.array(sorted(tried))
    displacements = np.array([tried[factor] for factor in factors])
    return FactorOfSafety(
        lower=lower,
        upper=upper,
        factors=factors,
        displacements=displacements,
        failed=displacements >= limit,
    )


def _bracket(fails: Callable[[float], bool], start: float) -> tuple[float, float]:
    """A factor that stands and a larger one that fails, from a first one."""
    factor, failed = start, fails(start)
    while 1.0 / MOST <= factor <= MOST:
        following = factor / STEP if failed else factor * STEP
        if fails(following) != failed:
            return min(factor, following), max(factor, following)
        factor = following
    raise ValueError(
        f"scene: its material {'fails' if failed else 'stands'} with all factors from "
        f"{1 / MOST:g} to {MOST:g}"
    )


def _height(scene: Scene) -> float:
    """Extent of the material along the axis nearest to gravity [m]."""
    down = int(np.argmax(np.abs(scene.gravity.vectors[-1])))
    ends = np.array([fill.region.bounds for fill in scene.fills])
    return float(ends[:, 1, down].max() - ends[:, 0, down].min())


def _weakened(scene: Scene, factor: float) -> Scene:
    """The scene with materials of a lower strength."""
    fills = tuple(
        fill if fill.material is None else replace(fill, material=reduced(fill.material, factor))
        for fill in scene.fills
    )
    return scene.replace(material=reduced(scene.material, factor), fills=fills)


def _moved_by(scene: Scene, begin: float, limit: float, threads: int | None) -> float:
    """Displacement from a time to the end of the scene, or to where it exceeds the limit [m]."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # they suspect a material that fails
        sim = Simulation(scene, threads=threads)
        if begin > 0.0:
            sim.run(until=begin, monitor=False)
        start: State = sim.state

        def far(sim: Any) -> bool:
            return _farthest(sim.state, start) >= limit

        every = (scene.duration - begin) / 50
        sim.run(until=scene.duration, every=every, hooks=(far,), monitor=False)
    return _farthest(sim.state, start)


def _farthest(state: State, start: State) -> float:
    """Displacement that a hundredth of the points exceed [m]; infinite if as many have left."""
    if state.n < SHARE * start.n:
        return math.inf
    lengths = np.linalg.norm(displacement(state, start), axis=1)
    return float(np.quantile(lengths, SHARE)) if len(lengths) else math.inf

"""The rules of `suggest`: each considers one aspect of a scene.

Each rule may use the part of the tolerance that remains after the rules before it.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from types import MappingProxyType
from typing import Any, NamedTuple, cast

from granular.economy import bias
from granular.economy.cost import cost
from granular.economy.pace import nanoseconds
from granular.economy.suggestion import Suggestion, Suggestions, changed, scene_function
from granular.economy.symmetry import obstacle
from granular.materials import DruckerPrager, Elastic, MuI
from granular.mpm import engine
from granular.mpm.axisymmetry import planar_laws
from granular.mpm.limits import check_time_step, courant_limit, damped_step, damps_by_step, height
from granular.mpm.scene import Scene
from granular.mpm.schemes import ParticleDensity, Scheme, default
from granular.theory.stopping import stopping_height
from granular.theory.well_posed import scaled_inertial_number_of_slope
from granular.tools.checks import in_range

NONLOCAL_AMPLITUDE = (0.48, 0.9)
"""A of the nonlocal law for glass beads; the grain size has an effect over lengths of A d."""

ONE_COLUMN = 0.005
"""Relative change of the flow down an incline when many columns become one, with the default scheme
(the errors against the one-dimensional equation are 0.0026 with 8 columns and 0.0023 with one,
benchmarks/speed/speed.py)."""

LINEAR_COLUMN = 0.002
"""Relative change of that flow, in one column, from the default scheme to linear functions."""

HALVED = 0.007
"""Relative change of a rate when a scene with shape functions that are not linear is halved: the
functions change near the wall in the symmetry plane. For a silo with an opening of 0.2 m, the
default scheme and cells of 0.02 m it is 0.0008 to 0.0064."""

OF_RINGS = 0.03
"""Relative change of a front or force from 3D to a plane of radius and height, with the same cells:
see docs/explanation/axisymmetry.md. It may take the whole tolerance, as it saves most."""

LEAST_ROWS = 10
"""Least number of cells over the height of a layer; fewer were not tested."""

SHARE = 0.25
"""Share of the tolerance that a rule before that of the stiffness may use."""

FRICTION_SHARE = 3.2
"""Relative change of a run-out, divided by that of the friction. Without the rate dependence of the
friction the run-out of a column of aspect 1 is 23 % larger, and the friction estimated here 7 %
lower."""


@dataclass(frozen=True)
class _Request:
    """A scene with the changes suggested so far.

    Attributes
    ----------
    scene : Scene
    name : str
        Name of the scene function; "" if none made it.
    tolerance : float
        Remaining tolerance, after the suggestions so far.
    """

    scene: Scene
    name: str
    tolerance: float


class _Advice(NamedTuple):
    """Result of a rule: see the attributes of `Suggestion`."""

    reason: str
    error: float = 0.0
    changes: Mapping[str, Any] = MappingProxyType({})


def _flat(request: _Request) -> bool:
    """True if the scene is an incline of one column of cells."""
    return request.name == "incline" and bias.one_column(request.scene)


def _columns(request: _Request) -> _Advice:
    """Suggest one column for an incline."""
    scene = request.scene
    if _flat(request):
        return _Advice("The scene already has a single column of cells.")
    if scene.dim == 3:
        return _Advice(
            "The flow is the same all across as well: a 2D scene shows it (columns_across = 0)."
            " The effect of that has not been measured.",
            math.nan,
        )
    if SHARE * request.tolerance < ONE_COLUMN:
        return _Advice(f"One column would change the flow by about {ONE_COLUMN:.2g}.")
    reason = (
        "The flow is the same all along the slope: one periodic column shows it. It cannot"
        " show waves on the surface, nor a scheme that fails in two dimensions."
    )
    if scene.scheme.density.name == "particle":
        reason += (
            " This one does: its result for many columns is not within this error"
            " (off by 0.16 on 8, linear functions), that for one column is."
        )
    return _Advice(reason, ONE_COLUMN, {"columns": 1})


def _plane_of(request: _Request) -> _Advice:
    """Suggest the plane of radius and height for a scene with an axis of symmetry."""
    scene, called = request.scene, request.scene.parameters
    if scene.scheme.basis == "ugimp":
        return _Advice("It has an axis of symmetry, but ugimp has no rings.")
    if laws := planar_laws(scene.materials):
        return _Advice(
            f"It has an axis of symmetry, but the law {laws[0].name!r} was not made with "
            "axisymmetric=True."
        )
    if request.tolerance < OF_RINGS:
        return _Advice(
            "It has an axis of symmetry, but in a plane of radius and height results differ by up "
            f"to {OF_RINGS:.2g}, as between seedings."
        )
    changes: dict[str, Any] = {"axisymmetric": True}
    if "dim" in called:
        changes["dim"] = 2
    if called["points_per_cell"] is not None:
        changes["points_per_cell"] = round(called["points_per_cell"] ** (1 / 3)) ** 2
    return _Advice("It has an axis of symmetry.", OF_RINGS, changes)


def _dimension(request: _Request) -> _Advice:
    scene, called = request.scene, request.scene.parameters
    if request.name == "incline":
        return _columns(request)
    if scene.grid.axisymmetric:
        return _Advice("The plane of radius and height is all that an axis of symmetry needs.")
    if scene.dim == 3 and "axisymmetric" in called:
        return _plane_of(request)
    if called.get("half", False):
        where = "2D, and half" if scene.dim == 2 else "Half"
        return _Advice(f"{where} by symmetry already.")
    reason = obstacle(scene)
    if reason:
        return _Advice(f"It cannot be halved: {reason}.")
    # The cell-averaged density has no second differences across a wall.
    alike = scene.scheme.basis == "linear" and scene.scheme.density.name != "cell_averaged"
    error = 0.0 if alike else HALVED
    if SHARE * request.tolerance < error:
        return _Advice(
            f"It is its own mirror image, but half of it would change the flow by {error:.2g}."
        )
    reason = "The scene is its own mirror image: half of it, before a free_slip wall, is enough."
    return _Advice(reason, error, {"half": True})


_LINEAR = Scheme(basis="linear")


def _basis(request: _Request) -> _Advice:
    scheme, dim = request.scene.scheme, request.scene.dim
    flat = _flat(request)
    if scheme.density.name == "cell_averaged":
        return _Advice("Linear functions that remain stable in shear flows: none is cheaper.")
    if scheme.basis == "linear":
        dearer = nanoseconds(default, dim) / nanoseconds(scheme, dim)
        reason = "Linear functions are the cheapest." + (
            ""
            if flat
            else " They fail in two-dimensional shear flows; a scheme that does not costs"
            f" {dearer:.2g} times as much per point and step."
        )
        return _Advice(reason)
    if not flat:
        share = nanoseconds(_LINEAR, dim) / nanoseconds(scheme, dim)
        return _Advice(
            f"No change: linear functions cost {share:.2g} of it, but layers sheared in two"
            " dimensions collapse; on the incline of 8 columns the profile is off by 0.16 in 4 s."
        )
    if not bias.with_numbers_of_default(scheme):
        reason = (
            "No change: the effect of linear functions was measured with the default scheme only."
        )
        return _Advice(reason, math.nan)
    if SHARE * request.tolerance < LINEAR_COLUMN:
        return _Advice(f"No change: linear functions change the flow by about {LINEAR_COLUMN:.2g}.")
    reason = "One column cannot fail in two dimensions: linear functions serve as well."
    changes = {"basis": "linear", "transfer": "flip", "density": ParticleDensity()}
    return _Advice(reason, LINEAR_COLUMN, changes)


def _resolution(request: _Request) -> _Advice:
    scene, called = request.scene, request.scene.parameters
    if request.name != "incline":
        return _Advice(
            "No change of cells and points. Openings act wider by a part of a cell, and a front"
            " is known to a cell: results depend on the cells. Fewer points per cell: see"
            " docs/reports/economy.md."
        )
    scheme, grains = scene.scheme, scene.material
    if not _flat(request) or damps_by_step(scheme) or not isinstance(grains, MuI):
        return _Advice(
            "No change: the effect of larger cells was measured in one column, with the mu(I)"
            " law and a numerical damping that does not depend on the step.",
            math.nan,
        )
    rows = round(called["height"] / called["cell"])
    for coarse in (n for n in range(LEAST_ROWS, rows) if rows % n == 0):
        cell = called["cell"] * (rows // coarse)
        error = bias.incline_resolution_error(scene, cell)
        if error <= SHARE * request.tolerance:
            reason = f"{coarse} cells over the height are enough: the error falls as their square."
            return _Advice(reason, error, {"cell": cell})
    return _Advice(f"{rows} cells over the height are needed.")


def _stiffness(request: _Request) -> _Advice:
    scene = request.scene

    def error(E: float) -> float:
        return bias.stiffness_error(scene, request.name, scene.material.replace(E=E))

    present = error(scene.material.E)
    if math.isnan(present):
        reason = "No change: the effect of softer grains has not been measured here."
        return _Advice(reason, math.nan)
    E = bias.softest(scene, error, request.tolerance)
    if math.isnan(E):
        reason = (
            f"Runs that should agree differ by the remaining tolerance, {request.tolerance:.2g}."
        )
        return _Advice(reason, present)
    if E >= scene.material.E:
        fits = (
            "is soft enough" if present <= request.tolerance else "is too soft for this tolerance"
        )
        known = f"about {present:.2g}" if math.isfinite(present) else "beyond the measured range"
        reason = (
            f"E = {scene.material.E:.2g} Pa {fits}: its error is {known},"
            f" and the tolerance needs {E:.2g} Pa or more."
        )
        return _Advice(reason, present)
    softer = error(E / 10)
    beyond = "not known" if not math.isfinite(softer) else f"about {softer:.2g}"
    strain = bias.pressure_strain(scene, scene.material.replace(E=E))
    reason = (
        f"Grains need only be stiff against their load: p/K = {strain:.2g} at the foot."
        f" Ten times softer still, the error is {beyond}: not suggested."
    )
    changes = bias.softening(scene, request.name, E)
    if len(changes) > 1:
        reason += " The numerical damping, which depends on the stiffness, is held constant."
    return _Advice(reason, error(E), changes)


def _time_step(request: _Request) -> _Advice:
    scene, scheme = request.scene, request.scene.scheme
    if scheme.dt is None:
        reason = f"Adaptive at {scheme.cfl:g} of dx/c already; beyond it runs can fail silently."
        return _Advice(reason)
    if damps_by_step(scheme):
        reason = (
            f'No change: "{scheme.transfer}" has numerical damping per step, and longer steps make'
            " the flow faster."
        )
        return _Advice(reason, math.nan)
    if scheme.density.name != "particle":
        reason = (
            "No change: the density is averaged at intervals of a number of steps, which are longer"
            " with longer steps."
        )
        return _Advice(reason, math.nan)
    limit = courant_limit(scene)
    if scheme.cfl > limit:
        reason = f"Kept: the adaptive step would be beyond its limit, cfl = {scheme.cfl} > {limit}."
        return _Advice(reason)
    adaptive = damped_step(scene, scheme.cfl * scene.grid.cell / scene.wave_speed)
    if adaptive <= scheme.dt:
        reason = f"{scheme.dt:.2g} s is no less than the adaptive step of {adaptive:.2g} s."
        return _Advice(reason)
    reason = f"Adaptive at {scheme.cfl:g} of dx/c: {adaptive:.2g} s in place of {scheme.dt:.2g} s."
    return _Advice(reason, 0.0, {"dt": None})


def inertia(scene: Scene, name: str) -> float:
    """Approximate I/I0 of the flow; 0 for an incline that stays at rest.

    On an incline it is that of its slope. Elsewhere it is that of the rate sqrt(g/L) of a fall
    through the length L at the pressure rho g L, which gives 1/(xi sqrt(rho_c) L); L is the opening
    or the height.
    """
    grains = cast(MuI, scene.material)
    if name == "incline":
        return scaled_inertial_number_of_slope(float(scene.parameters["angle_deg"]), grains)
    opening = scene.parameters.get("orifice", 2 * scene.parameters.get("orifice_radius", 0.0))
    return 1.0 / (grains.xi * math.sqrt(grains.rho_c) * (opening or height(scene)))


def _rate(request: _Request) -> _Advice:
    grains = request.scene.material
    if isinstance(grains, DruckerPrager | Elastic):
        return _Advice("The material does not depend on the rate.")
    if not isinstance(grains, MuI):
        return _Advice("What the rate changes has not been measured for this law.", math.nan)
    if request.name == "incline" and grains.cohesion:
        reason = "Not estimated: with cohesion I/I0 of a layer on a slope depends on the depth."
        return _Advice(reason, math.nan)
    ratio = inertia(request.scene, request.name)
    share = 1.0 if math.isinf(ratio) else ratio / (1 + ratio)
    gain = (grains.mu_2 - grains.mu_s) / grains.mu_s * share
    about = f"I/I0 is about {ratio:.2g}, friction {gain:.1%} above mu_s"
    if request.name == "incline" and ratio > 0.0:
        return _Advice(f"It decides how fast the layer flows: {about}.", math.inf)
    error = FRICTION_SHARE * gain
    if error > request.tolerance:
        return _Advice(f"It matters: {about}.", error)
    reason = f"It does not matter: {about}. Coulomb friction mu_s would do, and costs as much."
    return _Advice(reason, error)


def _grains(request: _Request) -> _Advice:
    scene, called = request.scene, request.scene.parameters
    d = getattr(scene.material, "d", None)
    if d is None:
        reason = "The material has no grain size; with I0 and d in place of xi it can be judged."
        return _Advice(reason, math.nan)
    low, high = (d * amplitude for amplitude in NONLOCAL_AMPLITUDE)
    opening = called.get("orifice", 2 * called.get("orifice_radius", 0.0))
    size, what = (opening, "opening") if opening else (height(scene), "layer")
    text = (
        f"The size of grains is felt over A d = {1e3 * low:.2g} to {1e3 * high:.2g} mm, "
        f"{high / size:.2g} of the {what} of {size:.3g} m"
    )
    if request.name == "incline":
        text += _stopping_height(scene, d)
    verdict = "The local law leaves it out" if high / size > request.tolerance else "Negligible"
    return _Advice(f"{text}. {verdict}.", high / size)


def _stopping_height(scene: Scene, d: float) -> str:
    """Sentence on the stopping height by the nonlocal law on this slope; empty if there is none."""
    grains, angle_deg = cast(MuI, scene.material), float(scene.parameters["angle_deg"])
    low, high = (
        stopping_height(angle_deg, amplitude, d, grains.mu_s, grains.mu_2)
        for amplitude in NONLOCAL_AMPLITUDE
    )
    if not 0.0 < low < math.inf:
        return ""
    return f"; layers thinner than {low:.2g} to {high:.2g} m would not flow"


_WANTED = {
    "incline": ("the mean velocity and its profile", "x, v and mass"),
    "column_collapse": ("the toe of the run-out", "x and mass at the end"),
    "cylinder_collapse": ("the toe of the run-out", "x and mass at the end"),
    "silo": ("the rate of discharge", "the remaining mass, a series in every record"),
    "hourglass": ("the rate and the slope of the heap", "x and mass"),
    "slug": ("impact and final shape", "x, v and mass"),
}


def _fields(request: _Request) -> _Advice:
    scene = request.scene
    carried = engine.build(scene, 1.0, runs=False).fields()
    size = sum(components * dtype.itemsize for _, components, *_, dtype in carried)
    names = ", ".join(name for name, *_ in carried)
    text = f"The scheme carries {names}: {size} bytes per point, all of which it needs"
    if request.name in _WANTED:
        quantity, needed = _WANTED[request.name]
        text += f"; for {quantity}, {needed} are enough"
    return _Advice(f"{text}.")


_RULES: Mapping[str, Callable[[_Request], _Advice]] = {
    "dimension": _dimension,
    "basis": _basis,
    "resolution": _resolution,
    "stiffness": _stiffness,
    "time step": _time_step,
    "rate": _rate,
    "grains": _grains,
    "fields": _fields,
}


def suggest(scene: Scene, tolerance: float = 0.02) -> Suggestions:
    """Suggest changes that make a scene cheaper, each with a reason and an expected error.

    Parameters
    ----------
    tolerance : float
        Largest relative change of the quantity of interest by all changes together,
        0 < tolerance <= 1/2. The quantities are the flow down an incline, the toe of the run-out of
        a column, the rate of a silo, the rate and slope of an hourglass, the impact and final shape
        of a slug.

    Returns
    -------
    Suggestions
        The sum of the expected errors of all changes is at most the tolerance. The scene itself is
        not changed; `apply` makes the cheaper one.

    Raises
    ------
    TypeError, ValueError
        If `scene` is not a scene, the tolerance is out of range, or the time step of the scene
        exceeds its limit.
    """
    if not isinstance(scene, Scene):
        raise TypeError(f"scene = {scene!r} must be a Scene")
    check_time_step(scene)
    tolerance = in_range("tolerance", tolerance, 0.0, 0.5, open_low=True)
    function = scene_function(scene)
    request = _Request(scene, function.__name__ if function else "", tolerance)
    items = []
    for topic, rule in _RULES.items():
        reason, error, changes = rule(request)
        gain = 1.0
        if changes:
            cheaper = changed(request.scene, changes)
            gain = cost(request.scene).seconds / cost(cheaper).seconds
            request = replace(request, scene=cheaper, tolerance=request.tolerance - error)
        items.append(
            Suggestion(
                topic=topic, reason=reason, error=error, saving=gain, changes=changes, scene=scene
            )
        )
    return Suggestions(items)

"""Failures that are known before a run: limits that are refused, settings that raise a warning."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from granular import _core
from granular.materials import NGF, MuI
from granular.model.fill import Fill
from granular.model.plausible import BOULDER
from granular.model.regions import Cloud
from granular.model.surfaces import Heights, Layer
from granular.mpm.body_limits import light_bodies, mesh_scale, near_thin_parts, thin_parts
from granular.mpm.filling import has_material, is_full, middle_points
from granular.mpm.indicators import POINTS_PER_CELL
from granular.mpm.indicators import indicators as indicators
from granular.mpm.indicators import remedies as remedies
from granular.mpm.support import unsupported
from granular.theory.well_posed import well_posed_slopes

if TYPE_CHECKING:
    from granular.model.inflow import Inflow
    from granular.mpm.scene import Scene
    from granular.mpm.schemes import Scheme


COURANT_LIMIT = {
    "linear": {2: 0.75, 3: 0.75},
    "ugimp": {2: 0.5, 3: 0.5},
    "quadratic": {2: 0.64, 3: 0.56},
}
"""Largest (c + speed) dt/dx by basis and dimension: beyond it a run fails, mostly without a NaN.

Up to this limit no arrangement of points creates energy (the maps "arrangement" and "courant").

For splines the worst arrangement is a single point in the corner of a cell, which is stable up to
c dt/dx = 2/sqrt(6 (1 + (dim - 1) nu/(1 - nu))): 0.68 in 2D and 0.60 in 3D at nu = 0.3. At nu = 0.49
this is 0.58 and 0.48, less than the limits here, but only such an isolated point would need it.
Points side by side in the corner with quadrature weights of 1.5 and 0.5, which can occur with the
smoothed density, are stable up to 0.65 and 0.57.

For linear shape functions there is no step at which all arrangements are stable, because a node
that points hardly reach has almost no mass. Their limit is that of a layer in flow (the map
"incline_courant").
"""

LAYER_CELLS = 6
"""Least height of the material in cells, from the map "incline_seeding"."""

LOCKING = {"linear": 0.45, "ugimp": 0.45, "quadratic": 0.49}
"""Largest nu without volumetric locking, from the map "locking"."""


def courant_limit(scene: Scene) -> float:
    """Largest stable (c + speed) dt/dx of the scheme of a scene."""
    return COURANT_LIMIT[scene.scheme.basis][scene.dim]


def dt_limit(scene: Scene) -> float:
    """Largest stable time step at rest [s]: courant_limit dx/c with c = sqrt((K + 4G/3)/rho_c).

    Elastic damping reduces it (`damped_step`).
    """
    return damped_step(scene, courant_limit(scene) * scene.grid.cell / scene.wave_speed)


def step_at_rest(scene: Scene) -> float:
    """Time step [s] of a scene at rest: the fixed one, or from `cfl`."""
    crossing = scene.grid.cell / scene.wave_speed
    return scene.scheme.dt or damped_step(scene, scene.scheme.cfl * crossing)


def damped_step(scene: Scene, dt: float) -> float:
    """Time step [s] that is as far from its limit with elastic damping as dt is without it.

    The wave of the largest frequency 2/dt obeys u" = -(2/dt)^2 (u + T u'). An explicit step h of it
    is stable if h^2 + 2 T h <= dt^2, so that the limit is sqrt(dt^2 + T^2) - T.
    """
    return _core.damped_dt(dt, max(material.damping_time for material in scene.materials))


def check_time_step(scene: Scene) -> None:
    """Refuse a time step beyond its limit by a ValueError that names dt or cfl, and the limit."""
    scheme, limit = scene.scheme, courant_limit(scene)
    if scheme.dt is None:
        if scheme.cfl > limit:
            raise ValueError(
                f"cfl = {scheme.cfl} must be <= {limit} with the {scheme.basis} basis "
                f"in {scene.dim} dimensions"
            )
        return
    wave, speed = scene.wave_speed, _fastest(scene)
    largest = damped_step(scene, limit * scene.grid.cell / (wave + speed))
    if scheme.dt > largest:
        raise ValueError(
            f"dt = {scheme.dt} must be <= {largest:.4g}, the limit of the {scheme.basis} basis in "
            f"{scene.dim} dimensions with cells of {scene.grid.cell} m, waves of {wave:.4g} m/s "
            f"and points or bodies of {speed:.4g} m/s"
        )


def _fastest(scene: Scene) -> float:
    """Largest speed [m/s] of the material at the start, of the bodies and of the walls."""
    moving = (wall.velocity for wall in scene.walls)
    walls = (math.hypot(*velocity) for velocity in moving if velocity)
    points = (_speed(source) for source in scene.sources)
    return max(*points, *walls, *(body.largest_speed(scene.grid) for body in scene.bodies), 0.0)


def _speed(fill: Fill | Inflow) -> float:
    """Largest speed [m/s] of the points of a fill or inflow at first."""
    if (
        fill.velocity is None
        and isinstance(fill.region, Cloud)
        and fill.region.velocity is not None
    ):
        return float(np.linalg.norm(fill.region.velocity, axis=1).max())
    return math.hypot(*fill.velocity) if fill.velocity else 0.0


def damps_by_step(scheme: Scheme) -> bool:
    """True if the numerical damping of a transfer is per step, not per second.

    The flow then depends on the time step. On an incline of 25 degrees (one column of 10 cells,
    E = 1e6), reducing the step to a tenth takes away 2.7 % of the mean velocity under "apic" with
    quadratic splines and half of it under "xpic". The change is 0.01 % under "flip" and "tpic",
    whose numerical damping is a rate, and under "apic" with linear shape functions.
    """
    return scheme.transfer == "xpic" or (scheme.transfer == "apic" and scheme.basis != "linear")


# ---- warnings ----


def known_failures(scene: Scene) -> list[str]:
    """List the settings of a scene that are known to fail without an error, one sentence each.

    Each of these failures was measured on the maps of stability (benchmark `stability_map`,
    the page "Limits and failures").
    """
    checks = (
        _elastic,
        _density,
        _damping,
        _seeding,
        _layer,
        _locking,
        _slope,
        _grains,
        _fluidity,
        _response,
        _late,
        _scatter,
        thin_parts,
        near_thin_parts,
        light_bodies,
        mesh_scale,
        _clipped,
        _walled_in,
        _divided,
        _closed,
        unsupported,
    )
    return [warning for check in checks if (warning := check(scene))]


def _elastic(scene: Scene) -> str | None:
    """Linear shape functions with an elastic body."""
    elastic = not all(material.granular for material in scene.materials)
    if not elastic or scene.scheme.basis != "linear":
        return None
    if scene.scheme.density.name == "cell_averaged":
        return (
            "CellAveragedDensity() is made for granular material: an elastic body comes apart at "
            "any time step"
        )
    return (
        'basis = "linear" with an elastic body: a node that points hardly reach has almost no '
        "mass, and where the body moves over the cells no time step is stable"
    )


def _density(scene: Scene) -> str | None:
    """A density integrated by each point alone, in a flow that varies along the layer.

    Such a flow is stable only with a density that is averaged over neighbouring points.
    """
    if not _granular(scene) or scene.scheme.density.name != "particle" or not _many_columns(scene):
        return None
    return (
        "ParticleDensity() loses contacts and volume in flows that are truly two-dimensional: most "
        "points become stress-free, layers compact; take SmoothedDensity() (the default)"
    )


def _damping(scene: Scene) -> str | None:
    """Transfers with numerical damping per step, in one column.

    With more columns `_density` warns of the density of these transfers, which is the more serious
    failure.
    """
    if not _granular(scene) or _many_columns(scene) or not damps_by_step(scene.scheme):
        return None
    return (
        f'transfer = "{scene.scheme.transfer}" has numerical damping per step, not per second: the '
        'flow depends on the time step and is too slow; take "tpic" or "flip"'
    )


def _seeding(scene: Scene) -> str | None:
    """Too few points per cell."""
    fewest = min(source.points_per_cell for source in scene.sources)
    if not _granular(scene) or fewest >= POINTS_PER_CELL or not _many_columns(scene):
        return None
    return f"points_per_cell = {fewest} is too few for a flow: take {POINTS_PER_CELL} or more"


def _layer(scene: Scene) -> str | None:
    """Too few cells over the height of the material."""
    if not _granular(scene) or scene.inflows:  # the height is not known
        return None
    cells = _thickness(scene) / scene.grid.cell
    if cells >= LAYER_CELLS * (1 - 1e-9):
        return None
    return f"material of {cells:.3g} cells in height: take {LAYER_CELLS} or more"


def _locking(scene: Scene) -> str | None:
    """Volumetric locking of nearly incompressible material."""
    nu = max(material.nu for material in scene.materials)
    limit = LOCKING[scene.scheme.basis]
    if nu <= limit:
        return None
    return (
        f"nu = {nu} exceeds {limit}: the {scene.scheme.basis} basis makes nearly incompressible "
        "material too stiff (volumetric locking)"
    )


def _slope(scene: Scene) -> str | None:
    """Endless layer on a slope outside of the range where the mu(I) law is well posed."""
    material, grid = scene.material, scene.grid
    if not isinstance(material, MuI | NGF) or len(scene.materials) > 1:
        return None
    if getattr(material, "cohesion", 0.0) or not material.is_local(grid.cell):
        return None
    if isinstance(material, NGF) and math.isinf(material.limiting_friction):
        return None
    if not _many_columns(scene) or not all(grid.periodic[:-1]):
        return None
    *along, across = scene.gravity.vectors[-1]
    if not across < 0:
        return None
    slope = math.degrees(math.atan2(math.hypot(*along), -across))
    if slope <= math.degrees(math.atan(material.mu_s)):
        return None  # at rest
    ends = well_posed_slopes(material)
    if ends is not None and ends[0] <= slope <= ends[1]:
        return None
    where = "nowhere" if ends is None else f"from {ends[0]:.1f} to {ends[1]:.1f} deg only"
    return (
        f"a slope of {slope:.4g} deg: the mu(I) law is well posed {where} (Barker et al. 2015); "
        "refinement need not converge"
    )


def _grains(scene: Scene) -> str | None:
    """Cells smaller than the grains of a local law; a nonlocal law contains the grain size."""
    local = [material for material in scene.materials if material.is_local(scene.grid.cell)]
    sizes = [size for material in local if (size := getattr(material, "d", None)) is not None]
    d = max(sizes, default=0.0)
    if scene.grid.cell >= d:
        return None
    hint = f"; did you mean d = {d / 1000:g}, in m?" if d > BOULDER else ""
    cell = scene.grid.cell
    return f"cell = {cell} is smaller than the grains, d = {d}: there is no continuum{hint}"


def _fluidity(scene: Scene) -> str | None:
    """Initial fluidity of points that are stress-free at the start."""
    initial = scene.scheme.fluidity.initial
    lithostatic = all(source.lithostatic for source in scene.sources)
    if not initial or lithostatic or scene.nonlocal_material is None:
        return None
    return (
        f"fluidity.initial = {initial}: points that are stress-free at the start lose their "
        "fluidity in the first step; take lithostatic fills, or no initial fluidity"
    )


def _response(scene: Scene) -> str | None:
    """Fluidity of a length below a cell that responds more slowly than waves cross the material."""
    fluid = scene.nonlocal_material
    if not isinstance(fluid, NGF) or scene.inflows:  # with inflows the height is not known
        return None
    crossing = _thickness(scene) / fluid.wave_speed
    if fluid.A * fluid.d >= scene.grid.cell or fluid.t0 <= crossing:
        return None
    return (
        f"t0 = {fluid.t0:g} s is longer than a wave takes to cross the material, {crossing:.2g} s: "
        "until the fluidity has grown it is elastic, and its waves do not decay; take a smaller "
        "t0 or E"
    )


UNRESOLVED = 150.0
"""Time step over t0 from which a nonlocal law responds like the local one, within a step.

In between the response is delayed: at 6, 20, 60 and 190 the force on a blade is 16, 13, 9 and 2 %
less than with A = 0, and at 6 a wheel sinks by 40 % more (docs/explanation/fluidity.md)."""


def _late(scene: Scene) -> str | None:
    """Fluidity whose response time is neither resolved by a substep nor much shorter."""
    fluid = scene.nonlocal_material
    if not isinstance(fluid, NGF) or not fluid.is_local(scene.grid.cell):
        return None
    dt = step_at_rest(scene)
    short = dt / UNRESOLVED
    if fluid.t0 <= short or dt / scene.scheme.fluidity.substeps <= fluid.t0:
        return None
    substeps, smaller = math.ceil(dt / fluid.t0), 10 ** math.floor(math.log10(short))
    return (
        f"t0 = {fluid.t0:g} s of the fluidity is less than the time step of {dt:.2g} s, but not so "
        "small that the law flows within the step: its response is late, and the material weaker; "
        f"take t0 = {smaller:g} or Fluidity(substeps={substeps})"
    )


FRICTION_RANGE = 1.0
"""Least mu_2 - mu_s of a nonlocal law with quadratic shape functions.

The friction of the points of a cell scatters, and the growth of the fluidity is convex in it. In 10
cells and at a friction halfway between mu_s and mu_2, layers are 18, 7, 4 and 2 % too fast with
differences of 0.26, 0.52, 0.82 and 1.12 (`benchmarks/external/external_refinement.py`).
"""


def _scatter(scene: Scene) -> str | None:
    """Quadratic shape functions with a nonlocal law whose friction comes near its limit."""
    fluid = scene.nonlocal_material
    if not isinstance(fluid, NGF) or scene.scheme.basis != "quadratic":
        return None
    if fluid.is_local(scene.grid.cell):  # then flows differ from the local law's by 0.2 %
        return None
    if fluid.limiting_friction - fluid.mu_s >= FRICTION_RANGE:
        return None
    return (
        f'basis = "quadratic" with a nonlocal law of mu_2 = {fluid.mu_2:g}: its friction scatters '
        "within the cells, and flows are too fast the nearer it comes to mu_2, layers of 10 cells "
        "by up to a third; take schemes.cell_averaged"
    )


def _clipped(scene: Scene) -> str | None:
    """APIC with boxes that end at the ends of the grid, so that their centre is not the point."""
    if scene.scheme.transfer != "apic" or scene.scheme.basis != "ugimp" or all(scene.grid.periodic):
        return None
    return (
        'transfer = "apic" with basis = "ugimp" creates momentum and energy in points at the ends '
        'of the grid; take "tpic" or "flip", or another basis'
    )


def _walled_in(scene: Scene) -> str | None:
    """Blocks inside a fill: no force moves the points within a block."""
    for i, wall in enumerate(scene.walls):
        lower, upper = wall.corners(scene.grid)
        for j, fill in enumerate(scene.fills):
            low, high = fill.region.bounds
            middles = middle_points(scene, np.maximum(lower, low), np.minimum(upper, high))
            if fill.region.contains(middles).any():
                return (
                    f"fills[{j}] has points within walls[{i}], a Solid, which holds them: leave "
                    "its volume out of the region (Difference)"
                )
    return None


def _divided(scene: Scene) -> str | None:
    """Walls within the grid that material can slide along on both sides, which share its nodes."""
    grid = scene.grid
    for i, wall in enumerate(scene.walls):
        if wall.axis is None or wall.rule.sticks or not np.isinf(wall.opens_at):
            continue
        low, high = wall.corners(grid)
        across = grid.cell * np.eye(grid.dim)[wall.axis]
        above = middle_points(scene, low, high + across)
        facing = has_material(scene, above) & has_material(scene, above - across)
        if facing.any():
            return (
                f"walls[{i}] has material on both sides, which share the nodes on it: shear passes "
                'through it, and friction of a "coulomb" wall where both sides press on it is lost;'
                " take a Body of three cells in thickness"
            )
    return None


def _closed(scene: Scene) -> str | None:
    """Material that is closed in without a wall that keeps a pressure, or the reverse."""
    if not _granular(scene):
        return None
    full = is_full(scene)
    for servo in scene.servos:
        if full:
            return None
        return (
            f"walls[{servo.wall}] keeps a pressure, but the material does not fill the domain: "
            "below a free surface its weight determines the pressure, and the servo changes only "
            "its density; fill the domain, or give the wall no pressure"
        )
    opens = any(getattr(wall, "opens_at", math.inf) < math.inf for wall in scene.walls)
    if not full or opens or scene.grid.open_sides:
        return None
    return (
        "the material is closed in on every side: its mean pressure K ln(rho/rho_c) is a strain "
        "below the errors of the volume, and drifts in plastic flow; let a Wall at an end of the "
        "grid keep it (pressure=...), or leave a free surface"
    )


def height(scene: Scene) -> float:
    """Height of the material at the start [m]; with inflows up to the highest from the ground."""
    lows, highs = zip(*(source.region.bounds for source in scene.sources), strict=True)
    lowest = scene.grid.lower[-1] if scene.inflows else min(low[-1] for low in lows)
    return max(high[-1] for high in highs) - lowest


def _thickness(scene: Scene) -> float:
    """Height of the material at the start [m], of a single layer on a surface its thickness."""
    regions = [source.region for source in scene.sources]
    if len(regions) > 1 or not isinstance(regions[0], Layer):
        return height(scene)
    thickness = regions[0].thickness
    return float(thickness.z.max()) if isinstance(thickness, Heights) else float(thickness)


def _granular(scene: Scene) -> bool:
    return any(material.granular for material in scene.materials)


def _many_columns(scene: Scene) -> bool:
    """True if a flow can vary along the layer: it has more than one periodic column."""
    grid = scene.grid
    pairs = zip(grid.shape[:-1], grid.periodic[:-1], strict=True)
    return any(count > 1 or not periodic for count, periodic in pairs)

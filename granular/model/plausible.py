"""Implausible numbers of a scene: mistakes of unit, of axis and of sign.

All limits are here, each with its source. They only raise warnings: a run with such numbers goes
on, and its results may be those of another material.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import fields, is_dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from granular.model.fill import rest_density
from granular.model.gravity import EARTH
from granular.model.grid import AXES
from granular.model.regions import Cloud
from granular.model.surfaces import Heights, Layer
from granular.shapes.mesh import Mesh

if TYPE_CHECKING:
    from granular.model.scene import BaseScene


FRICTION = (0.02, 1.5)
"""Friction coefficients of grains: 0.2 to 0.4 for rounded smooth grains, for broken rock
under little stress up to tan 55 deg = 1.4 (Leps 1970, J. Soil Mech. Found. Div. ASCE 96), and of
smooth grains in lubricated contact 0.05 and less."""
BULK = (5.0, 12e3)
"""Densities of granular material [kg/m3]: beads of foam have 8 to 20, aerogel and fresh snow 30 to
50, powder of tungsten 10,000."""
SOLID = (5.0, 23e3)
"""Densities of grains and bodies [kg/m3]: beads of foam have 10 to 30, osmium, the densest solid,
22,590."""
LARGEST_LOADING = 10.0
"""Largest mass of a body over that of a cube of osmium that contains it: a plate may bear a load
that is not modelled, but steel in grams is 100 times more."""
STIFFEST = 1.2e12
"""Largest Young's modulus of a solid, diamond [Pa]."""
LARGEST_STRAIN = 0.0177
"""Largest weight of the material above its base over the modulus of compression K. Up to it the
errors of softer grains were measured (`granular.economy.bias`): the run-out of a column is 3 % too
short there, and material that falls over its own height has a sixth of the speed of its waves."""
STIFF = 1e-3
"""The same over E that guides recommend (docs/how-to/choose_a_stiffness.md)."""
LARGEST_GRAVITY = 5e3
"""Largest gravity [m/s2], that of geotechnical centrifuges: 500 times that of the earth."""
CENTRIFUGE = (0.01, 2.0)
"""Cell and longest side of a domain [m] that are plausible in a centrifuge: its boxes have 0.3 to
1.5 m, and cells of a hundredth resolve them."""
WEAKEST = 1.0
"""Gravity [m/s2] that is plausible; the moon has 1.62."""
FASTEST_RIM = 120.0
"""Largest speed [m/s] of the rim of a tool: grinding and cut-off discs have 80 to 100."""
LARGEST_GRAIN = 0.5
"""Largest diameter of a grain over the longest side of the domain; a silo may be five grains wide,
a column of a layer three."""
BOULDER = 0.5
"""Diameter of a grain [m] from which it is implausible that cells resolve it."""
LIKELY = 200.0
"""Least density [kg/m3] that is suggested instead of a mistake; that of cork and expanded
perlite."""
DENSE, DILUTE = 1.05, 0.05
"""Densities of fills over rho_c. Above, the pressure at the start is a part of the stiffness;
below, the material is a gas, for which these laws are not made. An inflow may be a rain of any
density."""
LARGEST_MESH = 50.0
"""Largest edge of the box about the mesh of a body over the longest side of the domain; terrain is
rarely ten times as long as what is modelled on it, and a drawing in millimetres 1000 times."""
MOST_STEPS = 1e9
"""Implausibly many steps: at least a week where a step takes a millisecond."""
INERTIA = (1e-6, 1e3)
"""Moments of inertia over m R^2, R the distance of the farthest point of a body. That of a rod a
hundred times as long as thick, about its axis, is 5e-5. A motor behind a gear may add a hundred
times that of its wheel; moments in kg cm2 are 1000 to 10,000 times too large."""
UNITS_OF_INERTIA = {1e4: "kg cm2", 1e6: "kg mm2", 1e7: "g cm2", 1e9: "g mm2"}
"""Units of moments of inertia by how many are 1 kg m2."""
TYPED = 5e-6
"""Relative error of an angle in radians that is typed with four digits after the point."""


def suspect_numbers(scene: BaseScene) -> list[str]:
    """List the implausible numbers of a scene, one sentence each, with the likely mistake."""
    checks: tuple[Callable[[BaseScene], Iterator[str]], ...] = (
        _friction,
        _angles,
        _densities,
        _grains,
        _stiffness,
        _gravity,
        _idle,
        _speeds,
        _turning,
        _steps,
        _small,
        _outside,
        _meshes,
        _masses,
    )
    return [sentence for check in checks for sentence in check(scene)]


# ---- materials ----


def _friction(scene: BaseScene) -> Iterator[str]:
    named = [
        (f"{type(material).__name__}: {name}", getattr(material, name), FRICTION[0])
        for material in scene.materials
        for name in ("mu_s", "mu", "mu_l")
        if hasattr(material, name)
    ]
    for kind in ("walls", "bodies"):
        parts = enumerate(getattr(scene, kind, ()))
        named += [
            (f"{kind}[{i}].friction", getattr(part, "friction", 0.0), 0.0) for i, part in parts
        ]
    for name, mu, least in named:
        if mu > FRICTION[1]:
            hint = f"did you mean tan({mu:g} deg) = {math.tan(math.radians(mu)):.3g}?"
            rough = 'contact = "sticky"' if name.startswith("bodies") else 'kind = "no_slip"'
            other = f"for a rough surface take {rough}" if "friction" in name else "it has no unit"
            text = hint if 3 <= mu < 80 else other
            yield f"{name} = {mu:g} is beyond the friction of any grains, {FRICTION[1]}: {text}"
        elif mu < least:
            yield (
                f"{name} = {mu:g} is below the friction of any grains, {FRICTION[0]}: the "
                "coefficient of dry ones is 0.2 to 1"
            )


def _angles(scene: BaseScene) -> Iterator[str]:
    """Angles that should be in degrees, and are whole degrees in radians."""
    named = [(f"parameters[{name!r}]", value) for name, value in scene.parameters.items()]
    for kind in ("materials", "bodies"):
        for i, part in enumerate(getattr(scene, kind, ())):
            named += _numbers_in(f"{kind}[{i}]", part)
    for name, value in named:
        if "_deg" not in name or not isinstance(value, float) or not 0 < abs(value) <= 2 * math.pi:
            continue
        degrees = math.degrees(value)
        exact = abs(degrees - round(degrees)) < 1e-9 * abs(degrees)
        if exact or abs(degrees - 15 * round(degrees / 15)) < TYPED * abs(degrees):
            yield f"{name} = {value:.6g}, in degrees: did you mean {degrees:.6g}, this in radians?"


def _numbers_in(name: str, part: Any) -> list[tuple[str, Any]]:
    """Names and values of all numbers of a description, and of the descriptions within it."""
    if is_dataclass(part):
        parts = ((f"{name}.{field.name}", getattr(part, field.name)) for field in fields(part))
    elif isinstance(part, tuple):
        parts = ((f"{name}[{i}]", value) for i, value in enumerate(part))
    else:
        return [(name, part)]
    return [number for inner in parts for number in _numbers_in(*inner)]


def _densities(scene: BaseScene) -> Iterator[str]:
    for material in scene.materials:
        kind = type(material).__name__
        solid = getattr(material, "rho_s", None)
        for name, value, (low, high) in (("rho_c", material.rho_c, BULK), ("rho_s", solid, SOLID)):
            if value is not None and not low <= value <= high:
                hint = _thousands(value, max(low, LIKELY), high)
                yield f"{kind}: {name} = {value:g} kg/m3 is not a density of grains{hint}"
                break
    for i, fill in enumerate(scene.fills):
        rho_c = rest_density(fill.material or scene.material, fill.packing)
        low, high = DILUTE * rho_c, DENSE * rho_c
        if fill.density is not None and not low <= fill.density <= high:
            yield (
                f"fills[{i}] has a density of {fill.density:.4g} kg/m3, "
                f"{fill.density / rho_c:.3g} of rho_c{_thousands(fill.density, low, high)}"
            )


def _thousands(density: float, low: float, high: float) -> str:
    """Return the density if the number is in g/cm3, or in g/m3, if it is in a range."""
    for factor in (1000, 0.001):
        if low <= density * factor <= high:
            return f": did you mean {density * factor:g}?"
    return ""


def _grains(scene: BaseScene) -> Iterator[str]:
    """Grains of nonlocal laws and of elastic damping; the cells of a scene limit those of
    others."""
    cell, longest = scene.grid.cell, max(scene.grid.shape) * scene.grid.cell
    for material in scene.materials:
        nonlocal_ = getattr(material, "has_fluidity", False)
        names = ("d", "contact_diameter") if nonlocal_ else ("contact_diameter",)
        for name in names:
            size = getattr(material, name, None) or 0.0
            if size > LARGEST_GRAIN * longest or size > max(BOULDER, cell):
                yield (
                    f"{type(material).__name__}: {name} = {size:g} m in a domain of {longest:.3g} m"
                    f": did you mean {size / 1000:g}, this in mm?"
                )


def _stiffness(scene: BaseScene) -> Iterator[str]:
    for material in scene.materials:
        E = getattr(material, "E", None)
        if E is None:
            continue
        if E > STIFFEST:
            yield (
                f"{type(material).__name__}: E = {E:g} Pa is stiffer than diamond: the time step "
                "is proportional to 1/sqrt(E), and E need only be large compared with the load"
            )
    yield from filter(None, [stiffness_hint(scene)])


def stiffness_hint(scene: BaseScene) -> str:
    """Sentence on material that is too soft for its load; empty for one that is not."""
    worst = max(_loads(scene), key=lambda load: load[0] / load[1].K, default=None)
    if worst is None or worst[0] <= LARGEST_STRAIN * worst[1].K:
        return ""
    load, (E, K) = worst[0], (worst[1].E, worst[1].K)
    needed = load / LARGEST_STRAIN * E / K
    unit = next((factor for factor in (1e3, 1e6, 1e9) if needed <= E * factor <= STIFFEST), None)
    hint = "" if unit is None or E > 1e5 else f"did you mean E = {E * unit:g} Pa, or "
    return (
        f"E = {E:g} Pa is too soft: under the load of {load:.3g} Pa, p/E = {load / E:.3g}, the "
        f"density rises by a share of {load / K:.2g}, and flows change by some per cent: {hint}"
        f"take E >= {load / STIFF:.2g}, 1000 times the load" + ("?" if hint else "")
    )


def largest_load(scene: BaseScene) -> tuple[float, float]:
    """Pressure [Pa] at the base of a fill or inflow, or of a servo, and E [Pa]: the softest case.

    Zero and one if no material of the scene has an E.
    """
    loads = ((load, material.E) for load, material in _loads(scene))
    return max(loads, key=lambda pair: pair[0] / pair[1], default=(0.0, 1.0))


def rounded(E: float) -> float:
    """E rounded up to two digits."""
    unit = 10.0 ** (math.floor(math.log10(E)) - 1)
    return math.ceil(round(E / unit, 6)) * unit


def _loads(scene: BaseScene) -> Iterator[tuple[float, Any]]:
    """Yield the pressure [Pa] at the base of each fill and inflow, and of a servo, and the
    materials with an E that bear it."""
    g = max(abs(vector[-1]) for vector in scene.gravity.vectors)
    sources: tuple[Any, ...] = (*scene.fills, *scene.inflows)
    for source in sources:
        material = source.material or scene.material
        if hasattr(material, "E"):
            yield material.rho_c * g * _thickness(source.region), material
    for servo in getattr(scene, "servos", ()):
        yield servo.pressure, scene.material


def _thickness(region: Any) -> float:
    """Height of a region [m], of a layer its thickness."""
    if isinstance(region, Layer):
        thickness = region.thickness
        return float(thickness.z.max()) if isinstance(thickness, Heights) else float(thickness)
    low, high = region.bounds
    return float(high[-1] - low[-1])


# ---- set-up ----


def _gravity(scene: BaseScene) -> Iterator[str]:
    vectors = np.array(scene.gravity.vectors)
    largest = float(np.linalg.norm(vectors, axis=1).max())
    cell, longest = scene.grid.cell, max(scene.grid.shape) * scene.grid.cell
    spins = cell < CENTRIFUGE[0] and longest <= CENTRIFUGE[1]
    for factor, unit in ((100, "cm/s2"), (1000, "mm/s2")):
        if abs(largest / (factor * EARTH) - 1) < 0.01 and (largest > LARGEST_GRAVITY or not spins):
            hint = f"{largest / factor:g}, this in {unit}"
            yield f"gravity of {largest:g} m/s2: did you mean {hint}?"
            return
    if largest > LARGEST_GRAVITY:
        yield f"gravity of {largest:g} m/s2 is beyond that of a centrifuge, {LARGEST_GRAVITY:g}"
    up = AXES[scene.dim - 1]
    if vectors[:, -1].min() >= 0 and vectors[:, -1].max() > WEAKEST:
        yield f"gravity = {vectors[-1].tolist()} points upwards: the last axis, {up}, is up"
    elif not vectors[:, -1].any() and vectors.any() and not _is_laid(scene, vectors, largest):
        yield f"gravity = {vectors[-1].tolist()} has no component along {up}, the axis that is up"


def _is_laid(scene: BaseScene, vectors: Any, largest: float) -> bool:
    """True if a scene with gravity along another axis than the last is built for it.

    A single floor normal to the last axis says that this one is up; walls on both of its sides, a
    chute or a silo, do not, nor do walls normal to gravity, blocks and bodies without a floor.
    """
    axis, last = int(np.abs(vectors).max(axis=0).argmax()), scene.dim - 1
    if scene.grid.periodic[axis] or scene.grid.periodic[last]:
        return True
    walls: list[Any] = [wall for wall in scene.walls if wall.axis is not None]
    sides = {wall.at for wall in walls if wall.axis == last}
    held = any(wall.axis == axis for wall in walls)
    if len(sides) == 1:
        return held and abs(largest / EARTH - 1) >= 0.01
    blocks = len(walls) < len(scene.walls)
    return bool(sides) or held or blocks or bool(scene.bodies)


def _idle(scene: BaseScene) -> Iterator[str]:
    """Scenes without anything that moves the material."""
    moving = [getattr(part, "velocity", None) for part in (*scene.fills, *scene.walls)]
    moving += [fill.region.velocity for fill in scene.fills if isinstance(fill.region, Cloud)]
    bodies = scene.bodies
    moves = any(body.motion.rows()[:, 1:].any() for body in bodies)
    pressed = any(fill.density is not None for fill in scene.fills)
    other = scene.inflows or pressed or getattr(scene, "servos", ()) or getattr(scene, "jets", ())
    still = all(velocity is None or not np.any(velocity) for velocity in moving)
    if still and not (moves or other or np.any(scene.gravity.vectors)):
        yield "gravity is 0, and no part has a velocity: there will be no motion"


def _speeds(scene: BaseScene) -> Iterator[str]:
    """Parts that are faster than elastic waves."""
    c = scene.wave_speed
    for kind in ("fills", "inflows", "walls", "bodies"):
        for i, part in enumerate(getattr(scene, kind, ())):
            velocity = getattr(part, "velocity", None)
            speed = 0.0 if velocity is None else math.hypot(*velocity)
            if kind == "bodies":
                speed = float(np.linalg.norm(part.motion.rows()[:, 1:4], axis=1).max())
            if speed > c:
                yield (
                    f"{kind}[{i}] has a speed of {speed:.4g} m/s, faster than elastic waves, "
                    f"{c:.3g} m/s: velocities are in m/s, and real grains are stiffer than this"
                )


def _turning(scene: BaseScene) -> Iterator[str]:
    """Angular velocities that no tool has, or whole turns in degrees."""
    for i, body in enumerate(scene.bodies):
        half, omegas = body.extents(), body.motion.rows()[:, 4:]
        half = np.where(np.isfinite(half), half, 0.0)
        fastest = max(
            float(np.linalg.norm(np.cross(omegas, h), axis=1).max()) for h in np.diag(half)
        )
        omega = float(np.linalg.norm(omegas, axis=1).max())
        if fastest > FASTEST_RIM or (omega and omega % 360 == 0):
            yield (
                f"bodies[{i}] turns at {omega:.4g} rad/s, its rim at {fastest:.3g} m/s: did you "
                f"mean {math.radians(omega):.4g} rad/s, {omega:.4g} deg/s, or "
                f"{omega * math.pi / 30:.4g} rad/s, {omega:.4g} rpm?"
            )


def _steps(scene: BaseScene) -> Iterator[str]:
    dt = getattr(getattr(scene, "scheme", None), "dt", None)
    dt = dt or scene.courant_limit * scene.grid.cell / scene.wave_speed
    if scene.duration > MOST_STEPS * dt:
        yield (
            f"duration = {scene.duration:g} s takes {scene.duration / dt:.2g} steps of {dt:.2g} s: "
            "times are in s; the step is proportional to cell/sqrt(E/rho)"
        )


def _small(scene: BaseScene) -> Iterator[str]:
    """Fills that are thinner than a cell."""
    least = (1 - scene.grid.slack) * scene.grid.cell
    for i, fill in enumerate(scene.fills):
        size = min(b - a for a, b in zip(*fill.region.bounds, strict=True))
        if size < least and not isinstance(fill.region, Cloud):
            yield (
                f"fills[{i}] is {size:.3g} m thin, less than a cell of {scene.grid.cell:g} m: "
                "lengths are in m; take smaller cells"
            )


def _outside(scene: BaseScene) -> Iterator[str]:
    """Bodies that are outside of the domain and do not enter it."""
    grid, g = scene.grid, np.array(scene.gravity.vectors)
    near, longest = grid.cell, max(grid.shape) * grid.cell
    for i, body in enumerate(scene.bodies):
        for axis in np.flatnonzero(~np.array(grid.periodic)):
            reach, at, free = body.extents()[axis], body.position[axis], AXES[axis] in body.free
            for sign, end in ((-1, grid.lower[axis]), (1, grid.upper[axis])):
                gap = sign * (at - end) - reach
                if gap <= near or (gap <= longest and _is_near_another(scene, i)):
                    continue
                inwards = -sign * body.motion.rows()[:, 1 + axis]
                comes = (inwards.max() > 0 or (-sign * g[:, axis]).max() > 0) if free else False
                if not free:
                    comes = _way(body.motion.rows()[:, 0], inwards, scene.duration) > gap
                if not comes:
                    yield (
                        f"bodies[{i}] at {at:g} m is outside of the domain along {AXES[axis]}, by "
                        f"{gap:.3g} m beyond {end:g} m, and does not enter it: lengths are in m"
                    )


def _meshes(scene: BaseScene) -> Iterator[str]:
    """Meshes of bodies that are far larger than the domain, as those of drawings in millimetres."""
    longest = max(scene.grid.shape) * scene.grid.cell
    for i, body in enumerate(scene.bodies):
        for leaf in body.shape.leaves():
            if isinstance(leaf, Mesh):
                size = float(np.subtract(*leaf.bounds[::-1]).max())
                if size > LARGEST_MESH * longest:
                    yield (
                        f"bodies[{i}] has a mesh of {size:.4g} m in a domain of {longest:.4g} m: "
                        "did you mean Mesh.read(..., scale=1e-3), as its lengths are in mm?"
                    )


def _is_near_another(scene: BaseScene, i: int) -> bool:
    """True if the box about a body meets that of another one, on which it may roll or stand."""
    body = scene.bodies[i]
    return any(
        (
            np.abs(np.subtract(body.position, other.position))
            <= (body.extents() + other.extents())[: scene.dim] + scene.grid.cell
        ).all()
        for k, other in enumerate(scene.bodies)
        if k != i
    )


def _way(times: Any, velocity: Any, duration: float) -> float:
    """Largest displacement along an axis with a velocity that is linear between times."""
    t = np.unique(np.concatenate([np.linspace(0.0, duration, 200), times.clip(0.0, duration)]))
    v = np.interp(t, times, velocity)
    return float(np.max(np.cumsum(0.5 * (v[1:] + v[:-1]) * np.diff(t)), initial=0.0))


def _masses(scene: BaseScene) -> Iterator[str]:
    """Masses and moments of inertia that no body of this size has."""
    for i, body in enumerate(scene.bodies):
        half = body.extents()[: scene.dim]
        if body.mass is None or not np.isfinite(half).all():
            continue
        depth = ", per metre of depth" if scene.dim == 2 else ""
        loading = body.mass / float(2 * half.max()) ** scene.dim
        if loading > LARGEST_LOADING * SOLID[1]:
            yield (
                f"bodies[{i}].mass = {body.mass:g} kg is more than {loading:.3g} kg/m3: masses are "
                f"in kg{depth}; did you mean {body.mass / 1000:g}, this in g?"
            )
        least = body.least_volume()
        if body.mass < SOLID[0] * least:
            yield (
                f"bodies[{i}].mass = {body.mass:g} kg is less than {body.mass / least:.3g} kg/m3: "
                f"masses are in kg{depth}; did you mean {body.mass * 1000:g}, this in tonnes?"
            )
        if body.inertia is not None:
            yield from _inertias(i, body, body.mass * float(half.max()) ** 2)


def _inertias(i: int, body: Any, most: float) -> Iterator[str]:
    """Moments of inertia far from those of a body, at most `most` for a body that turns as a
    whole."""
    moments = np.linalg.eigvalsh(_tensor(body.inertia))
    largest = float(moments.max()) / most
    if INERTIA[0] * most <= moments.min() and largest <= INERTIA[1]:
        return
    unit = next((n for n in UNITS_OF_INERTIA if INERTIA[1] < largest <= n), None)
    hint = ":"
    if unit is not None:
        value = f"{moments.max() / unit:.3g} kg m2, this in {UNITS_OF_INERTIA[unit]}"
        hint = f": did you mean {value}? It is"
    yield (
        f"bodies[{i}].inertia = {body.inertia} kg m2 is impossible for a body of {body.mass:g} kg "
        f"within {math.sqrt(most / body.mass):.3g} m{hint} about {0.3 * most:.2g}, see "
        "mass_properties"
    )


def _tensor(inertia: Any) -> Any:
    values = np.atleast_1d(np.array(inertia, dtype=float))
    return values if values.ndim == 2 else np.diag(values)

"""Make an engine of the C core from a scene; only this module calls the core with its codes."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from granular import _core
from granular.materials import NGF, Material
from granular.materials.law_functions import MOST_HISTORY
from granular.materials.own import OwnLaw
from granular.model.fill import rest_density
from granular.model.inflow import inlet_points
from granular.model.seeding import Points
from granular.mpm.axis_nodes import c0_lines
from granular.mpm.body_limits import check_blades
from granular.mpm.cell_codes import cell_flags, fluidity_faces
from granular.mpm.damping import damping, velocity_decay
from granular.mpm.limits import check_time_step, step_at_rest
from granular.mpm.lithostatic import rest_compression, stress_shape
from granular.mpm.node_codes import WallRow, node_codes
from granular.mpm.scene import Scene, Servo
from granular.mpm.schemes import SmoothedDensity
from granular.tools.arrays import Array, IntArray
from granular.tools.buffers import allocate, rows_of

CORE = _core.enumerations()
UNBOUNDED = 1e300
LOCAL_PHASE = 10.0
"""Duration of the local phase of a nonlocal law without an initial fluidity, in units of t0."""


def _density_numbers(scene: Scene) -> dict[str, float]:
    """Numbers of the density; one of them is converted to what the core needs."""
    numbers = scene.scheme.density.numbers()
    if "relaxation_limit" in numbers:
        numbers["relaxation_limit"] = _relaxation_limit(scene, numbers["relaxation_limit"])
    return numbers


def _local_phase(scene: Scene) -> float:
    """Time [s] at which the diffusion of the fluidity of a nonlocal law begins."""
    if scene.scheme.fluidity.initial is not None:
        return 0.0
    material = scene.nonlocal_material
    return LOCAL_PHASE * material.t0 if isinstance(material, NGF) else 0.0


ROUNDED_POINTS = 64
"""Points that may lie at one node of an end of the grid."""


def _cutoff(scene: Scene) -> float:
    """Mass [points] up to which a node does not move.

    Points that an end of the grid stops lie within the rounding of its coordinate, and the node a
    cell before it has that share of their masses, but a whole part of their forces.
    """
    return max(scene.scheme.mass_cutoff, ROUNDED_POINTS * scene.grid.rounding)


def _parameters(scene: Scene, material: Material) -> dict[str, float]:
    """Parameters of a law by their names in the core, and other numbers of the material."""
    numbers = material.arguments() | {"K": material.K, "G": material.G}
    for derived in ("xi", "I1", "tensile_strength", "phi_fast"):
        if hasattr(material, derived):
            numbers[derived] = getattr(material, derived)
    if isinstance(material, NGF):
        averaging = scene.scheme.fluidity.pressure_averaging
        if averaging is None:
            of = (part for part in scene.sources if (part.material or scene.material) == material)
            source = next(of, scene.sources[0])  # the material of a scene may be in none
            averaging = 0.5 / (1 if scene.scheme.basis == "linear" else source.points_per_axis)
        numbers |= material.core_friction()
        numbers |= {"cohesion": 0.0, "tensile_strength": 0.0}  # of the local law, if A is 0
        # The largest component: a layer on a slope is loaded by gravity across the layer.
        across = float(np.abs(scene.gravity.vectors).max())
        layer = material.rho_c * across * scene.grid.cell
        numbers["p_averaging"] = averaging * layer
        numbers["reconnect_fluidity"] = float(scene.scheme.fluidity.reconnect_fluidity)
    return numbers


def _material_row(scene: Scene, material: Material, runs: bool) -> _core.MaterialRow:
    """Law of a material, its numbers, and the parameters of its law, as the core needs them."""
    separation = scene.scheme.density.numbers()["separation_strain"]
    of_scene = {
        # material that bears tension is never disconnected
        "separation_strain": separation if material.granular else UNBOUNDED,
        **damping(scene, material, largest_gravity(scene)),
    }
    numbers = {
        name: of_scene[name] if name in of_scene else getattr(material, name, 0.0)
        for name in _core.material_numbers()
    }
    law = None
    if isinstance(material, OwnLaw):
        capsule = material.function().capsule if runs else None
        law = capsule, material.numbers(), bool(material.history)
    return material.law, numbers, _parameters(scene, material), law


def largest_gravity(scene: Scene) -> float:
    """Largest gravity of a scene [m/s2]; under a wall that keeps P at least P/(rho_c H)."""
    magnitude = float(np.linalg.norm(scene.gravity.vectors, axis=1).max())
    loads = [s.pressure / extent(scene, s.axis) / scene.material.rho_c for s in scene.servos]
    return max([magnitude, *loads])


def extent(scene: Scene, axis: int) -> float:
    """Extent of the domain along an axis [m]."""
    return scene.grid.shape[axis] * scene.grid.cell


MOST_STEPS = 10**9
"""Largest number of steps between two averagings, an integer of the core."""


def averaging_interval(scene: Scene) -> int:
    """Number of steps between two averagings of the density."""
    density = scene.scheme.density
    if not isinstance(density, SmoothedDensity):
        return 1
    steps = density.averaging_time * _steps_per_crossing(scene)
    if not steps <= MOST_STEPS:
        raise ValueError(
            f"averaging_time = {density.averaging_time:g} is {steps:.3g} time steps, "
            f"must be at most {MOST_STEPS}"
        )
    return max(round(steps), 1)


def flutter_interval(scene: Scene) -> int:
    """Number of steps between two updates of the flutter damping: those in dx/c_w, or fewer.

    There are fewer if an explicit step of dx/c_w would not be stable with the viscosity of the
    deepest layer, X rho_c c_w h (csrc/mpm/flutter.inl), which would be reduced otherwise.
    """
    density = scene.scheme.density
    if not isinstance(density, SmoothedDensity) or not density.flutter_damping:
        return 1
    stable = _core.MOST_DIFFUSED / (density.flutter_damping * _depth(scene) / scene.grid.cell)
    return max(round(min(_steps_per_crossing(scene) * min(stable, 1.0), MOST_STEPS)), 1)


def _depth(scene: Scene) -> float:
    """Extent of the material at the start along the axis nearest to gravity [m], at least a cell.

    It is that of the domain if more material enters.
    """
    down = np.array(max(scene.gravity.vectors, key=lambda vector: math.hypot(*vector)))
    axis = int(np.argmax(np.abs(down)))
    if scene.inflows or not scene.fills:
        return scene.grid.shape[axis] * scene.grid.cell
    lower, upper = np.transpose([fill.region.bounds for fill in scene.fills], (1, 0, 2))
    return max(float(upper[:, axis].max() - lower[:, axis].min()), scene.grid.cell)


def _steps_per_crossing(scene: Scene) -> float:
    """Time in which a compression wave crosses a cell, in time steps."""
    return scene.grid.cell / scene.wave_speed / step_at_rest(scene)


def _relaxation_limit(scene: Scene, eps: float) -> float:
    """Largest rate [1/s] of the relaxation of the log-density: eps g/c_w, g the largest gravity."""
    g = largest_gravity(scene)
    return eps * g / scene.wave_speed if g else UNBOUNDED


def _axes(scene: Scene) -> tuple[_core.AxisRow, ...]:
    """Row of each axis; without a sponge layer it begins at infinity."""
    grid = scene.grid
    sponges = {sponge.axis: (sponge.above, sponge.damping) for sponge in scene.sponge_layers}
    return tuple(
        (
            grid.shape[axis],
            grid.lower[axis],
            grid.periodic[axis],
            f"{name}-" in grid.open_sides,
            f"{name}+" in grid.open_sides,
            np.array(c0_lines(grid, scene.walls, axis), dtype=np.int32),
            *sponges.get(axis, (math.inf, 0.0)),
        )
        for axis, name in enumerate("xyz"[: grid.dim])
    )


def build(
    scene: Scene, mean_mass: float, isa: str = "", device: str = "", *, runs: bool = True
) -> _core.Engine:
    """Make the engine of a scene, without points; one that `runs` has the code of its laws.

    Raises
    ------
    ValueError
        If the time step exceeds its limit, the scheme cannot be built, or the device does not have
        a part of the scene.
    """
    check_time_step(scene)
    check_blades(scene)
    grid, scheme = scene.grid, scene.scheme
    codes, rows = node_codes(scene)
    return _core.Engine(
        dim=grid.dim,
        basis=CORE["basis"][scheme.basis],
        transfer=CORE["transfer"][scheme.transfer],
        density=CORE["density"][scheme.density.name],
        single=int(scheme.precision == "single"),
        axisymmetric=int(grid.axisymmetric),
        averaging_interval=averaging_interval(scene),
        flutter_interval=flutter_interval(scene),
        pressure_from_density=int(scheme.density.name != "particle"),
        materials=[_material_row(scene, material, runs) for material in scene.materials],
        isa=isa,
        device=device,
        axes=_axes(scene),
        walls=[WallRow(), *rows],
        node_codes=codes,
        cell_flags=cell_flags(scene)
        if scheme.density.name != "particle" or scheme.transfer in ("apic", "tpic")
        else None,
        gravity_times=np.array(scene.gravity.times, dtype=float),
        gravity_vectors=np.array(scene.gravity.vectors, dtype=float).reshape(-1, grid.dim),
        numbers={
            "dx": grid.cell,
            "half_extent": 0.5 / scene.sources[0].points_per_axis,
            "wave_speed": scene.wave_speed,
            "velocity_decay": velocity_decay(scene, largest_gravity(scene)),
            "mean_mass": mean_mass,
        },
        scheme_numbers=scheme.numbers() | {"dt": scheme.dt or 0.0, "mass_cutoff": _cutoff(scene)},
        density_numbers=_density_numbers(scene),
        fluidity_numbers={
            "begins_at": _local_phase(scene),
            "tolerance": scheme.fluidity.tolerance,
            "floor": scheme.fluidity.floor,
            "substeps": float(scheme.fluidity.substeps),
        },
        fluidity_method=scheme.fluidity.method,
        fluidity_stencil=scheme.fluidity.stencil,
        fluidity_faces=fluidity_faces(scene) if scene.nonlocal_material is not None else None,
        bodies=[body.row() for body in scene.bodies],
    )


SERVO_CELLS = 8.0
"""Cells that a compression wave crosses in the time of the servo of a wall, T in csrc/mpm/servo.h.

Four times the usual interval of 2 dx/c_w between two averagings, after which the force on the wall
shows the effect of the servo: an integrating servo overshoots if T is less than e times the delay.
"""

MOST_STRAIN = 0.1
"""Largest strain of the domain by a wall that keeps a pressure: there its servo stops."""


def servo_arguments(
    scene: Scene, servo: Servo
) -> tuple[int, int, int, float, float, float, float, float]:
    """Return the arguments of `_core.Engine.hold_pressure`."""
    grid, material = scene.grid, scene.material
    area = _area(scene, servo)
    side = 1 if grid.line("at", servo.axis, servo.at) else -1
    rate = material.wave_speed / (material.K * SERVO_CELLS * grid.cell)
    height, most = _volume(scene) / area, MOST_STRAIN
    return servo.wall, servo.axis, side, servo.pressure, area, height, rate, most


def _area(scene: Scene, servo: Servo) -> float:
    """Area of the side of the domain at which a wall stands [m2; in 2D m, unless of rings]."""
    across = math.prod(extent(scene, d) for d in range(scene.dim) if d != servo.axis)
    if not scene.grid.axisymmetric:
        return across
    # Of the ends of the axis the area is that of a disc or ring, of mean radius.
    radius = 0.5 * (scene.grid.lower[0] + scene.grid.upper[0]) if servo.axis else servo.at
    return 2.0 * math.pi * radius * across


def _volume(scene: Scene) -> float:
    """Volume of the domain [m3; in 2D m2, unless of rings]."""
    grid = scene.grid
    rings = math.pi * (grid.lower[0] + grid.upper[0]) if grid.axisymmetric else 1.0
    return rings * math.prod(extent(scene, axis) for axis in range(scene.dim))


def initial_points(scene: Scene) -> dict[str, NDArray]:
    """Return the fields of the points at the start, in the order of their ids; see `fields_of`."""
    parts = list(initial_parts(scene))
    fields: dict[str, NDArray] = {}
    for name in dict.fromkeys(name for part in parts for name in part):
        shape = next(part[name] for part in parts if name in part).shape[1:]
        fields[name] = np.concatenate(
            [part.get(name, np.zeros((len(part["mass"]), *shape))) for part in parts]
        )
    return fields


def initial_parts(
    scene: Scene, parts: Iterable[Points] | None = None
) -> Iterator[dict[str, NDArray]]:
    """Return the fields of the points at the start, some points at a time; see `fields_of`.

    `parts` are the `points_in_parts` of the scene if those are known.
    """
    return (fields_of(scene, points) for points in parts or scene.points_in_parts())


def mean_mass(scene: Scene, parts: Iterable[Mapping[str, NDArray]]) -> float:
    """Mean mass of the points at the start, or without any of those that enter [kg].

    Its last bit depends on how the points are divided into parts.
    """
    sums = [(float(part["mass"].sum()), len(part["mass"])) for part in parts]
    if not sums:
        return float(entering_masses(scene).mean())
    masses, counts = zip(*sums, strict=True)
    return math.fsum(masses) / sum(counts)


def fields_of(scene: Scene, points: Points) -> dict[str, NDArray]:
    """Return the fields of points of the sources of a scene that are not zero.

    Lithostatic fills are in equilibrium below a level top: the vertical stress grows with the depth
    against gravity as rho g, the horizontal one is `K0` of the fill times it, and the density
    follows from their mean by the law of the material; see `granular.mpm.lithostatic`, also for
    slopes. Below other lithostatic fills this is exact for the same K, law and K0, else to the
    order of p/K. Grains of a given density above rho_c have its pressure, and so has an elastic
    material with Hencky's law, whose pressure is that of its density always. All other points are
    stress-free; cohesive ones of a density below rho_c are separated.
    """
    number = _numbers_of_materials(scene)[points.fill]
    rho_c, K, granular = (
        np.array([getattr(material, name) for material in scene.materials])[number]
        for name in ("rho_c", "K", "granular")
    )
    hencky = np.array([material.elasticity == "hencky" for material in scene.materials])[number]
    densities = [
        rest_density(part.material or scene.material, part.packing) for part in scene.sources
    ]
    rho_rest = np.array(densities)[points.fill]
    weight = math.hypot(*scene.gravity.at(0.0)) * (rho_rest * points.depth + points.overburden)
    cohesion = np.array([getattr(m, "cohesion", 0.0) for m in scene.materials])[number]
    k, shape = stress_shape(scene, points, weight, cohesion)
    compression = rest_compression(k * weight, K, hencky)
    origin = np.array([getattr(m, "separation", 0.0) for m in scene.materials])[number]
    lithostatic = np.array([source.lithostatic for source in scene.sources])[points.fill]
    # The weight compresses from the density on at which the law begins to bear stress.
    compression = compression + np.where(lithostatic, origin, 0.0)
    log_density = np.log(points.density / rho_rest) + compression
    fields = {
        "x": points.x,
        "v": points.v,
        "log_density": log_density,
        "mass": points.density * points.volume * np.exp(compression),
    }
    if any(material.dilates for material in scene.materials):
        fields["bulking"] = rho_c / rho_rest
    if len(scene.materials) > 1:
        fields["material"] = number.astype(np.float64)
    begins = [
        np.array([*getattr(material, "history", {}).values(), *[0.0] * MOST_HISTORY])
        for material in scene.materials
    ]
    if any(getattr(material, "history", None) for material in scene.materials):
        fields["history"] = np.array([values[:MOST_HISTORY] for values in begins])[number]
    cohesive = np.array([getattr(material, "cohesion", 0.0) > 0 for material in scene.materials])
    if cohesive.any():
        fields["separated"] = (cohesive[number] & (log_density < 0)).astype(np.float64)
    pressed = np.where(granular, log_density > origin, hencky | (points.depth > 0))
    if pressed.any():
        pressure = K * (log_density - origin) * np.where(hencky, np.exp(log_density), 1.0)
        held = np.where(pressed, pressure, 0.0)[:, None]
        fields["stress"] = 0.0 - held * shape
    flows = np.array([material.has_fluidity for material in scene.materials])
    if scene.scheme.fluidity.initial is not None and flows.any():
        fields["g"] = np.where(flows[number], scene.scheme.fluidity.initial, 0.0)
    return fields


def _numbers_of_materials(scene: Scene) -> IntArray:
    """Number of the material of each source, in `scene.materials`."""
    materials = scene.materials
    return np.array([materials.index(part.material or scene.material) for part in scene.sources])


def entering_masses(scene: Scene) -> Array:
    """Masses of the points of the sites of all inflows [kg]."""
    sites = (fields_of(scene, inlet_points(scene, i)) for i in range(len(scene.inflows)))
    return np.concatenate([fields["mass"] for fields in sites])


def add_inlets(engine: _core.Engine, scene: Scene) -> list[dict[str, NDArray]]:
    """Register the inflows of a scene, and return the fields of the points of their sites."""
    inlets = []
    for i, inflow in enumerate(scene.inflows):
        points = inlet_points(scene, i)
        fields = fields_of(scene, points)
        vx, vy, vz = (*inflow.velocity, 0.0)[:3]
        spacing = scene.grid.cell / inflow.points_per_axis
        rows = rows_of(engine, fields, len(points.x))
        yields = not inflow.driven
        engine.add_inlet(rows, inflow.axis, (vx, vy, vz), spacing, *inflow.times, yields)
        inlets.append(fields)
    return inlets


def initial_buffers(
    engine: _core.Engine, parts: Sequence[Mapping[str, NDArray]]
) -> dict[str, NDArray]:
    """Make buffers with the given points at 0 to n - 1; to group them by cell takes larger ones."""
    n = sum(len(part["mass"]) for part in parts)
    buffers, first = allocate(engine, n), 0
    for part in parts:
        last = first + len(part["mass"])
        for name, values in part.items():
            buffers[name][:, first:last] = np.atleast_2d(values.T)
        first = last
    buffers["id"][:n] = np.arange(n)
    return buffers

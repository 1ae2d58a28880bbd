"""Shallow layers on a Coulomb base against depth-averaged theory: a dam break, a spreading cap.

The inclinations and frictions are from AvaFrame's analytical tests, in a layer 0.1 m thick and
a cap 2 m long. Lengths along the plane are large compared with the thickness, so that the theory
should hold.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from granular import theory
from granular.materials import DruckerPrager
from granular.model.fill import Fill
from granular.model.gravity import Gravity
from granular.model.grid import Grid
from granular.model.regions import Mask
from granular.mpm import schemes
from granular.mpm.scene import Scene
from granular.mpm.schemes import Scheme
from granular.mpm.walls import Wall
from granular.run.simulation import Simulation
from granular.shapes import Box, Polygon, Region
from granular.tools.arrays import Array
from granular.verify.external.frame import Outcome, below, case, near

if TYPE_CHECKING:
    from matplotlib.figure import Figure

G, RHO = 9.81, 1500.0

TOLERANCES = {"front": 0.05, "thickness": 0.1, "velocity": 0.1}
"""Tolerances of relative differences."""

ACROSS = TOLERANCES | {"side": 0.05}
"""Those of the cap in 3D: "side" is its half-axis across the slope."""


SOFTNESS = 1e-3
"""Weight of the layer over Young's modulus: the compression of the layer, a hundredth of the
tolerances of thickness and velocity."""


def layer(
    region: Region, *, angle_deg: float, friction: float, mu: float, cell: float,
    along: tuple[float, float], rows: int, thickness: float, across: float | None = None,
    softness: float = SOFTNESS, scheme: Scheme = schemes.default, points: int = 4,
) -> Scene:  # fmt: skip
    """Layer of a Drucker-Prager material on a plane; gravity is inclined, not the grid.

    In 3D it is the half at y > 0 of a symmetric layer, in a grid as wide as `across`.
    """
    angle = math.radians(angle_deg)
    first = math.floor(along[0] / cell)
    aside = () if across is None else (math.ceil(across / cell),)
    shape = (math.ceil(along[1] / cell) - first, *aside, rows)
    up = len(shape) - 1
    smooth = (
        Wall(axis, first * cell if axis == 0 else 0.0, kind="free_slip") for axis in range(up)
    )
    weight = RHO * G * math.cos(angle) * thickness
    down = (G * math.sin(angle), *[0.0] * len(aside), -G * math.cos(angle))
    return Scene(
        name="shallow_layer",
        grid=Grid((first * cell, *[0.0] * up), cell, shape),
        fills=(Fill(region, points, lithostatic=True),),
        material=DruckerPrager(E=weight / softness, nu=0.3, rho_c=RHO, rho_s=2450.0, mu=mu),
        scheme=scheme,
        walls=(Wall(up, 0.0, kind="coulomb", friction=friction), *smooth),
        gravity=Gravity((0.0,), (down,)),
        duration=10.0,
    )


# ---- dam break: 22 degrees, base 21 degrees ----

H0 = 0.1
DAM: dict[str, Any] = {"angle_deg": 22.0, "mu": math.tan(math.radians(21.0)), "thickness": H0}
DAM_TIMES = (12.0, 15.0)
"""In sqrt(h0/g), when the wave is 25 to 31 times as long as the layer is thick."""

UPSTREAM = 3.2
"""Length of the layer [m]: the wave from its upper end stays behind that of the dam."""

TIP = H0 / 80.0
"""Thickness of the layer at its front [m]."""


def outermost(x: Array, thickness: Array, level: float) -> float:
    """Position [m] beyond which the layer is thinner than a level."""
    last = np.nonzero(thickness > level)[0][-1]
    share = (thickness[last] - level) / (thickness[last] - thickness[last + 1])
    return float(x[last] + share * (x[1] - x[0]))


def dam(
    mu: float, K: float, cells: int, scaled_times: Sequence[float], softness: float = SOFTNESS
) -> list[dict[str, Any]]:
    """Front [m] of ours and the theory's, and errors of thickness and velocity, at given times.

    Times are in sqrt(h0/g). The front is where the layer is h0/80 thick, in the mean over 5 cm: 2
    or 3 points of cells of h0/10. The error of the thickness is the L1 norm over the wave, that of
    the velocity the mean over the part thicker than h0/10. The profile has positions and the two
    thicknesses.
    """
    region = Box((-UPSTREAM, 0.0), (0.0, H0))
    plane = {"angle_deg": DAM["angle_deg"], "friction": DAM["mu"], "mu": mu}
    along = (-UPSTREAM, 2.6)
    scene = layer(
        region, **plane, cell=H0 / cells, along=along, rows=cells + 6, thickness=H0,
        softness=softness,
    )  # fmt: skip
    sim = Simulation(scene, threads=1)
    edges = np.linspace(-1.4, 2.6, 81)
    x, frames = (edges[1:] + edges[:-1]) / 2, []
    for scaled in scaled_times:
        time = scaled * math.sqrt(H0 / G)
        state = sim.run(until=time).state
        mass = np.histogram(state.x[:, 0], edges, weights=state.mass)[0]
        momentum = np.histogram(state.x[:, 0], edges, weights=state.mass * state.v[:, 0])[0]
        width = edges[1] - edges[0]
        h = mass / (RHO * width)
        known = theory.dam_break(x, time, K=K, **DAM)
        wave = x > known.back
        thick = wave & (known.thickness > 0.1 * H0) & (mass > 0.0)
        u, speed = momentum[thick] / mass[thick], known.velocity[thick]
        frames.append({
            "front": (outermost(x, h, TIP), outermost(x, known.thickness, TIP)),
            "thickness": np.abs(h - known.thickness)[wave].sum() / known.thickness[wave].sum(),
            "velocity": np.abs(u - speed).mean() / speed.mean(),
            "profile": (x, (h, known.thickness)),
        })  # fmt: skip
    return frames


# ---- cap: 35 degrees, base 25 degrees ----

LENGTH = 1.0
CAP_TIMES = (0.700357, 1.75089, 3.50179)
"""In sqrt(L/g), of the file of Savage & Hutter's parabolic cap."""


def cap(
    aspect: float, mu: float, cells: int, scaled_times: Sequence[float]
) -> list[dict[str, Any]]:
    """Ours and the theory's front [m], thickness in the middle [m] and velocity of the centre.

    Times are in sqrt(L/g). The front is that of the parabola that has 99 % of the mass where the
    material has.
    """
    H, friction = aspect * LENGTH, math.tan(math.radians(25.0))
    s = np.linspace(-LENGTH, LENGTH, 81)
    region = Polygon(tuple((float(x), float(H * (1.0 - (x / LENGTH) ** 2))) for x in s))
    times = np.array(scaled_times) * math.sqrt(LENGTH / G)
    known = theory.spreading_cap(
        times, angle_deg=35.0, mu=friction, half_length=LENGTH, thickness=H,
        K=theory.sliding_earth_pressure(mu, friction),
    )  # fmt: skip
    along = (-1.3 * LENGTH, known.centre[-1] + known.half_length[-1] + 0.5 * LENGTH)
    scene = layer(
        region, angle_deg=35.0, friction=friction, mu=mu, cell=H / cells, along=along,
        rows=cells + 6, thickness=H,
    )  # fmt: skip
    sim = Simulation(scene, threads=1)
    roots = np.roots([-0.25, 0.0, 0.75, -0.49])  # 0.99 = 1/2 + 3/4 s - s^3/4
    share = float(roots[(roots > 0) & (roots < 1)].real[0])
    frames = []
    for i, time in enumerate(times):
        state = sim.run(until=float(time)).state
        x, mass = state.x[:, 0], state.mass
        centre = np.average(x, weights=mass)
        order = np.argsort(x)
        reached = np.searchsorted(np.cumsum(mass[order]), 0.99 * mass.sum())
        half = (x[order][reached] - centre) / share
        middle = np.abs(x - centre) < 0.1 * half
        top = H * LENGTH / known.half_length[i]
        edges = np.linspace(*along, 101)
        bins = 0.5 * (edges[1:] + edges[:-1])
        h = np.histogram(x, edges, weights=mass)[0] / (RHO * (edges[1] - edges[0]))
        parabola = top * (1.0 - ((bins - known.centre[i]) / known.half_length[i]) ** 2)
        frames.append({
            "front": (centre + half, known.centre[i] + known.half_length[i]),
            "thickness": (
                mass[middle].sum() / (RHO * 0.2 * half) / (1.0 - 0.01 / 3.0), top
            ),
            "velocity": (np.average(state.v[:, 0], weights=mass), 2.0 * known.centre[i] / time),
            "profile": (bins, (h, np.maximum(parabola, 0.0))),
        })  # fmt: skip
    return frames


# ---- cap with a circular base: 35 degrees, base 25 degrees ----


def cap_in_3d(
    aspect: float, mu: float, cells: int, scaled_times: Sequence[float],
    scheme: Scheme = schemes.default, points: int = 8,
) -> list[dict[str, Any]]:  # fmt: skip
    """Ours and the theory's fronts [m], thickness in the middle [m] and velocity of the centre.

    Times are in sqrt(L/g). The half-axes are those of the paraboloid with the second moments of the
    material; in a paraboloid the mean square distance along an axis is a sixth of its half-axis
    squared. "front" is the lower end of the axis down the slope, "side" the half-axis across.
    """
    H, friction = aspect * LENGTH, math.tan(math.radians(25.0))
    times = np.array(scaled_times) * math.sqrt(LENGTH / G)
    known = theory.spreading_ellipse(
        times, angle_deg=35.0, mu=friction, half_length=LENGTH, thickness=H,
        K=theory.sliding_earth_pressure(mu, friction),
    )  # fmt: skip
    cell = H / cells
    region = Mask.of(
        lambda x: x[:, 2] < H * (1.0 - (x[:, 0] ** 2 + x[:, 1] ** 2) / LENGTH**2),
        (-LENGTH, 0.0, 0.0), (LENGTH, LENGTH, H), cell / round(points ** (1.0 / 3.0)),
    )  # fmt: skip
    along = (-1.3 * LENGTH, known.centre[-1] + known.half_length[-1] + 0.3 * LENGTH)
    scene = layer(
        region, angle_deg=35.0, friction=friction, mu=mu, cell=cell, along=along, rows=cells + 4,
        thickness=H, across=known.half_width[-1] + 0.3 * LENGTH, scheme=scheme, points=points,
    )  # fmt: skip
    sim, frames = Simulation(scene, threads=1), []
    for i, time in enumerate(times):
        state = sim.run(until=float(time)).state
        (x, y, _), mass = state.x.T, state.mass
        centre = np.average(x, weights=mass)
        long, wide = (math.sqrt(6.0 * np.average(d**2, weights=mass)) for d in (x - centre, y))
        middle = np.hypot((x - centre) / long, y / wide) < 0.2
        area = 0.5 * math.pi * 0.04 * long * wide
        frames.append({
            "front": (centre + long, known.centre[i] + known.half_length[i]),
            "side": (wide, known.half_width[i]),
            "thickness": (mass[middle].sum() / (RHO * area) / (1.0 - 0.02), known.thickness[i]),
            "velocity": (np.average(state.v[:, 0], weights=mass), known.velocity[i]),
        })  # fmt: skip
    return frames


def errors(frames: list[dict[str, Any]]) -> Array:
    """Relative differences, shape (times, 3), in the order of `TOLERANCES`."""

    def error(entry: Any) -> float:
        return float(entry[0] / entry[1] - 1.0 if isinstance(entry, tuple) else entry)

    return np.array([[error(moment[name]) for name in TOLERANCES] for moment in frames])


def _add(
    outcome: Outcome, tag: str, unit: str, scaled: Sequence[float],
    frames: list[dict[str, Any]], gate: bool = True,
) -> None:  # fmt: skip
    """Add the rows of a run, and its surfaces if it has them."""
    curves = {}
    for time, moment in zip(scaled, frames, strict=True):
        for name, share in ACROSS.items():
            if name not in moment:
                continue
            where, entry = f"t = {time:.2g} {unit}, {tag}", moment[name]
            if isinstance(entry, tuple):
                row = near(f"{name}, {where}", float(entry[0]), float(entry[1]), share, gate)
            else:
                row = below(f"relative error of the {name}, {where}", float(entry), share, gate)
            outcome.rows.append(row)
        if "profile" in moment:
            x, (h, known) = moment["profile"]
            curves[f"t = {time:.2g} {unit}"] = [x.tolist(), h.tolist(), known.tolist()]
    if curves:
        outcome.curves[tag] = curves


def picture(outcome: Outcome) -> Figure:
    """Surfaces: the runs as points, the theory as lines."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(6.4, 2.6 * len(outcome.curves)), layout="constrained")
    panels = figure.subplots(len(outcome.curves), squeeze=False)[:, 0]
    for axes, (title, curves) in zip(panels, outcome.curves.items(), strict=True):
        for name, (x, h, known) in curves.items():
            line = axes.plot(x, known, lw=1, label=f"theory, {name}")[0]
            axes.plot(x, h, ".", ms=3, color=line.get_color())
        axes.set(title=title, xlabel="distance along the plane [m]", ylabel="thickness [m]")
        axes.plot([], [], "k.", ms=3, label="run")
        axes.legend()
    return figure


@case(picture)
def shallow(quick: bool) -> Outcome:
    """Dam break on a plane of 22 deg and a cap on one of 35 deg against depth-averaged theory."""
    outcome, mu = Outcome(), 0.6
    K = theory.sliding_earth_pressure(mu, DAM["mu"])
    resolutions = (10,) if quick else (10, 20)
    for cells in resolutions:
        with outcome.timed():
            frames = dam(mu, K, cells, DAM_TIMES)
        tag, finest = f"dam break, {cells} cells", cells == resolutions[-1]
        _add(outcome, tag, "sqrt(h0/g)", DAM_TIMES, frames, finest)
    with outcome.timed():
        frames = cap(0.05, 0.48, 10, CAP_TIMES)
    _add(outcome, "cap of aspect 0.05, 10 cells", "sqrt(L/g)", CAP_TIMES, frames)
    cells = 3 if quick else 4
    with outcome.timed():
        frames = cap_in_3d(0.1, 0.48, cells, CAP_TIMES, schemes.cell_averaged)
    tag = f"cap in 3D of aspect 0.1, {cells} cells, cell_averaged"
    _add(outcome, tag, "sqrt(L/g)", CAP_TIMES, frames)
    return outcome

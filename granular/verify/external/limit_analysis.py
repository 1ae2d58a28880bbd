"""Earth pressure on a wall and bearing capacity of a footing against limit analysis.

The same problems are posed along the grid and turned against it: gravity, bed and moving body are
turned together, so that the exact force does not change. The friction of the law is mu = sin(phi)
in coaxial plane strain. As it does not dilate, a band slides at tan(phi*) = sin(phi) only, and
limit analysis has two values, with phi (the upper one, of associated flow) and with phi* (the lower
one, Davis 1968). A bed that yields uniformly has the upper one, and so has a wedge that slides
without dilation on a plane of 45 degrees, as bands of coaxial flow are inclined: its coefficient is
tan(45 deg + phi*) = (1 + mu)/(1 - mu). On another plane it is nearer to the lower one. Where the
two differ by more than the tolerance, a wedge is compared with the band between them.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from granular.materials import DruckerPrager
from granular.model.fill import Fill
from granular.model.gravity import Gravity
from granular.model.grid import Grid
from granular.mpm.bodies import Body
from granular.mpm.motion import Motion
from granular.mpm.scene import Scene
from granular.mpm.walls import Wall
from granular.run.simulation import Simulation
from granular.shapes import Box, HalfSpace, Polygon, Region
from granular.theory import bearing_capacity, earth_pressure
from granular.tools.arrays import Array
from granular.verify.external.frame import Outcome, case, load, near

if TYPE_CHECKING:
    from matplotlib.figure import Figure

G, RHO = 9.81, 1500.0

SIZE = 0.1
"""Height of the bed next to a wall, and width of a footing [m]."""

TOLERANCE = 0.05
"""Tolerance of relative differences."""


@dataclass(frozen=True)
class Frame:
    """Coordinates along and across the surface of a bed that is turned against the grid."""

    angle_deg: float

    def turned(self, along: float, across: float) -> tuple[float, float]:
        """Vector in coordinates of the grid."""
        t = math.radians(self.angle_deg)
        c, s = math.cos(t), math.sin(t)
        return c * along - s * across, s * along + c * across

    def box(self, lower: tuple[float, float], upper: tuple[float, float]) -> Region:
        """Rectangle along the surface."""
        if not self.angle_deg:
            return Box(lower, upper)
        (a, b), (c, d) = lower, upper
        return Polygon(tuple(self.turned(*corner) for corner in ((a, b), (c, b), (c, d), (a, d))))

    def grid(self, lower: tuple[float, float], upper: tuple[float, float], cell: float) -> Grid:
        """Grid that holds a rectangle along the surface, and some cells around it if turned."""
        corners = [self.turned(*p) for p in itertools.product(*zip(lower, upper, strict=True))]
        margin = 3 if self.angle_deg else 0
        low = np.round(np.min(corners, axis=0) / cell).astype(int) - margin
        high = np.round(np.max(corners, axis=0) / cell).astype(int) + margin
        first = tuple((low * cell).tolist())
        return Grid(first, cell, tuple((high - low).tolist()))

    def plane(self, normal: tuple[float, float], at: tuple[float, float], **contact: Any) -> Body:
        """Body that fills the half of space behind a plane."""
        return Body(HalfSpace(self.turned(*normal)), self.turned(*at), **contact)

    def motion(self, along: float, across: float, ramp: float) -> Motion:
        """Motion with a constant velocity after a ramp."""
        return Motion(times=(0.0, ramp), velocity=((0.0, 0.0), self.turned(along, across)))

    def scene(self, **parts: Any) -> Scene:
        """Scene with gravity across the surface."""
        gravity = Gravity((0.0,), (self.turned(0.0, -G),))
        return Scene(name="limit_analysis", gravity=gravity, duration=60.0, **parts)


def soil(phi_deg: float, E: float, rho: float = RHO) -> DruckerPrager:
    """Material whose friction angle is phi in uniform plane strain."""
    mu = math.sin(math.radians(phi_deg))
    return DruckerPrager(E=E, nu=0.3, mu=mu, rho_c=rho, rho_s=2450.0)


SPEED = {"wall": 0.01, "self-weight": 0.001, "surcharge": 0.015}
"""Speeds of the body [m/s]. The inertia is below 0.1 % of the force; the relevant effect is the
numerical damping of short waves, a viscosity that grows with the speed of waves."""

RAMP = 0.02
"""Time in which a body takes up its speed [s]."""


def wall_scene(
    phi_deg: float, *, passive: bool, rough: bool, angle_deg: float, cells: int, E: float = 3e6,
    speed: float = SPEED["wall"],
) -> Scene:  # fmt: skip
    """Bed 0.1 m high and 0.4 m long, and a smooth wall that is pushed into it or drawn away.

    The base is smooth, so that the whole bed yields uniformly, or has the friction of the material,
    so that a wedge slides up or down. Along the grid base and far end are walls of the grid.
    """
    frame, cell, length = Frame(angle_deg), SIZE / cells, 4.0 * SIZE
    material = soil(phi_deg, E)
    friction = material.mu if rough else 0.0
    motion = frame.motion(speed if passive else -speed, 0.0, RAMP)
    bodies = [frame.plane((1.0, 0.0), (0.0, 0.0), motion=motion)]
    walls: tuple[Wall, ...] = ()
    if angle_deg:
        bodies.append(frame.plane((0.0, 1.0), (0.0, 0.0), friction=friction))
        bodies.append(frame.plane((-1.0, 0.0), (length, 0.0)))
    else:
        walls = (Wall(1, 0.0, kind="coulomb", friction=friction), Wall(0, length, kind="free_slip"))
    margin = math.ceil(0.25 * cells) * cell
    return frame.scene(
        grid=frame.grid((-margin, 0.0), (length, SIZE + 2 * margin), cell),
        fills=(Fill(frame.box((0.0, 0.0), (length, SIZE)), 4, lithostatic=True),),
        material=material, walls=walls, bodies=tuple(bodies),
    )  # fmt: skip


RATIO, DEEP = 30.0, 0.5
"""Density of the layer that is the surcharge over that of the soil, and its depth in footings."""


def footing_scene(
    phi_deg: float, *, rough: bool, surcharge: bool, angle_deg: float, cells: int,
    speed: float | None = None,
) -> Scene:  # fmt: skip
    """Half of a strip footing 0.1 m wide on a bed, at a plane of symmetry, pushed down.

    A surcharge next to it is a layer of a material that is 30 times as dense and bears hardly any
    shear (a friction coefficient of 0.01): the soil itself is light in comparison, and its bearing
    capacity is due to the surcharge.
    """
    frame, cell = Frame(angle_deg), SIZE / cells
    length, depth, top = (
        (4.0 * SIZE, 1.5 * SIZE, DEEP * SIZE) if surcharge else (2.5 * SIZE, SIZE, 0.0)
    )
    material = soil(phi_deg, 1e7, 0.1 * RHO) if surcharge else soil(phi_deg, 3e6)
    fills = [Fill(frame.box((0.0, -depth), (length, 0.0)), 4, lithostatic=True)]
    if surcharge:
        dense = RATIO * material.rho_c
        liquid = DruckerPrager(E=2e6, nu=0.3, mu=0.01, rho_c=dense, rho_s=2 * dense)
        region = frame.box((0.5 * SIZE, 0.0), (length, top))
        fills.append(Fill(region, 4, lithostatic=True, material=liquid))
    slab = Box(size=(SIZE, 1.2 * SIZE), center=(0.0, 0.6 * SIZE))
    speed = SPEED["surcharge" if surcharge else "self-weight"] if speed is None else speed
    footing = Body(
        slab, (0.0, 0.0), rotation_deg=angle_deg, friction=float(rough),
        motion=frame.motion(0.0, -speed, RAMP),
    )  # fmt: skip
    walls, held = _ground(frame, length, depth, material.mu)
    above = math.ceil((top + 0.3 * SIZE) / cell) * cell
    return frame.scene(
        grid=frame.grid((0.0, -depth), (length, above), cell),
        fills=tuple(fills), material=material, walls=walls, bodies=(footing, *held),
    )  # fmt: skip


def _ground(
    frame: Frame, length: float, depth: float, mu: float
) -> tuple[tuple[Wall, ...], tuple[Body, ...]]:
    """Smooth sides of the ground and a floor with friction: walls of the grid, or turned bodies."""
    if not frame.angle_deg:
        sides = (Wall(0, at, kind="free_slip") for at in (0.0, length))
        return (*sides, Wall(1, -depth, kind="coulomb", friction=mu)), ()
    planes = (((1.0, 0.0), (0.0, 0.0), 0.0), ((-1.0, 0.0), (length, 0.0), 0.0))
    floor = ((0.0, 1.0), (0.0, -depth), mu)
    return (), tuple(frame.plane(n, at, friction=f) for n, at, f in (*planes, floor))


@dataclass(frozen=True)
class Reaction:
    """Force on body 0 against its motion over its displacement.

    Attributes
    ----------
    displacement : ndarray
        In `SIZE`.
    force : ndarray
        Mean over the interval around it [N/m]; the part along the motion.
    points : tuple of ndarray
        Positions of the points at the end [m], and their speeds over that of the body.
    """

    displacement: Array
    force: Array
    points: tuple[Array, Array]

    def at_rest(self, begin: float) -> float:
        """Force on the undeformed bed [N/m]: the line through the values beyond `begin`, at 0."""
        later = self.displacement > begin
        return float(np.polyfit(self.displacement[later], self.force[later], 1)[1])


def reaction(scene: Scene, stops: Sequence[float]) -> Reaction:
    """Run a scene to displacements in `SIZE`; the force is a mean between two of them."""
    velocity = np.array(scene.bodies[0].motion.velocity[-1])
    speed = float(np.hypot(*velocity))
    sim = Simulation(scene, threads=1)
    times, impulses = [], []
    for stop in stops:
        sim.run(until=stop * SIZE / speed + 0.5 * RAMP)
        times.append(sim.time)
        impulses.append(sim.bodies[0].impulse @ velocity / speed)
    moved = (np.array(times) - 0.5 * RAMP) * speed / SIZE
    state = sim.state
    return Reaction(
        displacement=0.5 * (moved[1:] + moved[:-1]),
        force=np.abs(np.diff(impulses) / np.diff(times)),
        points=(state.x, np.hypot(*state.v.T) / speed),
    )


def self_weight(phi_deg: float, rough: bool) -> float:
    """N_gamma: for a smooth footing that of the theory, for a rough one from the file.

    Between the angles of the file ln(N_gamma) is linear; below the first of them, 20 deg, it has
    the slope of the first interval.
    """
    if not rough:
        return bearing_capacity(phi_deg).smooth_self_weight
    data = load("plane_strain_limit_analysis")
    phi, known = data["phi_deg"], np.log(data["Ngamma_rough"])
    k = int(np.clip(np.searchsorted(phi, phi_deg) - 1, 0, len(phi) - 2))
    slope = (known[k + 1] - known[k]) / (phi[k + 1] - phi[k])
    return math.exp(known[k] + slope * (phi_deg - phi[k]))


# ---- the case ----

ANGLES = (0.0, 17.0, 30.0)
"""Angles of the surface against the grid [deg]."""

BEGIN = tuple(0.001 * k for k in range(6))
STOPS = {
    "K_p": (*BEGIN, *(0.0025 * k for k in range(3, 9))),
    "K_a": (*BEGIN, *(0.0025 * k for k in range(3, 7))),
    "self-weight": tuple(0.001 * k for k in range(7)),
    "surcharge": tuple(0.001 * k for k in range(11)),
}
"""Displacements in `SIZE` between which forces are averaged."""

STEADY = {"K_p": 0.01, "K_a": 0.005, "self-weight": 0.0025, "surcharge": 0.005}
"""Displacements in `SIZE` beyond which the material fails. Passive pressure takes 0.01 of it from a
horizontal stress of nu/(1 - nu) of the vertical one, and half of that from an equal one."""

BASES = {"smooth": (8,), "rough": (16, 32)}
"""Bases of the bed and numbers of cells over its height, of which the last decides. A smooth base
needs fewer, and quick runs have the first."""


def limits(phi_deg: float) -> tuple[float, float]:
    """Upper and lower friction angle [deg]: phi, and phi* with tan(phi*) = sin(phi)."""
    return phi_deg, earth_pressure(math.sin(math.radians(phi_deg))).band_deg


def rankine(phi_deg: float, passive: bool) -> float:
    """Coefficient of earth pressure on a smooth wall."""
    known = earth_pressure(math.sin(math.radians(phi_deg)))
    return known.passive_coaxial if passive else known.active_coaxial


def wall_reference(phi_deg: float, passive: bool, base: str) -> float | tuple[float, float]:
    """Coefficient with the upper friction angle, or both if a wedge distinguishes them."""
    upper, lower = (rankine(value, passive) for value in limits(phi_deg))
    apart = base == "rough" and abs(upper - lower) > TOLERANCE * upper
    return (upper, lower) if apart else upper


def _wall(
    outcome: Outcome, base: str, phi: float, passive: bool, angle: float, cells: int, gate: bool
) -> None:
    """Coefficient of the earth pressure at an angle against the grid."""
    unit, kind = 0.5 * RHO * G * SIZE**2, "K_p" if passive else "K_a"
    scene = wall_scene(phi, passive=passive, rough=base == "rough", angle_deg=angle, cells=cells)
    with outcome.timed():
        result = reaction(scene, STOPS[kind])
    K = result.at_rest(STEADY[kind]) / unit
    angles = "phi = {:g}, phi* = {:.1f} deg".format(*limits(phi))
    name = f"{kind}, {angles}, {base} base, turned by {angle:g} deg, {cells} cells"
    outcome.rows.append(near(name, K, wall_reference(phi, passive, base), TOLERANCE, gate))
    if base == "rough" and gate:
        outcome.curves["walls"].append({
            "kind": kind, "phi": phi, "angle": angle,
            "known": tuple(rankine(value, passive) for value in limits(phi)),
            "curve": ((100 * result.displacement).tolist(), (result.force / unit).tolist()),
        })  # fmt: skip
        if passive:
            outcome.curves["wedge"] = map_of(result, angle)


def map_of(result: Reaction, angle: float) -> dict[str, Any]:
    """Positions and speeds of the points, for a picture."""
    x, speed = result.points
    return {"angle": angle, "x": (x / SIZE).T.tolist(), "speed": speed.tolist()}


def _footing(outcome: Outcome, surcharge: bool, rough: bool, angle: float, cells: int) -> float:
    """Run a footing at one angle and resolution; return its coefficient."""
    if surcharge:
        load = 0.1 * RHO * RATIO * G * DEEP * SIZE
        kind, unit = "surcharge", 0.5 * load * SIZE
    else:
        kind, unit = "self-weight", 0.25 * RHO * G * SIZE**2
    with outcome.timed():
        result = reaction(
            footing_scene(20.0, rough=rough, surcharge=surcharge, angle_deg=angle, cells=cells),
            STOPS[kind],
        )
    surface, known = "rough" if rough else "smooth", bearing(20.0, surcharge, rough)
    outcome.curves["footings"].append({
        "kind": kind, "rough": rough, "angle": angle, "cells": cells,
        "known": known,
        "curve": ((100 * result.displacement).tolist(), (result.force / unit).tolist()),
    })  # fmt: skip
    if surcharge and rough:
        outcome.curves["footing"] = map_of(result, angle)
    N = result.at_rest(STEADY[kind]) / unit
    name = f"{'N_q' if surcharge else 'N_gamma'}, {surface} footing, turned by {angle:g} deg"
    # N_gamma of a rough footing is recalled in the file; for a smooth one the finest cells decide
    gate = surcharge or not (rough or cells < 40)
    outcome.rows.append(near(f"{name}, {cells} cells", N, known[0], TOLERANCE, gate))
    return N


def bearing(phi: float, surcharge: bool, rough: bool) -> tuple[float, float]:
    """Coefficients of bearing capacity with the upper and the lower friction angle.

    The weight of the soil below a surcharge adds N_gamma B/2 to N_q q by superposition.
    """
    weight = [self_weight(value, rough) for value in limits(phi)]
    if not surcharge:
        return weight[0], weight[1]
    share = 0.5 / (RATIO * DEEP)
    upper, lower = (
        bearing_capacity(value).surcharge + share * w
        for value, w in zip(limits(phi), weight, strict=True)
    )
    return upper, lower


STYLES = {0.0: "-", 17.0: "--", 30.0: ":"}
"""Line styles by the angle of the surface against the grid [deg]."""


def _draw_curves(axes: Any, curves: list[dict[str, Any]], label: Callable[[dict], str]) -> None:
    """Coefficients over the displacement, each over the band between its two references."""
    colours: dict[tuple, str] = {}
    for curve in curves:
        upper, lower = curve["known"]
        first = curve["known"] not in colours
        colour = colours.setdefault(tuple(curve["known"]), f"C{len(colours)}")
        if first:
            axes.axhspan(min(upper, lower), max(upper, lower), color=colour, alpha=0.2, lw=0)
            axes.axhline(upper, color=colour, lw=0.8)
        name = label(curve) if first else None
        axes.plot(*curve["curve"], STYLES[curve["angle"]], color=colour, lw=1.2, label=name)
    for angle, style in STYLES.items():
        axes.plot([], [], style, color="k", lw=1.2, label=f"turned by {angle:g} deg")
    axes.legend(loc="upper center", bbox_to_anchor=(0.5, -0.2), ncols=2)


def _draw_map(axes: Any, data: dict[str, Any], title: str, pushed: str, ends: Array) -> None:
    """Speed of the points, and a line from one end to another along and across the surface."""
    from granular.plot.canvas import triangles

    cloud = triangles(np.transpose(data["x"]), longest=3)
    field = axes.tripcolor(cloud, data["speed"], shading="gouraud", vmin=0.0, vmax=1.5)
    axes.figure.colorbar(field, ax=axes, label=f"speed / speed of the {pushed}")
    frame = Frame(data["angle"])
    axes.plot(*np.transpose([frame.turned(*end) for end in ends]), "r-", lw=2)
    axes.set(title=title, aspect="equal", xlabel="$x$ / size", ylabel="$y$ / size")


def picture(outcome: Outcome) -> Figure:
    """Coefficients over the displacement, and the speeds of the points of two turned problems."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(7.0, 6.0), layout="constrained")
    panels = figure.subplots(2, 2)
    curves = outcome.curves
    _draw_curves(panels[0, 0], curves["walls"], lambda c: f"${c['kind']}$, {c['phi']:g} deg")
    panels[0, 0].set(
        xlabel="displacement of the wall [% of the height]", ylabel="coefficient $K$",
        title="smooth wall, rough base", yscale="log", yticks=(ticks := (0.3, 0.4, 0.5, 1, 2, 3)),
        yticklabels=[f"{tick:g}" for tick in ticks],
    )  # fmt: skip
    panels[0, 0].minorticks_off()
    _draw_curves(
        panels[0, 1], curves["footings"],
        lambda c: f"{c['kind']}, {'rough' if c['rough'] else 'smooth'}",
    )  # fmt: skip
    panels[0, 1].set(
        xlabel="settlement [% of the width]",
        ylabel="coefficient $N$",
        title="strip footing, 20 deg",
    )
    if "wedge" in curves:
        wall = np.array([[STOPS["K_p"][-1], 0.0], [STOPS["K_p"][-1], 1.0]])
        _draw_map(panels[1, 0], curves["wedge"], "passive wall", "wall", wall)
    if "footing" in curves:
        base = np.array([[0.0, -0.01], [0.5, -0.01]])
        _draw_map(panels[1, 1], curves["footing"], "footing, surcharge", "footing", base)
    return figure


@case(picture)
def limit_analysis(quick: bool) -> Outcome:
    """Earth pressure on a smooth wall and bearing capacity of a footing, at any angle."""
    outcome = Outcome(curves={"walls": [], "footings": []})
    phis, angles = ((20.0,), ANGLES[1:2]) if quick else ((20.0, 30.0), ANGLES)
    for base, every in BASES.items():
        sizes = every[:1] if quick else every
        for phi, passive, cells, angle in itertools.product(phis, (True, False), sizes, angles):
            _wall(outcome, base, phi, passive, angle, cells, cells == sizes[-1])
    if quick:
        _footing(outcome, True, True, 0.0, 10)
        return outcome
    for rough, angle in ((True, 0.0), (True, 17.0), (True, 30.0), (False, 0.0)):
        _footing(outcome, True, rough, angle, 16)
    _footing(outcome, False, True, 17.0, 20)
    for rough, cells in itertools.product((True, False), (20, 40)):
        _footing(outcome, False, rough, 0.0, cells)
    return outcome

"""Columns in 2D: contact dynamics of Lagrée et al. 2011, aluminium bars of Bui et al. 2008."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from granular import measure, scenes
from granular.materials import DruckerPrager, Material, MuI
from granular.model.gravity import Gravity
from granular.model.state import State
from granular.model.typing import AnyScene
from granular.mpm import schemes
from granular.mpm.scene import Scene
from granular.mpm.schemes import Scheme
from granular.mpm.walls import Wall
from granular.run.simulation import Simulation
from granular.tools.arrays import Array
from granular.verify.external.frame import Data, Outcome, below, case, load, near

if TYPE_CHECKING:
    from matplotlib.figure import Figure

RHO, G = 1500.0, 9.8
DISCS: dict[str, Any] = {"mu_s": 0.32, "mu_2": 0.6, "I0": 0.4}
"""Friction of the discs of contact dynamics: the numbers that their authors fit to them."""
STIFF = 1e3 * RHO * G
"""Young's modulus [Pa] of the columns of 1 m of contact dynamics."""
SCHEMES = {
    "default": schemes.default,
    "cell_averaged": schemes.cell_averaged,
    "published": schemes.dunatunga_kamrin_2015.replace(dt=None),
}


def borne(scene: AnyScene) -> Scene:
    """The scene of a column that bears its weight and is let go at once, in full gravity."""
    assert isinstance(scene, Scene)
    fills = tuple(replace(fill, lithostatic=True) for fill in scene.fills)
    down = (*[0.0] * (len(scene.grid.shape) - 1), -G)
    return replace(scene, fills=fills, gravity=Gravity((0.0,), (down,)))


def released(scene: AnyScene) -> Simulation:
    """Simulation of such a column."""
    return Simulation(borne(scene), threads=1)


def surface_of(state: State) -> tuple[Array, Array]:
    """Centres of the columns of cells [m], and the height [m] of their mass at rho_c."""
    columns = measure.surface(state)
    return np.asarray(columns.x), np.asarray(columns.height)


def height_at(state: State, x: Array) -> Array:
    """Height [m] of the mass of the columns at rho_c, between their centres; 0 beyond."""
    return np.interp(x, *surface_of(state), right=0.0)


def toe(x: Array, height: Array, level: float) -> float:
    """Position [m] at which a surface first falls to a level, between its points."""
    k = int(np.argmax(height <= level))
    return float(np.interp(level, height[[k, k - 1]], x[[k, k - 1]]))


THIN, THICK = 2.0, 8.0
"""Heights in grains between which a surface is continued to the ground: the foot of a deposit. The
last grains are left out, because their position is random and a continuum has no such grains. A
foot is decisive if a cell is at most as high as the lower of the two."""


def foot(x: Array, height: Array, grain: float) -> float:
    """Position [m] at which the line through a surface of `THICK` to `THIN` grains meets the
    ground.

    The line is that of least squares, between the positions at which the surface first falls to
    both.
    """
    places = np.linspace(toe(x, height, THICK * grain), toe(x, height, THIN * grain), 100)
    slope, at_0 = np.polyfit(places, np.interp(places, x, height), 1)
    return float(-at_0 / slope)


def _panels(outcome: Outcome, xlabel: str, ylabel: str, data: tuple[str, str]) -> Figure:
    """A panel for each entry of the curves; `data` is the name of the points, and their label."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(6.4, 2.6 * len(outcome.curves)), layout="constrained")
    panels = figure.subplots(len(outcome.curves), squeeze=False)[:, 0]
    for axes, (title, curves) in zip(panels, outcome.curves.items(), strict=True):
        for name, (x, y) in curves.items():
            ends = 1 + np.max(np.nonzero(y)[0], initial=0)  # beyond, there is no material
            style, label = ("k.", data[1]) if name == data[0] else ("-", f"run, {name}")
            axes.plot(x[: ends + 1], y[: ends + 1], style, label=label, lw=1)
        axes.set(title=title, xlabel=xlabel, ylabel=ylabel)
        axes.legend()
    return figure


def _draw_contact_dynamics(outcome: Outcome) -> Figure:
    names = "contact dynamics", "contact dynamics, Lagrée et al. 2011"
    return _panels(outcome, "distance from the middle $x / H$", "height $h / H$", names)


REACHES = np.array([0.99, 0.999])
"""Shares of the mass whose half-width is a run-out. The last thousandth of half a column is two or
three discs, and its position is only reported."""


def moments(state: State) -> tuple[float, float, Array]:
    """Mean position, potential energy per weight, half-widths of `REACHES` of the mass [m]."""
    x, y = state.x.T
    return float(x.mean()), float(y.mean()), np.quantile(x, REACHES)


CELLS = {"default": 32, "cell_averaged": 32, "published": 16}
"""Cells along the lesser of height and half-width of a column by scheme. Quick runs have 8."""

DIAMETERS = {0.5: 0.03356, 1.42: 0.01543, 6.26: 0.00746}
"""Of a grain over the height of the column, by its aspect ratio, of the headers of the files."""


@dataclass(frozen=True)
class Discs:
    """Data of a column of discs: lengths in its height H, times in sqrt(H/g).

    Attributes
    ----------
    aspect : float
        Nominal aspect ratio, which names the file.
    facts : dict of ndarray
        Area, energy, mean distance and so on, one number for each time.
    x, h : ndarray
        Deposit.
    """

    aspect: float
    facts: dict[str, Array]
    x: Array
    h: Array

    @classmethod
    def load(cls, aspect: float) -> Discs:
        """Read those of an aspect ratio."""
        shape, summary = load(f"lagree2011_cd_a{aspect:g}"), load("lagree2011_cd_summary")
        mine, last = summary["a_nominal"] == aspect, shape["t"] == shape["t"].max()
        facts = {name: column[mine] for name, column in summary.columns.items()}
        return cls(aspect, facts, shape["x_over_H"][last], shape["h_over_H"][last])

    @property
    def half_width(self) -> float:
        """Half-width of the rectangle of height H that has the area of the first shape.

        The foremost grain is 2 to 3 % farther out, as the sides are uneven.
        """
        return float(self.facts["m"][0])

    @property
    def foot(self) -> float:
        """Growth of the half-width up to the foot of the deposit."""
        return foot(self.x, self.h, DIAMETERS[self.aspect]) - self.half_width

    def runout(self, name: str = "q999") -> float:
        """Growth of the half-width of 99.9 % of the mass, or of 99 % ("q99")."""
        return float(self.facts[name][-1] - self.facts[name][0])

    def places(self) -> Array:
        """Positions at which deposits are compared."""
        return np.linspace(0.0, 2.0 * self.facts["xf"].max(), 2000)

    def deviation(self, h: Array) -> float:
        """L1 norm of the difference of a deposit at `places`, over the area."""
        target = np.interp(self.places(), self.x, self.h, right=0.0)
        return float(np.sum(np.abs(h - target)) / np.sum(target))

    def of_deposit(self, x: Array, h: Array) -> dict[str, Any]:
        """Mean distance, energy, deviation and growths of reaches and foot of a deposit.

        `x` are the middles of equal columns from the axis on.
        """
        width = float(x[1] - x[0])
        mass = np.cumsum(h) * width
        reach = np.interp(REACHES * mass[-1], mass, x + 0.5 * width)
        return {
            "mean": float(np.average(x, weights=h)),
            "energy": float(np.sum(h**2) * width / (2.0 * mass[-1])),
            "runout": reach - REACHES * self.half_width,
            "foot": foot(x, h, DIAMETERS[self.aspect]) - self.half_width,
            "L1": self.deviation(np.interp(self.places(), x, h, right=0.0)),
        }


def column_of_discs(
    data: Discs,
    cells: int,
    *,
    half_width: float | None = None,
    material: Material | None = None,
    stiffness: float = 1e3,
    **numbers: Any,
) -> Scene:
    """Column of discs, 1 m high, as if poured at rest.

    Parameters
    ----------
    data : Discs
    cells : int
        Number of cells along the lesser of height and half-width.
    half_width : float, optional
        In heights of the column; by default that of its area.
    material : Material, optional
        By default mu(I) with the numbers that fit the discs.
    stiffness : float
        E/(rho g H) of that.
    **numbers
        Arguments of `granular.scenes.column_collapse`, such as `scheme`.
    """
    width = half_width or data.half_width
    law = material or MuI(
        E=stiffness * RHO * G, **DISCS, d=DIAMETERS[data.aspect], rho_s=RHO, rho_c=RHO
    )
    column = scenes.column_collapse(
        aspect=1.0 / width, half_width=width, cell=min(width, 1.0) / cells,
        lip=2.0 * data.facts["xf"].max(), material=law, duration=20.0, **numbers,
    )  # fmt: skip
    return borne(column)


def collapse_of_discs(
    data: Discs, cells: int, scheme: Scheme, *, points: int = 16, **numbers: Any
) -> dict[str, Any]:
    """Run a column with H = 1 m; `numbers` are those of `column_of_discs`.

    Returns energy and mean distance at each time of the data, the growths of the half-widths of
    `REACHES` of the mass and of that up to the foot, and the deposit at `data.places()` with its
    deviation.
    """
    scene = column_of_discs(data, cells, scheme=scheme, points_per_cell=points, **numbers)
    sim = Simulation(scene, threads=1)
    history = [moments(sim.state)]
    for t in data.facts["t"][1:]:
        history.append(moments(sim.run(until=float(t) / math.sqrt(G)).state))
    mean, energy, reach = zip(*history, strict=True)
    h = height_at(sim.state, data.places())
    ends = foot(*surface_of(sim.state), DIAMETERS[data.aspect]) - data.half_width
    return {
        "mean": mean, "energy": energy, "runout": reach[-1] - reach[0], "foot": ends,
        "deposit": h, "L1": data.deviation(h),
    }  # fmt: skip


def contact_dynamics_rows(outcome: Outcome, aspect: float, quick: bool) -> None:
    """Add the rows and curves of one aspect ratio."""
    data = Discs.load(aspect)
    curves: dict[str, Any] = {"contact dynamics": [data.x.tolist(), data.h.tolist()]}
    for name in ("default",) if quick else SCHEMES:
        cells = 10 if quick else CELLS[name]
        tag = f"a = {aspect:g}, {name}, {cells} cells"
        with outcome.timed():
            result = collapse_of_discs(data, cells, SCHEMES[name])
        for k in (1, 2):  # while it moves; the times of the data are inferred
            for what, column, fact, share in (
                ("energy", "energy", "pe", 0.04), ("mean distance", "mean", "xm", 0.03)
            ):  # fmt: skip
                ours, theirs = result[column][k], data.facts[fact][k]
                quantity = f"{what} at t = {k}, {tag}"
                outcome.rows.append(near(quantity, ours, theirs, share, gate=False))
        cell = min(data.half_width, 1.0) / cells
        resolved = cell <= THIN * DIAMETERS[aspect]
        mean, (out_99, out_999) = data.facts["xm"][-1], map(float, result["runout"])
        outcome.rows += [
            below(f"L1 of the deposit over the area, {tag}", result["L1"], 0.06),
            near(f"mean distance of the deposit, {tag}", result["mean"][-1], mean, 0.03),
            near(f"run-out to the foot in H, {tag}", result["foot"], data.foot, 0.15, resolved),
            near(f"run-out of 99 % in H, {tag}", out_99, data.runout("q99"), 0.15),
            near(f"run-out of 99.9 % in H, {tag}", out_999, data.runout(), 0.15, gate=False),
        ]
        x, h = data.places()[::10], result["deposit"][::10]
        curves[name] = [x.tolist(), h.tolist()]
    outcome.curves[f"a = {aspect:g}"] = curves


@case(_draw_contact_dynamics)
def contact_dynamics(quick: bool) -> Outcome:
    """Columns of Lagrée, Staron & Popinet 2011 by contact dynamics: deposit, run-out, energy."""
    outcome = Outcome()
    for aspect in (1.42,) if quick else (0.5, 1.42, 6.26):
        contact_dynamics_rows(outcome, aspect, quick)
    return outcome


def _draw_bars(outcome: Outcome) -> Figure:
    names = "experiment", "experiment, Bui et al. 2008"
    return _panels(outcome, "distance from the wall [m]", "height [m]", names)


PHI = math.radians(19.8)
BAR = 1.5e-3
"""Diameter of the thicker bars [m], and height of the last point of the experiment's surface."""

MOVED = 1e-3
"""Horizontal displacement [m] beyond which a point counts as moved. The file names none; this is
that of the scripts of its authors (MaterialPointSolver.jl)."""


def _in_order(state: State) -> Array:
    """Copy of the positions [m], by the number of the point."""
    return np.array(state.x[np.argsort(state.fields["id"])])


def failure_line(start: Array, end: Array, x: Array, width: float, moved: float = MOVED) -> Array:
    """Highest point [m] that has not moved, by its initial position, within `width` of each x."""
    still = start[np.abs(end[:, 0] - start[:, 0]) <= moved]
    near_x = (still[np.abs(still[:, 0] - at) <= 0.5 * width, 1] for at in x)
    return np.array([y.max(initial=0.0) for y in near_x])


@dataclass(frozen=True)
class Heap:
    """A column of bars that has collapsed: initial positions of the points, and final state."""

    cell: float
    start: Array
    state: State

    def miss(self, surface: Data) -> float:
        """Root mean square difference of the surface [m]."""
        h = height_at(self.state, surface["x_m"])
        return float(np.sqrt(np.mean((h - surface["y_m"]) ** 2)))

    def toe(self, level: float) -> float:
        """Position [m] at which the surface first falls to a level."""
        return toe(*surface_of(self.state), level)

    def foot(self) -> float:
        """Foot [m], by the height of a bar."""
        return foot(*surface_of(self.state), BAR)

    def line(self, data: Data, moved: float = MOVED) -> tuple[Array, float]:
        """Failure line [m] and its root mean square difference from the experiment's."""
        y = failure_line(self.start, _in_order(self.state), data["x_m"], self.cell, moved)
        return y, float(np.sqrt(np.mean((y - data["y_m"]) ** 2)))


def collapse_of_bars(
    mu: float,
    cell: float,
    scheme: Scheme = schemes.default,
    *,
    E: float = 0.84e6,
    rate: bool = False,
    floor: float | None = None,
    **numbers: Any,
) -> Heap:
    """Run the column of bars with a friction of the cone `mu`.

    With `rate` this is the friction at rest, and it grows as that of the discs. `floor` is the
    friction of the floor instead of a rough one, and `numbers` are arguments of
    `granular.scenes.column_collapse`, such as `points_per_cell`.
    """
    elastic: dict[str, Any] = {"E": E, "nu": 0.3, "rho_c": 2650.0, "rho_s": 2650.0}
    material: Material = DruckerPrager(mu=mu, **elastic)
    if rate:
        at_most = mu + DISCS["mu_2"] - DISCS["mu_s"]
        material = MuI(mu_s=mu, mu_2=at_most, I0=DISCS["I0"], d=BAR, **elastic)
    scene = borne(scenes.column_collapse(
        aspect=0.5, half_width=0.2, cell=cell, lip=0.7, material=material, scheme=scheme,
        duration=1.5, **numbers,
    ))  # fmt: skip
    if floor is not None:
        below_all = Wall(1, 0.0, kind="coulomb", friction=floor)
        scene = replace(scene, walls=(below_all, *scene.walls[1:]))
    sim = Simulation(scene, threads=1)
    start = _in_order(sim.state)
    return Heap(cell, start, sim.run().state)


BARS = {
    "mu = sin phi": math.sin(PHI),
    "mu = tan phi": math.tan(PHI),
    "mu(I), mu_s = tan phi": math.tan(PHI),
}
"""Friction of the runs; that of the last one is the friction at rest."""


@case(_draw_bars)
def bars(quick: bool) -> Outcome:
    """Aluminium bars of Bui et al. 2008: surface, toe, failure line; phi by sin and by tan.

    A third run, of friction that grows with the rate as that of discs, is only reported: the source
    has no numbers for it.
    """
    surface, line, outcome = load("bui2008_surface"), load("bui2008_failure"), Outcome()
    curves: dict[str, Any] = {"experiment": [surface["x_m"].tolist(), surface["y_m"].tolist()]}
    lines: dict[str, Any] = {"experiment": [line["x_m"].tolist(), line["y_m"].tolist()]}
    places, heights = surface["x_m"], surface["y_m"]
    ends, last = foot(places, heights, BAR), float(places.max())
    three = toe(places, heights, 3.0 * BAR)
    for tag, mu in BARS.items():
        rate = tag.startswith("mu(I)")
        with outcome.timed():
            cell, points = (0.01, 16) if quick else (0.0025, 4)
            heap = collapse_of_bars(mu, cell, rate=rate, points_per_cell=points)
        far = float(np.quantile(heap.state.x[:, 0], 0.999))
        y, off = heap.line(line)
        outcome.rows += [
            below(f"rms of the surface [m], {tag}", heap.miss(surface), 3e-3, not rate),
            near(f"foot [m], {tag}", heap.foot(), ends, 0.05, cell <= THIN * BAR and not rate),
            near(f"three bars high [m], {tag}", heap.toe(3.0 * BAR), three, 0.05, False),
            near(f"one bar high [m], {tag}", heap.toe(BAR), last, 0.05, False),
            near(f"half-width of 99.9 % of the mass [m], {tag}", far, last, 0.05, False),
            below(f"rms of the failure line [m], {tag}", off, 6e-3, not rate),
        ]
        curves[tag] = [places.tolist(), height_at(heap.state, places).tolist()]
        lines[tag] = [line["x_m"].tolist(), y.tolist()]
    outcome.curves = {"final surface": curves, "failure line": lines}
    return outcome

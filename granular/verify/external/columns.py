"""Columns in 2D: contact dynamics of Lagrée et al. 2011, aluminium bars of Bui et al. 2008."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from granular import measure, scenes
from granular.gravity import Gravity
from granular.materials import DruckerPrager, Material, MuI
from granular.mpm import schemes
from granular.mpm.scene import Scene
from granular.simulation import Simulation
from granular.state import State
from granular.typing import AnyScene
from granular.verify.external.frame import Array, Outcome, below, case, load, near

if TYPE_CHECKING:
    from matplotlib.figure import Figure

RHO, G = 1500.0, 9.8
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


def height_at(state: State, x: Array) -> Array:
    """Height [m] of the mass of the columns at rho_c, between their centres; 0 beyond."""
    columns = measure.surface(state)
    return np.interp(x, columns.x, columns.height, right=0.0)


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
        axes.legend(fontsize="small")
    return figure


def _draw_contact_dynamics(outcome: Outcome) -> Figure:
    names = "contact dynamics", "contact dynamics, Lagrée et al. 2011"
    return _panels(outcome, "distance from the middle $x / H$", "height $h / H$", names)


def moments(state: State) -> tuple[float, float, float]:
    """Mean position, potential energy per weight, half-width of 99.9 % of the mass [m]."""
    x, y = state.x.T
    return float(x.mean()), float(y.mean()), float(np.quantile(x, 0.999))


def contact_dynamics_facts(aspect: float) -> dict[str, Array]:
    """Measures of the column of contact dynamics over time, as in the file of the summary."""
    summary = load("lagree2011_cd_summary")
    mine = summary["a_nominal"] == aspect
    return {name: column[mine] for name, column in summary.columns.items()}


def contact_dynamics_scene(
    aspect: float, cells: int, *, material: Material | None = None, **numbers: Any
) -> Scene:
    """Column of contact dynamics, 1 m high, as if poured at rest, with the law that fits the discs.

    Parameters
    ----------
    aspect : {0.5, 1.42, 6.26}
        Nominal aspect ratio; the half-width is the measured one.
    cells : int
        Number of cells along the lesser of height and half-width.
    material : Material, optional
        Another law.
    **numbers
        Arguments of `granular.scenes.column_collapse`, such as `scheme`.
    """
    facts = contact_dynamics_facts(aspect)
    R0, lip = float(facts["R0"][0]), 2.0 * float(facts["xf"].max())
    d = {0.5: 0.03356, 1.42: 0.01543, 6.26: 0.00746}[aspect]  # headers of the files
    law = material or MuI(E=STIFF, mu_s=0.32, mu_2=0.6, I0=0.4, d=d, rho_s=RHO, rho_c=RHO)
    column = scenes.column_collapse(
        aspect=1.0 / R0, half_width=R0, cell=min(R0, 1.0) / cells, lip=lip,
        material=law, duration=20.0, **numbers,
    )  # fmt: skip
    return borne(column)


def contact_dynamics_rows(
    outcome: Outcome, aspect: float, cells: int, names: Sequence[str]
) -> None:
    """Add the rows and curves of one aspect ratio; lengths in H = 1 m, times in sqrt(H/g)."""
    shape, facts = load(f"lagree2011_cd_a{aspect:g}"), contact_dynamics_facts(aspect)
    R0, end = float(facts["R0"][0]), shape["t"].max()
    last = shape["t"] == end
    x_cd, h_cd = shape["x_over_H"][last], shape["h_over_H"][last]
    x = np.linspace(0.0, 2.0 * facts["xf"].max(), 2000)
    target = np.interp(x, x_cd, h_cd, right=0.0)
    curves: dict[str, Any] = {"contact dynamics": [x_cd.tolist(), h_cd.tolist()]}
    for name in names:
        scene = contact_dynamics_scene(aspect, cells, scheme=SCHEMES[name])
        tag = f"a = {aspect:g}, {name}"
        with outcome.timed():
            sim = Simulation(scene, threads=1)
            for k in range(1, len(facts["t"])):
                sim.run(until=float(facts["t"][k]) / math.sqrt(G))
                xm, pe, q999 = moments(sim.state)
                if k in (1, 2):  # while it moves; the times of the data are inferred
                    row = near(f"energy at t = {k}, {tag}", pe, facts["pe"][k], 0.04, gate=False)
                    outcome.rows.append(row)
                    row = near(
                        f"mean distance at t = {k}, {tag}", xm, facts["xm"][k], 0.03, gate=False
                    )
                    outcome.rows.append(row)
        h = height_at(sim.state, x)
        L1 = float(np.sum(np.abs(h - target)) / np.sum(target))
        outcome.rows += [
            below(f"L1 of the deposit over the area, {tag}", L1, 0.06),
            near(f"mean distance of the deposit, {tag}", xm, facts["xm"][-1], 0.03),
            near(f"run-out in H, {tag}", q999 - R0, facts["q999"][-1] - R0, 0.15),
        ]
        curves[name] = [x[::10].tolist(), h[::10].tolist()]
    outcome.curves[f"a = {aspect:g}"] = curves


@case(_draw_contact_dynamics)
def contact_dynamics(quick: bool) -> Outcome:
    """Columns of Lagrée, Staron & Popinet 2011 by contact dynamics: deposit, run-out, energy."""
    outcome = Outcome()
    for aspect in (1.42,) if quick else (0.5, 1.42, 6.26):
        names = ("default",) if quick else tuple(SCHEMES)
        contact_dynamics_rows(outcome, aspect, CELLS, names)
    return outcome


def _draw_bars(outcome: Outcome) -> Figure:
    names = "experiment", "experiment, Bui et al. 2008"
    return _panels(outcome, "distance from the wall [m]", "height [m]", names)


CELLS = 8
"""Cells along the lesser of height and half-width of a column."""

PHI = math.radians(19.8)
MOVED = 1e-3
"""Displacement [m] beyond which a point counts as moved: about a bar. The file names none."""


def _in_order(state: State) -> Array:
    """Copy of the positions [m], by the number of the point."""
    return np.array(state.x[np.argsort(state.fields["id"])])


def failure_line(start: Array, end: Array, x: Array, width: float) -> Array:
    """Highest point [m] that has not moved, by its place at the start, within `width` of each x."""
    still = start[np.hypot(*(end - start).T) <= MOVED]
    near_x = (still[np.abs(still[:, 0] - at) <= 0.5 * width, 1] for at in x)
    return np.array([y.max(initial=0.0) for y in near_x])


@case(_draw_bars)
def bars(quick: bool) -> Outcome:
    """Aluminium bars of Bui et al. 2008: surface, toe, failure line; phi by sin and by tan."""
    surface, line, outcome = load("bui2008_surface"), load("bui2008_failure"), Outcome()
    cell = 0.01 if quick else 0.004
    curves: dict[str, Any] = {"experiment": [surface["x_m"].tolist(), surface["y_m"].tolist()]}
    lines: dict[str, Any] = {"experiment": [line["x_m"].tolist(), line["y_m"].tolist()]}
    for name, mu in {"sin": math.sin(PHI), "tan": math.tan(PHI)}.items():
        material = DruckerPrager(E=0.84e6, nu=0.3, mu=mu, rho_c=2650.0, rho_s=2650.0)
        scene = scenes.column_collapse(
            aspect=0.5, half_width=0.2, cell=cell, lip=0.7, material=material, duration=1.5
        )
        with outcome.timed():
            sim = released(scene)
            start = _in_order(sim.state)
            end = sim.run().state
        h = height_at(end, surface["x_m"])
        rms = float(np.sqrt(np.mean((h - surface["y_m"]) ** 2)))
        toe = float(np.quantile(end.x[:, 0], 0.999))
        connected = 0.2 * (1.0 + measure.runout(end).contiguous)
        y = failure_line(start, _in_order(end), line["x_m"], cell)
        off = float(np.sqrt(np.mean((y - line["y_m"]) ** 2)))
        tag = f"mu = {name} phi"
        outcome.rows += [
            below(f"rms of the surface [m], {tag}", rms, 3e-3),
            near(f"toe [m], {tag}", toe, float(surface["x_m"].max()), 0.05),
            near(
                f"toe by connected columns [m], {tag}", connected, surface["x_m"].max(), 0.05, False
            ),
            below(f"rms of the failure line [m], {tag}", off, 6e-3),
        ]
        curves[tag] = [surface["x_m"].tolist(), h.tolist()]
        lines[tag] = [line["x_m"].tolist(), y.tolist()]
    outcome.curves = {"final surface": curves, "failure line": lines}
    return outcome

"""Figures 4 to 10 of Dunatunga & Kamrin, Modelling silo clogging: silos of the nonlocal law."""

from __future__ import annotations

import argparse
import json
from collections.abc import Iterable

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import LogNorm
from shared import RESULTS

import granular as gr
from figures.common import frames, options, save
from granular import plot
from granular.measure import GridField
from granular.measure.silo_clogging.velocity_slices import HEIGHTS
from granular.scenes.silo import linear_flip

SCHEMES = {
    "linear": linear_flip,
    "splines": gr.Scheme(basis="quadratic", transfer="tpic", density=gr.ParticleDensity(), dt=1e-4),
}
DIAGRAM = RESULTS / "clogging.json"
"""Table made by benchmarks/figures/clogging.py."""
W = 0.14
"""Opening of the scene [m]."""
FRAME = 1 / 240
"""Time between two frames of the paper [s]."""
SPEEDS = np.arange(0.05, 0.351, 0.05)

FORMATION = (0, 12, 24, 36, 60, 350)
STEADY = range(120, 181, 2)
LATE = range(350, 361)
FLUIDITY = range(280, 301)
CENTRED = (349, 350, 351)
SAME_MASS = {0.1: 70, 1.0: 86}
"""Frames of figure 6, by A."""

COLORS = ("#c2377e", "#2a8a4a", "#2d5d8f")
"""Pink, green and blue, as in the paper."""


class Silos:
    """Runs of half silos, and the frames of them that figures need."""

    def __init__(self, chosen: argparse.Namespace) -> None:
        self.chosen = chosen
        # --quick: cells of twice the size, and frames of the first sixth of the time
        self.frame = FRAME / 6 if chosen.quick else FRAME
        self.size = {"width": 0.56, "height": 0.56} if chosen.quick else {}

    def run(
        self, A: float, ratio: float, wanted: Iterable[int], *, refined: bool = False
    ) -> dict[int, gr.State]:
        """States by the number of their frame."""
        cell = 0.035 if self.chosen.quick else 0.0175
        scheme = self.chosen.scheme
        scene = gr.scenes.clogging_silo(
            opening_over_d=ratio,
            A=A,
            cell=cell / 2 if refined else cell,
            scheme=scheme.replace(dt=2.5e-5) if refined else scheme,
            material=self.chosen.material,
            **self.size,
        )
        numbers = set(wanted)
        seen = frames(
            scene,
            (max(numbers) + 0.01) * self.frame,
            self.frame,
            lambda state: state if round(state.time / self.frame) in numbers else None,
            self.chosen,
            name=f"A = {A:g}, W/d = {ratio:g}{', refined' * refined}",
        )
        return {round(s.time / self.frame): s for s in seen if s is not None}


def some(by_frame: dict[int, gr.State], wanted: Iterable[int]) -> list[gr.State]:
    return [by_frame[i] for i in wanted]


# ---- parts of pictures ----


def image_of(ax: Axes, field: GridField, **style) -> object:
    """Draw a field of half a silo with its mirror image; empty cells are white."""
    cell = field.axes[1][1] - field.axes[1][0]
    x = np.concatenate([-field.axes[0][::-1], field.axes[0]])
    value = np.concatenate([field.value[::-1], field.value])
    up = field.axes[1] + cell > 0
    image = ax.pcolormesh(x, field.axes[1][up], value[:, up].T, shading="nearest", **style)
    dress(ax)
    return image


def dress(ax: Axes) -> None:
    ax.set(aspect="equal", xlabel="x [m]", ylabel="y [m]", ylim=(-0.05, 0.62))
    for side in (-1, 1):
        ax.plot((side * W / 2, side * 0.2975), (0, 0), color="black", linewidth=2.5)


def points(ax: Axes, state: gr.State, value: np.ndarray, *, size: float, **style) -> object:
    """Draw the points of half a silo and their mirror images."""
    x = np.concatenate([-state.x[:, 0], state.x[:, 0]])
    y = np.concatenate([state.x[:, 1]] * 2)
    image = ax.scatter(x, y, c=np.concatenate([value] * 2), s=size, linewidths=0, **style)
    dress(ax)
    return image


def speed(state: gr.State) -> np.ndarray:
    return np.linalg.norm(state.v, axis=1)


def pressure(states: list[gr.State]) -> GridField:
    return gr.measure.frame_average(states, "pressure", weight="volume")


# ---- figures ----


def figure_4a(chosen: argparse.Namespace) -> None:
    table = json.loads(DIAGRAM.read_text())
    fig = plot.Picture(figsize=(7.0, 3.2), layout="compressed")
    for ax, scheme in zip(fig.subplots(1, 2), SCHEMES, strict=True):
        rows = [row for row in table["diagram"] if row["scheme"] == scheme]
        A, ratio = np.array([row["case"] for row in rows]).T
        verdicts = [row["verdict"] for row in rows]
        lines = gr.measure.silo_clogging.flow_threshold(A, ratio, verdicts)
        plot.silo_clogging.phase_diagram(A, ratio, verdicts, threshold=lines, ax=ax)
        ax.set_title(scheme)
    save(fig, chosen, "ngf_figure_4a")


def figure_4b(jammed: dict[int, gr.State], chosen: argparse.Namespace) -> None:
    fig = plot.Picture(figsize=(7.0, 4.9), layout="compressed")
    for ax, state in zip(fig.subplots(2, 3).flat, some(jammed, FORMATION), strict=True):
        image = points(ax, state, speed(state), size=5, vmin=0, vmax=0.5)
        ax.set(title=f"t = {state.time:.3f} s", xlim=(-0.2, 0.2), ylim=(-0.04, 0.24))
    fig.colorbar(image, ax=fig.axes, label="speed [m/s]")
    save(fig, chosen, "ngf_figure_4b")


def figure_5(silos: dict[float, dict[int, gr.State]], chosen: argparse.Namespace) -> None:
    fig = plot.Picture(figsize=(7.0, 5.3), layout="compressed")
    axes = fig.subplot_mosaic([list("abc"), list("ddd")], height_ratios=(3, 2))
    line = axes["d"]
    fields = {ratio: pressure(some(by_frame, LATE)) for ratio, by_frame in silos.items()}
    top = max(np.nanmax(field.value) for field in fields.values())
    for name, color, (ratio, field) in zip("abc", COLORS, fields.items(), strict=True):
        image = image_of(axes[name], field, vmin=0, vmax=top)
        axes[name].set_title(f"W/d = {ratio:g}")
        centre = gr.measure.centre_line_pressure(some(silos[ratio], LATE))
        line.plot(centre.y, centre.value, "o-", color=color, label=f"W/d = {ratio:g}")
    fig.colorbar(image, ax=[axes[n] for n in "abc"], label="pressure [Pa]")
    line.set(xlabel="y [m], on the centre line", ylabel="pressure [Pa]")
    line.legend()
    save(fig, chosen, "ngf_figure_5")


def figure_6(silos: dict[float, dict[int, gr.State]], chosen: argparse.Namespace) -> None:
    fig = plot.Picture(figsize=(7.0, 6.6), layout="compressed")
    above, below = fig.subplots(2, 2, height_ratios=(3, 2))
    for ax, curve, (A, frame) in zip(above, below, SAME_MASS.items(), strict=True):
        state = silos[A][frame]
        image = points(ax, state, speed(state), size=4, vmin=0, vmax=0.5)
        for contour in gr.measure.speed_contours(state, SPEEDS):
            for x, y in (line.T for line in contour.lines):
                ax.plot(x, y, color="black", linewidth=0.7)
                ax.plot(-x, y, color="black", linewidth=0.7)
        ax.set_title(f"A = {A:g}, t = {state.time:.3f} s")
        slices(curve, gr.measure.silo_clogging.velocity_slices(state), "o-")
        for height, color in zip(HEIGHTS, COLORS, strict=True):
            ax.axhline(height * W, color=color, linewidth=1)
    fig.colorbar(image, ax=list(above), label="speed [m/s]")
    low = min(ax.get_ylim()[0] for ax in below)
    for ax in below:
        ax.set_ylim(low, 0.01)
    save(fig, chosen, "ngf_figure_6")


def slices(ax: Axes, sections: gr.measure.silo_clogging.VelocitySlices, marker: str) -> None:
    for row, height, color in zip(sections.velocity, HEIGHTS, COLORS, strict=True):
        x, v = (np.concatenate([s * a[:0:-1], a]) for s, a in ((-1, sections.x), (1, row)))
        ax.plot(x, v, marker, color=color, markersize=3, linewidth=1, label=f"y = {height:g} W")
    ax.set(xlabel="x [m]", ylabel="vertical velocity [m/s]")
    ax.legend()


def figure_7(steady: list[gr.State], chosen: argparse.Namespace) -> None:
    fig = plot.Picture(figsize=(6.5, 4.6), layout="compressed")
    ax = fig.add_subplot()
    sections = gr.measure.silo_clogging.velocity_slices(steady)
    fit = gr.measure.silo_clogging.gaussian_fit(sections)
    slices(ax, sections, "o")
    x = np.linspace(-sections.x.max(), sections.x.max(), 201)
    for y, C, offset, color in zip(
        sections.heights, fit.amplitude, fit.offset, COLORS, strict=True
    ):
        ax.plot(x, C * np.exp(-(x**2) / (4 * fit.B * y)) + offset, color=color)
    ax.set_title(f"A = 0.5, W/d = 5: B = {fit.B_over_d:.2f} d (paper 0.6 d)")
    save(fig, chosen, "ngf_figure_7")


def figure_8(silos: dict[float, list[gr.State]], chosen: argparse.Namespace) -> None:
    """Draw means over dense points; cells without any are white here, and 0 in the paper."""
    fig = plot.Picture(figsize=(7.0, 3.0), layout="compressed")
    for ax, (A, states) in zip(fig.subplots(1, 3), silos.items(), strict=True):
        field = gr.measure.frame_average(states, "g", points="dense")
        image = image_of(ax, field, norm=LogNorm(0.01, 100), cmap="inferno")
        ax.set_title(f"A = {A:g}")
    fig.colorbar(image, ax=fig.axes, label="fluidity [1/s]")
    save(fig, chosen, "ngf_figure_8")


def figures_9_10(
    silos: dict[str, dict[float, dict[int, gr.State]]], chosen: argparse.Namespace
) -> None:
    drawn = {
        name: plot.Picture(figsize=(7.0, 7.0), layout="compressed")
        for name in ("ngf_figure_9", "ngf_figure_10")
    }
    grids = {name: fig.subplots(2, 2) for name, fig in drawn.items()}
    for row, (cells, by_frame) in enumerate(silos.items()):
        for column, (ratio, frame) in enumerate(((1, 350), (5, 105))):
            state = by_frame[ratio][frame]
            ax, size = grids["ngf_figure_9"][row, column], (4, 1)[row]
            v = points(ax, state, speed(state), size=size, vmin=0, vmax=0.5)
            ax.set_title(f"{cells}, W/d = {ratio}, t = {state.time:.3f} s")
            ax = grids["ngf_figure_10"][row, column]
            p = image_of(ax, pressure(some(by_frame[ratio], CENTRED)), vmin=0, vmax=9000)
            ax.set_title(f"{cells}, W/d = {ratio}")
    drawn["ngf_figure_9"].colorbar(v, ax=drawn["ngf_figure_9"].axes, label="speed [m/s]")
    drawn["ngf_figure_10"].colorbar(p, ax=drawn["ngf_figure_10"].axes, label="pressure [Pa]")
    for name, fig in drawn.items():
        save(fig, chosen, name)


def main(argv: list[str] | None = None) -> None:
    grains = gr.materials.silo_grains
    chosen = options(
        __doc__, argv, E=grains.E, schemes=SCHEMES, grains=grains, without=("tolerance",)
    )
    silos = Silos(chosen)
    jammed = silos.run(1.0, 1, {*FORMATION, *LATE, *CENTRED})
    near = silos.run(1.0, 2, LATE)
    flowing = silos.run(1.0, 5, {SAME_MASS[1.0], 105, *FLUIDITY, *LATE, *CENTRED})
    local = silos.run(0.1, 5, {SAME_MASS[0.1], *FLUIDITY})
    middle = silos.run(0.5, 5, {*STEADY, *FLUIDITY})
    figure_4b(jammed, chosen)
    figure_5({1: jammed, 2: near, 5: flowing}, chosen)
    figure_6({0.1: local, 1.0: flowing}, chosen)
    figure_7(some(middle, STEADY), chosen)
    amplitudes = {0.1: local, 0.5: middle, 1.0: flowing}
    figure_8({A: some(by_frame, FLUIDITY) for A, by_frame in amplitudes.items()}, chosen)
    fine = {
        1: silos.run(1.0, 1, CENTRED, refined=True),
        5: silos.run(1.0, 5, (105, *CENTRED), refined=True),
    }
    figures_9_10({"coarse": {1: jammed, 5: flowing}, "refined": fine}, chosen)
    figure_4a(chosen)

"""Figure 2 of the nonlocal law: flow and rest of layers on a rough incline."""

import math
import time

import numpy as np
from matplotlib.axes import Axes
from shared import RESULTS, write

import granular as gr
from figures.common import RUN, options, save, tell
from granular import plot, theory
from granular.plot import Picture
from granular.verify.chute import AT_REST, PROFILES, column, kinetic_energy, velocity

GRAINS = gr.scenes.chute_ngf().material
GLASS = {"A": 0.48, "d": 0.005, "mu_s": 0.3819}
"""Beads of figure 2(d), without their mu_2."""
CELL = 0.001
ANGLES = (22.0, 24.0, 26.0, 28.0, 30.0, 32.0, 34.0)
CELLS_HIGH = (2, 3, 4, 5, 6, 7, 8, 10, 12, 14)
"""Heights of figure 2(b), in cells of 1 mm."""
MARGIN = 0.02
"""Relative distance from H_stop within which a verdict is not judged."""
OUT = RESULTS / "ngf_figure_2.json"


def energy_at_end(record: gr.Trajectory) -> float:
    """Kinetic energy per mass of the last frame [J/kg]."""
    return kinetic_energy(record[-1])


def diagram(quick: bool) -> list[dict]:
    """Rows of figure 2(b): angle and height of a layer, its final energy and the verdict."""
    angles, heights = (ANGLES[1::4], CELLS_HIGH[2::5]) if quick else (ANGLES, CELLS_HIGH)
    cases = {
        (angle, n): gr.scenes.chute_ngf(
            angle_deg=angle, height=n * CELL, duration=1.0 if quick else 5.0
        )
        for angle in angles
        for n in heights
    }
    measured = gr.sweep(cases, measure=energy_at_end, every=1.0, workers=2, strict=True)
    rows = []
    for (angle, n), energy in zip(cases, measured, strict=True):
        m = GRAINS
        stop = float(theory.stopping_height(angle, m.A, m.d, m.mu_s, m.mu_2))
        row = {"angle_deg": angle, "height": n * CELL, "over_stopping": n * CELL / stop}
        row |= {"energy": energy, "verdict": "flowing" if energy > AT_REST else "static"}
        rows.append(row)
    return rows


def wrong(rows: list[dict]) -> list[dict]:
    """Rows that are further than `MARGIN` from the line, on its wrong side by the theory."""
    return [
        row
        for row in rows
        if abs(row["over_stopping"] - 1) > MARGIN
        and (row["verdict"] == "flowing") != (row["over_stopping"] > 1)
    ]


def draw_diagram(ax: Axes, rows: list[dict]) -> None:
    """Figure 2(b): verdicts over angle and height, and eq. 3.1."""

    def stopping(angle: np.ndarray) -> np.ndarray:
        m = GRAINS
        return theory.stopping_height(angle, m.A, m.d, m.mu_s, m.mu_2) / m.d

    plot.silo_clogging.phase_diagram(
        [row["angle_deg"] for row in rows],
        [row["height"] / GRAINS.d for row in rows],
        [row["verdict"] for row in rows],
        labels=("angle [deg]", "H/d"),
        boundary=stopping,
        ax=ax,
    )
    ax.legend(loc="upper center", bbox_to_anchor=(0.5, -0.13), ncols=3, frameon=False)
    ax.set_title("(b) flowing and static")


def draw_profiles(ax: Axes, heights: dict[float, float]) -> None:
    """Figure 2(c): profiles at 27 deg, with the theoretical solutions and both limits."""
    stop = float(theory.stopping_height(27.0, GRAINS.A, GRAINS.d, GRAINS.mu_s, GRAINS.mu_2))
    for k, (height, until) in enumerate(heights.items()):
        simulation = column(height=height)
        tell(simulation.run(until=until))
        y, v = velocity(simulation.state)
        flow = theory.chute_profile(27.0, height, GRAINS)
        every = max(1, (y.size - 1) // 20)
        color = f"C{k}"
        ax.plot(v[::every] / v[-1], y[::every] / height, "o", markersize=3.5, color=color)
        label = f"$H/H_{{stop}}$ = {height / stop:.3g}"
        ax.plot(flow.v / flow.v[-1], flow.y / height, color=color, linewidth=1, label=label)
    y = np.linspace(0, 1, 200)
    ax.plot(theory.stopping_shape(y, 1.0), y, "k--", linewidth=1.2, label="$H \\to H_{stop}$")
    ax.plot(theory.bagnold_shape(y, 1.0), y, "k:", linewidth=1.5, label="Bagnold")
    ax.set(xlabel="$v/v(H)$", ylabel="$y/H$", xlim=(0, 1.02), ylim=(0, 1.02), title="(c) profiles")
    ax.legend(frameon=False)


def draw_glass(ax: Axes) -> None:
    """Figure 2(d): H_stop of glass beads, with and without a limit of friction."""
    angle = np.linspace(21.5, 34, 400)
    for mu_2, style in ((0.6435, "C0-"), (math.inf, "C3:")):
        height = theory.stopping_height(angle, mu_2=mu_2, **GLASS) / GLASS["d"]
        name = "\\infty" if math.isinf(mu_2) else f"{mu_2}"
        ax.plot(angle, height, style, label=f"$\\mu_2 = {name}$")
    ax.set(xlabel="angle [deg]", ylabel="$H_{stop}/d$", ylim=(0, 12), title="(d) glass beads")
    ax.legend(frameon=False)


def main(argv: list[str] | None = None) -> None:
    chosen = options(__doc__, argv, E=GRAINS.E, quick_E=GRAINS.E, without=RUN)
    if chosen.E != GRAINS.E:
        raise ValueError(f"E = {chosen.E} must be {GRAINS.E}: the scene has it so")
    begin = time.perf_counter()
    rows = diagram(chosen.quick)
    seconds = time.perf_counter() - begin
    missed = wrong(rows)
    print(f"{len(rows)} layers in {seconds:.0f} s, {len(missed)} on the wrong side", *missed)
    if not chosen.quick:
        write(OUT, {"seconds": round(seconds), "rows": rows})
    picture = Picture(figsize=(7.0, 2.6), layout="tight")
    below, middle, right = picture.subplots(1, 3)
    draw_diagram(below, rows)
    few = dict(list(PROFILES.items())[:2])
    draw_profiles(middle, few if chosen.quick else PROFILES)
    draw_glass(right)
    save(picture, chosen, "ngf_figure_2")

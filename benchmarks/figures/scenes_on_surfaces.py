"""Landslide, obstacle, penetration and conveyor: a state of each, numbers against a reference.

The whole takes a minute or two; --quick, with cells of twice the size, some seconds.
"""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
from matplotlib.axes import Axes

import granular as gr
from figures.common import draw_pages, tell
from granular import plot, theory

ANGLE = math.radians(35.0)
RHO, G = 1500.0, 9.81


def course(scene: gr.Scene, windows: int, body: int = 0) -> tuple[list, np.ndarray, np.ndarray]:
    """States at the ends of equal parts of a run, their times, and mean forces on a body."""
    sim = gr.Simulation(scene)
    states, impulses = [sim.state], [sim.bodies[body].impulse]
    for until in np.linspace(0.0, scene.duration, windows + 1)[1:]:
        sim.run(until=until)
        states.append(sim.state)
        impulses.append(sim.bodies[body].impulse)
    tell(sim)
    times = np.array([state.time for state in states])
    return states, times, np.diff(impulses, axis=0) / np.diff(times)[:, None]


def draw(
    ax: Axes,
    state: gr.State,
    color: str,
    limits: tuple[float, float],
    extent: tuple[tuple[float, float], tuple[float, float]],
) -> None:
    """Draw a state with its time to hundredths."""
    title = f"t = {state.time:.2f} s"
    plot.frame(state, color, ax=ax, limits=limits, extent=extent, title=title)


def axes_of(count: int, height: float) -> tuple[plot.Picture, list]:
    """Picture with some panels below one another."""
    picture = plot.Picture(figsize=(7.0, height), layout="constrained")
    return picture, list(np.atleast_1d(picture.subplots(count, 1)))


def landslide(cell: float) -> plot.Picture:
    """States on the way, and front, centre and rear compared with a cap and a block."""
    scene = gr.scenes.landslide(cell=cell)
    states, times, _ = course(scene, 40)
    slide = gr.measure.slide_history(states)
    picture, axes = axes_of(4, 9.0)
    for ax, k in zip(axes[:3], (6, 14, 40), strict=True):
        draw(ax, states[k], "speed", (0.0, 2.5), ((-1.0, 1.5), (-0.05, 0.75)))
    ax, start = axes[3], slide.centre[0, 0]
    for line, text in (
        (slide.front, "front"),
        (slide.centre[:, 0], "centre"),
        (slide.rear, "rear"),
    ):
        ax.plot(times, line, label=f"{text} (99 % of the mass)" if text == "front" else text)
    on = times[times < 0.42]
    low, high = (
        theory.spreading_cap(
            on,
            angle_deg=35.0,
            mu=0.3,
            half_length=0.2 / math.cos(ANGLE),
            thickness=0.08 * math.cos(ANGLE),
            K=K,
        )
        for K in (theory.sliding_earth_pressure(scene.material.mu_2, 0.3), 1.0)
    )
    ends = [
        slide.front[0] + (c.centre + 0.883 * (c.half_length - c.half_length[0])) * math.cos(ANGLE)
        for c in (low, high)
    ]
    ax.fill_between(on, *ends, color="0.8", label="cap, active to hydrostatic")
    ax.plot(on, start + low.centre * math.cos(ANGLE), "k--", label="block")
    stops = theory.block_runout(angle_deg=35.0, bend=0.3, mu=0.3, distance=-start)
    ax.axhline(stops, color="black", lw=0.6, label="where a block stops")
    ax.set(ylim=(-1.1, 2.6), xlabel="time [s]", ylabel="x [m]")
    ax.legend(loc="upper left", ncols=2)
    error = 100 * (slide.centre[-1, 0] / stops - 1)
    print(
        f"landslide {cell}: stops at {slide.centre[-1, 0]:.4f}, block {stops:.4f} ({error:.2f} %)"
    )
    print(f"  energy line {slide.energy_line:.4f}")
    return picture


def obstacle(cell: float) -> plot.Picture:
    """A layer stopped by a wall, and one that meets it fast."""
    states, times, force = course(gr.scenes.obstacle(cell=cell, tall=0.3), 40)
    jet = {"angle_deg": 0.0, "gap": 0.02, "length": 1.0, "friction": 0.0, "speed": 4.0}
    fast = gr.scenes.obstacle(
        cell=cell, gravity=0.5, tall=0.6, headroom=0.4, behind=0.2, duration=0.2, **jet
    )
    _, hit, impact = course(fast, 20)
    picture, axes = axes_of(4, 9.0)
    for ax, k in zip(axes[:2], (12, 40), strict=True):
        draw(ax, states[k], "speed", (0.0, 1.5), ((-0.6, 0.7), (-0.03, 0.4)))
    last = gr.measure.deposit(states[-1])
    depth = last.thickness[(last.axes[0] > 0.3) & (last.axes[0] < 0.4)].mean()
    weight = 0.5 * RHO * G * math.cos(math.radians(30.0)) * depth**2
    bounds = theory.earth_pressure(0.3819)
    axes[2].plot(0.5 * (times[1:] + times[:-1]), force[:, 0], label="force on the wall")
    for K, text in ((bounds.active_coaxial, "active"), (1.0, "hydrostatic")):
        axes[2].axhline(K * weight, color="black", lw=0.6)
        axes[2].text(0.02, K * weight, text, va="bottom")
    axes[3].plot(0.5 * (hit[1:] + hit[:-1]), impact[:, 0], label="4 m/s, smooth level bed")
    axes[3].axhline(RHO * 0.1 * 16.0, color="black", lw=0.6, label=r"$\rho\, h\, v^2$")
    for ax in axes[2:]:
        ax.set(xlabel="time [s]", ylabel="force [N/m]")
        ax.legend()
    mean = impact[5:, 0].mean() / (RHO * 0.1 * 16.0)
    print(f"obstacle {cell}: at rest {force[-1, 0] / weight:.3f} of rho g h^2/2, flux {mean:.3f}")
    return picture


def penetration(cell: float) -> plot.Picture:
    """The force on a disc and on a wedge over their depth, with two sizes of cells."""
    picture, axes = axes_of(3, 8.0)
    wedge = {"kind": "cone", "cone_deg": 120.0, "diameter": 0.6, "width": 1.2, "soil": 0.4}
    cases = (
        ({"width": 0.64}, axes[1], 1, "disc"),
        (wedge | {"duration": 0.8}, axes[2], 2, "wedge"),
    )
    for given, ax, power, text in cases:
        for size in (2 * cell, cell):
            scene = gr.scenes.penetration(cell=size, **given)
            states, times, force = course(scene, 20)
            z = 0.1 * np.where(times < 0.1, 5.0 * times**2, times - 0.05)
            z = 0.5 * (z[1:] + z[:-1])
            of = RHO * G * (0.08 * z if power == 1 else z**2)
            ax.plot(1e3 * z[2:], force[2:, 1] / of[2:], label=f"{text}, cells of {1e3 * size:g} mm")
            deep = z > 0.05
            mean, spread = (force[:, 1] / of)[deep].mean(), np.ptp((force[:, 1] / of)[deep])
            print(f"penetration {text} {size}: {mean:.3f}, range {spread:.3f}")
        if power == 1:
            draw(axes[0], states[-1], "speed", (0.0, 0.1), ((0.0, 0.64), (-0.2, 0.05)))
    axes[1].set(xlabel="depth z [mm]", ylabel=r"$F/(\rho g z D)$", ylim=(0, 12))
    axes[2].set(xlabel="depth z [mm]", ylabel=r"$F/(\rho g z^2)$", ylim=(0, 50))
    for ax in axes[1:]:
        ax.legend()
    return picture


def conveyor(cell: float) -> plot.Picture:
    """The bin and the belt, and what passes a line on the belt."""
    scene = gr.scenes.conveyor(cell=cell)
    states, times, _ = course(scene, 40)
    line = 0.4
    held = np.array([state.mass[state.x[:, 0] < line].sum() for state in states])
    picture, axes = axes_of(3, 7.0)
    for ax, k in zip(axes[:2], (20, 40), strict=True):
        draw(ax, states[k], "v_x", (0.0, 0.6), ((-0.4, 0.8), (-0.03, 0.33)))
    ax = axes[2]
    ax.plot(0.5 * (times[1:] + times[:-1]), -np.diff(held) / np.diff(times), label="x = 0.4 m")
    ax.axhline(RHO * 0.1 * 0.5, color="black", lw=0.6, label=r"$\rho\, v$ times the opening")
    ax.set(xlabel="time [s]", ylabel="mass flow [kg/(s m)]")
    ax.legend()
    last = states[-1]
    rides = (last.x[:, 0] > line) & (last.x[:, 0] < line + 0.2)
    speed = np.average(last.v[rides, 0], weights=last.mass[rides])
    thickness = last.mass[rides].sum() / (RHO * 0.2)
    late = times >= 1.6
    rate = (held[late][0] - held[late][-1]) / (times[late][-1] - times[late][0])
    print(f"conveyor {cell}: v {speed:.4f}, h {thickness:.4f}, rate {rate:.2f} of")
    print(f"  rho h v = {RHO * thickness * speed:.2f}")
    return picture


PAGES: dict[str, Callable[[bool], plot.Picture]] = {
    f.__name__: lambda quick, f=f: f(0.02 if quick else 0.005)
    for f in (landslide, obstacle, penetration, conveyor)
}


def main(argv: list[str] | None = None) -> None:
    draw_pages(__doc__, argv, PAGES, "scene_")

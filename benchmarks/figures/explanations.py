"""Figures of the pages of docs/explanation/, by their names: explain_*.png of docs/pictures/.

`python explanations.py laws bodies` makes only these.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.patches import Rectangle
from stability.arrangements import linear, spline

import granular as gr
from figures.common import draw_pages, tell
from granular.plot import Picture

BLUE, ORANGE, GREEN, RED, GREY = "#0072b2", "#e69f00", "#009e73", "#d55e00", "#8a8f98"
STILL = gr.Gravity((0.0,), ((0.0, 0.0),))


def picture(*widths: float, height: float = 3.4) -> tuple[Picture, list[Axes]]:
    """Empty picture with panels of these relative widths."""
    made = Picture(figsize=(7.0, height), layout="constrained")
    axes = np.atleast_1d(made.subplots(1, len(widths), width_ratios=widths))
    return made, list(axes)


# ---- the laws ----


def laws(quick: bool) -> Picture:
    """Friction against the inertial number, and the two cases of a step of the stress."""
    made, (curve, plane) = picture(1.0, 1.0)
    grains = gr.materials.glass_beads_5mm
    mu_s, mu_2 = grains.mu_s, grains.mu_2
    rate = np.geomspace(1e-4, 1e2, 200)
    curve.semilogx(rate, mu_s + (mu_2 - mu_s) / (grains.I0 / rate + 1), color=BLUE, lw=2)
    for mu, text, side in ((mu_s, r"$\mu_s$", "top"), (mu_2, r"$\mu_2$", "bottom")):
        curve.axhline(mu, color=GREY, ls=":")
        curve.text(1.2e-4, mu, text, va=side)
    curve.axvline(grains.I0, color=GREY, ls="--", lw=1)
    curve.text(1.15 * grains.I0, 0.33, "$I_0$")
    curve.text(4e-4, 0.435, "slow: like a solid\nthat slides")
    curve.text(1.2, 0.52, "fast: grains\ncollide")
    curve.set(xlabel="inertial number $I$", ylabel=r"friction $\mu = \tau/p$", ylim=(0.3, 0.7))
    curve.set_title("The flow rule")

    p = np.array([0.0, 1.0])
    plane.fill_between(p, 0, mu_s * p, color=BLUE, alpha=0.15)
    plane.fill_between(p, mu_s * p, mu_2 * p, color=ORANGE, alpha=0.2)
    plane.axvspan(-0.25, 0.0, color=GREY, alpha=0.2)
    plane.plot(p, mu_s * p, color=BLUE)
    plane.plot(p, mu_2 * p, color=ORANGE)
    arrow = {"arrowstyle": "->", "lw": 1.6, "color": "black", "shrinkA": 0, "shrinkB": 0}
    for start, end in (
        ((0.42, 0.06), (0.5, 0.13)),
        ((0.68, 0.3), (0.72, 0.62)),
        ((0.72, 0.62), (0.72, 0.38)),
        ((0.15, 0.03), (-0.12, 0.1)),
        ((-0.12, 0.1), (0.0, 0.0)),
    ):
        plane.annotate("", end, start, arrowprops=arrow)
    plane.text(0.73, 0.62, "trial")
    plane.text(0.735, 0.395, "new stress")
    plane.text(0.62, 0.08, "elastic")
    plane.text(0.86, 0.47, "flow", rotation=24)
    plane.text(-0.235, 0.35, "disconnected:\nno stress")
    plane.text(0.15, 0.57, "beyond the law", color="0.35")
    plane.set(xlim=(-0.25, 1.0), ylim=(0, 0.7), xlabel="pressure $p$", xticks=[0], yticks=[0])
    plane.set_ylabel(r"shear stress $\tau$")
    plane.set_title("Steps of the stress")
    return made


# ---- grid and transfers ----


def turning(scheme: gr.Scheme, turns: float) -> tuple[np.ndarray, np.ndarray]:
    """Kinetic energy of an elastic disc that turns freely, over that at the start, by its turns."""
    omega, cell, middle = 2 * np.pi, 0.05, 0.5
    disc = gr.Fill(gr.Sphere(0.3, center=(middle, middle)), 4)
    scene = gr.Scene(
        name="turning",
        grid=gr.Grid((0.0, 0.0), cell, (20, 20)),
        fills=[disc],
        material=gr.materials.Elastic(E=1e6),
        gravity=STILL,
        scheme=scheme,
        duration=turns,
    )
    sim, energies = gr.Simulation(scene), []
    x, v = sim.buffers["x"], sim.buffers["v"]
    v[0], v[1] = -omega * (x[1] - middle), omega * (x[0] - middle)
    v *= sim.buffers["id"] >= 0
    if "affine" in sim.buffers:
        sim.buffers["affine"][:] = np.reshape([0.0, -omega, omega, 0.0], (4, 1))

    def note(running: gr.Simulation) -> None:
        state = running.state
        energies.append((running.time, 0.5 * float(state.mass @ (state.v**2).sum(axis=1))))

    tell(sim.run(every=0.02, hooks=(note,)))
    times, energy = np.array(energies).T
    return times, energy / energy[0]


def transfers(quick: bool) -> Picture:
    """Shape functions, their slopes, and how long a disc goes on turning."""
    made, (left, middle, right) = picture(1.0, 1.0, 1.4)
    x = np.linspace(-2, 2, 401)
    for function, name, colour in ((linear, "linear", ORANGE), (spline, "quadratic", BLUE)):
        for ax, values in zip((left, middle), function(x), strict=True):
            ax.plot(x, values, color=colour, label=name, lw=1.8)
    left.set(title="Shape function", xlabel="position [cells]")
    middle.set(title="Its slope: the force", xlabel="position [cells]")
    left.legend(loc="upper right")
    particle = gr.ParticleDensity()
    schemes = {
        "TPIC": ({"transfer": "tpic", "tpic_decay": 0.0}, BLUE, "-"),
        "APIC": ({"transfer": "apic"}, GREEN, "--"),
        "FLIP": ({"transfer": "flip", "flip_decay": 0.0}, ORANGE, "-"),
        "PIC": ({"transfer": "xpic", "xpic_order": 1}, RED, "-"),
    }
    for name, (numbers, colour, style) in schemes.items():
        scheme = gr.Scheme(basis="quadratic", density=particle, **numbers)
        times, energy = turning(scheme, 0.2 if quick else 1.0)
        right.plot(times, energy, style, color=colour, label=name, lw=1.8)
    right.set(title="A disc that turns freely", xlabel="turns", ylim=(0, 1.05))
    right.set_ylabel("kinetic energy left")
    right.legend()
    return made


# ---- the density correction ----


def density_correction(quick: bool) -> Picture:
    """Pressure in a sheared layer with and without the correction."""
    made, axes = picture(1.0, 1.0)
    angle, cell, height = 25.0, 0.01, 0.2
    densities = {
        "Density of each point by itself": gr.ParticleDensity(),
        "Smoothed density": gr.SmoothedDensity(),
    }
    for ax, (title, density) in zip(axes, densities.items(), strict=True):
        scene = gr.scenes.incline(
            angle_deg=angle,
            height=height,
            cell=cell,
            columns=8,
            E=1e6,
            jitter=0.2,
            scheme=gr.Scheme(transfer="tpic", density=density),
        )
        sim = gr.Simulation(scene)
        tell(sim.run(until=0.2 if quick else 4.0))
        state, up = sim.state, np.array([0.0, height])
        weight = scene.material.rho_c * 9.8 * np.cos(np.radians(angle))
        ax.plot(state.pressure, state.x[:, 1], ".", color=BLUE, ms=3, alpha=0.6)
        ax.plot(weight * (height - up), up, color="black", lw=1.2, label="weight above")
        ax.set(title=title, xlabel="pressure [Pa]", xlim=(-100, 5500), ylim=(0, 1.1 * height))
    axes[0].set_ylabel("height above the base [m]")
    axes[1].legend()
    return made


# ---- the nonlocal law ----


def fluidity(quick: bool) -> Picture:
    """Angle at which a layer stops against its thickness, and profiles of the velocity."""
    made, (stop, profile) = picture(1.0, 1.0)
    grains = gr.NGF(E=1e6, mu_s=0.3819, mu_2=0.6435, rho_c=1500.0, rho_s=2450.0, I0=0.279, A=0.48,
                    d=0.005, t0=1e-3)  # fmt: skip
    numbers = (grains.A, grains.d, grains.mu_s, grains.mu_2)
    angle = np.linspace(20.95, 31.0, 400)
    height = gr.theory.stopping_height(angle, *numbers) / grains.d
    stop.plot(angle, height, color=BLUE, lw=2)
    stop.fill_between(angle, 0, height, color=BLUE, alpha=0.15)
    local = float(np.degrees(np.arctan(grains.mu_s)))
    stop.axvline(local, color=ORANGE, ls="--", label="local law, any thickness")
    stop.text(21.8, 1.2, "at rest")
    stop.text(26.5, 7, "flows")
    stop.set(xlabel="inclination [deg]", ylabel="thickness [grain diameters]", ylim=(0, 15))
    stop.set_title("Where a layer stops")
    stop.legend()
    slope, y = 25.0, np.linspace(0, 1, 201)
    least = float(gr.theory.stopping_height(slope, *numbers))
    for ratio, colour in ((1.05, RED), (2.0, ORANGE), (5.0, GREEN), (20.0, BLUE)):
        flow = gr.theory.chute_profile(slope, ratio * least, grains)
        speed = np.interp(y, flow.y / (ratio * least), flow.v)
        profile.plot(speed / speed[-1], y, color=colour, label=f"{ratio:g}")
    profile.plot(gr.theory.bagnold_shape(y, 1.0), y, "k:", label="local law")
    profile.set(xlabel="speed over that at the surface", ylabel="height over thickness")
    profile.set_title("How it flows")
    profile.legend(title="thickness over\nthat at which it stops")
    return made


# ---- the bits of a result ----


def determinism(quick: bool) -> Picture:
    """Growth of a difference of one rounding error, and of another number of threads."""
    made, (ax,) = picture(1.0, height=3.2)
    scene = gr.scenes.column_collapse(aspect=2.0, E=1e6, cell=0.04 if quick else 0.02)
    until, every = (0.2, 0.1) if quick else (1.0, 0.02)

    def history(threads: int, nudge: float = 0.0) -> tuple[np.ndarray, list[np.ndarray]]:
        sim, positions = gr.Simulation(scene, threads=threads), []
        x = sim.buffers["x"]
        x[0] += nudge * (sim.buffers["id"] == 7)
        sim.run(
            until=until, every=every, hooks=(lambda running: positions.append(running.state.x),)
        )
        tell(sim)
        return np.arange(len(positions)) * every, positions

    times, whole = history(1)
    for threads, nudge, colour, name in (
        (1, 1e-16, BLUE, "one point moved by 1e-16 m"),
        (2, 0.0, ORANGE, "two threads instead of one"),
    ):
        apart = [abs(a - b).max() for a, b in zip(whole, history(threads, nudge)[1], strict=True)]
        ax.semilogy(times, np.maximum(apart, 1e-18), ".-", color=colour, label=name)
    ax.axhline(scene.grid.cell, color=GREY, ls=":")
    ax.text(0.0, 1.3 * scene.grid.cell, "a cell", color="0.35")
    ax.set_yticks(
        [1e-18, 1e-15, 1e-12, 1e-9, 1e-6, 1e-3], ["0", *(f"1e-{k}" for k in (15, 12, 9, 6, 3))]
    )
    ax.set(xlabel="time [s]", ylabel="largest distance [m]", ylim=(3e-19, 1))
    ax.set_title("Distance of points from the first run")
    ax.legend(loc="center right")
    return made


# ---- rigid bodies ----


def bodies(quick: bool) -> Picture:
    """Points near a surface, their contact points, and the nodes on which a contact point acts."""
    made, (ax,) = picture(1.0, height=4.2)
    columns, rows = 8, 4
    body = gr.Body(gr.shapes.HalfSpace((-np.sin(0.3), np.cos(0.3))), (4.0, 1.35))
    for k in range(columns + 1):
        ax.axvline(k, color="0.85", lw=0.8, zorder=0)
    for k in range(rows + 1):
        ax.axhline(k, color="0.85", lw=0.8, zorder=0)
    ends = np.array([-1.0, columns + 1.0])
    level = 1.35 + np.tan(0.3) * (ends - 4.0)
    ax.fill_between(ends, -1, level, color="#d5d8dc", zorder=1)
    ax.plot(ends, level, color="#3f4650", zorder=2)
    along = (np.arange(2 * columns) + 0.5) / 2
    points = np.array([(x, y) for x in along for y in (np.arange(2 * rows) + 0.5) / 2])
    distance, normal = body.distance(points)
    points, distance, normal = (a[distance > 0.02] for a in (points, distance, normal))
    near = distance < 0.375
    ax.plot(*points[~near].T, "o", color=BLUE, ms=5, label="points", zorder=3)
    contacts = points[near] - distance[near, None] * normal[near]
    for point, contact in zip(points[near], contacts, strict=True):
        ax.plot(*np.transpose([point, contact]), color=RED, lw=1, zorder=3)
    ax.plot(*points[near].T, "o", color=RED, ms=5, label="points in contact", zorder=4)
    ax.plot(*contacts.T, "x", color="black", ms=5, label="their contact points", zorder=4)
    chosen = contacts[np.argmin(abs(contacts[:, 0] - 3.6))]
    nodes = np.array([(i, j) for i in range(columns + 1) for j in range(rows + 1)], float)
    reach = (abs(nodes - chosen) < 1.5).all(axis=1)
    for node in nodes[reach]:
        ax.plot(*np.transpose([chosen, node]), color=GREEN, lw=0.9, zorder=3)
    ax.plot(*nodes[reach].T, "s", color=GREEN, ms=6, label="nodes of one contact point", zorder=4)
    ax.text(6.0, 0.6, "body")
    ax.set(xlim=(0, columns), ylim=(-0.15, rows - 0.4), aspect="equal", xticks=[], yticks=[])
    ax.legend(loc="upper left", framealpha=1)
    return made


# ---- the core ----


def core(quick: bool) -> Picture:
    """Cells that exist for the kernels, and the slots of some of them in memory."""
    made = Picture(figsize=(7.0, 3.3), layout="constrained")
    top, bottom = made.subplots(2, 1, height_ratios=(3.0, 2.0))
    scene = gr.scenes.column_collapse(aspect=1.0, E=1e6, cell=0.04, points_per_cell=4)
    sim = gr.Simulation(scene, threads=1)
    tell(sim.run(until=0.3))
    state, grid = sim.state, scene.grid
    columns, rows = 14, 7
    held = np.zeros((columns, rows), bool)
    at = np.floor((state.x - grid.lower) / grid.cell).astype(int)
    inside = (at < (columns, rows)).all(axis=1)
    held[tuple(at[inside].T)] = True
    padded = np.pad(held, 1)
    near = np.any([np.roll(padded, (i, j), (0, 1)) for i in (-1, 0, 1) for j in (-1, 0, 1)], 0)
    active = near[1:-1, 1:-1]
    colour = np.where(held, 2, np.where(active, 1, 0)).T
    extent = (0, columns, 0, rows)
    kinds = {"vmin": 0, "vmax": 2, "cmap": "Blues", "alpha": 0.45}
    top.imshow(colour, origin="lower", extent=extent, **kinds)
    top.plot(*((state.x - grid.lower) / grid.cell).T, ".", color="black", ms=4)
    top.set(xticks=range(columns + 1), yticks=range(rows + 1), xticklabels=[], yticklabels=[])
    top.grid(color="0.8", lw=0.6)
    top.tick_params(length=0)
    top.set(xlim=(0, columns), ylim=(0, rows), aspect="equal")
    top.set_title("Cells with points, their neighbours, and cells that do not exist")
    counts = sim._engine.cells()[1][:8]  # points in the cells of the first tile
    tile = np.arange(counts.max() + 1)[:, None] < counts  # with the spare row
    for row, lanes in enumerate(tile):
        for lane, used in enumerate(lanes):
            face, alpha = (BLUE, 1.0) if used else (GREY, 0.3)
            slot = (lane, -row)
            bottom.add_patch(Rectangle(slot, 0.9, 0.9, facecolor=face, alpha=alpha))
    bottom.set(xlim=(-0.5, 8.5), ylim=(0.5 - len(tile), 1.5), xticks=[], yticks=[], aspect="equal")
    bottom.set(xlabel="cells of the tile", ylabel="rows")
    bottom.set_title("Slots of a tile: points (blue) and spare slots (grey)")
    for side in bottom.spines.values():
        side.set_visible(False)
    return made


# ---- axes of symmetry ----


def axisymmetry(quick: bool) -> Picture:
    """A cylinder that collapses, by radius and height, and its heap compared with 3D."""
    made, (flow, heap) = picture(1.0, 1.0, height=2.9)
    cells, radius = 6 if quick else 12, 0.2
    numbers = {"aspect": 1.0, "radius": radius, "cell": radius / cells, "ramp": 0.0, "E": 1e7}
    sim = gr.Simulation(gr.scenes.cylinder_collapse(axisymmetric=True, duration=1.0, **numbers))
    sim.run(until=0.18)
    gr.plot.frame(sim.state, "speed", ax=flow, extent=((0.0, 0.45), (0.0, 0.22)))
    flow.set(xlabel="radius r [m]", ylabel="height z [m]", title="0.18 s after the release")
    plane = gr.measure.surface(tell(sim.run()).state)
    whole = gr.Simulation(gr.scenes.cylinder_collapse(duration=1.0, **numbers))
    quarter = gr.measure.surface(tell(whole.run()).state)
    heap.plot(plane.x, plane.height, "-", color=BLUE, label="axisymmetric")
    heap.plot(quarter.x, quarter.height, "o", color=ORANGE, ms=4, mfc="none", label="3D")
    heap.plot([0.0, radius, radius], [radius, radius, 0.0], ":", color=GREY, label="at the start")
    heap.set(xlim=(0, 0.5), ylim=(0, 0.22), xlabel="radius r [m]", ylabel="height [m]")
    heap.set_title("At rest")
    heap.legend(loc="upper right")
    return made


# ---- a device ----


def _cells(axes: Axes, left: float, low: float, colors: Sequence[str], label: str) -> None:
    """Draw a row of cells with these colours, and what it is to the left of it."""
    for k, color in enumerate(colors):
        axes.add_patch(Rectangle((left + k, low), 1, 1, fc=color, ec="white", lw=1.5))
    axes.text(left - 0.3, low + 0.5, label, ha="right", va="center")


def device(quick: bool) -> Picture:
    """Lanes and threads for the same cells; and places in the list of points that change cells."""
    made, (lanes, places) = picture(1.0, 1.0, height=3.0)
    light = [f"{color}66" for color in (BLUE, ORANGE, GREEN, RED)]
    lanes.set_title("Who computes a cell")
    _cells(lanes, 0, 5, [light[0]] * 4 + [light[1]] * 4, "cells")
    for tile in range(2):
        lanes.text(4 * tile + 2, 5.5, f"tile {tile + 1}", ha="center", va="center")
    _cells(lanes, 0, 2.7, [light[0]] * 4, "processor")
    lanes.text(2, 3.2, "vector of 4 lanes", ha="center", va="center")
    lanes.annotate(
        "then tile 2", (6.6, 3.2), (4.2, 3.2), va="center", arrowprops={"arrowstyle": "->"}
    )
    _cells(lanes, 0, 0.4, light * 2, "GPU")
    for k in range(8):
        lanes.text(k + 0.5, 0.9, str(k), ha="center", va="center")
    lanes.text(4, 0.05, "a thread for each cell, all at once", ha="center", va="top")
    lanes.set(xlim=(-2.8, 8.1), ylim=(-0.7, 6.4))

    leaving = (0, 2, 0, 1, 0, 0, 3, 0)
    before = np.cumsum((0, *leaving[:-1]))
    colors = [light[k % 4] if n else "#e8e8e8" for k, n in enumerate(leaving)]
    places.set_title("Points that change their cells")
    for low, label, numbers in (
        (5.0, "leaving", leaving),
        (2.7, "sum of those before", before),
    ):
        _cells(places, 0, low, colors, label)
        for k, number in enumerate(numbers):
            places.text(k + 0.5, low + 0.5, str(number), ha="center", va="center")
    row = [colors[k] for k, n in enumerate(leaving) for _ in range(n)]
    _cells(places, 0, 0.4, row, "list")
    for k in (1, 3, 6):
        start, end = (k + 0.5, 2.7), (before[k] + 0.5, 1.45)
        places.annotate("", end, start, arrowprops={"arrowstyle": "->"})
    places.text(4, 0.05, "in the order of the cells, as on a processor", ha="center", va="top")
    places.set(xlim=(-4.6, 8.1), ylim=(-0.7, 6.4))
    for axes in (lanes, places):
        axes.axis("off")
    return made


PAGES: dict[str, Callable[[bool], Picture]] = {
    "laws": laws,
    "transfers": transfers,
    "axisymmetry": axisymmetry,
    "density_correction": density_correction,
    "fluidity": fluidity,
    "determinism": determinism,
    "bodies": bodies,
    "core": core,
    "device": device,
}


def main(argv: list[str] | None = None) -> None:
    draw_pages(__doc__, argv, PAGES, "explain_")

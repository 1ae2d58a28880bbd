"""Pictures of the guides on loads and on soil: walls, tools, slopes, footings, erosion."""

from __future__ import annotations

from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np

import granular as gr
from figures.common import BLUE, GREEN, GREY, ORANGE, RED, WEIGHT, panels, tell
from granular.plot import Picture


def wall_pressure(quick: bool) -> Picture:
    """Pressure and friction along a bin at rest and in flow, and along its cone with an insert."""
    cell = 0.02 if quick else 0.01
    scene = gr.scenes.hopper(
        angle_deg=20.0, orifice=0.12, width=0.3, fill_height=0.8, friction=0.3, cell=cell,
        ramp=0.3, opens_at=0.5, duration=1.0, mu_s=0.5, nu=0.4, E=1e6 if quick else 1e7,
    )  # fmt: skip
    wedge = gr.Polygon(((0.0, 0.18), (0.03, 0.24), (0.0, 0.30), (-0.03, 0.24)))
    insert = gr.Body(wedge, (0.0, 0.0), friction=0.3)
    made, (axes,) = panels(1, 3, 3.0, sharey=True)
    changed = scene.replace(bodies=(*scene.bodies, insert))
    with TemporaryDirectory() as folder:
        records = []
        for k, one in enumerate((scene, changed)):
            path = Path(folder, f"{k}.h5")
            gr.Simulation(one, tractions=True).run(save=path, every=0.01)
            records.append(gr.open(path))
        upright = gr.measure.wall_traction(records[0], body=1, bins=np.linspace(0.26, 0.8, 19))
        cones = [
            gr.measure.wall_traction(record, body=0, bins=np.linspace(0.0, 0.24, 9))
            for record in records
        ]
        tell(records[0])
    rest, flow = upright.mean(0.4, 0.5), upright.mean(0.7, 0.9)
    _along_bin(axes, scene, rest, flow, cones[0])
    for cone, color, label in zip(cones, (RED, GREEN), ("no insert", "with insert"), strict=True):
        mean = cone.mean(0.7, 0.9)
        axes[2].errorbar(
            1e-3 * mean.normal, mean.position, xerr=1e-3 * mean.normal_scatter, fmt="o-",
            color=color, ms=4, label=label,
        )  # fmt: skip
    axes[2].set(title="inclined wall in flow", xlabel="pressure [kPa]")
    axes[2].legend()
    return made


def _along_bin(
    axes: np.ndarray,
    scene: gr.Scene,
    rest: gr.measure.TractionProfile,
    flow: gr.measure.TractionProfile,
    cone: gr.measure.WallTraction,
) -> None:
    """Pressure and mobilised friction along the bin, and the pressure along its cone."""
    ratio = scene.material.nu / (1 - scene.material.nu)
    z = np.linspace(0.25, 0.8, 50)
    janssen = ratio * gr.theory.janssen_pressure(
        0.8 - z, 0.3, friction=0.3, ratio=ratio, rho=scene.material.rho_c
    )
    axes[0].plot(1e-3 * janssen, z, color="black", ls="--", label="Janssen", zorder=3)
    for mean, color, label in ((rest, BLUE, "at rest"), (flow, ORANGE, "in flow")):
        axes[0].errorbar(
            1e-3 * mean.normal, mean.position, xerr=1e-3 * mean.normal_scatter, fmt="o-",
            color=color, ms=4, label=label,
        )  # fmt: skip
        axes[1].plot(mean.friction, mean.position, "o-", color=color, ms=4, label=label)
    for begin, end, color in ((0.4, 0.5, BLUE), (0.7, 0.9, ORANGE)):
        mean = cone.mean(begin, end)
        axes[0].plot(1e-3 * mean.normal, mean.position, "s:", color=color, ms=4)
    axes[0].axhline(0.25, color=GREY, lw=0.8)
    axes[0].annotate("inclined wall", (0.03, 0.24), xycoords=("axes fraction", "data"), va="top")
    axes[0].set(title="bin and inclined wall", xlabel="pressure [kPa]", ylabel="elevation [m]")
    axes[0].legend()
    axes[1].axvline(0.3, color=GREY, ls="--", label="friction of the wall")
    axes[1].set(title="bin", xlabel="mobilised friction", xlim=(0.0, 0.35))
    axes[1].legend(loc="lower left")


RADIUS, OMEGA, LOAD = 0.1, 2.0, 300.0
"""Radius [m], angular velocity [rad/s] and load [N/m] of the wheel."""


def bed(cell: float, body: gr.Body, duration: float) -> gr.Scene:
    """Soil 0.16 m deep with a tool."""
    return gr.Scene(
        name="soil",
        grid=gr.Grid((0.0, 0.0), cell, (round(0.8 / cell), round(0.44 / cell)), open_sides={"y+"}),
        fills=[gr.Fill(gr.Box((0.0, 0.0), (0.8, 0.16)), 4, lithostatic=True)],
        material=gr.MuI(E=1e6, mu_s=0.6, mu_2=0.8),
        walls=[
            gr.Wall(axis=1, at=0.0),
            gr.Wall(axis=0, at=0.0, kind="free_slip"),
            gr.Wall(axis=0, at=0.8, kind="free_slip"),
        ],
        bodies=[body],
        gravity=WEIGHT,
        duration=duration,
    )


def wheel_on_soil(slip: float, grousers: int, cell: float) -> gr.Scene:
    """The wheel of the guide, which settles for 0.3 s before it rolls."""
    height = 0.02 if grousers else 0.0
    motion = gr.Motion(
        times=(0.0, 0.3, 0.4),
        velocity=((0.0, 0.0), (0.0, 0.0), ((1.0 - slip) * OMEGA * RADIUS, 0.0)),
        angular_velocity=(0.0, 0.0, -OMEGA),
    )
    shape = gr.shapes.wheel(RADIUS, grousers=grousers, height=height, thickness=3 * cell)
    place = (0.2, 0.16 + RADIUS + height)
    wheel = gr.Body(shape, place, motion=motion, friction=0.5, free="y", mass=LOAD / 9.8)
    return bed(cell, wheel, 1.5)


def tools_in_soil(quick: bool) -> Picture:
    """A wheel with grousers, its drawbar pull against slip, and a bucket that digs."""
    cell = 0.02 if quick else 0.01
    made = Picture(figsize=(7.0, 4.4), layout="compressed")
    axes = made.subplot_mosaic([["wheel", "bucket"], ["pull", "pull"]])
    for grousers, color, label in ((0, BLUE, "smooth"), (8, ORANGE, "with grousers")):
        rows = []
        for slip in (-0.4, 0.0, 0.15, 0.3, 0.5, 0.7):
            with TemporaryDirectory() as folder:
                path = Path(folder, "a.h5")
                sim = gr.Simulation(wheel_on_soil(slip, grousers, cell)).run(save=path, every=0.02)
                history = gr.measure.soil_tools.wheel_history(gr.open(path))
            pull = history.drawbar_pull[history.times > 0.7] / LOAD
            rows.append((slip, pull.mean(), pull.std()))
            if grousers and slip == 0.3:
                extent = ((0.0, 0.8), (0.0, 0.44))
                gr.plot.frame(
                    tell(sim).state, "speed", ax=axes["wheel"], extent=extent, title="wheel"
                )
        slips, means, scatter = np.transpose(rows)
        axes["pull"].errorbar(slips, means, yerr=scatter, fmt="o-", color=color, ms=4, label=label)
    axes["pull"].axhline(0.0, color=GREY, lw=0.8)
    axes["pull"].set(xlabel="slip", ylabel="drawbar pull over load")
    axes["pull"].legend(loc="lower right")
    _bucket(axes["bucket"], cell)
    return made


def _bucket(ax: Any, cell: float) -> None:
    """The bucket of the guide at its end, and the path of its position."""
    times = (0.0, 0.4, 0.9, 1.3)
    places = ((0.2, 0.34), (0.22, 0.24), (0.4, 0.16), (0.45, 0.3))
    path = gr.Motion.through(times, places, angles_deg=(0.0, 15.0, 60.0, 100.0))
    side = gr.Polygon(((0.0, 0.12), (0.0, 0.0), (0.14, 0.0)), thickness=3 * cell)
    bucket = gr.Body(side, places[0], rotation_deg=-60.0, motion=path, friction=0.5)
    positions = []

    def follow(sim: gr.Simulation) -> None:
        positions.append(sim.bodies[0].position.copy())

    sim = gr.Simulation(bed(cell, bucket, 1.3)).run(every=0.02, hooks=(follow,))
    extent = ((0.0, 0.8), (0.0, 0.44))
    gr.plot.frame(tell(sim).state, "speed", ax=ax, extent=extent, title="bucket")
    ax.plot(*np.transpose(positions), color=ORANGE, ls="--", lw=1.2)
    ax.plot(*np.transpose(places), "o", color=ORANGE, ms=3)


def slope_stability(quick: bool) -> Picture:
    """A slope of weakened soil that slides, and the displacement against the factor."""
    scene = gr.scenes.slope(cell=0.5 if quick else 0.125)
    made = Picture(figsize=(7.0, 2.4), layout="constrained")
    left, right = made.subplots(1, 2, width_ratios=(1.4, 1.0))
    factor = 1.5
    weak = scene.replace(material=gr.stability.reduced(scene.material, factor))
    sim = gr.Simulation(weak).run(until=1.0)
    start = sim.state
    state = tell(sim.run()).state
    moved = np.hypot(*gr.measure.displacement(state, start).T)
    title = f"strength divided by {factor:g}"
    gr.plot.frame(state, moved, ax=left, title=title, label="displacement [m]")
    for cell, color in ((0.5, GREY), (0.25, BLUE), (0.125, ORANGE))[: 2 if quick else 3]:
        safety = gr.stability.factor_of_safety(
            gr.scenes.slope(cell=cell), tolerance=0.01, start=1.2, moved=0.05
        )
        moves = np.maximum(safety.displacements, 1e-4)
        right.plot(safety.factors, moves, "o-", color=color, ms=4, label=f"cells of {cell:g} m")
    right.axvspan(1.38, 1.40, color=GREY, alpha=0.4, lw=0, label="charts, finite elements")
    right.axhline(0.05, color=GREY, lw=0.8, ls=":", label="counts as failure")
    right.set(xlabel="factor", ylabel="displacement [m]", yscale="log", ylim=(3e-5, 0.2))
    right.legend(loc="lower right")
    return made


def _pushed(scene: gr.Scene, axis: int, window: int) -> tuple[np.ndarray, np.ndarray]:
    """Displacement of body 0 along an axis and the force on it."""
    with TemporaryDirectory() as folder:
        path = Path(folder, "a.h5")
        gr.Simulation(scene).run(save=path, every=0.01)
        record = gr.open(path)
        force, motion = gr.measure.body_force(record, window=window), gr.measure.body_motion(record)
    moved = np.interp(force.times, motion.times, motion.position[:, axis])
    return np.abs(moved), np.abs(force.force[:, axis])


def walls_and_footings(quick: bool) -> Picture:
    """Coefficients of earth pressure over the displacement, and pressures on footings."""
    made, ((left, right),) = panels(1, 2, 2.7)
    cell = 0.125 if quick else 0.0625
    for speed, color, label in ((0.02, ORANGE, "passive"), (-0.02, BLUE, "active")):
        scene = gr.scenes.retaining_wall(speed=speed, cell=cell)
        moved, force = _pushed(scene, 0, 5)
        left.plot(100 * moved, force / (0.5 * 1600.0 * 9.8), color=color, label=label)
    known = gr.theory.earth_pressure(0.5)
    for K in (known.passive_coaxial, known.active_coaxial):
        left.axhline(K, color=GREY, ls="--", label="Rankine" if K > 1 else None)
    left.set(xlabel="displacement [% of the height]", ylabel="K", yscale="log", ylim=(0.2, 5.0))
    ticks = (0.33, 0.5, 1, 2, 3, 5)
    left.set_yticks(ticks, [f"{tick:g}" for tick in ticks])
    left.minorticks_off()
    left.legend()
    clay = {"mu": 0.02, "cohesion": 2e4, "tensile_strength": 2e4, "E": 1e8}
    angle = np.sin(np.radians(20.0))
    for numbers, unit, exact, color, label in (
        (clay, 2e4, 5.14, BLUE, "N_c, hardly any friction"),
        ({"mu": angle}, 0.5 * 1600.0 * 9.8, 2.84, ORANGE, "N_gamma, 20 degrees"),
    ):
        scene = gr.scenes.footing(
            length=2.5, soil=1.5, cell=cell, speed=0.01, settlement=0.02, **numbers
        )
        moved, force = _pushed(scene, 1, 10)
        right.plot(100 * moved, force / unit, color=color, label=label)
        right.axhline(exact, color=color, ls="--")
    right.set(xlabel="settlement [% of the width]", ylabel="pressure over its unit", ylim=(0, 6.5))
    right.legend(loc="lower right")
    return made


def erodible_bed(quick: bool) -> Picture:
    """A column before and after its collapse on a bed of the same grains."""
    cell = 0.02 if quick else 0.01
    regions = (gr.Box((0.0, 0.0), (1.2, 0.08)), gr.Box((0.0, 0.08), (0.2, 0.48)))
    scene = gr.Scene(
        name="erodible_bed",
        grid=gr.Grid((0.0, 0.0), cell, (round(1.2 / cell), round(0.56 / cell))),
        fills=[gr.Fill(region, 4, lithostatic=True) for region in regions],
        material=gr.MuI(E=1e6, mu_s=0.38, mu_2=0.64),
        walls=[
            gr.Wall(axis=1, at=0.0),
            gr.Wall(axis=0, at=0.0, kind="free_slip"),
            gr.Wall(axis=0, at=1.2, kind="free_slip"),
        ],
        gravity=WEIGHT,
        duration=2.0,
    )
    made, axes = panels(3, 1, 5.3, sharex=True)
    sim = gr.Simulation(scene)
    start = sim.state
    of_bed = start.id[start.x[:, 1] < 0.08]
    extent = ((0.0, 1.2), (0.0, 0.5))
    for ax, until in zip(axes[:2, 0], (0.25, 2.0), strict=True):
        state = sim.run(until=until).state
        part = np.isin(state.id, of_bed).astype(float)
        gr.plot.frame(
            state, part, ax=ax, extent=extent, title=f"t = {until:g} s",
            label="grains of the bed", limits=(0.0, 1.0),
        )  # fmt: skip
    moved = np.hypot(*gr.measure.displacement(tell(sim).state, start).T)
    gr.plot.frame(
        sim.state, moved, ax=axes[2, 0], extent=extent, title="displacement",
        label="displacement [m]", limits=(0.0, 0.5),
    )  # fmt: skip
    return made


def slope_in_drum(record: gr.Trajectory) -> float:
    """Slope of the surface in the second half of a run [deg]; processes import it."""
    return gr.measure.drum_flow(record[len(record) // 2 :]).slope_deg


def calibrate_friction(quick: bool) -> Picture:
    """Slopes in a drum against the friction, and the interval that a measured slope leaves."""
    made = Picture(figsize=(7.0, 2.8), layout="compressed")
    left, right = made.subplots(1, 2, width_ratios=(1.3, 1.0))
    values, seeds = ((0.35, 0.42, 0.5), (1, 2)) if quick else ((0.35, 0.4, 0.45, 0.5), (1, 2, 3))
    cases = {
        (mu_s, seed): gr.scenes.rotating_drum(
            cell=0.01, omega=0.6, duration=3.0, jitter=0.3, seed=seed, mu_s=mu_s, mu_2=mu_s + 0.26
        )
        for mu_s in values
        for seed in seeds
    }
    with TemporaryDirectory() as folder:
        results = gr.sweep(
            cases, folder=folder, measure=slope_in_drum, every=0.1, workers=2, progress=False
        )
        state = gr.open(results.paths[-1])[-1]
    numbers = [mu_s for mu_s, _ in results.keys]
    measured, error = 28.0, 0.5
    known = gr.calibrate.invert(numbers, list(results), measured, error=error)
    along = np.linspace(values[0], values[-1], 50)
    left.plot(numbers, list(results), "o", color=BLUE, ms=4, label="runs, several seeds")
    left.plot(along, known(along), color=BLUE, lw=1, label="fit")
    left.axhspan(measured - error, measured + error, color=GREY, alpha=0.3, lw=0, label="measured")
    left.axvspan(*known.interval, color=ORANGE, alpha=0.3, lw=0, label="interval, 95 %")
    left.set(xlabel="mu_s", ylabel="slope in the drum [degrees]")
    left.legend()
    gr.plot.frame(state, "speed", ax=right, title="mu_s = 0.5")
    return made

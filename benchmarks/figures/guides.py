"""Pictures of the pages of docs/how-to/ and docs/tutorials/: guide_*.png of docs/pictures/.

`python benchmarks guides walls restart` makes only these. The whole takes some minutes.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Sequence
from contextlib import chdir
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
from matplotlib.figure import Figure
from matplotlib.image import imread

import granular as gr
from figures.arching import arching
from figures.common import BLUE, GREEN, GREY, ORANGE, RED, WEIGHT, draw_pages, panels, tell
from figures.engineering import (
    calibrate_friction,
    erodible_bed,
    slope_stability,
    tools_in_soil,
    wall_pressure,
    walls_and_footings,
)
from figures.from_files import dem_runs, meshes
from granular.plot import Picture

STILL = gr.Gravity((0.0,), ((0.0, 0.0),))


def column(cell: float, until: float = 1.0, **numbers: float) -> gr.State:
    """Last state of a column that collapses."""
    scene = gr.scenes.column_collapse(cell=cell, points_per_cell=4, duration=until, **numbers)
    return tell(gr.Simulation(scene).run()).state


def runout(state: gr.State) -> float:
    return gr.measure.runout(state).quantile


# ---- parts of a scene ----


def walls(quick: bool) -> Picture:
    """A block that spreads over a floor of each kind."""
    made, axes = panels(3, 1, 5.1, sharex=True)
    cell = 0.04 if quick else 0.02
    floors = {
        "no_slip": gr.Wall(axis=1, at=0.0),
        "coulomb, friction 0.2": gr.Wall(axis=1, at=0.0, kind="coulomb", friction=0.2),
        "free_slip": gr.Wall(axis=1, at=0.0, kind="free_slip"),
    }
    for ax, (kind, floor) in zip(axes.flat, floors.items(), strict=True):
        scene = gr.Scene(
            name="block",
            grid=gr.Grid((0.0, 0.0), cell, (round(0.8 / cell), round(0.24 / cell))),
            fills=[gr.Fill(gr.Box((0.0, 0.0), (0.2, 0.2)), 9)],
            material=gr.MuI(E=1e6),
            walls=[floor, gr.Wall(axis=0, at=0.0, kind="free_slip")],
            gravity=WEIGHT,
            duration=0.3,
        )
        state = tell(gr.Simulation(scene).run()).state
        extent = ((0.0, 0.7), (0.0, 0.2))
        gr.plot.frame(state, "speed", ax=ax, extent=extent, limits=(0, 1.5), title=kind)
    return made


def fill_regions(quick: bool) -> Picture:
    """A layer on a slope, and the pressure at the start of several regions."""
    made, axes = panels(1, 2, 2.4)
    slope = gr.Body(gr.shapes.HalfSpace((np.sin(0.5), np.cos(0.5))), (0.5, 0.25), friction=0.4)
    release = gr.Layer(
        on=slope,
        thickness=lambda x: 0.08 * np.cos((x - 0.3) / 0.13),
        lower=0.1,
        upper=0.5,
        spacing=0.005,
    )
    made_of = {"material": gr.MuI(E=1e6), "gravity": WEIGHT, "duration": 1.0}
    avalanche = gr.Scene(
        name="avalanche",
        grid=gr.Grid((0.0, 0.0), 0.01, (100, 60)),
        fills=[gr.Fill(release, 4)],
        bodies=[slope],
        **made_of,
    )
    gr.plot.scene(avalanche, ax=axes[0, 0], title="gr.Layer on a body")
    ring = gr.Mask.of(
        lambda p: abs(np.hypot(*(p - (0.75, 0.3)).T) - 0.12) < 0.04,
        lower=(0.55, 0.1),
        upper=(0.95, 0.5),
        spacing=0.005,
    )
    regions = [
        gr.Fill(gr.Box((0.0, 0.0), (0.25, 0.3)), 9, lithostatic=True),
        gr.Fill(
            gr.Difference(gr.Box((0.3, 0.0), (0.5, 0.3)), gr.Sphere(0.07, center=(0.4, 0.15))), 9
        ),
        gr.Fill(ring, 9),
        gr.Fill(gr.Polygon([(0.55, 0.0), (0.95, 0.0), (0.75, 0.1)]), 9),
    ]
    several = gr.Scene(
        name="regions", grid=gr.Grid((0.0, 0.0), 0.01, (100, 60)), fills=regions, **made_of
    )
    gr.plot.frame(
        gr.Simulation(several).state, "pressure", ax=axes[0, 1], title="pressure at the start",
        extent=((0.0, 1.0), (0.0, 0.6)),
    )  # fmt: skip
    for text, x, y in (
        ("gr.Box,\nlithostatic", 0.02, 0.33),
        ("gr.Difference", 0.29, 0.33),
        ("gr.Mask", 0.68, 0.49),
        ("gr.Polygon", 0.8, 0.08),
    ):
        axes[0, 1].text(x, y, text)
    return made


def own_material(quick: bool) -> Picture:
    """Friction against the inertial number, and heaps of materials with other friction."""
    made = Picture(figsize=(7.0, 2.8), layout="compressed")
    grid = made.add_gridspec(2, 2, width_ratios=(1.0, 1.2))
    curve = made.add_subplot(grid[:, 0])
    sand = gr.MuI(E=1e6, nu=0.3, rho_c=1600.0, mu_s=0.6, mu_2=0.9, rho_s=2650.0, I0=0.28, d=1e-3)
    beads = gr.materials.glass_beads_5mm.replace(E=1e6)
    rate = np.geomspace(1e-4, 1e2, 200)
    for k, (name, law, colour) in enumerate((("sand", sand, ORANGE), ("glass beads", beads, BLUE))):
        mu = law.mu_s + (law.mu_2 - law.mu_s) / (law.I0 / rate + 1)
        curve.semilogx(rate, mu, color=colour, lw=2, label=f"MuI: {name}")
        ax = made.add_subplot(grid[k, 1])
        state = column(0.04 if quick else 0.01, aspect=1.0, material=law)
        extent = ((0.0, 0.55), (0.0, 0.21))
        gr.plot.frame(state, "pressure", ax=ax, extent=extent, title=f"{name}, at rest")
    curve.axhline(0.5, color=GREY, ls="--", label="DruckerPrager, mu = 0.5")
    curve.set(xlabel="inertial number", ylabel="friction", ylim=(0.3, 1.0))
    curve.legend(loc="upper left")
    return made


def choose_a_scheme(quick: bool) -> Picture:
    """Pressure in a silo by each of the ready schemes."""
    made, axes = panels(1, 3, 3.2, sharey=True)
    schemes = {
        "default": gr.schemes.default,
        "cell_averaged": gr.schemes.cell_averaged,
        "dunatunga_kamrin_2015": gr.schemes.dunatunga_kamrin_2015.replace(dt=None),
    }
    cell = 0.05 if quick else 0.00625
    for ax, (name, scheme) in zip(axes.flat, schemes.items(), strict=True):
        scene = gr.scenes.silo(orifice=0.2, E=1e6, cell=cell, points_per_cell=4, scheme=scheme)
        state = gr.Simulation(scene).run(until=0.6, monitor=False).state
        last = ax is axes.flat[-1]
        gr.plot.frame(state, "pressure", ax=ax, limits=(0, 15000), title=name, bar=last)
    return made


def choose_a_stiffness(quick: bool) -> Picture:
    """Run-out and number of steps against the stiffness."""
    made, ((left, right),) = panels(1, 2, 2.4)
    stiffness = np.array([3e4, 1e5, 3e5, 1e6, 3e6, 1e7])[: 3 if quick else None]
    runouts, steps = [], []
    for E in stiffness:
        state = column(0.04 if quick else 0.0125, aspect=1.0, E=float(E))
        runouts.append(runout(state))
        steps.append(state.step)
    largest = 1500 * 9.8 * 0.2
    left.semilogx(stiffness / largest, runouts, "o-", color=BLUE)
    left.axvline(1000, color=GREY, ls="--")
    left.text(900, 0.1, "rule of thumb: 1000", color="0.35", ha="right")
    left.set(xlabel="E over the largest pressure", ylabel="run-out [half-widths]")
    left.set_ylim(0, 1.15 * max(runouts))
    right.loglog(stiffness, steps, "o-", color=ORANGE)
    right.set(xlabel="Young's modulus E [Pa]", ylabel="time steps of the run")
    return made


def scale_a_model(quick: bool) -> Picture:
    """A column and its model of a quarter of the size."""
    made, axes = panels(1, 2, 2.3, width_ratios=(2.0, 1.0))
    large = gr.scenes.column_collapse(aspect=1.0, half_width=2.0, cell=0.2 if quick else 0.1, E=1e8)
    small = gr.scaling.Froude(1 / 4).scene(large)
    times = 1.2, 0.6
    for ax, scene, until, name in zip(
        axes.flat, (large, small), times, ("site", "model"), strict=True
    ):
        state = tell(gr.Simulation(scene).run(until=until)).state
        size = until / 0.6
        extent = ((0.0, 1.2 * size**2), (0.0, 0.52 * size**2))
        gr.plot.frame(state, "speed", ax=ax, extent=extent, title=f"{name}, t = {until} s")
    return made


# ---- scenes ----


def scene_files(quick: bool) -> Figure:
    """The scene that the file of a hopper describes."""
    with TemporaryDirectory() as folder:
        path = Path(folder, "hopper.toml")
        path.write_text(gr.scenes.template("hopper"))
        made = gr.plot.scene(gr.scenes.read_scene(path).scene, title="hopper.toml")
    made.set_size_inches(5.0, 5.5)
    return made


def shear_cell(quick: bool) -> Picture:
    """Velocity and pressure over the height of a shear cell whose lid keeps a pressure."""
    made, ((left, right),) = panels(1, 2, 2.4, sharey=True)
    scene = gr.Scene(
        name="shear_cell",
        grid=gr.Grid((0.0, 0.0), 0.01, (4, 20), periodic=(True, False)),
        fills=[gr.Fill(gr.Box((0.0, 0.0), (0.04, 0.2)), 4, jitter=0.6)],
        material=gr.MuI(E=1e6),
        walls=[gr.Wall(1, 0.0), gr.Wall(1, 0.2, velocity=(2.8, 0.0), pressure=1000.0)],
        gravity=STILL,
        duration=5.0,
    )
    state = tell(gr.Simulation(scene).run(until=0.2 if quick else 5.0)).state
    height = state.x[:, 1]
    left.plot(state.v[:, 0], height, ".", color=BLUE, ms=4, label="points")
    left.plot([0, 2.8], [0, 0.2], color="black", lw=1.2, label="uniform shear")
    left.set(xlabel="velocity along x [m/s]", ylabel="height [m]")
    left.legend()
    right.plot(state.pressure, height, ".", color=BLUE, ms=4)
    right.axvline(1000.0, color="black", lw=1.2)
    right.set(xlabel="pressure [Pa]", xlim=(0, 2000))
    return made


def own_scene(quick: bool) -> Picture:
    """The block and the wedge of the tutorial: the scene, and the flow at two times."""
    made, axes = panels(1, 3, 2.1, sharey=True)
    cell = 0.05 if quick else 0.02
    wedge = gr.shapes.Polygon([(0.45, 0.0), (0.75, 0.0), (0.75, 0.15)])
    scene = gr.Scene(
        name="block_and_wedge",
        grid=gr.Grid((0.0, 0.0), cell, (round(1 / cell), round(0.5 / cell)), open_sides={"x+"}),
        fills=[gr.Fill(gr.Box((0.0, 0.0), (0.3, 0.4)), points_per_cell=4)],
        walls=[gr.Wall(axis=1, at=0.0), gr.Wall(axis=0, at=0.0, kind="free_slip")],
        bodies=[gr.Body(wedge, (0.0, 0.0), friction=0.4)],
        material=gr.MuI(E=1e6, mu_s=0.6, mu_2=0.9, rho_c=1600.0, rho_s=2650.0),
        gravity=gr.Gravity(),
        duration=1.0,
    )
    sim = gr.Simulation(scene)
    for ax, until in zip(axes.flat, (0.0, 0.3, 1.0), strict=True):
        if until:
            sim.run(until=until)
        last = ax is axes.flat[-1]
        extent = ((0.0, 1.0), (0.0, 0.42))
        gr.plot.frame(sim.state, "speed", ax=ax, extent=extent, limits=(0, 1.2), bar=last)
    tell(sim)
    return made


# ---- runs and results ----


def read_the_verdict(quick: bool) -> Picture:
    """An indicator of two runs over time, one of which becomes suspect."""
    made, axes = panels(1, 3, 2.3, width_ratios=(1.5, 1.0, 1.0))
    made.set_layout_engine("constrained")
    left, *frames = axes.flat
    schemes = (
        ("default scheme", gr.schemes.default, BLUE),
        ("published scheme", gr.schemes.dunatunga_kamrin_2015.replace(dt=None), RED),
    )
    for ax, (name, scheme, colour) in zip(frames, schemes, strict=True):
        scene = gr.scenes.incline(
            angle_deg=25.0, height=0.2, cell=0.01, columns=20, E=1e6, jitter=0.2,
            points_per_cell=4, scheme=scheme, duration=2.0 if quick else 8.0,
        )  # fmt: skip
        with TemporaryDirectory() as folder:
            sim = tell(gr.Simulation(scene).run(save=Path(folder, "a.h5"), every=0.1))
            with gr.open(Path(folder, "a.h5")) as record:
                samples = record.samples["disconnected"]
                left.plot(record.times, samples, ".-", color=colour, label=name)
        gr.plot.frame(
            sim.state, "pressure", ax=ax, limits=(0, 2700), title=name, bar=ax is frames[1]
        )
    left.axhline(0.1, color=GREY, ls="--", label="limit")
    left.set(xlabel="time [s]", ylabel="disconnected share", ylim=(-0.01, None))
    left.legend()
    return made


def watch_a_run(quick: bool) -> Picture:
    """Speed of a column that collapses, as a hook notes it, and when the hook ends the run."""
    made, ((ax,),) = panels(1, 1, 2.2)
    scene = gr.scenes.column_collapse(aspect=1.2, E=1e6, cell=0.04, points_per_cell=9)
    speeds_in_time: list[tuple[float, float]] = []

    def note(sim: gr.Simulation) -> None:
        speeds_in_time.append((sim.time, gr.measure.speed_percentile(sim.state)))

    tell(gr.Simulation(scene).run(until=0.3 if quick else 1.0, every=0.02, hooks=(note,)))
    times, speeds = np.array(speeds_in_time).T
    ax.plot(times, speeds, ".-", color=BLUE, label="values stored by the hook")
    ax.axhline(0.02, color=GREY, ls="--", label="taken as rest")
    resting = (times > 0.3) & (speeds < 0.02)
    if resting.any():
        ax.axvline(times[resting][0], color=ORANGE, label="the hook ends the run")
    ax.set(xlabel="time [s]", ylabel="speed of the fastest points [m/s]")
    ax.legend()
    return made


def restart(quick: bool) -> Picture:
    """A run that continues one record with its friction and with another."""
    made, axes = panels(1, 3, 2.0, sharey=True)
    cell = 0.04 if quick else 0.0125
    extent, common = ((0.0, 0.7), (0.0, 0.31)), {"bar": False, "limits": (0, 1.5)}
    with TemporaryDirectory() as folder:
        path = Path(folder, "collapse.h5")
        scene = gr.scenes.column_collapse(aspect=1.5, E=1e6, cell=cell, points_per_cell=4)
        sim = tell(gr.Simulation(scene).run(until=0.2, save=path))
        gr.plot.frame(sim.state, "speed", ax=axes[0, 0], extent=extent, title="t = 0.2 s", **common)
        for ax, mu_s in zip(axes[0, 1:], (scene.material.mu_s, 0.1), strict=True):
            changed = scene.replace(material=scene.material.replace(mu_s=mu_s))
            resumed = gr.Simulation.resume(path, scene=changed)
            state = tell(resumed.run(until=0.5, save=Path(folder, f"{mu_s}.h5"))).state
            title = f"t = 0.5 s, mu_s = {mu_s:.2f}"
            options = common | {"bar": ax is axes[0, 2]}
            gr.plot.frame(state, "speed", ax=ax, extent=extent, title=title, **options)
    return made


def couple_with_another_program(quick: bool) -> Picture:
    """The vehicle of the guide, and its height and the force on it by either program."""
    del quick  # it takes some seconds
    made = Picture(figsize=(7.0, 3.6), layout="constrained")
    axes = made.subplot_mosaic([["top", "top"], ["left", "right"]])
    top, left, right = axes["top"], axes["left"], axes["right"]
    with TemporaryDirectory() as folder, chdir(folder):
        exec("\n".join(code_of("couple_with_another_program")), {})
        vehicle = gr.open("vehicle.h5")
        gr.plot.frame(
            vehicle[-1], "speed", ax=top, limits=(0, 0.4), title=f"t = {vehicle.times[-1]:.1f} s"
        )
        for name, color, line in (("vehicle", BLUE, "-"), ("vehicle_mujoco", ORANGE, "--")):
            record = gr.open(f"{name}.h5")
            motion, force = gr.measure.body_motion(record), gr.measure.body_force(record)
            label = "MuJoCo" if "mujoco" in name else "ten lines"
            left.plot(motion.times, 1e3 * motion.position[:, 1], line, color=color, label=label)
            right.plot(force.times, force.force[:, 1], line, color=color, label=label)
    right.axhline(80 * 9.8, color=GREY, ls=":", label="weight")
    left.set(xlabel="time [s]", ylabel="height [mm]", title="axle of the wheel")
    right.set(xlabel="time [s]", ylabel="force [N/m]", title="force of the sand upwards")
    right.legend()
    return made


def code_of(guide: str) -> list[str]:
    """Blocks of Python of a guide."""
    page = Path(__file__).parents[2] / "docs" / "how-to" / f"{guide}.md"
    return re.findall(r"^```python\n(.*?)^```$", page.read_text(), re.M | re.S)


def two_numbers(mu_s: float, aspect: float, cell: float) -> gr.Scene:
    return gr.scenes.column_collapse(
        aspect=aspect, cell=cell, points_per_cell=4, E=1e6, mu_s=mu_s, mu_2=mu_s + 0.26,
        duration=1.0,
    )  # fmt: skip


def measured_runout(record: gr.Trajectory) -> float:
    """Run-out of a case of the sweep; processes import it."""
    return runout(record[-1])


def sweep(quick: bool) -> Picture:
    """Run-outs of a sweep over friction and aspect, and heaps of three of its cases."""
    made = Picture(figsize=(7.0, 3.2), layout="constrained")
    grid = made.add_gridspec(3, 2, width_ratios=(1.0, 1.3))
    frictions: Sequence[float] = (0.3, 0.4, 0.5)
    aspects = (1.0, 2.0) if quick else (1.0, 1.5, 2.0, 2.5)
    cases = {
        (mu_s, a): two_numbers(mu_s, a, 0.025 if quick else 0.01)
        for mu_s in frictions
        for a in aspects
    }
    with TemporaryDirectory() as folder:
        measure = measured_runout
        results = gr.sweep(cases, folder=folder, measure=measure, workers=2, progress=False)
        left = made.add_subplot(grid[:, 0])
        for k, mu_s in enumerate(frictions):
            reached = [results[results.keys.index((mu_s, a))] for a in aspects]
            colour = (BLUE, GREEN, ORANGE)[k]
            left.plot(aspects, reached, "o-", color=colour, label=f"mu_s = {mu_s}")
            ax = made.add_subplot(grid[k, 1])
            with gr.open(results.paths[results.keys.index((mu_s, 1.0))]) as record:
                extent = ((0.0, 0.6), (0.0, 0.18))
                options = {
                    "extent": extent,
                    "limits": (0, 2000),
                    "title": f"mu_s = {mu_s}, aspect 1",
                }
                gr.plot.frame(record[-1], "pressure", ax=ax, **options)
    left.set(xlabel="height over half-width of the column", ylabel="run-out [half-widths]")
    left.legend()
    return made


def paraview(quick: bool) -> Picture:
    """A frame with its bodies, and a view of a 3D state."""
    made, (axes,) = panels(1, 2, 2.0, width_ratios=(1.2, 1.0))
    scene = gr.scenes.penetration(
        cell=0.02 if quick else 0.005, duration=0.6, headroom=0.2, speed=0.2
    )
    left, right = axes
    state = tell(gr.Simulation(scene).run(until=0.1 if quick else 0.6)).state
    gr.plot.frame(state, "pressure", ax=left, title="gr.plot.frame(state, color='pressure')")
    blade = gr.scenes.excavation(
        depth=0.05, travel=0.1, speed=0.2, dive_speed=0.1, settle=0.15, length=0.8, width=0.5,
        cell=0.025 if quick else 0.0125,
    )  # fmt: skip
    sim = tell(gr.Simulation(blade).run(until=0.3 if quick else 1.15))
    with TemporaryDirectory() as folder:
        path = Path(folder, "now.png")
        gr.plot.view(
            sim, path, color="speed", limits=(0.0, 0.2), camera=(0.8, -1.2, 0.6), window=(800, 600)
        )
        pixels = imread(path)
        ink = (pixels[..., :3] < 1).any(axis=2)
        rows, columns = (np.flatnonzero(ink.any(axis=axis)) for axis in (1, 0))
        right.imshow(pixels[rows[0] : rows[-1] + 1, columns[0] : columns[-1] + 1])
    right.set_title("gr.plot.view(sim, 'now.png')")
    right.axis("off")
    return made


def error_bar(quick: bool) -> Picture:
    """Rates of a hopper in cells of several sizes, and the answer with its uncertainty."""
    made, ((ax,),) = panels(1, 1, 2.7)
    scene = gr.scenes.hopper(
        angle_deg=45.0, orifice=0.16, width=0.48, fill_height=0.48, cell=0.012, jitter=0.1,
        opens_at=0.0, duration=0.5, E=1e6,
    )  # fmt: skip
    budget = 1e-3 if quick else 60.0
    answer = gr.economy.answer(scene, "discharge", tolerance=0.05, budget=budget, progress=False)
    given = scene.material.E
    for E, color, label in ((given, BLUE, "E as given"), (None, ORANGE, "another E")):
        runs = [s for s in answer.samples if (s.E == given) == (E == given)]
        cells, values = zip(*((1e3 * s.cell, s.value) for s in runs), strict=True)
        ax.plot(cells, values, "o", color=color, label=f"runs, {label}")
    ax.errorbar(
        0.0, answer.value, answer.uncertainty, fmt="s", color=GREY, capsize=4, label="answer, 95 %"
    )
    ax.set(xlabel="size of the cells [mm]", ylabel="rate [kg/(s m)]")
    ax.legend()
    return made


def ranks(quick: bool) -> Picture:
    """Points of four ranks at the start of a collapse, and after blocks have changed hands."""
    made, axes = panels(1, 2, 1.9, sharey=True)
    cell = 0.04 if quick else 0.01
    scene = gr.scenes.column_collapse(aspect=1.5, E=1e6, cell=cell, points_per_cell=4)
    with gr.ranks.threads(4) as comm:
        sim = gr.Simulation(scene, comm=comm)
        for ax, time in zip(axes.flat, (0.0, 0.5), strict=True):
            if time:
                sim.run(until=time)
                sim.balance(1.0)
            for x, color in zip(
                sim.on_each_rank(positions), (BLUE, ORANGE, GREEN, RED), strict=True
            ):
                ax.plot(*x.T, ".", color=color, markersize=2.2)
            ax.set(title=f"t = {time:g} s", xlabel="x [m]", aspect="equal", xlim=(0.0, 0.75))
    tell(sim)
    axes[0, 0].set(ylabel="y [m]", ylim=(0.0, 0.32))
    return made


def positions(state: gr.State) -> np.ndarray:
    return state.x


PAGES: dict[str, Callable[[bool], Figure]] = {
    made.__name__: made
    for made in (
        *(walls, fill_regions, own_material, choose_a_scheme, choose_a_stiffness, scale_a_model),
        *(
            couple_with_another_program,
            scene_files,
            shear_cell,
            own_scene,
            read_the_verdict,
            watch_a_run,
            restart,
        ),
        *(calibrate_friction, sweep, ranks, paraview, error_bar, dem_runs, meshes),
        *(arching, wall_pressure, tools_in_soil, slope_stability, walls_and_footings, erodible_bed),
    )
}


def main(argv: list[str] | None = None) -> None:
    draw_pages(__doc__, argv, PAGES, "guide_")

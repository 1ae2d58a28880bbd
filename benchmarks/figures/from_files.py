"""Pictures of the guides to data from files, which `guides.py` makes: dumps of DEM runs, meshes."""

from __future__ import annotations

from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

import granular as gr
from figures.common import BLUE, GREY, ORANGE, WEIGHT, panels, tell
from granular.grain_scale.dem.process import execute
from granular.plot import Picture

COLLAPSE = """
units si
atom_style sphere
boundary f p f
newton off
comm_modify vel yes
region box block 0 0.4 0 0.012 0 0.14
create_box 1 box
{grains}
set group all diameter 0.004
set group all density 2500
pair_style gran/hooke/history 2000 NULL 800 NULL 0.5 1
pair_coeff * *
fix walls all wall/gran hooke/history 2000 NULL 800 NULL 0.5 1 zplane 0 0.14
fix sides all wall/gran hooke/history 2000 NULL 800 NULL 0.5 1 xplane 0 0.4
fix weight all gravity 9.81 vector 0 0 -1
fix move all nve/sphere
timestep 1e-5
dump d all custom {every} grains.dump id x y z vx vy vz radius mass
dump_modify d units yes time yes sort id
run {steps}
"""
"""A column of grains between x = 0 and 0.4 m, for LAMMPS."""


def grains_that_collapse(folder: Path, quick: bool) -> gr.grain_scale.Dump:
    """Dump of a column, with a frame each 0.1 s."""
    rng, per_second = np.random.default_rng(0), 100_000
    places = np.indices((22, 3, 12 if quick else 24)).reshape(3, -1).T * 0.004 + 0.002
    places = places + rng.uniform(-1e-4, 1e-4, places.shape)
    grains = "\n".join(f"create_atoms 1 single {x:.9g} {y:.9g} {z:.9g}" for x, y, z in places)
    text = COLLAPSE.format(grains=grains, every=per_second // 10, steps=per_second // 5)
    (folder / "in.lammps").write_text(text)
    execute(folder, command=None, timeout=300.0)
    return gr.grain_scale.read_dump(folder / "grains.dump")


def dem_runs(quick: bool) -> Picture:
    """Grains, their averages, and a continuum that goes on from them."""
    made, axes = panels(3, 1, 5.3, sharex=True)
    grid = gr.Grid((0.0, 0.0), 0.008, (50, 18))
    with TemporaryDirectory() as name:
        dump = grains_that_collapse(Path(name), quick)
        first, last = dump[1], dump[2]
        average = gr.grain_scale.average_grains(first, grid, axes="xz")
    limits = {"vmin": 0.0, "vmax": 0.8, "cmap": "viridis"}
    x, speed = first.x, np.linalg.norm(first.v, axis=1)
    axes[0, 0].scatter(x[:, 0], x[:, 2], 9, speed, **limits)
    axes[0, 0].set_title(f"speed of the grains at {first.time:.1f} s [m/s]")
    mean = np.linalg.norm(average.velocity, axis=-1).T
    mesh = axes[1, 0].pcolormesh(*average.axes, mean, **limits)
    axes[1, 0].set_title("their average over cells")
    scene = gr.Scene(
        name="goes on",
        grid=grid,
        fills=[gr.Fill(first.cloud(0.6, axes="xz"), 4)],
        material=gr.MuI(E=1e5, rho_c=1500.0),
        walls=[gr.Wall(axis=1, at=0.0), gr.Wall(axis=0, at=0.0, kind="free_slip")],
        gravity=WEIGHT,
        duration=last.time - first.time,
    )
    state = tell(gr.Simulation(scene).run()).state
    axes[2, 0].scatter(last.x[:, 0], last.x[:, 2], 9, GREY, alpha=0.3)
    axes[2, 0].scatter(*state.x.T, 4, np.linalg.norm(state.v, axis=1), **limits)
    axes[2, 0].set_title(f"a continuum from there, and the grains (grey), at {last.time:.1f} s")
    for ax in axes.flat:
        ax.set(aspect="equal", xlim=(0.0, 0.3), ylim=(0.0, 0.11), ylabel="z [m]")
    axes[2, 0].set_xlabel("x [m]")
    made.colorbar(mesh, ax=axes, shrink=0.6, label="speed [m/s]")
    return made


LUGS = 10


def wheel_of_shells() -> tuple[list[np.ndarray], np.ndarray, np.ndarray]:
    """Corners of the closed shells of a hub and its lugs [m], and the triangles of the two."""
    turns = np.linspace(0.0, 2 * np.pi, 48, endpoint=False)
    ring = 0.1 * np.stack([np.cos(turns), np.sin(turns)], axis=1)
    ends = [np.column_stack([ring, np.full(48, z)]) for z in (-0.05, 0.05)]
    hub = np.concatenate([*ends, [(0.0, 0.0, -0.05), (0.0, 0.0, 0.05)]])
    k = np.arange(48)
    after = (k + 1) % 48
    sides = [(k, after, after + 48), (k, after + 48, k + 48)]
    caps = [(after, k, np.full(48, 96)), (k + 48, after + 48, np.full(48, 97))]
    round_faces = np.concatenate([np.stack(side, axis=1) for side in (*sides, *caps)])
    corners = np.array([(x, y, z) for z in (-1, 1) for y in (-1, 1) for x in (-1, 1)])
    quads = [(0, 2, 3, 1), (4, 5, 7, 6), (0, 1, 5, 4), (2, 6, 7, 3), (0, 4, 6, 2), (1, 3, 7, 5)]
    box_faces = np.array([face for a, b, c, d in quads for face in ((a, b, c), (a, c, d))])
    lugs = []
    for turn in 2 * np.pi * np.arange(LUGS) / LUGS:
        c, s = np.cos(turn), np.sin(turn)
        box = corners * (0.025, 0.008, 0.055) + (0.105, 0.0, 0.0)
        lugs.append(box @ np.array([(c, s, 0.0), (-s, c, 0.0), (0.0, 0.0, 1.0)]))
    return [hub, *lugs], round_faces, box_faces


def meshes(quick: bool) -> Picture:
    """A wheel as CAD gives it, in closed shells that overlap, and the distance from their union."""
    made, ((plan, section),) = panels(1, 2, 3.1, sharex=True, sharey=True)
    shells, round_faces, box_faces = wheel_of_shells()
    faces = [round_faces, *[box_faces] * LUGS]
    for corners, triangles, colour in zip(shells, faces, [GREY, *[ORANGE] * LUGS], strict=True):
        x, y, _ = 1e3 * corners.T
        plan.triplot(x, y, triangles, color=colour, lw=0.8)
    plan.set(aspect="equal", xlabel="x [mm]", ylabel="y [mm]")
    plan.set_title(f"{1 + LUGS} closed shells that overlap")
    begin = np.cumsum([0, *map(len, shells)])
    joined = np.concatenate([part + first for part, first in zip(faces, begin, strict=False)])
    wheel = gr.shapes.Mesh(np.concatenate(shells), joined, spacing=0.006 if quick else 0.003)
    line = np.linspace(-0.16, 0.16, 321)
    x, y = np.meshgrid(line, line)
    phi = wheel.distance(np.column_stack([x.ravel(), y.ravel(), np.zeros(x.size)]))[0]
    phi = 1e3 * phi.reshape(x.shape)
    bands = section.contourf(
        1e3 * x, 1e3 * y, phi, np.linspace(-15, 15, 13), cmap="RdBu", extend="both"
    )
    section.contour(1e3 * x, 1e3 * y, phi, [0.0], colors=BLUE)
    section.set(aspect="equal", xlabel="x [mm]")
    section.set_title("signed distance from their union [mm]")
    made.colorbar(bands, ax=section)
    return made

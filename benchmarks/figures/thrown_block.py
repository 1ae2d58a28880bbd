"""A block that is thrown into a bed and turns, for docs/how-to/free_bodies.md.

The whole takes some seconds.
"""

from __future__ import annotations

from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
from beds import bed
from numpy.typing import NDArray

import granular as gr
from figures.common import tell
from granular.plot import Picture


def thrown(quick: bool) -> gr.Scene:
    """A block above a bed, which moves and turns freely."""
    cell = 0.02 if quick else 0.01
    shape = gr.shapes.Box(size=(0.2, 0.1))
    whole = gr.bodies.mass_properties(shape, density=2500.0)
    block = gr.Body(
        shape,
        (0.4, 0.34),
        rotation_deg=20.0,
        motion=gr.Motion(velocity=((1.0, -2.0),), angular_velocity=(-5.0,)),
        friction=0.4,
        free="xy",
        mass=whole.mass,
        inertia=whole.inertia,
    )
    rise = round(0.3 / cell)
    return bed("block", (1.2, 0.2), cell, rise, bodies=[block], duration=0.6)


def draw_motion(
    axes: NDArray, motion: gr.measure.BodyMotion, force: gr.measure.MeanForce, weight: float
) -> None:
    """Draw the path, the angle and the force of the block."""
    across, up = motion.position.T
    axes[0].plot(motion.times, across - across[0], label="across")
    axes[0].plot(motion.times, up - up[0], label="up")
    axes[0].set(xlabel="time [s]", ylabel="way of the centre [m]")
    turn = np.unwrap(2 * np.arctan2(motion.quaternion[:, 3], motion.quaternion[:, 0]))
    axes[1].plot(motion.times, np.degrees(turn))
    axes[1].set(xlabel="time [s]", ylabel="angle [degrees]")
    axes[2].plot(force.times, force.force[:, 1] / weight, label="up")
    axes[2].plot(force.times, force.force[:, 0] / weight, label="across")
    axes[2].set(xlabel="time [s]", ylabel="force over weight")
    for ax in (axes[0], axes[2]):
        ax.legend()


def picture(quick: bool) -> Picture:
    """Draw the picture of the page."""
    made = Picture(figsize=(7.0, 3.6), layout="compressed")
    axes = made.subplots(2, 3)
    scene = thrown(quick)
    sim = gr.Simulation(scene)
    with TemporaryDirectory() as folder:
        path = Path(folder, "block.h5")
        tell(sim.run(until=0.1 if quick else 0.6, save=path, every=0.01))
        record = gr.open(path)
        frames = (0, len(record) // 4, len(record) - 1)
        for ax, k in zip(axes[0], frames, strict=True):
            title = f"t = {record[k].time:.2f} s"
            common = {"limits": (0, 1), "extent": ((0.2, 1.0), (0.0, 0.5)), "bar": k == frames[-1]}
            gr.plot.frame(record[k], "speed", ax=ax, title=title, **common)
        motion = gr.measure.body_motion(record, body=0)
        force = gr.measure.body_force(record, body=0, window=2)
    draw_motion(axes[1], motion, force, 9.8 * scene.bodies[0].mass)
    return made

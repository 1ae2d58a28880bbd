"""A bed that was pushed, with three restitutions, for docs/how-to/damp_waves.md.

The whole takes some seconds.
"""

from __future__ import annotations

import numpy as np

import granular as gr
from granular.plot import Picture

HEIGHT, SPEED = 0.2, 1e-3
WAVENUMBER = np.pi / (2 * HEIGHT)
COLOURS = {1.0: "#8a8f98", 0.5: "#0072b2", 0.1: "#e69f00"}


def bed(restitution: float, cells: int) -> gr.Scene:
    """A bed under its weight on a floor."""
    cell = HEIGHT / cells
    return gr.Scene(
        name="bed",
        grid=gr.Grid((0.0, 0.0), cell, (4, cells + 6), periodic=(True, False)),
        fills=(gr.Fill(gr.Box((0.0, 0.0), (4 * cell, HEIGHT)), 4, lithostatic=True),),
        material=gr.MuI(E=1e6, restitution=restitution, contact_diameter=4e-3),
        walls=(gr.Wall(1, 0.0),),
        gravity=gr.Gravity((0.0,), ((0.0, -9.8),)),
        duration=0.5,
    )


def ring(scene: gr.Scene) -> tuple[np.ndarray, np.ndarray]:
    """Times [s], and the velocity of the surface [m/s] in the slowest oscillation of the bed."""
    sim = gr.Simulation(scene)
    used = sim.buffers["id"] >= 0
    sim.buffers["v"][1, used] = -SPEED * np.sin(WAVENUMBER * sim.buffers["x"][1, used])
    times, velocities = [], []
    while sim.time < scene.duration:
        sim.step(4)
        shape = np.sin(WAVENUMBER * sim.buffers["x"][1, used])
        times.append(sim.time)
        velocities.append(2 * np.mean(sim.buffers["v"][1, used] * shape))
    return np.array(times), np.array(velocities)


def picture(quick: bool) -> Picture:
    """Draw the picture of the page."""
    picture = Picture(figsize=(7.0, 2.6), layout="constrained")
    ax = picture.subplots()
    for restitution, colour in COLOURS.items():
        scene = bed(restitution, 10 if quick else 20)
        times, velocities = ring(scene)
        ax.plot(times, 1e3 * velocities, color=colour, lw=1, label=f"restitution {restitution}")
        rate = gr.theory.wave_decay(
            wavenumber=WAVENUMBER,
            wave_speed=scene.material.wave_speed,
            damping_time=scene.material.damping_time,
        )
        if rate:
            ax.plot(times, 1e3 * SPEED * np.exp(-rate * times), color=colour, ls="--", lw=1.5)
    ax.set(xlabel="time [s]", ylabel="velocity of the surface [mm/s]")
    ax.legend(loc="center left", bbox_to_anchor=(1.0, 0.5))
    return picture

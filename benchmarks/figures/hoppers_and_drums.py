"""Hoppers and drums compared with references: hopper.png, rotating_drum.png of docs/pictures/."""

from __future__ import annotations

import math

import numpy as np

import granular as gr
from figures.common import parser_of, save, tell
from granular import plot

ANGLES = (10.0, 15.0, 20.0, 25.0, 30.0, 40.0, 50.0, 60.0)
FRICTIONS = (0.1, 0.3, 0.5)
ORIFICE, WIDTH = 0.1, 0.4
OMEGAS = (0.25, 0.5, 1.0, 2.0, 4.0)


def emptied(angle: float, friction: float, cell: float) -> tuple[gr.State, float, float]:
    """Last state of a hopper, its rate of discharge, and its least index of mass flow."""
    scene = gr.scenes.hopper(
        angle_deg=angle,
        orifice=ORIFICE,
        width=WIDTH,
        fill_height=0.6,
        friction=friction,
        cell=cell,
        opens_at=0.0,
        E=1e6,
        mu_s=0.5,
    )
    sim, states, mass = gr.Simulation(scene), [], []
    for time in np.linspace(0.25, 0.45, 11):
        sim.run(until=float(time))
        states.append(sim.state)
        mass.append(2 * sim.state.mass[sim.state.x[:, 1] > 0].sum())
    tell(sim)
    flow = gr.measure.hopper_flow(states)
    top = min((WIDTH - ORIFICE) / 2 / math.tan(math.radians(angle)), 0.3)
    rate = -np.polyfit([state.time for state in states], mass, 1)[0]
    return (
        states[-1],
        rate,
        float(np.nanmin(flow.index[(flow.z > 0.25 * ORIFICE) & (flow.z < top)])),
    )


def hoppers(cell: float) -> plot.Picture:
    """Speed in two hoppers; index of mass flow and rate against the half angle."""
    runs = {(a, f): emptied(a, f, cell) for f in FRICTIONS for a in ANGLES}
    picture = plot.Picture(figsize=(7.0, 3.0), layout="constrained")
    axes = picture.subplots(1, 4, width_ratios=(0.6, 0.85, 1.3, 1.3))
    for ax, angle in zip(axes, (15.0, 40.0), strict=False):
        options = {"extent": ((0.0, 0.22), (-0.04, 0.55)), "title": f"{angle:g} deg"}
        state = runs[angle, 0.5][0]
        plot.frame(state, "speed", ax=ax, limits=(0.0, 1.0), bar=angle > 15.0, **options)
    effective = gr.theory.earth_pressure(0.5).coaxial_deg
    flat = gr.theory.rose_tanaka_factor(ANGLES, 45.0)
    for k, friction in enumerate(FRICTIONS):
        colour = f"C{k}"
        indices, rates = ([runs[a, friction][i] for a in ANGLES] for i in (2, 1))
        axes[2].plot(ANGLES, indices, "o-", color=colour, label=f"friction {friction:g}")
        limit = gr.theory.mass_flow_limit(math.degrees(math.atan(friction)), effective)
        axes[2].axvline(limit, color=colour, linestyle=":", label=f"limit of theory, {friction:g}")
        scaled = np.array(rates) / (1500.0 * math.sqrt(9.8) * ORIFICE**1.5)
        axes[3].plot(ANGLES, scaled, "o-", color=colour)
        print(friction, "limit", round(limit, 1), np.round(indices, 3), np.round(scaled, 3))
    level = np.exp(np.mean(np.log(scaled / flat)))  # the reference says how it falls, not how much
    axes[3].plot(ANGLES, level * flat, "k--", label="Rose & Tanaka, 45 deg")
    axes[2].axhline(0.3, color="0.6", linewidth=0.8)
    axes[2].text(60.0, 0.32, "mass flow above", color="0.4", ha="right", va="bottom")
    axes[2].set(xlabel="half angle [deg]", ylabel="least index of mass flow", ylim=(0, 1))
    axes[3].set(
        xlabel="half angle [deg]", ylabel=r"rate / ($\rho\, \sqrt{g}\, D^{1.5}$)", ylim=(0, None)
    )
    lines = [part for ax in axes[2:] for part in zip(*ax.get_legend_handles_labels(), strict=True)]
    picture.legend(*zip(*lines, strict=True), loc="outside lower center", ncols=4)
    return picture


def turned(omega: float, cell: float) -> list[gr.State]:
    """States of a drum in its flow, after a turn of a radian or more, over half a radian."""
    sim, states = gr.Simulation(gr.scenes.rotating_drum(omega=omega, cell=cell, E=2e5)), []
    for time in np.linspace(1.0, 1.5, 26) / omega + 0.5:
        sim.run(until=float(time))
        states.append(sim.state)
    tell(sim)
    return states


def drums(cell: float) -> plot.Picture:
    """Speed in a drum; its slope against the Froude number; flux along the surface."""
    picture = plot.Picture(figsize=(7.0, 2.2), layout="constrained")
    axes = picture.subplots(1, 3)
    slopes, froude = [], []
    for omega in OMEGAS:
        states = turned(omega, cell)
        flow = gr.measure.drum_flow(states)
        scene = states[0].scene
        slopes.append(flow.slope_deg)
        froude.append(scene.parameters["froude"])
        if omega == 1.0:
            title = "speed, omega = 1 rad/s"
            extent = ((-0.105, 0.105), (-0.105, 0.105))
            options = {"title": title, "limits": (0.0, 0.3), "extent": extent}
            plot.frame(states[-1], "speed", ax=axes[0], **options)
            R = scene.parameters["radius"]
            axes[2].plot(flow.s, flow.flux, "o", label="run")
            axes[2].plot(flow.s, flow.balance, "k-", label="balance")
            axes[2].plot(flow.s, 0.5 * omega * (R**2 - flow.s**2), "k:", label="thin layer")
        middle = abs(flow.s) < 0.06
        ratio = (flow.flux / flow.balance)[middle]
        thick, speed = flow.thickness[middle].mean(), flow.speed[middle].mean()
        print(omega, f"Fr {froude[-1]:.3g} slope {slopes[-1]:.2f} +- {flow.slope_spread_deg:.2f}")
        print(f"  flux/balance {ratio.mean():.3f} +- {ratio.std():.3f} d {thick:.4f} u {speed:.4f}")
    axes[1].semilogx(froude, slopes, "o-")
    for mu, text in (
        (scene.material.mu_s, r"$\arctan\ \mu_s$"),
        (scene.material.mu_2, r"$\arctan\ \mu_2$"),
    ):
        axes[1].axhline(math.degrees(math.atan(mu)), color="k", linestyle=":")
        axes[1].text(froude[0], math.degrees(math.atan(mu)) + 0.4, text, va="bottom")
    axes[1].set(xlabel=r"Froude number $\omega^2 R/g$", ylabel="slope of the surface [deg]")
    axes[2].set(xlabel="position along the surface [m]", ylabel="flux [m$^2$/s]")
    axes[2].locator_params(axis="x", nbins=5)
    axes[2].legend(loc="lower center", handlelength=1.0)
    return picture


def main(argv: list[str] | None = None) -> None:
    chosen = parser_of(__doc__).parse_args(argv)
    save(drums(0.02 if chosen.quick else 0.005), chosen, "rotating_drum")
    save(hoppers(0.025 if chosen.quick else 0.0125), chosen, "hopper")

"""Growth of short waves in a flow of uniform shear: mu(I), its regularised form, and theory.

A box of uniform shear between two plates, periodic along them, gets a small wave: the one that
grows fastest by `granular.theory.shear_waves`, or decays slowest. Its amplitude is the amplitude of
the velocity along the wave fronts, weighed with a window across the box, with the wave vector that
the shear turns. The rate is the slope of its logarithm over the last two thirds of the run, and the
rate of theory is the mean of the rates of the wave vectors on the way. The scheme has quadratic
B-splines, FLIP and the density of each point: nothing in it damps waves but the grid.

It takes some minutes.
"""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from shared import markdown, parser_of, write

import granular as gr
from granular.plot import Picture
from granular.theory import shear_wave_growth, shear_waves

PLAIN = gr.MuI(E=1e6, mu_s=0.3819, mu_2=0.6435, I0=0.279, d=0.16)
REGULARISED = gr.RegularisedMuI(E=1e6, d=0.16)
PRESSURE = 1000.0
SLOW, FAST = 0.01, 3.0
ANGLE = {SLOW: 85.0, FAST: 79.0}
"""Inertial numbers at which mu(I) is ill posed, and angles of the wave vectors from the flow."""
AMPLITUDE, WAVES, GAIN = 1e-3, 3, 2.5
"""Velocity of the wave over the velocity of the shear of its length, wave lengths across the box,
and logarithm of its growth or decay by theory in the run."""
UNDAMPED = gr.Scheme(basis="quadratic", transfer="flip", density=gr.ParticleDensity())


class Growth(NamedTuple):
    """Times, amplitudes over the first one, and rates by the run and by theory [1/s]."""

    times: np.ndarray
    amplitudes: np.ndarray
    measured: float
    theory: float


def sheared(
    material: Any, wave_length: float, cells: int, number: float, scheme: gr.Scheme
) -> tuple[gr.Scene, np.ndarray, float]:
    """Return the box of shear, the wave vector that fits into it, and the shear rate [1/s]."""
    dx = wave_length / cells
    along = round(cells / math.cos(math.radians(ANGLE[number])))
    k = np.array([2 * math.pi / (along * dx), 0.0])
    k[1] = math.sqrt((2 * math.pi / wave_length) ** 2 - k[0] ** 2)
    rate = number / material.d * math.sqrt(PRESSURE / material.rho_s)
    size = (along * dx, WAVES * wave_length)
    half = 0.5 * rate * size[1]
    scene = gr.Scene(
        name="sheared",
        grid=gr.Grid((0.0, 0.0), dx, (along, WAVES * cells), periodic=(True, False)),
        fills=[gr.Fill(gr.Box((0.0, 0.0), size), 4)],
        material=material,
        walls=[gr.Wall(1, 0.0, velocity=(-half, 0.0)), gr.Wall(1, size[1], velocity=(half, 0.0))],
        scheme=scheme,
        gravity=gr.Gravity((0.0,), ((0.0, 0.0),)),
        duration=100.0,
    )
    return scene, k, rate


def window(scene: gr.Scene, y: np.ndarray) -> np.ndarray:
    """Weight across the box, zero at the plates."""
    return np.sin(math.pi * y / scene.grid.upper[1]) ** 2


def disturb(sim: gr.Simulation, k: np.ndarray, rate: float, number: float, length: float) -> None:
    """Give the points the flow at a steady stress, and the wave."""
    scene, b = sim.scene, sim.buffers
    m, used = scene.material, b["id"] >= 0
    _, shapes = shear_waves(
        material=m, inertial_number=number, pressure=PRESSURE, wave_vector=tuple(k)
    )
    shape = shapes[:, 0] / abs(shapes[0, 0]) * AMPLITUDE * rate * length
    x = b["x"][:, used]
    phase, weight = np.exp(1j * (k @ x)), window(scene, x[1])
    v_x, v_y, s_xx, s_yy, s_xy, c = (weight * (part * phase).real for part in shape)
    regular = isinstance(m, gr.RegularisedMuI)
    scaled = number / m.I0
    mu = m.friction(number) if regular else m.mu_s + (m.mu_2 - m.mu_s) * scaled / (1 + scaled)
    c += PRESSURE / m.K
    b["v"][0, used] = rate * (x[1] - 0.5 * scene.grid.upper[1]) + v_x
    b["v"][1, used] = v_y
    b["log_density"][0, used] = c
    for row, deviator in enumerate((s_xx, s_yy, -s_xx - s_yy)):
        b["stress"][row, used] = deviator - m.K * c
    b["stress"][3, used] = mu * PRESSURE + s_xy


def amplitude(state: gr.State, k: np.ndarray, rate: float) -> float:
    """Amplitude of the velocity along the fronts of the wave [m/s]."""
    turned = k - [0.0, rate * state.time * k[0]]
    front = np.array([-turned[1], turned[0]]) / np.linalg.norm(turned)
    v = state.v - np.outer(state.x[:, 1] - 0.5 * state.scene.grid.upper[1], (rate, 0.0))
    phase = np.exp(-1j * (state.x @ turned))
    return float(abs(np.mean(window(state.scene, state.x[:, 1]) * (v @ front) * phase)))


def growth(
    material: Any,
    wave_length: float,
    cells: int,
    *,
    number: float = SLOW,
    scheme: gr.Scheme = UNDAMPED,
) -> Growth:
    """Run a wave, and return its growth."""
    scene, k, rate = sheared(material, wave_length, cells, number, scheme)
    given = {"material": material, "inertial_number": number, "pressure": PRESSURE}

    def by_theory(time: float) -> float:
        turned = (float(k[0]), float(k[1] - rate * time * k[0]))
        return shear_wave_growth(wave_vector=turned, **given)

    end = GAIN / max(abs(by_theory(0.0)), 1.0)
    sim = gr.Simulation(scene, threads=1)
    disturb(sim, k, rate, number, wave_length)
    times, amplitudes = [], []
    while sim.time < end:
        times.append(sim.time)
        amplitudes.append(amplitude(sim.state, k, rate))
        sim.step(max(int(end / 60 / (0.5 * scene.grid.cell / material.wave_speed)), 1))
    t, a = np.array(times), np.array(amplitudes)
    late = t > end / 3
    theory = np.mean([by_theory(time) for time in t[late]])
    return Growth(t, a / a[0], float(np.polyfit(t[late], np.log(a[late]), 1)[0]), float(theory))


def rows(quick: bool) -> list[tuple[str, ...]]:
    """Rows of the table."""
    lines = []
    for number in (SLOW, FAST):
        lengths = (1.0, 0.5, 0.25) if number == SLOW else (0.125, 0.0625)
        for length in lengths[:1] if quick else lengths:
            row = [f"{number:g}", f"{length:g}"]
            for material in (PLAIN, REGULARISED):
                runs = [growth(material, length, n, number=number) for n in (8, 16)[: 2 - quick]]
                row += [f"{runs[0].theory:.3g}", ", ".join(f"{run.measured:.3g}" for run in runs)]
                print(*row, flush=True)
            lines.append(tuple(row))
    return lines


def tables(results: dict[str, Any]) -> dict[str, list[str]]:
    """Table of the page."""
    head = (
        "I",
        "wave length, m",
        "mu(I): theory, 1/s",
        "measured",
        "regularised: theory",
        "measured",
    )
    return {"short waves": markdown(head, results["rows"])}


def draw(quick: bool) -> Picture:
    """Amplitudes of waves of three lengths with both laws, and of theory."""
    picture = Picture(figsize=(7.0, 2.6), layout="constrained")
    colours = {1.0: "#0072b2", 0.5: "#e69f00", 0.25: "#009e73"}
    axes = picture.subplots(1, 2)
    for ax, (name, material) in zip(
        axes, (("mu(I)", PLAIN), ("regularised", REGULARISED)), strict=True
    ):
        for length, colour in colours.items():
            run = growth(material, length, 8 if quick else 16)
            ax.plot(run.times, run.amplitudes, color=colour, label=f"wave length {length:g} m")
            middle = len(run.times) // 3
            by_theory = np.exp(run.theory * (run.times - run.times[middle]))
            ax.plot(run.times, run.amplitudes[middle] * by_theory, color=colour, ls="--", lw=1)
        ax.set(xlabel="time [s]", yscale="log", title=f"{name}, I = {SLOW:g}")
    axes[0].set_ylabel("amplitude over the first")
    axes[0].legend()
    return picture


def main(argv: list[str] | None = None) -> None:
    """Measure the rates, and draw the picture."""
    parser = parser_of(__name__, __doc__)
    parser.add_argument("--to", type=Path, help="draw the picture")
    chosen = parser.parse_args(argv)
    if chosen.to:
        draw(chosen.quick).savefig(chosen.to)
    write(chosen.out, {"rows": rows(chosen.quick)})

"""Figure 5: mass left in silos, and the rate of discharge against the orifice."""

import numpy as np

import granular as gr
from figures.common import frames, options, save
from granular import plot


def _left(state: gr.State) -> tuple[float, float]:
    """Time [s] and remaining mass [kg/m]."""
    return state.time, float(state.mass.sum())


def main(argv: list[str] | None = None) -> None:
    # Five minutes; 1e7 takes three times as long.
    chosen = options(__doc__, argv, E=1e6)
    orifices = (0.12, 0.16, 0.20) if chosen.quick else np.arange(6, 21, 2) / 100
    cell, histories = 0.02 if chosen.quick else 0.01, {}
    for orifice in orifices:
        scene = gr.scenes.silo(orifice=float(orifice), cell=cell, **chosen.settings)
        # Long enough for 600 kg to leave at two thirds of the rate of the paper.
        rate = gr.theory.beverloo_rate(orifice, chosen.material.rho_c, gravity=9.8)
        until = min(scene.duration, 0.5 + 600 / (0.67 * float(rate)))
        name = f"D = {orifice:g} m"
        times, mass = np.array(frames(scene, until, 1 / 60, _left, chosen, name=name)).T
        histories[float(orifice)] = gr.measure.MassHistory(times, 2 * mass, 0.5)
    rates = [gr.measure.discharge(history).rate for history in histories.values()]
    unit = {"rho": chosen.material.rho_c, "gravity": 9.8}
    fit = gr.measure.beverloo(list(histories), rates, **unit)
    shown = {d: h for d, h in histories.items() if chosen.quick or round(100 * d) % 4 == 2}
    save(plot.dunatunga_kamrin_2015.figure_5(shown, fit, **unit), chosen, "figure_5")

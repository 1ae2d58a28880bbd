"""Figure 13: the stress update along the path of appendix B against Runge-Kutta."""

import numpy as np

import granular as gr
from figures.common import RUN, options, save
from granular import plot
from granular.verify.constitutive import DURATION, STEPS, constitutive_path

P0 = 500.0
"""Pressure at the start [Pa]."""
APPENDIX_E = 1e4
"""Young's modulus of appendix B [Pa]."""


def _path(material: gr.materials.MuI, dt: float) -> plot.dunatunga_kamrin_2015.ConstitutivePath:
    times, stress = constitutive_path(material, P0, dt)
    p = -stress[:, :3].sum(axis=1) / 3
    deviator = stress[:, :3] + p[:, None]
    tau = np.sqrt((deviator**2).sum(axis=1) / 2 + stress[:, 3] ** 2)
    return plot.dunatunga_kamrin_2015.ConstitutivePath(
        dt, times, stress, gr.theory.plastic_shear_rate(p, tau, material)
    )


def main(argv: list[str] | None = None) -> None:
    chosen = options(__doc__, argv, E=APPENDIX_E, quick_E=APPENDIX_E, without=RUN)
    paths = [_path(chosen.material, dt) for dt in (STEPS[:3] if chosen.quick else STEPS)]
    finest = min(paths, key=lambda path: path.dt)
    times = np.linspace(0.0, DURATION, len(finest.times))
    exact = gr.theory.reference(chosen.material, P0, times)
    save(plot.dunatunga_kamrin_2015.figure_13(paths, exact), chosen, "figure_13")

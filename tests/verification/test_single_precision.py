"""Kernels in single precision against those in double precision, and against theory."""

import numpy as np
import pytest

import granular as gr

MATERIAL = gr.materials.glass_beads.replace(E=1e6)
SCHEMES = {
    "default": gr.schemes.default,
    "cell_averaged": gr.schemes.cell_averaged,
    "apic": gr.Scheme(transfer="apic"),
    "flip": gr.Scheme(transfer="flip"),
    "linear": gr.Scheme(basis="linear"),
}


def in_single(scheme: gr.Scheme) -> gr.Scheme:
    return scheme.replace(precision="single")


def column(scheme: gr.Scheme, dim: int = 2) -> gr.Scene:
    if dim == 2:
        return gr.scenes.column_collapse(aspect=2.0, cell=0.05, material=MATERIAL, scheme=scheme)
    return gr.scenes.cylinder_collapse(aspect=1.0, cell=0.05, material=MATERIAL, scheme=scheme)


@pytest.mark.parametrize("name", SCHEMES)
@pytest.mark.parametrize("dim", [2, 3])
def test_a_step_is_that_in_double_precision(name, dim):
    """Velocities and stresses after a step from a state in motion, to the rounding of a float."""
    scheme = SCHEMES[name]
    start = gr.Simulation(column(scheme, dim), threads=1).run(until=0.1, monitor=False)
    states = []
    for chosen in (scheme, in_single(scheme)):
        scene = column(chosen, dim)
        sim = gr.Simulation.from_checkpoint(scene, start.checkpoint().replace(scene=scene))
        sim.step(1)
        states.append(sim.state)
    double, single = states
    speed, stress = np.abs(double.v).max(), np.abs(double.stress).max()
    # a float has 24 bits; sums over some dozen terms, and stresses that cancel
    assert np.abs(single.v - double.v).max() < 100 * 2**-24 * speed
    assert np.abs(single.x - double.x).max() < 100 * 2**-24 * speed * 1e-3
    assert np.abs(single.stress - double.stress).max() < 1e4 * 2**-24 * stress

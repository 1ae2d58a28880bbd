"""Ends of the grid without a wall, which stop points and do nothing else."""

import numpy as np
import pytest
from scenes_by_hand import scene_with

import granular as gr

CELL = 1 / 64
SCHEMES = [
    gr.Scheme(),
    gr.Scheme(transfer="apic", density=gr.ParticleDensity()),
    gr.Scheme(transfer="flip", density=gr.ParticleDensity()),
    gr.Scheme(basis="linear", transfer="flip", density=gr.ParticleDensity()),
]


def fastest(scheme, sign, cells, shift):
    """Largest speed of a slightly compressed column of points at an end, over the elastic one."""
    low, high = sorted((0.0, sign * cells * CELL))
    end = shift + (high if sign > 0 else low)
    places = np.column_stack([np.full(8, end), (np.arange(8) + 0.5) * CELL / 2])
    material = gr.MuI(E=1e6)
    cloud = gr.Cloud(places, np.full(8, CELL**2 / 4), density=np.full(8, 1500 * 1.001))
    scene = scene_with(
        grid=gr.Grid((low + shift, 0.0), CELL, (cells, 12)),
        fills=(gr.Fill(cloud, 4),),
        material=material,
        scheme=scheme,
        gravity=0.0,
    )
    sim = gr.Simulation(scene, threads=1)
    largest = 0.0
    for _ in range(20):
        sim.step(1)
        largest = max(largest, sim.state.speed.max())
    assert np.abs(sim.state.log_density).max() < 0.1
    return largest / (1e-3 * material.wave_speed)


@pytest.mark.parametrize("scheme", SCHEMES, ids=lambda s: f"{s.basis}-{s.transfer}")
def test_points_at_an_end_are_not_thrown(scheme):
    """At the upper end they lie within the rounding of its coordinate, far from the origin most.

    Their share at the node before it was a mass that moved, with a whole part of their forces.
    """
    for sign in (-1, 1):
        for cells, shift in ((24, 0.0), (400, 0.0), (96, 1e4 * CELL), (96, 1e6 * CELL)):
            assert fastest(scheme, sign, cells, shift) < 3

"""Sponge layers damp upward motion in them, and nothing else."""

import math

import numpy as np
import pytest
from schemes_by_name import scheme_of

import granular as gr
from granular.geometry import Box, Fill, Grid
from granular.gravity import Gravity
from granular.mpm.walls import SpongeLayer

SCHEMES = [
    ("linear", "flip", "particle"),
    ("linear", "tpic", "cell_averaged"),
    ("quadratic", "apic", "particle"),
    ("quadratic", "tpic", "smoothed"),
]


def moved(velocity, sponge, combination, steps=10):
    """A cloud without weight that moves as a whole, in the middle of 8 m by 8 m."""
    basis, transfer, density = combination
    scene = gr.Scene(
        name="cloud",
        grid=Grid((0.0, 0.0), 1.0, (8, 8)),
        fills=(Fill(Box((2.0, 2.0), (6.0, 6.0)), 4, velocity=velocity),),
        material=gr.materials.MuI(E=1e5),
        scheme=scheme_of(basis, transfer, density, dt=1e-3),
        sponge_layers=(sponge,),
        gravity=Gravity((0.0,), ((0.0, 0.0),)),
        duration=1.0,
    )
    sim = gr.Simulation(scene, threads=1)
    sim.step(steps)
    return sim.state


@pytest.mark.parametrize("combination", SCHEMES, ids="-".join)
@pytest.mark.parametrize("axis", [0, 1])
def test_what_rises_slows_down_at_the_rate(combination, axis):
    """The whole cloud lies in the layer, so that each step removes the same fraction."""
    for sign in (1.0, -1.0):
        velocity = tuple(sign * (2.0 if d == axis else 0.5) for d in range(2))
        state = moved(velocity, SpongeLayer(axis, 1.0, damping=30.0), combination)
        left = math.exp(-30.0 * 0.01) if sign > 0 else 1.0
        assert state.v[:, axis] == pytest.approx(2.0 * sign * left, rel=1e-12)
        assert state.v[:, 1 - axis] == pytest.approx(0.5 * sign, rel=1e-12)


def test_at_once_by_default_and_only_above():
    state = moved((0.0, 1.0), SpongeLayer(1, 4.0), SCHEMES[0], steps=1)
    above = state.x[:, 1] >= 4.0
    assert above.any() and not above.all()
    np.testing.assert_array_equal(state.v[above, 1], 0.0)
    assert state.v[~above, 1] == pytest.approx(1.0, rel=1e-12)


@pytest.mark.parametrize("rate", [0.0, -1.0, math.nan])
def test_rate_must_be_positive(rate):
    with pytest.raises(ValueError, match="damping = "):
        SpongeLayer(1, 0.5, rate)

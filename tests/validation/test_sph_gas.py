"""The jet on a bed of section 6.2.2 of Hurley's thesis makes a crater in 75 ms."""

import numpy as np
import pytest

from granular import scenes, sph


def surface(state, middle, half):
    """Mean height [m] of the highest particles in the columns within `half` of `middle`."""
    near = np.abs(state.x[:, 0] - middle) < half
    column = np.round(state.x[near, 0] / state.scene.grid.cell)
    heights = state.x[near, -1]
    return np.mean([heights[column == k].max() for k in np.unique(column)])


@pytest.mark.parametrize("across", [0.0, pytest.param(0.05, marks=pytest.mark.slow)])
def test_jet_digs_a_crater(across):
    scene = scenes.jet_on_bed(spacing=0.0125, across=across)
    simulation = sph.Simulation(scene, threads=2 if across else 1)
    begin = simulation.state
    bulb = []

    def sample(simulation):
        gas = simulation.gas
        height = gas.x[:, -1]
        under = (np.abs(gas.x[:, 0] - 0.25) < 0.03) & (height > 0.05) & (height < 0.2)
        bulb.append(gas.p[under].mean() - 1e5)

    simulation.run(every=0.0075, hooks=(sample,))
    end = simulation.state
    fallen = surface(begin, 0.25, 0.05) - surface(end, 0.25, 0.05)
    beside = surface(begin, 0.02, 0.04) - surface(end, 0.02, 0.04)
    assert fallen - beside > 0.005
    assert max(bulb) > 3000.0  # a region of high pressure below the jet
    outward = (end.v[:, 0] * np.sign(end.x[:, 0] - 0.25))[end.x[:, -1] > 0.22]
    assert outward.max() > 0.5
    assert end.x[:, -1].max() > 0.265  # sand is thrown up
    assert simulation.counts["dropped"] == 0 and simulation.counts["gas_dropped"] == 0

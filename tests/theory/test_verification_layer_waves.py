"""Waves in a flowing layer: decay, and comparison with the transient of the 1D equation."""

import numpy as np
import pytest

from granular.materials import glass_beads
from granular.theory import bagnold_mean, layer_waves, transient

HEIGHT = 0.2


@pytest.mark.parametrize(("angle_deg", "times"), [(22.0, (12.0, 15.0)), (25.0, (24.0, 30.0))])
def test_long_waves_decay_as_the_transient_does(angle_deg, times):
    """Without slopes along the layer it approaches the steady velocity, at last exponentially.

    The independent equation is that of rigid grains.
    """
    stiff = glass_beads.replace(E=1e9)
    waves = layer_waves(angle_deg, HEIGHT, stiff, wavelength=1e4)
    assert abs(waves.growth[0]) < 1e-3  # a uniformly higher surface
    left = 1 - transient(angle_deg, HEIGHT, stiff, times).mean / bagnold_mean(
        angle_deg, HEIGHT, stiff
    )
    rate = np.log(left[1] / left[0]) / (times[1] - times[0])
    assert waves.growth[1] == pytest.approx(rate, rel=2e-3)


@pytest.mark.parametrize(("angle_deg", "E"), [(22.0, 1e6), (25.0, 1e7), (28.0, 1e6)])
def test_waves_of_some_cells_die(angle_deg, E):
    """Waves of a few cells, seen in layers along the slope, decay under the law."""
    for wavelength, cells in ((0.04, 60), (0.08, 30), (0.16, 30)):
        waves = layer_waves(angle_deg, HEIGHT, glass_beads.replace(E=E), wavelength, cells=cells)
        assert waves.growth[0] < -1.0


def test_order_of_the_pieces():
    """First order, or better."""
    growth = [
        layer_waves(25.0, HEIGHT, glass_beads.replace(E=1e6), 0.16, cells=cells).growth[0]
        for cells in (20, 40, 80)
    ]
    first, second = np.abs(np.diff(growth))
    assert 1.6 < first / second < 5.0

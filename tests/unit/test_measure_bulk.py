"""Volumes, contacts, gaps and ill-posedness of states with values from a line of algebra."""

import numpy as np
import pytest
from synthetic import RHO_C, XI, isotropic, regular_points, scene, state

from granular import theory
from granular.materials import glass_beads
from granular.measure import density_drift, disconnected_fraction, gap_fraction, ill_posed_fraction

CELL = 0.01


def pool(height=0.1, **fields):
    s = scene((5, 20), CELL)
    s.walls = ()
    x = regular_points(s, 2, lambda x: x[:, -1] < height - 1e-9)
    fields.setdefault("stress", isotropic(np.full(len(x), 100.0)))
    return state(s, x, **fields)


def test_density_that_follows_the_volume_does_not_drift():
    assert density_drift(pool()) == pytest.approx(0, abs=1e-12)
    # twice the mass at twice the density takes the same volume
    mass = RHO_C * CELL**2 / 2
    assert density_drift(pool(mass=mass, rho=2 * RHO_C)) == pytest.approx(0, abs=1e-12)


@pytest.mark.parametrize("factor", [1.5, 3.0])
def test_drift_is_point_volume_over_available_volume(factor):
    """A layer collapsed to 1/factor of its height, while its particle density has not changed."""
    compressed = pool(mass=factor * RHO_C * CELL**2 / 4)
    assert density_drift(compressed) == pytest.approx(factor - 1)


def test_drift_sees_the_bulk_alone():
    points = pool()
    rho = np.where(points.x[:, 1] > 0.09, RHO_C / 2, RHO_C)  # the surface has become less dense
    assert density_drift(pool(rho=rho)) == pytest.approx(0, abs=1e-12)
    assert density_drift(pool(rho=rho), depth_cells=0) > 0.01


def test_disconnected_flight_is_not_a_lost_contact():
    """At 0.8 rho_c a body is rightly free of stress, whatever its size; at rho_c it is not."""
    flying = pool(mass=0.8 * RHO_C * CELL**2 / 4, rho=0.8 * RHO_C, stress=np.zeros((800, 4))[:200])
    assert disconnected_fraction(flying) == 1
    with pytest.raises(ValueError, match=r"packed = 0\.9"):
        disconnected_fraction(flying, packed=0.9)
    dense = pool(stress=np.zeros((200, 4)))
    assert disconnected_fraction(dense, packed=0.9) == 1


def test_ill_posed_fraction_counts_flowing_mass():
    low, high = theory.well_posed_range(glass_beads)
    scaled = np.array([1e-4, low * 0.9, low * 1.1, high * 0.9, high * 1.1, 1.0])
    s = scene((5, 20), CELL)
    x = np.linspace(0.001, 0.04, 12).reshape(6, 2)
    p = np.array([100.0, 100, 100, 100, 100, 0])  # the last point is free of stress
    rate = scaled * XI * np.sqrt(100.0)
    points = state(s, x, mass=[9.0, 1, 2, 3, 4, 9], shear_rate=rate, stress=isotropic(p))
    # the first does not flow; of mass 1 + 2 + 3 + 4, that below and above the range is ill posed
    assert ill_posed_fraction(points) == pytest.approx(5 / 10)
    still = state(s, x, shear_rate=0.0, stress=isotropic(p))
    assert np.isnan(ill_posed_fraction(still))


def test_gaps_are_empty_cells_in_a_stressed_body():
    points = pool()
    assert gap_fraction(points) == 0
    column = (points.x[:, 0] > 0.02) & (points.x[:, 0] < 0.03)
    torn = state(points.scene, points.x[~column], stress=points.stress[~column])
    assert gap_fraction(torn) == pytest.approx(10 / 40)
    calm = state(points.scene, points.x[~column])
    assert np.isnan(gap_fraction(calm))


def test_bad_arguments_are_refused():
    with pytest.raises(ValueError, match="packed = -1"):
        density_drift(pool(), packed=-1.0)
    with pytest.raises(ValueError, match="depth_cells = 30"):
        density_drift(pool(), depth_cells=30)

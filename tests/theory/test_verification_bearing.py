"""Bearing capacity by limit analysis: exact values of others, and equilibrium at yield."""

import numpy as np
import pytest

from granular import theory
from granular.verify import external


def test_the_file_of_limit_analysis_is_reproduced():
    """Its N_gamma of a smooth footing is Martin's (2005), by the method of characteristics."""
    data = external.load("plane_strain_limit_analysis")
    found = [theory.bearing_capacity(float(phi)) for phi in data["phi_deg"]]
    assert [f.surcharge for f in found] == pytest.approx(data["Nq"], rel=1e-4)
    assert [f.smooth_self_weight for f in found] == pytest.approx(data["Ngamma_smooth"], rel=3e-4)
    assert [f.rough_self_weight for f in found] == pytest.approx(data["Ngamma_rough"], rel=0.012)
    assert found[0].cohesion == pytest.approx(14.835, rel=1e-4)  # at 20 degrees
    pressure = found[0].pressure(2.0, rho=1500.0, cohesion=100.0, surcharge=50.0, gravity=10.0)
    parts = (100.0 * found[0].cohesion, 50.0 * data["Nq"][0], 15000.0 * found[0].rough_self_weight)
    assert pressure == pytest.approx(sum(parts), rel=1e-4)
    few = [theory.bearing_capacity(phi) for phi in (0.0, 1e-6, 5.0, 10.0)]
    assert few[0].cohesion == 2 + np.pi and few[1].cohesion == pytest.approx(2 + np.pi, rel=1e-6)
    assert few[0].surcharge == pytest.approx(1.0, rel=1e-15)
    assert few[0].rough_self_weight == few[0].smooth_self_weight == 0.0
    # Martin (2005), by the method of characteristics
    assert [f.smooth_self_weight for f in few[2:]] == pytest.approx([0.08446, 0.2809], rel=3e-4)
    with pytest.raises(ValueError, match="cohesion = -1"):
        found[0].pressure(1.0, cohesion=-1.0)
    coefficients = [theory.earth_pressure(np.sin(np.radians(phi))) for phi in data["phi_deg"]]
    assert [c.passive_coaxial for c in coefficients] == pytest.approx(
        data["Kp_smooth_wall"], rel=1e-4
    )
    assert [c.active_coaxial for c in coefficients] == pytest.approx(
        data["Ka_smooth_wall"], rel=1e-4
    )

"""Friction law: sums over contacts and averages over frames, against values computed by hand."""

import math
from dataclasses import replace

import numpy as np
import pytest
from contacts import frame
from refusals import refused

from granular.grain_scale import dem, friction_law
from granular.grain_scale.friction_law.contacts import _share_between

GRAINS = dem.Grains(d=1.0, spread=0.0, rho_s=2.0, kn=1e3, gamma_n=0.7, mu_p=0.5)
ABOVE = [[1.0, 0.55, 1.0], [1.0, 1.45, 1.0]]
"""Two grains of diameter 1, one above the other, with an overlap of 0.1."""


def two(**made):
    """Two grains at rest; the force on the upper one points left, that on the lower one right."""
    given = {"pairs": [(0, 1)], "force": [3.0], "tangential": [[1.5, 0.0, 0.0]]}
    return frame(ABOVE, np.zeros((2, 3)), **(given | made))


def test_stress_by_hand():
    """sigma = -sum branch (x) force/V; the branch points from the upper to the lower grain."""
    found = friction_law.sample(two(shear_rate=1e-9), GRAINS)
    # force on the lower grain: (1.5, -3, 0); branch (0, -0.9, 0); V = 8.
    assert found.stress[1] == pytest.approx([0.9 * 1.5 / 8, -0.9 * 3.0 / 8, 0.0], abs=1e-12)
    assert found.stress[0] == pytest.approx([0.0, 0.0, 0.0], abs=1e-12)
    assert (found.contacts, found.grains, found.slipping) == (1, 2, 1)
    assert found.solid == pytest.approx(2 * math.pi / 6)
    # the stress of motion is relative to the shear
    still = friction_law.sample(frame(ABOVE, [[0.55, 0, 0], [1.45, 0, 0]]), GRAINS)
    assert still.kinetic == pytest.approx(np.zeros((3, 3)), abs=1e-15)
    moving = friction_law.sample(frame(ABOVE, [[0.55, -2, 0], [1.45, 2, 0]]), GRAINS)
    assert moving.kinetic[1, 1] == pytest.approx(-2 * 4 / 8)
    assert moving.stress[1, 1] == moving.kinetic[1, 1]


def test_dissipation_by_hand():
    """m = 1/2, R = sqrt(1/4), overlap 0.1; the tangential spring returns some of the energy."""
    given = two(normal_velocity=[2.0], sliding=[[-4.0, 0.0, 1.0]])
    normal, tangential = friction_law.dissipation(given.contacts, given.radius, given.mass, GRAINS)
    assert normal == pytest.approx([0.5 * 0.5 * 0.7 * math.sqrt(0.1) * 4.0])
    assert tangential == pytest.approx([1.5 * 4.0])
    back = two(sliding=[[4.0, 0.0, 0.0]])
    assert friction_law.sample(back, GRAINS).sliding == pytest.approx(-6.0)
    # sticking contacts count for the power, but not as slipping
    found = friction_law.sample(two(tangential=[[1.4, 0, 0]], sliding=[[-1.0, 0, 0]]), GRAINS)
    assert (found.slipping, found.sliding) == (0, pytest.approx(1.4))


def test_law_is_the_balance_of_energy():
    """(Z phi/I) <Gamma>/Gamma~ equals the power over stress, shear rate and volume."""
    frames = [
        two(force=[f], sliding=[[-s, 0, 0]], normal_velocity=[0.2]) for f, s in ((3, 1), (5, 2))
    ]
    samples = [friction_law.sample(one, GRAINS) for one in frames]
    point = friction_law.average(samples, GRAINS)
    power = np.mean([s.viscoelastic + s.sliding for s in samples])
    assert point.friction_by_law == pytest.approx(power / (point.normal_stress * 1.0 * 8.0))
    assert point.friction == pytest.approx(0.9 * 1.5 / 8 / point.normal_stress)
    assert point.normal_stress == pytest.approx(0.9 * 4.0 / 8)
    assert point.coordination == pytest.approx(1.0)
    assert point.packing_fraction == pytest.approx(math.pi / 24)
    assert point.inertial_number == pytest.approx(math.sqrt(2.0 / point.normal_stress))
    # The mass of the handmade grains does not enter, but the volumes of spheres do.
    share = point.friction_viscoelastic / point.friction_by_law
    assert share == pytest.approx(point.viscoelastic / (point.viscoelastic + point.sliding))
    # the height grows by a tenth during a strain of 4
    samples = [
        friction_law.sample(two(time=t, box=(2.0, h, 2.0)), GRAINS)
        for t, h in ((1.0, 2.0), (3.0, 2.1), (5.0, 2.2))
    ]
    point = friction_law.average(samples, GRAINS)
    assert point.dilation == pytest.approx(math.log(1.1) / 4.0)
    assert point.balance * (point.friction - point.dilation) == point.friction_by_law


def test_invariants_of_a_stress_by_hand():
    point = replace(
        friction_law.average([friction_law.sample(two(), GRAINS)], GRAINS),
        stress=(-1.0, 0.5, 0.0, 0.5, -2.0, 0.0, 0.0, 0.0, -3.0),
        normal_stress=2.0,
        inertial_number=0.1,
    )
    assert point.friction == 0.25
    # p = 2, s = (1, 0, -1) and 0.5: s:s/2 = (2 + 0.5)/2.
    assert point.invariants == pytest.approx((math.sqrt(1.25) / 2.0, 0.1))


def test_errors_come_from_the_scatter_of_blocks():
    rng = np.random.default_rng(3)
    forces = rng.normal(3.0, 0.3, 4000)
    samples = [friction_law.sample(two(force=[f]), GRAINS) for f in forces[:400]]
    point = friction_law.average(samples, GRAINS)
    # mu = 1.5/<force>, so that its error is that of the mean force, to first order.
    expected = 0.5 * 0.1 / math.sqrt(400)
    assert 0.4 * expected < point.friction_error < 2.0 * expected
    assert point.frames == 400
    assert math.isnan(friction_law.average(samples[:5], GRAINS).friction_error)


def test_share_of_a_sphere_between_two_heights():
    """Comparison with the integral of the area of the sections of the sphere."""
    y, radius = np.array([0.2]), np.array([0.5])
    z = np.linspace(-0.1, 0.55, 200001)
    area = np.pi * np.maximum(0.25 - (z - 0.2) ** 2, 0.0)
    whole = 4 / 3 * np.pi * 0.125
    expected = np.trapezoid(area, z) / whole
    assert _share_between(y, radius, -0.1, 0.55) == pytest.approx([expected], rel=1e-8)
    assert _share_between(y, radius, -np.inf, np.inf) == pytest.approx([1.0])


def test_a_layer_between_walls_has_the_slope_of_its_own_velocity():
    rng = np.random.default_rng(0)
    x = rng.uniform(0.0, 10.0, (400, 3))
    v = np.zeros_like(x)
    v[:, 0] = np.where(x[:, 1] < 5.0, 2.0 * x[:, 1], 10.0)  # the upper half moves as a block
    wall = x[:, 1] > 9.0
    given = frame(x, v, radius=0.1, box=(10.0,) * 3, shear_rate=np.nan, wall=wall)
    lower = friction_law.sample(given, GRAINS, (0.05, 0.5))
    assert lower.shear_rate == pytest.approx(2.0)
    assert lower.kinetic[0, 0] == pytest.approx(0.0, abs=1e-12)
    upper = friction_law.sample(given, GRAINS, (0.6, 1.0))
    assert upper.shear_rate == pytest.approx(0.0, abs=1e-12)
    # The layer is nearly uniform: its share of grains is that of its height, without wall grains.
    assert lower.grains == pytest.approx(400 * 0.45 * 9.1 / 10.0, rel=0.1)
    refused(
        ("one side only", lambda: friction_law.sample(given, GRAINS, None)),
        ("low end", lambda: friction_law.sample(given, GRAINS, (0.5, 0.2))),
        (r"layer\[1\]", lambda: friction_law.sample(given, GRAINS, (0.0, 1.5))),
        ("without walls", lambda: friction_law.sample(two(), GRAINS, (0.0, 1.0))),
    )


def test_all_of_a_flow_between_walls_by_hand():
    """Two grains between single wall grains that move at 3 m/s and -2 m/s; diameters are 1."""
    x = [[1.0, 0.0, 1.0], [1.0, 1.0, 1.0], [1.0, 2.0, 1.0], [1.0, 3.0, 1.0]]
    v = [[-2.0, 0.0, 0.0], [-1.0, 0.0, 0.0], [2.0, 0.0, 0.0], [3.0, 0.0, 0.0]]
    given = {"wall": [True, False, False, True], "shear_rate": np.nan}
    pairs = {"pairs": [(0, 1), (1, 2), (2, 3)], "force": [4.0, 4.0, 4.0]}
    found = friction_law.sample(frame(x, v, **given, **pairs), GRAINS)
    assert found.shear_rate == pytest.approx(5.0 / 2.0)
    assert (found.grains, found.contacts) == (2, 3)
    assert found.volume == pytest.approx(2.0 * 2.0 * 2.0)
    assert found.stress[1, 1] == pytest.approx(-3 * 4.0 / 8.0)


def test_nothing_to_average_is_refused():
    loose = friction_law.sample(frame(ABOVE, np.zeros((2, 3)), shear_rate=1e-9), GRAINS)
    refused(
        ("0 frames", lambda: friction_law.average([], GRAINS)),
        (r"normal stress .* must be > 0", lambda: friction_law.average([loose], GRAINS)),
        ("blocks = 1", lambda: friction_law.average([loose], GRAINS, blocks=1)),
    )

"""DilatantMuI in the element tests of soil mechanics, from loose, critical and dense packing.

Against scipy's integrator on the tensorial rate equations, and against closed forms. In axial
symmetry q = sqrt(3) tau, and the plastic rates are those of the original Cam clay: the dilatancy
d(volume)/d(shear strain) is -sqrt(3) psi, so that q/p = sqrt(3) mu + sqrt(3) psi = M - dilatancy.
"""

import math

import numpy as np
import pytest
from dilatant_point import Element, critical_packing, driven, exact

from granular import DilatantMuI

SAND = DilatantMuI(E=1e7)
SLOW = SAND.replace(d=1e-6)
ON_LINE = SAND.replace(E=1e8, csl_slope=0.05)
PACKINGS = np.array([0.56, 0.585, 0.62])
ROOT = math.sqrt(3.0)


def diagonal(*values):
    return np.diag(np.array(values, dtype=float))


SHEAR = np.array([[0.0, 1.0, 0.0], [0.0, 0.0, 0.0], [0.0, 0.0, 0.0]])
TRIAXIAL = Element(diagonal(0, 0, -1), diagonal(1, 1, 0), diagonal(1, 0, 0))
SIMPLE_SHEAR = Element(SHEAR, diagonal(0, 1, 0), diagonal(0, 1, 0))
OEDOMETER = Element(diagonal(0, 0, -1))


@pytest.mark.parametrize(
    ("sand", "test", "p", "strain", "gdot"),
    [
        (SAND, TRIAXIAL, 20e3, 1.5, 0.1),
        (SAND, TRIAXIAL, 20e3, 1.5, 30.0),
        (SAND, SIMPLE_SHEAR, 20e3, 1.5, 0.1),
        (SAND, SIMPLE_SHEAR, 20e3, 1.5, 30.0),
        (SAND, OEDOMETER, 1e3, 0.02, 0.1),
        (SAND, OEDOMETER, 1e3, 0.02, 30.0),
        (ON_LINE, TRIAXIAL, 200e3, 1.5, 30.0),
        (ON_LINE, SIMPLE_SHEAR, 500e3, 1.5, 0.1),
        (ON_LINE, OEDOMETER, 1e3, 0.002, 0.1),
    ],
)
def test_paths_converge_to_the_rate_equations(sand, test, p, strain, gdot):
    """All components of the stress, and the packing: mean errors over the path, which fall with the
    first power of dt; on a line faster at first, as a part is of the second order."""
    end, errors = strain / gdot, []
    steps = (200, 400) if sand is SAND else (400, 800)
    times = np.linspace(0, end, 9)[1:]
    solved = [exact(sand, packing, p, gdot, test, times) for packing in PACKINGS]
    stress, packing = (np.array(values).swapaxes(0, 1) for values in zip(*solved, strict=True))
    size = abs(stress).max(axis=(0, 2, 3))
    for count in steps:
        path = driven(sand, PACKINGS, p, gdot, test, end, count)
        at = np.arange(count // 8 - 1, count, count // 8)
        of_stress = abs(path.stress[at] - stress).max(axis=(2, 3)) / size
        errors.append((of_stress + abs(path.packing[at] / packing - 1)).mean(axis=0))
    assert errors[-1].max() < 1.2e-3
    measurable = errors[-1] > 1e-6  # scipy leaves some 1e-7
    orders = np.log2(errors[0] / errors[1])[measurable]
    assert len(orders) and orders.min() > 0.8 and (sand is ON_LINE or orders.max() < 1.2), errors


@pytest.mark.parametrize("gdot", [0.1, 30.0])
@pytest.mark.parametrize(("test", "dim"), [(TRIAXIAL, 3), (SIMPLE_SHEAR, 2), (SIMPLE_SHEAR, 3)])
def test_loose_and_dense_reach_the_critical_state(test, dim, gdot):
    """Packing and friction within 1 % from both sides, of the rate and pressure at the end."""
    path = driven(SAND, PACKINGS, 20e3, gdot, test, 3.0 / gdot, 600, dim=dim)
    p, D = path.p[-1], path.strain[-1] / (3.0 / gdot / 600)
    D = (D + D.swapaxes(1, 2)) / 2
    rate = np.sqrt(2 * (D * D).sum(axis=(1, 2)))
    inertial = rate * SAND.d * np.sqrt(SAND.rho_s / p)
    assert path.packing[-1] == pytest.approx(SAND.packing(inertial), rel=1e-2)
    assert path.tau[-1] / p == pytest.approx(SAND.friction(inertial), rel=1e-2)


def test_triaxial_compression_has_the_peak_and_the_volume_of_the_closed_forms():
    """q = sqrt(3) (mu + psi) p with p = cell pressure + q/3, at the peak and in the critical state;
    phi = phi_c/(1 - (1 - phi_c/phi_0) exp(-m phi_c gamma)) of the plastic shear gamma; and
    q/p + d(volume)/d(shear strain) = M all the way."""
    cell = 20e3
    path = driven(SLOW, PACKINGS, cell, 0.1, TRIAXIAL, 15.0, 1500)
    q = -path.stress[:, :, 2, 2] - cell
    assert q == pytest.approx(ROOT * path.tau, rel=1e-6)
    assert path.p == pytest.approx(cell + q / 3, rel=1e-6)
    slope = ROOT * SLOW.peak_friction(0.62)
    assert q[:, 2].max() == pytest.approx(cell * slope / (1 - slope / 3), rel=5e-3)
    assert np.argmax(q[:, 2]) < 10  # where it begins to flow
    assert q[:, :2].max(axis=0) == pytest.approx(q[-1, :2], rel=1e-2)  # no peak
    critical = ROOT * SLOW.mu_s
    assert q[-1] / path.p[-1] == pytest.approx(critical, rel=1e-2)
    along = np.cumsum(path.strain, axis=0)
    plastic = 2 / ROOT * (along[:, :, 0, 0] - along[:, :, 2, 2]) - path.tau / SLOW.G
    m, phi_c = SLOW.dilatancy, SLOW.phi_c
    closed = phi_c / (1 - (1 - phi_c / PACKINGS) * np.exp(-m * phi_c * plastic))
    assert path.packing == pytest.approx(closed, rel=5e-4)
    flows = slice(20, None)
    volume = -np.diff(np.log(path.packing), axis=0)[flows]
    ratio = -volume / (np.diff(plastic, axis=0)[flows] / ROOT)  # compression is positive
    middle = (q / path.p)[1:][flows]
    assert middle + ratio == pytest.approx(critical, rel=2e-2)


def test_sand_is_dense_at_a_small_pressure_and_loose_at_a_large_one():
    """On a critical-state line the same packing has a peak and dilates, or has none and compacts;
    the critical state is that of the pressure at the end."""
    sand = SLOW.replace(E=1e8, csl_slope=0.05)
    ends = []
    for cell, dense in ((50e3, True), (1e6, False)):
        path = driven(sand, 0.62, cell, 0.1, TRIAXIAL, 15.0, 1500)
        friction, critical = path.tau[:, 0] / path.p[:, 0], critical_packing(sand, path.p[-1, 0])
        assert friction[-1] == pytest.approx(sand.mu_s, rel=1e-2)
        assert path.packing[-1, 0] == pytest.approx(critical, rel=1e-2)
        assert (friction.max() > 1.1 * friction[-1]) == dense
        assert (path.packing[-1, 0] < 0.62) == dense
        ends.append(critical)
        if dense:  # at first yield, where q = sqrt(3) tau and p = cell + q/3
            yields = path.p[np.argmax(friction), 0]
            assert friction.max() == pytest.approx(sand.peak_friction(0.62, yields), rel=5e-3)
    assert ends[0] + 0.05 < ends[1]


def test_stiff_sand_that_is_held_comes_to_the_pressure_of_its_packing_without_ringing():
    """At a constant volume phi_c(p) = phi in the end. In ten steps of a shear of 0.05, the explicit
    change of psi in a step would be b K dgamma = 4 to 16 times its cause: it rings from 2 on."""
    sand = SLOW.replace(E=1e9, csl_slope=0.05)
    packings = np.array([0.60, 0.62, 0.64])
    path = driven(sand, packings, 200e3, 1.0, Element(SHEAR), 0.5, 10)
    fall = 1 / sand.phi_c - 1 / path.packing[-1]
    last = 101325 * (fall / sand.csl_slope) ** (1 / sand.csl_exponent)
    assert path.p[-1] == pytest.approx(last, rel=1e-5)  # I is not quite 0: 4e-6 of the least
    off = abs(np.concatenate([np.full((1, 3), 200e3), path.p]) - last)
    assert (np.diff(off, axis=0) < 1e-5 * last).all()  # nearer with every step
    crossings = (np.diff(np.sign(path.p[:5] - last), axis=0) != 0).sum(axis=0)
    assert (crossings == 0).all()
    b = sand.dilatancy * sand.csl_exponent * fall * path.packing[-1] ** 2 / last
    assert (b * sand.K * 0.05 > 4).all() and (b * sand.K * 0.05).max() > 16
    times = np.linspace(0, 0.5, 11)[1:]
    path = driven(sand, packings, 200e3, 1.0, Element(SHEAR), 0.5, 200)
    for i, packing in enumerate(packings):
        stress, _ = exact(sand, packing, 200e3, 1.0, Element(SHEAR), times)
        p = -np.trace(stress, axis1=1, axis2=2) / 3
        assert path.p[19::20, i] == pytest.approx(p, rel=1e-4)


def test_an_oedometer_is_elastic_and_then_yields():
    """Modulus K + 4 G/3 and horizontal over vertical stress nu/(1 - nu); then along the cone, where
    the plastic rate g of a unit of compression follows from tau = (mu + psi) p, and at the critical
    packing the modulus is K (1 + 2 mu/sqrt(3))."""
    K, G, m = SLOW.K, SLOW.G, SLOW.dilatancy
    packings = np.array([0.56, 0.585, 0.61, 0.64])
    path = driven(SLOW, packings, 1.0, 0.1, OEDOMETER, 0.05, 500)
    vertical, horizontal = -path.stress[:, :, 2, 2], -path.stress[:, :, 0, 0]
    moduli = np.diff(vertical, axis=0) / 1e-5
    assert moduli[:, 3] == pytest.approx(K + 4 * G / 3, rel=1e-6)
    assert horizontal[-1, 3] / vertical[-1, 3] == pytest.approx(0.3 / 0.7, rel=1e-3)
    friction = SLOW.mu_s + m * (path.packing[-1] - SLOW.phi_c)
    on_cone = (ROOT - friction) / (ROOT + 2 * friction)
    ratio = horizontal[-1] / vertical[-1]
    assert ratio[:3] == pytest.approx(on_cone[:3], rel=1e-4)
    assert on_cone[3] < ratio[3]
    p, psi = path.p[-1], friction - SLOW.mu_s
    g = (2 * G / ROOT - friction * K) / (G + friction * K * psi - m * path.packing[-1] * psi * p)
    expected = K * (1 + psi * g) + 2 / ROOT * G * (2 / ROOT - g)
    assert moduli[-1, :3] == pytest.approx(expected[:3], rel=1e-3)
    assert moduli[-1, 1] == pytest.approx(K * (1 + 2 * SLOW.mu_s / ROOT), rel=1e-3)


@pytest.mark.parametrize("test", [TRIAXIAL, SIMPLE_SHEAR], ids=["triaxial", "simple shear"])
def test_a_superposed_rotation_turns_the_stress_and_nothing_else(test):
    """The frame of the test turns by a right angle about a skew axis: the stress in that frame is
    the one without rotation, to the first order of the step."""
    axis, end = np.array([1.0, 2.0, 2.0]) / 3, 5.0
    cross = np.cross(np.eye(3), axis)

    def turn(t, dt):
        angles = math.pi / 2 * np.array([t, t + dt]) / end
        return [np.eye(3) - math.sin(a) * cross + (1 - math.cos(a)) * cross @ cross for a in angles]

    errors = []
    for steps in (200, 400):
        path, turned = (
            driven(SAND, PACKINGS, 20e3, 0.1, test, end, steps, turn=t) for t in (None, turn)
        )
        errors.append(abs(turned.stress - path.stress).max() / 20e3)
        errors[-1] = max(errors[-1], abs(turned.packing - path.packing).max())
    assert errors[-1] < 1e-2 and errors[0] / errors[1] == pytest.approx(2.0, abs=0.2), errors


@pytest.mark.parametrize(
    ("test", "strain"),
    [(TRIAXIAL, 1.5), (SIMPLE_SHEAR, 1.5), (OEDOMETER, 0.02)],
    ids=["triaxial", "simple shear", "oedometer"],
)
def test_no_path_gives_back_more_work_than_the_elastic_energy(test, strain):
    """Work less the change of p^2/2K + tau^2/2G is never negative, and in slow flow the integral of
    mu_s p over the plastic shear."""
    p = 20e3
    path = driven(SLOW, PACKINGS, p, 0.1, test, strain / 0.1, 500)
    work = (path.stress * path.strain).sum(axis=(2, 3))
    energy = path.p**2 / (2 * SLOW.K) + path.tau**2 / (2 * SLOW.G)
    start = np.full((1, 3), p**2 / (2 * SLOW.K))
    lost = work - np.diff(np.concatenate([start, energy]), axis=0)
    assert lost.min() > -1e-12 * energy.max()
    D = (path.strain + path.strain.swapaxes(2, 3)) / 2
    D = D - np.trace(D, axis1=2, axis2=3)[..., None, None] / 3 * np.eye(3)
    shear = np.sqrt(2 * (D * D).sum(axis=(2, 3)))
    if strain > 1:  # the elastic shear is a small part
        plastic = shear.sum(axis=0) - path.tau[-1] / SLOW.G
        mean = (path.p * shear).sum(axis=0) / shear.sum(axis=0)
        assert lost.sum(axis=0) == pytest.approx(SLOW.mu_s * mean * plastic, rel=1e-2)


@pytest.mark.parametrize("dim", [2, 3])
def test_shear_that_opens_by_a_fifth_and_closes_is_finite_and_keeps_the_mass(dim):
    """No tension, no stress of material that is open, and phi exp(c) that of the deformation."""
    for sign in (1.0, -1.0):
        opening = Element(SHEAR + sign * diagonal(0, 0.2, 0))
        path = driven(SAND, PACKINGS, 20e3, 1.0, opening, 1.0, 300, dim=dim)
        c = np.maximum(path.p / SAND.K, 0)
        assert np.isfinite(path.stress).all() and np.isfinite(path.packing).all()
        assert path.p.min() >= 0
        density = np.log(PACKINGS) + 20e3 / SAND.K - sign * 0.2 * np.arange(1, 301)[:, None] / 300
        pressed = path.p > 0
        assert (np.log(path.packing) + c)[pressed] == pytest.approx(density[pressed], abs=1e-9)
        if sign > 0:
            assert (path.p[-1] == 0).all() and (path.tau[-1] == 0).all()

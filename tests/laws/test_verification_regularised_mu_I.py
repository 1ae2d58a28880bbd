"""The partially regularised mu(I) of Barker & Gray 2017: the law, its step, its creep and waves."""

import itertools
import math

import numpy as np
import pytest
import scipy

import granular as gr
from granular import RegularisedMuI, _core, theory

GRAINS = RegularisedMuI(E=1e6)
STEEP = RegularisedMuI(E=1e6, mu_s=0.6, mu_2=1.2, alpha=1.7, mu_inf=0.1)


def written(inertial, m):
    """Friction as the paper states it, with A by continuity."""
    at = m.I1
    A = at * math.exp(
        m.alpha * (m.I0 + at) ** 2 / (m.mu_s * m.I0 + m.mu_2 * at + m.mu_inf * at**2) ** 2
    )
    if inertial <= at:
        return math.sqrt(m.alpha / math.log(A / inertial))
    return (m.mu_s * m.I0 + m.mu_2 * inertial + m.mu_inf * inertial**2) / (m.I0 + inertial)


@pytest.mark.parametrize("m", [GRAINS, STEEP])
def test_the_law_is_well_posed_from_rest_to_a_large_inertial_number(m):
    """The criterion of Barker et al. 2015, from differences of the law."""
    plain = theory.well_posed_range(gr.MuI(mu_s=m.mu_s, mu_2=m.mu_2))
    low, high = theory.well_posed_range(m)
    assert m.I1 == pytest.approx(plain[0] * m.I0)
    assert low == 0.0 and high > plain[1]
    above = m.I1 * (1 + 1e-12)
    assert written(above, m) == pytest.approx(written(m.I1, m), rel=1e-11)
    slow, fast = np.logspace(-12, -1e-6, 60) * m.I1, np.geomspace(1.001 * m.I1, high * m.I0, 80)
    for inertial in (*slow, *fast[:-1], 1.01 * fast[-1]):
        mu, h = written(inertial, m), 1e-6
        r = math.log(written(inertial * (1 + h), m) / written(inertial * (1 - h), m)) / (2 * h)
        C = 4 * r**2 - 4 * r + mu**2 * (1 - r / 2) ** 2
        assert m.friction(inertial) == pytest.approx(mu, rel=1e-12)
        assert theory.ill_posedness(inertial / m.I0, m) == pytest.approx(C, abs=1e-8)
        assert (C <= 0) == (inertial < high * m.I0), inertial
    assert m.friction(0.0) == 0.0


def sheared(m, tau, p, gradient, times, steps):
    """Shear stress [Pa] under a constant pressure and velocity gradient dv_x/dy [1/s], in 2D.

    The normal stresses of simple shear, of second order in tau/G, are kept out: the deviator is
    set to pure shear before each step, so that the reference is one equation.
    """
    names = [name for name, *_ in _core.laws()[m.law][1]]
    lanes = _core.build_info()["lanes"]
    dt, found = times[-1] / steps, [tau]
    step = np.zeros((1, 4, lanes))
    step[0, 1:3] = gradient * dt / 2  # without rotation
    for _ in range(steps):
        stress = np.zeros((4, lanes))
        stress[:3], stress[3] = -p, found[-1]
        rate = np.zeros(lanes)
        _core.law_update(
            m.law, 2, {name: getattr(m, name) for name in names}, dt, 0, step,
            np.full(lanes, p / m.K), stress, rate, "", None, np.zeros(lanes),
        )  # fmt: skip
        found.append(stress[3, 0])
    return np.interp(times, np.linspace(0, times[-1], steps + 1), found)


@pytest.mark.parametrize(
    ("start", "gradient", "span"),
    [(0.35, 0.0, 2e-2), (0.7, 0.0, 2e-2), (0.0, 0.5, 4e-3), (0.1, 30.0, 2e-4)],
    ids=["creeps at rest", "from fast flow", "sheared slowly", "sheared fast"],
)
def test_steps_converge_to_the_rate_equation(start, gradient, span):
    """d tau/dt = G (gradient - gdot(tau/p)), integrated by SciPy: first order in the step.

    At rest the stress relaxes without end; under shear it tends to mu(I) p.
    """
    m, p = GRAINS, 1000.0
    to_inertial = m.d * math.sqrt(m.rho_s / p)

    def slope(_, tau):
        low, high, ratio = math.log(1e-280), math.log(1e4), tau[0] / p
        if ratio < written(math.exp(low), m):
            return [m.G * gradient]
        inertial = math.exp(
            scipy.optimize.brentq(lambda u: written(math.exp(u), m) - ratio, low, high, xtol=1e-13)
        )
        return [m.G * (gradient - inertial / to_inertial)]

    times = np.linspace(0, span, 9)
    exact = scipy.integrate.solve_ivp(
        slope, (0, span), [start * p], t_eval=times, method="LSODA", rtol=1e-9, atol=1e-7
    ).y[0]
    errors = [
        abs(sheared(m, start * p, p, gradient, times, n) - exact)[1:].max()
        for n in (400, 800, 1600)
    ]
    assert errors[-1] < 5e-3 * p
    for coarse, fine in itertools.pairwise(errors):
        assert 1.8 < coarse / fine < 2.2


@pytest.mark.parametrize("isa", ["baseline", ""])
def test_no_stress_or_pressure_is_too_large_or_small(isa):
    """The friction is finite and does not exceed that of the trial."""
    m, names = GRAINS, [name for name, *_ in _core.laws()[GRAINS.law][1]]
    p, ratio = np.meshgrid(10.0 ** np.arange(-300, 12, 8), 10.0 ** np.arange(-18, 19, 3))
    n = p.size // 8 * 8
    p, tau = p.ravel()[:n], (p * ratio).ravel()[:n]
    stress, rate = np.zeros((4, n)), np.zeros(n)
    stress[:3], stress[3] = -p, tau
    lanes = _core.build_info(isa)["lanes"]
    for dt in (1e-9, 1e-5, 1.0):
        found = stress.copy()
        _core.law_update(
            m.law, 2, {name: getattr(m, name) for name in names}, dt, 0,
            np.zeros((n // lanes, 4, lanes)), np.ones(n), found, rate, isa, None, np.zeros(n),
        )  # fmt: skip
        assert np.isfinite(found).all() and np.isfinite(rate).all()
        assert (found[3] >= 0).all() and (found[3] <= tau).all() and (rate >= 0).all()
        usual = (p > 1e-100) & (tau > 1e-100)
        assert (found[3] > 0)[usual].all()


def creep_speed(angle_deg, height, m, gravity=9.8):
    """Mean velocity [m/s] of steady flow down an incline, where tau/p = tan(angle) everywhere.

    The shear rate I sqrt(p/rho_s)/d integrates to 2/5 of itself at the base times the height.
    """
    slope = math.tan(math.radians(angle_deg))
    inertial = math.exp(
        scipy.optimize.brentq(lambda u: written(math.exp(u), m) - slope, -600.0, 3.0, xtol=1e-13)
    )
    p = m.rho_c * gravity * math.cos(math.radians(angle_deg)) * height
    return 0.4 * height * inertial / m.d * math.sqrt(p / m.rho_s)


def mean_speed(time, cells, angle_deg, m, flutter_damping=None, **more):
    """Mean velocity [m/s] down an incline, and the share of the flow where the law is ill posed."""
    scene = gr.scenes.incline(angle_deg=angle_deg, height=0.2, cell=0.2 / cells, material=m, **more)
    if flutter_damping is not None:
        density = gr.SmoothedDensity(flutter_damping=flutter_damping)
        scene = scene.replace(scheme=scene.scheme.replace(density=density))
    sim = gr.Simulation(scene, threads=1)
    sim.run(until=time, monitor=False)
    speed = float(np.average(sim.state.v[:, 0], weights=sim.state.mass))
    return speed, gr.measure.ill_posed_fraction(sim.state)


def test_a_layer_creeps_below_the_friction_angle_at_the_speed_of_the_law():
    """20 deg, where mu(I) is at rest. The speed follows the 28th power of the friction there.
    At E = 1 MPa it is 2 % higher, an error that falls with the stiffness: hence 10 MPa.
    """
    stiff = GRAINS.replace(E=1e7)
    expected = creep_speed(20.0, 0.2, stiff)
    assert expected == pytest.approx(0.0297, abs=5e-5)
    errors = []
    for cells in (8, 16):
        speed, ill_posed = mean_speed(4.0, cells, 20.0, stiff)
        assert ill_posed == 0
        errors.append(speed / expected - 1)
    assert 0 < errors[0] < 0.015
    assert abs(errors[1]) < 0.5 * errors[0]


@pytest.mark.slow
def test_refinement_converges_where_that_of_plain_mu_I_does_not():
    """20 deg with many columns, jitter, and no damping of flutter: waves make plain mu(I) flow once
    the cells are fine enough for them, below the slope at which it can.
    """
    options = {"flutter_damping": 0, "jitter": 0.5}
    found = {
        m: [mean_speed(3.0, n, 20.0, m, columns=n // 2, **options) for n in (8, 16, 32)]
        for m in (GRAINS, gr.MuI(E=1e6, I0=GRAINS.I0, d=GRAINS.d))
    }
    regularised, plain = found.values()
    expected = creep_speed(20.0, 0.2, GRAINS)
    assert [ill_posed for _, ill_posed in regularised] == [0, 0, 0]
    assert [speed for speed, _ in regularised[1:]] == pytest.approx([expected] * 2, rel=0.04)
    assert regularised[2][0] == pytest.approx(regularised[1][0], rel=0.01)
    assert max(abs(speed) for speed, _ in plain[:2]) < 1e-3
    assert plain[2][0] > 0.01 and plain[2][1] > 0.5


def test_functions_of_laws_with_a_yield_stress_refuse_it():
    m = GRAINS
    for call in (
        lambda: theory.bagnold_profile([0.1], 24.0, 0.2, m),
        lambda: theory.bagnold_mean(24.0, 0.2, m),
        lambda: theory.transient(24.0, 0.2, m, [1.0]),
        lambda: theory.reference(m, 100.0, [0.1]),
        lambda: theory.plastic_shear_rate(1.0, 0.5, m),
        lambda: theory.well_posed_slopes(m),
        lambda: theory.scaled_inertial_number_of_slope(24.0, m),
        lambda: theory.couette_decay_length(0.3, m),
        lambda: theory.chute_profile(24.0, 0.2, m),
        lambda: theory.chute_transient(24.0, 0.2, m, [0.1], 0.1),
        lambda: gr.sph.Viscoplastic.matching(m, 100.0),
    ):
        with pytest.raises(TypeError, match="material = RegularisedMuI"):
            call()

"""Stress update of every registered law: against 50 digits, the plain reference, and properties."""

import decimal
import itertools
import math
from decimal import Decimal

import numpy as np
import oracle_fluidity
import oracle_law as oracle
import oracle_nonlocal
import pytest
from oracle_hencky import FLOW_OF

from granular import NGF, DruckerPrager, Elastic, MuI, RegularisedMuI, _core

MATERIALS = {
    "elastic": Elastic(E=1e7),
    "drucker_prager": DruckerPrager(E=1e7),
    "mu_I": MuI(E=1e7, I0=0.279, d=0.005),
    "ngf": NGF(E=1e7, I0=0.279, d=0.005),
    "regularised_mu_I": RegularisedMuI(E=1e7),
    "cohesive drucker_prager": DruckerPrager(E=1e7, cohesion=30.0, tensile_strength=50.0),
    "cohesive mu_I": MuI(E=1e7, I0=0.279, d=0.005, cohesion=30.0),
}

LAWS = sorted(MATERIALS)
FRICTIONAL = [law for law in LAWS if law != "elastic"]
WITH_YIELD_STRESS = [law for law in LAWS if law != "regularised_mu_I"]  # which creeps at rest


def numbers(law):
    """Parameters of the law, with the elastic moduli."""
    material = MATERIALS[law]
    more = {"K": material.K, "G": material.G, "xi": getattr(material, "xi", None)}
    if law == "regularised_mu_I":
        more["I1"] = material.I1
    if hasattr(material, "tensile_strength"):
        more["tensile_strength"] = material.tensile_strength
    return vars(material) | more | {"p_averaging": 40.0}


def before(n):
    """Fluidity after its diffusion, equal in eight points, and shear rates of the step before."""
    rng = np.random.default_rng(n)
    cells = -(-n // 8)
    g_star = rng.choice([0.0, 1.0], cells, p=[0.3, 0.7]) * 10 ** rng.uniform(-6, 3, cells)
    return np.repeat(g_star, 8)[:n], rng.choice([0.0, 1.0], n) * 10 ** rng.uniform(-4, 2, n)


def update(law, dim, *state, **options):
    """Results of `full_update` without the fluidity; a nonlocal law begins from `before`."""
    if law == "ngf" and "g_star" not in options:
        options["g_star"], options["shear_rate"] = before(len(state[0]))
    return full_update(law, dim, *state, **options)[:2]


def full_update(
    law, dim, stress, Ldt, log_density, dt, *, equation_of_state=False, isa="", g_star=None,
    shear_rate=0.0,
):  # fmt: skip
    """Apply `_core.law_update` to stress (n, 4 or 6) and L dt (n, dim, dim).

    Returns new stresses, plastic shear rates and fluidities.
    """
    core = MATERIALS[law].law
    lanes = _core.build_info(isa)["lanes"]
    n = len(stress)
    padded = -(-n // lanes) * lanes
    gradient = np.zeros((padded, dim * dim))
    gradient[:n] = Ldt.reshape(n, -1)
    gradient = np.ascontiguousarray(gradient.reshape(-1, lanes, dim * dim).transpose(0, 2, 1))
    density, rate, g = np.zeros((3, padded))
    density[:n], rate[:n] = log_density, shear_rate
    if g_star is not None:
        g_star = np.resize(np.broadcast_to(g_star, n), padded)
    new = np.zeros((stress.shape[1], padded))
    new[:, :n] = stress.T
    parameters = {name: numbers(law)[name] for name, *_ in _core.laws()[core][1]}
    _core.law_update(
        core, dim, parameters, dt, int(equation_of_state), gradient, density, new, rate, isa,
        g_star, g,
    )  # fmt: skip
    return new[:, :n].T.copy(), rate[:n].copy(), g[:n].copy()


def random_states(rng, n, dim, law, steepest=0.9):
    """Stresses below the limit friction, increments L dt and log-densities, of many magnitudes."""
    material = numbers(law)
    p = 10 ** rng.uniform(0.0, 4.5, n)
    stress = rng.normal(size=(n, 4 if dim == 2 else 6))
    stress[:, :3] -= stress[:, :3].mean(axis=1, keepdims=True)
    size = np.sqrt((stress[:, :3] ** 2).sum(axis=1) / 2 + (stress[:, 3:] ** 2).sum(axis=1))
    friction = material.get("mu_2", material.get("mu", 0.6))
    stress *= (rng.uniform(0.0, steepest, n) * friction * p / size)[:, None]
    stress[:, :3] -= p[:, None]
    Ldt = (
        rng.normal(size=(n, dim, dim))
        * (p / material["G"] * 10 ** rng.uniform(-2, 1.5, n))[:, None, None]
    )
    return stress, Ldt, p / material["K"] * 10 ** rng.uniform(-1, 1, n)


# ---- 50 digits ----


def exact(array):
    """Exact decimal values of floating-point numbers."""
    return np.vectorize(Decimal, otypes=[object])(array)


root = np.vectorize(lambda a: a.sqrt(), otypes=[object])


def law_in_decimals(law, dim, stress, Ldt, dt):
    """The update (3.10-3.16) of dense points in exact numbers, and what selects branches."""
    q = {name: Decimal(float(v)) for name, v in numbers(law).items() if isinstance(v, float)}
    step, L = Decimal(dt), np.full((len(stress), 3, 3), Decimal(0), dtype=object)
    L[:, :dim, :dim] = exact(Ldt) / step
    s, identity = oracle.tensor(exact(stress), dim), np.eye(3, dtype=int)
    p, deviator = oracle.split_trial(q, s, L, step)
    K, G, strained = float(q["K"]), float(q["G"]), (L * step).astype(float)
    added = (K - 2 * G / 3) * np.trace(strained, axis1=1, axis2=2)[:, None, None] * identity
    added += G * (strained + strained.transpose(0, 2, 1))
    size = np.maximum(abs(added), abs(s.astype(float))).max(axis=(1, 2))
    if law == "elastic":
        return deviator - p[:, None, None] * identity, size, np.ones(len(stress), dtype=bool)
    tau_trial = root((deviator**2).sum(axis=(1, 2)) / 2)
    strength, cohesion = q.get("tensile_strength", Decimal(0)), q.get("cohesion", Decimal(0))
    dense = np.array([a > -strength for a in p])
    safe = np.where(dense, p, Decimal(1))
    static = q["mu" if law.endswith("drucker_prager") else "mu_s"] * safe
    tau = static
    if law == "regularised_mu_I":
        tau = np.array(
            [regularised_in_decimals(q, t, a, step) for t, a in zip(tau_trial, safe, strict=True)]
        )
        static = 0 * safe
    if law == "ngf":
        friction = [
            oracle_fluidity.point(numbers(law), dt, *state)[0] if state[1] > 0 else Decimal(0)
            for state in zip(tau_trial / safe, p, *before(len(p)), strict=True)
        ]
        tau = np.array(friction) * safe
    if law in ("mu_I", "cohesive mu_I"):
        pressed, over = np.maximum(safe, Decimal(0)), tau_trial - cohesion
        S2, alpha = q["mu_2"] * pressed, q["xi"] * q["G"] * step * root(pressed)
        B, H = S2 + over + alpha, S2 * over + static * alpha
        tau = np.where(pressed > 0, (B - root(abs(B * B - 4 * H))) / 2, static)
    tau, static = tau + cohesion, static + cohesion
    yields = np.array([a > b for a, b in zip(tau_trial, static, strict=True)])
    yields |= law == "ngf"
    factor = np.where(yields, tau / np.where(yields, tau_trial, Decimal(1)), Decimal(1))
    new = factor[:, None, None] * deviator - safe[:, None, None] * identity
    new = np.where(dense[:, None, None], new, Decimal(0))
    gap = abs((tau_trial - static).astype(float))
    # Near p = 0 the root of p depends on the last bit of the trial, and near yield the branch does.
    clear = (abs(p.astype(float)) > 1e-3 * size) & (gap > 1e-6 * size)
    clear &= abs((p + strength).astype(float)) > 1e-3 * size
    return new, size, clear


def regularised_in_decimals(q, trial, p, dt):
    """Shear stress of the regularised mu(I): that of the oracle, made exact by Newton's method."""
    floats = {name: float(v) for name, v in q.items()}
    mu = Decimal(oracle.regularised(floats, float(trial), float(p), float(dt))) / p
    x1, alpha, k = q["I1"] / q["I0"], q["alpha"], q["mu_inf"] * q["I0"]
    B, m = q["xi"] * q["G"] * dt / p.sqrt(), trial / p
    mu_1 = (q["mu_s"] + (q["mu_2"] + k * x1) * x1) / (1 + x1)
    if m - B * x1 > mu_1:
        a, b = B + k, B + q["mu_2"] - m
        x = ((b * b + 4 * a * (m - q["mu_s"])).sqrt() - b) / (2 * a)
        return (m - B * x) * p
    for _ in range(3):
        x = x1 * (alpha / mu_1**2 - alpha / mu**2).exp()
        mu -= (mu + B * x - m) / (1 + 2 * alpha * B * x / mu**3)
    assert abs(mu + B * x1 * (alpha / mu_1**2 - alpha / mu**2).exp() - m) < Decimal("1e-30")
    return mu * p


@pytest.mark.parametrize("law", LAWS)
def test_stress_update_against_fifty_digits(law):
    rng = np.random.default_rng(len(law))
    worst, count, dense = 0.0, 0, 0
    with decimal.localcontext() as context:
        context.prec = 50
        for dt, dim in itertools.product((1e-7, 3e-6, 1e-4, 2e-3), (2, 3)):
            stress, Ldt, c = random_states(rng, 250, dim, law)
            found, _ = update(law, dim, stress, Ldt, c, dt)
            expected, size, clear = law_in_decimals(law, dim, stress, Ldt, dt)
            for k, (i, j) in enumerate(oracle.STRESS_PLACES[dim]):
                error = abs((exact(found[:, k]) - expected[:, i, j]).astype(float)) / size
                worst = max(worst, error[clear].max())
            count += clear.sum()
            dense += (clear & (expected[:, 0, 0] != 0)).sum()
    assert count >= dense >= 1_250
    assert worst <= 1e-13


@pytest.mark.parametrize("isa", ["baseline", ""])
@pytest.mark.parametrize("equation_of_state", [False, True])
@pytest.mark.parametrize("law", LAWS)
def test_stress_update_against_the_oracle(law, dim, equation_of_state, isa):
    """All branches: connected or disconnected by density and by pressure, elastic and flowing."""
    rng = np.random.default_rng(5)
    stress, Ldt, c = random_states(rng, 1500, dim, law, steepest=1.2)
    c = np.where(rng.random(len(c)) < 0.3, -c, c)
    dt = 1e-4
    L = np.zeros((len(c), 3, 3))
    L[:, :dim, :dim] = Ldt / dt
    s = oracle.tensor(stress, dim)
    if law == "ngf":
        start = before(len(c))
        expected, rate, *_ = oracle_nonlocal.ngf(
            numbers(law), s, L, c, dt, *start, equation_of_state
        )
    else:
        expected, rate = oracle.law(
            MATERIALS[law].law, numbers(law), s, L, c, dt, equation_of_state
        )
    found, found_rate = update(
        law, dim, stress, Ldt, c, dt, equation_of_state=equation_of_state, isa=isa
    )
    size = abs(stress).max(axis=1) + abs(Ldt).max(axis=(1, 2)) * numbers(law)["K"]
    size += numbers(law)["K"] * abs(c) * equation_of_state
    error = abs(found - oracle.components(expected, dim)).max(axis=1)
    assert (error <= 1e-12 * size).all()
    assert (abs(found_rate - rate) <= 1e-12 * size / (numbers(law)["G"] * dt)).all()
    if law != "elastic":
        free = ~found.any(axis=1)
        assert 0.1 < free.mean() < 0.7
        loosest = -numbers(law).get("tensile_strength", 0.0) / numbers(law)["K"]
        assert (free[c < loosest]).all()
        assert free[c < 0].all() == (loosest == 0)
        assert 0.05 < (found_rate > 0).mean() < 0.95


# ---- properties of every law ----


def rotations(rng, n, dim):
    """Random rotations in 2D or 3D, shape (n, 3, 3)."""
    if dim == 2:
        angle, Q = rng.uniform(0, 2 * math.pi, n), np.zeros((n, 3, 3))
        Q[:, 0, 0] = Q[:, 1, 1] = np.cos(angle)
        Q[:, 1, 0] = np.sin(angle)
        Q[:, 0, 1], Q[:, 2, 2] = -Q[:, 1, 0], 1.0
        return Q
    Q = np.linalg.qr(rng.normal(size=(n, 3, 3)))[0]
    return Q * np.linalg.det(Q)[:, None, None]


def pressure(stress):
    return -stress[:, :3].sum(axis=1) / 3


def shear(stress):
    """Equivalent shear stress (2.10)."""
    deviator = stress[:, :3] + pressure(stress)[:, None]
    return np.sqrt((deviator**2).sum(axis=1) / 2 + (stress[:, 3:] ** 2).sum(axis=1))


@pytest.mark.parametrize("axes", ["turned", "permuted"])
@pytest.mark.parametrize("law", LAWS)
def test_the_frame_in_which_a_state_is_written_does_not_matter(law, dim, axes):
    """The result is that of the other frame to round-off, also where axes are only exchanged."""
    rng = np.random.default_rng(1)
    stress, Ldt, c = random_states(rng, 500, dim, law)
    if axes == "turned":
        Q = rotations(rng, len(c), dim)
    else:
        Q = np.eye(3)[None, [1, 0, 2] if dim == 2 else [2, 0, 1]]
    turned = Q @ oracle.tensor(stress, dim) @ Q.transpose(0, 2, 1)
    R = Q[:, :dim, :dim]
    dt = 1e-4
    one, rate = update(law, dim, stress, Ldt, c, dt)
    other, other_rate = update(
        law, dim, oracle.components(turned, dim), R @ Ldt @ R.transpose(0, 2, 1), c, dt
    )
    expected = Q @ oracle.tensor(one, dim) @ Q.transpose(0, 2, 1)
    size = abs(stress).max(axis=1) + numbers(law)["K"] * abs(Ldt).max(axis=(1, 2))
    error = abs(other - oracle.components(expected, dim)).max(axis=1)
    if axes == "permuted":
        assert (error <= 1e-13 * size).all()
        assert (abs(other_rate - rate) <= 1e-12 * size / (numbers(law)["G"] * dt)).all()
        return
    # where the trial pressure is zero but for rounding, the branch may differ
    decided = abs(pressure(one)) > 1e-9 * size
    assert decided.mean() > 0.5
    assert (error <= 1e-12 * size)[decided].all()
    assert np.allclose(rate[decided], other_rate[decided], rtol=1e-9, atol=1e-9 / dt * 1e-6)


STILL = {"g_star": 0.0, "shear_rate": 0.0}
"""No fluidity, with which a nonlocal law does not flow."""


def spun(law, dim, stress, steps, angle):
    """Stresses after a rigid rotation by `angle` about z, in a number of steps."""
    w = angle / steps
    Ldt = np.zeros((len(stress), dim, dim))
    Ldt[:, 0, 1], Ldt[:, 1, 0] = -w, w
    for _ in range(steps):
        stress, _ = update(law, dim, stress, Ldt, np.full(len(stress), 1e-3), 1e-4, **STILL)
    return stress


@pytest.mark.parametrize("law", WITH_YIELD_STRESS)
def test_stress_turns_with_the_material(law, dim):
    """In a rigid rotation the errors of orientation and invariants decrease with the step."""
    rng = np.random.default_rng(2)
    stress, _, _ = random_states(rng, 50, dim, law, steepest=0.5)
    angle, Q = 1.0, np.eye(3)
    Q[:2, :2] = [[math.cos(angle), -math.sin(angle)], [math.sin(angle), math.cos(angle)]]
    expected = oracle.components(Q @ oracle.tensor(stress, dim) @ Q.T, dim)
    size = abs(stress).max()
    found = {steps: spun(law, dim, stress, steps, angle) for steps in (100, 200, 400)}
    turned = [abs(s - expected).max() / size for s in found.values()]
    assert turned[0] < 0.02
    assert all(1.8 < a / b < 2.2 for a, b in itertools.pairwise(turned))
    for s in found.values():
        np.testing.assert_allclose(pressure(s), pressure(stress), rtol=1e-12)
    grown = [abs(shear(s) / shear(stress) - 1).max() for s in found.values()]
    # the explicit Jaumann form scales in-plane shear stress by sqrt(1 + 4 w^2) in each step
    for steps, growth in zip(found, grown, strict=True):
        assert growth < 1.001 * ((1 + 4 * (angle / steps) ** 2) ** (steps / 2) - 1)


@pytest.mark.parametrize("law", WITH_YIELD_STRESS)
def test_no_strain_leaves_the_stress(law, dim):
    rng = np.random.default_rng(3)
    stress, Ldt, c = random_states(rng, 400, dim, law, steepest=0.55)
    found, rate = update(law, dim, stress, 0 * Ldt, c, 1e-4, **STILL)
    limit = numbers(law).get("mu_s", numbers(law).get("mu", math.inf))
    still = shear(stress) < 0.999 * limit * pressure(stress)
    assert still.sum() > 100
    np.testing.assert_allclose(found[still], stress[still], rtol=3e-15, atol=1e-15 * 3e4)
    assert not rate[still].any()


# ---- the nonlocal law ----


def nonlocal_states(rng, n, dim):
    """States of `random_states` of all kinds, a quarter of them disconnected."""
    stress, Ldt, c = random_states(rng, n, dim, "ngf", steepest=1.2)
    return stress, Ldt, np.where(rng.random(n) < 0.25, -c, c)


@pytest.mark.parametrize("isa", oracle_fluidity.available())
@pytest.mark.parametrize("equation_of_state", [False, True])
def test_without_diffused_fluidity_the_nonlocal_law_is_the_local_one(dim, equation_of_state, isa):
    """In its local phase the law equals mu(I) to the last bit, and g = gdot/mu."""
    state = nonlocal_states(np.random.default_rng(11), 3000, dim)
    options = {"equation_of_state": equation_of_state, "isa": isa}
    local = full_update("mu_I", dim, *state, 1e-4, **options)
    found, rate, g = full_update("ngf", dim, *state, 1e-4, **options)
    assert found.tobytes() == local[0].tobytes()
    assert rate.tobytes() == local[1].tobytes()
    flows = rate > 0
    assert 0.1 < flows.mean() < 0.9
    mu = shear(found)[flows] / pressure(found)[flows]
    np.testing.assert_allclose(g[flows], rate[flows] / mu, rtol=1e-9)
    assert not g[~flows].any()


@pytest.mark.parametrize("isa", oracle_fluidity.available())
def test_fluidity_against_the_oracle(dim, isa):
    """Points with and without earlier fluidity, dense or not; the rate is that of g mu."""
    stress, Ldt, c = nonlocal_states(np.random.default_rng(12), 3000, dim)
    dt, start = 1e-4, before(len(c))
    L = np.zeros((len(c), 3, 3))
    L[:, :dim, :dim] = Ldt / dt
    *_, expected, gain = oracle_nonlocal.ngf(
        numbers("ngf"), oracle.tensor(stress, dim), L, c, dt, *start
    )
    found, rate, g = full_update(
        "ngf", dim, stress, Ldt, c, dt, g_star=start[0], shear_rate=start[1], isa=isa
    )
    dense = found.any(axis=1)
    assert 0.2 < dense.mean() < 0.9
    assert not g[~dense].any() and not rate[~dense].any() and not gain[~dense].any()
    X = numbers("ngf")["G"] * dt * np.stack([g, expected]) / np.where(dense, pressure(found), 1.0)
    # where the trial pressure is a small difference, its friction depends on the last bits
    clear = dense & (pressure(found) > 1e-4 * abs(stress).max(axis=1))
    assert (abs(X[0] - X[1]) <= 1e-9 * X[1] + 1e-12)[clear].all()
    mu = shear(found)[clear] / pressure(found)[clear]
    np.testing.assert_allclose(rate[clear], (g[clear] * mu), rtol=1e-9, atol=1e-12)


def test_without_strain_friction_relaxes_by_the_fluidity_at_hand(dim):
    stress, Ldt, c = random_states(np.random.default_rng(13), 400, dim, "ngf")
    found, rate = update("ngf", dim, stress, 0 * Ldt, c, 1e-4)
    flows = before(len(c))[0] > 0
    mu, left = shear(stress) / pressure(stress), shear(found) / pressure(found)
    np.testing.assert_allclose(pressure(found), pressure(stress), rtol=1e-14)
    assert (left <= mu * (1 + 1e-14)).all()
    assert (left < mu)[flows & (rate > 1.0)].all()
    assert (rate > 0)[flows].all()


# ---- all that flow ----


@pytest.mark.parametrize("law", FRICTIONAL)
def test_flow_dissipates_and_friction_is_bounded(law, dim):
    rng = np.random.default_rng(4)
    stress, Ldt, c = random_states(rng, 4000, dim, law, steepest=0.99)
    dt = 1e-4
    found, rate = update(law, dim, stress, Ldt, c, dt)
    p, tau = pressure(found), shear(found)
    limit = numbers(law).get("mu_2", numbers(law).get("mu"))
    slow, bears = numbers(law).get("mu_s", numbers(law).get("mu")), found.any(axis=1)
    cohesion, strength = (numbers(law).get(name, 0.0) for name in ("cohesion", "tensile_strength"))
    assert (p > -strength * (1 + 1e-12) - 1e-300).all()
    if law == "regularised_mu_I":
        m = MATERIALS[law]
        limit = limit + m.mu_inf * m.I0 * rate / (m.xi * np.sqrt(np.where(p > 0, p, 1.0)))
    bound = np.where(p > 0, limit, slow) * p + cohesion * bears
    assert (tau <= bound + 1e-12 * (tau + cohesion)).all()
    assert (rate >= 0).all()
    assert (rate > 0).mean() > 0.2
    # power of the plastic strain rate: sigma_new : D_p >= 0, D_p = D - C^-1 (change of stress)
    trial, _ = update("elastic", dim, stress, Ldt, c, dt)
    G = numbers(law)["G"]
    plastic = (oracle.tensor(trial, dim) - oracle.tensor(found, dim)) / (2 * G)
    dev = oracle.tensor(found, dim) + p[:, None, None] * np.eye(3)
    power = np.einsum("pij,pij->p", dev, plastic) / dt
    dense = p > 0
    # slow flow is a difference of stresses, and accurate only to their rounding
    rounding = 1e-12 + 1e-15 * abs(oracle.tensor(trial, dim)).max(axis=(1, 2)) ** 2 / (G * dt)
    assert (power >= -1e-9 * tau * abs(rate) - rounding)[dense].all()
    np.testing.assert_allclose(power[dense], (tau * rate)[dense], rtol=1e-6, atol=1e-3)


@pytest.mark.parametrize("law", LAWS)
def test_2d_is_3d_without_its_third_axis(law):
    rng = np.random.default_rng(8)
    stress, Ldt, c = random_states(rng, 500, 2, law)
    dt = 1e-4
    plane, rate = update(law, 2, stress, Ldt, c, dt)
    wide = np.zeros((len(c), 3, 3))
    wide[:, :2, :2] = Ldt
    space, space_rate = update(law, 3, np.pad(stress, ((0, 0), (0, 2))), wide, c, dt)
    assert not space[:, 4:].any()
    size = abs(stress).max(axis=1) + numbers(law)["K"] * abs(Ldt).max(axis=(1, 2))
    assert (abs(space[:, :4] - plane).max(axis=1) <= 1e-13 * size).all()
    assert (abs(space_rate - rate) <= 1e-12 * size / (numbers(law)["G"] * dt)).all()


def test_every_registered_law_is_tested():
    """Each law is tested here, except those of finite strain, that dilate, and that of the user.

    They are in test_unit_hencky.py, test_unit_hardening.py, test_verification_dilatant.py and
    test_verification_own_laws.py.
    """
    finite = {law for law in _core.laws() if law.startswith("hencky_")}
    assert finite == set(FLOW_OF) | {"hencky_hardening_drucker_prager"}
    plain = {law: m for law, m in MATERIALS.items() if not law.startswith("cohesive")}
    assert set(plain) == set(_core.laws()) - finite - {"own", "dilatant_mu_I"}
    for law, material in plain.items():
        assert material.law == law
        if law == "regularised_mu_I":
            continue  # which has hypoelasticity alone
        assert material.replace(elasticity="hencky").law == f"hencky_{law}" in finite

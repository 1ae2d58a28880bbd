"""The stress update of every registered law: 50 digits, the oracle, and its properties."""

import decimal
import itertools
import math
from decimal import Decimal

import numpy as np
import oracle_law as oracle
import pytest

from granular import _core
from granular.materials import DruckerPrager, Elastic, MuI

MATERIALS = {
    "elastic": Elastic(E=1e7),
    "drucker_prager": DruckerPrager(E=1e7),
    "mu_i": MuI(E=1e7),
}

LAWS = sorted(_core.laws())
FRICTIONAL = [law for law in LAWS if law != "elastic"]


def numbers(law):
    """The law's parameters, moduli included."""
    material = MATERIALS[law]
    return vars(material) | {"K": material.K, "G": material.G}


def update(law, dim, stress, Ldt, log_density, dt, *, equation_of_state=False, isa=""):
    """`_core.law_update`: stress (n, 4 or 6), L dt (n, dim, dim); new stress and rates."""
    lanes = {"baseline": 2, "avx2": 4, "avx512": 8}[isa or _core.build_info()["isa"]]
    n = len(stress)
    padded = -(-n // lanes) * lanes
    gradient = np.zeros((padded, dim * dim))
    gradient[:n] = Ldt.reshape(n, -1)
    gradient = np.ascontiguousarray(gradient.reshape(-1, lanes, dim * dim).transpose(0, 2, 1))
    density, rate = np.zeros(padded), np.zeros(padded)
    density[:n] = log_density
    new = np.zeros((stress.shape[1], padded))
    new[:, :n] = stress.T
    parameters = {name: numbers(law)[name] for name, *_ in _core.laws()[law][1]}
    _core.law_update(
        law, dim, parameters, dt, int(equation_of_state), gradient, density, new, rate, isa
    )
    return new[:, :n].T.copy(), rate[:n].copy()


def random_states(rng, n, dim, law, steepest=0.9):
    """Stresses below the limit friction, increments L dt and log-densities, all of broad sizes."""
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
    """Doubles as decimal numbers, without rounding."""
    return np.vectorize(Decimal, otypes=[object])(array)


root = np.vectorize(lambda a: a.sqrt(), otypes=[object])


def law_in_decimals(law, dim, stress, Ldt, dt):
    """The update (3.10-3.16) of dense points in exact numbers, and what decides its branches."""
    q = {name: Decimal(float(v)) for name, v in numbers(law).items() if isinstance(v, float)}
    K, G, step = q["K"], q["G"], Decimal(dt)
    zero = np.full(len(stress), Decimal(0), dtype=object)
    L = np.array([[zero] * 3] * 3, dtype=object)
    for i in range(dim):
        for j in range(dim):
            L[i, j] = exact(Ldt[:, i, j])
    s = np.array([[zero] * 3] * 3, dtype=object)
    for c, (i, j) in enumerate(oracle.STRESS_PLACES[dim]):
        s[i, j] = s[j, i] = exact(stress[:, c])
    D, W = (L + L.transpose(1, 0, 2)) / 2, (L - L.transpose(1, 0, 2)) / 2
    volumetric = D[0, 0] + D[1, 1] + D[2, 2]
    added = 2 * G * D
    for i in range(3):
        added[i, i] = added[i, i] + (K - 2 * G / 3) * volumetric
    size = abs(np.concatenate([added.astype(float), s.astype(float)])).max(axis=(0, 1))
    trial = s + added
    for i in range(3):
        for j in range(3):
            for k in range(3):
                trial[i, j] = trial[i, j] + W[i, k] * s[k, j] - s[i, k] * W[k, j]
    if law == "elastic":
        return trial, size, np.ones(len(stress), dtype=bool)
    p = -(trial[0, 0] + trial[1, 1] + trial[2, 2]) / 3
    deviator = trial.copy()
    for i in range(3):
        deviator[i, i] = deviator[i, i] + p
    tau_trial = root(sum(deviator[i, j] ** 2 for i in range(3) for j in range(3)) / 2)
    dense = np.array([a > 0 for a in p])
    safe = np.where(dense, p, Decimal(1))
    static = (q["mu_s"] if law == "mu_i" else q["mu"]) * safe
    tau = static
    if law == "mu_i":
        S2, alpha = q["mu_2"] * safe, q["xi"] * G * step * root(safe)
        B, H = S2 + tau_trial + alpha, S2 * tau_trial + static * alpha
        tau = (B - root(B * B - 4 * H)) / 2
    yields = np.array([a > b for a, b in zip(tau_trial, static, strict=True)])
    factor = np.where(yields, tau / np.where(yields, tau_trial, Decimal(1)), Decimal(1))
    new = factor * deviator
    for i in range(3):
        new[i, i] = new[i, i] - safe
    new = np.where(dense, new, Decimal(0))
    gap = abs((tau_trial - static).astype(float))
    # Near p = 0 the square root of p, and at yield the branch, hang on the last bit of the trial.
    clear = (abs(p.astype(float)) > 1e-3 * size) & (gap > 1e-6 * size)
    return new, size, clear


@pytest.mark.parametrize("law", LAWS)
def test_stress_update_against_fifty_digits(law, dim):
    rng = np.random.default_rng(len(law))
    worst, count, dense = 0.0, 0, 0
    with decimal.localcontext() as context:
        context.prec = 50
        for dt in (1e-7, 3e-6, 1e-4, 2e-3):
            stress, Ldt, c = random_states(rng, 4000, dim, law)
            found, _ = update(law, dim, stress, Ldt, c, dt)
            expected, size, clear = law_in_decimals(law, dim, stress, Ldt, dt)
            for k, (i, j) in enumerate(oracle.STRESS_PLACES[dim]):
                error = abs((exact(found[:, k]) - expected[i, j]).astype(float)) / size
                worst = max(worst, error[clear].max())
            count += clear.sum()
            dense += (clear & (expected[0, 0] != 0)).sum()
    assert count >= dense >= 10_000
    assert worst <= 1e-13


@pytest.mark.parametrize("isa", ["baseline", ""])
@pytest.mark.parametrize("equation_of_state", [False, True])
@pytest.mark.parametrize("law", LAWS)
def test_stress_update_against_the_oracle(law, dim, equation_of_state, isa):
    """With all branches: connected or not by density and by pressure, elastic and flowing."""
    rng = np.random.default_rng(5)
    stress, Ldt, c = random_states(rng, 1500, dim, law, steepest=1.2)
    c = np.where(rng.random(len(c)) < 0.3, -c, c)
    dt = 1e-4
    L = np.zeros((len(c), 3, 3))
    L[:, :dim, :dim] = Ldt / dt
    s = oracle.tensor(stress, dim)
    expected, rate = oracle.law(law, numbers(law), s, L, c, dt, equation_of_state)
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
        assert (free[c < 0]).all()
        assert 0.05 < (found_rate > 0).mean() < 0.95


# ---- properties of every law ----


def rotations(rng, n, dim):
    """Random rotations of the plane or of space, shape (n, 3, 3)."""
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


@pytest.mark.parametrize("law", LAWS)
def test_the_frame_in_which_a_state_is_written_does_not_matter(law, dim):
    rng = np.random.default_rng(1)
    stress, Ldt, c = random_states(rng, 500, dim, law)
    Q = rotations(rng, len(c), dim)
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
    # where the trial pressure is a rounding error from zero the branch may differ
    decided = abs(pressure(one)) > 1e-9 * size
    assert decided.mean() > 0.5
    assert (error <= 1e-12 * size)[decided].all()
    assert np.allclose(rate[decided], other_rate[decided], rtol=1e-9, atol=1e-9 / dt * 1e-6)


def spun(law, dim, stress, steps, angle):
    """The stresses after a rigid rotation by `angle` about z in so many steps."""
    w = angle / steps
    Ldt = np.zeros((len(stress), dim, dim))
    Ldt[:, 0, 1], Ldt[:, 1, 0] = -w, w
    for _ in range(steps):
        stress, _ = update(law, dim, stress, Ldt, np.full(len(stress), 1e-3), 1e-4)
    return stress


@pytest.mark.parametrize("law", LAWS)
def test_stress_turns_with_the_material(law, dim):
    """Rigid rotation: error of the orientation and of the invariants falls with the step."""
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
    # the explicit Jaumann form lengthens a shear in the plane of rotation by sqrt(1 + 4 w^2) a step
    for steps, growth in zip(found, grown, strict=True):
        assert growth < 1.001 * ((1 + 4 * (angle / steps) ** 2) ** (steps / 2) - 1)


@pytest.mark.parametrize("law", LAWS)
def test_no_strain_leaves_the_stress(law, dim):
    rng = np.random.default_rng(3)
    stress, Ldt, c = random_states(rng, 400, dim, law, steepest=0.55)
    found, rate = update(law, dim, stress, 0 * Ldt, c, 1e-4)
    limit = numbers(law).get("mu_s", numbers(law).get("mu", math.inf))
    still = shear(stress) < 0.999 * limit * pressure(stress)
    assert still.sum() > 100
    np.testing.assert_allclose(found[still], stress[still], rtol=3e-15, atol=1e-15 * 3e4)
    assert not rate[still].any()


@pytest.mark.parametrize("law", FRICTIONAL)
def test_flow_dissipates_and_friction_is_bounded(law, dim):
    rng = np.random.default_rng(4)
    stress, Ldt, c = random_states(rng, 4000, dim, law, steepest=0.99)
    dt = 1e-4
    found, rate = update(law, dim, stress, Ldt, c, dt)
    p, tau = pressure(found), shear(found)
    limit = numbers(law).get("mu_2", numbers(law).get("mu"))
    assert (p >= 0).all()
    assert (tau <= limit * p * (1 + 1e-12)).all()
    assert (rate >= 0).all()
    assert (rate > 0).mean() > 0.2
    # power of the plastic strain rate: sigma_new : D_p >= 0, D_p = D - C^-1 (change of stress)
    trial, _ = update("elastic", dim, stress, Ldt, c, dt)
    G = numbers(law)["G"]
    plastic = (oracle.tensor(trial, dim) - oracle.tensor(found, dim)) / (2 * G)
    dev = oracle.tensor(found, dim) + p[:, None, None] * np.eye(3)
    power = np.einsum("pij,pij->p", dev, plastic) / dt
    dense = p > 0
    assert (power[dense] >= -1e-9 * (tau * abs(rate))[dense] - 1e-12).all()
    np.testing.assert_allclose(power[dense], (tau * rate)[dense], rtol=1e-6, atol=1e-3)


@pytest.mark.parametrize("law", LAWS)
def test_axes_are_alike(law, dim):
    """A permutation of the axes permutes the result, to round-off."""
    rng = np.random.default_rng(6)
    stress, Ldt, c = random_states(rng, 300, dim, law)
    dt = 1e-4
    one, rate = update(law, dim, stress, Ldt, c, dt)
    order = [1, 0, 2] if dim == 2 else [2, 0, 1]
    s = oracle.tensor(stress, dim)[:, order][:, :, order]
    near = order[:dim]
    other, other_rate = update(law, dim, oracle.components(s, dim), Ldt[:, near][:, :, near], c, dt)
    expected = oracle.components(oracle.tensor(one, dim)[:, order][:, :, order], dim)
    size = abs(stress).max(axis=1) + numbers(law)["K"] * abs(Ldt).max(axis=(1, 2))
    assert (abs(other - expected).max(axis=1) <= 1e-13 * size).all()
    assert (abs(other_rate - rate) <= 1e-12 * size / (numbers(law)["G"] * dt)).all()


@pytest.mark.parametrize("law", LAWS)
def test_the_plane_is_space_without_its_third_axis(law):
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
    assert set(MATERIALS) == set(_core.laws())
    assert {material.law for material in MATERIALS.values()} == set(_core.laws())

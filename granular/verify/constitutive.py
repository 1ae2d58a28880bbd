"""The stress update alone, against 50-digit arithmetic and against appendix B."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from decimal import Decimal, localcontext
from functools import lru_cache
from typing import Any, cast

import numpy as np

from granular import _core, materials
from granular.materials import Material, MuI
from granular.theory import appendix_b_velocity_gradient, reference
from granular.tools.arrays import Array
from granular.verify.rows import Row, at_least, at_most, check, within

STEPS = (1e-3, 5e-4, 2.5e-4, 1.25e-4, 6.25e-5)
"""Time steps of appendix B [s]."""

DURATION = 1.25
"""Duration of appendix B [s]."""

SEPARATION = 500.0
"""The disconnected start is stress-free, at rho = rho_c exp(-SEPARATION/K) [Pa]."""


@lru_cache(maxsize=8)  # as `constitutive_path` needs them at each step
def law_parameters(material: Material) -> dict[str, float]:
    """Parameters of the material by the names of the C core."""
    known = {**material.arguments(), "K": material.K, "G": material.G}
    for derived in ("xi", "tensile_strength", "phi_fast"):
        if hasattr(material, derived):
            known[derived] = getattr(material, derived)
    names = [name for name, _, _ in _core.laws()[material.law][1]]
    return {name: known[name] for name in names}


def update(
    material: Material,
    dt: float,
    gradient: Array,
    log_density: Array,
    stress: Array,
    *,
    pressure_from_density: bool = False,
) -> tuple[Array, Array]:
    """One stress update of n points by the C core, in 2D.

    Parameters
    ----------
    gradient : ndarray, shape (n, 4)
        L dt: xx, xy, yx, yy.
    log_density : ndarray, shape (n,)
        At the end of the step.
    stress : ndarray, shape (n, 4)
        At its beginning [Pa].

    Returns
    -------
    stress, shear_rate : ndarray, shape (n, 4), (n,)
    """
    lanes, n = _core.build_info()["lanes"], len(log_density)
    blocks = -(-n // lanes)

    def filled(rows: Array) -> Array:
        out = np.zeros((rows.shape[0], blocks * lanes))
        out[:, :n] = rows
        return out

    packed = np.ascontiguousarray(filled(gradient.T).reshape(4, blocks, lanes).swapaxes(0, 1))
    density, out = filled(log_density[None])[0], filled(stress.T)
    rate = np.zeros(blocks * lanes)
    _core.law_update(
        material.law,
        2,
        law_parameters(material),
        dt,
        int(pressure_from_density),
        packed,
        density,
        out,
        rate,
        "",
    )
    return out[:, :n].T.copy(), rate[:n]


def constitutive_path(
    material: Material,
    p0: float,
    dt: float,
    *,
    log_density0: float | None = None,
    at: float = 1.0,
    pressure_from_density: bool = False,
    duration: float = DURATION,
    velocity_gradient: Callable[[Array], Array] = appendix_b_velocity_gradient,
) -> tuple[Array, Array]:
    """Stress history of one point driven through the law of the core (appendix B).

    Parameters
    ----------
    material : Material
        Material whose law is run.
    p0 : float
        Initial isotropic pressure [Pa].
    dt : float
        Time step [s].
    log_density0 : float, optional
        Initial ln(rho/rho_c); p0/K by default.
    at : float
        Instant of a step at which L is evaluated: 1 is its end, as in the paper, 0.5 its middle.
    pressure_from_density : bool
        If True, the law takes the pressure from the density instead of integrating it.
    duration : float
        Duration [s].
    velocity_gradient : callable
        Function of times [s], shape (k,), that returns the velocity gradient L, shape (k, 2, 2)
        [1/s].

    Returns
    -------
    times, stress : ndarray, shape (nt,), (nt, 4)
        Times [s] and stresses [Pa], the initial state first.
    """
    steps = round(duration / dt)
    gradient = velocity_gradient((np.arange(steps, dtype=float) + at) * dt).reshape(steps, 4) * dt
    start = p0 / material.K if log_density0 is None else log_density0
    log_density = start - np.cumsum(gradient[:, 0] + gradient[:, 3])
    stress = np.zeros((steps + 1, 4))
    stress[0, :3] = -p0
    for k in range(steps):
        rows = (array[k : k + 1] for array in (gradient, log_density, stress))
        stress[k + 1] = update(material, dt, *rows, pressure_from_density=pressure_from_density)[0]
    return dt * np.arange(steps + 1, dtype=float), stress


def path_errors(
    material: Material,
    p0: float,
    steps: Sequence[float] = STEPS,
    *,
    log_density0: float | None = None,
    **path: Any,
) -> Array:
    """Largest error of a stress component at any step, divided by the largest stress, per dt.

    Further keywords are passed to `constitutive_path`.
    """
    finest = round(DURATION / min(steps))
    times = np.arange(finest + 1) * (DURATION / finest)
    exact = reference(cast(MuI, material), p0, times, log_density0).stress
    errors = []
    for dt in steps:
        _, stress = constitutive_path(material, p0, dt, log_density0=log_density0, **path)
        stride = finest // (len(stress) - 1)
        errors.append(np.abs(stress - exact[::stride]).max() / np.abs(exact).max())
    return np.array(errors)


def orders(errors: Array) -> Array:
    """Order of convergence between each dt and its half."""
    return np.log2(errors[:-1] / errors[1:])


def random_states(material: MuI, n: int, seed: int = 0) -> tuple[Array, Array, Array]:
    """Increments L dt, log-densities and stresses of dense points, away from branch switches.

    The pressures are 1 Pa to 1 MPa. The increments change the stress by a thousandth of the
    pressure up to a few times the pressure. Only states are used whose trial pressure is at least a
    tenth of the scale of their stress and whose trial friction differs from mu_s by 1 % or more.
    """
    rng = np.random.default_rng(seed)
    p = 10 ** rng.uniform(0, 6, 4 * n)
    size = p / material.G * 10 ** rng.uniform(-3, 0.5, 4 * n)
    gradient = rng.uniform(-1, 1, (4 * n, 4)) * size[:, None]
    stress = rng.uniform(-0.3, 0.3, (4 * n, 4)) * p[:, None]
    stress[:, :3] -= p[:, None]
    trace = gradient[:, 0] + gradient[:, 3]
    p_trial = -stress[:, :3].sum(axis=1) / 3 - material.K * trace
    scale = np.abs(stress).max(axis=1) + material.K * np.abs(gradient).max(axis=1)
    shear = stress - (stress[:, :3].sum(axis=1) / 3)[:, None] * [1, 1, 1, 0]
    shear += 2 * material.G * (gradient[:, [0, 3, 0, 1]] * [1, 1, 0, 0.5])
    shear[:, 3] += material.G * gradient[:, 2]
    shear[:, :3] -= 2 * material.G / 3 * trace[:, None]
    tau = np.sqrt((shear[:, :3] ** 2).sum(axis=1) / 2 + shear[:, 3] ** 2)
    usable = (p_trial > 0.1 * scale) & (np.abs(tau / (material.mu_s * p_trial) - 1) > 0.01)
    usable = np.flatnonzero(usable)[:n]
    return gradient[usable], p[usable] / material.K, stress[usable]


def update_50_digits(material: MuI, dt: float, gradient: Array, stress: Array) -> Array:
    """The stress update of one dense point (eqs 3.10-3.16) with 50 digits, shape (4,).

    The root of the quadratic is the textbook formula: with 50 digits its cancellation is harmless.
    """
    with localcontext() as context:
        context.prec = 50
        K, G, xi = Decimal(material.K), Decimal(material.G), Decimal(material.xi)
        mu_s, mu_2 = Decimal(material.mu_s), Decimal(material.mu_2)
        exx, lxy, lyx, eyy = map(Decimal, gradient.tolist())
        sxx, syy, szz, sxy = map(Decimal, stress.tolist())
        bulk, w = (K - 2 * G / 3) * (exx + eyy), (lxy - lyx) / 2
        trial = [
            sxx + bulk + 2 * G * exx + 2 * w * sxy,
            syy + bulk + 2 * G * eyy - 2 * w * sxy,
            szz + bulk,
            sxy + G * (lxy + lyx) + w * (syy - sxx),
        ]
        p = -(trial[0] + trial[1] + trial[2]) / 3
        deviator = [trial[0] + p, trial[1] + p, trial[2] + p, trial[3]]
        square = sum((s * s for s in deviator[:3]), Decimal(0)) / 2 + deviator[3] ** 2
        tau_trial = tau = square.sqrt()
        if tau_trial > mu_s * p:
            alpha = xi * G * Decimal(dt) * p.sqrt()
            B, H = mu_2 * p + tau_trial + alpha, mu_2 * p * tau_trial + mu_s * p * alpha
            tau = (B - (B * B - 4 * H).sqrt()) / 2
        pressure = (p, p, p, Decimal(0))
        return np.array(
            [float(tau / tau_trial * s - q) for s, q in zip(deviator, pressure, strict=True)]
        )


@check()
def stress_update() -> Iterator[Row]:
    """The stress update against 50-digit arithmetic, 10^4 random states, dt = 1e-5 s."""
    material, dt = materials.glass_beads, 1e-5
    gradient, log_density, stress = random_states(material, 10_000)
    result = update(material, dt, gradient, log_density, stress)[0]
    exact = np.array(
        [update_50_digits(material, dt, g, s) for g, s in zip(gradient, stress, strict=True)]
    )
    volumetric = (material.K - 2 * material.G / 3) * (gradient[:, 0] + gradient[:, 3])
    change = np.stack(
        [
            volumetric + 2 * material.G * gradient[:, 0],
            volumetric + 2 * material.G * gradient[:, 3],
            volumetric,
            material.G * (gradient[:, 1] + gradient[:, 2]),
        ],
        axis=1,
    )
    scale = np.maximum(np.abs(stress).max(axis=1), np.abs(change).max(axis=1))
    yield within("states", len(result), 10_000, 0)
    yield at_most("largest error", float((np.abs(result - exact).max(axis=1) / scale).max()), 1e-13)


@check()
def appendix_b() -> Iterator[Row]:
    """Appendix B: E = 1e4 Pa, dt = 1e-3 to 6.25e-5 s, against RK45; errors / max |sigma|."""
    soft = materials.glass_beads.replace(E=1e4)
    for p0 in (500.0, 100.0):
        end = path_errors(soft, p0)
        middle = path_errors(soft, p0, at=0.5)
        worst = orders(end)[np.argmax(np.abs(orders(end) - 1))]
        yield at_most(f"error at dt = 1e-3, p0 = {p0:g}", end[0], 4.0e-3)
        yield within(f"order, the worst of 4 halvings, p0 = {p0:g}", worst, 1.0, 0.03)
        gain = float((end / middle).min())
        yield at_least(f"gain of L at mid-step, least of 5 dt, p0 = {p0:g}", gain, 10.0)
    errors = path_errors(soft, 0.0, log_density0=-SEPARATION / soft.K, pressure_from_density=True)
    fit = -np.polyfit(np.arange(len(STEPS)), np.log2(errors), 1)[0]
    yield at_least("order, disconnected start, equation of state", fit, 0.9)
    yield at_least("the least of its 4 halvings", orders(errors).min(), 0.9)

"""Plain reference for the finite-strain law: matrix functions, ODEs.

Full matrices (..., 3, 3) throughout; only `update` calls `granular._core`.
"""

import math
from itertools import pairwise

import numpy as np
import oracle_law
from scipy.integrate import solve_ivp
from scipy.linalg import expm

from granular import _core

SAND = {
    "K": 1e6, "G": 5e5, "mu_s": 0.3819, "mu_2": 0.6435, "I0": 0.278, "rho_s": 2550.0, "d": 0.004,
    "t0": 1e-4, "p_averaging": 0.0, "reconnect_fluidity": 1.0,
}  # fmt: skip
FLOWS = ("elastic", "drucker_prager", "linear_mu_I", "mu_I", "linear_ngf", "ngf")
FLOW_OF = {
    "hencky_elastic": ("elastic", "elastic"),
    "hencky_drucker_prager": ("drucker_prager", "drucker_prager"),
    "hencky_mu_I": ("mu_I", "mu_I"),
    "hencky_linear_mu_I": ("linear_mu_I", "linear_mu_I"),
    "hencky_ngf": ("ngf", "mu_I"),
    "hencky_linear_ngf": ("linear_ngf", "linear_mu_I"),
}
"""Flow rule of each law, and that of its local phase."""


# ---- between the arrays of the core and matrices ----


def components(stress, dim):
    """(4|6, n) of matrices (n, 3, 3)."""
    return np.ascontiguousarray(oracle_law.components(stress, dim).T)


def matrices(stress):
    """(n, 3, 3) of components (4|6, n)."""
    return oracle_law.tensor(stress.T, 2 if len(stress) == 4 else 3)


def gradients(step, dim):
    """(dim*dim, n) of L dt (n, 3, 3)."""
    return np.ascontiguousarray(step[:, :dim, :dim].reshape(len(step), dim * dim).T)


def update(flow, q, dt, step, c, stress, g, rate, *, dim=3, isa=""):
    """Apply `_core.hencky_update` to matrices; return stress, g and shear rate after the step."""
    n = len(step)
    rows = components(stress, dim)
    g, rate = (np.array(np.broadcast_to(a, n), dtype=float) for a in (g, rate))
    c = np.array(np.broadcast_to(c, n), dtype=float)
    _core.hencky_update(flow, q, dt, gradients(step, dim), c, rows, g, rate, isa)
    return matrices(rows), g, rate


# ---- one step ----


def deviator(a):
    return a - np.trace(a, axis1=-2, axis2=-1)[..., None, None] / 3 * np.eye(3)


def function_of(a, f):
    """Function of symmetric matrices, through their eigenvalues."""
    value, vector = np.linalg.eigh(a)
    return np.einsum("...ik,...k,...jk->...ij", vector, f(value), vector)


def shear(stress):
    """Equivalent shear stress."""
    s = deviator(stress)
    return np.sqrt((s * s).sum(axis=(-2, -1)) / 2)


def trial_strain(h, step):
    """Deviator of the logarithmic strain after F = exp(dev L dt), by scipy and LAPACK."""
    F = expm(deviator(step))
    b = F @ function_of(2 * h, np.exp) @ np.swapaxes(F, -1, -2)
    return deviator(function_of(b, lambda value: np.log(value) / 2))


def friction(flow, q, dt, m, p, g_star, rate):
    """Friction and fluidity of one point after a step from its trial friction m, by bisection."""
    dmu, grain = q["mu_2"] - q["mu_s"], q["d"] * math.sqrt(q["rho_s"] / p)

    def slip(mu):  # shear rate that would change the friction from m to mu
        return (m - mu) * p / (q["G"] * dt)

    if flow == "drucker_prager":
        mu = min(m, q["mu_s"])
        return mu, slip(mu) / mu if mu else 0.0
    if flow.endswith("mu_I"):
        if m <= q["mu_s"]:
            return m, 0.0

        def excess(mu):  # increases with mu
            inertial = slip(mu) * grain
            most = 0.0 if flow.startswith("linear") else inertial
            return mu - q["mu_s"] - dmu * inertial / (most + q["I0"])

        mu = bisected(excess, q["mu_s"], m)
        return mu, slip(mu) / mu
    theta = dt / q["t0"]

    def left(g):  # residual of the fluidity equation over g, which increases with g
        mu = m / (1 + q["G"] * dt * g / p)
        drive = (q["mu_s"] - mu) * (1.0 if flow.startswith("linear") else dmu / (q["mu_2"] - mu))
        return 1 + theta * (drive + dmu / q["I0"] * grain * rate) - g_star / g

    low, high = 1e-300, 1.0
    if not flow.startswith("linear") and m >= q["mu_2"]:
        low = (m / q["mu_2"] - 1) * p / (q["G"] * dt) * (1 + 1e-15)
    while high <= low or left(high) < 0:
        high *= 4
    g = math.exp(bisected(lambda x: left(math.exp(x)), math.log(low), math.log(high)))
    return m / (1 + q["G"] * dt * g / p), g


def bisected(f, low, high):
    """Zero of the increasing function f."""
    for _ in range(200):
        middle = (low + high) / 2
        low, high = (low, middle) if f(middle) > 0 else (middle, high)
    return (low + high) / 2


# ---- in time ----


def stepped(flow, q, gradient, times, *, p0, g0=1.0, substeps=1):
    """Stress, g and shear rate at `times` by steps of the core, with L in the middle of each step.

    One point that starts from an isotropic pressure, without diffusion of the fluidity.
    """
    c, stress = np.array([p0 / q["K"]]), -p0 * np.eye(3)[None]
    g, rate = np.array([g0]), np.array([0.0])
    found = [(stress[0], g[0], rate[0])]
    for a, b in pairwise(times):
        dt = (b - a) / substeps
        for k in range(substeps):
            step = np.asarray(gradient(a + (k + 0.5) * dt))[None] * dt
            c = c - np.trace(step, axis1=1, axis2=2)
            stress, g, rate = update(flow, q, dt, step, c, stress, g, rate)
        found.append((stress[0], g[0], rate[0]))
    return tuple(np.array(part) for part in zip(*found, strict=True))


def plastic_rate(flow, q, p, tau, g):
    """Plastic shear rate of the continuous law."""
    mu, grain = tau / p, q["d"] * math.sqrt(q["rho_s"] / p)
    if flow.endswith("ngf"):
        return mu * g
    over = max(mu - q["mu_s"], 0.0)
    span = q["mu_2"] - (q["mu_s"] if flow.startswith("linear") else mu)
    return q["I0"] / grain * over / max(span, 1e-12)


def continuous(flow, q, gradient, times, *, p0, g0=1.0, rtol=1e-10):
    """Stress and g at `times` as in `stepped`, by scipy's Radau in the unknowns b_e, c and ln g.

    db/dt = L b + b L^T - (gdot/tau) s b, less what changes its determinant.
    """
    dmu = q["mu_2"] - q["mu_s"]

    def parts(y):
        b, c = y[:9].reshape(3, 3), y[9]
        s = 2 * q["G"] * deviator(function_of((b + b.T) / 2, lambda value: np.log(value) / 2))
        # the finite differences of the Jacobian try any value where the result does not depend on
        # it
        return b, q["K"] * c, s, shear(s), math.exp(min(y[10], 700.0))

    def rates(t, y):
        b, p, s, tau, g = parts(y)
        L = np.asarray(gradient(t))
        slip = plastic_rate(flow, q, p, tau, g)
        D = deviator(L)
        db = D @ b + b @ D.T - (slip / max(tau, 1e-12 * p)) * s @ b
        grow = 0.0
        if flow.endswith("ngf"):
            mu = tau / p
            share = 1.0 if flow.startswith("linear") else dmu / (q["mu_2"] - mu)
            drive = (mu - q["mu_s"]) * share
            sink = dmu / q["I0"] * q["d"] * math.sqrt(q["rho_s"] / p) * mu * g
            grow = (drive - sink) / q["t0"]
        return np.concatenate([db.ravel(), [-np.trace(L), grow]])

    start = np.concatenate([np.eye(3).ravel(), [p0 / q["K"], math.log(g0)]])
    found = solve_ivp(
        rates, (times[0], times[-1]), start, "Radau", times, rtol=rtol, atol=1e-13, max_step=0.02
    )
    assert found.success, found.message
    stress, g = [], []
    for y in found.y.T:
        _, p, s, _, fluidity = parts(y)
        stress.append(s - p * np.eye(3))
        g.append(fluidity)
    return np.array(stress), np.array(g)

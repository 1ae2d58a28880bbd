"""Plain reference for constitutive laws, and conversion of stresses to matrices."""

import math

import numpy as np

STRESS_PLACES = {2: ((0, 0), (1, 1), (2, 2), (0, 1)),
                 3: ((0, 0), (1, 1), (2, 2), (0, 1), (1, 2), (0, 2))}  # fmt: skip


def tensor(components, dim):
    """Components (n, 4 or 6) as symmetric matrices (n, 3, 3)."""
    out = np.zeros((len(components), 3, 3), dtype=components.dtype)
    for c, (i, j) in enumerate(STRESS_PLACES[dim]):
        out[:, i, j] = out[:, j, i] = components[:, c]
    return out


def components(matrices, dim):
    """Components of symmetric matrices, shape (n, 4 or 6)."""
    return np.stack([matrices[:, i, j] for i, j in STRESS_PLACES[dim]], axis=1)


def law(name, q, stress, L, log_density, dt, equation_of_state=False):
    """Update stresses (n, 3, 3) under velocity gradients L (n, 3, 3) over the time dt.

    Returns the new stresses and the equivalent plastic shear rates (n,).
    """
    p, deviator = split_trial(q, stress, L, dt)
    identity = np.eye(3)
    if name == "elastic":
        return deviator - p[:, None, None] * identity, np.zeros(len(stress))
    if equation_of_state:
        p = q["K"] * log_density
    strength = q.get("tensile_strength", 0.0)
    dense = (log_density >= -strength / q["K"]) & (p > -strength)
    p = np.where(dense, p, 0.0)
    tau_trial = np.sqrt(np.einsum("pij,pij->p", deviator, deviator) / 2)
    tau = np.array(
        [returned(name, q, t, pressure, dt) for t, pressure in zip(tau_trial, p, strict=True)]
    )
    scale = np.divide(tau, tau_trial, out=np.ones_like(tau), where=tau_trial > 0)
    new = scale[:, None, None] * deviator - p[:, None, None] * identity
    new[~dense] = 0.0
    rate = np.where(dense, (tau_trial - tau) / (q["G"] * dt), 0.0)
    return new, rate


def split_trial(q, stress, L, dt):
    """Pressure (n,) and deviator (n, 3, 3) of the elastic trial stress, of floats or decimals."""
    identity = np.eye(3, dtype=int)
    D, W = (L + L.transpose(0, 2, 1)) / 2, (L - L.transpose(0, 2, 1)) / 2
    volumetric = np.trace(D, axis1=1, axis2=2)[:, None, None] * identity
    elastic = (q["K"] - 2 * q["G"] / 3) * volumetric + 2 * q["G"] * D
    trial = stress + dt * (elastic + W @ stress - stress @ W)
    p = -np.trace(trial, axis1=1, axis2=2) / 3
    return p, trial + p[:, None, None] * identity


def returned(name, q, trial, p, dt):
    """Shear stress after the return to yield, or after the flow of the regularised mu(I).

    Bisection on tau_trial - tau = G dt gamma(tau) (2.13-2.15).
    """
    if name == "regularised_mu_I":
        return regularised(q, trial, p, dt)
    slow = q["mu_s"] if name == "mu_I" else q["mu"]
    cohesion = q.get("cohesion", 0.0)
    if trial <= cohesion + slow * p:
        return trial
    if name == "drucker_prager" or p <= 0:
        return max(0.0, cohesion + slow * p)
    trial, static = trial - cohesion, slow * p
    # gamma = xi sqrt(p) (mu - mu_s)/(mu_2 - mu), times its denominator: a quadratic in tau
    upper = q["mu_2"] * p
    alpha = q["xi"] * q["G"] * dt * math.sqrt(p)

    def excess(tau):
        return (trial - tau) * (upper - tau) - alpha * (tau - static)

    low, high = static, min(trial, upper)
    for _ in range(200):
        middle = (low + high) / 2
        if middle in (low, high):
            break
        low, high = (middle, high) if excess(middle) > 0 else (low, middle)
    return cohesion + (low + high) / 2


def regularised(q, trial, p, dt):
    """Shear stress of the regularised mu(I) after a step: the root of tau_trial - tau = G dt gdot.

    Bisection on ln I, with the law as Barker & Gray (2017) write it.
    """
    if trial == 0 or p == 0:
        return 0.0
    I0, I1, alpha = q["I0"], q["I1"], q["alpha"]

    def fast(inertial):
        return (q["mu_s"] * I0 + (q["mu_2"] + q["mu_inf"] * inertial) * inertial) / (I0 + inertial)

    ln_A = math.log(I1) + alpha / fast(I1) ** 2
    rate = q["xi"] / I0 * math.sqrt(p)  # per unit of I

    def friction(ln_I):
        inertial = math.exp(ln_I)
        return fast(inertial) if inertial > I1 else math.sqrt(alpha / (ln_A - ln_I))

    low, high = -700.0, 600.0
    for _ in range(200):
        middle = (low + high) / 2
        if middle in (low, high):
            break
        over = friction(middle) * p + q["G"] * dt * rate * math.exp(middle) > trial
        low, high = (low, middle) if over else (middle, high)
    return min(trial, friction(low) * p) if low > -700.0 else trial

"""Reference evaluation of the SPH equations in plain NumPy, over all pairs."""

import itertools

import numpy as np
from oracle_smoothed import deviator
from scipy.linalg import expm
from scipy.optimize import brentq


def kernel(dim, h, d):
    """Weight W (n, n) and its gradient at a (n, n, dim), d = x_b - x_a: the cubic spline."""
    norm = 10 / (7 * np.pi * h**2) if dim == 2 else 1 / (np.pi * h**3)
    r = np.sqrt((d**2).sum(-1))
    near = r < 2 * h
    q, w, slope = r[near] / h, np.zeros_like(r), np.zeros_like(d)
    w[near] = norm * np.where(q < 1, 1 - 1.5 * q**2 + 0.75 * q**3, 0.25 * (2 - q) ** 3)
    # dW/dr over r
    slope[near] = np.where(q < 1, 2.25 * q - 3, -0.75 * (2 - q) ** 2 / np.maximum(q, 1))[:, None]
    return w, -norm / h**2 * slope * d


def seeding_gradient(dim, h, spacing):
    """Kernel gradient of a linear field on the seeding lattice over the exact gradient."""
    ways = np.stack(np.meshgrid(*[np.arange(-4, 5) * spacing] * dim), axis=-1).reshape(1, -1, dim)
    weights, gradient = kernel(dim, h, ways)
    return (ways * gradient)[0, :, 0].sum() / weights.sum()


def images(scene, x):
    """Shifts by whole periods under which particles may be neighbours."""
    grid = scene.grid
    steps = [(-1, 0, 1) if p else (0,) for p in grid.periodic]
    lengths = np.array(grid.shape) * grid.cell
    return [np.array(k) * lengths for k in itertools.product(*steps)]


def size(T):
    """|T| = sqrt(T:T/2) of many tensors."""
    return np.sqrt(0.5 * (T**2).sum((1, 2)))


def within(T, strength):
    """Tensors scaled back so that |T| does not exceed the strength."""
    norm = size(T)
    share = np.where(norm > strength, strength / np.maximum(norm, 1e-300), 1.0)
    return share[:, None, None] * T


def overburden(scene):
    """Weight of the fills on an area."""
    heights = [
        z for fill in scene.fills for z in (fill.region.bounds[0][-1], fill.region.bounds[1][-1])
    ]
    return (
        scene.material.rho0 * np.linalg.norm(scene.gravity.vectors, axis=1).max() * np.ptp(heights)
    )


def slipping(trial, near, p, strength, mu, cohesion):
    """Limit the shear stress of trial stresses on planes along walls, found by bisection."""
    for d, axis in enumerate(np.eye(3)[: near.shape[1]]):
        for a in np.flatnonzero(near[:, d] & (strength > mu * p + cohesion)):
            T = trial[a]
            t = T[d] * (1 - axis)
            shear = np.outer(axis, t) + np.outer(t, axis)

            def excess(kept, T=T, shear=shear, a=a, d=d, t=t):
                cut = within((T - (1 - kept) * shear)[None], strength[a : a + 1])[0]
                along = np.linalg.norm(cut[d] * (np.arange(3) != d))
                return along - max(mu[a] * (p[a] - cut[d, d]) + cohesion, 0)

            if excess(1.0) > 0:
                kept = brentq(excess, 0, 1, xtol=1e-15) if excess(0.0) < 0 else 0.0
                trial[a] = T - (1 - kept) * shear


def velocity_gradients(scene, pairs, x, v, volume, wall, walls, n_grains):
    """L (n, 3, 3), zero out of the plane in 2D; wall particles use the others only."""
    dim, n = scene.dim, scene.numerics
    L = np.zeros((len(x), 3, 3))
    normal = np.concatenate([np.zeros((n_grains, dim)), walls["normal"]])
    depth = np.concatenate([np.zeros(n_grains), walls["depth"]])
    for d, weight, grad in pairs:
        dv = v[None] - v[:, None]
        dv[wall[:, None] & wall[None]] = 0
        mixed = (wall[:, None] != wall[None]) & (weight > 0)
        deep = (depth[:, None] + depth)[mixed]
        height = ((normal[:, None] - normal) * d).sum(-1)[mixed] - deep
        dv[mixed] *= np.minimum(n.z_max, 1 + deep / np.maximum(height, 1e-300))[:, None]
        L[:, :dim, :dim] += np.einsum("b,abi,abj->aij", volume, dv, grad)
    return L


def evaluate(scene, grains, walls, dt, gravity, elastic):
    """Evaluate the SPH equations once.

    Returns densities, rates, stresses (n, 3, 3), accelerations of the free particles, which come
    first, and elastic stresses (n, 3, 3) after a step from `elastic`.
    """
    dim, h, m, n = scene.dim, scene.h, scene.material, scene.numerics
    x, v = (np.concatenate([grains[k], walls[k]]) for k in ("x", "v"))
    mass = np.full(len(x), scene.point_mass)
    wall = np.arange(len(x)) >= len(grains["x"])
    pairs = []
    for shift in images(scene, x):
        d = x[None] + shift - x[:, None]
        weight, gradient = kernel(dim, h, d)
        pairs.append((d, weight, gradient / seeding_gradient(dim, h, scene.grid.cell)))
    plain = sum((mass * w).sum(1) for _, w, _ in pairs)
    rho = plain / sum((mass / plain * w).sum(1) for _, w, _ in pairs)

    L = velocity_gradients(scene, pairs, x, v, mass / rho, wall, walls, len(grains["x"]))
    D = L + L.transpose(0, 2, 1)
    rate = size(D)
    rho0 = np.where(wall, n.rho0_wall(m, overburden(scene)), m.rho0)
    p = np.where(rho > rho0, m.kappa * ((rho / rho0) ** 1.5 - 1), 0)
    with np.errstate(divide="ignore", invalid="ignore"):
        beta = np.nan_to_num(np.clip(0.5 * np.trace(D, axis1=1, axis2=2) / rate, 0, m.dilation))
        mu = m.mu_l + (m.mu_h - m.mu_l) / (m.D_star / rate + 1)

    turns = expm(0.5 * dt * (L - L.transpose(0, 2, 1)))
    kept = turns @ elastic @ turns.transpose(0, 2, 1)
    K, nu = 1.5 * m.kappa, m.nu
    G = 3 * K * (1 - 2 * nu) / (2 * (1 + nu))
    eta = (n.regularisation * h**2 * rho / dt)[:, None, None]
    trial = kept + eta * D + G * dt * deviator(D)
    strength = (mu + beta) * p + m.cohesion
    if m.mu_wall is not None:
        normal = np.concatenate([np.zeros(grains["x"].shape), walls["normal"]])
        near = sum((w[:, :, None] * np.abs(normal)).sum(1) for _, w, _ in pairs) > 0
        near[wall] = normal[wall] != 0
        slipping(trial, near, p, strength, m.mu_wall + beta, m.cohesion)
    shear = within(trial, strength)
    bulk = shear - p[:, None, None] * np.eye(3)
    # the strain shared by spring and dashpot follows from the remaining shear stress
    strained = (deviator(shear) - kept) / (eta + G * dt)
    elastic = within(kept + G * dt * strained, strength)

    a = np.tile(np.array(gravity, dtype=float), (len(x), 1))
    for _, _, grad in pairs:
        T = bulk[:, :dim, :dim] / rho[:, None, None] ** 2
        a += np.einsum("b,abij,abj->ai", mass, T[:, None] + T[None], grad)
    return rho, rate, bulk, a[~wall], elastic

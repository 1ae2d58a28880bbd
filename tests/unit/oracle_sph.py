"""One evaluation of the equations of particle hydrodynamics in plain NumPy, over all pairs."""

import itertools

import numpy as np


def kernel(dim, h, d):
    """Weight W (n, n) and its gradient at a (n, n, dim), d = x_b - x_a: the cubic spline."""
    norm = 10 / (7 * np.pi * h**2) if dim == 2 else 1 / (np.pi * h**3)
    r = np.sqrt((d**2).sum(-1))
    q = r / h
    w = norm * np.where(
        q < 1, 1 - 1.5 * q**2 + 0.75 * q**3, np.where(q < 2, 0.25 * (2 - q) ** 3, 0)
    )
    dw = (norm / h) * np.where(
        q < 1, -3 * q + 2.25 * q**2, np.where(q < 2, -0.75 * (2 - q) ** 2, 0)
    )
    slope = np.divide(dw, r, out=np.zeros_like(r), where=r > 0)
    return w, -slope[..., None] * d


def images(scene, x):
    """Shifts by whole periods under which points may be neighbours."""
    grid = scene.grid
    steps = [(-1, 0, 1) if p else (0,) for p in grid.periodic]
    lengths = np.array(grid.shape) * grid.cell
    return [np.array(k) * lengths for k in itertools.product(*steps)]


def evaluate(scene, grains, walls, dt, gravity):
    """Densities, rates, stresses (n, dim, dim); accelerations of the grains, which are first."""
    dim, h, m, n = scene.dim, scene.h, scene.material, scene.numerics
    x, v = (np.concatenate([grains[k], walls[k]]) for k in ("x", "v"))
    mass = np.full(len(x), scene.point_mass)
    wall = np.arange(len(x)) >= len(grains["x"])
    pairs = []
    for shift in images(scene, x):
        d = x[None] + shift - x[:, None]
        pairs.append((d, *kernel(dim, h, d)))
    plain = sum((mass * w).sum(1) for _, w, _ in pairs)
    rho = plain / sum((mass / plain * w).sum(1) for _, w, _ in pairs)

    L = np.zeros((len(x), dim, dim))
    normal = np.concatenate([np.zeros_like(grains["x"]), walls["normal"]])
    depth = np.concatenate([np.zeros(len(grains["x"])), walls["depth"]])
    for d, weight, grad in pairs:
        dv = v[None] - v[:, None]
        dv[wall[:, None] & wall[None]] = 0
        for a, b in np.argwhere((wall[:, None] != wall[None]) & (weight > 0)):
            w, sign = (a, 1) if wall[a] else (b, -1)
            height = sign * normal[w] @ d[a, b] - depth[w]
            dv[a, b] *= n.z_max if height <= 0 else min(n.z_max, 1 + depth[w] / height)
        L += np.einsum("b,abi,abj->aij", mass / rho, dv, grad)
    D = L + L.transpose(0, 2, 1)
    rate = np.sqrt(0.5 * (D**2).sum((1, 2)))
    rho0 = np.where(wall, n.wall_density * m.rho0, m.rho0)
    p = np.where(rho > rho0, m.kappa * ((rho / rho0) ** 1.5 - 1), 0)
    with np.errstate(divide="ignore", invalid="ignore"):
        beta = np.nan_to_num(np.clip(0.5 * np.trace(D, axis1=1, axis2=2) / rate, 0, m.dilation))
        mu = m.mu_l + (m.mu_h - m.mu_l) / (m.D_star / rate + 1)

    def stress(mu):
        tau = (mu + beta) * p + m.cohesion
        least = tau * dt / (n.regularisation * h**2 * rho)
        over = np.maximum(rate, least)
        eta = np.divide(tau, over, out=np.zeros_like(tau), where=over > 0)
        return eta[:, None, None] * D - p[:, None, None] * np.eye(dim)

    bulk = stress(mu)
    at_wall = bulk if m.mu_wall is None else stress(np.full_like(mu, m.mu_wall))
    a = np.tile(np.array(gravity, dtype=float), (len(x), 1))
    for _, _, grad in pairs:
        for s, chosen in ((bulk, ~wall), (at_wall, wall)):
            T = s / rho[:, None, None] ** 2
            both = T[:, None] + T[None]
            weight = np.where(chosen, mass, 0.0)
            a += np.einsum("b,abij,abj->ai", weight, both, grad)
    return rho, rate, bulk, a[~wall]

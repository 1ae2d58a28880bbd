"""Plain reference for the nonlocal law: at single points, and coupled through cells."""

import numpy as np
from oracle_fluidity import outflow
from oracle_fluidity import step as diffuse
from oracle_law import components, split_trial, tensor
from scipy.sparse import csc_matrix, eye
from scipy.sparse.linalg import spsolve

from granular.mpm.cell_codes import fluidity_faces
from granular.mpm.engine import largest_gravity


def numbers(scene):
    """Parameters of the law in a scene."""
    material, grid = scene.material, scene.grid
    spread = scene.scheme.fluidity.pressure_averaging
    if spread is None:
        spread = 0.5
        if scene.scheme.basis == "quadratic":
            spread /= scene.fills[0].points_per_axis
    # overburden pressure of a layer one cell high
    weight = material.rho_c * largest_gravity(scene) * grid.cell
    return vars(material) | {"K": material.K, "G": material.G, "p_averaging": spread * weight}


def root(q, dt, m, p, g_star, rate):
    """X = G dt g/p after a step: bisection on g - g* + f [(mu_s - mu)/(mu_2 - mu) + k] g = 0.

    The unknown is Y = X - e, e = max(0, m/mu_2 - 1), on a logarithmic scale: mu_2 (1 + X) - m is
    then a sum of terms of one sign, without cancellation.
    """
    mu_s, mu_2 = q["mu_s"], q["mu_2"]
    f = dt / q["t0"] * (mu_2 - mu_s)
    roots = np.sqrt(p + q["p_averaging"]) + np.sqrt(np.maximum(p - q["p_averaging"], 0.0))
    k = rate * q["d"] * np.sqrt(q["rho_s"]) / q["I0"] * 2 / roots
    start = q["G"] * dt * np.maximum(g_star, 0.0) / p
    e, below = np.maximum(m / mu_2 - 1, 0.0), np.maximum(mu_2 - m, 0.0)
    low, high = np.full(np.shape(m), -690.0), np.full(np.shape(m), 230.0)
    for _ in range(75):
        middle = (low + high) / 2
        Y = np.exp(middle)
        X = e + Y
        excess = X * (1 + f * ((mu_s * (1 + X) - m) / (mu_2 * Y + below) + k)) - start
        low, high = np.where(excess > 0, low, middle), np.where(excess > 0, middle, high)
    Y = np.exp((low + high) / 2)
    return e + np.where(Y < 1e-290, 0.0, Y)


def ngf(q, stress, L, log_density, dt, g_star, rate, equation_of_state=False):
    """Update stresses (n, 3, 3) over the time dt, with the fluidity g_star left by diffusion.

    Returns the new stresses, plastic shear rates, fluidities and the gain of the law over g_star.
    """
    p, deviator = split_trial(q, stress, L, dt)
    p = pressure(q, p, log_density, equation_of_state)
    flowed, rate, g, gain = flow(q, deviator, p, dt, g_star, rate)
    return flowed - p[:, None, None] * np.eye(3), rate, g, gain


def pressure(q, p, log_density, equation_of_state):
    """Pressure of the trial stress or of the density; 0 where disconnected."""
    if equation_of_state:
        p = q["K"] * log_density
    return np.where((log_density >= 0) & (p > 0), p, 0.0)


def flow(q, deviator, p, dt, g_star, rate):
    """Deviator, plastic shear rate, fluidity and its gain after flow from a trial deviator."""
    dense = p > 0
    safe = np.where(dense, p, 1.0)
    m = np.sqrt(np.einsum("pij,pij->p", deviator, deviator) / 2) / safe
    X = root(q, dt, m, safe, g_star, rate)
    g = np.where(dense, X * safe / (q["G"] * dt), 0.0)
    left = np.where(dense, 1 / (1 + X), 0.0)[:, None, None] * deviator
    return left, g * m / (1 + X), g, np.where(dense, g - g_star, 0.0)


def cell_of(scene, x):
    """Index of the cells of points in (..., y, x)."""
    grid = scene.grid
    at = np.floor((x - grid.lower) / grid.cell).astype(int)
    return tuple(np.mod(at, grid.shape)[:, ::-1].T)


def means(scene, points, name, bears):
    """Means by mass over the stressed points of each cell, and a mask of cells with such points."""
    shape = scene.grid.shape[::-1]
    mass, total = np.zeros(shape), np.zeros(shape)
    weight = np.where(bears, points["mass"], 0.0)
    where = cell_of(scene, points["x"])
    np.add.at(mass, where, weight)
    np.add.at(total, where, weight * points[name])
    return np.divide(total, mass, out=np.zeros(shape), where=mass > 0), mass > 0


def diffused(scene, points, dt, bears):
    """Fluidity of the points after a substep of diffusion, from which the law begins.

    To that of their cell comes what is left of the deviation of a point from the mean before.
    """
    q, fluidity, grid = scene.material, scene.scheme.fluidity, scene.grid
    g, dense = means(scene, points, "g", bears)
    first = grid.lower[0] / grid.cell if grid.axisymmetric else None
    L = outflow(dense, fluidity_faces(scene), grid.periodic, first)
    k = dt * q.A**2 * q.d**2 / (q.t0 * grid.cell**2)
    if fluidity.method != "implicit":
        most = outflow(np.ones_like(dense), fluidity_faces(scene), grid.periodic, first)
        faces = np.diag(most) - most.sum(axis=1) / 2
        found = diffuse(fluidity.method, L, k, g.ravel(), k * faces.max()).reshape(g.shape)
    else:
        gain = np.clip(means(scene, points, "g_gain", bears)[0], -g, g / 2)
        found = spsolve(csc_matrix(eye(g.size) + k * L), (g + gain).ravel()).reshape(g.shape)
        found = found - gain
    where = cell_of(scene, points["x"])
    of_cell = np.maximum(found, 0.0)[where]
    own = of_cell + np.exp(-(np.pi**2) * k) * (points["g"] - g[where])
    return np.where(bears, np.maximum(own, 0.0), of_cell)


class Substeps:
    """A step with velocity gradients L (n, 3, 3), in substeps.

    The rotation of the stress is applied once; strain and flow are divided among the substeps. Each
    uses the pressure at the end of the step. Before the last substep that is the pressure of the
    density before averaging.
    """

    def __init__(self, scene, points, L, dt):
        self.scene, self.q = scene, numbers(scene)
        self.n = scene.scheme.fluidity.substeps
        self.dt = dt / self.n
        stress = tensor(points["stress"], scene.dim)
        _, self.deviator = split_trial(self.q, stress, (L - L.transpose(0, 2, 1)) / 2, dt)
        self.p_trial, trial = split_trial(self.q, stress, L, dt)
        self.strained = trial - self.deviator
        self.bears = np.trace(stress, axis1=1, axis2=2) < 0
        self.points = points
        c = points["log_density"] - dt * np.trace(L, axis1=1, axis2=2)
        for _ in range(1, self.n):
            self.substep(c)

    def substep(self, log_density):
        """Take one substep; return the points after it, with their stress."""
        scene, now = self.scene, self.points
        p = pressure(self.q, self.p_trial, log_density, scene.scheme.density.name != "particle")
        g_star = diffused(scene, now, self.dt, self.bears)
        trial = self.deviator + self.strained / self.n
        self.deviator, rate, g, gain = flow(self.q, trial, p, self.dt, g_star, now["shear_rate"])
        self.bears = p > 0
        stress = components(self.deviator - p[:, None, None] * np.eye(3), scene.dim)
        found = {"stress": stress, "shear_rate": rate, "g": g, "g_gain": gain}
        self.points = now | {name: value for name, value in found.items() if name in now}
        return self.points

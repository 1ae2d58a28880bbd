"""Plain reference for the smoothed density, which is averaged over the grid at intervals."""

import itertools

import numpy as np
from oracle_law import tensor
from oracle_shapes import Shapes, axis_nodes, full_mass, node_radii
from oracle_walls import at_face, held_at_walls, near_outlet

from granular.mpm.damping import damping
from granular.mpm.engine import averaging_interval, flutter_interval, largest_gravity


def averages(scene, step):
    """True if the density is averaged in this step."""
    return scene.scheme.density.name == "smoothed" and step % averaging_interval(scene) == 0


def neighbour_corrections(scene, nodes, fixed):
    """Corrections at nodes that depend on their neighbours, updated in `nodes`.

    `gap` is the log filling fraction less the log density, averaged over the neighbours. `excess`
    is the relative quadrature weight above that which fills the volume. `uneven` is the residual
    force, set to zero where a wall or an end of the domain can bear it, and outside of the bulk; on
    inner grid lines, where splines are only C0, a quarter of it counts along the normal.
    """
    counts, periodic = nodes.shapes.counts, scene.grid.periodic
    own = 2 * (nodes.phi - 1) / (nodes.phi + 1) - nodes.cbar  # first Pade approximant of ln phi
    gaps = own.reshape(counts, order="F")
    full = gaps > -0.5
    inside, mean, weights = full.copy(), np.zeros(counts), np.zeros(counts)
    radii = node_radii(scene).reshape(counts, order="F")
    for d in range(len(counts)):
        unit = np.eye(len(counts), dtype=int)[d]
        for side in (-1, 1):
            inside &= _beside(full, side * unit, periodic)
    for offset in itertools.product((-1, 0, 1), repeat=len(counts)):
        gap = _beside(gaps, offset, periodic)
        share = 0.5 ** len(counts) * 0.5 ** np.abs(offset).sum() * _beside(radii, offset, periodic)
        weights += share
        mean += share * np.where(gap > -0.5, gap, np.where(full, gaps, 0.0))
    inside = inside.ravel(order="F")
    nodes.gap = np.where(inside, (mean / weights).ravel(order="F"), 0.0)
    nodes.excess[inside] += 1 - np.exp(-own[inside])
    for d in range(len(counts)):
        at = np.indices(counts)[d]
        end = ((at == 0) | (at == counts[d] - 1)) & (not periodic[d])
        nodes.uneven[~inside | end.ravel(order="F") | fixed[:, d], d] = 0.0
        place = axis_nodes(scene, d)
        on_line = np.broadcast_to(
            (place == np.floor(place)).reshape([-1 if k == d else 1 for k in range(len(counts))]),
            counts,
        )
        nodes.uneven[on_line.ravel(order="F"), d] *= 0.25


def _beside(field, offset, periodic):
    """Field at the neighbours by an offset; beyond an end of the domain, the field at the end."""
    for d, step in enumerate(offset):
        at = np.arange(field.shape[d]) + step
        at = at % field.shape[d] if periodic[d] else np.clip(at, 0, field.shape[d] - 1)
        field = np.take(field, at, axis=d)
    return field


def average(scene, points, new, nodes, gradient, dt):
    """Average the density, relax it to the nodal density and shift the points.

    `gradient` is that of the velocity, shape (n, 3, 3).

    One call stands for all the steps until the next averaging.
    """
    many = averaging_interval(scene)
    q, dx, s, dim = scene.scheme.density, scene.grid.cell, nodes.shapes, scene.grid.dim
    L, trace = gradient[:, :dim, :dim], np.trace(gradient, axis1=1, axis2=2)
    old = points["log_density"]
    bears = old >= (0.0 if scene.material.law != "elastic" else -np.inf)
    rate = many * np.where(bears, points["shear_rate"], kinematic_rate(gradient))
    joins = old >= -q.separation_strain
    near = s.w @ nodes.cbar[s.node]
    eta = averaged_part(scene, many * dt, dt * rate, old)
    c = old - dt * trace + np.where(joins, eta, 0.0) * (near - old)
    fed = relaxation(scene, many * dt, rate * dt, s.w @ nodes.gap[s.node])
    c = np.where(c >= 0, c + fed, c)
    slope = np.einsum("k,pkj->pj", np.maximum(nodes.phi[s.node] - 1, 0.0), s.g)
    delta = -q.shifting * (rate * dt)[:, None] * dx**2 * slope
    length = np.linalg.norm(delta, axis=1)
    most = np.minimum(q.shifting_limit * dx, 0.5 * rate * dt * dx)
    most = np.where(near_outlet(scene, points["x"]), 0.0, most)
    scale = np.where(length > most, most / np.maximum(length, 1e-300), 1.0)
    delta = delta * scale[:, None]
    delta = held_at_walls(scene, points["x"], delta)
    delta += across_faces(scene, points, nodes, rate * dt, gradient)
    borrowed = np.einsum("pdj,pj->pd", L, delta)
    kept = points["weight_correction"]
    divergence = np.einsum("kj,pkj->p", nodes.uneven[s.node], s.g * dx)
    if scene.grid.axisymmetric:
        divergence += (s.w @ nodes.uneven[s.node][:, 0]) * dx / points["x"][:, 0]
    u = (
        kept
        - q.weight_correction * divergence
        - q.weight_correction_decay * kept
        - s.w @ nodes.excess[s.node]
    )
    u = np.clip(u, -q.weight_correction_limit, q.weight_correction_limit)
    new["weight_correction"] = np.where(joins, u, kept)
    gradient = np.einsum("k,pkj->pj", nodes.cbar[s.node], s.g)
    new["density_gradient"] = np.where(joins[:, None], gradient, 0.0).reshape(-1, dim)
    new["log_density"], new["x"] = c, new["x"] + delta
    new["v"], new["shift_velocity"] = new["v"] + borrowed, borrowed


def across_faces(scene, points, nodes, strain, gradient):
    """Shift of points out of cells that hold more than their neighbours, linear between faces."""
    grid, x, q = scene.grid, points["x"], scene.scheme.density
    dim, shape = grid.dim, np.array(grid.shape)
    place = (x - np.array(grid.lower)) / grid.cell
    at = np.floor(place).astype(int)
    own = np.ravel_multi_index(tuple(at.T), grid.shape)
    L, full = gradient[:, :dim, :dim], full_mass(scene)
    if grid.axisymmetric:
        full = full * (at[:, 0] + 0.5 + grid.lower[0] / grid.cell)
    filled = np.bincount(own, points["mass"] / full, minlength=shape.prod())
    count = np.bincount(own, minlength=shape.prod())
    middle = (np.indices(grid.shape).reshape(dim, -1).T + 0.5) * grid.cell + np.array(grid.lower)
    about = Shapes(scene, middle)
    node = about.node[about.w.argmax(axis=1)]
    phi, cbar = nodes.phi[node], nodes.cbar[node]
    gap = np.where(phi > 0, 2 * (phi - 1) / (phi + 1) - cbar, -2.0)
    inside = np.clip((gap + 0.353) / (0.353 - 0.105), 0.0, 1.0)
    excess = (filled - 1) * np.where(filled < 1, inside, 1.0)
    shift = np.zeros_like(x)
    for d in range(dim):
        lasting = np.sqrt(np.maximum(0.5 * np.einsum("pij,pji->p", L, L), 0.0))
        stretch = 2 * np.minimum(lasting, np.abs(L[:, d, d]))
        stretch = stretch / np.maximum(kinematic_rate(gradient), 1e-300)
        along = 2 * strain * np.minimum(stretch, 1.0)
        most = np.where(near_outlet(scene, x), 0.0, q.shifting_limit)
        faces = []
        for high in (0, 1):
            other = at.copy()
            other[:, d] += 2 * high - 1
            beyond = (other[:, d] < 0) | (other[:, d] >= shape[d])
            other[:, d] %= shape[d]
            closed = at_face(scene, x, d, high) | (beyond & (not grid.periodic[d]))
            rise = excess[np.ravel_multi_index(tuple(other.T), grid.shape)] - excess[own]
            rise = np.where(closed, 0.0, rise)
            much = np.maximum(np.abs(rise) - 1.5 * filled[own] / count[own], 0.0)
            drop = np.sign(rise) * much * (-1 if high else 1)
            faces.append(np.clip(q.shifting * along * drop, -most, most))
        xi = place[:, d] - at[:, d]
        shift[:, d] = faces[0] + xi * (faces[1] - faces[0])
    return grid.cell * own_parts(points["id"])[:, None] * shift


def own_parts(ids):
    """Part of a shift that a point takes, by a hash of its id: uniform in [0, 2)."""
    odd = np.uint64(0x9E3779B97F4A7C15)
    mixed = ids.astype(np.uint64) * odd
    other = (mixed ^ (mixed >> np.uint64(32))) * odd
    return (other >> np.uint64(11)).astype(float) * 2.0**-52


def mean_of_cells(scene, x, mass, value):
    """Mean by mass of the values of points over the cell of each."""
    at = np.floor((x - np.array(scene.grid.lower)) / scene.grid.cell).astype(int)
    _, cell = np.unique(at, axis=0, return_inverse=True)
    return (np.bincount(cell, mass * value) / np.bincount(cell, mass))[cell]


def damped_share(scene, rate, c):
    """Damping of slow plastic flow in averaged cells, over its largest rate."""
    end = damping(scene, scene.material, 0.0)["slow_rate"] * np.sqrt(np.maximum(c, 0.0))
    damped = (rate > 0) & (rate < end)
    return np.where(damped, 1 - rate / np.where(damped, end, 1.0), 0.0)


def deviator(stress):
    return stress - np.trace(stress, axis1=1, axis2=2)[:, None, None] / 3 * np.eye(3)


def damp_flutter(scene, points, dt, step):
    """Overstress of unsteady slow flow, and the mean shear rate that counts as steady."""
    m, q = scene.material, scene.scheme.density
    g, time = largest_gravity(scene), flutter_interval(scene) * dt
    stress = tensor(points["stress"], scene.grid.dim)
    p = np.maximum(-np.trace(stress, axis1=1, axis2=2) / 3, 0.0)
    tau = np.sqrt(np.maximum((deviator(stress) ** 2).sum(axis=(1, 2)) / 2, 1e-300))
    steep = m.K * np.linalg.norm(points["density_gradient"], axis=1) / (m.rho_c * g)
    rate, depth = points["shear_rate"], p / (m.rho_c * g) / np.maximum(steep, 1.0)
    steady = 20.0 * depth / m.wave_speed
    mean = (steady * points["mean_shear_rate"] + time * rate) / (steady + time)
    if step <= flutter_interval(scene):
        mean = rate
    viscosity = q.flutter_damping * m.rho_c * m.wave_speed * depth
    viscosity = np.minimum(viscosity, 1.4 * m.rho_c * scene.grid.cell**2 / time)
    end = 4.0 * m.wave_speed * g * m.rho_c / m.G * tau / np.maximum(p, 1e-300)
    unsteady = rate - np.clip(rate, 0.9 * mean, 1.1 * mean)
    slow = np.maximum(1 - mean / np.maximum(end, 1e-300), 0.0)
    share = np.clip(viscosity / np.maximum(p, 1e-300) * slow * unsteady * p / tau, -0.25, 0.25)
    flows = (p > 0) & (rate > 0)
    return {"mean_shear_rate": mean, "overstress": np.where(flows, share, 0.0)}


def averaged_part(scene, dt, strain, c):
    """Fraction by which averaging moves log-densities to their mean in a time and a strain."""
    q = scene.scheme.density
    rest = dt * q.diffusion * scene.material.wave_speed / scene.grid.cell
    pressed = np.maximum(c, 0)
    r = rest * pressed + q.strain_diffusion * strain
    return r / np.where(r > 0, pressed + r, 1.0)


def kinematic_rate(L):
    """Shear rate and |tr L| of velocity gradients (n, dim, dim)."""
    trace, D = np.trace(L, axis1=1, axis2=2), (L + L.transpose(0, 2, 1)) / 2
    deviator_squared = np.einsum("pij,pij->p", D, D) - trace**2 / 3
    return np.sqrt(np.maximum(2 * deviator_squared, 0)) + abs(trace)


def relaxation(scene, dt, strain, gap):
    """Relaxation of log-densities to the nodal density in a time and a strain."""
    q, g = scene.scheme.density, np.linalg.norm(scene.gravity.vectors, axis=1).max()
    most = q.relaxation_limit * g / scene.material.wave_speed * dt
    apart = np.minimum(q.compression_rate * strain, 1.0) * np.maximum(gap - q.dead_band, 0.0)
    return np.clip(q.relaxation * strain * gap, -most, most) + apart

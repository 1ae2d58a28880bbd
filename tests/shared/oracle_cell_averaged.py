"""Plain reference for the cell-averaged density: the points of a cell share one density."""

from types import SimpleNamespace

import numpy as np
from oracle_law import tensor
from oracle_shapes import Shapes, full_mass, node_volumes
from oracle_smoothed import averaged_part, kinematic_rate, relaxation
from oracle_walls import faces, held_at_walls, near_outlet


def cell_averages(scene, points, nodes):
    """Averages over cells with points; forces from cell stresses replace those of the points."""
    grid, s, m, dim = scene.grid, nodes.shapes, points["mass"], scene.grid.dim
    at = np.floor((points["x"] - grid.lower) / grid.cell)
    place, which = np.unique(at, axis=0, return_inverse=True)
    which = which.ravel()
    mean = _mean_over_cells(which, m)
    # Volumes are over 2 pi cells in rings, as are those of nodes.
    size = full_mass(scene) / scene.material.rho_c
    radius = np.ones(len(place))
    if grid.axisymmetric:
        radius = grid.lower[0] / grid.cell + place[:, 0] + 0.5
    free_volume = node_volumes(scene) * size
    middle = Shapes(scene, grid.lower + (place + 0.5) * grid.cell)
    around = middle.w > 0
    filled = around @ nodes.mass[middle.node] / scene.material.rho_c
    free = around @ free_volume[middle.node]
    phi = filled / free
    phi_i = nodes.mass / scene.material.rho_c / np.where(free_volume > 0, free_volume, np.inf)
    counted = around & (free_volume > 0)[middle.node]
    least = np.where(counted, phi_i[middle.node], np.inf).min(axis=1)
    inside = np.clip(np.minimum((phi - 0.8) / 0.1, (least - 0.25) / 0.25), 0.0, 1.0)
    centre = mean((points["x"] - grid.lower) / grid.cell) - place
    middle_of_ring = np.full(place.shape, 0.5)
    if grid.axisymmetric:
        middle_of_ring[:, 0] += 1 / (12 * radius)
    local = inside[:, None] * middle_of_ring + (1 - inside[:, None]) * centre
    here = Shapes(scene, grid.lower + (place + local) * grid.cell)
    hoop = _hoops(scene, place, local, inside, radius)

    stress = mean(tensor(points["stress"], dim))
    sigma = stress[:, :dim, :dim]
    needed = np.minimum(np.bincount(which, m) / scene.material.rho_c, size * radius)
    volume = inside * size * radius + (1 - inside) * needed
    brought = np.zeros(around.shape)
    np.add.at(brought, which, s.w * m[:, None])
    shared = around * inside[:, None] * phi_i[middle.node] * (size * radius)[:, None] / 2**dim
    heavy = np.maximum(brought / scene.material.rho_c, shared)  # [m^dim]
    slope = here.g.copy()
    slope[..., 0] += hoop
    square = np.sum((slope * grid.cell) ** 2, axis=2)
    stiffness = np.sum(square / np.where(heavy > 0, heavy, np.where(square > 0, 1e-300, 1)), axis=1)
    volume = np.where(inside < 1, np.minimum(volume, 12 / stiffness), volume)
    nodes.force = s.to_nodes(0 * s.g) - here.to_nodes(
        np.einsum("c,cij,ckj->cki", volume, sigma, here.g)
    )
    if grid.axisymmetric:
        of_rings = np.zeros(here.g.shape)
        of_rings[..., 0] = (volume * stress[:, 2, 2])[:, None] * hoop
        nodes.force -= here.to_nodes(of_rings)
    excess = np.maximum(nodes.mass / scene.material.rho_c - free_volume, 0.0) / size
    nodes.cells = SimpleNamespace(
        which=which,
        place=place,
        here=here,
        c=mean(points["log_density"]),
        inside=inside,
        hoop=hoop,
        filled=(filled_cell := np.bincount(which, m) / scene.material.rho_c / (size * radius)),
        count=np.bincount(which),
        shortage=(filled_cell - 1) * np.where(filled_cell < 1, inside, 1.0),
        log_phi=2 * (phi - 1) / (phi + 1),
        excess_gradient=np.einsum("k,ckj->cj", excess[here.node], here.g)
        * (grid.cell / radius)[:, None],
    )


def _hoops(scene, place, local, inside, radius):
    """S_i/r of the cells [1/m], for full rings at the middle of the cell; 0 in other grids."""
    grid = scene.grid
    if not grid.axisymmetric:
        return 0.0
    at = local.copy()
    at[:, 0] -= inside / (12 * radius)
    return (
        Shapes(scene, grid.lower + (place + at) * grid.cell).w
        / ((radius - 0.5 + at[:, 0]) * grid.cell)[:, None]
    )


def _mean_over_cells(which, m):
    """Return a function that averages values (points, ...) by mass over the points of each cell."""

    def mean(values):
        flat = values.reshape(len(m), -1)
        sums = np.stack([np.bincount(which, m * column) for column in flat.T], axis=1)
        sums /= np.bincount(which, m)[:, None]
        return sums.reshape(-1, *values.shape[1:])

    return mean


def _second_difference(scene, cells):
    """Mean over axes of a quarter of the second difference of c, between connected cells."""
    grid = scene.grid
    joins = np.where(cells.c >= -scene.scheme.density.separation_strain, cells.c, np.nan)
    known = {tuple(place): c for place, c in zip(cells.place, joins, strict=True)}
    out = np.zeros(len(joins))
    for k, place in enumerate(cells.place):
        for d in range(grid.dim):
            ends = (_beyond(scene, place, d, side, known) for side in (-1, 1))
            out[k] += np.nan_to_num(sum(ends) - 2 * joins[k]) / (4 * grid.dim)
    return out


def _beyond(scene, place, d, side, known, empty=np.nan):
    """Value of the neighbour cell, `empty` without points; NaN beyond a wall or an end."""
    grid = scene.grid
    at = grid.lower[d] + (place[d] + max(side, 0)) * grid.cell
    middle = grid.lower + (place + 0.5) * grid.cell
    for axis, face, extents in faces(scene):
        others = set(range(grid.dim)) - {d}
        here = axis == d and abs(face - at) < 1e-6 * grid.cell
        if here and all(extents[j][0] < middle[j] < extents[j][1] for j in others):
            return np.nan
    other = place.copy()
    other[d] += side
    if grid.periodic[d]:
        other[d] %= grid.shape[d]
    outside = other[d] < 0 or other[d] >= grid.shape[d]
    return np.nan if outside else known.get(tuple(other), empty)


def _through_faces(scene, cells, stretch):
    """Shift at the low and the high face of the cells along each axis, in cells (cells, dim, 2).

    `stretch` is 2 |L_dd| dt, shape (cells, dim).
    """
    q = scene.scheme.density
    known = {tuple(place): k for k, place in enumerate(cells.place)}
    excess = dict(zip(known, cells.shortage, strict=True))
    out = np.zeros((len(cells.c), scene.grid.dim, 2))
    for place, k in known.items():
        for d in range(scene.grid.dim):
            most = min(q.shifting_limit, stretch[k, d])
            for side in (0, 1):
                other = _beyond(scene, cells.place[k], d, 2 * side - 1, excess, empty=0.0)
                fall = excess[place] - other if np.isfinite(other) else 0.0
                much = max(abs(fall) - cells.filled[k] / cells.count[k], 0.0)
                speed = q.shifting * stretch[k, d] * np.sign(fall) * much
                out[k, d, side] = (2 * side - 1) * np.clip(speed, -most, most)
    return out


def flow_of_cells(scene, points, new, nodes, dt):
    """Update density and position of the points by cells; return the velocity gradients."""
    q, cells, dx = scene.scheme.density, nodes.cells, scene.grid.cell
    v = nodes.v[cells.here.node]
    L = np.zeros((len(cells.c), 3, 3))
    L[:, : v.shape[1], : v.shape[1]] = np.einsum("ckj,ki->cij", cells.here.g, v)
    L[:, 2, 2] += np.sum(cells.hoop * v[:, 0], axis=1) if scene.grid.axisymmetric else 0.0
    rate = dt * kinematic_rate(L)
    eta = averaged_part(scene, dt, rate, cells.c)
    c = cells.c - dt * np.trace(L, axis1=1, axis2=2) + eta * _second_difference(scene, cells)
    gap = cells.log_phi - c
    fed = relaxation(scene, dt, rate, gap)
    c = np.where((gap > 0) | (c >= 0), c + np.where(gap < 0, cells.inside, 1.0) * fed, c)
    length = np.linalg.norm(cells.excess_gradient, axis=1)
    most = np.minimum(q.shifting_limit, 0.5 * rate)
    scale = np.minimum(q.shifting * rate, most / np.maximum(length, 1e-300))
    shift = (-scale[:, None] * dx * cells.excess_gradient)[cells.which]
    shift = held_at_walls(scene, points["x"], shift)
    stretch = 2 * dt * abs(np.diagonal(L, axis1=1, axis2=2)[:, : v.shape[1]])
    faces = _through_faces(scene, cells, stretch)[cells.which] * dx
    xi = (points["x"] - scene.grid.lower) / dx - cells.place[cells.which]
    shift += (1 - xi) * faces[..., 0] + xi * faces[..., 1]
    shift[near_outlet(scene, points["x"])] = 0.0
    new["log_density"] = c[cells.which]
    new["x"] = new["x"] + shift
    return L[cells.which]

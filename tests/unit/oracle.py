"""The step once more, slow and plain: NumPy written from the equations, for comparison.

Every function here works on whole arrays over all nodes; nothing is shared with the C core but the
table of walls. Equation numbers are those of Dunatunga & Kamrin 2015.
"""

import math
from types import SimpleNamespace

import numpy as np
from oracle_shapes import Shapes, node_volumes

from granular.engine import averaging_interval
from granular.nodes import node_codes

STRESS_PLACES = {2: ((0, 0), (1, 1), (2, 2), (0, 1)),
                 3: ((0, 0), (1, 1), (2, 2), (0, 1), (1, 2), (0, 2))}  # fmt: skip


# ---- scatter, grid, gather ----


def tensor(components, dim):
    """Components (n, 4 or 6) as symmetric matrices (n, 3, 3)."""
    out = np.zeros((len(components), 3, 3))
    for c, (i, j) in enumerate(STRESS_PLACES[dim]):
        out[:, i, j] = out[:, j, i] = components[:, c]
    return out


def components(matrices, dim):
    """The components of symmetric matrices, shape (n, 4 or 6)."""
    return np.stack([matrices[:, i, j] for i, j in STRESS_PLACES[dim]], axis=1)


def averages(scene, step):
    """Whether a step averages the density."""
    return scene.scheme.density == "diffused" and step % averaging_interval(scene) == 0


def scatter(scene, points, step=0, lent_dt=1.0):
    """Nodal sums (3.4): mass, momentum, force; phi and cbar where the step averages the density,
    and `cells` where they share it."""
    dim = scene.grid.dim
    s = Shapes(scene, points["x"])
    m = points["mass"]
    v = np.broadcast_to(points["v"][:, None, :], s.r.shape)
    if "affine" in points:
        v = v + np.einsum("pdj,pkj->pkd", points["affine"].reshape(-1, dim, dim), s.r)
    volume = m * np.exp(-points["log_density"]) / scene.material.rho_c
    if "overweight" in points:
        volume = (1 + points["overweight"]) * volume
    stress = tensor(points["stress"], dim)[:, :dim, :dim]
    force = -np.einsum("p,pdj,pkj->pkd", volume, stress, s.g)
    if averages(scene, step - 1):
        force -= np.einsum("p,pk,pd->pkd", m / lent_dt, s.w, points["shift_velocity"])
    out = SimpleNamespace(
        shapes=s,
        mass=s.to_nodes(s.w * m[:, None]),
        momentum=s.to_nodes((s.w * m[:, None])[..., None] * v),
        force=s.to_nodes(force),
    )
    if scene.scheme.density == "shared":
        _share(scene, points, out)
    if averages(scene, step):
        cell_mass = scene.material.rho_c * scene.grid.cell**dim
        out.phi = _ratio(out.mass, cell_mass * node_volumes(scene))
        c = points["log_density"]
        joins = np.where(c >= -scene.scheme.tension_reach, m, 0.0)
        seen = c[:, None] + np.einsum("pj,pkj->pk", points["density_gradient"], s.r)
        joined = s.to_nodes(s.w * joins[:, None])
        weighted = joins * (1 + points["overweight"])
        counted = s.to_nodes(s.w * weighted[:, None])
        out.cbar = _ratio(s.to_nodes(s.w * weighted[:, None] * seen), counted)
        out.excess = np.where(joined > 0, _ratio(counted, joined) - 1, 0.0)
        push = s.g * scene.grid.cell * (weighted / cell_mass)[:, None, None]
        out.uneven = s.to_nodes(push)
    return out


def keep_uneven_inside(scene, nodes, fixed):
    """Leave it where node and next nodes are full, no wall bears it and the domain goes on; where
    they are full, the weights are to fill the room."""
    counts = nodes.shapes.counts
    full = (nodes.phi > 0.6).reshape(counts, order="F")
    inside, ends = full.copy(), []
    for d, periodic in enumerate(scene.grid.periodic):
        place = np.moveaxis(np.indices(counts)[d], d, 0)
        ends.append((place == 0) | (place == counts[d] - 1) if not periodic else place < 0)
        line, kept = np.moveaxis(full, d, 0), np.moveaxis(inside, d, 0)
        for side in (-1, 1):
            beside = np.roll(line, side, axis=0)
            if not periodic:
                beside[0 if side == 1 else -1] = True
            kept &= beside
    inside = inside.ravel(order="F")
    nodes.excess[inside] += 1 - np.exp(nodes.cbar[inside]) / nodes.phi[inside]
    for d in range(len(counts)):
        on_end = np.moveaxis(ends[d], 0, d).ravel(order="F")
        lost = ~inside | on_end | fixed[:, d]
        nodes.uneven[lost, d] = 0.0


def _ratio(a, b):
    return np.divide(a, b, out=np.zeros_like(a), where=b > 0)


def _wall(row, v, after):
    """What a wall leaves of the velocities before and after the forces, shape (dim,)."""
    dim = len(v)
    rub = 0.0
    if row.normal >= 0:
        into = abs(after[row.normal]) if row.side == 0 else -row.side * after[row.normal]
        along = math.sqrt(sum(after[d] ** 2 for d in range(dim) if d != row.normal))
        if into > 0 and along > 0:
            rub = min(1.0, row.friction * into / along)
    for d in range(dim):
        if row.fixed >> d & 1:
            v[d] = after[d] = 0.0
        elif row.normal >= 0:
            after[d] -= rub * after[d]
        if row.clamp >> d & 1 and after[d] > 0:
            after[d], v[d] = 0.0, min(v[d], 0.0)


def keep_share(scene, dt):
    """The part of the old velocity of a point that survives a step."""
    scheme = scene.scheme
    if scheme.transfer in ("apic", "xpic"):
        return 0.0
    if scheme.transfer == "tpic":
        return math.exp(-scheme.decay * scene.material.wave_speed / scene.grid.cell * dt)
    return math.exp(-scheme.flip_decay * dt)


def grid(scene, points, nodes, dt, time):
    """Nodal velocities (3.5-3.7): `v` after the forces, `w` what the points receive."""
    used = nodes.mass > 0
    v = _ratio(nodes.momentum, nodes.mass[:, None])
    after = np.zeros_like(v)
    acceleration = nodes.force[used] / nodes.mass[used, None] + scene.gravity.at(time)
    after[used] = v[used] + dt * acceleration
    fixed = _at_walls(scene, used, v, after, time)
    keep = keep_share(scene, dt)
    if hasattr(nodes, "uneven"):
        keep_uneven_inside(scene, nodes, fixed)
    nodes.v, nodes.before = after, v
    nodes.w = keep * (after - v) + (1 - keep) * after
    if scene.scheme.transfer == "xpic":
        nodes.w = after - v + _filtered(scene, points, nodes, v, fixed)


def _at_walls(scene, used, v, after, time):
    """Apply the walls of a time to nodal velocities; which components they hold."""
    codes, rows = node_codes(scene)
    codes = codes.ravel()
    fixed = np.zeros(v.shape, dtype=bool)
    for i in np.flatnonzero(used & (codes > 0)):
        row = rows[codes[i] - 1]
        while time >= row.opens_at:
            row = rows[row.after - 1] if row.after else None
            if row is None:
                break
        if row is not None:
            _wall(row, v[i], after[i])
            fixed[i] = [row.fixed >> d & 1 for d in range(v.shape[1])]
    return fixed


def _filtered(scene, points, nodes, v, fixed):
    """sum_r (-1)^(r+1) binomial(m, r) (S+ S)^(r-1) v (Hammerquist & Nairn 2017, eq. 20)."""
    s, order, out = nodes.shapes, scene.scheme.xpic_order, 0.0
    used = nodes.mass > 0
    for r in range(1, order + 1):
        out = out - (-1) ** r * math.comb(order, r) * v
        at_points = np.einsum("pk,pkd->pd", s.w, v[s.node][None])
        weights = (s.w * points["mass"][:, None])[..., None]
        v = s.to_nodes(weights * at_points[:, None, :])
        v[used] /= nodes.mass[used, None]
        v[fixed] = 0.0
    return out


def gather(scene, points, nodes, dt, step=0):
    """Points after the step (3.8-3.16), as a new mapping."""
    dim, s = scene.grid.dim, nodes.shapes
    new, keep = dict(points), keep_share(scene, dt)
    v, w = nodes.v[s.node], nodes.w[s.node]
    L = np.einsum("kd,pkj->pdj", v, s.g)
    new["v"] = keep * points["v"] + s.w @ w
    new["x"] = points["x"] + dt * (s.w @ v)
    if scene.scheme.density == "shared":
        L = _flow_of_cells(scene, points, new, nodes, dt)
    else:
        new["log_density"] = points["log_density"] - dt * np.trace(L, axis1=1, axis2=2)
    if scene.scheme.transfer == "tpic":
        new["affine"] = L.reshape(-1, dim * dim)
    if scene.scheme.transfer == "apic":
        new["affine"] = _moment(scene, s, v).reshape(-1, dim * dim)
    if averages(scene, step):
        _average(scene, points, new, nodes, L, dt)
    if "affine" in new and scene.material.law != "elastic":  # these loose points carry none
        loose = new["log_density"] < -scene.scheme.tension_reach
        if scene.scheme.density == "tracked":
            loose &= _alone_at_wall(scene, points["x"])
        new["affine"] = np.where(loose[:, None], 0.0, new["affine"])
    gradient = np.zeros((len(L), 3, 3))
    gradient[:, :dim, :dim] = L
    material = scene.material
    stress, rate = law(
        material.law,
        vars(material) | {"K": material.K, "G": material.G},
        tensor(points["stress"], dim),
        gradient,
        new["log_density"],
        dt,
        equation_of_state=scene.scheme.density != "tracked",
    )
    new["stress"], new["shear_rate"] = components(stress, dim), rate
    return new


def _moment(scene, s, v):
    """The affine field of APIC: C = sum w v (x) r D^-1, D = sum w r (x) r."""
    dim, cell = scene.grid.dim, scene.grid.cell
    D = np.stack([(s.w * s.r[:, :, d] ** 2).sum(axis=1) for d in range(dim)], axis=1)
    C = np.empty((len(D), dim, dim))
    for d in range(dim):
        by_moment = np.einsum("pk,kd->pd", s.w * s.r[:, :, d], v)
        by_slope = np.einsum("pk,kd->pd", s.g[:, :, d], v)
        ruled = (D[:, d] > 0.02 * cell**2)[:, None]
        C[:, :, d] = np.where(ruled, by_moment / np.maximum(D[:, d], 1e-300)[:, None], by_slope)
    return C


def _average(scene, points, new, nodes, L, dt):
    """Averaging of the density, its pull to the geometric density, and the shift: for all the steps
    until the next one."""
    many = averaging_interval(scene)
    q, dx, s, dim = scene.scheme, scene.grid.cell, nodes.shapes, scene.grid.dim
    trace = np.trace(L, axis1=1, axis2=2)
    rate = many * _kinematic_rate(L)
    old = points["log_density"]
    joins = old >= -q.tension_reach
    near = s.w @ nodes.cbar[s.node]
    eta = _averaged_part(scene, many * dt, dt * rate, old)
    c = old - dt * trace + np.where(joins, eta, 0.0) * (near - old)
    phi = nodes.phi[s.node]
    full = s.w @ phi
    fed = _least_around(scene, points["x"], nodes.phi) > 0.5
    gap = 2 * (full - 1) / (full + 1) - c  # ln(full) by its first approximant
    pull = _pull(scene, many * dt, rate * dt, gap)
    c = np.where(fed & (c >= 0), c + pull, c)
    slope = np.einsum("k,pkj->pj", np.maximum(phi - 1, 0.0), s.g)
    delta = -q.shift * (rate * dt)[:, None] * dx**2 * slope
    length = np.linalg.norm(delta, axis=1)
    most = np.minimum(q.shift_limit * dx, 0.5 * rate * dt * dx)
    most = np.where(near_outlet(scene, points["x"]), 0.0, most)
    scale = np.where(length > most, most / np.maximum(length, 1e-300), 1.0)
    delta = delta * scale[:, None]
    delta = _held_at_walls(scene, points["x"], delta)
    lent = np.einsum("pdj,pj->pd", L, delta)
    u = points["overweight"]
    divergence = np.einsum("kj,pkj->p", nodes.uneven[s.node], s.g * dx)
    u = u - q.weighting * divergence - q.weight_decay * u - s.w @ nodes.excess[s.node]
    new["overweight"] = np.clip(u, -q.weight_limit, q.weight_limit)
    gradient = np.einsum("k,pkj->pj", nodes.cbar[s.node], s.g)
    new["density_gradient"] = np.where(joins[:, None], gradient, 0.0).reshape(-1, dim)
    new["log_density"], new["x"] = c, new["x"] + delta
    new["v"], new["shift_velocity"] = new["v"] + lent, lent


def _averaged_part(scene, dt, strain, c):
    """What an averaging moves log-densities towards their mean by, in a time and a strain."""
    q = scene.scheme
    rest = dt * q.diffusion * scene.material.wave_speed / scene.grid.cell
    pressed = np.maximum(c, 0)
    r = rest * pressed + q.strain_diffusion * strain
    return r / np.where(r > 0, pressed + r, 1.0)


def _kinematic_rate(L):
    """Shear rate and |tr L| of velocity gradients (n, dim, dim)."""
    trace, D = np.trace(L, axis1=1, axis2=2), (L + L.transpose(0, 2, 1)) / 2
    deviator_squared = np.einsum("pij,pij->p", D, D) - trace**2 / 3
    return np.sqrt(np.maximum(2 * deviator_squared, 0)) + abs(trace)


# ---- the density that the points of a cell share ----


def _share(scene, points, nodes):
    """Cells with points: what they are, and their forces in place of those of the points."""
    grid, s, m, dim = scene.grid, nodes.shapes, points["mass"], scene.grid.dim
    at = np.floor((points["x"] - grid.lower) / grid.cell)
    place, which = np.unique(at, axis=0, return_inverse=True)
    which = which.ravel()
    mean = _mean_over_cells(which, m)
    room = node_volumes(scene) * grid.cell**dim
    middle = Shapes(scene, grid.lower + (place + 0.5) * grid.cell)
    around = middle.w > 0
    filled = around @ nodes.mass[middle.node] / scene.material.rho_c
    free = around @ room[middle.node]
    phi = filled / free
    inside = np.clip((phi - 0.8) / 0.1, 0.0, 1.0)
    centre = mean((points["x"] - grid.lower) / grid.cell) - place
    local = inside[:, None] / 2 + (1 - inside[:, None]) * centre
    here = Shapes(scene, grid.lower + (place + local) * grid.cell)

    sigma = mean(tensor(points["stress"], dim)[:, :dim, :dim])
    needed = np.minimum(np.bincount(which, m) / scene.material.rho_c, grid.cell**dim)
    volume = inside * grid.cell**dim + (1 - inside) * needed
    nodes.force = s.to_nodes(0 * s.g) - here.to_nodes(
        np.einsum("c,cij,ckj->cki", volume, sigma, here.g)
    )
    excess = np.maximum(nodes.mass / scene.material.rho_c - room, 0.0) / grid.cell**dim
    nodes.cells = SimpleNamespace(
        which=which,
        place=place,
        here=here,
        c=mean(points["log_density"]),
        inside=inside,
        log_phi=2 * (phi - 1) / (phi + 1),
        crowding=np.einsum("k,ckj->cj", excess[here.node], here.g) * grid.cell,
    )


def _mean_over_cells(which, m):
    """The mean by mass of values (points, ...) over the points of each cell."""

    def mean(values):
        flat = values.reshape(len(m), -1)
        sums = np.stack([np.bincount(which, m * column) for column in flat.T], axis=1)
        sums /= np.bincount(which, m)[:, None]
        return sums.reshape(-1, *values.shape[1:])

    return mean


def _unevenness(scene, cells):
    """The mean over the axes of a quarter of the second difference of c, where all three join."""
    grid = scene.grid
    joins = np.where(cells.c >= -scene.scheme.tension_reach, cells.c, np.nan)
    known = {tuple(place): c for place, c in zip(cells.place, joins, strict=True)}
    out = np.zeros(len(joins))
    for k, place in enumerate(cells.place):
        for d in range(grid.dim):
            ends = (_beyond(scene, place, d, side, known) for side in (-1, 1))
            out[k] += np.nan_to_num(sum(ends) - 2 * joins[k]) / (4 * grid.dim)
    return out


def _beyond(scene, place, d, side, known):
    """c of the cell beside one; NaN beyond a wall or an end, and where there is none."""
    grid = scene.grid
    at = grid.lower[d] + (place[d] + max(side, 0)) * grid.cell
    middle = grid.lower + (place + 0.5) * grid.cell
    for axis, face, extents in _faces(scene):
        others = set(range(grid.dim)) - {d}
        here = axis == d and abs(face - at) < 1e-6 * grid.cell
        if here and all(extents[j][0] < middle[j] < extents[j][1] for j in others):
            return np.nan
    other = place.copy()
    other[d] += side
    if grid.periodic[d]:
        other[d] %= grid.shape[d]
    return known.get(tuple(other), np.nan)


def _flow_of_cells(scene, points, new, nodes, dt):
    """Density and shift of the points, by cells; returned are the velocity gradients of these."""
    q, cells, dx = scene.scheme, nodes.cells, scene.grid.cell
    L = np.einsum("ckj,ki->cij", cells.here.g, nodes.v[cells.here.node])
    rate = dt * _kinematic_rate(L)
    eta = _averaged_part(scene, dt, rate, cells.c)
    c = cells.c - dt * np.trace(L, axis1=1, axis2=2) + eta * _unevenness(scene, cells)
    gap = cells.log_phi - c
    fed = _pull(scene, dt, rate, gap)
    c = np.where((gap > 0) | (c >= 0), c + np.where(gap < 0, cells.inside, 1.0) * fed, c)
    length = np.linalg.norm(cells.crowding, axis=1)
    most = np.minimum(q.shift_limit, 0.5 * rate)
    scale = np.minimum(q.shift * rate, most / np.maximum(length, 1e-300))
    shift = (-scale[:, None] * dx * cells.crowding)[cells.which]
    shift[near_outlet(scene, points["x"])] = 0.0
    new["log_density"] = c[cells.which]
    new["x"] = new["x"] + _held_at_walls(scene, points["x"], shift)
    return L[cells.which]


def _pull(scene, dt, strain, gap):
    """What densities are pulled to the fullness by, in a time and a strain."""
    q, g = scene.scheme, np.linalg.norm(scene.gravity.vectors, axis=1).max()
    most = q.feedback_limit * g / scene.material.wave_speed * dt
    pull, crowd = q.feedback * strain, np.maximum(gap - q.feedback_noise, 0)
    return np.clip(pull * gap, -most, most) + pull * crowd


def _least_around(scene, x, phi):
    """Smallest phi of the nodes of the cell a point is in."""
    middle = scene.grid.lower + (np.floor((x - scene.grid.lower) / scene.grid.cell) + 0.5) * (
        scene.grid.cell
    )
    s = Shapes(scene, middle)
    return np.where(s.w > 0, phi[s.node], np.inf).min(axis=1)


def _faces(scene):
    """Axis, coordinate and extents of the faces of walls and blocks."""
    for wall in scene.walls:
        if hasattr(wall, "axis"):
            others = set(range(scene.grid.dim)) - {wall.axis}
            yield wall.axis, wall.at, {d: wall.extent(scene.grid, d) for d in others}
        else:
            extents = list(zip(wall.lower, wall.upper, strict=True))
            yield from ((d, at, extents) for d in range(scene.grid.dim) for at in extents[d])


def _beside_walls(scene, middle, reach=0.5):
    """Faces, and which cells have their middle at most so many cells from them."""
    cell, more = scene.grid.cell, (reach - 0.5 + 1e-6) * scene.grid.cell
    for axis, at, extents in _faces(scene):
        beside = abs(middle[:, axis] - at) < reach * cell + 1e-6 * cell
        for d in set(range(scene.grid.dim)) - {axis}:
            low, high = extents[d]
            beside &= (middle[:, d] > low - more) & (middle[:, d] < high + more)
        yield axis, at, beside


def _alone_at_wall(scene, x):
    """Points in a cell with one other at most, and with a wall among its nodes."""
    cell, lower = scene.grid.cell, np.array(scene.grid.lower)
    if scene.scheme.basis == "ugimp":  # cells about the nodes
        at, reach = np.floor((x - lower) / cell + 0.5), 1.0
        middle = lower + at * cell
    else:
        at, reach = np.floor((x - lower) / cell), 0.5
        middle = lower + (at + 0.5) * cell
    _, which, count = np.unique(at, axis=0, return_inverse=True, return_counts=True)
    walls = [beside for *_, beside in _beside_walls(scene, middle, reach)]
    return (count[which.ravel()] <= 2) & np.any(walls, axis=0)


def _held_at_walls(scene, x, delta):
    """What is left of the shift in the cell at a wall: towards it as much as the distance to it."""
    cell, delta = scene.grid.cell, delta.copy()
    middle = scene.grid.lower + (np.floor((x - scene.grid.lower) / cell) + 0.5) * cell
    for a, at, beside in _beside_walls(scene, middle):
        distance = (x[:, a] - at) / cell
        towards = beside & (distance * delta[:, a] < 0)
        delta[:, a] *= np.where(towards, abs(distance), 1.0)
    return delta


def near_outlet(scene, x):
    """Points in cells no farther than shift_outlet_cells from an opening."""
    reach = scene.scheme.shift_outlet_cells * scene.grid.cell
    cell = scene.grid.cell
    middle = scene.grid.lower + (np.floor((x - scene.grid.lower) / cell) + 0.5) * cell
    near = np.zeros(len(x), dtype=bool)
    for wall in scene.walls:
        if getattr(wall, "opens_at", math.inf) == math.inf:
            continue
        inside = np.ones(len(x), dtype=bool)
        for d in range(scene.grid.dim):
            low, high = (wall.at, wall.at) if d == wall.axis else wall.extent(scene.grid, d)
            inside &= (middle[:, d] > low - reach) & (middle[:, d] < high + reach)
        near |= inside
    return near


# ---- constitutive laws ----


def law(name, q, stress, L, log_density, dt, equation_of_state=False):
    """One update of stresses (n, 3, 3) under velocity gradients L (n, 3, 3) in the time dt.

    Returns the new stresses and the equivalent plastic shear rates (n,).
    """
    identity = np.eye(3)
    D, W = (L + L.transpose(0, 2, 1)) / 2, (L - L.transpose(0, 2, 1)) / 2
    volumetric = np.trace(D, axis1=1, axis2=2)[:, None, None] * identity
    elastic = (q["K"] - 2 * q["G"] / 3) * volumetric + 2 * q["G"] * D
    trial = stress + dt * (elastic + W @ stress - stress @ W)
    if name == "elastic":
        return trial, np.zeros(len(stress))
    p = -np.trace(trial, axis1=1, axis2=2) / 3
    deviator = trial + p[:, None, None] * identity
    if equation_of_state:
        p = q["K"] * log_density
    dense = (log_density >= 0) & (p > 0)
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


def returned(name, q, trial, p, dt):
    """Shear stress after the return: bisection on tau_trial - tau = G dt gamma(tau) (2.13-2.15)."""
    static = (q["mu_s"] if name == "mu_i" else q["mu"]) * p
    if trial <= static:
        return trial
    if name == "drucker_prager":
        return static
    # gamma = xi sqrt(p) (mu - mu_s)/(mu_2 - mu), cleared of its denominator: a quadratic in tau
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
    return (low + high) / 2

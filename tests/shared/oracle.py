"""Reference step of the MPM engine in plain NumPy, written from the equations.

Every function works on whole arrays over all nodes; only the table of walls is shared with the C
core. Equation numbers are those of Dunatunga & Kamrin 2015.
"""

import math
from types import SimpleNamespace

import numpy as np
from oracle_cell_averaged import cell_averages, flow_of_cells
from oracle_law import components, law, tensor
from oracle_nonlocal import Substeps
from oracle_shapes import Shapes, full_mass, node_radii, node_volumes
from oracle_smoothed import (
    average,
    averages,
    damp_flutter,
    damped_share,
    deviator,
    mean_of_cells,
    neighbour_corrections,
)
from oracle_walls import alone_at_wall

from granular.mpm.damping import damping
from granular.mpm.engine import flutter_interval
from granular.mpm.node_codes import node_codes


def p2g(scene, points, step=0, shift_dt=1.0):
    """Nodal sums (3.4): mass, momentum, force.

    Steps that average the density add phi and cbar; a cell-averaged density adds `cells`.
    """
    dim = scene.grid.dim
    s = Shapes(scene, points["x"])
    m = points["mass"]
    v = np.broadcast_to(points["v"][:, None, :], s.r.shape)
    if "affine" in points:
        v = v + np.einsum("pdj,pkj->pkd", points["affine"].reshape(-1, dim, dim), s.r)
    volume = m * np.exp(-points["log_density"]) / scene.material.rho_c
    if "weight_correction" in points:
        volume = (1 + points["weight_correction"]) * volume
    stress = tensor(points["stress"], dim)
    if "overstress" in points:
        stress = stress + points["overstress"][:, None, None] * deviator(stress)
    force = -np.einsum("p,pdj,pkj->pkd", volume, stress[:, :dim, :dim], s.g)
    if averages(scene, step - 1):
        force -= np.einsum("p,pk,pd->pkd", m / shift_dt, s.w, points["shift_velocity"])
    if scene.grid.axisymmetric:
        force[..., 0] -= s.w * (volume * stress[:, 2, 2] / points["x"][:, 0])[:, None]
    out = SimpleNamespace(
        shapes=s,
        mass=s.to_nodes(s.w * m[:, None]),
        momentum=s.to_nodes((s.w * m[:, None])[..., None] * v),
        force=s.to_nodes(force),
    )
    if scene.scheme.density.name == "cell_averaged":
        cell_averages(scene, points, out)
        rate = mean_of_cells(scene, points["x"], m, points["shear_rate"])
        share = damped_share(scene, rate, out.cells.c[out.cells.which])
        out.damped = s.to_nodes(s.w * (m * share)[:, None])
    if averages(scene, step):
        cell_mass = full_mass(scene)
        out.phi = _ratio(out.mass, cell_mass * node_volumes(scene))
        c = points["log_density"]
        joins = np.where(c >= -scene.scheme.density.separation_strain, m, 0.0)
        seen = c[:, None] + np.einsum("pj,pkj->pk", points["density_gradient"], s.r)
        joined = s.to_nodes(s.w * joins[:, None])
        weighted = joins * (1 + points["weight_correction"])
        counted = s.to_nodes(s.w * weighted[:, None])
        out.cbar = _ratio(s.to_nodes(s.w * weighted[:, None] * seen), counted)
        out.excess = np.where(joined > 0, _ratio(counted, joined) - 1, 0.0)
        push = s.g * scene.grid.cell
        if scene.grid.axisymmetric:
            push[..., 0] += s.w * (scene.grid.cell / points["x"][:, :1])
        push *= (weighted / cell_mass)[:, None, None]
        out.uneven = s.to_nodes(push) / node_radii(scene)[:, None]
    return out


def _ratio(a, b):
    return np.divide(a, b, out=np.zeros_like(a), where=b > 0)


def _wall(row, kept, v, after):
    """Apply a wall, in place, to the velocities (dim,) before and after the forces.

    Returned: which components it holds in the end, as friction may stop one that was leaving.
    """
    relative = after - row.velocity[: len(v)]
    held = _held(row, relative)
    slides = ~np.array(held)
    taken = relative - kept * (v - row.velocity[: len(v)])
    into = [max(-a * u, 0.0) if a else abs(u) for a, u in zip(row.away, taken, strict=False)]
    most = sum(h * f * u for h, f, u in zip(held, row.friction, into, strict=False))
    along = np.linalg.norm(after[slides])
    if most > 0 and along > 0:
        after[slides] -= min(1.0, most / along) * after[slides]
    v[held] = after[held] = np.array(row.velocity[: len(v)])[held]
    return _held(row, after - row.velocity[: len(v)])


def _held(row, relative):
    """Components that a wall holds at velocities relative to it: those that do not leave it."""
    held = [bool(row.fixed >> d & 1) for d in range(len(relative))]
    return [h and not a * u > 0 for h, a, u in zip(held, row.away, relative, strict=False)]


def keepshare(scene, dt):
    """Fraction of the old velocity of a point that is kept in a step."""
    scheme = scene.scheme
    if scheme.transfer in ("apic", "xpic"):
        return 0.0
    if scheme.transfer == "tpic":
        cell, g = scene.grid.cell, max(math.hypot(*vector) for vector in scene.gravity.vectors)
        rate = scheme.tpic_decay * scene.material.wave_speed / cell
        return math.exp(-max(rate, scheme.tpic_least_decay * math.sqrt(g / cell)) * dt)
    return math.exp(-scheme.flip_decay * dt)


def grid(scene, points, nodes, dt, time):
    """Nodal velocities (3.5-3.7): `v` after the forces, `w` the velocity that points receive."""
    used = nodes.mass > 0
    v = _ratio(nodes.momentum, nodes.mass[:, None])
    after = np.zeros_like(v)
    acceleration = nodes.force[used] / nodes.mass[used, None] + scene.gravity.at(time)
    after[used] = v[used] + dt * acceleration
    keep = np.full((len(v), 1), keepshare(scene, dt))
    if hasattr(nodes, "damped"):
        rate = damping(scene, scene.material, 0.0)["damping_rate"]
        share = rate * dt * _ratio(nodes.damped, nodes.mass)
        nodes.damping = keep * np.minimum(share, 1.0)[:, None]
        keep = keep - nodes.damping
    fixed, held = _at_walls(scene, used, keep[:, 0], v, after, time)
    if hasattr(nodes, "uneven"):
        neighbour_corrections(scene, nodes, fixed)
    nodes.v, nodes.before = after, v
    nodes.w = keep * (after - v) + (1 - keep) * after
    if scene.scheme.transfer == "xpic":
        nodes.w = after - v + _filtered(scene, points, nodes, v, held)


def _at_walls(scene, used, kept, v, after, time):
    """Apply the walls active at a time to nodal velocities.

    Returned: which components have a wall, and which of them it holds now.
    """
    codes, rows = node_codes(scene)
    codes = codes.dense().ravel()
    fixed, held = np.zeros(v.shape, dtype=bool), np.zeros(v.shape, dtype=bool)
    for i in np.flatnonzero(used & (codes > 0)):
        row = rows[codes[i] - 1]
        while time >= row.opens_at:
            row = rows[row.after - 1] if row.after else None
            if row is None:
                break
        if row is not None:
            held[i] = _wall(row, kept[i], v[i], after[i])
            fixed[i] = [row.fixed >> d & 1 for d in range(v.shape[1])]
    return fixed, held


def _filtered(scene, points, nodes, v, held):
    """Filtered velocity sum_r (-1)^(r+1) binomial(m, r) (S+ S)^(r-1) v

    Hammerquist & Nairn 2017, eq. 20.
    """
    s, order, out = nodes.shapes, scene.scheme.xpic_order, 0.0
    used = nodes.mass > 0
    for r in range(1, order + 1):
        out = out - (-1) ** r * math.comb(order, r) * v
        at_points = np.einsum("pk,pkd->pd", s.w, v[s.node][None])
        weights = (s.w * points["mass"][:, None])[..., None]
        v = s.to_nodes(weights * at_points[:, None, :])
        v[used] /= nodes.mass[used, None]
        v[held] = 0.0
    return out


def g2p(scene, points, nodes, dt, step=0):
    """Points after the step (3.8-3.16), as a new mapping."""
    new = _moved(scene, points, nodes, dt, step)
    for sponge in scene.sponge_layers:
        a = sponge.axis
        rises = (points["x"][:, a] >= sponge.above) & (new["v"][:, a] > 0)
        new["v"][rises, a] *= math.exp(-sponge.damping * dt)
    return new


def _moved(scene, points, nodes, dt, step):
    """The points after the step, before the sponge layers act."""
    dim, s = scene.grid.dim, nodes.shapes
    new, keep = dict(points), keepshare(scene, dt)
    v, w = nodes.v[s.node], nodes.w[s.node]
    L = np.einsum("kd,pkj->pdj", v, s.g)
    new["v"] = keep * points["v"] + s.w @ w
    if hasattr(nodes, "damping"):
        C = points["affine"].reshape(-1, dim, dim)
        carried = points["v"][:, None, :] + np.einsum("pdj,pkj->pkd", C, s.r)
        new["v"] = new["v"] - np.einsum("pk,pkd->pd", s.w * nodes.damping[s.node][..., 0], carried)
    new["x"] = points["x"] + dt * (s.w @ v)
    gradient = np.zeros((len(L), 3, 3))
    gradient[:, :dim, :dim] = L
    if scene.grid.axisymmetric:
        gradient[:, 2, 2] = (s.w @ v)[:, 0] / points["x"][:, 0]
    if scene.scheme.density.name == "cell_averaged":
        gradient = flow_of_cells(scene, points, new, nodes, dt)
        L = gradient[:, :dim, :dim]
    else:
        new["log_density"] = points["log_density"] - dt * np.trace(gradient, axis1=1, axis2=2)
    before = points
    if scene.material.law == "ngf":
        substeps = Substeps(scene, points, gradient, dt)
        points = substeps.points
    if "overstress" in points and step % flutter_interval(scene) == 0:
        # the stress of the points is stored at the end of the step, the rate after each substep
        new |= damp_flutter(scene, before | {"shear_rate": points["shear_rate"]}, dt, step)
    if scene.scheme.transfer == "tpic":
        new["affine"] = L.reshape(-1, dim * dim)
    if scene.scheme.transfer == "apic":
        new["affine"] = _moment(scene, s, v).reshape(-1, dim * dim)
    if averages(scene, step):
        average(scene, points, new, nodes, gradient, dt)
    # disconnected points have no affine field
    if "affine" in new and scene.material.law != "elastic":
        disconnected = new["log_density"] < -scene.scheme.density.separation_strain
        if scene.scheme.density.name == "particle":
            disconnected &= alone_at_wall(scene, points["x"])
        new["affine"] = np.where(disconnected[:, None], 0.0, new["affine"])
    material = scene.material
    if material.law == "ngf":
        made = substeps.substep(new["log_density"])
        names = {"stress", "shear_rate", "g", "g_gain"} & set(points)
        return new | {name: made[name] for name in names}
    stress, rate = law(
        material.law,
        vars(material) | {"K": material.K, "G": material.G},
        tensor(points["stress"], dim),
        gradient,
        new["log_density"],
        dt,
        equation_of_state=scene.scheme.density.name != "particle",
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

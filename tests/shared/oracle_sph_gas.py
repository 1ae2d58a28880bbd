"""Reference evaluation of the gas equations in plain NumPy, over all pairs.

The equations are in docs/explanation/sph.md.
"""

import numpy as np
from oracle_sph import images, kernel

LEAST, FULL, NEAREST = 0.05, 0.9, 0.25


def drag_coefficient(gas, diameter, e, rho, speed):
    """Drag coefficient B of Darcy, of Wen and Yu, and between them."""
    darcy = e**2 * gas.viscosity / gas.permeability
    reynolds = np.maximum(e * rho * speed * diameter / gas.viscosity, 1e-300)
    c_d = np.where(reynolds < 1000, 24 / reynolds * (1 + 0.15 * reynolds**0.687), 0.44)
    wen_yu = 0.75 * c_d * e * (1 - e) * rho * speed / diameter * e**-2.65
    t = np.clip((e - gas.darcy_porosity) / gas.blend, 0, 1)
    return darcy + t**2 * (3 - 2 * t) * (wen_yu - darcy)


def evaluate(scene, grains, walls, points, dry, dt, gravity):
    """Fields of the gas at the start of a run.

    Arguments: `grains` (solid particles) have x, v and rho; `points` (gas particles) have x, v and
    rho, the density of the gas; `walls` have x, porosity, normal and depth; `dry` holds the
    accelerations of the solid particles without gas.

    Returns mass, porosity, pressure force and acceleration of the gas, its gain of mass, and the
    accelerations of the solid particles.
    """
    gas, h = scene.gas, scene.h
    x, v, rho = points["x"], points["v"], points["rho"]
    v_wall = scene.point_mass / scene.material.rho0
    n, A = np.zeros(len(x)), np.ones(len(x))
    solid, cover = np.zeros(len(x)), np.zeros(len(x))

    def pairs(other):
        ways = [other[None] + shift - x[:, None] for shift in images(scene, x)]
        return [(d, *kernel(scene.dim, h, d)) for d in ways]

    gas_pairs, wall_pairs = pairs(x), pairs(walls["x"])
    w_grain = np.zeros((len(x), len(grains["x"])))
    for _, w, _ in gas_pairs:
        n += w.sum(1)
    for _, w, _ in wall_pairs:
        A -= (w * v_wall * (1 - walls["porosity"])).sum(1)
    for _, w, _ in pairs(grains["x"]):
        w_grain += w
        solid += (w * scene.point_mass / gas.grain_density).sum(1)
        cover += (w * scene.point_mass / grains["rho"]).sum(1)
    A = np.maximum(A, LEAST)
    t = np.minimum(cover / A / FULL, 1)
    share = np.divide(solid, cover, out=np.zeros_like(solid), where=cover > 0)
    e = np.maximum(1 - share * t**2 * (3 - 2 * t), LEAST)
    V = A / n
    mass = rho * e * V
    p = gas.sound_speed**2 * rho - gas.pressure

    push, stop, about = np.zeros_like(x), np.zeros_like(x), np.zeros(len(x))
    for d, _, grad in gas_pairs:
        u = h * np.einsum("abi,abi->ab", v[None] - v[:, None], d) / ((d**2).sum(-1) + 0.01 * h**2)
        u = np.minimum(u, 0)
        R = 0.5 * ((mass / V)[:, None] + (mass / V)[None])
        Q = gas.damping * (-gas.sound_speed * u + 2 * u**2) / R
        pull = p * V / n
        both = pull[:, None] + pull[None] + mass[:, None] * mass[None] * Q
        push -= np.einsum("ab,abi->ai", both, grad)
    for d, w, grad in wall_pairs:
        w = w * (1 - walls["porosity"])
        height = -np.einsum("abi,bi->ab", d, walls["normal"]) - walls["depth"]
        about += w.sum(1)
        lack = w * np.maximum(1 - height / (NEAREST * h), 0)
        stop += np.einsum("ab,bi->ai", lack, walls["normal"])
        push -= np.einsum("a,b,abi->ai", p / n, v_wall * (1 - walls["porosity"]), grad)

    stop = np.divide(stop, about[:, None], out=0 * stop, where=about[:, None] > 0)
    push += (mass * gas.sound_speed**2 / h)[:, None] * stop

    gain = np.zeros(len(x))
    slope = -push / V[:, None]
    for d, _, grad in gas_pairs:
        jump = p[None] - p[:, None]
        jump = jump - 0.5 * np.einsum("abi,abi->ab", slope[:, None] + slope[None], d)
        r2 = (d**2).sum(-1)
        # grad W points towards the neighbour, as d does
        per = np.divide(np.einsum("abi,abi->ab", d, grad), r2, out=0 * r2, where=r2 > 0)
        weight = gas.diffusion * h / gas.sound_speed * (e[:, None] + e[None]) * V[:, None] * V[None]
        gain += (weight * jump * per).sum(1)

    weights = w_grain * scene.point_mass
    total = weights.sum(1, keepdims=True)
    weights = np.divide(weights, total, out=np.zeros_like(weights), where=total > 0)
    weights[e >= 1] = 0
    a_grains = dry + np.einsum("aj,a,ai->ji", weights, 1 - e, push) / scene.point_mass
    a = e[:, None] * push / mass[:, None] + gravity
    load = np.einsum("aj,a->j", weights, mass) / scene.point_mass
    L = np.where(weights > 0, load[None], 0).max(1)
    r = weights @ grains["v"] - v * (weights.sum(1) > 0)[:, None]
    f = weights @ a_grains - a
    B = drag_coefficient(
        gas, gas.grain_diameter(scene.material.rho0), e, rho, np.linalg.norm(r, axis=1)
    )
    B = np.where(weights.sum(1) > 0, B, 0)
    s = B * V * (1 + L) / mass * dt
    ended = -np.expm1(-s)
    late = 1 - np.divide(ended, s, out=np.ones_like(s), where=s > 0)
    drag = (mass / (1 + L))[:, None] * (r * ended[:, None] / dt + f * late[:, None])
    a = a + drag / mass[:, None]
    a_grains = a_grains - weights.T @ drag / scene.point_mass
    return mass, e, push, a, gain, a_grains

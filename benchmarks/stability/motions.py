"""Elastic bodies that swing, rotate, settle and tear: conservation and losses of each transfer."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

import granular as gr
from stability.cells import SCHEMES, Map, chosen, off, simulate
from stability.elastic import BASES, WEIGHTLESS, body, places

LENGTH = 3.2
"""Length of the bar [m]."""

TRANSFERS = {
    "flip": gr.Scheme(transfer="flip"),
    "pic (xpic(1))": gr.Scheme(transfer="xpic", xpic_order=1),
    "xpic(2)": gr.Scheme(transfer="xpic"),
    "apic": gr.Scheme(transfer="apic"),
    "tpic": gr.Scheme(transfer="tpic", density=gr.ParticleDensity()),
    "tpic, smoothed (default)": gr.schemes.default,
    "cell_averaged": gr.schemes.cell_averaged,
}
"""Transfers; all but the last are with the quadratic basis."""


def bar(scheme: gr.Scheme, points: int = 4) -> gr.Simulation:
    """A bar of 32 cells along x, periodic along both axes."""
    cell = LENGTH / 32
    scene = body(gr.Box((0.0, 0.0), (LENGTH, cell)), points, scheme, shape=(32, 1), jitter=0.0)
    return simulate(scene)


def null_space(scheme: gr.Scheme) -> float:
    """Share left, after 4 periods, of a velocity that alternates between the points of a cell."""
    sim = bar(scheme)
    at, x = places(sim), sim.state.x
    sign = np.where(np.floor(x[:, 0] / 0.05 + 1e-9) % 2, 1.0, -1.0)
    sim.buffers["v"][0, at] = 1e-4 * sign
    before = abs(sim.state.v[:, 0] @ sign)
    while sim.time < 4 * LENGTH / sim.scene.material.wave_speed:
        sim.step()
    return float(abs(sim.state.v[:, 0] @ sign) / before)


def wave_energy(scheme: gr.Scheme) -> float:
    """Energy retained by a standing wave of 32 cells in one period."""
    sim = bar(scheme.replace(cfl=0.2))
    k, amplitude = 2 * np.pi / LENGTH, 1e-3
    at, x = places(sim), sim.state.x[:, 0]
    sim.buffers["v"][0, at] = amplitude * np.sin(k * x)
    if "affine" in sim.buffers:
        sim.buffers["affine"][0, at] = amplitude * k * np.cos(k * x)
    before = gr.measure.energy(sim.state).total
    while sim.time < LENGTH / sim.scene.material.wave_speed:
        sim.step()
    return gr.measure.energy(sim.state).total / before


def turning(scheme: gr.Scheme, turns: float, rate: float = 0.1) -> tuple[float, float]:
    """Relative errors of angular momentum and kinetic energy of a free block after some turns."""
    scene = body(gr.Box((0.6, 0.6), (1.0, 1.0)), 4, scheme, periodic=(False, False), seed=11)
    sim = simulate(scene)
    at, r = places(sim), sim.state.x - 0.8
    sim.buffers["v"][:, at] = rate * np.stack([-r[:, 1], r[:, 0]])
    if "affine" in sim.buffers:
        sim.buffers["affine"][:, at] = np.array([[0.0], [-rate], [rate], [0.0]])
    spin = scene.scheme.transfer == "apic"
    start = sim.state
    while sim.time * rate < 2 * np.pi * turns:
        sim.step(64)
    end = sim.state
    momentum = angular_momentum(end, spin) / angular_momentum(start, spin) - 1
    kinetic = gr.measure.energy(end).kinetic / gr.measure.energy(start).kinetic - 1
    return abs(momentum), abs(kinetic)


def angular_momentum(state: gr.State, spin: bool) -> float:
    """Angular momentum about the origin; with APIC including the spin of the affine field."""
    arm = state.x[:, 0] * state.v[:, 1] - state.x[:, 1] * state.v[:, 0]
    if spin:
        C = state.affine.reshape(-1, 2, 2)
        arm = arm + (C[:, 1, 0] - C[:, 0, 1]) * state.scene.grid.cell**2 / 4
    return float(np.sum(state.mass * arm))


def transfers(quick: bool) -> list[Map]:
    """Null space, dissipation, rotation: one map each, because their numbers differ in kind."""
    null = Map("null_space", "Null space", "share left after 4 periods", "transfer", "", 0.05)
    waves = Map("wave", "Dissipation", "energy kept in a period", "transfer", "", 0.9, least=True)
    spin = Map("rotation", "Rotation, ten turns", "relative error", "transfer", "of", 1e-2)
    for name, scheme in TRANSFERS.items():
        null.add(name, "alternating velocity", null_space, scheme)
        waves.add(name, "32 cells", wave_energy, scheme)
        for i, quantity in enumerate(("angular momentum", "kinetic energy")):
            spin.add(name, quantity, lambda s=scheme, i=i: turning(s, 0.2 if quick else 10)[i])
    return [null, waves, spin]


# ---- locking ----


def settlement(scheme: gr.Scheme, nu: float, cell: float) -> float:
    """Mean sinking [m] of the top of a block of 0.8 x 0.8 m that bulges on a rough floor.

    Half of the block is simulated; x = 0 is its plane of symmetry. Gravity grows over 20 wave
    times, then the block comes to rest by the damping of a dissipative transfer.
    """
    material = gr.Elastic(E=1e5, nu=nu)
    n = round(0.8 / cell)
    slow = 20 * 0.8 / material.wave_speed * max(1.0, 0.3 / math.sqrt(1 - 2 * nu))
    scene = gr.Scene(
        name="block",
        grid=gr.Grid((0.0, 0.0), cell, (n, round(1.2 / cell))),
        fills=(gr.Fill(gr.Box((0.0, 0.0), (0.4, 0.8)), 9),),
        material=material,
        scheme=scheme,
        walls=(gr.Wall(1, 0.0, kind="no_slip"), gr.Wall(0, 0.0, kind="free_slip")),
        gravity=gr.Gravity((0.0, slow), ((0.0, 0.0), (0.0, -1.0))),
        duration=4 * slow,
    )
    sim = simulate(scene)
    top = sim.state.x[:, 1] > 0.7
    start = sim.state.x[top, 1].mean()
    sinking = []
    while sim.time < 4 * slow:
        sim.run(until=min(sim.time + slow / 4, 4 * slow))
        sinking.append(start - sim.state.x[top, 1].mean())
    return float(np.mean(sinking[-8:]))


def locking(quick: bool) -> Map:
    """Volumetric locking: a block that is too stiff because its volume can hardly change."""
    result = Map(
        "locking",
        "Volumetric locking: sinking of a block that bulges, 4 cells across",
        "relative error against cells a quarter the size",
        "scheme",
        "nu",
        0.05,
    )
    names = [name for name in SCHEMES if name != "quadratic, flip"]
    fine = 0.1 if quick else 0.025
    for nu in chosen((0.3, 0.45, 0.49, 0.499), quick):
        exact = settlement(gr.Scheme(transfer="apic"), nu, fine)
        for name in names:
            result.add(name, f"{nu:g}", off, exact, settlement, SCHEMES[name], nu, 0.1)
    return result


# ---- tearing ----


def tear(scheme: gr.Scheme, points: int, most: float) -> tuple[float, dict[str, Any]]:
    """Stretch at which gaps appear in a uniformly stretched bar.

    The bar flies apart with v = rate x, and its stress has little effect on its motion. A gap
    is a pair of neighbouring points that share no node, so that no force is transmitted between
    them. The note is the stretch at which `granular.measure.gap_fraction` finds the first gap.
    """
    cell, rate = 0.1, 1.0
    material = gr.Elastic(E=1.0, nu=0.0)
    scene = gr.Scene(
        name="drawn",
        grid=gr.Grid((0.0, 0.0), cell, (48, 3)),
        fills=(gr.Fill(gr.Box((1.9, 0.1), (2.9, 0.2)), points),),
        material=material,
        scheme=scheme.replace(dt=2e-3),
        gravity=WEIGHTLESS,
        duration=most / rate,
    )
    sim = simulate(scene)
    at = places(sim)
    sim.buffers["v"][0, at] = rate * (sim.state.x[:, 0] - 2.4)
    if "affine" in sim.buffers:
        sim.buffers["affine"][0, at] = rate
    gap = math.nan
    while sim.time * rate < most - 1:
        sim.step(5)
        stretch = 1 + sim.time * rate
        if math.isnan(gap) and gr.measure.gap_fraction(sim.state) > 0:
            gap = stretch
        if weakest(sim, scheme.basis):
            return stretch, {"gap seen at": gap}
    return most, {"gap seen at": gap}


def weakest(sim: gr.Simulation, basis: str) -> bool:
    """True if some pair of neighbouring points along the bar shares no node."""
    x = np.unique(np.round(sim.state.x[:, 0] / sim.scene.grid.cell, 9))
    first, last = node_span(x, basis)
    return bool(np.any(first[1:] > last[:-1]))


def node_span(x: np.ndarray, basis: str) -> tuple[np.ndarray, np.ndarray]:
    """First and last node on which a point at x [cells] has a non-zero weight."""
    reach = {"linear": 1.0, "ugimp": 1.25, "quadratic": 1.5}[basis] * (1 - 1e-9)
    return np.ceil(x - reach), np.floor(x + reach)


def tearing(quick: bool) -> Map:
    """Numerical fracture: the stretch at which neighbouring points no longer share a node."""
    result = Map(
        "tearing",
        "Numerical fracture: a bar drawn out from 1 to 4",
        "stretch at which neighbours share no node",
        "basis",
        "points per cell",
        4.0,
        least=True,
    )
    for basis in BASES:
        scheme = gr.Scheme(basis=basis, transfer="flip")
        for points in chosen((1, 4, 9, 16), quick):
            result.add(basis, f"{points}", tear, scheme, points, 4.0)
    return result

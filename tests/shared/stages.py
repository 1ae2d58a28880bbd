"""Simulations from a disturbed state, and steps made stage by stage."""

import numpy as np

import granular as gr

TIME = 0.03
"""Time in the middle of the gravity ramp."""


def living(sim):
    """Columns of the active points in the buffers, in the order of their ids."""
    ids = sim.buffers["id"]
    places = np.flatnonzero(ids >= 0)
    return places[np.argsort(ids[places])]


def disturbed(scene, seed=3, step=0, **options):
    """Simulation after some steps: points move, most bear stress, and all fields are in use."""
    sim = gr.Simulation(scene, threads=1, **options)
    rng, at = np.random.default_rng(seed), living(sim)
    n, material = len(at), scene.material
    p = np.where(rng.random(n) < 0.2, 0.0, rng.uniform(10.0, 4000.0, n))
    values = {
        "v": rng.normal(0.0, 0.3, (scene.dim, n)),
        "log_density": np.where(p > 0, p / material.K, rng.uniform(-0.3, 0.0, n)),
        "affine": rng.normal(0.0, 3.0, (scene.dim**2, n)),
        "density_gradient": rng.normal(0.0, 0.05, (scene.dim, n)),
        "shift_velocity": rng.normal(0.0, 0.02, (scene.dim, n)),
        "weight_correction": rng.normal(0.0, 0.1, (1, n)),
        "shear_rate": rng.uniform(0.0, 5.0, (1, n)),
        "mean_shear_rate": np.maximum(rng.uniform(-1.0, 5.0, (1, n)), 0.0),
        "overstress": rng.uniform(-0.2, 0.2, (1, n)),
    }
    stress = rng.normal(0.0, 0.3, (4 if scene.dim == 2 else 6, n)) * p
    stress[:3] -= stress[:3].mean(axis=0) + p
    values["stress"] = stress
    values["g"] = rng.choice([0.0, 1.0], (1, n)) * 10 ** rng.uniform(-3.0, 1.5, (1, n))
    values["g_gain"] = rng.normal(0.0, 1.0, (1, n)) * values["g"].mean()
    for name, value in values.items():
        if name in sim.buffers:
            sim.buffers[name][:, at] = value
    clock = {"time": TIME, "time_anchor": TIME, "step": step, "step_anchor": step}
    sim._engine.restore(sim._engine.scalars() | clock)
    return sim


def stages(sim, count):
    for _ in range(count):
        for stage in (sim._engine.p2g, sim._engine.grid, sim._engine.g2p):
            needed = stage()
            while needed:
                sim._grow(needed)
                needed = 0

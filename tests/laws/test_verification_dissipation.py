"""Plastic flow takes elastic energy from every point of 3D scenes, in each step; none gains any."""

import numpy as np
import oracle_hencky as oracle
import pytest

import granular as gr

PARTICLE_DENSITY = gr.scenes.excavation().scheme
"""Scheme whose points keep their velocity gradient, so that a step can be repeated outside."""

SCENES = {
    "excavation": lambda: gr.scenes.excavation(
        depth=0.05, speed=0.2, dive_speed=0.2, settle=0.02, ramp=0.01, cell=0.05, length=0.6,
        width=0.4, start=0.2, travel=0.1,
    ),
    "wheel": lambda: gr.scenes.wheel(
        settle=0.1, ramp=0.05, cell=0.05, soil=0.1, width=0.2, scheme=PARTICLE_DENSITY
    ),
    "couette": lambda: gr.scenes.couette(
        inner=0.04, outer=0.082, height=0.02, cell=0.01, omega=2.5, scheme=PARTICLE_DENSITY
    ),
    "silo_3d": lambda: gr.scenes.silo_3d(cell=0.0125, width=0.025, scheme=PARTICLE_DENSITY),
}  # fmt: skip


def stored(h, material):
    """Energy [J/m3] of a deviatoric logarithmic strain (n, 3, 3)."""
    return material.G * (h * h).sum(axis=(1, 2))


def strain(state, rows):
    """Deviator of the elastic logarithmic strain of these points, (n, 3, 3)."""
    kirchhoff = (
        oracle.matrices(state.stress[rows].T) * np.exp(-state.log_density[rows])[:, None, None]
    )
    return oracle.deviator(kirchhoff) / (2 * state.scene.material.G)


def made_again(before, after):
    """Energy lost by flow in a step, mean stress times plastic strain, trial energy [J/m3].

    The trial state uses scipy's exponential and LAPACK's eigenvalues.
    """
    _, here, there = np.intersect1d(before.id, after.id, return_indices=True)
    dense = before.dense[here] & after.dense[there]
    here, there = here[dense], there[dense]
    dt, material = after.time - before.time, after.scene.material
    trial = oracle.trial_strain(strain(before, here), dt * after.affine[there].reshape(-1, 3, 3))
    found = strain(after, there)
    energies = stored(trial, material), stored(found, material)
    mean = sum(np.sqrt(2 * material.G * energy) for energy in energies) / 2
    return energies[0] - energies[1], mean * after.shear_rate[there] * dt, energies[0]


@pytest.mark.parametrize("name", SCENES)
def test_no_point_gains_energy_by_flow(name):
    sim = gr.Simulation(SCENES[name](), threads=1)
    share = []
    for time in np.linspace(0.02, 0.2, 10):
        sim.run(until=time, monitor=False)
        before = sim.state
        sim.run(until=np.nextafter(sim.time, 1.0), monitor=False)
        assert sim.steps == before.step + 1
        lost, said, trial = made_again(before, sim.state)
        rounding = 1e-12 * trial.max()
        assert (lost >= -rounding).all()
        np.testing.assert_allclose(lost, said, rtol=0, atol=1e-9 * lost.max() + rounding)
        share.append(np.mean(lost > 1e-6 * trial))
    assert max(share) > 0.05  # some points flow


@pytest.mark.parametrize("name", [name for name in SCENES if name != "excavation"])
def test_plastic_power_is_not_negative_with_the_schemes_of_the_scenes(name):
    sim = gr.Simulation(SCENES[name]().replace(scheme=getattr(gr.scenes, name)().scheme), threads=1)
    for time in np.linspace(0.02, 0.3, 15):
        state = sim.run(until=time, monitor=False).state
        assert (state.shear_rate >= 0).all()
    assert (state.shear_stress * state.shear_rate > 0).mean() > 0.05

"""The plastic shear strain summed up by the core, for any law."""

import numpy as np
import pytest

import granular as gr


def collapse(law=None, **scheme):
    scene = gr.scenes.column_collapse(cell=0.05, E=1e6, duration=0.4)
    law = gr.MuI(E=1e6) if law is None else law
    return scene.replace(material=law, scheme=scene.scheme.replace(shear_strain=1, **scheme))


@pytest.mark.parametrize(
    ("law", "scheme"),
    [
        (gr.MuI(E=1e6), {}),
        (gr.DruckerPrager(E=1e6), {"density": gr.ParticleDensity()}),
        (gr.NGF(E=1e6, elasticity="hencky", A=0.5, d=0.01), {}),
    ],
)
def test_it_is_the_sum_of_the_rates(law, scheme):
    """Of the points by their ids, step by step, also where they change their cells."""
    sim = gr.Simulation(collapse(law, **scheme), threads=1)
    strain = np.zeros(sim.state.n)
    assert not sim.state.shear_strain.any()
    for _ in range(150):
        sim.step()
        strain += sim.dt * sim.state.shear_rate
    assert np.array_equal(sim.state.shear_strain, strain)
    assert strain.max() > 0.01


def test_it_changes_no_bits_and_restarts_with_the_same(tmp_path):
    plain = gr.Simulation(collapse().replace(scheme=gr.schemes.default), threads=1).run(until=0.2)
    assert "shear_strain" not in plain.state.fields
    whole = gr.Simulation(collapse(), threads=3).run(until=0.2)
    assert whole.state.x.tobytes() == plain.state.x.tobytes()
    part = gr.Simulation(collapse(), threads=1)
    part.run(until=0.1, save=tmp_path / "a.h5")
    del part
    gr.Simulation.resume(tmp_path / "a.h5").run(until=0.2)
    last = gr.open(tmp_path / "a.h5")[-1]
    assert last.shear_strain.tobytes() == whole.state.shear_strain.tobytes()


def test_a_layer_that_is_sheared_by_a_wall():
    """Strain u t/h of a thin layer between plates, one of which moves with u."""
    grid = gr.Grid((0.0, 0.0), 0.05, (4, 8), periodic=(True, False))
    layer = gr.Fill(gr.Box((0.0, 0.0), (0.2, 0.4)), 4, density=1510.0)
    walls = (gr.Wall(1, 0.0), gr.Wall(1, 0.4, velocity=(0.4, 0.0)))
    scene = gr.Scene(
        name="shear", grid=grid, fills=(layer,), walls=walls, gravity=(0.0, 0.0),
        material=gr.DruckerPrager(E=1e6), duration=1.0, scheme=gr.Scheme(shear_strain=1),
    )  # fmt: skip
    state = gr.Simulation(scene).run(monitor=False).state
    mean = np.average(state.shear_strain, weights=state.mass)
    assert mean == pytest.approx(1.0, rel=0.03)  # less the elastic strain


def test_only_0_and_1_are_allowed():
    for value in (2, -1, 0.5):
        with pytest.raises((TypeError, ValueError), match="shear_strain"):
            gr.Scheme(shear_strain=value)

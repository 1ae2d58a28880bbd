"""Laws of one's own, in NumPy, by numba and in C: mu(I) again, history, faults, restarts."""

import dataclasses
import importlib.util

import numpy as np
import pytest
from accuracy.own_mohr_coulomb import material as mohr_coulomb
from same_bits import same_bits
from scenes_by_hand import scene_with
from speed.own_mu_I import MU_I_IN_C, mu_I, mu_I_by_points

import granular as gr
from granular.materials import from_function

SAND = gr.materials.glass_beads.replace(E=1e6)
NUMBERS = {"mu_s": SAND.mu_s, "mu_2": SAND.mu_2, "xi": SAND.xi}


def laws():
    common = {"parameters": NUMBERS, "E": SAND.E, "nu": SAND.nu, "rho_c": SAND.rho_c}
    return {
        "numpy": lambda: from_function(mu_I, **common),
        "numba": lambda: from_function(mu_I_by_points, compiler="numba", **common),
        "c": lambda: from_function(MU_I_IN_C, **common),
    }


@pytest.fixture(params=["numpy", "numba", "c"])
def own(request):
    if request.param == "numba":
        pytest.importorskip("numba")
    return laws()[request.param]()


def scene_of(material, dim=2, **more):
    across = () if dim == 2 else (0.1,)
    return scene_with(
        grid=gr.Grid((0.0,) * dim, 0.025, (24, *([4] * (dim - 2)), 12)),
        fills=[gr.Fill(gr.Box((0.0,) * dim, (0.2, *across, 0.2)), 2**dim)],
        material=material,
        walls=[gr.Wall(0, 0.0, kind="free_slip"), gr.Wall(dim - 1, 0.0)],
        # the damping of ill-posed waves is for laws whose friction the scheme knows
        scheme=gr.schemes.default.replace(density=gr.SmoothedDensity(flutter_damping=0)),
        **more,
    )


@pytest.mark.parametrize("dim", [2, 3])
def test_mu_I_of_the_user_is_that_of_the_core(own, dim):
    """The same law flows as the built-in one to round-off, before chaos makes it grow."""
    runs = [gr.Simulation(scene_of(m, dim), threads=1) for m in (own, SAND.replace(nu=own.nu))]
    for sim in runs:
        sim.step(150)
    a, b = (sim.state for sim in runs)
    assert (b.shear_rate > 0).mean() > 0.03  # the flow has begun
    assert np.abs(a.x - b.x).max() < 1e-9
    assert np.abs(a.pressure - b.pressure).max() < 1e-7 * b.pressure.max()
    assert np.abs(a.shear_rate - b.shear_rate).max() < 1e-6 * b.shear_rate.max()


def test_bits_for_threads_and_a_restart(own, tmp_path):
    same_bits(scene_of(own), 60, 100, path=tmp_path / "own.h5")


def worn(dt, parameters, gradient, log_density, stress, shear_rate, history):
    history[0] += dt
    history[1] *= 2.0


def test_points_keep_their_history(tmp_path):
    law = from_function(worn, history={"age": 1.0, "twice": 1.0}, E=1e6, bears_tension=True)
    sim = gr.Simulation(scene_of(law), threads=2)
    sim.step(10)
    assert sim.state.history.shape == (sim.n_points, 4)
    assert np.allclose(sim.state.history[:, 0], 1.0 + sim.time, rtol=1e-12)
    assert (sim.state.history[:, 1] == 2.0**10).all()
    sim.run(until=sim.time + 1e-3, save=tmp_path / "worn.h5")
    again = gr.Simulation.resume(tmp_path / "worn.h5")
    assert np.array_equal(again.state.history, sim.state.history)


def shifted(dt, parameters, gradient, log_density, stress, shear_rate, history):
    """p = K max(c - a, 0) and tau <= mu p, elastic below."""
    K, G, a, mu = parameters[:4]
    p = K * np.maximum(log_density - a, 0.0)
    deviator = stress.copy()
    deviator[:3] -= stress[:3].mean(axis=0)
    tau = np.sqrt(0.5 * (deviator[:3] ** 2).sum(axis=0) + (deviator[3:] ** 2).sum(axis=0))
    stress[:] = deviator * np.minimum(1.0, mu * p / np.maximum(tau, 1e-300))
    stress[:3] -= p
    shear_rate[:] = np.maximum(tau - mu * p, 0.0) / (G * dt)


def bed_of(a, density, separation):
    """A bed of points at random places that bears its weight from the start."""
    law = from_function(shifted, parameters={"a": a, "mu": 0.5}, separation=separation)
    cell, averaged = 0.02, isinstance(density, gr.CellAveragedDensity)
    return scene_with(
        grid=gr.Grid((0.0, 0.0), cell, (6, 26), periodic=(True, False)),
        fills=(gr.Fill(gr.Box((0.0, 0.0), (0.12, 0.4)), 4, jitter=0.3, lithostatic=True),),
        material=law,
        walls=(gr.Wall(1, 0.0),),
        scheme=gr.Scheme(basis="linear" if averaged else "quadratic", density=density),
    )


def borne(sim):
    """Vertical stress over the weight above, mean over rows of cells and over half a second."""
    shares = []
    for time in np.linspace(0.5, 1.0, 11):
        state = sim.run(until=time).state
        row = (state.x[:, 1] / 0.02).astype(int)
        mass = np.bincount(row, state.mass, minlength=26)
        above = (np.cumsum(mass[::-1])[::-1] - 0.5 * mass) * 9.8 / 0.12
        stress = np.bincount(row, -state.stress[:, 1] * state.mass, minlength=26)
        shares.append((stress[3:14] / mass[3:14] / above[3:14]).mean())
    return np.mean(shares)


@pytest.mark.parametrize("a", [-0.05, 0.1])
@pytest.mark.parametrize(
    "density", [gr.SmoothedDensity(), gr.CellAveragedDensity(), gr.ParticleDensity()]
)
def test_a_law_says_where_it_separates(a, density):
    sim = gr.Simulation(bed_of(a, density, a), threads=1)
    assert borne(sim) == pytest.approx(1.0, abs=0.02)
    assert "weights_at_limit" not in {found.name for found in sim.health().suspect}


def test_points_that_count_as_disconnected_keep_their_weights():
    """A law that does not say that it bears pressure there: the stress was 0.64 of the weight."""
    scene = bed_of(-0.03, gr.SmoothedDensity(), 0.0)
    (fill,) = scene.fills
    loose = dataclasses.replace(fill, lithostatic=False, density=1500.0 * np.exp(-0.03))
    slow = gr.Gravity((0.0, 0.3), ((0.0, 0.0), (0.0, -9.8)))
    sim = gr.Simulation(scene.replace(fills=(loose,), gravity=slow), threads=1)
    assert borne(sim) == pytest.approx(1.0, abs=0.02)


def test_weights_at_their_limit_make_a_run_suspect():
    """Points at random places, whose weights are hardly allowed to differ."""
    narrow = gr.SmoothedDensity(weight_correction_limit=1e-3)
    sim = gr.Simulation(bed_of(0.0, narrow, 0.0), threads=1).run(until=0.1)
    assert "weights_at_limit" in {found.name for found in sim.health().suspect}


def broken(dt, parameters, gradient, log_density, stress, shear_rate, history):
    raise ZeroDivisionError("a fault of the user")


SHARE = 1.0


def with_global(dt, parameters, gradient, log_density, stress, shear_rate, history):
    stress *= SHARE


def with_default(dt, parameters, gradient, log_density, stress, shear_rate, history, share=0.5):
    stress *= share


class Holder:
    def law(self, dt, parameters, gradient, log_density, stress, shear_rate, history):
        stress *= 0.5


def test_faults_are_told(monkeypatch):
    sim = gr.Simulation(scene_of(from_function(broken)), threads=2)
    with pytest.raises(ZeroDivisionError, match="a fault of the user"):
        sim.step(5)
    if importlib.util.find_spec("numba"):
        sim = gr.Simulation(scene_of(from_function(broken, compiler="numba")), threads=2)
        with pytest.raises(ZeroDivisionError, match="a fault of the user"):
            sim.step(5)
    captured = 3.0

    def enclosed(dt, parameters, gradient, log_density, stress, shear_rate, history):
        stress *= captured

    with pytest.raises(ValueError, match="must be a plain function without default values"):
        from_function(with_default)
    with pytest.raises(ValueError, match="must be a plain function without default values"):
        from_function(Holder().law)
    monkeypatch.setitem(globals(), "SHARE", 0.25)
    first = from_function(with_global)
    monkeypatch.setitem(globals(), "SHARE", 0.5)
    assert from_function(with_global).digest != first.digest
    with pytest.raises(ValueError, match=r"must not use variables .*'captured'"):
        from_function(enclosed)
    with pytest.raises(ValueError, match="its source cannot be read"):
        from_function(eval("lambda *points: None"))
    with pytest.raises(TypeError, match="update = 3 must be a function"):
        from_function(3)
    with pytest.raises(ValueError, match=r"separation = 2\.0 must"):
        from_function(worn, separation=2.0)
    with pytest.raises(ValueError, match=r"separation = 0\.1 must be 0 with bears_tension"):
        from_function(worn, separation=0.1, bears_tension=True)
    with pytest.raises(ValueError, match="compiler = 'jit' must be one of"):
        from_function(worn, compiler="jit")
    with pytest.raises(ValueError, match=r"history = .* must be 4 numbers at most"):
        from_function(worn, history=dict.fromkeys("abcde", 0.0))
    with pytest.raises(ValueError, match=r"parameters\['a'\] = inf must be"):
        from_function(worn, parameters={"a": np.inf})


def test_c_source_that_does_not_compile_is_refused():
    with pytest.raises(ValueError, match="the C source of the law 'update' must compile"):
        from_function("void update(int64_t n) { return 1; }")


def test_another_source_does_not_resume(tmp_path, monkeypatch):
    """A record knows the source; a process that does not have the function says so."""
    law = laws()["numpy"]()
    gr.Simulation(scene_of(law), threads=1).run(until=1e-3, save=tmp_path / "own.h5")
    with gr.open(tmp_path / "own.h5") as record:
        assert record.scene.material == law
    other = law.replace(source=law.source + "\n# changed")
    with pytest.raises(ValueError, match=r"materials\[0\].source must .* differs in\n\+# changed"):
        gr.Simulation.resume(tmp_path / "own.h5", scene=scene_of(other))
    top = gr.Fill(gr.Box((0.0, 0.2), (0.2, 0.25)), 4, material=law)
    both = scene_of(SAND)
    both = both.replace(fills=[*both.fills, top])
    gr.Simulation(both, threads=1).run(until=1e-3, save=tmp_path / "both.h5")
    changed = both.replace(fills=[both.fills[0], dataclasses.replace(top, material=other)])
    with pytest.raises(ValueError, match=r"materials\[1\].source must be .* differs in"):
        gr.Simulation.resume(tmp_path / "both.h5", scene=changed)
    monkeypatch.setattr("granular.materials.own._FUNCTIONS", {})
    with pytest.raises(ValueError, match=r"'mu_I' with the source digest .* is not known"):
        gr.Simulation.resume(tmp_path / "own.h5")


def test_an_own_law_beside_one_of_the_core():
    """Two materials, one of them of the user, flow as the two of the core do."""
    law = laws()["numpy"]()
    heavy = SAND.replace(rho_c=1800.0)
    states = []
    for material in (law, SAND):
        scene = scene_of(material)
        top = gr.Fill(gr.Box((0.0, 0.2), (0.2, 0.25)), 4, material=heavy)
        sim = gr.Simulation(scene.replace(fills=[*scene.fills, top]), threads=1)
        sim.step(100)
        states.append(sim.state)
    assert np.abs(states[0].x - states[1].x).max() < 1e-9


@pytest.mark.parametrize("dim", [2, 3])
def test_mohr_coulomb_bounds_the_principal_stresses(dim):
    """In a collapse, sigma_1 - sigma_3 <= (sigma_1 + sigma_3) sin(phi), equal where it yields."""
    sim = gr.Simulation(scene_of(mohr_coulomb(phi_deg=31.0, E=1e6), dim), threads=1)
    sim.step(300)
    xx, yy, zz, *shear = sim.state.stress.T
    xy, yz, xz = (*shear, 0 * xx, 0 * xx) if dim == 2 else shear
    tensor = np.moveaxis(np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]]), 2, 0)
    least, _, largest = -np.linalg.eigvalsh(tensor)[:, ::-1].T
    yields = (sim.state.shear_rate > 0) & (sim.state.pressure > 0)
    mobilised = (largest - least)[yields] / (largest + least)[yields]
    assert yields.mean() > 0.03
    assert mobilised == pytest.approx(np.sin(np.radians(31.0)), rel=1e-9)
    limit = (largest + least) * np.sin(np.radians(31.0))
    assert (largest - least <= limit * (1 + 1e-9) + 1e-9).all()

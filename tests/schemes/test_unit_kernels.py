"""P2G, grid and G2P stages of the core against the plain NumPy step of oracle.py."""

import numpy as np
import oracle
import pytest
from oracle_fluidity import available
from oracle_shapes import Shapes, axis_nodes
from stages import TIME, disturbed, living, stages

import granular as gr
from granular import _core


def read(sim):
    """Buffers as arrays (n, ...) by id."""
    places = living(sim)
    fields = {name: array[..., places].T.copy() for name, array in sim.buffers.items()}
    return {n: a[:, 0] if a.ndim == 2 and a.shape[1] == 1 else a for n, a in fields.items()}


def nodes_by_number(scene, found):
    """Numbers of the engine's nodes in the whole grid, x fastest."""
    shapes = Shapes(scene, np.array([scene.grid.lower]) + 0.5 * scene.grid.cell)
    where = np.zeros((len(found), scene.dim))
    number, stride = np.zeros(len(found), dtype=int), 1
    for d in range(scene.dim):
        where = (found[:, d] - scene.grid.lower[d]) / scene.grid.cell
        axis = axis_nodes(scene, d)
        nearest = abs(where[:, None] - axis).argmin(axis=1)
        np.testing.assert_allclose(axis[nearest], where, atol=1e-9)
        number += stride * nearest
        stride *= shapes.counts[d]
    return number


def assert_close(actual, expected, scale, text):
    """Assert equality to the round-off of the sums."""
    error = abs(np.asarray(actual) - np.asarray(expected)).max() if len(actual) else 0.0
    assert error <= 2e-13 * scale, f"{text}: {error:.3g} of {scale:.3g}"


def decaying(small_scene, kind, dim, combination):
    decay = 40.0 if combination[1] == "flip" else 0.0
    return small_scene(
        kind, dim, combination, flip_decay=decay, shifting_limit=1e-3, averaging_time=0.0
    )


def test_stages_agree_with_the_oracle(small_scene, combination, dim):
    compare_stages(decaying(small_scene, "walls", dim, combination), FLOWING)


@pytest.mark.parametrize("kind", ["periodic", "outlet"])
def test_stages_agree_in_other_domains(small_scene, typical_combination, dim, kind):
    compare_stages(decaying(small_scene, kind, dim, typical_combination), FLOWING)


@pytest.mark.parametrize("kind", ["axis", "rings"])
def test_stages_of_rings_agree_with_the_oracle(small_scene, combination, kind):
    if combination[0] == "ugimp":
        with pytest.raises(ValueError, match="axisymmetric"):
            small_scene(kind, 2, combination)
    else:
        compare_stages(decaying(small_scene, kind, 2, combination), FLOWING)


@pytest.mark.parametrize("step", [0, 1, 2, 3])
def test_steps_between_averagings_agree_with_the_oracle(small_scene, dim, step):
    """The first of three steps averages; the second subtracts the shift momentum correction."""
    combination = ("quadratic", "tpic", "smoothed")
    scene = small_scene("walls", dim, combination, shifting_limit=3e-3, averaging_time=1.5)
    compare_stages(scene, FLOWING + step)


FLOWING = 12
"""A step that averages and damps: beyond the first, in which all flow counts as steady."""

NONLOCAL = [
    ("linear", "flip", "particle"),
    ("quadratic", "flip", "particle"),
    ("quadratic", "tpic", "smoothed"),
    ("linear", "tpic", "cell_averaged"),
]
METHODS = [("explicit", 1), ("explicit", 3), ("implicit", 1), ("implicit", 3), ("rkl2", 1)]


@pytest.mark.parametrize("kind", ["axis", "rings"])
@pytest.mark.parametrize(("method", "substeps"), METHODS)
@pytest.mark.parametrize("of_rings", NONLOCAL[2:], ids="-".join)
def test_a_step_of_rings_with_fluidity_agrees_with_the_oracle(
    small_scene, of_rings, kind, method, substeps
):
    compare_fluidity(small_scene, of_rings, 2, kind, method, substeps)


@pytest.mark.parametrize(
    ("kind", "dim", "method", "substeps"),
    [*(("walls", 2, *method) for method in METHODS), *(("periodic", 3, *m) for m in METHODS[1::2])],
)
@pytest.mark.parametrize("nonlocal_combination", NONLOCAL, ids="-".join)
def test_a_step_with_fluidity_agrees_with_the_oracle(
    small_scene, nonlocal_combination, dim, kind, method, substeps
):
    """Compare cell means, diffusion, the balance with the law, and the law, all in substeps."""
    compare_fluidity(small_scene, nonlocal_combination, dim, kind, method, substeps)


def compare_fluidity(small_scene, combination, dim, kind, method, substeps):
    """Compare the stages of a step of a nonlocal law."""
    scene = small_scene(kind, dim, combination, shifting_limit=1e-3, averaging_time=0.0)
    fluidity = gr.schemes.Fluidity(method=method, substeps=substeps, initial=0.0, tolerance=1e-13)
    grains = gr.materials.NGF(E=1e6, A=0.25 if method == "explicit" else 1.0, d=0.1, t0=1e-3)
    compare_stages(
        scene.replace(material=grains, scheme=scene.scheme.replace(fluidity=fluidity)), FLOWING
    )


def compare_stages(scene, step):
    """Compare P2G, grid and G2P of one step from a disturbed state, in all fields."""
    sim = disturbed(scene, seed=3, step=step)
    before, engine = read(sim), sim._engine
    expected = oracle.p2g(scene, before, step)
    assert engine.p2g() == 0
    found = engine.nodes()
    number = nodes_by_number(scene, found["x"])
    assert set(np.flatnonzero(expected.mass > 0)) <= set(number)
    for name in ("mass", "momentum", "force"):
        value = getattr(expected, name)
        assert_close(found[name], value[number], abs(value).max(), name)

    engine.grid()
    found, dt = engine.nodes(), engine.scalars()["dt"]
    if step:  # the shift momentum is subtracted in a step of this length
        expected = oracle.p2g(scene, before, step, dt)
    oracle.grid(scene, before, expected, dt, TIME)
    # velocities of nodes of small mass are quotients of small sums
    heavy = expected.mass[number] > 1e-4 * expected.mass.max()
    assert heavy.mean() > 0.3
    for name in ("v", "w"):
        value = getattr(expected, name)[number]
        assert_close(found[name][heavy], value[heavy], 1e3 * abs(value[heavy]).max(), name)
    light = expected.mass[number] == 0
    assert not found["v"][light].any()

    engine.g2p()
    after, expected = read(sim), oracle.g2p(scene, before, expected, dt, step)
    np.testing.assert_array_equal(after["id"], before["id"])
    length = np.array(scene.grid.shape) * scene.grid.cell
    difference = after["x"] - expected["x"]
    difference -= np.where(scene.grid.periodic, np.round(difference / length) * length, 0.0)
    assert abs(difference).max() <= 1e-15 + 1e-13 * scene.grid.cell
    assert abs(after["x"] - before["x"]).max() > 1e-4 * scene.grid.cell
    K = scene.material.K
    strain = abs(expected["log_density"] - before["log_density"]).max()
    floor = {"stress": K * strain, "shear_rate": strain / dt, "log_density": 1e-3}
    assert ("g" in after) == (scene.material.law == "ngf")
    for name in set(after) - {"x", "id", "mass"}:
        scale = max(floor.get(name, 0.0), abs(expected[name]).max())
        assert scale > 0, name
        assert_close(after[name], expected[name], 10 * scale, name)
    np.testing.assert_array_equal(after["mass"], before["mass"])


def test_the_approximate_logarithm_of_the_relaxation_is_accurate():
    full = np.linspace(np.exp(-0.2), np.exp(0.2), 1001)
    assert abs(2 * (full - 1) / (full + 1) - np.log(full)).max() < 1e-3


AVAILABLE = available()


def test_the_best_instruction_set_is_among_those_that_are_tested():
    assert "baseline" in AVAILABLE
    assert _core.build_info()["isa"] in AVAILABLE


@pytest.mark.parametrize("isa", ["", *AVAILABLE])
def test_the_configuration_shown_is_that_of_a_simulation(monkeypatch, isa):
    monkeypatch.setenv("GRANULAR_ISA", isa)
    sim = gr.Simulation(gr.scenes.incline(cell=0.05), threads=1)
    config = gr.show_config()
    assert config["isa"] == sim.isa == (isa or AVAILABLE[-1])
    assert config["lanes"] == {"one_lane": 1, "baseline": 2, "avx2": 4, "avx512": 8}[sim.isa]


def test_an_instruction_set_that_is_not_there_is_refused(monkeypatch):
    monkeypatch.setenv("GRANULAR_ISA", "abacus")
    for use in (gr.show_config, lambda: gr.Simulation(gr.scenes.incline(cell=0.05))):
        with pytest.raises(ValueError, match='"abacus" is not available'):
            use()


def test_fused_and_separate_stages_have_the_same_bits(small_scene, combination, dim):
    compare_fused(small_scene("walls", dim, combination), AVAILABLE[-1])


@pytest.mark.parametrize("isa", AVAILABLE)
def test_so_they_have_with_each_instruction_set(small_scene, typical_combination, dim, isa):
    compare_fused(small_scene("outlet", dim, typical_combination), isa)


def compare_fused(scene, isa):
    """Compare 30 steps of the engine with those made stage by stage."""
    fused, separate = disturbed(scene, isa=isa), disturbed(scene, isa=isa)
    fused.step(30)
    stages(separate, 30)
    one, other = fused.checkpoint(), separate.checkpoint()
    for name, number in one.scalars.items():  # the stages alone make no tallies
        assert number == other.scalars[name] or name.startswith("tally_"), name
    for name, array in one.arrays.items():
        assert array.tobytes() == other.arrays[name].tobytes(), name


@pytest.mark.parametrize("isa", [isa for isa in AVAILABLE if isa != "baseline"])
def test_instruction_sets_agree_to_round_off(small_scene, combination, dim, isa):
    scene = small_scene("walls", dim, combination)
    plain, wide = disturbed(scene, isa="baseline"), disturbed(scene, isa=isa)
    plain.step()
    wide.step()
    assert wide.isa == isa
    assert plain.dt == wide.dt
    one, other = read(plain), read(wide)
    for name in one:
        scale = abs(one[name]).max()
        assert abs(one[name] - other[name]).max() <= 1e-12 * scale, name


def test_no_point_is_lost_when_points_spread(small_scene, combination, dim):
    """Cells fill and empty: sorting keeps every point once, with all of its fields."""
    sim = disturbed(small_scene("walls", dim, combination))
    before = read(sim)
    sim.step(200)
    after = read(sim)
    np.testing.assert_array_equal(after["id"], before["id"])
    np.testing.assert_array_equal(after["mass"], before["mass"])
    spare = sim.buffers["id"] < 0
    used = sim._engine.cells()
    assert used[1].sum() == len(before["id"])
    assert not sim.buffers["mass"][0, spare].any()
    assert all(np.isfinite(array).all() for array in sim.buffers.values())

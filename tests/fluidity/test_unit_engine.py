"""The nonlocal law in a simulation: its local limit, its bits, its stability limits."""

import numpy as np
import pytest
from same_bits import bits, same_bits, stepped
from scenes_by_hand import scene_with
from stages import stages

import granular as gr
from granular import NGF, Box, Fill, Fluidity, Grid, Solid, Wall
from granular.mpm.cell_codes import FACE_LINK, FACE_OPEN, FACE_ROUGH, cell_flags, fluidity_faces

LINEAR = gr.Scheme(basis="linear", transfer="flip", density=gr.ParticleDensity())
SOFT = NGF(E=1e5, A=0.5, d=0.1, t0=1e-3)
METHODS = ["explicit", "implicit", "rkl2"]


def silo(method="implicit", substeps=1, seed=None, cell=0.035, dt=5e-4, **options):
    """A soft silo of a few hundred cells that flows, about 0.6 m high."""
    scheme = LINEAR.replace(
        dt=dt, fluidity=Fluidity(method=method, substeps=substeps, initial=seed)
    )
    grains = gr.materials.silo_grains.replace(E=2e5, t0=1e-3)
    given = {"A": 0.1, "width": 0.56, "height": 0.56, "points_per_cell": 4, "material": grains}
    return gr.scenes.clogging_silo(cell=cell, scheme=scheme, **(given | options))


# ---- without a fluidity ----


@pytest.mark.parametrize(
    "combination", [("linear", "flip", "particle"), ("quadratic", "tpic", "smoothed")]
)
def test_without_amplitude_it_is_the_local_law_to_the_last_bit(small_scene, combination, dim):
    scene = small_scene("walls", dim, combination)
    grains = NGF(E=1e6, A=0.0, d=0.01)
    local = gr.materials.MuI(E=1e6, I0=grains.I0, d=0.01)
    one, other = (stepped(scene.replace(material=m), 60) for m in (grains, local))
    assert bits(one) == bits(other)
    assert one.fluidity is None
    assert "g" not in one.buffers and "g_gain" not in one.buffers


def test_a_record_has_a_fluidity_only_of_a_nonlocal_law(tmp_path):
    for A in (0.0, 0.1):
        path = tmp_path / f"{A}.h5"
        gr.Simulation(silo(A=A, cell=0.07), threads=1).run(until=2e-3, every=1e-3, save=path)
        with gr.open(path) as record:
            assert ("g" in record[-1].fields) == (A > 0)
            assert record.scene.material.A == A


@pytest.mark.parametrize("method", METHODS)
def test_the_local_phase_is_the_local_law_and_seeds_the_fluidity(method):
    """Until 10 t0 the state is that of mu(I), with g = gdot/mu; afterwards it differs."""
    scene = silo(method, A=0.05)
    grains = scene.material
    local = gr.materials.MuI(
        **{name: getattr(grains, name) for name in ("E", "nu", "rho_c", "mu_s", "mu_2", "rho_s")},
        I0=grains.I0,
        d=grains.d,
    )
    one, other = stepped(scene, 20), stepped(scene.replace(material=local), 20)
    assert one.time == pytest.approx(10 * grains.t0)
    for name in ("x", "v", "stress", "shear_rate", "log_density"):
        assert getattr(one.state, name).tobytes() == getattr(other.state, name).tobytes(), name
    state = one.state
    g, rate = state.fields["g"], state.shear_rate
    flows = rate > 0
    assert 5 < flows.sum() < len(g)
    stress = state.stress
    p = -stress[:, :3].sum(axis=1) / 3
    tau = np.sqrt(((stress[:, :3] + p[:, None]) ** 2).sum(axis=1) / 2 + stress[:, 3] ** 2)
    np.testing.assert_allclose(g[flows], rate[flows] * p[flows] / tau[flows], rtol=1e-8)
    # fluidity does not grow from zero below the friction that bounds a step
    assert not stepped(silo(seed=0.0, cell=0.07), 1).state.fields["g"].any()


def test_what_is_stress_free_has_no_fluidity():
    sim = stepped(silo(seed=1.0), 300)
    state = sim.state
    free = ~state.stress.any(axis=1)
    assert free.sum() > 10
    assert not state.fields["g"][free].any() and not state.shear_rate[free].any()
    assert not state.fields["g_gain"][free].any()
    assert (state.fields["g"] >= 0).all()


# ---- bits ----


@pytest.mark.parametrize("method", METHODS)
def test_threads_and_cuts_give_the_same_bits(method):
    """Nine chunks of 512 cells are needed for threads to share the diffusion."""
    scene = silo(method, 2, seed=1.0, cell=0.00875, dt=5e-5, A=0.05, width=0.595, height=1.05)
    assert np.prod(scene.grid.shape) > 8 * 512
    same_bits(scene, 5, 7, threads=(2, 4))


@pytest.mark.parametrize("method", METHODS)
def test_restarts_frames_and_threads_do_not_matter(method, tmp_path):
    """The restart is at the end of the local phase or in flow; the checkpoint holds the balance."""
    scene = silo(method, 2, dt=2.5e-4)
    whole = stepped(scene, 120)
    assert ("g_gain" in whole.checkpoint().arrays) == (method == "implicit")
    for cut in (30, 77):
        same_bits(scene, cut, 120 - cut, threads=(2,))
    watched = gr.Simulation(scene, threads=1)
    watched.run(
        until=whole.time,
        every=3e-3,
        save=tmp_path / "a.h5",
        hooks=(lambda sim: sim.state,),
        monitor=False,
    )
    assert bits(watched) == bits(whole)
    with gr.open(tmp_path / "a.h5") as record:
        assert record[-1].fields["g"].tobytes() == whole.state.fields["g"].tobytes()


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("substeps", [1, 3])
def test_fused_and_separate_stages_have_the_same_bits(method, substeps):
    scene = silo(method, substeps, seed=1.0)
    fused, separate = stepped(scene, 40), gr.Simulation(scene, threads=1)
    stages(separate, 40)
    (one, fields), (other, others) = bits(fused), bits(separate)
    assert fields == others
    for name, number in one.items():  # the stages alone make no tallies
        assert number == other[name] or name.startswith("tally_"), name


# ---- substeps ----


def fluidity_after(substeps, **options):
    """g of the points after five steps, in which strains are about 1e-5."""
    grains = gr.materials.silo_grains.replace(E=2e6, t0=1e-3, **options)
    state = stepped(silo("implicit", substeps, 1.0, material=grains, A=0.3, dt=2e-4), 5).state
    return state.fields["g"][np.argsort(state.fields["id"])]


@pytest.mark.parametrize("rheology", ["mu_I", "linear_mu_I"])
def test_substeps_converge_and_are_those_of_small_strains(rheology):
    """Each elasticity has its own way through the substeps; at small strain the results agree."""
    hencky = {"elasticity": "hencky", "rheology": rheology}
    g = {n: fluidity_after(n, **hencky) for n in (1, 2, 4, 32)}
    off = [abs(g[n] - g[32]).sum() / g[32].sum() for n in (1, 2, 4)]
    assert 0.002 < off[2] < off[1] / 1.8 < off[0] / 3 < 0.01
    if rheology == "mu_I":  # the other rheology has no hypoelastic form
        for n in (1, 4):
            small = fluidity_after(n)
            assert abs(small - g[n]).sum() <= 3e-5 * g[n].sum()


# ---- limits and failures ----


def still(dim, dt, method="explicit", substeps=1):
    """A block on no-slip ground in a box with free-slip sides, 8 cells wide."""
    last, n = dim - 1, 8
    size = 0.1 * n
    return scene_with(
        grid=Grid((0.0,) * dim, 0.1, (n,) * dim),
        fills=(Fill(Box((0.0,) * dim, (size,) * dim), 2**dim, lithostatic=True),),
        material=SOFT,
        scheme=LINEAR.replace(
            dt=dt, fluidity=Fluidity(method=method, substeps=substeps, initial=1e-3)
        ),
        walls=(
            Wall(last, 0.0, kind="no_slip"),
            *(Wall(d, at, kind="free_slip") for d in range(last) for at in (0.0, size)),
        ),
    )


def test_the_explicit_limit_holds_to_two_percent(dim):
    limit = 0.1**2 * SOFT.t0 / (2 * dim * SOFT.A**2 * SOFT.d**2)
    sim = stepped(still(dim, 0.98 * limit), 60)
    assert sim.fluidity["method"] == "explicit"
    assert sim.fluidity["limit"] == pytest.approx(limit)
    assert np.isfinite(sim.state.fields["g"]).all()
    with pytest.raises(ValueError, match=r'the limit of method "explicit".* 2 substeps') as error:
        gr.Simulation(still(dim, 1.02 * limit), threads=1)
    assert "dt = " in str(error.value)
    stepped(still(dim, 1.02 * limit, substeps=2), 2)
    assert stepped(still(dim, 1.02 * limit, "auto"), 2).fluidity["method"] == "implicit"
    assert stepped(still(dim, 0.98 * limit, "auto"), 2).fluidity["method"] == "explicit"


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("name", ["g", "stress", "v", "shear_rate"])
def test_a_point_that_is_not_a_number_is_named(name, method):
    sim = stepped(silo(method, 2, seed=1.0, cell=0.07), 10)
    place = np.flatnonzero(sim.buffers["id"] == 37)[0]
    sim.buffers[name][0, place] = np.nan
    with pytest.raises(gr.SimulationError) as error:
        sim.step(5)
    assert 10 <= error.value.step <= 12
    assert error.value.point >= 0  # without iterations, the first such point that is reached
    if name == "g" and method == "implicit":
        assert error.value.point == 37
    assert "converge" not in str(error.value)


@pytest.mark.parametrize("substeps", [1, 4])
def test_points_keep_their_fluidity_where_diffusion_is_negligible(substeps):
    """Points with pressure start from their own g, not from the mean of their cell."""
    # the reaction is negligible in a step, too
    grains = gr.materials.silo_grains.replace(E=2e5, t0=1e3)
    sim = stepped(silo("explicit", substeps, seed=1.0, material=grains, A=1e-6), 100)
    rng, ids = np.random.default_rng(1), sim.buffers["id"]
    living = ids >= 0
    sim.buffers["g"][0, living] = rng.exponential(1.0, living.sum())
    sim.buffers["shear_rate"][0] = 0.0
    before = sim.state
    sim.step(1)
    after = sim.state
    _, row, row_after = np.intersect1d(before.id, after.id, return_indices=True)
    bears = before.stress[:, :3].sum(axis=1) < 0
    g = after.fields["g"][row_after]
    still_dense = (after.stress[row_after].any(axis=1)) & bears[row]
    assert still_dense.sum() > 400 and (~bears).sum() > 10
    np.testing.assert_allclose(g[still_dense], before.fields["g"][row][still_dense], rtol=1e-5)


# ---- walls ----


def walled(*walls, periodic=(False, False)):
    return scene_with(
        grid=Grid((0.0, 0.0), 0.1, (4, 3), periodic=periodic),
        fills=(Fill(Box((0.0, 0.0), (0.4, 0.1)), 4),),
        material=SOFT,
        scheme=LINEAR,
        walls=walls,
    )


def test_only_no_slip_walls_hold_the_fluidity():
    faces = fluidity_faces(walled(Wall(1, 0.0, kind="no_slip"), Wall(0, 0.0, kind="free_slip"),
                                  Wall(0, 0.4, kind="coulomb", friction=0.3)))  # fmt: skip
    expected = np.full((4, 3, 4), FACE_LINK)
    expected[2, 0] = FACE_ROUGH  # lower side along y
    expected[0, :, 0] = expected[1, :, -1] = FACE_OPEN
    np.testing.assert_array_equal(faces, expected)


def test_walls_inside_blocks_and_openings():
    scene = walled(
        Wall(1, 0.1, kind="no_slip", span=((0.0, 0.2),)),
        Wall(1, 0.1, kind="no_slip", span=((0.2, 0.3),), opens_at=0.1),
        Solid((0.3, 0.1), (0.4, 0.2)),
        periodic=(True, False),
    )
    faces = fluidity_faces(scene)
    assert (faces[3, 0] == [FACE_ROUGH, FACE_ROUGH, FACE_LINK, faces[3, 0, 3]]).all()
    assert (faces[2, 1, :3] == [FACE_ROUGH, FACE_ROUGH, FACE_LINK]).all()
    # faces of the block, from outside: above, below, and through the periodic end from the left
    kind = FACE_ROUGH if scene.walls[2].kind == "no_slip" else FACE_OPEN
    assert (faces[2, 2, 3], faces[3, 0, 3], faces[1, 1, 2]) == (kind, kind, kind)
    assert faces[0, 0, 0] == faces[1, 0, 3] == FACE_LINK
    flags = cell_flags(scene.replace(scheme=gr.schemes.cell_averaged)).dense()
    assert flags[1, 3] & 1 and not flags[0, 0] & 1  # the block is solid
    assert flags[0, 0] & 4 << 3 and flags[1, 0] & 4 << 2  # the wall, from below and above
    assert flags[0, 2] & 2  # near the opening


# ---- lithostatic fills ----


@pytest.mark.parametrize("basis", ["linear", "quadratic"])
def test_a_lithostatic_fill_is_in_balance(basis, dim):
    """p = k s, ds/dy = rho g, rho = rho_c exp(p/K): p = -K ln(1 - k rho_c g depth/K)."""
    scene = still(dim, None, "implicit")
    scene = scene.replace(scheme=gr.Scheme(basis=basis))
    state = gr.Simulation(scene, threads=1).state
    K, rho_c, depth = SOFT.K, SOFT.rho_c, 0.8 - state.x[:, -1]
    k = (1 + 2 * SOFT.K0) / 3
    p = -K * np.log1p(-k * rho_c * 9.8 * depth / K)
    borne = np.full(3, SOFT.K0)
    borne[scene.dim - 1] = 1.0
    np.testing.assert_allclose(state.stress[:, :3], np.outer(-p / k, borne), rtol=1e-12)
    assert not state.stress[:, 3:].any()
    np.testing.assert_allclose(state.log_density, p / K, rtol=1e-9)
    column = -K * np.log1p(-k * rho_c * 9.8 * 0.8 / K) / (9.8 * k)
    assert state.mass.sum() == pytest.approx(column * 0.8 ** (dim - 1), rel=1e-3)


def test_fills_too_heavy_are_refused():
    scene = still(2, None, "implicit")
    with pytest.raises(ValueError, match=r"K = .* must exceed rho_c g depth"):
        gr.Simulation(scene.replace(material=SOFT.replace(E=5e3)), threads=1)


def test_ugimp_is_refused():
    with pytest.raises(ValueError, match='basis = "ugimp" must be "linear" or "quadratic"'):
        still(2, None).replace(scheme=gr.Scheme(basis="ugimp"))


def test_a_nonlocal_material_of_a_scene_may_be_in_none_of_its_fills():
    bed = gr.Fill(gr.Box((0.0, 0.0), (0.2, 0.1)), 4, material=gr.MuI(E=1e6))
    scene = scene_with(
        grid=gr.Grid((0.0, 0.0), 0.02, (10, 10)),
        fills=(bed,),
        material=gr.NGF(E=1e6, mu_2=1.5),
        walls=(gr.Wall(1, 0.0),),
        duration=0.1,
    )
    sim = gr.Simulation(scene, threads=1)
    sim.step(3)
    assert np.isfinite(sim.state.stress).all()

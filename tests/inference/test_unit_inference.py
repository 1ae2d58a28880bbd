"""Small inference problems: rows by hand, cones, choices, sums; also without Clarabel."""

import sys
import warnings
from dataclasses import replace

import numpy as np
import pytest

from granular.grain_scale import inference
from granular.grain_scale.inference import BoundaryForce, InferenceError, InferenceWarning, Packing
from granular.grain_scale.inference.dynamic import knee_of
from granular.papers.hurley_thesis.packings import jittered_grid, pressed_discs, sums


def square():
    """A unit disc between four walls, compressed by 3 N/m horizontally and 5 N/m vertically."""
    normals = np.array([[1.0, 0], [-1, 0], [0, 1], [0, -1]])
    return Packing(
        bodies=[[0, -2], [0, -1], [0, -4], [0, -3]],
        positions=normals,
        normals=normals,
        centroids=[[0.0, 0.0]],
        volumes=[np.pi],
        stresses=[np.diag([-2 * 3.0, -2 * 5.0]) / np.pi],
    )


@pytest.mark.parametrize("shape", [(6, 5), (4, 4, 4)])
def test_rows_are_those_written_down_one_by_one(shape):
    """K_eq and K_st against the plain loops of the reference; b_st from known forces."""
    case = jittered_grid(shape)
    packing, f = case.packing, case.forces.ravel()
    table = {"bodies": packing.bodies, "positions": packing.positions}
    balance, stress = sums(table, packing.centroids)
    assert abs(inference.equilibrium_matrix(packing) - balance).max() == 0
    mine = inference.stress_matrix(packing) @ f
    assert mine == pytest.approx(inference.stress_vector(packing), abs=1e-12 * abs(mine).max())
    assert np.sort(abs(mine)) == pytest.approx(np.sort(abs(stress @ f)))
    assert not inference.momentum_vector(packing).any()


def test_blocks_of_the_thesis():
    """Eqs 2.5 and 2.8 for a contact at (2, 3) from one centroid and (-1, 0) from the other."""
    packing = Packing(
        bodies=[[0, 1]],
        positions=[[2.0, 3.0]],
        normals=[[0.6, 0.8]],
        centroids=[[0.0, 0.0], [3.0, 3.0]],
        volumes=[1.0, 1.0],
        stresses=np.zeros((2, 2, 2)),
    )
    balance = inference.equilibrium_matrix(packing).toarray()
    assert balance.tolist() == [[1, 0], [0, 1], [-3, 2], [-1, 0], [0, -1], [0, 1]]
    stress = inference.stress_matrix(packing).toarray()
    assert stress.tolist() == [[2, 0], [0, 3], [3, 2], [1, 0], [0, 0], [0, 1]]
    B = inference.admissibility_matrix(packing, 0.5).toarray()
    assert B == pytest.approx(np.array([[-0.6, -0.8], [0.5, -1.0], [-1.1, 0.2]]))


def test_frames_are_orthonormal_and_walls_have_their_friction():
    normals = np.random.default_rng(0).normal(size=(40, 3))
    normals = np.vstack([normals, np.eye(3), -np.eye(3)])
    normals /= np.linalg.norm(normals, axis=1)[:, None]
    frames = inference.contact_frames(normals)
    assert np.einsum("kab,kcb->kac", frames, frames) == pytest.approx(
        np.tile(np.eye(3), (46, 1, 1))
    )
    assert frames[:, 0] == pytest.approx(normals)
    # mu_wall is a number for all walls, or one for each by its name
    packing = square()
    assert inference.friction_of_contacts(packing, 0.5, 0.0).tolist() == [0, 0, 0, 0]
    some = inference.friction_of_contacts(packing, 0.5, {-4: 0.1, -1: 0.0})
    assert some.tolist() == [0.5, 0.0, 0.1, 0.5]
    window, _ = jittered_grid((5, 5)).packing.subset([0, 1])
    outside = window.bodies.min(axis=1) == inference.OUTSIDE
    assert outside.any()
    assert (inference.friction_of_contacts(window, 0.5, 0.0)[outside] == 0.5).all()


@pytest.mark.parametrize("solver", ["auto", "clarabel", "nnls"])
@pytest.mark.parametrize("mu", [0.0, 0.5, np.inf])
def test_a_disc_between_four_walls(mu, solver):
    if solver == "clarabel":
        pytest.importorskip("clarabel")
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", InferenceWarning)
        found = inference.infer_static(square(), mu=mu, solver=solver)
    assert found.stress_residual < 1e-7
    assert found.balance_residual < 1e-7
    # 4 pushes. With friction there are 8 components in 6 rows: left and right pushes may differ if
    # friction balances them. Cones do not affect the rank.
    assert (found.rank, found.unknowns) == ((4, 4) if mu == 0 else (6, 8))
    assert found.trusted == (mu == 0)
    if mu == 0:
        expected = np.array([[-3, 0], [3, 0], [0, -5], [0, 5]])
        assert found.forces == pytest.approx(expected, abs=1e-6)
        assert found.pushes == pytest.approx([3, 3, 5, 5])
        assert not found.slips.any()


def test_strains_and_stiffness_give_the_stresses():
    """Plane stress, plane strain and 3D against Hooke's law written out."""
    E, nu = 5.5e6, 0.3
    strain = np.array([[1e-3, 2e-4], [2e-4, -2e-3]])
    free = inference.isotropic_stiffness(E, nu, 2)
    held = inference.isotropic_stiffness(E, nu, 2, plane="strain")
    space = inference.isotropic_stiffness(E, nu, 3)
    stress = np.einsum("abij,ij->ab", free, strain)
    back = (stress - nu * (np.trace(stress) * np.eye(2) - stress)) / E
    assert np.diag(back) == pytest.approx(np.diag(strain))
    assert stress[0, 1] == pytest.approx(E / (1 + nu) * 2e-4)
    flat = np.zeros((3, 3))
    flat[:2, :2] = strain
    full = np.einsum("abij,ij->ab", space, flat)
    assert np.einsum("abij,ij->ab", held, strain) == pytest.approx(full[:2, :2])
    packing = square()
    stress = packing.stresses[0]
    given = ((1 + nu) * stress - nu * np.trace(stress) * np.eye(2)) / E
    from_strains = replace(packing, stresses=None, strains=[given], stiffness=free)
    assert from_strains.stresses[0] == pytest.approx(stress)


def test_a_subset_keeps_contacts_in_order_and_names_the_rest():
    case = jittered_grid((5, 5))
    window, contacts = case.packing.subset([4, 1])
    assert window.centroids.tolist() == case.packing.centroids[[4, 1]].tolist()
    old, new = case.packing.bodies[contacts], window.bodies
    names = {4: 0, 1: 1} | {-1: -1}
    expected = [[names.get(b, inference.OUTSIDE) for b in pair] for pair in old.tolist()]
    assert new.tolist() == expected
    assert len(contacts) == 7


def test_boundary_force_by_scaling():
    """Stresses wrong by a factor are corrected exactly by the load, with each way of scaling."""
    case = pressed_discs(1)[0]
    stiff = replace(case.packing, stresses=1.3 * case.packing.stresses)
    value = -case.forces[case.packing.bodies[:, 1] == -4, 1].sum()
    known = BoundaryForce(body=-4, direction=(0, -2), value=value, opposite=-3)
    found = inference.infer_with_boundary(stiff, known, mu=0.5, by="force")
    assert found.scale == pytest.approx(1 / 1.3, rel=1e-9)
    assert found.forces == pytest.approx(case.forces, abs=1e-6 * abs(case.forces).max())
    assert inference.boundary_force(stiff, found.forces, known) == pytest.approx(value)
    found = inference.infer_with_boundary(stiff, known, mu=0.5, by="virial")
    assert found.scale == pytest.approx(1 / 1.3, rel=1e-3)  # platens are flat but for overlaps
    found = inference.infer_with_boundary(stiff, known, mu=0.5, solver="nnls")
    assert inference.boundary_force(stiff, found.forces, known) == pytest.approx(value, rel=1e-4)
    assert found.regularization > 0


def test_a_boundary_force_that_no_lambda_meets_is_flagged():
    packing = square()
    known = BoundaryForce(body=-4, direction=(0, -1), value=6.0)
    with pytest.warns(InferenceWarning, match="boundary"):
        found = inference.infer_with_boundary(packing, known, mu=0.0)
    assert found.flags[0].name == "boundary"
    assert found.regularization == 0.0


def test_without_clarabel_2d_is_solved_and_3d_says_what_to_install(monkeypatch):
    monkeypatch.setitem(sys.modules, "clarabel", None)
    case = pressed_discs(1)[0]
    noise = np.random.default_rng(0).normal(1, 0.3, (case.packing.n, 1, 1))
    rough = replace(case.packing, stresses=case.packing.stresses * noise)
    assert inference.infer_static(rough, mu=0.45).solver == "nnls"
    space = jittered_grid((5, 5, 5)).packing
    noise = np.random.default_rng(0).normal(1, 0.5, (space.n, 1, 1))
    rough = replace(space, stresses=space.stresses * noise)
    with pytest.raises(ImportError, match=r"pip install 'granular-flow\[inference\]'"):
        inference.infer_static(rough, mu=0.2)


def test_grains_that_cannot_stand_are_refused():
    """A weight on too steep a slope is refused by name, also beside a weight that can stand.

    Both carry grains that could rest there.
    """
    packing = Packing(
        bodies=[[0, -1], [1, -1], [2, 0], [3, 1]],
        positions=[[0.0, -1.0], [8.4, -0.8], [0.0, 1.0], [9.0, 1.0]],
        normals=[[0.0, -1.0], [-0.6, -0.8], [0.0, -1.0], [0.0, -1.0]],
        centroids=[[0.0, 0.0], [9.0, 0.0], [0.0, 2.0], [9.0, 2.0]],
        volumes=np.full(4, np.pi),
        stresses=np.zeros((4, 2, 2)),
        masses=np.ones(4),
        gravity=[0.0, -9.81],
    )
    for solver in ("nnls", "clarabel"):
        if solver == "clarabel":
            pytest.importorskip("clarabel")
        with pytest.raises(InferenceError, match=r"grains 1(, 3)? cannot be in balance"):
            inference.infer_static(packing, mu=0.3, solver=solver)


def test_a_grain_under_stress_without_contact_is_flagged():
    packing = square()
    two = replace(
        packing,
        centroids=[[0.0, 0.0], [9.0, 0.0]],
        volumes=[np.pi, np.pi],
        stresses=np.tile(packing.stresses, (2, 1, 1)),
    )
    with (
        pytest.warns(InferenceWarning, match="misfit"),
        pytest.warns(InferenceWarning, match="grains 1 have stress but no contact"),
    ):
        found = inference.infer_static(two, mu=0.0)
    assert "stressed_rattlers" in {flag.name for flag in found.flags}


def test_knee_impulses_and_distances_by_hand():
    """Knee of a front like 1/x in any units; of a flat front the weight closest to one."""
    x = np.logspace(-2, 2, 41)
    weights = np.logspace(-3, 3, 41)
    assert knee_of(x, 1 / x, weights=weights) == 20
    assert knee_of(1e6 * x, 1e-3 / x, weights=weights) == 20
    assert knee_of(0 * x, 1 / x, weights=weights) == 20
    net = np.array([[[0.0, 1.0]], [[2.0, 1.0]], [[4.0, 1.0]]])
    assert inference.impulses(net, [0.0, 0.5, 1.0]).tolist() == [[2.0, 1.0]]
    forces = [[[3.0, 4.0], [1.0, 0.0]], [[0.0, 2.0], [9.0, 0.0]]]
    found = inference.largest_by_distance(forces, [[0.1, 1.5], [1.9, -1.0]], bin_width=1.0, bins=3)
    assert found[:2].tolist() == [5.0, 2.0]
    assert np.isnan(found[2])


def test_statistics_of_exponential_forces():
    """Decay rate above the mean, fraction 1/e of strong forces, and its error."""
    rng = np.random.default_rng(0)
    size = rng.exponential(3.0, 20000)
    angle = rng.uniform(0, 2 * np.pi, 20000)
    forces = size[:, None] * np.stack([np.cos(angle), np.sin(angle)], axis=1)
    found = inference.force_statistics(forces, loaded=0.0)
    assert found.mean == pytest.approx(3.0, rel=0.02)
    assert found.decay == pytest.approx(1.0, abs=4 * found.decay_error)
    assert found.strong_share == pytest.approx(np.exp(-1), abs=0.02)
    assert (found.strong == (size > found.mean)).all()


def test_a_chain_is_found_and_ends_where_it_bends():
    """A column of five loaded grains beside unloaded ones; a sixth, loaded sideways, is no part."""
    x = np.array([[0.0, 2 * k] for k in range(5)] + [[2.0, 8.0], [2.0, 0.0], [2.0, 2.0]])
    bodies = [[k, k + 1] for k in range(4)] + [[4, 5], [0, 6], [6, 7]]
    way = np.array([x[b] - x[a] for a, b in bodies]) / 2
    stresses = np.zeros((8, 2, 2))
    stresses[:5, 1, 1], stresses[5, 0, 0], stresses[6:, 1, 1] = -1.0, -1.0, -0.01
    packing = Packing(
        bodies=bodies,
        positions=np.array([x[a] for a, _ in bodies]) + way,
        normals=way,
        centroids=x,
        volumes=np.full(8, np.pi),
        stresses=stresses,
    )
    assert [chain.tolist() for chain in inference.force_chains(packing)] == [[0, 1, 2, 3, 4]]
    assert inference.force_chains(packing, least=6) == []


def test_a_grain_may_be_given_in_any_image_of_a_periodic_box():
    """Moving some grains by a period changes nothing but the positions where contacts are seen."""
    case, box = jittered_grid((5, 6)), np.array([40.0, -30.0])
    packing, moved = case.packing, np.zeros(case.packing.n, bool)
    moved[[1, 4, 7]] = True
    by = np.where(moved[:, None], box, 0.0)
    first, second = (
        np.where((b >= 0)[:, None], by[np.maximum(b, 0)], 0.0) for b in packing.bodies.T
    )
    image = replace(
        packing,
        centroids=packing.centroids + by,
        positions=packing.positions + first,
        shifts=second - first,
    )
    for one, other in zip(packing.sides(), image.sides(), strict=True):
        assert other[3] == pytest.approx(one[3], abs=1e-12)
    found = inference.infer_static(image, mu=0.5)
    assert found.forces == pytest.approx(case.forces, abs=1e-9)
    stress = inference.macroscopic_stress(packing, case.forces, 20.0)
    assert inference.macroscopic_stress(image, found.forces, 20.0) == pytest.approx(stress)
    chains = [chain.tolist() for chain in inference.force_chains(packing, least=2)]
    assert [chain.tolist() for chain in inference.force_chains(image, least=2)] == chains
    assert len(chains[0]) > 2
    window, contacts = image.subset([1, 2, 6])
    assert window.shifts.tolist() == image.shifts[contacts].tolist()
    assert replace(window).shifts.any()

"""Meaningless inputs (packings, friction, options) are refused by name."""

import numpy as np
import pytest

from granular.grain_scale import inference
from granular.grain_scale.inference import BoundaryForce, Packing

NORMALS = np.array([[1.0, 0], [-1, 0], [0, 1], [0, -1]])
GOOD = {
    "bodies": [[0, -2], [0, -1], [0, -4], [0, -3]],
    "positions": NORMALS,
    "normals": NORMALS,
    "centroids": [[0.0, 0.0]],
    "volumes": [np.pi],
    "stresses": [-np.eye(2)],
}


def changed(name, at, value):
    array = np.array(GOOD[name])
    array[at] = value
    return {name: array}


@pytest.mark.parametrize(
    "change, error, words",
    [
        (changed("bodies", (2, 0), 7), ValueError, r"bodies\[2\] = \[7, -4\].*0 to 0"),
        (changed("bodies", (1, 0), -3), ValueError, r"bodies\[1\].*at least one grain"),
        (changed("bodies", (1, 1), 0), ValueError, r"bodies\[1\].*different"),
        ({"bodies": [[0.0, -1.0]] * 4}, TypeError, "bodies must hold integers"),
        ({"bodies": np.zeros((0, 2), int)}, ValueError, "at least one contact"),
        (changed("normals", 3, [0, -1.1]), ValueError, r"normals\[3\] has length 1.1"),
        ({"normals": -NORMALS}, ValueError, "must point out"),
        ({"normals": NORMALS[:3]}, ValueError, r"normals has shape \(3, 2\), must be \(4, 2\)"),
        (changed("positions", (1, 0), np.nan), ValueError, r"positions\[1, 0\] must be finite"),
        (changed("volumes", 0, 0.0), ValueError, r"volumes\[0\] = 0.0 must be > 0"),
        ({"shifts": [[1.0, 0.0]]}, ValueError, r"shifts has shape \(1, 2\), must be \(4, 2\)"),
        ({"volumes": [1.0, 2.0]}, ValueError, r"volumes has shape \(2,\), must be \(1,\)"),
        ({"volumes": ["much"]}, TypeError, "volumes"),
        ({"stresses": None}, ValueError, "either stresses or strains"),
        ({"strains": [np.eye(2)]}, ValueError, "either stresses or strains"),
        ({"stresses": None, "strains": [np.eye(2)]}, ValueError, "given together"),
        ({"stresses": [[[1.0, 2.0], [0.0, 1.0]]]}, ValueError, r"stresses\[0\].*symmetric"),
        ({"accelerations": [[0.0, 1.0]]}, ValueError, "accelerations need masses"),
        ({"gravity": [0.0, -9.81]}, ValueError, "gravity need masses"),
        ({"masses": [-1.0]}, ValueError, r"masses\[0\] = -1.0"),
        ({"inertias": [1.0]}, ValueError, "inertias and angular_accelerations"),
        ({"stress_errors": [0.0]}, ValueError, r"stress_errors\[0\] = 0.0 must be > 0"),
        ({"stress_errors": 1.0}, ValueError, r"stress_errors has shape \(\), must be \(1,\)"),
        ({"acceleration_errors": [1.0]}, ValueError, "acceleration_errors need masses"),
        (
            {"masses": [1.0], "acceleration_errors": [-1.0]},
            ValueError,
            r"acceleration_errors\[0\] = -1.0 must be > 0",
        ),
        ({"centroids": np.zeros((0, 2))}, ValueError, "at least one grain"),
        ({"centroids": [[0.0]]}, ValueError, "centroids has shape"),
    ],
)
def test_packings(change, error, words):
    with pytest.raises(error, match=words):
        Packing(**(GOOD | change))


def test_arrays_are_copies_and_errors_of_one_kind_are_refused():
    volumes = np.array([np.pi])
    packing = Packing(**(GOOD | {"volumes": volumes}))
    volumes[0] = -1.0
    assert packing.volumes[0] == np.pi
    with pytest.raises(ValueError, match="read-only"):
        packing.volumes[0] = 1.0
    packing = Packing(**(GOOD | {"stress_errors": [1.0]}))
    with pytest.raises(ValueError, match="stress_errors and acceleration_errors must be given tog"):
        inference.infer_dynamic(packing, mu=0.5)
    turning = {"masses": [1.0], "inertias": [1.0], "angular_accelerations": [1.0]}
    packing = Packing(**(GOOD | turning))
    with pytest.raises(ValueError, match="moments = False must not be used with angular"):
        inference.infer_dynamic(packing, mu=0.5, moments=False)
    with pytest.raises(TypeError, match="moments = 0"):
        inference.infer_dynamic(packing, mu=0.5, moments=0)


@pytest.mark.parametrize(
    "options, error, words",
    [
        ({"mu": -0.1}, ValueError, r"mu = -0.1 must be >= 0"),
        ({"mu": np.nan}, ValueError, "mu = nan"),
        ({"mu": "rough"}, TypeError, "mu = 'rough'"),
        ({"mu": [0.5, 0.5]}, ValueError, r"mu has shape \(2,\)"),
        ({"mu": 0.5, "mu_wall": -1.0}, ValueError, "mu_wall = -1.0"),
        ({"mu": 0.5, "mu_wall": {-9: 0.0}}, ValueError, r"mu_wall\[-9\] must name one of"),
        ({"mu": 0.5, "regularization": -1.0}, ValueError, "regularization"),
        ({"mu": 0.5, "solver": "simplex"}, ValueError, "solver = 'simplex'"),
    ],
)
def test_options(options, error, words):
    with pytest.raises(error, match=words):
        inference.infer_static(Packing(**GOOD), **options)


@pytest.mark.parametrize("weight", [0.0, -1.0, np.inf, np.nan])
def test_weights(weight):
    with pytest.raises(ValueError, match="weight"):
        inference.infer_dynamic(Packing(**GOOD), mu=0.5, weight=weight)
    with pytest.raises(ValueError, match="weights"):
        inference.pareto_front(Packing(**GOOD), mu=0.5, weights=[weight, 1.0, 2.0])


@pytest.mark.parametrize(
    "options, words",
    [
        ({"body": 3}, "body = 3"),
        ({"direction": (0.0, 0.0)}, "must not be zero"),
        ({"value": 0.0}, "value = 0.0"),
        ({"opposite": -4}, "opposite = -4"),
    ],
)
def test_boundary_forces(options, words):
    with pytest.raises(ValueError, match=words):
        BoundaryForce(**({"body": -4, "direction": (0, -1), "value": 1.0} | options))


def test_boundaries_that_say_nothing():
    """A wall that does not exist, a cluster away from the wall, a scaling without its wall."""
    packing = Packing(**GOOD)
    with pytest.raises(ValueError, match="body = -7 must be a wall"):
        inference.infer_with_boundary(
            packing, BoundaryForce(body=-7, direction=(0, -1), value=1.0), mu=0.5
        )
    with pytest.raises(ValueError, match="direction"):
        inference.infer_with_boundary(
            packing, BoundaryForce(body=-4, direction=(0, 0, -1), value=1.0), mu=0.5
        )
    known = BoundaryForce(body=-4, direction=(0, -1), value=1.0)
    with pytest.raises(ValueError, match="opposite"):
        inference.infer_with_boundary(packing, known, mu=0.0, by="virial")
    apart = {
        "bodies": GOOD["bodies"] + [[1, -2], [1, -1]],
        "positions": np.vstack([NORMALS, NORMALS[:2] + np.array([9.0, 0.0])]),
        "normals": np.vstack([NORMALS, NORMALS[:2]]),
        "centroids": [[0.0, 0.0], [9.0, 0.0]],
        "volumes": [np.pi, np.pi],
        "stresses": [-np.eye(2)] * 2,
    }
    with pytest.raises(ValueError, match=r"grains \[1\] are not joined to wall -4"):
        inference.infer_with_boundary(Packing(**apart), known, mu=0.5)


@pytest.mark.parametrize(
    "call, words",
    [
        *((lambda p, g=g: p.subset(g), "grains") for g in ([1], [0, 0], [], [0.5])),
        (lambda p: inference.macroscopic_stress(p, np.zeros((3, 2)), 1.0), "forces has shape"),
        (lambda p: inference.macroscopic_stress(p, np.zeros((4, 2)), 0.0), "volume"),
        (lambda p: inference.force_statistics(np.zeros((4, 2))), "zero"),
        (lambda p: inference.impulses(np.zeros((2, 1, 2)), [1.0, 0.0]), "ascend"),
        (lambda p: inference.force_chains(p, least=1), "least"),
        (lambda p: inference.largest_by_distance([], [], bin_width=1.0, bins=0), "bins"),
        (lambda p: inference.isotropic_stiffness(1e6, 0.5, 3), "nu"),
    ],
)
def test_subsets_and_sums(call, words):
    with pytest.raises(ValueError, match=words):
        call(Packing(**GOOD))

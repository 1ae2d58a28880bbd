"""Smoothing, nodal density and cell averages against fields that are known by hand."""

import numpy as np
import pytest
from refusals import refused
from synthetic import RHO_C, filled, isotropic, regular_points, scene, state

import granular as gr
from granular.measure import (
    cell_average,
    cell_density,
    cell_density_percentile,
    nodal_density,
    phase,
    smooth,
)
from granular.measure.averaging_grid import stencil
from granular.measure.energy import elastic_of

CELL = 0.1


def box(shape=(6, 5), **options):
    return filled(scene(shape, CELL, **options))


def irregular(n=300, seed=3, **options):
    s = scene((6, 5), CELL, **options)
    rng = np.random.default_rng(seed)
    return state(s, rng.uniform(0, [0.6, 0.5], (n, 2)), mass=rng.uniform(1, 3, n))


def test_smoothing_is_the_papers_sum_over_nodes():
    """With weights that sum to one and place the point."""
    points = irregular()
    shapes = stencil(points)
    assert np.allclose(shapes.weights.sum(axis=0), 1, atol=1e-14)
    i, j = np.meshgrid(np.arange(7), np.arange(6), indexing="ij")
    nodes = CELL * np.stack([i.ravel(), j.ravel()], axis=1)
    assert np.allclose(shapes.to_points(nodes), points.x, atol=1e-14)
    points = irregular(n=12)
    f = np.sin(37 * points.x[:, 0]) + points.x[:, 1]
    nodes = [(CELL * i, CELL * j) for i in range(7) for j in range(6)]

    def S(node, x):
        return np.prod([max(0.0, 1 - abs(a - b) / CELL) for a, b in zip(node, x, strict=True)])

    expected = np.zeros(points.n)
    for node in nodes:
        w = np.array([S(node, x) for x in points.x])
        if (w * points.mass).sum() > 0:
            expected += w * (w * points.mass * f).sum() / (w * points.mass).sum()
    assert np.allclose(smooth(points, f), expected, rtol=1e-12)


@pytest.mark.parametrize("periodic", [(False, False), (True, False)])
def test_a_constant_field_is_untouched(periodic):
    points = irregular(periodic=periodic)
    assert np.allclose(smooth(points, np.full(points.n, 7.5)), 7.5, rtol=1e-13)
    tensor = np.tile([1.0, -2.0, 3.0, 0.5], (points.n, 1))
    assert np.allclose(smooth(points, tensor), tensor, rtol=1e-13)


@pytest.mark.parametrize("shape", [(6, 5), (5, 5, 6)])
def test_a_linear_field_is_reproduced_inside(shape):
    points = box(shape)
    slope = np.arange(1.0, len(shape) + 1)
    f = 2 + points.x @ slope
    low, high = CELL, CELL * (np.array(shape) - 1)
    inside = np.all((points.x > low) & (points.x < high), axis=1)
    assert np.allclose(smooth(points, f)[inside], f[inside], rtol=1e-12)
    # one-sided at the walls: nodes there only have points on the inner side
    assert not np.allclose(smooth(points, f), f, rtol=1e-3)


def test_smoothing_knows_the_periodic_axis():
    points = box(periodic=(True, False))
    f = np.sin(2 * np.pi * points.x[:, 0] / 0.6)
    once = smooth(points, f)
    # moved by half a period, points beyond the edge fold back and the result moves with them
    shifted = state(points.scene, points.x + np.array([0.3, 0.0]))
    assert shifted.x[:, 0].max() > 0.6
    assert np.allclose(smooth(shifted, f), once, rtol=1e-12)
    walled = smooth(box(), f)
    assert np.abs(walled - once).max() > 0.01


def test_smoothing_takes_names_and_calms_a_checkerboard():
    points = box()
    p = 1000 + 500 * (-1.0) ** np.arange(points.n)
    noisy = state(points.scene, points.x, stress=isotropic(p))
    inside = (points.x[:, 1] > CELL) & (points.x[:, 1] < 0.4)
    assert np.allclose(smooth(noisy, "pressure")[inside], 1000, rtol=1e-12)
    assert np.allclose(smooth(noisy, "stress")[:, 0], -smooth(noisy, "pressure"))


@pytest.mark.parametrize("shape", [(6, 5), (4, 3, 5), (1, 6)])
@pytest.mark.parametrize("across", [False, True])
def test_a_full_box_has_the_density_of_its_points_in_edges_and_corners_too(shape, across):
    points = box(shape, periodic=(across,) + (False,) * (len(shape) - 1))
    assert np.allclose(nodal_density(points, at="nodes"), RHO_C, rtol=1e-13)
    assert np.allclose(nodal_density(points), RHO_C, rtol=1e-13)
    assert phase(points).all()


def test_the_density_at_the_surface_and_the_phase_are_nodal():
    layer = filled(scene((6, 8), CELL), 2, lambda x: x[:, 1] < 0.35 + 0.1 * (x[:, 0] > 0.3))
    density = nodal_density(layer)
    # whole cells are filled up to 0.3 and 0.4; half-filled cells above have half the density
    assert np.allclose(density[layer.x[:, 1] < 0.2], RHO_C, rtol=1e-13)
    assert np.all(density[layer.x[:, 1] > 0.4] < 0.9 * RHO_C)
    s = scene((6, 20), CELL)
    heap = regular_points(s, 2, lambda x: x[:, 1] < 0.5)
    rain = regular_points(s, 1, lambda x: x[:, 1] > 1.0)
    points = state(s, np.vstack([heap, rain]))
    assert np.array_equal(phase(points), points.x[:, 1] < 0.5)
    assert np.allclose(nodal_density(points)[points.x[:, 1] > 1.2], RHO_C / 4)
    less_dense = state(s, heap, mass=0.98 * RHO_C * CELL**2 / 4)
    assert not phase(less_dense).any()
    assert phase(less_dense, tolerance=0.03).all()


def test_cell_averages_by_mass_and_by_volume():
    s = scene((3, 3), CELL)
    x = [[0.02, 0.02], [0.08, 0.08], [0.25, 0.05]]
    points = state(s, x, mass=[1.0, 3.0, 2.0], rho=[1000.0, 1500.0, 1500.0])
    f = np.array([10.0, 20.0, 5.0])
    by_mass = cell_average(points, f)
    assert np.array_equal(by_mass.cells, [[0, 0], [2, 0]])
    assert np.allclose(by_mass.centres, [[0.05, 0.05], [0.25, 0.05]])
    assert np.allclose(by_mass.value, [(10 + 60) / 4, 5])
    assert np.allclose(by_mass.weight, [4, 2])
    by_volume = cell_average(points, f, weight="volume")
    assert np.allclose(by_volume.value, [(10 * 1 + 20 * 2) / 3, 5])
    rows = cell_average(points, np.stack([f, -f], axis=1))
    assert np.allclose(rows.value, [[17.5, -17.5], [5, -5]])


def test_stresses_count_by_the_weights_of_the_scheme(small_scene):
    sim = gr.Simulation(small_scene("walls", 2, ("quadratic", "tpic", "smoothed")), threads=1)
    sim.buffers["stress"][:3] = -100.0
    plain, u = sim.state, np.linspace(-0.4, 0.4, sim.state.n)
    sim.buffers["weight_correction"][0, sim.buffers["id"] >= 0] = u[
        sim.buffers["id"][sim.buffers["id"] >= 0]
    ]
    weighted = sim.state
    assert np.array_equal(plain.quadrature_volume, plain.volume)
    assert np.allclose(weighted.quadrature_volume, (1 + u) * plain.volume, rtol=1e-15)
    assert np.allclose(elastic_of(weighted), (1 + u) * elastic_of(plain), rtol=1e-15)
    total = cell_average(weighted, np.ones(plain.n), weight="volume").weight.sum()
    assert total == pytest.approx(np.sum((1 + u) * plain.volume), rel=1e-14)


def test_the_density_of_cells_and_its_percentile():
    points = box()
    assert np.allclose(cell_density(points).value, RHO_C)
    assert cell_density_percentile(points) == pytest.approx(1)
    # all points of the third row moved into the second
    x = points.x - [0.0, CELL] * ((points.x[:, 1] > 0.2) & (points.x[:, 1] < 0.3))[:, None]
    compressed = state(points.scene, x)
    assert cell_density_percentile(compressed) == pytest.approx(2)
    assert cell_density_percentile(compressed, q=50) == pytest.approx(1)
    assert np.count_nonzero(np.isclose(cell_density(compressed).value, 2 * RHO_C)) == 6


def test_bad_fields_are_refused():
    points = box()
    with pytest.raises(ValueError, match="field = 'force' is not"):
        smooth(points, "force")
    with pytest.raises(ValueError, match=r"shape \(3,\)"):
        smooth(points, np.ones(3))
    with pytest.raises(ValueError, match="outside the grid along axis 1"):
        smooth(state(points.scene, points.x + np.array([0.0, 0.2])), np.ones(points.n))
    refused(
        ("0 points", lambda: nodal_density(state(points.scene, np.empty((0, 2))))),
        ("at = 'cells'", lambda: nodal_density(points, at="cells")),
        ("weight = 'number'", lambda: cell_average(points, "pressure", weight="number")),
        ("q = 101", lambda: cell_density_percentile(points, q=101)),
        ("tolerance", lambda: phase(points, tolerance=-1.0)),
    )

"""Fills beside anything: points are in the grid and their region, in no body or other fill."""

import numpy as np
import pytest
from random_scenes import random_scene

import granular as gr
from granular.model.grid import combined
from granular.mpm.body_distances import distance_from_bodies

CUT, WHOLE = 0.02, 0.5
"""Largest error of the volume of a fill over its surface and the edge of a square.

The boundary of a polygon or a layer cuts squares, as bodies do, to the second order of an eighth of
a square. Of other regions squares count as a whole, by their centres, so that each face errs by up
to half of one.
"""


def check(scene):
    """Places and volumes of all fills, against samples of the regions; and that it runs."""
    points, grid = scene.points(), scene.grid
    assert ((points.x >= grid.lower) & (points.x < grid.upper)).all()
    distance = distance_from_bodies(scene.grid, scene.bodies)
    assert distance(points.x)[0].min() >= 0
    n = {2: 300, 3: 60}[grid.dim]
    size = grid.cell * np.array(grid.shape)
    u = combined([np.arange(n)] * grid.dim) + np.random.default_rng(0).random(
        (n**grid.dim, grid.dim)
    )
    samples = np.array(grid.lower) + size * u / n
    samples = samples[distance(samples)[0] > 0]
    for i, fill in enumerate(scene.fills):
        own = points.fill == i
        for j, other in enumerate(scene.fills):
            if i == j and isinstance(fill.region, gr.Cloud):
                continue
            assert (other.region.contains(points.x[own]) == (i == j)).all()
        if isinstance(fill.region, gr.Cloud):
            continue
        exact = fill.region.contains(samples).sum() * size.prod() / n**grid.dim
        extent = np.ptp(fill.region.bounds, axis=0)
        surface = 2 * sum(np.delete(extent, axis).prod() for axis in range(grid.dim))
        error = (points.volume[own].sum() - exact) / (surface * grid.cell / fill.points_per_axis)
        assert abs(error) < (CUT if isinstance(fill.region, (gr.Polygon, gr.Layer)) else WHOLE)
    gr.Simulation(scene, threads=1).step(2)


@pytest.mark.parametrize("seed", range(8))
def test_fills_beside_bodies_and_ends_of_the_grid(seed):
    check(random_scene(seed))


@pytest.mark.slow
def test_a_thousand_of_them():
    for seed in range(8, 1008):
        check(random_scene(seed))

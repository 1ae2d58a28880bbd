"""Division of cells among ranks: a curve whose parts are connected and of equal weight."""

import numpy as np
import pytest

from granular.ranks.partition import BLOCKS, edge_of_blocks, hilbert, owners_of_blocks


@pytest.mark.parametrize(("dim", "bits"), [(1, 5), (2, 1), (2, 5), (3, 1), (3, 3)])
def test_the_curve_meets_all_blocks_and_goes_from_neighbour_to_neighbour(dim, bits):
    side = 2**bits
    places = np.array(np.unravel_index(np.arange(side**dim), (side,) * dim))
    position = hilbert(places, bits)
    assert sorted(position) == list(range(side**dim))
    along = places[:, np.argsort(position)]
    assert np.all(np.abs(np.diff(along, axis=1)).sum(axis=0) == 1)


@pytest.mark.parametrize("shape", [(13, 1, 1), (9, 14, 1), (7, 5, 6)])
@pytest.mark.parametrize("size", [1, 2, 5, 7])
def test_parts_are_even_and_all_blocks_have_an_owner(shape, size):
    weights = np.random.default_rng(size).integers(0, 50, np.prod(shape)).astype(float)
    owners = owners_of_blocks(weights, shape, size)
    assert owners.dtype == np.int32 and owners.min() >= 0 and owners.max() < size
    parts = np.bincount(owners, weights, size)
    assert abs(parts - weights.sum() / size).max() <= weights.max()


def test_without_points_the_blocks_are_divided():
    assert set(owners_of_blocks(np.zeros(64), (8, 8, 1), 4)) == {0, 1, 2, 3}


def test_blocks_are_as_large_as_leaves_enough_for_each_rank():
    counts = {32: 3, 16: 2 * BLOCKS, 8: 100, 4: 400}
    assert edge_of_blocks(counts, 1) == 16
    assert edge_of_blocks(counts, 2) == 16
    assert edge_of_blocks(counts, 3) == 8
    assert edge_of_blocks(counts, 1000) == 4

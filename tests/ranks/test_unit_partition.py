"""Division of cells among ranks: parts of equal weight that meet in few faces."""

import numpy as np
import pytest

from granular.ranks.partition import BLOCKS, edge_of_blocks, owners_of_blocks


def test_parts_meet_in_few_faces():
    """A cube by eight ranks is eight cubes, and a plate is not cut along its length."""
    owners = owners_of_blocks(np.ones(8**3), (8, 8, 8), 8).reshape(8, 8, 8)
    for corner in np.ndindex(2, 2, 2):
        low = 4 * np.array(corner)
        part = owners[tuple(slice(a, a + 4) for a in low)]
        assert len(np.unique(part)) == 1
    plate = owners_of_blocks(np.ones(40 * 6), (40, 6, 1), 2).reshape(6, 40)
    assert (plate[:, :20] == plate[0, 0]).all() and (plate[:, 20:] == plate[0, -1]).all()


def test_parts_do_not_meet_along_the_first_axis_unless_they_gain_by_it():
    owners = owners_of_blocks(np.ones(6 * 9), (6, 9, 1), 3).reshape(9, 6)
    assert [len(set(row)) for row in owners] == [1] * 9


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
    counts = {32: BLOCKS // 2, 16: 2 * BLOCKS, 8: 7 * BLOCKS, 4: 20 * BLOCKS}
    assert edge_of_blocks(counts, 1) == 16
    assert edge_of_blocks(counts, 2) == 16
    assert edge_of_blocks(counts, 3) == 8
    assert edge_of_blocks(counts, 1000) == 4

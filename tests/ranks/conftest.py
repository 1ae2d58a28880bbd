"""Fixtures of the tests of ranks."""

from contextlib import contextmanager

import numpy as np
import pytest

from granular.ranks import simulation as ranked


@pytest.fixture
def scattered(monkeypatch):
    """A context in which blocks of 4 cells are given to ranks at random."""

    @contextmanager
    def owners(seed):
        def draw(weights, shape, size):
            rng = np.random.default_rng(seed)
            return rng.integers(0, size, len(weights)).astype(np.int32)

        with monkeypatch.context() as patch:
            patch.setattr(ranked, "owners_of_blocks", draw)
            patch.setattr(ranked, "EDGES", {2: (4,), 3: (4,)})
            yield

    return owners

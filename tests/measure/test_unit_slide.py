"""Front, rear, centre, energy line and deposit of synthetic states."""

import numpy as np
import pytest
import synthetic

from granular import measure


def row(shift, time, v=(1.0, -0.5)):
    """A thousand equal points in a row 1 m long, that has slid by `shift` along (2, -1)."""
    scene = synthetic.scene((40, 10), 0.1)
    x = (np.arange(1000) + 0.5) / 1000
    places = np.column_stack([x + 2 * shift, 0.9 - shift + 0 * x])
    return synthetic.state(scene, places, time=time, v=np.tile(v, (1000, 1)))


def test_history_of_a_row_that_slides():
    found = measure.slide_history(row(s, t) for s, t in ((0.0, 0.0), (0.25, 1.0), (0.75, 2.0)))
    np.testing.assert_allclose(found.front, [0.99, 1.49, 2.49], atol=1e-12)
    np.testing.assert_allclose(found.rear, [0.01, 0.51, 1.51], atol=1e-12)
    np.testing.assert_allclose(found.centre[-1], [2.0, 0.15], atol=1e-12)
    np.testing.assert_allclose(found.velocity, np.tile([1.0, -0.5], (3, 1)))
    np.testing.assert_allclose(found.front_speed, [0.5, 0.75, 1.0])
    assert found.energy_line == pytest.approx(0.5)
    half = measure.slide_history([row(0.0, 0.0), row(0.1, 1.0)], share=0.75)
    assert half.front[0] == pytest.approx(0.75) and half.rear[0] == pytest.approx(0.25)


def test_history_refuses_what_has_no_meaning():
    with pytest.raises(ValueError, match="states must be at least 2, are 1"):
        measure.slide_history([row(0.0, 0.0)])
    for share in (0.5, 1.0):
        with pytest.raises(ValueError, match=f"share = {share} must be"):
            measure.slide_history([row(0.0, 0.0), row(0.1, 1.0)], share=share)


@pytest.mark.parametrize("dim", [2, 3])
def test_deposit_of_a_step(dim):
    """Two cells high in the first three columns, empty beyond."""
    shape = (6, 5, 4)[:: 2 if dim == 2 else 1]
    scene = synthetic.scene(shape, 0.1)
    x = synthetic.regular_points(scene, keep=lambda x: (x[..., 0] < 0.3) & (x[..., -1] < 0.2))
    found = measure.deposit(synthetic.state(scene, x, per_cell=2**dim))
    profile = found.thickness if dim == 2 else found.thickness[:, 0]
    np.testing.assert_allclose(profile, [0.2] * 3 + [0.0] * 3, atol=1e-12)
    assert found.thickness.shape == shape[:-1]
    assert found.highest == pytest.approx(0.2)
    assert found.area == pytest.approx(0.3 * (1.0 if dim == 2 else 0.5))
    np.testing.assert_allclose(found.axes[0], 0.05 + 0.1 * np.arange(6))

"""Slices of velocity fields that are known, and Gaussians of known width."""

import numpy as np
import pytest
from refusals import refused
from scipy.optimize import curve_fit
from synthetic import material, regular_points, silo, state

from granular.measure import Opening
from granular.papers.silo_clogging import VelocitySlices, gaussian_fit, velocity_slices

WIDTH, D = 0.14, 0.028
B = 0.6 * D
"""Values of the paper at A = 0.5 and W/d = 5."""
HEIGHTS = np.array([1.5, 2.0, 2.5]) * WIDTH
GRAINS = material(d=D)


def gaussian(x, y, B=B):
    """Speed 0.3 m/s over the opening and 0.02 m/s at the walls, as in the kinematic model."""
    return -0.3 * np.sqrt(0.2 / y) * np.exp(-(x**2) / (4 * B * y)) - 0.02


def frames(v, *, half=True, cell=0.0175, top=0.56, count=2, left=None, noise=0.0, axis=0.0):
    """Irregular points that carry a vertical velocity v(x, y)."""
    s = silo(half=half, cell=cell, rows=round(0.595 / cell), left=left, grains=GRAINS)
    random = np.random.default_rng(7)
    found = []
    for k in range(count):
        x = regular_points(s, 4, lambda x: x[:, 1] < top)
        x = x + cell / 4 * random.uniform(-0.5, 0.5, x.shape)
        up = v(x[:, 0] - axis, x[:, 1]) + noise * random.standard_normal(len(x))
        found.append(state(s, x, v=np.stack([0 * up, up], axis=1), per_cell=16, time=k))
    return found


def exact(noise=0.0, seed=1, x=None, d=D):
    x = np.linspace(-0.2975, 0.2975, 35) if x is None else x
    v = gaussian(x[None, :], HEIGHTS[:, None])
    v = v + noise * np.random.default_rng(seed).standard_normal(v.shape)
    return VelocitySlices(x, HEIGHTS, v, d, 1)


@pytest.mark.parametrize("half", [True, False])
def test_slices_of_a_linear_field_are_exact_inside(half):
    """The height 1.53 W lies between the 12th and the 13th row of nodes."""
    found = velocity_slices(frames(lambda x, y: 3 * y - 1, half=half, count=40), [1.5, 1.53])
    assert found.frames == 40
    assert found.x[0] == (0.0 if half else pytest.approx(-0.2975))
    assert len(found.x) == (18 if half else 35)
    assert found.d == D
    assert np.allclose(found.heights, [0.21, 0.2142])
    # irregular points: their centroid is off the node by some hundredths of a cell
    assert found.velocity[0] == pytest.approx(3 * 0.21 - 1, abs=0.004)
    assert found.velocity[1] == pytest.approx(3 * 0.2142 - 1, abs=0.004)


def test_the_error_of_a_slice_is_of_second_order():
    errors = []
    for cell in (0.0175, 0.00875):
        s = silo(half=True, cell=cell, rows=round(0.595 / cell))
        x = regular_points(s, 4)
        v = np.stack([0 * x[:, 0], gaussian(*x.T)], axis=1)
        found = velocity_slices(state(s, x, v=v, per_cell=16))
        expected = gaussian(found.x[None, :], found.heights[:, None])
        errors.append(np.abs(found.velocity - expected)[:, :-1].max())
    assert errors[0] < 0.01 * 0.3
    assert errors[0] / errors[1] == pytest.approx(4.0, rel=0.2)


def test_an_exact_gaussian_is_fitted_exactly():
    fit = gaussian_fit(exact())
    assert pytest.approx(B, rel=1e-7) == fit.B
    assert fit.B_over_d == pytest.approx(0.6, rel=1e-7)
    assert np.allclose(fit.B_each, B, rtol=1e-6)
    assert np.allclose(fit.amplitude, -0.3 * np.sqrt(0.2 / HEIGHTS))
    assert np.allclose(fit.offset, -0.02)
    assert fit.r_squared == pytest.approx(1.0, abs=1e-12)
    assert fit.rms < 1e-8
    assert fit.B_error < 1e-6 * B
    assert gaussian_fit(exact(d=None)).B_over_d is None
    assert gaussian_fit(exact(d=None), d=B).B_over_d == pytest.approx(1.0)
    half = gaussian_fit(exact(x=np.linspace(0, 0.2975, 18)))
    assert pytest.approx(B, rel=1e-6) == half.B
    # places without material are left out
    slices = exact()
    slices.velocity[2, :5] = np.nan
    assert gaussian_fit(slices).B == pytest.approx(B, rel=1e-6)
    flat = exact()
    flat.velocity[1] = -0.1
    fit = gaussian_fit(flat)
    assert np.isnan(fit.B_each[1])
    assert pytest.approx(B, rel=1e-6) == fit.B


def test_the_standard_error_is_that_of_many_tries():
    fits = [gaussian_fit(exact(noise=0.005, seed=k)) for k in range(80)]
    found = np.array([fit.B for fit in fits])
    assert found.mean() == pytest.approx(B, abs=4 * found.std() / np.sqrt(80))
    assert np.mean([fit.B_error for fit in fits]) == pytest.approx(found.std(), rel=0.2)
    # 105 positions, 7 parameters
    assert np.mean([fit.rms**2 for fit in fits]) == pytest.approx(0.005**2 * 98 / 105, rel=0.05)


def test_the_fit_is_that_of_scipy():
    """scipy fits all seven parameters at once, by another method."""
    slices = exact(noise=0.01)
    which = np.repeat(np.arange(3), len(slices.x))
    q = np.tile(slices.x, 3) ** 2 / (4 * HEIGHTS[which])

    def model(q, B, *parts):
        C, offset = np.array(parts).reshape(2, 3)
        return C[which] * np.exp(-q / B) + offset[which]

    found, covariance = curve_fit(
        model, q, slices.velocity.ravel(), p0=(0.02, *[-0.3] * 3, 0, 0, 0)
    )
    fit = gaussian_fit(slices)
    assert pytest.approx(found[0], rel=1e-5) == fit.B
    assert fit.B_error == pytest.approx(np.sqrt(covariance[0, 0]), rel=1e-3)
    assert np.allclose(np.concatenate([fit.amplitude, fit.offset]), found[1:], rtol=1e-4)
    # R^2 is about the mean of each height
    fit = gaussian_fit(exact(noise=0.02))
    v = exact(noise=0.02).velocity
    left = fit.rms**2 * v.size
    assert fit.r_squared == pytest.approx(1 - left / np.sum((v - v.mean(axis=1)[:, None]) ** 2))
    assert 0.8 < fit.r_squared < 0.99


@pytest.mark.parametrize("half", [True, False])
def test_a_field_on_points_gives_its_width_back(half):
    """Averaging about nodes adds cell**2/6 to the variance 2 B y, which is 0.7 % at 1.5 W."""
    fit = gaussian_fit(velocity_slices(frames(gaussian, half=half, count=4, noise=0.01)))
    assert pytest.approx(B, rel=0.02) == fit.B
    assert fit.B_over_d == pytest.approx(0.6, rel=0.02)
    assert fit.r_squared > 0.998
    fine = gaussian_fit(velocity_slices(frames(gaussian, half=half, cell=0.00875)))
    assert pytest.approx(B, rel=0.006) == fine.B


def test_an_axis_at_the_right_and_a_width_that_is_not_as_the_height():
    left = frames(gaussian, left=-0.2975)
    found = velocity_slices(left, opening=Opening(WIDTH, half=True))
    assert found.x[-1] == pytest.approx(0.0, abs=1e-12)
    assert gaussian_fit(found).B == pytest.approx(B, rel=0.02)
    shifted = frames(gaussian, half=False, left=1.0, axis=1.2975)
    assert gaussian_fit(velocity_slices(shifted)).B == pytest.approx(B, rel=0.02)
    straight = frames(lambda x, y: -np.exp(-(x**2) / (4 * 0.004)))
    each = gaussian_fit(velocity_slices(straight)).B_each
    assert each * HEIGHTS == pytest.approx(0.004, rel=0.02)


def test_the_highest_row_with_material_needs_none_above():
    """0.56 m is the 32nd row of nodes and 4 W; 0.595 m is the last row."""
    assert np.isfinite(velocity_slices(frames(gaussian), [4.0]).velocity).all()
    full = velocity_slices(frames(gaussian, top=1.0), [4.25])
    assert np.isfinite(full.velocity).all()


def test_bad_slices_are_refused():
    flow = frames(gaussian, count=1)
    for heights in ([], [0.0], [2.0, 1.5], [[1.5]], [np.nan]):
        with pytest.raises(ValueError, match="heights"):
            velocity_slices(flow, heights)
    with pytest.raises(TypeError, match="VelocitySlices"):
        gaussian_fit(flow)
    low, few = frames(gaussian, top=0.5, count=1), exact(x=np.linspace(0, 0.3, 3))
    still, bent = exact(), exact()
    still.velocity[:], bent.velocity[:] = -0.25, 1 - bent.x**2
    refused(
        (r"the grid 0\.595 m", lambda: velocity_slices(flow, [1.5, 5.0])),
        (r"no material at 0.588 m", lambda: velocity_slices(low, [4.2])),
        (r"3 nodes with material at height 0\.21 m", lambda: gaussian_fit(few)),
        ("B must be between", lambda: gaussian_fit(still)),
        ("B must be between", lambda: gaussian_fit(bent)),
        ("d = 0", lambda: gaussian_fit(exact(), d=0.0)),
    )

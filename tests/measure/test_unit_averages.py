"""Averages over frames, the centre line and contours of known fields."""

import numpy as np
import pytest
from refusals import refused
from synthetic import RHO_C, isotropic, regular_points, scene, silo, state

from granular.measure import (
    GridField,
    Opening,
    cell_average,
    centre_line_pressure,
    contours,
    frame_average,
    speed_contours,
)
from granular.measure.fields import nodal

CELL = 0.0175


def filled(s, field, *, top=0.56, jitter=0.0, seed=0, **fields):
    x = regular_points(s, 4, lambda x: x[:, 1] < top)
    x = x + jitter * CELL / 4 * np.random.default_rng(seed).uniform(-0.5, 0.5, x.shape)
    return state(s, x, per_cell=16, **{name: f(x) for name, f in (field | fields).items()})


def test_one_frame_is_the_average_over_its_cells_or_nodes():
    s = silo(half=True)
    points = filled(s, {"v": np.sin}, jitter=1.0)
    cells, mean = cell_average(points, "v"), frame_average(points, "v")
    assert mean.value.shape == (17, 36, 2)
    assert np.allclose(mean.value[tuple(cells.cells.T)], cells.value)
    assert np.allclose(mean.weight[tuple(cells.cells.T)], cells.weight)
    assert np.isnan(mean.value[:, 33:]).all()
    assert np.allclose(mean.axes[0], CELL * (np.arange(17) + 0.5))
    at_nodes = frame_average(points, lambda state: state.v[:, 1], at="nodes")
    assert at_nodes.value.shape == (18, 37)
    assert at_nodes.axes[1][-1] == pytest.approx(36 * CELL)
    expected = nodal(points, points.v[:, 1])
    known = at_nodes.weight.ravel() > 0
    assert np.allclose(at_nodes.value.ravel()[known], expected[known])
    assert np.isnan(at_nodes.value.ravel()[~known]).all()


def test_frames_count_by_what_they_hold_and_stress_by_volume():
    s = scene((2, 1), 1.0)
    first = state(s, [[0.5, 0.5], [1.5, 0.5]], mass=[1.0, 2.0])
    second = state(s, [[0.2, 0.5]], mass=3.0)
    field = {id(first): [10.0, 7.0], id(second): [2.0]}
    mean = frame_average([first, second], lambda state: field[id(state)])
    assert mean.frames == 2
    assert np.allclose(mean.value[:, 0], [(10 + 3 * 2) / 4, 7.0])
    assert np.allclose(mean.weight[:, 0], [2.0, 1.0])
    s = scene((1, 1), 1.0)
    frame = state(s, [[0.5, 0.5], [0.6, 0.5]], mass=1.0, rho=[1.0, 0.25])
    frame.f = np.array([10.0, 20.0])
    assert frame_average(frame, "f").value.item() == pytest.approx(15)
    assert frame_average(frame, "f", weight="volume").value.item() == pytest.approx(18)


def test_the_fluidity_of_dense_points_alone():
    s = scene((2, 1), 1.0)
    frames = []
    for g, p in (([4.0, np.nan, 5.0], [1.0, 0.0, 0.0]), ([8.0, 2.0, np.nan], [1.0, 3.0, 0.0])):
        frame = state(s, [[0.5, 0.5], [0.6, 0.5], [1.5, 0.5]], mass=1.0, stress=isotropic(p))
        frame.g = np.array(g)
        frames.append(frame)
    mean = frame_average(frames, "g", points="dense")
    assert mean.value[0, 0] == pytest.approx((4 + 8 + 2) / 3)
    assert np.isnan(mean.value[1, 0])
    assert mean.weight[0, 0] == 1.5
    with pytest.raises(ValueError, match="no such point"):
        frame_average(state(s, [[0.5, 0.5]]), "x", points="dense")


@pytest.mark.parametrize("half", [True, False])
def test_lithostatic_pressure_on_the_centre_line(half):
    """A field that also depends on x shows how far from the axis is averaged."""
    s = silo(half=half)

    def p(x):
        return RHO_C * 9.8 * (0.56 - x[:, 1]) + 1e5 * np.abs(x[:, 0])

    frames = [filled(s, {"stress": lambda x: isotropic(p(x))}, seed=k, jitter=0.8) for k in (1, 2)]
    line = centre_line_pressure(frames)
    assert np.allclose(line.y, CELL * (np.arange(36) + 0.5))
    assert np.isnan(line.value[32:]).all()
    expected = RHO_C * 9.8 * (0.56 - line.centroid[:32])
    off = (line.value[:32] - expected) / 1e5
    # half a cell; point positions in it vary by 0.8 spacings over sqrt(12 * 32 points)
    assert off == pytest.approx(CELL / 2, abs=4 * 0.8 * CELL / 4 / np.sqrt(12 * 32))
    assert off.mean() == pytest.approx(CELL / 2, rel=0.01)
    wide = centre_line_pressure(frames, columns=3)
    expected = RHO_C * 9.8 * (0.56 - wide.centroid[:32])
    assert np.allclose(wide.value[:32] - expected, 1e5 * 1.5 * CELL, rtol=0.02)
    # the volume of whole cells, with the same number of columns on each modelled side
    assert wide.weight[:32] == pytest.approx((1 if half else 2) * 3 * CELL**2)
    raised = centre_line_pressure(frames, opening=Opening(0.14, floor=2 * CELL))
    assert np.allclose(raised.y, line.y[:-2])
    assert np.allclose(raised.value[:30], line.value[2:32])


def test_an_axis_through_cells_and_points_free_of_stress():
    s = scene((5, 2), 1.0, parameters={"orifice": 1.0})
    x = regular_points(s, 2)
    p = np.where(x[:, 1] > 1, 10.0 * np.floor(x[:, 0]) ** 2, 0.0)
    line = centre_line_pressure(state(s, x, stress=isotropic(p)))
    # the middle of five cells is that of the third cell
    assert np.allclose(line.value, [0.0, 40.0])
    with pytest.raises(ValueError, match="no column of cells next to"):
        centre_line_pressure(state(s, x), opening=Opening(1.0, axis=-9.0))
    with pytest.raises(ValueError, match="columns = 0"):
        centre_line_pressure(state(s, x), columns=0)


def test_contours_of_a_cone_are_circles():
    axis = np.linspace(-1, 1, 201)
    r = np.hypot(*np.meshgrid(axis, axis, indexing="ij"))
    r[r > 0.95] = np.nan
    found = contours(GridField((axis, axis), r, np.ones_like(r), 1), [0.25, 0.5, 2.0])
    assert [c.level for c in found] == [0.25, 0.5, 2.0]
    assert [len(c.lines) for c in found] == [1, 1, 0]
    for c in found[:2]:
        assert np.hypot(*c.lines[0].T) == pytest.approx(c.level, abs=1e-4)


def test_contours_of_speed_of_a_field_that_depends_on_x_and_y():
    s = silo(half=True)
    frames = [
        filled(s, {"v": lambda x: np.stack([0.6 * x[:, 0], -0.8 * x[:, 0]], axis=1)}, seed=k)
        for k in (1, 2)
    ]
    (line,) = speed_contours(frames, 0.1)[0].lines
    assert line[:, 0] == pytest.approx(0.1, abs=1e-9)
    # from the floor to the highest row of nodes with material
    assert np.ptp(line[:, 1]) == pytest.approx(33 * CELL, abs=CELL)
    tilted = [filled(s, {"v": lambda x: np.stack([0 * x[:, 0], -x[:, 0] - 2 * x[:, 1]], axis=1)})]
    (line,) = speed_contours(tilted, [0.5])[0].lines
    inside = (line[:, 0] > CELL) & (line[:, 0] < 16 * CELL)
    assert line[inside, 0] + 2 * line[inside, 1] == pytest.approx(0.5, abs=1e-9)


def test_bad_averages_are_refused():
    s = silo(half=True)
    points = filled(s, {})
    for wrong in ({"points": "loose"}, {"at": "corners"}, {"weight": "count"}):
        (name,) = wrong
        with pytest.raises(ValueError, match=name):
            frame_average(points, "v", **wrong)
    refused(
        ("not a field", lambda: frame_average(points, "colour")),
        ("one value or row", lambda: frame_average(points, lambda state: [1.0])),
        ("0 frames", lambda: frame_average([], "v")),
        ("one value per cell or node", lambda: contours(frame_average(points, "v"), [0.1])),
        ("different grids", lambda: frame_average([points, filled(silo(half=False), {})], "v")),
    )
    field = frame_average(points, lambda state: state.x[:, 0])
    for levels in ([], [0.2, 0.1], [np.nan], [[0.1]]):
        with pytest.raises(ValueError, match="levels"):
            contours(field, levels)

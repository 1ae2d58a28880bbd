"""Wrong arguments to the engine raise documented exceptions: no crash, no change to the engine."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from spoiled import DOCUMENTED, QUICK, WAYS, arguments, numbers, spoiled

import granular as gr
from granular import _core
from granular.mpm import engine as core


@pytest.fixture
def keywords(small_scene):
    return arguments(small_scene("walls", 2, ("quadratic", "tpic", "smoothed")))


# ---- construction ----


def test_the_caught_keywords_build_an_engine(keywords):
    assert _core.Engine(**keywords).fields()


@QUICK
@given(data=st.data())
def test_engine_refuses_wrong_keywords(keywords, data):
    wrong = dict(keywords)
    names = st.lists(st.sampled_from(sorted(keywords)), min_size=1, max_size=3, unique=True)
    for name in data.draw(names):
        value = wrong[name]
        if isinstance(value, np.ndarray):
            wrong[name] = spoiled(value, data.draw(st.sampled_from(WAYS)))
        elif isinstance(value, dict):
            inner = dict(value)
            inner[data.draw(st.sampled_from(sorted(inner)))] = data.draw(numbers)
            wrong[name] = inner
        elif isinstance(value, tuple):
            rows = [list(row) for row in value]
            row = rows[data.draw(st.integers(0, len(rows) - 1))]
            row[data.draw(st.integers(0, len(row) - 1))] = data.draw(numbers)
            wrong[name] = tuple(map(tuple, rows[: data.draw(st.integers(0, 4))]))
        else:
            wrong[name] = data.draw(numbers)
    try:
        engine = _core.Engine(**wrong)
    except DOCUMENTED:
        return
    assert engine.scalars()["step"] == 0


@QUICK
@given(row=st.tuples(*[numbers] * 7), length=st.integers(0, 7))
def test_engine_refuses_wrong_walls(keywords, row, length):
    walls = [keywords["walls"][0], row[:length], *keywords["walls"][2:]]
    try:
        _core.Engine(**(keywords | {"walls": walls}))
    except DOCUMENTED:
        return
    assert length == 6


@QUICK
@given(
    lines=st.lists(st.integers(-5, 20), max_size=8),
    basis=st.integers(-1, 4),
    n=st.integers(-3, 12),
    periodic=st.booleans(),
)
def test_node_positions_refuses_wrong_axes(lines, basis, n, periodic):
    try:
        found = _core.node_positions(basis, n, periodic, np.array(lines, dtype=np.int32))
    except DOCUMENTED:
        return
    assert (np.diff(found) > 0).all()
    assert lines == sorted(set(lines))


@pytest.mark.parametrize("how", WAYS)
def test_node_positions_refuses_wrong_c0_lines(how):
    lines = spoiled(np.array([2, 4, 6], dtype=np.int32), how)
    if how in ("int32", "read-only", "empty", "short", "flat"):
        assert len(_core.node_positions(2, 9, False, np.ascontiguousarray(lines)))
        return
    with pytest.raises((TypeError, ValueError)):
        _core.node_positions(2, 9, False, lines)


# ---- buffers ----


def bound(scene):
    sim = gr.Simulation(scene, threads=1)
    return core.build(scene, sim._mean_mass), sim.buffers, sim.n_points


@pytest.mark.parametrize("how", WAYS)
def test_bind_refuses_wrong_buffers(small_scene, how):
    scene = small_scene("walls", 2, ("quadratic", "tpic", "smoothed"))
    engine, buffers, n = bound(scene)
    for name in buffers:
        with pytest.raises((TypeError, ValueError)):
            engine.bind(buffers | {name: spoiled(buffers[name], how)}, n, True)
        rest = {k: a for k, a in buffers.items() if k != name}
        with pytest.raises(ValueError, match=name):
            engine.bind(rest, n, True)
    with pytest.raises(RuntimeError, match="bind"):
        engine.advance(1, 1.0, 1)


def test_bind_refuses_overlapping_buffers(small_scene):
    engine, buffers, n = bound(small_scene("walls", 2, ("linear", "flip", "particle")))
    for name, other in (("x", "v"), ("mass", "log_density")):
        with pytest.raises(ValueError, match="share memory"):
            engine.bind(buffers | {name: buffers[other]}, n, True)
    both = np.zeros(2 * len(buffers["id"]) + 8)
    one = both[: buffers["mass"].size].reshape(1, -1)
    half = both[8 : 8 + buffers["mass"].size].reshape(1, -1)
    with pytest.raises(ValueError, match="share memory"):
        engine.bind(buffers | {"mass": one, "shear_rate": half}, n, True)
    with pytest.raises(ValueError, match="share memory"):
        engine.bind(buffers | {"id": buffers["mass"].view(np.int64)[0]}, n, True)


@QUICK
@given(n=numbers, fresh=numbers)
def test_bind_refuses_wrong_counts(small_scene, n, fresh):
    engine, buffers, _ = bound(small_scene("walls", 2, ("linear", "flip", "particle")))
    try:
        engine.bind(buffers, n, fresh)
        engine.regroup()
    except DOCUMENTED:
        return
    assert 0 <= n <= len(buffers["id"])


@QUICK
@given(steps=numbers, until=numbers, threads=numbers)
def test_advance_refuses_wrong_numbers(small_scene, steps, until, threads):
    sim = gr.Simulation(small_scene("walls", 2, ("linear", "flip", "particle")), threads=1)
    few = steps if not isinstance(steps, int) or abs(steps) < 50 else -abs(steps)
    try:
        sim._engine.advance(few, until, threads)
    except DOCUMENTED:
        assert sim.steps == 0
    sim.step()


@QUICK
@given(data=st.data())
def test_restore_refuses_wrong_scalars(small_scene, data):
    sim = gr.Simulation(small_scene("walls", 2, ("linear", "flip", "particle")), threads=1)
    before = sim._engine.scalars()
    name = data.draw(st.sampled_from(sorted(before)))
    try:
        sim._engine.restore(before | {name: data.draw(numbers)})
    except DOCUMENTED:
        assert sim._engine.scalars() == before
        sim.step()


@QUICK
@given(data=st.data())
def test_any_number_at_a_point_is_survived(small_scene, data):
    """A step on NaN, infinite or absurd values ends in SimulationError or completes; no crash."""
    combination = data.draw(
        st.sampled_from([("linear", "flip", "particle"), ("quadratic", "tpic", "smoothed")])
    )
    sim = gr.Simulation(small_scene("periodic", 2, combination), threads=1)
    at = np.flatnonzero(sim.buffers["id"] >= 0)
    for _ in range(3):
        name = data.draw(st.sampled_from(sorted(set(sim.buffers) - {"id"})))
        array = sim.buffers[name]
        component = data.draw(st.integers(0, len(array) - 1))
        array[component, at[data.draw(st.integers(0, len(at) - 1))]] = data.draw(st.floats())
    sim._engine.restore(sim._engine.scalars())
    try:
        sim.step(3)
    except (gr.SimulationError, ValueError):
        return
    assert sim.steps == 3


def test_an_engine_without_points_says_so(keywords):
    engine = _core.Engine(**keywords)
    calls = (engine.regroup, engine.p2g, engine.grid, engine.g2p, engine.nodes)
    for call in (*calls, engine.cells, engine.stable_dt, lambda: engine.advance(1, 1.0, 1)):
        with pytest.raises(RuntimeError, match="bind"):
            call()
    with pytest.raises(RuntimeError, match="already"):
        engine.__init__(**keywords)
    with pytest.raises(RuntimeError, match="bind"):
        _core.Engine.__new__(_core.Engine).advance(1, 1.0, 1)

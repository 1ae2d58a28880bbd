"""Discharge rates and Beverloo fits from histories that are known exactly."""

from types import SimpleNamespace

import numpy as np
import pytest
from refusals import refused
from synthetic import scene, state

import granular as gr
from granular.measure import EffectiveOpening, MassHistory, beverloo, discharge, mass_history


def silo(rate, *, half=False, orifice=0.1, frames=200, end=4.0, dim=2):
    """One-point states that lose `rate` kg/s of the 1500 kg in the whole silo."""
    s = scene((10,) * dim, 0.1, parameters={"orifice": orifice, "half": half})
    share = 0.5 if half else 1.0
    return Run(
        s,
        [
            state(s, [[0.5] * dim], mass=share * (1500 - rate * t), time=t)
            for t in np.linspace(0, end, frames)
        ],
    )


class Run(list):
    """States that hold their scene, as a trajectory does."""

    def __init__(self, scene, states):
        super().__init__(states)
        self.scene = scene


@pytest.mark.parametrize("half", [False, True])
def test_the_rate_of_a_straight_line(half):
    result = discharge(silo(200.0, half=half))
    assert result.rate == pytest.approx(200, rel=1e-12)
    assert result.standard_error < 1e-9
    assert result.window_spread < 1e-9
    assert 1200 >= result.mass[0] > result.mass[1] >= 900
    # 300 kg at 200 kg/s, a frame every 4/199 s
    assert result.frames == pytest.approx(300 / 200 / (4 / 199), abs=1.1)
    modelled = discharge(silo(200.0, half=half), total=False)
    assert modelled.rate == pytest.approx(100 if half else 200, rel=1e-12)


def test_the_errors_of_a_regression():
    times = np.linspace(0, 3, 301)
    noise = np.random.default_rng(1).normal(0, 2.0, len(times))
    history = MassHistory(times, 1200 - 100 * times + noise, 1.0)
    result = discharge(history, window=(2000.0, 10.0))
    # textbook formula: sigma/sqrt(sum (t - tbar)^2)
    expected = 2.0 / np.sqrt(np.sum((times - 1.5) ** 2))
    assert result.standard_error == pytest.approx(expected, rel=0.1)
    assert abs(result.rate - 100) < 4 * expected


def test_a_changing_rate_shows_in_the_spread_of_the_window():
    times = np.linspace(0, 10, 2001)
    mass = 1500 * np.exp(-0.1 * times)
    result = discharge(MassHistory(times, mass, 1.0))
    # the rate is 0.1 m: between the means of the two halves of the window it falls by a tenth
    assert result.window_spread == pytest.approx(0.1 * 150, rel=0.05)
    assert result.standard_error < result.window_spread / 20


@pytest.mark.parametrize(("scheme", "wider"), [("default", -1.05), ("cell_averaged", -1.4)])
def test_the_rate_is_corrected_for_the_effective_opening(scheme, wider):
    """Half a silo of 8 cells in its opening, which acts narrower by a cell and more."""
    given = {"cell": 0.02, "scheme": getattr(gr.schemes, scheme)}
    scene = gr.scenes.silo(orifice=0.16, edge="wall", **given)
    as_published = EffectiveOpening.of(gr.scenes.silo(orifice=0.16, **given))
    assert as_published.width == pytest.approx(0.2)  # the bottom begins a cell further out
    mass = 0.5 * (1500 - 200 * np.linspace(0, 4, 200))
    record = SimpleNamespace(scene=scene, series={"time": np.linspace(0, 4, 200), "mass": mass})
    for total, share in ((True, 1.0), (False, 0.5)):
        found = discharge(record, total=total)
        assert found.opening.effective == pytest.approx(0.16 + wider * 0.02)
        factor = (8 / (8 + wider)) ** 1.5
        assert found.corrected == pytest.approx(factor * 200 * share, rel=1e-9)
        assert found.rate == pytest.approx(200 * share, rel=1e-9)
        expected = 1.5 * 0.1 / (8 + wider) * found.corrected
        assert found.corrected_uncertainty == pytest.approx(expected, rel=1e-6)
    assert np.isnan(discharge(silo(200.0)).corrected)  # a scheme that was not measured


def test_the_history_of_a_series_needs_no_frames():
    s = scene((10, 10), 0.1, parameters={"half": True})
    record = SimpleNamespace(scene=s, series={"time": np.arange(3.0), "mass": [3.0, 2.0, 1.0]})
    history = mass_history(record)
    assert np.array_equal(history.mass, [6.0, 4.0, 2.0])
    assert np.array_equal(history.times, [0.0, 1.0, 2.0])
    assert history.share == 0.5


@pytest.mark.parametrize(("C", "exponent", "dim"), [(1.42, 1.5, 2), (1.31, 1.47, 2), (0.6, 2.5, 3)])
def test_beverloo_of_exact_data(C, exponent, dim):
    D = np.array([0.06, 0.1, 0.14, 0.2])
    fit = beverloo(D, C * 1500 * np.sqrt(9.81) * D**exponent, rho=1500.0, dim=dim)
    assert fit.exponent_free == pytest.approx(exponent, rel=1e-10)
    assert fit.C_free == pytest.approx(C, rel=1e-10)
    assert np.abs(fit.residuals_free).max() < 1e-12
    # with the exponent of dim, the mean of ln(C D**(exponent - dim + 1/2)) over the orifices
    extra = exponent - dim + 0.5
    assert pytest.approx(C * np.exp(extra * np.log(D).mean()), rel=1e-12) == fit.C
    assert fit.residuals.sum() == pytest.approx(0, abs=1e-12)
    assert extra or np.abs(fit.residuals).max() < 1e-12


def test_beverloo_of_runs():
    D = np.array([0.1, 0.14, 0.2])
    rates = 1.5 * 1500 * np.sqrt(9.8) * D**1.5
    runs = [silo(Q, orifice=d, half=True, end=3.0) for d, Q in zip(D, rates, strict=True)]
    with pytest.raises(ValueError, match=r"window = \(2.0, 1.0\): 0 frames lie in it"):
        beverloo(runs, window=(2.0, 1.0))
    fit = beverloo(runs)
    assert pytest.approx(1.5, rel=1e-10) == fit.C
    assert np.allclose(fit.orifices, D)
    assert np.allclose(fit.rates, rates)
    rounds = [silo(0.6 * 1500 * np.sqrt(9.8) * d**2.5, orifice=d, end=40.0, dim=3) for d in D[1:]]
    assert pytest.approx(0.6, rel=1e-10) == beverloo(rounds).C
    with pytest.raises(ValueError, match="in 2D and 'synthetic' in 3D"):
        beverloo([*runs, *rounds])


def test_bad_histories_and_fits_are_refused():
    refused(
        ("0 frames", lambda: mass_history([])),
        ("0 frames lie in it", lambda: discharge(silo(10.0, end=1.0))),
        ("must fall", lambda: discharge(silo(200.0), window=(900.0, 1200.0))),
        ("at least 3", lambda: discharge(silo(200.0, frames=7))),
    )
    refused(
        ("rho = None", lambda: beverloo([0.1, 0.2], [1.0, 2.0])),
        ("at least 2 different", lambda: beverloo([0.1, 0.1], [1.0, 2.0], rho=1500.0)),
        ("rates = ", lambda: beverloo([0.1, 0.2], [1.0, -2.0], rho=1500.0)),
        ("equal length", lambda: beverloo([0.1, 0.2], [1.0], rho=1500.0)),
    )
    with pytest.raises(TypeError, match="give trajectories"):
        beverloo([0.1, 0.2])
    with pytest.raises(ValueError, match="at least 2 different"):
        beverloo([])

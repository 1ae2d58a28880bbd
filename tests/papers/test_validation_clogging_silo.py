"""The clogging silo: cases on which every numerical method should agree, and mirror images."""

import warnings
from functools import cache

import numpy as np
import pytest

import granular as gr
from granular.papers.silo_clogging.document import SCHEMES


@cache
def frames(duration, **keywords):
    """States every 1/120 s."""
    found = []
    with warnings.catch_warnings():  # marks of tests do not apply to cached results
        warnings.simplefilter("ignore", gr.StabilityWarning)
        scene = gr.scenes.clogging_silo(duration=duration, **keywords)
        sim = gr.Simulation(scene, threads=1)
    sim.run(every=1 / 120, hooks=(lambda sim: found.append(sim.state),), monitor=False)
    return tuple(found)


def verdict(duration, **keywords):
    return gr.papers.silo_clogging.flow_verdict(frames(duration, **keywords)).verdict


def outflow(states, start):
    """Mean outflow [kg/s] from a time to the end."""
    history = gr.papers.silo_clogging.silo_history(states)
    mass = np.interp((start, history.times[-1]), history.times, history.mass)
    return (mass[0] - mass[1]) / (history.times[-1] - start)


def test_small_openings_clog():
    """Shorter runs would still see the material below the arch fall out."""
    assert verdict(0.7, A=1.0, opening_over_d=1) == "static"


@pytest.mark.parametrize(("A", "opening"), [(1.0, 5), (0.1, 1)])
def test_large_openings_flow(A, opening):
    """Opening in grains and amplitude A: an opening that is small for A = 1 is large for A = 0.1.

    The flow pulses: at 0.4 s the dense points of A = 0.1 happen to be slower.
    """
    assert verdict(0.5, A=A, opening_over_d=opening) == "flowing"


@pytest.mark.slow
@pytest.mark.parametrize("scheme", SCHEMES)
@pytest.mark.parametrize(
    ("A", "opening", "expected"),
    [
        (1.0, 1, "static"),
        (2.0, 1, "static"),
        (3.0, 1, "static"),
        (3.0, 2, "static"),
        (1.0, 4, "flowing"),
        (1.0, 5, "flowing"),
        (0.5, 5, "flowing"),
        (0.1, 1, "flowing"),
        (0.1, 5, "flowing"),
    ],
)
def test_gates_at_the_published_time(A, opening, expected, scheme):
    chosen = SCHEMES[scheme]
    assert verdict(1.5, A=A, opening_over_d=opening, scheme=chosen) == expected


def test_friction_below_one_bears_no_arch():
    """The face of an arch needs mu = 1: with the mu_2 of glass beads the arch fails and flows."""
    weak = gr.materials.silo_grains.replace(mu_2=0.6435)
    with pytest.warns(gr.StabilityWarning, match="cannot jam"):
        gr.scenes.clogging_silo(material=weak)
    assert verdict(0.3, A=1.0, opening_over_d=1, material=weak) == "flowing"


def test_half_a_silo_is_the_whole_one():
    """Equal to rounding at all nodes; on the axis a half silo has the sideways motion of a side."""
    half, whole = (frames(0.05, opening_over_d=3, half=h)[-1] for h in (True, False))
    assert whole.n == 2 * half.n
    v, both = (gr.measure.frame_average(s, "v", at="nodes").value for s in (half, whole))
    n = len(v)
    scale = np.nanmax(np.abs(v))
    for other in (both[-n:], both[:n][::-1] * [-1, 1]):
        assert np.isnan(other[1:]).tolist() == np.isnan(v[1:]).tolist()
        assert np.nanmax(np.abs(other - v)[1:]) < 1e-12 * scale
        assert np.nanmax(np.abs(other - v)[0, :, 1]) < 1e-12 * scale
    assert np.nanmax(np.abs(both[n - 1, :, 0])) < 1e-12 * scale


def test_outflow_falls_and_shear_spreads_with_the_amplitude():
    """W/d = 5, figures 6 and 8: nonlocality slows the flow and makes all of it shear."""
    rates, spreads = [], []
    for A in (0.1, 1.0):
        states = frames(0.5, A=A, opening_over_d=5)
        rates.append(outflow(states, 0.15))
        spreads.append(least_fluidity(states[-13:], 2.5 * 0.14))
    assert rates[1] < 0.9 * rates[0]
    assert spreads[1] > 2 * spreads[0]


def least_fluidity(states, height):
    """Ratio of the smallest to the largest fluidity at a height."""
    field = gr.measure.frame_average(states, "g", points="dense")
    row = field.value[:, int(np.argmin(np.abs(field.axes[1] - height)))]
    return np.nanmin(row) / np.nanmax(row)

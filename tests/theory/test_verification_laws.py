"""Run-out laws and the Beverloo rate against the printed figures."""

from __future__ import annotations

import inspect
import math

import numpy as np
import pytest

from granular import theory
from granular.theory import RUNOUT_LAWS, beverloo_rate


@pytest.mark.parametrize(
    ("name", "aspect", "runout"),
    [
        ("dunatunga", 1.0, 2.28),
        ("dunatunga", 8.0, 12.78),
        ("staron", 1.0, 2.5),
        ("staron", 4.0, 8.70),
        ("lube", 1.0, 1.2),
        ("lube", 8.0, 7.6),
        ("lagree", 2.0, 4.4),
        ("lagree", 10.0, 19.55),
        ("mast", 1.0, 1.01),
        ("mast", 4.0, 3.677),
    ],
)
def test_run_out_by_hand(name, aspect, runout):
    assert RUNOUT_LAWS[name](aspect) == pytest.approx(runout, rel=1e-3)


@pytest.mark.parametrize(
    ("name", "jump"), [("dunatunga", 3e-3), ("staron", 0.07), ("lagree", 0.02), ("mast", 0.07)]
)
def test_the_pieces_meet_within_their_precision(name, jump):
    law = RUNOUT_LAWS[name]
    at = law.pieces[0].upper
    below, above = law([np.nextafter(at, 0), at])
    assert below == pytest.approx(above, rel=jump)


def test_laws_of_the_run_out_between_their_ranges():
    runout = RUNOUT_LAWS["lube"](np.array([[1.7, 1.8], [2.7, 2.8]]))
    np.testing.assert_array_equal(np.isnan(runout), [[False, True], [True, False]])
    narrow = RUNOUT_LAWS["balmforth_narrow"]
    assert narrow.pieces[0].exponent == 0.65
    with pytest.raises(ValueError, match="exponents only"):
        narrow(1.0)
    with pytest.raises(ValueError, match="aspect"):
        RUNOUT_LAWS["dunatunga"]([1.0, 0.0])


def test_beverloo_by_hand_and_its_scaling():
    # 1.42 * 1500 * sqrt(9.8) * 0.2^1.5 = 596.4 kg/s per metre
    assert beverloo_rate(0.2, 1500.0, gravity=9.8) == pytest.approx(596.4, abs=0.05)
    free = beverloo_rate(0.2, 1500.0, C=1.31, exponent=1.47)
    assert free == pytest.approx(1.31 * 1500 * math.sqrt(9.81) * math.exp(1.47 * math.log(0.2)))
    # 0.58 * 1500 * sqrt(9.81) * (0.1 - 1.4 * 0.005)^2.5 = 7.187 kg/s through a round orifice
    round_one = beverloo_rate(0.1, 1500.0, k=1.4, d=0.005, dim=3)
    assert round_one == pytest.approx(7.187, abs=1e-3)
    # The coefficient of a slot would give 2.4 times as much.
    for wrong in ({"exponent": 2.5}, {"exponent": 1.5, "dim": 3}, {"exponent": 1.47}):
        with pytest.raises(ValueError, match="needs its own C"):
            beverloo_rate(0.1, 1500.0, **wrong)
    widths = np.array([0.004, 0.008, 0.048, 0.168])
    rate = beverloo_rate(widths, 1500.0, k=1.6, d=0.005)
    np.testing.assert_array_equal(rate[:2], 0)
    assert rate[3] / rate[2] == pytest.approx(8.0, rel=1e-12)


def test_one_gravity_in_all_the_theory():
    """Whatever takes gravity takes that of the earth if none is given."""
    functions = (getattr(theory, name) for name in dir(theory))
    found = {
        f.__name__: inspect.signature(f).parameters["gravity"].default
        for f in functions
        if inspect.isfunction(f) and "gravity" in inspect.signature(f).parameters
    }
    assert len(found) >= 15
    assert {v for v in found.values() if v is not inspect.Parameter.empty} == {9.81}

"""Wrong arguments to the functions of `granular.theory` are refused by name."""

from math import inf, nan
from types import SimpleNamespace

import pytest

from granular import theory

CHUTE = {"A": 0.25, "d": 5e-3, "mu_s": 0.3819, "mu_2": 1.5}
GRAINS = SimpleNamespace(
    **CHUTE, I0=0.279, b=4.0, rho_s=2450.0, rho_c=1500.0, t0=1e-3, xi=1.1233, K=1e5, G=6e4
)
GAS = {"diameter": 0.005, "restitution": 0.7}


def spoilt(**changes):
    """The grains with meaningless numbers."""
    return {"material": SimpleNamespace(**(vars(GRAINS) | changes))}


STOPPING = [
    ({"A": -0.1}, "A = -0.1"),
    ({"d": 0.0}, "d = 0.0"),
    ({"mu_s": 0.0}, "mu_s = 0.0"),
    ({"mu_s": inf}, "mu_s = inf"),
    ({"mu_2": 0.3}, "mu_2 = 0.3 must exceed mu_s"),
    ({"mu_2": nan}, "mu_2 = nan"),
]
PROFILE = [
    ({"angle_deg": 90.0}, "angle_deg = 90"),
    ({"angle_deg": 57.0}, r"below atan\(mu_2\) = 56.3"),
    ({"height": 0.0}, "height = 0.0"),
    ({"gravity": -9.8}, "gravity = -9.8"),
    ({"cells": 6}, "cells = 6"),
    ({"cells": 11}, "cells = 11 must be even"),
    (spoilt(A=-0.1), "A = -0.1"),
    (spoilt(d=-5e-3), "d = -0.005"),
    (spoilt(b=0.0), "b = 0.0"),
    (spoilt(t0=0.0), "t0 = 0.0"),
    (spoilt(rho_s=0.0), "rho_s = 0.0"),
    (spoilt(rho_c=nan), "rho_c = nan"),
    (spoilt(mu_2=0.3819), "mu_2 = 0.3819 must exceed"),
]
LINEAR = (spoilt(rheology="linear_mu_I"), 'rheology = "linear_mu_I" must be "mu_I"')
LAYER = {"angle_deg": 27.0, "height": 0.02, "material": GRAINS, "cells": 20}
COUETTE = {"inner": 0.0999, "outer": 0.2001, "material": GRAINS}
CAP = {"times": [0.1], "angle_deg": 35.0, "mu": 0.3, "half_length": 0.2, "thickness": 0.05}
WAVE = {"x": 0.0, "t": 0.0, "length": 1.0, "amplitude": 1e-3, "material": GRAINS}
CASES = [
    ("stopping_height", CHUTE | {"angle_deg": 25.0}, [
        *STOPPING,
        ({"angle_deg": -1.0}, "angle_deg"),
        ({"angle_deg": [20.0, 90.0]}, "angle_deg"),
        ({"angle_deg": nan}, "angle_deg"),
    ]),
    ("stopping_angle", CHUTE | {"height": 25.0}, [
        *STOPPING,
        ({"height": 0.0}, "height"),
        ({"height": -1.0}, "height"),
        ({"height": nan}, "height"),
    ]),
    ("stopping_shape", {"y": 0.1, "height": 0.2}, [
        ({"height": 0.0}, "height"),
        ({"y": [0.1, 0.21]}, "y in"),
    ]),
    ("chute_profile", LAYER, PROFILE),
    ("chute_transient", LAYER | {"times": [0.1], "g0": 1.0}, [
        *PROFILE,
        ({"times": [1.0, 0.5]}, "times"),
        ({"times": [inf]}, "times"),
        ({"rtol": 0.0}, "rtol = 0.0"),
        ({"g0": -1.0}, "g0 = -1.0"),
        ({"g0": lambda y: 0.1 - y / 0.02}, "g0"),
        ({"g0": lambda y: 1.0}, "g0"),
    ]),
    ("reference", {"material": GRAINS, "p0": 500.0, "times": [0.0, 1.0]}, [
        LINEAR,
        ({"p0": -1.0}, "p0"),
        ({"p0": 0.0}, "log_density0"),
        ({"p0": 0.0, "log_density0": 0.0}, "log_density0"),
        ({"log_density0": 0.1}, "log_density0"),
        ({"times": [0.5, 0.1]}, "times"),
        ({"times": [-0.5, 0.1]}, "times"),
        ({"times": [nan]}, "times"),
        ({"times": [0.0]}, "times"),
        ({"breakpoints": (0.0, 1.0, 0.5)}, "breakpoints"),
        ({"solver": "euler"}, "solver"),
        ({"rtol": 0.0}, "rtol"),
    ]),
    ("couette_quasi_static", COUETTE, [
        ({"outer": 0.05}, "outer = 0.05 must exceed inner = 0.0999"),
        ({"inner": -1.0}, "inner = -1.0 must be a finite number > 0"),
        ({"walls": "sticky"}, "walls = 'sticky' must be one of 'rough', 'smooth'"),
        ({"points": 100}, "points = 100 must be an integer from 101 to 100001"),
        ({"rate": 0.0}, "rate = 0.0 must be"),
        (spoilt(A=0.0), "A = 0.0 must be"),
        (spoilt(mu_2=0.3), "mu_2 = 0.3 must exceed mu_s = 0.3819"),
    ]),
    ("couette_flow", COUETTE | {"rate": 1.0, "pressure": 1.0}, [
        ({"pressure": -1.0}, r"pressure = -1\.0 must be"),
        ({"points": 104}, "points = 104 must be odd"),
        ({"points": 51}, "points = 51 must be an integer from 101 to 100001"),
    ]),
    ("couette_decay_length", {"material": GRAINS}, [({"mu": -0.1}, r"mu = -0\.1 must be >= 0")]),
    ("hencky_column", {"reference_height": 0.0, "height0": 1.0, "material": GRAINS}, [
        ({"reference_height": 2.0}, r"reference_height = 2\.0 must be in \[0, 1\.0\]"),
        ({"height0": 0.0}, r"height0 = 0\.0 must be"),
    ]),
    ("standing_wave", WAVE, [
        ({"x": 2.0}, r"x = 2\.0 must be in \[0, 1\.0\]"),
        ({"ends": "free"}, "ends = 'free' must be one of"),
        ({"log_stretch": 1.0}, r"log_stretch = 1\.0 must be below 1"),
        ({"mode": 0}, "mode = 0 must be an integer >= 1"),
    ]),
    ("transient", {"angle_deg": 25.0, "height": 0.2, "material": GRAINS, "times": [1.0]}, [
        LINEAR,
        ({"height": -0.2}, "height"),
        ({"gravity": 0.0}, "gravity"),
        ({"ramp": -0.1}, "ramp"),
        ({"cells": 1}, "cells"),
        ({"rtol": 0.0}, "rtol"),
        ({"times": [1.0, 0.5]}, "times"),
        ({"times": [nan]}, "times"),
        ({"times": []}, "times"),
        ({"angle_deg": nan}, "angle_deg"),
        ({"angle_deg": -1.0}, "angle_deg"),
    ]),
    ("bagnold_mean", {"angle_deg": 25.0, "height": 0.2, "material": GRAINS}, [LINEAR]),
    ("packing_fraction_of_inertial_number", {"inertial_number": 0.1, "restitution": 0.7}, [
        ({"inertial_number": -0.1}, "inertial_number"),
        ({"restitution": 1.1}, "restitution"),
    ]),
    ("shear_pressure", GAS | {"packing_fraction": 0.5, "shear_rate": 1.0, "material": GRAINS}, [
        ({"packing_fraction": 0.6}, "packing_fraction"),
        ({"diameter": 0.0}, "diameter"),
    ]),
    ("compression_temperature", GAS | {"packing_fraction": 0.5, "compression_rate": 6.0}, [
        ({"packing_fraction": 0.0}, "packing_fraction"),
        ({"restitution": 1.0}, "restitution = 1"),
    ]),
    ("granular_temperature", GAS | {"packing_fraction": 0.5, "compression_rate": 1.0}, [
        ({"times": [-1.0], "temperature0": 1.0}, "times"),
        ({"times": [1.0], "temperature0": -1.0}, "temperature0"),
    ]),
    ("coupled_shear", GAS | {"packing_fraction": 0.5, "shear_rate": 1.0, "material": GRAINS}, [
        ({"shear_rate": -1.0}, "shear_rate"),
        ({"offset": -0.5}, "offset"),
    ]),
    ("beverloo_rate", {"orifice": 0.1, "rho": 1500.0}, [
        ({name: -1}, name)
        for name in ("orifice", "rho", "C", "k", "d", "gravity", "exponent", "dim")
    ]),
    ("crater_depth", {"drop": 0.2, "D": 0.025, "mu": 0.4, "density_ratio": 1.5}, [
        ({"drop": [0.1, -0.1]}, "drop = "),
        ({"drop": nan}, "drop = nan"),
        ({"D": 0.0}, "D = 0.0"),
        ({"mu": 0.0}, "mu = 0.0"),
        ({"density_ratio": inf}, "density_ratio = inf"),
    ]),
    ("bearing_capacity", {"phi_deg": 20.0}, [
        ({"phi_deg": -1.0}, "phi_deg = -1.0"),
        ({"phi_deg": 46.0}, "phi_deg = 46.0"),
        ({"phi_deg": nan}, "phi_deg = nan"),
    ]),
    ("flow_factor", {"angle_deg": 20.0, "wall_deg": 15.0, "effective_deg": 40.0}, [
        ({"angle_deg": 0.5}, "angle_deg = 0.5"),
        ({"wall_deg": 40.0}, "wall_deg = 40.0"),
        ({"effective_deg": nan}, "effective_deg = nan"),
        ({"dim": 1}, "dim = 1"),
    ]),
    ("arch_factor", {"angle_deg": 20.0}, [({"angle_deg": -1.0}, "angle_deg = -1.0")]),
    ("critical_outlet", {"strength": 100.0, "angle_deg": 20.0, "wall_deg": 15.0,
                         "effective_deg": 40.0, "density": 1e3}, [
        ({"strength": -1.0}, "strength = -1.0"),
        ({"strength": nan}, "strength = nan"),
        ({"density": 0.0}, "density = 0.0"),
        ({"gravity": 0.0}, "gravity = 0.0"),
    ]),
    ("unconfined_strength", {"cohesion": 100.0, "mu": 0.4}, [
        ({"cohesion": -1.0}, "cohesion = -1.0"),
        ({"mu": 1.0}, "mu = 1.0"),
    ]),
    ("sliding_earth_pressure", {"mu": 0.4, "base": 0.3}, [
        ({"mu": 0.0}, "mu = 0.0"),
        ({"mu": 1.0}, "mu = 1.0"),
        ({"base": -0.1}, "base = -0.1"),
        ({"base": nan}, "base = nan"),
    ]),
    ("spreading_cap", CAP, [
        ({"times": [0.2, 0.1]}, "times must be ascending"),
        ({"times": []}, "times must be ascending"),
        ({"angle_deg": 90.0}, "angle_deg = 90.0"),
        ({"mu": 0.8}, "mu = 0.8"),
        ({"half_length": 0.0}, "half_length = 0.0"),
        ({"thickness": -1.0}, "thickness = -1.0"),
        ({"K": 0.0}, "K = 0.0"),
        ({"gravity": inf}, "gravity = inf"),
    ]),
    ("spreading_ellipse", CAP, [
        ({"times": [0.2, 0.1]}, "times must be ascending"),
        ({"angle_deg": 90.0}, "angle_deg = 90.0"),
        ({"angle_deg": 0.0, "mu": 0.0}, "mu = 0.0 must be below"),
        ({"half_length": 0.0}, "half_length = 0.0"),
        ({"thickness": -1.0}, "thickness = -1.0"),
        ({"K": 0.0}, "K = 0.0"),
        ({"gravity": inf}, "gravity = inf"),
    ]),
    ("dam_break", {"x": [0.0], "time": 1.0, "angle_deg": 22.0, "mu": 0.3, "thickness": 1.0}, [
        ({"x": [nan]}, "x"),
        ({"time": 0.0}, "time = 0.0"),
        ({"mu": 0.5}, "mu = 0.5"),
        ({"thickness": 0.0}, "thickness = 0.0"),
        ({"K": -1.0}, "K = -1.0"),
    ]),
    ("block_runout", {"angle_deg": 35.0, "bend": 0.3, "mu": 0.3, "distance": 1.0}, [
        ({"angle_deg": 0.0}, "angle_deg = 0.0"),
        ({"bend": -0.1}, "bend = -0.1"),
        ({"mu": 0.0}, "mu = 0.0"),
        ({"distance": 0.05}, "distance = 0.05"),
        ({"distance": 0.08, "mu": 0.69}, "distance = 0.08 must be more"),
    ]),
    ("layer_waves", {"angle_deg": 25.0, "height": 0.2, "wavelength": 0.1, "cells": 10,
                     "material": SimpleNamespace(**(vars(GRAINS) | {"mu_2": 0.6435}))}, [
        LINEAR,
        ({"angle_deg": 20.0}, "angle_deg = 20.0"),
        ({"angle_deg": 33.0}, "angle_deg = 33.0"),
        ({"wavelength": 0.0}, "wavelength = 0.0"),
        ({"height": -1.0}, "height = -1.0"),
        ({"cells": 3}, "cells = 3"),
    ]),
]  # fmt: skip
"""Function, arguments that it takes, and changes with what is then said."""


@pytest.mark.parametrize(
    ("name", "given", "message"),
    [(name, good | change, said) for name, good, changes in CASES for change, said in changes],
)
def test_errors_name_the_argument(name, given, message):
    with pytest.raises(ValueError, match=message):
        getattr(theory, name)(**given)


def test_couette_flow_takes_any_odd_number_of_points():
    """Half of 103 is even."""
    flow = theory.couette_flow(**COUETTE, rate=1.0, pressure=500.0, points=103)
    assert flow.r.size == 103 and 0 < flow.error < 2e-3

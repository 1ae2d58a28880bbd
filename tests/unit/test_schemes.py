"""Schemes: the two presets and the checks of arguments."""

import math

import pytest

from granular.mpm import schemes
from granular.mpm.schemes import (
    CellAveragedDensity,
    Fluidity,
    ParticleDensity,
    Scheme,
    SmoothedDensity,
)


def test_presets():
    p, d, c = schemes.dunatunga_kamrin_2015, schemes.default, schemes.cell_averaged
    assert (c.basis, c.transfer, c.density.name, c.dt) == ("linear", "tpic", "cell_averaged", None)
    assert (p.basis, p.transfer, p.density.name, p.dt) == ("linear", "flip", "particle", 3e-6)
    assert (d.basis, d.transfer, d.density.name, d.dt) == ("quadratic", "tpic", "smoothed", None)
    assert Scheme() == d and d.replace(cfl=0.25).cfl == 0.25 and d.cfl == 0.5


@pytest.mark.parametrize(
    ("arguments", "error", "message"),
    [
        ({"basis": "cubic"}, ValueError, "basis = 'cubic' must be one of 'linear'"),
        ({"basis": 2}, TypeError, "basis = 2"),
        ({"transfer": "pic"}, ValueError, "transfer = 'pic'"),
        ({"density": 1.0}, TypeError, "density = 1.0"),
        ({"cfl": 0.0}, ValueError, r"cfl = 0.0 must be in \(0.0, 1.0\]"),
        ({"cfl": 1.01}, ValueError, "cfl = 1.01"),
        ({"dt": 0.0}, ValueError, "dt = 0.0"),
        ({"dt": math.inf}, ValueError, "dt = inf"),
        ({"xpic_order": 0}, ValueError, "xpic_order = 0"),
        ({"xpic_order": 2.0}, TypeError, "xpic_order = 2.0"),
        ({"flip_decay": -1.0}, ValueError, "flip_decay = -1.0"),
        ({"mass_cutoff": 0.1}, ValueError, "mass_cutoff = 0.1"),
        (
            {"basis": "linear", "density": SmoothedDensity()},
            ValueError,
            'needs basis = "quadratic"',
        ),
        (
            {"density": CellAveragedDensity(), "basis": "quadratic"},
            ValueError,
            'needs basis = "linear" and transfer = "tpic"',
        ),
        (
            {"density": CellAveragedDensity(), "transfer": "flip"},
            ValueError,
            "not 'linear' and 'flip'",
        ),
        ({"transfer": "apic", "flip_decay": 1.0}, ValueError, "flip_decay = 1.0 must be 0"),
        ({"tpic_decay": "fast"}, TypeError, "tpic_decay = 'fast'"),
        ({"density": "smoothed"}, TypeError, "must be a SmoothedDensity"),
        ({"diffusion": 1.0}, TypeError, "diffusion"),
    ],
)
def test_refusals(arguments, error, message):
    with pytest.raises(error, match=message):
        Scheme(**arguments)


@pytest.mark.parametrize(
    ("arguments", "error", "message"),
    [
        ({"diffusion": math.nan}, ValueError, "diffusion = nan"),
        ({"weight_correction": 1.1}, ValueError, "weight_correction = 1.1"),
        ({"weight_correction_limit": 1.0}, ValueError, "weight_correction_limit = 1.0"),
        ({"weight_correction_decay": -0.1}, ValueError, "weight_correction_decay = -0.1"),
        ({"relaxation_limit": -1.0}, ValueError, "relaxation_limit = -1.0"),
        ({"shifting_limit": 0.6}, ValueError, "shifting_limit = 0.6"),
        ({"shifting_outlet_cells": -1}, ValueError, "shifting_outlet_cells = -1"),
    ],
)
def test_refusals_of_densities(arguments, error, message):
    with pytest.raises(error, match=message):
        SmoothedDensity(**arguments)
    (name,) = arguments
    if name in CellAveragedDensity.units:
        with pytest.raises(error, match=message):
            CellAveragedDensity().replace(**arguments)


def test_a_density_has_the_numbers_of_its_own():
    assert Scheme().density == SmoothedDensity() != CellAveragedDensity()
    assert (SmoothedDensity().shifting, CellAveragedDensity().shifting) == (8.0, 2.0)
    assert ParticleDensity.units.keys() == {"separation_strain"}
    assert "averaging_time" not in CellAveragedDensity.units
    with pytest.raises(TypeError, match="weight_correction"):
        CellAveragedDensity(weight_correction=0.5)


def test_a_density_brings_its_basis_and_transfer():
    scheme = Scheme(density=CellAveragedDensity(diffusion=0.25))
    assert (scheme.basis, scheme.transfer, scheme.tpic_decay) == ("linear", "tpic", 3.0)
    assert Scheme(density=ParticleDensity()).transfer == "tpic"
    assert Scheme(basis="linear").density == ParticleDensity()


def test_declared_numbers_are_documented():
    """The core declares name, default, range, unit and text of each, once."""
    for kind in (Scheme, Fluidity, *schemes.DENSITIES.values()):
        for name in kind.units:
            assert f"    {name} : " in kind.__doc__
    assert "[1/s]" in Scheme.__doc__ or "1/s." in Scheme.__doc__
    assert "[0, 0.5]" in SmoothedDensity.__doc__


@pytest.mark.parametrize(
    ("arguments", "error", "message"),
    [
        ({"method": "euler"}, ValueError, "method = 'euler' must be one of 'auto'"),
        ({"method": None}, TypeError, "method = None"),
        ({"substeps": 0}, ValueError, "substeps = 0"),
        ({"substeps": 1.0}, TypeError, "substeps = 1.0"),
        ({"tolerance": 0.0}, ValueError, "tolerance = 0.0"),
        ({"tolerance": 1.0}, ValueError, "tolerance = 1.0"),
        ({"initial": -1.0}, ValueError, "initial = -1.0"),
        ({"initial": math.nan}, ValueError, "initial = nan"),
        ({"pressure_averaging": 1.5}, ValueError, "pressure_averaging = 1.5"),
        ({"pressure_averaging": -0.5}, ValueError, "pressure_averaging = -0.5"),
    ],
)
def test_refusals_of_the_fluidity(arguments, error, message):
    with pytest.raises(error, match=message):
        Fluidity(**arguments)
    with pytest.raises(error, match=message):
        Fluidity().replace(**arguments)


def test_a_scheme_holds_a_fluidity():
    assert Scheme().fluidity == Fluidity()
    with pytest.raises(TypeError, match="fluidity = 'implicit' must be a Fluidity"):
        Scheme(fluidity="implicit")


def test_html_shows_the_choices():
    assert "quadratic" in schemes.default._repr_html_()

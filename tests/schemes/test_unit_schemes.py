"""Schemes: the two presets and the checks of arguments."""

import math

import pytest

import granular as gr
from granular import (
    CellAveragedDensity,
    Fluidity,
    ParticleDensity,
    Scheme,
    SmoothedDensity,
    schemes,
)


def test_presets():
    p, d, c = schemes.dunatunga_kamrin_2015, schemes.default, schemes.cell_averaged
    assert (c.basis, c.transfer, c.density.name, c.dt) == ("linear", "tpic", "cell_averaged", None)
    assert (p.basis, p.transfer, p.density.name, p.dt) == ("linear", "flip", "particle", 3e-6)
    assert (d.basis, d.transfer, d.density.name, d.dt) == ("quadratic", "tpic", "smoothed", None)
    assert Scheme() == d and d.replace(cfl=0.25).cfl == 0.25 and d.cfl == 0.5


SMOOTHED, CELLS = SmoothedDensity(), CellAveragedDensity()


@pytest.mark.parametrize(
    ("kind", "arguments", "error", "message"),
    [
        (Scheme, {"basis": "cubic"}, ValueError, "basis = 'cubic' must be one of 'linear'"),
        (Scheme, {"basis": 2}, TypeError, "basis = 2"),
        (Scheme, {"transfer": "pic"}, ValueError, "transfer = 'pic'"),
        (Scheme, {"density": 1.0}, TypeError, "density = 1.0"),
        (Scheme, {"cfl": 0.0}, ValueError, r"cfl = 0.0 must be in \(0.0, 1.0\]"),
        (Scheme, {"cfl": 1.01}, ValueError, "cfl = 1.01"),
        (Scheme, {"dt": 0.0}, ValueError, "dt = 0.0"),
        (Scheme, {"dt": math.inf}, ValueError, "dt = inf"),
        (Scheme, {"xpic_order": 0}, ValueError, "xpic_order = 0"),
        (Scheme, {"xpic_order": 2.0}, TypeError, "xpic_order = 2.0"),
        (Scheme, {"flip_decay": -1.0}, ValueError, "flip_decay = -1.0"),
        (Scheme, {"mass_cutoff": 0.1}, ValueError, "mass_cutoff = 0.1"),
        (Scheme, {"basis": "linear", "density": SMOOTHED}, ValueError, 'needs basis = "quadratic"'),
        (Scheme, {"density": CELLS, "basis": "quadratic"}, ValueError, 'and transfer = "tpic"'),
        (Scheme, {"density": CELLS, "transfer": "flip"}, ValueError, "not 'linear' and 'flip'"),
        (Scheme, {"transfer": "apic", "flip_decay": 1.0}, ValueError, "flip_decay = 1.0 must be 0"),
        (Scheme, {"tpic_decay": "fast"}, TypeError, "tpic_decay = 'fast'"),
        (Scheme, {"density": "smoothed"}, TypeError, "must be a SmoothedDensity"),
        (Scheme, {"diffusion": 1.0}, TypeError, "diffusion"),
        (SmoothedDensity, {"diffusion": math.nan}, ValueError, "diffusion = nan"),
        (SmoothedDensity, {"weight_correction": 1.1}, ValueError, "weight_correction = 1.1"),
        (
            SmoothedDensity,
            {"weight_correction_limit": 1.0},
            ValueError,
            "weight_correction_limit = 1.0",
        ),
        (
            SmoothedDensity,
            {"weight_correction_decay": -0.1},
            ValueError,
            "weight_correction_decay = -0.1",
        ),
        (SmoothedDensity, {"relaxation_limit": -1.0}, ValueError, "relaxation_limit = -1.0"),
        (SmoothedDensity, {"shifting_limit": 0.6}, ValueError, "shifting_limit = 0.6"),
        (SmoothedDensity, {"shifting_outlet_cells": -1}, ValueError, "shifting_outlet_cells = -1"),
        (Fluidity, {"method": "euler"}, ValueError, "method = 'euler' must be one of 'auto'"),
        (Fluidity, {"method": None}, TypeError, "method = None"),
        (Fluidity, {"substeps": 0}, ValueError, "substeps = 0"),
        (Fluidity, {"substeps": 1.0}, TypeError, "substeps = 1.0"),
        (Fluidity, {"tolerance": 0.0}, ValueError, "tolerance = 0.0"),
        (Fluidity, {"tolerance": 1.0}, ValueError, "tolerance = 1.0"),
        (Fluidity, {"initial": -1.0}, ValueError, "initial = -1.0"),
        (Fluidity, {"initial": math.nan}, ValueError, "initial = nan"),
        (Fluidity, {"pressure_averaging": 1.5}, ValueError, "pressure_averaging = 1.5"),
        (Fluidity, {"pressure_averaging": -0.5}, ValueError, "pressure_averaging = -0.5"),
    ],
)
def test_refusals(kind, arguments, error, message):
    """The same for a changed object, and for the numbers that a cell-averaged density has, too."""
    with pytest.raises(error, match=message):
        kind(**arguments)
    if kind is not Scheme:
        with pytest.raises(error, match=message):
            kind().replace(**arguments)
    if kind is SmoothedDensity and arguments.keys() <= CellAveragedDensity.units.keys():
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
    assert (scheme.basis, scheme.transfer, scheme.tpic_decay) == ("linear", "tpic", 0.2)
    assert Scheme(density=ParticleDensity()).transfer == "tpic"
    assert Scheme(basis="linear").density == ParticleDensity()


def test_declared_numbers_are_documented():
    """The core declares name, default, range, unit and text of each, once."""
    for kind in (Scheme, Fluidity, *schemes.DENSITIES.values()):
        for name in kind.units:
            assert f"\n{name} : " in kind.__doc__
    assert "[1/s]" in Scheme.__doc__ or "1/s." in Scheme.__doc__
    assert "[0, 0.5]" in SmoothedDensity.__doc__


def test_a_scheme_holds_a_fluidity():
    assert Scheme().fluidity == Fluidity()
    with pytest.raises(TypeError, match="fluidity = 'implicit' must be a Fluidity"):
        Scheme(fluidity="implicit")


def test_a_scene_that_names_no_scheme_has_the_one_that_suits_its_material():
    """`cell_averaged` for a nonlocal law with a limiting friction alone, in any way to a scene."""
    nonlocal_law, local = gr.NGF(E=1e6), gr.materials.glass_beads
    unlimited = gr.NGF(E=1e6, rheology="linear_mu_I", elasticity="hencky")
    collapse = gr.scenes.column_collapse
    averaged, default = gr.schemes.cell_averaged, gr.schemes.default
    assert collapse(material=nonlocal_law).scheme == averaged
    assert collapse(material=nonlocal_law, mu_2=1.0).scheme == averaged
    assert collapse(material=nonlocal_law, scheme=default).scheme == default
    for material in (local, unlimited, nonlocal_law.replace(A=0.0)):
        assert collapse(material=material).scheme == default
    parts = {name: getattr(collapse(), name) for name in ("name", "grid", "gravity", "duration")}
    fills = collapse().fills
    assert gr.Scene(**parts, fills=fills, material=nonlocal_law).scheme == averaged
    mixed = (*fills, gr.Fill(gr.Box((0.0, 0.42), (0.2, 0.45)), 4, material=local))
    assert gr.Scene(**parts, fills=mixed, material=nonlocal_law).scheme == default
    with pytest.raises(TypeError, match="scheme = 'default' must be a Scheme"):
        gr.Scene(**parts, fills=fills, material=local, scheme="default")


@pytest.mark.parametrize(
    "change",
    [
        {"density": gr.SmoothedDensity(averaging_time=2.0**63)},
        {"density": gr.SmoothedDensity(averaging_time=1e30)},
        {"dt": 1e-30},
    ],
)
def test_more_steps_than_the_core_counts_are_refused(change):
    scene = gr.scenes.column_collapse(cell=0.1, scheme=gr.Scheme(**change))
    with pytest.raises(
        ValueError, match=r"averaging_time = .* time steps, must be at most 1000000000"
    ):
        gr.Simulation(scene)

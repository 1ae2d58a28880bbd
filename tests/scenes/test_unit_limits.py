"""Scenes and settings that are refused or warned of before a run, and those that are not."""

import warnings

import numpy as np
import pytest
from scenes_by_hand import scene_with

import granular as gr
from granular import Box, Fill, Grid, Solid, Wall, scene_warnings
from granular.mpm.limits import COURANT_LIMIT, dt_limit

BEADS = gr.materials.glass_beads.replace(E=1e6)


def layer(**options):
    """Eight columns of the incline in the middle of the well-posed range: no warnings."""
    return gr.scenes.incline(**({"columns": 8, "cell": 0.01, "material": BEADS} | options))


def divided(wall, fill=(0.0, 1.0)):
    """A bed 0.3 m high with a wall at x = 0.5 m."""
    return scene_with(
        grid=Grid((0.0, 0.0), 0.02, (50, 25)),
        fills=(Fill(Box((fill[0], 0.0), (fill[1], 0.3)), 4, lithostatic=True),),
        material=BEADS,
        walls=(wall, Wall(1, 0.0), Wall(0, 0.0), Wall(0, 1.0)),
        duration=0.1,
    )


def test_walls_with_material_on_both_sides_are_warned_of():
    """Not those that hold it altogether, open, or have it on one side alone."""
    for options in (
        {"kind": "free_slip", "span": ((0.1, 0.5),)},
        {"kind": "coulomb", "friction": 0.3},
    ):
        wall = Wall(0, 0.5, **options)
        (warning,) = scene_warnings(divided(wall))
        assert warning.startswith("walls[0] has material on both sides")
        assert scene_warnings(divided(wall, fill=(0.5, 1.0))) == []
    for wall in (
        Wall(0, 0.5, kind="no_slip"),
        Wall(0, 0.5, kind="free_slip", opens_at=0.1),
        Wall(0, 0.5, kind="free_slip", span=((0.3, 0.5),)),
    ):
        assert scene_warnings(divided(wall)) == []


def test_material_above_an_end_of_the_grid_without_a_wall_is_warned_of():
    """It lies there flat and without stress, and the verdict has the only remedy that helps."""
    column, floor = gr.scenes.column_collapse(E=1e7), Wall(1, 0.0)
    lid = Wall(1, column.grid.upper[1])
    for walls in ((), (lid,), (Wall(0, 0.0),)):
        (told,) = scene_warnings(column.replace(walls=walls))
        assert told.startswith("fills[0] has no Wall, Solid or body below it")
        assert "Wall(1, 0)" in told
    blind = column.replace(walls=())
    assert blind.remedies["disconnected"] == "put a Wall below the material"
    leaving = gr.Grid(
        column.grid.lower, column.grid.cell, column.grid.shape, open_sides=frozenset({"y-"})
    )
    block, ground = Solid((0.0, 0.0), (0.1, 0.1)), gr.shapes.HalfSpace((0.0, 1.0))
    for change in (
        {"walls": (floor,)},
        {"walls": (block,), "fills": column.fills[:1]},
        {"walls": (), "grid": leaving},
        {"walls": (), "gravity": gr.Gravity((0.0,), ((0.0, 0.0),))},
        {"walls": (), "bodies": (gr.Body(ground, (0.5, 0.0)),)},
    ):
        assert not any("below it" in told for told in scene_warnings(column.replace(**change)))


def test_soft_grains_are_told_and_ready_scenes_take_an_e_of_their_load():
    """The density of a column 200 times too soft is 10 % off, its run-out 5 %."""
    column = gr.scenes.column_collapse()
    load = column.material.rho_c * 9.8 * 0.4
    for E, soft in ((load * 1000, False), (load * 100, False), (load * 57, True), (load * 5, True)):
        told = scene_warnings(gr.scenes.column_collapse(E=E))
        assert any("is too soft" in sentence for sentence in told) == soft, told
    drum = gr.scenes.rotating_drum
    assert drum().material.E == drum(radius=0.05).material.E == 1e6
    assert drum(radius=1.2, cell=0.05).material.E == pytest.approx(12e6)
    assert drum(radius=1.2, cell=0.05, E=1e6).material.E == 1e6
    assert drum(radius=1.2, cell=0.05, material=drum().material).material.E == 1e6
    heavy = column_of(height=200.0)
    assert heavy.material.E >= 1000 * heavy.material.rho_c * 9.8 * 200.0
    assert "times the pressure at the foot" in str(gr.economy.cost(heavy))


def column_of(height):
    return gr.scenes.silo(height=height, width=100.0, orifice=10.0, cell=1.0)


@pytest.mark.parametrize("name", gr.scenes.names("mpm"))
def test_scenes_as_they_are_raise_no_warnings(name):
    scene = gr.scenes.registry[name]()
    if name == "clogging_silo":  # the published scheme; half of its points are stress-free in flow
        (warning,) = scene_warnings(scene)
        assert warning.startswith("ParticleDensity()")
        scene = scene.replace(scheme=gr.Scheme())
    if name == "excavation":  # only the particle density separates the sides of its thin blade
        density, blade, soft = scene_warnings(scene)
        assert density.startswith("ParticleDensity()") and blade.startswith("bodies[0]")
        assert soft.startswith("E = 150000 Pa is too soft")  # that of its paper
        return
    if name == "excavator":  # sheets of two cells, which contain nodes
        sheets, soft = scene_warnings(scene)
        assert "is coupled to that" in sheets and soft.startswith("E = 150000 Pa is too soft")
        return
    assert scene_warnings(scene) == []
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        gr.Simulation(layer(), threads=1)


@pytest.mark.parametrize(
    "options",
    [
        {"angle_deg": 20.0},  # at rest a slope is never ill posed
        # one column is not two-dimensional
        {"columns": 1, "angle_deg": 31.0},
        {"columns": 1, "points_per_cell": 1},
        *(
            {"columns": 1, "angle_deg": angle, "scheme": gr.schemes.dunatunga_kamrin_2015}
            for angle in (19.0, 25.0, 34.0)
        ),
    ],
)
def test_what_is_not_warned_of(options):
    assert scene_warnings(layer(**options)) == []


def test_transfers_and_functions_that_are_warned_of_in_one_column():
    """A particle density alone gives no warning in one column."""
    for scheme in (gr.Scheme(transfer="apic"), gr.Scheme(basis="linear", transfer="xpic")):
        (warning,) = scene_warnings(layer(columns=1, scheme=scheme))
        assert scheme.transfer in warning and "has numerical damping per step" in warning
    assert scene_warnings(layer(columns=1, scheme=gr.Scheme(basis="linear", transfer="apic"))) == []
    # quadratic functions, where mu_2 is near mu_s, unless the scheme is left to the package
    options = {"columns": 1, "material": gr.NGF(E=1e6)}
    assert scene_warnings(layer(**options)) == []
    (warning,) = scene_warnings(layer(**options, scheme=gr.schemes.default))
    assert "nonlocal law of mu_2 = 0.6435" in warning and "take schemes.cell_averaged" in warning
    wide = gr.NGF(E=1e6, mu_2=1.5)
    assert scene_warnings(layer(columns=1, material=wide, scheme=gr.schemes.default)) == []


@pytest.mark.parametrize(
    ("options", "names"),
    [
        ({"scheme": gr.schemes.dunatunga_kamrin_2015.replace(dt=None)}, "ParticleDensity"),
        ({"scheme": gr.Scheme(transfer="apic")}, "ParticleDensity"),
        (
            {"scheme": gr.schemes.cell_averaged, "material": gr.materials.Elastic(E=1e6)},
            "is made for granular material",
        ),
        (
            {"scheme": gr.Scheme(basis="linear"), "material": gr.materials.Elastic(E=1e6)},
            'basis = "linear" with an elastic body',
        ),
        ({"points_per_cell": 1}, "points_per_cell = 1"),
        ({"height": 0.03}, "3 cells in height"),
        ({"angle_deg": 31.0}, "slope of 31 deg: .* from 21.7 to 30.1 deg"),
        ({"angle_deg": 21.3}, "slope of 21.3 deg"),
        ({"material": BEADS.replace(mu_2=0.4), "angle_deg": 21.3}, "well posed nowhere"),
        ({"material": BEADS.replace(nu=0.495)}, "nu = 0.495 exceeds"),
        (
            {"material": gr.materials.glass_beads_5mm.replace(E=1e6), "cell": 0.004},
            "cell = 0.004 is smaller than the grains",
        ),
    ],
)
def test_one_suspect_setting_is_one_warning(options, names):
    scene = layer(**options)
    assert len(scene_warnings(scene)) == 1
    with pytest.warns(gr.StabilityWarning, match=names) as caught:
        gr.Simulation(scene, threads=1)
    assert caught[0].filename == __file__


def test_cells_of_layers_and_of_grains_that_are_warned_of():
    # a layer on a slope is as high as it is thick
    assert scene_warnings(gr.scenes.landslide()) == []
    (warning,) = scene_warnings(gr.scenes.landslide(cell=0.04))
    assert "material of 2 cells in height" in warning
    # cells smaller than a grain are what a nonlocal law is for
    scene = gr.scenes.chute_ngf()
    assert scene.grid.cell < scene.material.d and scene_warnings(scene) == []
    local = scene.replace(material=scene.material.replace(A=0.0))
    (warning,) = scene_warnings(local)
    assert "cell = 0.001 is smaller than the grains, d = 0.005" in warning


def test_a_fluidity_of_no_length_that_responds_slowly_is_told():
    """Its waves take 0.01 s to cross the layer; with a length above a cell t0 is the law's own."""
    size = {"angle_deg": 20.0, "height": 0.1, "columns": 16, "cell": 0.0125}
    for changes, told in (
        ({"t0": 0.1}, "longer than a wave takes"),
        ({"t0": 1e-4}, "take t0 = 1e-06 or Fluidity(substeps=6)"),
        ({"t0": 1e-6}, ""),
        ({"t0": 0.1, "A": 50.0}, ""),
    ):
        soil = gr.materials.grc_1.replace(E=0.15e6, **changes)
        scene = gr.scenes.incline(material=soil, **size)
        warnings = [text for text in scene.known_failures() if text.startswith("t0 = ")]
        assert told in "".join(warnings) and len(warnings) == bool(told)
    late = gr.scenes.incline(material=gr.materials.grc_1.replace(E=0.15e6), **size)
    resolved = late.scheme.replace(fluidity=gr.Fluidity(substeps=6))
    assert not any("t0 = " in text for text in late.replace(scheme=resolved).known_failures())


@pytest.mark.parametrize(
    "size",
    [
        {"angle_deg": 28.0},
        {"angle_deg": 21.0},  # the local law is ill posed
        {"cell": 0.002, "height": 0.03},  # cells smaller than grains
        {"scheme": gr.schemes.default},
        {"scheme": gr.schemes.cell_averaged},
    ],
)
def test_a_nonlocal_law_of_no_length_is_taken_for_the_local_one(size):
    """Its scheme and its warnings go by the length A d in cells, not by whether A is 0."""
    size = {"angle_deg": 20.0, "height": 0.1, "columns": 16, "cell": 0.01} | size
    short, none, long = (
        gr.scenes.incline(material=gr.NGF(E=1e6, A=A, t0=1e-7), **size) for A in (1e-6, 0.0, 2.0)
    )
    assert short.scheme == none.scheme
    assert scene_warnings(short) == scene_warnings(none)
    same = (long.scheme, scene_warnings(long)) == (none.scheme, scene_warnings(none))
    assert same == (size.get("scheme") == gr.schemes.cell_averaged)


@pytest.mark.parametrize(
    ("basis", "dim", "limit"), [(b, d, v) for b, of in COURANT_LIMIT.items() for d, v in of.items()]
)
def test_cfl_beyond_the_limit_is_refused(small_scene, basis, dim, limit):
    assert gr.Scheme(basis=basis).cfl <= limit
    scene = small_scene("periodic", dim, (basis, "flip", "particle"), cfl=limit)
    gr.Simulation(scene, threads=1)
    with pytest.raises(ValueError, match=rf"cfl = .* must be <= {limit} .* {dim} dimensions"):
        gr.Simulation(scene.replace(scheme=scene.scheme.replace(cfl=1.01 * limit)))


def test_limits_are_those_of_a_single_point():
    """The limit is 2/sqrt(lambda_max) c/dx of one point between the nodes of a spline, in 1D.

    lambda_max = sum slope^2/weight; its first term is 2 wherever the point stands and the others
    tend to 4 at the border of a cell, so that the worst step is 2/sqrt(6).
    """
    s = np.linspace(0, 0.4999, 101)
    weight = np.array([(0.5 - s) ** 2 / 2, 0.75 - s * s, (0.5 + s) ** 2 / 2])
    slope = np.array([s - 0.5, -2 * s, s + 0.5])
    steps = 2 / np.sqrt(np.sum(slope**2 / weight, axis=0))
    assert steps.min() == pytest.approx(2 / np.sqrt(6), rel=1e-3)
    for dim, limit in COURANT_LIMIT["quadratic"].items():
        # That point strains equally along every axis: 1 + (dim - 1) nu/(1 - nu) times as stiff.
        corner = steps.min() / np.sqrt(1 + (dim - 1) * 0.3 / 0.7)
        assert 0.9 * corner < limit < corner


def test_a_fixed_step_must_suit_the_speed_at_the_start():
    """Moving material crosses a cell sooner: its speed is added to that of waves."""
    material = gr.materials.MuI(E=1e4)
    scene = scene_with(
        grid=Grid((0.0, 0.0), 0.1, (8, 8)),
        fills=(Fill(Box((0.1, 0.1), (0.6, 0.6)), 4, velocity=(3.0, 0.0)),),
        material=material,
        scheme=gr.schemes.default,
        walls=(Wall(1, 0.0, kind="no_slip"),),
    )
    step = 0.99 * dt_limit(scene)  # stable at rest
    with pytest.raises(ValueError, match=r"dt = .* points or bodies of 3 m/s"):
        gr.Simulation(scene.replace(scheme=gr.Scheme(dt=step)))
    c = material.wave_speed
    gr.Simulation(scene.replace(scheme=gr.Scheme(dt=step * c / (c + 3.0))), threads=1)


def test_a_resumed_run_is_not_warned_of_again(tmp_path):
    scene = layer(points_per_cell=1)
    with pytest.warns(gr.StabilityWarning):
        gr.Simulation(scene, threads=1).run(until=1e-3, save=tmp_path / "a.h5")
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        gr.Simulation.resume(tmp_path / "a.h5", threads=1)


def test_several_fills():
    """Several fills are told what one fill is."""
    halves = (Box((0.0, 0.0), (0.2, 0.3)), Box((0.3, 0.0), (0.5, 0.3)))
    block = gr.Elastic(E=1e6, nu=0.3)

    def scene(scheme, count=4, material=None):
        return scene_with(
            grid=Grid((0.0, 0.0), 0.05, (10, 10)),
            fills=(Fill(halves[0], 4), Fill(halves[1], count, material=material)),
            material=BEADS,
            scheme=scheme,
            walls=(Wall(1, 0.0),),
        )

    linear = gr.Scheme(basis="linear", transfer="flip", density=gr.ParticleDensity())
    assert any("with an elastic body" in told for told in scene_warnings(scene(linear, 4, block)))
    assert not any("with an elastic body" in told for told in scene_warnings(scene(linear)))
    with pytest.raises(ValueError, match=r"points_per_cell = \[4, 9\] must be one number"):
        scene(linear.replace(basis="ugimp"), 9)

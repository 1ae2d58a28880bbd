"""Scene functions: mass, walls and openings against values by hand."""

import inspect
import math
import re
import warnings

import numpy as np
import pytest
from scenes_by_hand import mass

import granular as gr
from granular import Scene, Solid, SpongeLayer, materials, scenes, schemes
from granular.mpm.axis_nodes import c0_lines, node_positions
from granular.mpm.engine import initial_points
from granular.mpm.node_codes import node_codes


def fixed_along_y(scene, y, time=0.0):
    """x [m] of the nodes at height y, and a mask of those fixed vertically at `time`."""
    codes, rows = node_codes(scene)
    codes = codes.dense()
    grid, basis = scene.grid, scene.scheme.basis
    xs, ys = (
        node_positions(basis, n, per, c0_lines(grid, scene.walls, axis)) * grid.cell
        for axis, (n, per) in enumerate(zip(grid.shape, grid.periodic, strict=True))
    )
    held = []
    for code in codes[np.argmin(abs(ys - y))]:
        while code and rows[code - 1].opens_at <= time:
            code = rows[code - 1].after
        held.append(bool(code and rows[code - 1].fixed & 2))
    return xs, np.array(held)


COARSE = {
    "couette": {"cell": 0.025, "height": 0.05},
    "cylinder_collapse": {"cell": 0.05},
    "excavation": {"cell": 0.025},
    "excavator": {"cell": 0.025},
    "sphere_drop": {"cell": 0.008},
}
"""Coarse cells for scenes that have very many by default."""

MPM = (
    *("chute_fed", "chute_ngf", "clogging_silo", "cohesive_cliff", "column_collapse", "conveyor"),
    *("conveyor_heap", "couette"),
    *("cylinder_collapse", "excavation", "excavator", "flexible_barrier", "footing", "hopper"),
    "hourglass",
    *("incline", "landslide", "obstacle", "penetration", "retaining_wall", "rolling_wheel"),
    "rotating_drum",
    *("settling_bed", "silo", "silo_3d", "silo_fed", "slope", "slug", "sphere_drop"),
    *("tumbling_block", "wheel"),
)
FED = ("chute_fed", "conveyor_heap")
"""Scenes without a fill that could have jitter."""

SPH = (
    *("column_collapse", "column_collapse_sph", "fluidised_bed", "incline_sph"),
    *("inclined_collapse", "jet_on_bed", "slump_sph"),
)


def test_registry_holds_keyword_only_functions_of_both_methods():
    assert scenes.names("mpm") == MPM and scenes.names("sph") == SPH
    assert scenes.names() == tuple(sorted({*MPM, *SPH})) == tuple(scenes.registry)
    assert scenes.registry["column_collapse"].methods == ("mpm", "sph")
    for name, function in scenes.registry.items():
        assert getattr(scenes, name) is function and function.__name__ == name
        *own, numbers = inspect.signature(function).parameters.values()
        assert all(p.kind is p.KEYWORD_ONLY and p.default is not p.empty for p in own)
        assert numbers.kind is numbers.VAR_KEYWORD and "material" in {p.name for p in own}
        if "mpm" in function.methods:
            wanted = {"scheme", "seed"} if name in FED else {"scheme", "seed", "jitter"}
            assert wanted <= {p.name for p in own}
    with pytest.raises(ValueError, match="method = 'dem' must be one of 'mpm', 'sph'"):
        scenes.names("dem")


PARTS = ("duration", "material", "method", "numerics", "scheme", "seed")
DERIVED = {
    "chute_ngf": {"columns_across": 0},
    "column_collapse": {"cell": 0.0125, "lip": pytest.approx(142 * 0.0125), "half": True},
    "cylinder_collapse": {"lip": pytest.approx(24 * 0.025), "quarter": True},
    "footing": {"half": True},
    "hopper": {"half": True},
    "hourglass": {"width": 1.0, "half": True},
    "rotating_drum": {"froude": pytest.approx(0.1 / 5.0)},
    "silo": {"half": True},
    "silo_fed": {"half": True},
    "slug": {"wall_at": pytest.approx(91 * 0.0083)},
    "column_collapse_sph": {
        **{"half_width": pytest.approx(0.09), "half": True, "reach": pytest.approx(0.91)},
        "duration": pytest.approx(1.5 + 8.0 * math.sqrt(0.18 / 9.81)),
    },
    "excavation": {"symmetry": "y"},
    "excavator": {"symmetry": "y"},
    "fluidised_bed": {"duration": 0.3},
    "incline_sph": {"duration": 3.0},
    "inclined_collapse": {"half_width": pytest.approx(0.2), "duration": 1.5},
    "jet_on_bed": {"duration": 0.075},
    "settling_bed": {"duration": pytest.approx(0.609343, rel=1e-5)},
    "slump_sph": {"duration": 6.0},
}
"""Parameters that a scene chooses, rounds or adds, by hand."""


@pytest.mark.parametrize("name", scenes.names())
def test_parameters_are_the_arguments_and_what_the_scene_derives(name):
    arguments = inspect.signature(scenes.registry[name]).parameters
    expected = {
        key: argument.default
        for key, argument in arguments.items()
        if key not in (*PARTS, "material_numbers")
    }
    given = {"gravity": 5.0, **COARSE.get(name, {})}
    scene = scenes.registry[name](**given)
    if name == "column_collapse_sph":
        given["duration"] = pytest.approx(1.5 + 8.0 * math.sqrt(0.18 / 5.0))
    assert dict(scene.parameters) == expected | DERIVED.get(name, {}) | given


@pytest.mark.parametrize("name", scenes.names())
def test_numbers_of_the_material_are_keywords(name):
    function, coarse = scenes.registry[name], COARSE.get(name, {})
    default = inspect.signature(function).parameters["material"].default
    scene = function(nu=0.2, **coarse)
    assert scene == function(material=default.replace(nu=0.2), **coarse)
    assert scene.material == function(**coarse).material.replace(nu=0.2)
    assert scene.material.nu == 0.2 and "nu" not in scene.parameters
    with pytest.raises(TypeError, match=rf"{name}\(\) has no keyword 'youngs'.* gravity,.* nu,"):
        function(youngs=1e7)
    with pytest.raises(ValueError, match=r"nu = 0\.7"):
        function(nu=0.7)
    with pytest.raises(TypeError, match="material = 'sand' must be a Material or"):
        function(nu=0.2, material="sand")


def test_keywords_of_the_scene_come_before_those_of_its_material():
    """And scenes derive from the changed material."""
    flat = scenes.couette(pressure=1000.0, E=1e5, nu=0.25)
    assert flat.fills[0].density == pytest.approx(0.645 * 2550.0 * math.exp(1000.0 / (1e5 / 1.5)))
    half_weight = 0.5 * 1500.0 * 9.8 * 0.4
    soft = materials.glass_beads.replace(E=1e7, mu_s=0.4)
    column = scenes.column_collapse(method="sph", E=1e7, mu_s=0.4)
    assert column.material == gr.sph.Viscoplastic.matching(soft, half_weight)
    with pytest.raises(TypeError, match=r"'kappa'.* its material, MuI, are E, nu"):
        scenes.column_collapse(method="sph", kappa=1e6)
    stiff = scenes.column_collapse(method="sph", material=gr.sph.grit, kappa=1e6)
    assert stiff.material == gr.sph.grit.replace(kappa=1e6)
    small = scenes.silo(I0=0.3, d=1e-3).material  # in place of xi
    assert small.xi == pytest.approx(0.3 / (1e-3 * math.sqrt(2450.0)))
    silo = scenes.clogging_silo(A=0.3, E=2e6)
    assert silo.parameters["A"] == silo.material.A == 0.3 and silo.material.E == 2e6
    slump = scenes.slump_sph(dilation=0.2, nu=0.3)
    assert slump.parameters["dilation"] == slump.material.dilation == 0.2
    with pytest.raises(ValueError, match=r"d = 0\.05 must not be given: clogging_silo sets it"):
        scenes.clogging_silo(d=0.05)
    with pytest.raises(ValueError, match=r"mu_l = 0\.3 must not be given: slump_sph sets it"):
        scenes.slump_sph(mu_l=0.3)


NONLOCAL = ("chute_ngf", "clogging_silo", "silo_3d", "couette", "excavation", "wheel", "excavator")
SOFT = (
    *("conveyor", "flexible_barrier", "hopper", "landslide", "obstacle", "penetration"),
    *("rotating_drum", "chute_fed", "cohesive_cliff", "conveyor_heap", "silo_fed"),
    *("footing", "retaining_wall", "slope"),
    *("settling_bed", "sphere_drop", "rolling_wheel", "tumbling_block"),
)
"""Scenes of `glass_beads` with another E, or of another material."""


@pytest.mark.parametrize("basis", ["ugimp", "quadratic"])
@pytest.mark.parametrize("name", scenes.names("mpm"))
def test_every_scene_is_whole(name, basis):
    make = scenes.registry[name]
    if name in NONLOCAL and basis == "ugimp":
        with pytest.raises(ValueError, match='"ugimp" must be "linear" or "quadratic"'):
            make(scheme=schemes.Scheme(basis=basis))
        return
    coarse = COARSE.get(name, {})
    if "jitter" in inspect.signature(make).parameters:
        coarse = coarse | {"jitter": 0.5}
    scene = make(scheme=schemes.Scheme(basis=basis), seed=7, **coarse)
    assert Scene.from_json(scene.to_json()) == scene
    grains = inspect.signature(make).parameters["material"].default
    assert (grains is materials.glass_beads) == (name not in (*NONLOCAL, *SOFT))
    if name == "clogging_silo":
        grains = grains.replace(A=1.0, d=0.14)
    assert scene.material == grains and scene.seed == 7
    assert len(scene.points().x) == scene.n_points
    codes, rows = node_codes(scene)
    assert codes.values.max() == len(rows) or any(row.after for row in rows)
    # the arguments of the scene function build the same scene again
    known = inspect.signature(make).parameters
    called = {key: value for key, value in scene.parameters.items() if key in known}
    assert make(**called, scheme=scene.scheme, seed=7) == scene


@pytest.mark.parametrize(("aspect", "cell"), [(0.5, 0.00625), (1.0, 0.0125), (2.0, 0.0125)])
def test_column(aspect, cell):
    scene = scenes.column_collapse(aspect=aspect)
    assert scene.grid.cell == cell and scene.duration == 2.0
    assert mass(scene) == pytest.approx(1500 * 0.2 * 0.2 * aspect)
    assert scene.n_points == round(0.04 * aspect / cell**2) * 16
    assert scene.gravity.at(0.05).tolist() == [0, -4.9]
    assert scene.gravity.at(2.0).tolist() == [0, -9.8]
    floor, plane, lip = scene.walls
    assert (floor.axis, floor.at, floor.kind) == (1, 0.0, "no_slip")
    assert (plane.axis, plane.at, plane.kind) == (0, 0.0, "free_slip")
    # space for the run-outs measured with the published scheme
    assert lip.at / 0.2 - 1 > {0.5: 0.88, 1.0: 2.31, 2.0: 4.62}[aspect]


def test_column_of_odd_height_is_rounded_to_rows():
    scene = scenes.column_collapse(aspect=0.77)
    spacing = 0.0125 / 4
    assert abs(mass(scene) / (1500 * 0.2) - 0.77 * 0.2) <= spacing / 2


@pytest.mark.parametrize("D", [0.06, 0.1, 0.2])
def test_silo_opening_by_the_papers_definition(D):
    """In the whole silo, the free nodes of a linear basis run from -D/2 to D/2."""
    scene = scenes.silo(orifice=D, scheme=schemes.dunatunga_kamrin_2015)
    x, held = fixed_along_y(scene, 0.0, time=0.2)
    whole = np.concatenate([-x[~held], x[~held]])
    assert whole.max() - whole.min() == pytest.approx(D, abs=1e-12)
    assert held[x > D / 2 + 1e-9].all()
    lid = scene.walls[1]
    assert lid.opens_at == 0.1 and lid.span == ((0.0, scene.walls[0].span[0][0]),)
    _, closed = fixed_along_y(scene, 0.0, time=0.0999)
    assert closed.all()


def test_silo_mass_sides_bases_and_definition():
    x, held = fixed_along_y(scenes.silo(orifice=0.1), 0.0, time=0.2)
    assert x[held].min() == pytest.approx(0.06)  # quadratic: a node lies on the edge itself
    x, held = fixed_along_y(scenes.silo(orifice=0.1, edge="wall"), 0.0, time=0.2)
    assert x[held].min() == pytest.approx(0.05)
    scene = scenes.silo()
    assert 2 * mass(scene) == pytest.approx(1500.0)
    assert scene.parameters["half"] is True and scene.parameters["orifice"] == 0.1
    assert scene.grid.open_sides == {"y-"} and scene.duration == 40.0
    assert {(w.axis, w.at, w.kind) for w in scene.walls[2:]} == {
        (0, 0.0, "free_slip"),
        (0, 0.5, "free_slip"),
    }


def test_flat_hourglass():
    scene = scenes.hourglass()
    assert mass(scene) == pytest.approx(1500 * 0.5 * 0.25)
    x, held = fixed_along_y(scene, 0.5, time=0.05)
    assert held[x <= 0.5].all() and not held[x > 0.5 + 1e-9].any()
    x, held = fixed_along_y(scene.replace(scheme=schemes.dunatunga_kamrin_2015), 0.5, time=0.2)
    assert x[~held & (x < 0.4)].max() == pytest.approx(0.02)
    assert scene.points().x[:, 1].min() > 0.5
    # no side wall below the divider, and a floor that holds a heap of all the material at repose
    assert scene.grid.open_sides == {"x+"}
    assert scene.grid.upper[0] > math.sqrt(2 * 0.5 * 0.25 / 0.3819)


def test_sloped_hourglass():
    scene = scenes.hourglass(kind="sloped", scheme=schemes.dunatunga_kamrin_2015)
    blocks = [wall for wall in scene.walls if isinstance(wall, Solid)]
    # the edges of the steps lie on a line of 45 deg from the end of the divider at 0.03
    assert len(blocks) == 21
    for block in blocks:
        assert block.upper[1] - 0.5 == pytest.approx(block.lower[0] - 0.03, abs=1e-12)
        assert block.upper[0] == 0.25
    # the fill: a box of 0.25 x 0.25 less the steps (22 columns of 0, 1, ..., 21 cells)
    area = 0.25**2 - 0.01**2 * sum(range(22))
    assert mass(scene) == pytest.approx(1500 * area)
    x, held = fixed_along_y(scene, 0.6)
    slope = 0.03 + 0.1
    assert held[x > slope - 1e-9].all() and not held[x < slope - 1e-9].any()
    codes, rows = node_codes(scene)
    assert rows[codes.dense()[10, -1] - 1].fixed & 1  # the side wall reaches down to the base
    steep = scenes.hourglass(kind="sloped", slope_deg=60.0)
    assert mass(steep) < mass(scene) < mass(scenes.hourglass(kind="sloped", slope_deg=20.0))


def test_hopper():
    """Half a plane hopper and a quarter of a conical one: what the walls leave of the fill."""
    rise = 0.2 / math.tan(math.radians(30))
    flat = scenes.hopper()
    section = (0.05 + 0.25) / 2 * rise + 0.25 * (0.6 - rise)
    assert flat.points().volume.sum() == pytest.approx(section, rel=2e-3)
    cone = scenes.hopper(dim=3, cell=0.025)
    volume = rise / 3 * (0.05**2 + 0.05 * 0.25 + 0.25**2) + 0.25**2 * (0.6 - rise)
    assert cone.points().volume.sum() == pytest.approx(math.pi / 4 * volume, rel=5e-3)
    for scene, side in ((flat, "y-"), (cone, "z-")):
        assert scene.grid.open_sides == {side} and scene.grid.lower[-1] == -4 * scene.grid.cell
        assert [w.opens_at for w in scene.walls[scene.dim - 1 :]] == [0.1]
        x = np.zeros((2, scene.dim))
        x[:, 0], x[:, -1] = (0.1, 0.24), (0.1, 0.5)
        gaps = np.array([body.distance(x)[0] for body in scene.bodies]).min(axis=0)
        inclined = 0.1 * math.sin(math.radians(30)) - 0.05 * math.cos(math.radians(30))
        assert gaps == pytest.approx([inclined, 0.01])
    history = gr.measure.mass_history([gr.Simulation(cone).state])
    assert history.share == 0.25
    assert history.mass[0] == pytest.approx(1500.0 * math.pi * volume, rel=0.01)
    assert not scenes.hopper(ramp=0.1).fills[0].lithostatic and flat.fills[0].lithostatic


@pytest.mark.parametrize("fraction", [0.2, 0.7])
def test_rotating_drum(fraction):
    flat = scenes.rotating_drum(fill_fraction=fraction)
    assert flat.points().volume.sum() == pytest.approx(fraction * math.pi * 0.01, rel=1e-3)
    slice_ = scenes.rotating_drum(fill_fraction=fraction, width=0.02, cell=0.01)
    assert slice_.grid.periodic == (False, True, False)
    volume = fraction * math.pi * 0.01 * 0.02
    assert slice_.points().volume.sum() == pytest.approx(volume, rel=5e-3)
    (drum,) = slice_.bodies
    # at larger x it moves up, as in 2D
    assert np.cross(drum.motion.angular_velocity[0], (0.1, 0.0, 0.0))[2] > 0
    assert flat.bodies[0].motion.angular_velocity == (1.0,)
    assert drum.contact == "separating" and not drum.rough
    held = scenes.rotating_drum(friction=None).bodies[0]
    assert held.contact == "sticky" and held.rough
    smooth = scenes.rotating_drum(friction=0.3).bodies[0]
    assert (smooth.contact, smooth.friction, smooth.rough) == ("separating", 0.3, False)


def test_incline_in_2d_and_3d():
    scene = scenes.incline(angle_deg=25.0, columns=4, jitter=0.3)
    assert scene.grid.periodic == (True, False)
    assert scene.grid.shape == (4, 48) and scene.grid.cell == 0.005
    assert mass(scene) == pytest.approx(1500 * 0.2 * 0.02)
    g = scene.gravity.at(1.0)
    assert math.hypot(*g) == pytest.approx(9.8)
    assert g[0] / -g[1] == pytest.approx(math.tan(math.radians(25)))
    assert scene.walls[0].kind == "no_slip"
    scene = scenes.incline(columns=4, columns_across=3, height=0.1, cell=0.01, points_per_cell=8)
    assert scene.grid.periodic == (True, True, False) and scene.grid.shape == (4, 3, 18)
    assert mass(scene) == pytest.approx(1500 * 0.1 * 0.04 * 0.03)
    assert len(scene.points().x) == 8 * 4 * 3 * 10
    g = scene.gravity.at(1.0)
    assert g[1] == 0.0 and g[0] / -g[2] == pytest.approx(math.tan(math.radians(25)))
    assert scene.walls[0].axis == 2
    with pytest.raises(ValueError, match="columns_across"):
        scenes.incline(columns_across=-1)


def test_chute_of_the_paper():
    """Section 6: cells of 1 mm, 16 points, 2 grains of 5 mm high, one column, at rest."""
    scene = scenes.chute_ngf()
    grains = scene.material
    assert (grains.A, grains.d, grains.t0) == (0.25, 0.005, 1e-3)
    assert (grains.mu_s, grains.mu_2, grains.rho_s) == (0.3819, 1.5, 2450.0)
    assert scene.grid.shape == (1, 14) and scene.grid.cell == 0.001
    assert scene.grid.periodic == (True, False) and scene.fills[0].points_per_cell == 16
    assert mass(scene) == pytest.approx(1500 * 0.001 * 0.01)
    g = scene.gravity.at(1.0)
    assert g[0] / -g[1] == pytest.approx(math.tan(math.radians(27)))
    assert math.hypot(*g) == pytest.approx(9.81)
    assert scenes.chute_ngf(columns=3).grid.shape[0] == 3


@pytest.mark.parametrize("half", [True, False])
def test_clogging_silo_of_the_paper(half):
    """Section 7: an opening between fixed nodes, no-slip floor beside it, lithostatic pressure."""
    scene = scenes.clogging_silo(half=half, opening_over_d=2.0)
    assert scene.fills[0].lithostatic and scene.fills[0].K0 == 1.0
    assert scene.material.d == 0.07 and scene.material.A == 1.0
    assert (scene.material.mu_2, scene.material.b) == (50.0, 1.0)
    assert scene.scheme.dt == 1e-4 and scene.duration == 1.5
    x, held = fixed_along_y(scene, 0.0)
    x = x + scene.grid.lower[0]
    assert held[abs(x) > 0.07 - 1e-9].all() and not held[abs(x) < 0.07 - 1e-9].any()
    assert x.min() == pytest.approx(0.0 if half else -0.2975) and x.max() == pytest.approx(0.2975)
    K, H = scene.material.K, 0.595
    column = -K * np.log1p(-1500 * 9.81 * H / K) / 9.81  # mass per square metre
    start = initial_points(scene)
    assert start["mass"].sum() == pytest.approx((0.2975 if half else 0.595) * column, rel=1e-7)
    assert scene.sponge_layers == (SpongeLayer(1, 0.49, 1000.0),)
    assert scene.grid.open_sides == {"y-"}
    assert scenes.clogging_silo(sponge=None).sponge_layers == ()


def test_a_silo_that_cannot_jam_is_warned_of():
    beads = materials.silo_grains.replace(mu_2=0.9)
    with pytest.warns(gr.StabilityWarning, match=r"mu_2 = 0.9 is below 1: .* cannot jam") as said:
        scenes.clogging_silo(material=beads)
    assert said[0].filename == __file__  # the line that called the scene
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        scenes.clogging_silo()
        scenes.clogging_silo(material=beads.replace(mu_2=1.0))


def test_slug_flies_freely_from_the_start():
    scene = scenes.slug()
    points = scene.points()
    assert mass(scene) == pytest.approx(1200 * math.pi * 0.15**2, rel=5e-3)
    assert (points.v == (1.2, 3.0)).all() and (points.density == 1200.0).all()
    assert scene.gravity.at(0.0).tolist() == [0, -9.8]
    # it meets the wall in the air: the lowest point is above the floor by then
    hit = (scene.walls[2].at - points.x[:, 0].max()) / 1.2
    low = points.x[:, 1].min() + 3.0 * hit - 4.9 * hit**2
    assert 0.3 < hit < 0.4 and low > 0.4
    assert points.x[:, 1].max() + 3.0**2 / 19.6 < scene.grid.upper[1]


def test_cylinder():
    scene = scenes.cylinder_collapse()
    assert scene.dim == 3
    assert 4 * mass(scene) == pytest.approx(1500 * math.pi * 0.2**2 * 0.1, rel=5e-3)
    assert np.hypot(*scene.points().x[:, :2].T).max() < 0.2
    codes, rows = node_codes(scene)
    fixed = np.array([0, *(row.fixed for row in rows)])[codes.dense()]
    assert (fixed[0] == 7).all()
    assert fixed[3, 5, 0] == 1 and fixed[3, 0, 5] == 2 and fixed[3, 0, 0] == 3


def test_material_scheme_and_ramp_are_passed_on():
    soft = materials.glass_beads.replace(E=1e7)
    scene = scenes.silo(material=soft, scheme=schemes.dunatunga_kamrin_2015, ramp=0.5, seed=5)
    assert scene.material is soft and scene.seed == 5
    assert scene.scheme is schemes.dunatunga_kamrin_2015
    assert scene.gravity.at(0.25).tolist() == [0.0, -4.9]
    assert scenes.silo(ramp=0.0).gravity.at(0.0).tolist() == [0.0, -9.8]


@pytest.mark.parametrize("name", scenes.names())
def test_docstrings_describe_each_argument_once(name):
    doc = inspect.getdoc(scenes.registry[name])
    arguments = doc.partition("\nParameters\n")[2].partition("\nRaises\n")[0]
    heads = re.findall(r"^\**(\w[\w, ]*?)(?: :.*)?$", arguments, re.MULTILINE)
    described = ", ".join(heads).split(", ")
    assert sorted(described) == sorted(inspect.signature(scenes.registry[name]).parameters)


def test_a_wheel_with_grousers_needs_no_thickness():
    """They are at least three cells thick: thinner ones would couple the soil on both sides."""
    scene = gr.scenes.wheel(grousers=10, grouser_height=0.025, start=0.3)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert gr.Simulation(scene).n_points > 0

"""Suggestions of cheaper scenes: each topic, refused input, and nothing changed unasked."""

import math
from dataclasses import replace

import numpy as np
import pytest
from economy_scenes import full_silo, item
from scenes_by_hand import scene_with
from schemes_by_name import scheme_of

import granular as gr
from granular import DruckerPrager, Elastic, Wall
from granular.economy import bias, pace
from granular.economy.suggestion import rebuilt
from granular.materials import glass_beads, glass_beads_5mm
from granular.mpm.limits import check_time_step, damps_by_step
from granular.mpm.schemes import BASES, TRANSFERS
from granular.run.memory import MARGIN

PAPER = [
    gr.scenes.incline(),
    gr.scenes.incline(angle_deg=21.0),
    gr.scenes.incline(angle_deg=34.0),
    gr.scenes.column_collapse(aspect=0.5),
    gr.scenes.column_collapse(aspect=2.0),
    gr.scenes.silo(),
    gr.scenes.hourglass(kind="flat"),
    gr.scenes.hourglass(kind="sloped"),
    gr.scenes.slug(),
]
PUBLISHED = [scene.replace(scheme=gr.schemes.dunatunga_kamrin_2015) for scene in PAPER]


@pytest.mark.parametrize("tolerance", [0.005, 0.1])
@pytest.mark.parametrize("scene", PAPER + PUBLISHED, ids=lambda s: f"{s.name}-{s.scheme.basis}")
def test_suggestions_stay_within_the_tolerance(scene, tolerance):
    before = scene.to_json()
    suggestion = gr.economy.suggest(scene, tolerance)
    topics = "dimension, basis, resolution, stiffness, time step, rate, grains, fields"
    assert ", ".join(item.topic for item in suggestion) == topics
    assert suggestion.error <= tolerance * (1 + 1e-12)
    assert all(item.reason.endswith(".") and item.saving >= 1 for item in suggestion)
    cheaper = gr.economy.apply(scene, suggestion)
    assert scene.to_json() == before
    spared = gr.economy.cost(scene).seconds / gr.economy.cost(cheaper).seconds
    assert spared == pytest.approx(suggestion.saving, rel=1e-6)
    # Asking again for a scene that was already made cheaper suggests nothing more.
    again = gr.economy.suggest(cheaper, 1e-6)
    assert gr.economy.apply(cheaper, again) == cheaper


@pytest.mark.parametrize("scene", PAPER + PUBLISHED, ids=lambda s: f"{s.name}-{s.scheme.basis}")
def test_two_per_cent_spare_nine_tenths(scene):
    """A tolerance of 2 % saves nine tenths for E = 1 GPa, and for the paper's dt = 3e-6 s."""
    suggestion = gr.economy.suggest(scene, 0.02)
    refused = {
        ("slug", "linear"): "not been measured",  # its final place drifts with E, without end
        ("slug", "quadratic"): "should agree",  # its centre is, to 3 %
        ("silo", "linear"): "should agree",  # its rate is, to 3 %
        ("hourglass_flat", "linear"): "should agree",  # its rate is, to 3 %
        ("hourglass_sloped", "linear"): "should agree",
        ("column_collapse", "linear"): "should agree",  # its run-out is chance,
        ("column_collapse", "quadratic"): "should agree",  # to 2.5 %
    }.get((scene.name, scene.scheme.basis))
    if scene == PAPER[3]:
        refused = "not been measured"  # low and stiff: damped by the cells
    if refused:
        assert refused in suggestion.about("stiffness").reason
        assert suggestion.about("stiffness").changes == {}
        if scene != PAPER[3] and scene.name != "slug":
            assert gr.economy.suggest(scene, 0.15).saving >= 10
    else:
        assert suggestion.saving >= 10


def test_a_silo_a_seventh_off_is_not_suggested():
    """E = 1e5 Pa changes the rate of the published scheme by 14 %, beyond the tolerance."""
    for scheme in (gr.schemes.dunatunga_kamrin_2015, gr.schemes.default):
        scene = gr.scenes.silo(orifice=0.2, scheme=scheme)
        for tolerance in (0.015, 0.05):
            found = item("stiffness", scene, tolerance)
            assert found.changes.get("E", 1e9) > 1e5
        soft = gr.scenes.silo(material=glass_beads.replace(E=1e5), scheme=scheme)
        found = item("stiffness", soft, 0.02)
        assert not found.changes and found.error > 0.02
    assert "too soft for this tolerance" in found.reason
    # Stiff runs differ from one another by 1.5 %: a smaller error is not promised.
    found = item("stiffness", gr.scenes.silo(), 0.01)
    assert not found.changes and "should agree" in found.reason
    assert item("stiffness", PUBLISHED[5], 0.13).changes["E"] > 1e5


def test_pressure_strain_by_hand():
    """rho g H/K is 1500 9.8 1 m over 1 GPa/1.2; the same for a silo twice as high and as stiff."""
    scene = gr.scenes.silo()
    assert bias.pressure_strain(scene) == pytest.approx(1500 * 9.8 / (1e9 / 1.2))
    tall = gr.scenes.silo(height=2.0, material=glass_beads.replace(E=2e9))
    assert bias.pressure_strain(tall) == pytest.approx(bias.pressure_strain(scene))
    asked = [item("stiffness", s, 0.02).changes["E"] for s in (scene, tall)]
    assert asked[1] == pytest.approx(2 * asked[0], rel=0.05)


def test_soft_layer_loses_friction_as_the_closed_form_says():
    """The loss is mu tau/G at the base, 5/7 of it for the mean velocity, times d ln v/d ln mu."""
    scene = gr.scenes.incline(angle_deg=25.0, duration=200.0)
    grains = glass_beads.replace(E=1e6)
    t = math.tan(math.radians(25))
    tau = 1500 * 9.8 * math.sin(math.radians(25)) * 0.2
    assert bias.friction_shift(scene, grains) == pytest.approx(5 / 7 * t * tau / grains.G)
    gain = bias.incline_flow(scene, weaker=1e-4) / bias.incline_flow(scene) - 1
    closed = grains.mu_s / (t - grains.mu_s) + grains.mu_2 / (grains.mu_2 - t)
    assert gain / 1e-4 == pytest.approx(closed, rel=5e-3)
    # The design study measured 0.7 % at 25 degrees, 1.8 % at 30, E = 1e6, steady.
    for angle, measured in ((25.0, 0.007), (30.0, 0.018)):
        scene = gr.scenes.incline(angle_deg=angle, duration=200.0)
        assert 0.8 * measured < bias.incline_error(scene, grains) < 2 * measured


def test_near_the_threshold_grains_must_be_stiff():
    scenes = [gr.scenes.incline(angle_deg=angle) for angle in (21.0, 22.0, 25.0)]
    E = [item("stiffness", scene, 0.02).changes.get("E", 1e9) for scene in scenes]
    assert E[0] > 10 * E[1] > 50 * E[2]
    flat = item("stiffness", gr.scenes.incline(angle_deg=19.0), 0.02)
    assert not flat.changes and math.isnan(flat.error)


def test_dimension():
    many = gr.economy.suggest(gr.scenes.incline(columns=8), 0.05)
    assert many.about("dimension").changes == {"columns": 1}
    assert many.about("dimension").saving == pytest.approx(8, rel=0.2)  # and a fixed part
    assert not item("dimension", gr.scenes.incline(columns=8), 0.005).changes
    assert not item("dimension", gr.scenes.incline(), 0.05).changes
    for scene in (gr.scenes.silo(), gr.scenes.cylinder_collapse()):
        found = item("dimension", scene)
        assert not found.changes and "symmetry" in found.reason
    assert "cannot be halved" in item("dimension", gr.scenes.slug()).reason


def test_a_fixed_step_of_the_default_scheme_is_kept():
    """The step sets the time between two averagings of the density, and so affects the flow."""
    fixed = gr.schemes.default.replace(dt=3e-6)
    suggestion = gr.economy.suggest(gr.scenes.silo(scheme=fixed), 0.1)
    for topic in ("stiffness", "time step"):
        found = suggestion.about(topic)
        assert not found.changes and math.isnan(found.error)
    # One column is not affected: linear functions with an adaptive step serve as well.
    column = gr.scenes.incline(scheme=fixed)
    cheaper = gr.economy.apply(column, gr.economy.suggest(column, 0.02))
    assert cheaper.scheme.basis == "linear" and cheaper.scheme.dt is None


def test_a_damping_that_moves_the_run_out_is_not_softened_away():
    """In cells of 0.025 m the run-out at 1 GPa is 9 % less than at 1e7 Pa, by the grid damping."""
    coarse = gr.scenes.column_collapse(aspect=1.0, cell=0.025)
    found = item("stiffness", coarse, 0.1)
    assert not found.changes and math.isnan(found.error)
    # 0.03 of 947 m/s and a cell of 0.025 m, against a fall through 0.2 m.
    assert bias.grid_damping(coarse) == pytest.approx(0.03 * 947.3 * 0.025 / (0.2 * 1.4), rel=1e-3)


def test_basis_and_resolution_only_where_they_converge():
    assert not item("basis", gr.scenes.column_collapse(), 0.5).changes
    assert not item("basis", gr.scenes.incline(columns=8), 0.005).changes
    one = item("basis", gr.scenes.incline(), 0.02)
    assert one.changes["basis"] == "linear"
    assert "fail in" in item("basis", PUBLISHED[5], 0.02).reason
    found = item("resolution", gr.scenes.incline(), 0.02)
    assert 0.2 / found.changes["cell"] == pytest.approx(round(0.2 / found.changes["cell"]))
    assert found.error <= 0.005
    fine = item("resolution", gr.scenes.incline(), 0.004)
    assert fine.changes["cell"] < found.changes["cell"]
    assert not item("resolution", gr.scenes.silo(), 0.5).changes


def test_time_step():
    found = item("time step", PUBLISHED[4], 0.02)
    assert found.changes == {"dt": None}
    assert not item("time step", PAPER[4], 0.02).changes
    coarse = gr.schemes.dunatunga_kamrin_2015.replace(dt=6e-6)
    scene = gr.scenes.column_collapse(scheme=coarse, material=glass_beads.replace(E=1.3e9))
    kept = item("time step", scene, 1e-9)
    assert not kept.changes
    # An adaptive step that a simulation would refuse is not suggested.
    quick = gr.scenes.silo(scheme=gr.schemes.dunatunga_kamrin_2015.replace(cfl=0.9))
    assert "beyond its limit" in item("time step", quick, 0.2).reason
    with pytest.raises(ValueError, match="cfl"):
        gr.economy.suggest(quick.replace(scheme=quick.scheme.replace(dt=None)))


def test_rate():
    for scene in PAPER:
        assert not item("rate", scene, 0.02).changes
    found = item("rate", PAPER[4], 0.02)
    assert found.error > 0.02 and "It matters" in found.reason
    hill = gr.scenes.column_collapse(half_width=200.0, cell=12.5)
    found = item("rate", hill, 0.02)
    assert found.error < 0.02 and "does not matter" in found.reason and not found.changes
    simple = hill.replace(material=DruckerPrager())
    assert "not depend" in item("rate", simple).reason
    still = item("rate", gr.scenes.incline(angle_deg=19.0))
    assert still.error == 0.0
    unknown = gr.scenes.silo(material=gr.materials.RegularisedMuI())
    assert "not been measured" in item("rate", unknown, 0.02).reason
    cohesive = gr.economy.suggest(gr.scenes.incline(cohesion=10.0), 0.1)
    assert "depends on the depth" in cohesive.about("rate").reason
    for topic in ("rate", "stiffness"):
        assert math.isnan(cohesive.about(topic).error) and not cohesive.about(topic).changes


def test_damping_is_held_where_grains_are_softened():
    """The change is decay c_w/dx and nothing else: the cost per point and step stays the same."""
    scene = gr.scenes.silo()
    cheaper = gr.economy.apply(scene, item("stiffness", scene, 0.03))
    soft, stiff = cheaper.material, scene.material
    assert soft.E < stiff.E
    rates = [s.scheme.tpic_decay * s.material.wave_speed for s in (cheaper, scene)]
    assert rates[0] == pytest.approx(rates[1], rel=1e-12)
    assert cheaper.scheme.replace(tpic_decay=scene.scheme.tpic_decay) == scene.scheme
    column = item("stiffness", gr.scenes.column_collapse(aspect=1.0), 0.1)
    assert set(column.changes) == {"E"}  # the run-out of E does not keep to that
    damped = gr.scenes.column_collapse(aspect=1.0, scheme=cheaper.scheme, material=soft)
    assert math.isnan(item("stiffness", damped, 0.1).error)
    flip = scene.replace(scheme=gr.schemes.dunatunga_kamrin_2015)
    assert set(item("stiffness", flip, 0.1).changes) == {"E"}
    assert bias.held_decay(flip, 1e6) == {}


def test_grains_and_fields_are_only_told_of():
    unknown = item("grains", gr.scenes.silo(), 0.02)
    assert math.isnan(unknown.error) and not unknown.changes
    narrow = gr.scenes.silo(orifice=0.06, material=glass_beads_5mm)
    found = item("grains", narrow, 0.02)
    assert found.error == pytest.approx(0.9 * 0.005 / 0.06) and "leaves it out" in found.reason
    assert not found.changes
    layer = item("grains", gr.scenes.incline(material=glass_beads_5mm))
    stop = math.pi / 2 * 0.48 * 0.005 * math.sqrt(0.1772 / (0.2616 * 0.0844))
    assert f"{stop:.2g}" in layer.reason
    particle, smoothed = (item("fields", scene).reason for scene in (PUBLISHED[5], PAPER[5]))
    assert "88 bytes" in particle and "176 bytes" in smoothed and "density_gradient" in smoothed


SCHEMES = [
    gr.Scheme(basis=basis, transfer=transfer, density=gr.ParticleDensity())
    for basis in BASES
    for transfer in TRANSFERS
]


@pytest.mark.parametrize("scheme", SCHEMES, ids=lambda s: f"{s.basis}-{s.transfer}")
@pytest.mark.parametrize("fixed", [False, True])
def test_no_scheme_is_refused_or_led_astray(scheme, fixed):
    """Suggestions for any scheme can be run, and keep to the tolerance that was asked for."""
    scheme = scheme.replace(dt=2e-6) if fixed else scheme
    inclines = (
        {"columns": 1},
        {"columns": 8},
        {"columns": 2, "columns_across": 2, "points_per_cell": 8, "cell": 0.02},
    )
    scenes = [gr.scenes.incline(scheme=scheme, **called) for called in inclines]
    scenes += [scene.replace(scheme=scheme) for scene in (PAPER[4], PAPER[5], full_silo())]
    for scene in (*scenes, gr.scenes.cylinder_collapse(scheme=scheme, cell=0.05)):
        suggestion = gr.economy.suggest(scene, 0.05)
        cheaper = gr.economy.apply(scene, suggestion)
        check_time_step(cheaper)
        assert suggestion.error <= 0.05 * (1 + 1e-12) and suggestion.saving >= 1
        changed = {name for one in suggestion for name in one.changes}
        if damps_by_step(scheme):
            assert not changed & {"E", "dt", "cell", "basis"}
        if scene.name != "incline" and (scheme.basis, scheme.transfer) != ("linear", "flip"):
            assert "E" not in changed
        if scene.dim == 3:
            assert not changed & {"columns", "columns_across", "cell"}


def unmeasured():
    """Scenes for which no error of softer grains was measured."""
    yield full_silo()
    # a name alone, or parameters that no scene function takes
    yield full_silo(name="incline")
    yield gr.scenes.incline(columns=4).replace(parameters={"angle_deg": "steep"})
    for material in (DruckerPrager(), Elastic(E=1e9)):
        yield from (scene.replace(material=material) for scene in (*PAPER[::2], *PUBLISHED[1::2]))
    for changes in ({"shifting": 0.0}, {"relaxation": 0.0}, {"diffusion": 0.3}, {"tpic_decay": 0}):
        yield gr.scenes.silo(scheme=scheme_of("quadratic", "tpic", "smoothed", **changes))
    for changes in ({"transfer": "apic"}, {"flip_decay": 20.0}, {"basis": "ugimp"}):
        yield gr.scenes.silo(scheme=gr.schemes.dunatunga_kamrin_2015.replace(**changes))


def test_what_was_not_measured_keeps_its_stiffness():
    for scene in unmeasured():
        found = item("stiffness", scene, 0.1)
        assert not found.changes and math.isnan(found.error)
    assert "not been measured" in item("stiffness", full_silo(), 0.02).reason


def test_schemes_of_the_same_kind():
    default, published = gr.schemes.default, gr.schemes.dunatunga_kamrin_2015
    held = default.replace(**bias.held_decay(gr.scenes.silo(), 1e6))
    for scheme in (default, held, default.replace(cfl=0.125)):
        assert bias.kind(scheme) == "default"
    for changes in ({"averaging_time": 1.0}, {"dt": 1e-6}):
        assert bias.kind(scheme_of("quadratic", "tpic", "smoothed", **changes)) == ""
    # the effect of softer grains was not measured
    assert bias.kind(default.replace(tpic_decay=0.02)) == ""
    assert bias.kind(published) == bias.kind(published.replace(dt=None, cfl=0.3)) == "published"
    assert bias.kind(published.replace(mass_cutoff=0.01)) == ""


def test_pieces_can_be_chosen_and_scenes_read_again():
    scene = gr.scenes.incline(columns=4, scheme=gr.schemes.dunatunga_kamrin_2015)
    suggestion = gr.economy.suggest(scene, 0.05)
    some = gr.economy.apply(scene, [i for i in suggestion if i.topic in ("dimension", "time step")])
    assert some == gr.scenes.incline(
        columns=1, scheme=gr.schemes.dunatunga_kamrin_2015.replace(dt=None)
    )
    assert gr.economy.apply(scene, suggestion.about("stiffness")).grid == scene.grid
    assert gr.economy.apply(scene, []) == scene
    # a scene read again has the same suggestion
    for scene in PAPER[::3]:
        again = gr.Scene.from_json(scene.to_json())
        assert str(gr.economy.suggest(again, 0.02)) == str(gr.economy.suggest(scene, 0.02))


def test_a_suggestion_for_another_scene_is_refused_and_one_changed_by_hand_not_rebuilt():
    with pytest.raises(ValueError, match="another scene"):
        gr.economy.apply(gr.scenes.silo(orifice=0.2), gr.economy.suggest(gr.scenes.silo()))
    with pytest.raises(TypeError, match="Suggestion"):
        gr.economy.apply(gr.scenes.silo(), ["stiffness"])
    scene = gr.scenes.incline(columns=4).replace(walls=(Wall(1, 0.0, kind="free_slip"),))
    suggestion = item("dimension", gr.scenes.incline(columns=4), 0.05)
    with pytest.raises(ValueError, match="another scene"):
        gr.economy.apply(scene, suggestion)
    with pytest.raises(ValueError, match="by hand"):
        rebuilt(scene, columns=1)
    own = gr.economy.suggest(scene, 0.05)
    assert not own.about("dimension").changes and not own.about("resolution").changes
    assert math.isnan(own.about("stiffness").error) and not own.about("stiffness").changes


def test_arguments_are_checked_and_a_suggestion_prints_as_a_table():
    for tolerance in (0.0, -0.1, 0.6, math.nan, True, "2 %"):
        with pytest.raises((TypeError, ValueError), match="tolerance"):
            gr.economy.suggest(gr.scenes.silo(), tolerance)
    with pytest.raises(TypeError, match="Scene"):
        gr.economy.suggest("silo")
    suggestion = gr.economy.suggest(gr.scenes.silo())
    text = str(suggestion)
    assert text.count("\n") == len(suggestion) and "together" in text
    assert "<table>" in suggestion._repr_html_()
    with pytest.raises(KeyError):
        suggestion.about("weather")
    assert len(suggestion[:2]) == 2


def test_cost_by_hand_and_on_given_terrain():
    scene = gr.scenes.column_collapse(scheme=gr.schemes.dunatunga_kamrin_2015)
    found = gr.economy.cost(scene)
    assert (found.points, found.steps) == (8192, 666667)
    each = 1e-9 * pace.nanoseconds(scene.scheme, 2, 8192, 16)
    known = pace.slowness() * (found.point_steps * each + found.steps * 1e-6 * pace.STEP)
    assert found.seconds == pytest.approx(known)
    single = scene.replace(scheme=gr.schemes.default.replace(precision="single"))
    double = gr.economy.cost(single.replace(scheme=gr.schemes.default))
    assert 0.4 * double.seconds < gr.economy.cost(single).seconds < 0.8 * double.seconds
    stiff = scene.replace(material=glass_beads.replace(E=1e13))
    with pytest.raises(ValueError, match="dt"):
        gr.economy.cost(stiff)
    # its parameters do not hold the map, so that the scene counts as made by hand
    ground = gr.shapes.HeightMap(np.linspace(0.5, 0.0, 21), 0.05)
    scene = gr.scenes.landslide(terrain=ground, at=(0.3,), cell=0.025, thickness=0.15)
    assert gr.economy.cost(scene).points == scene.n_points


def test_cost_of_a_preset_of_1_gpa_tells_what_would_be_enough():
    scene = gr.scenes.silo(orifice=0.2)
    found = gr.economy.cost(scene)
    assert found.points == scene.n_points
    assert found.E == 1e9
    assert 0 < found.error <= 0.02
    softer = scene.material.replace(E=0.9 * found.enough_E)
    assert bias.stiffness_error(scene, "silo", softer) > 0.02
    text = str(found)
    assert f"{found.points:,} points, {found.steps:,} steps: about" in text and "GB" in text
    assert f"E = {found.enough_E:.2g} Pa in place of 1e+09 would be enough (error " in text
    soft = gr.economy.cost(scene.replace(material=scene.material.replace(E=1e5)))
    assert "in place of 1e+05 would be enough" in str(soft) and str(soft).endswith("times slower")
    assert found.seconds / soft.seconds == pytest.approx(math.sqrt(1e4), rel=0.01)


def test_stiffness_that_is_enough_where_no_error_was_measured():
    """Grains whose elasticity shrinks the foot by 0.001, with H = 0.3 m of the block."""
    scene = scene_with(
        grid=gr.Grid((0.0, 0.0), 0.02, (50, 20)),
        fills=(gr.Fill(gr.Box((0.0, 0.0), (0.3, 0.3)), 4),),
        material=glass_beads.replace(E=1e9),
        gravity=gr.Gravity(),
    )
    found, grains = gr.economy.cost(scene), scene.material
    strain = grains.rho_c * 9.8 * 0.3 / (grains.K * found.enough_E / grains.E)
    assert strain == pytest.approx(1e-3, rel=0.1) and math.isnan(found.error)
    assert "p/K = 0.001 at the foot" in str(found)
    floating = scene.replace(gravity=gr.Gravity((0.0,), ((0.0, 0.0),)))
    assert math.isnan(gr.economy.cost(floating).enough_E)
    assert "enough" not in str(gr.economy.cost(floating))


@pytest.mark.parametrize("name", gr.scenes.registry)
def test_points_and_memory_of_every_scene(name):
    """The estimate for many points agrees with their number; SPH has no modulus to lower."""
    coarse = {"cell": 0.025} if name in ("couette", "cylinder_collapse") else {}
    scene = gr.scenes.registry[name](**coarse)
    found = gr.economy.cost(scene)
    gas = getattr(scene, "gas", None)
    points = scene.n_points + (len(gas.points(scene.grid, 0).x) if gas else 0)
    entering = [(i, i.points_per_cell) for i in getattr(scene, "inflows", ())]
    entering += [(jet, 1) for jet in (gas.jets if gas else ()) if jet.density]
    for inflow, per_cell in entering:
        box, axis = inflow.region, int(np.argmax(np.abs(inflow.velocity)))
        swept = np.array(box.upper) - np.array(box.lower)
        swept[axis] = abs(inflow.velocity[axis]) * scene.duration
        points += per_cell * np.prod(swept / scene.grid.cell)
    assert found.points == pytest.approx(points, rel=0.01)
    assert found.steps > 0 and found.seconds > 0
    walls = len(scene.wall_points()["x"]) if scene.method == "sph" else 0
    assert 0.07 * 2**30 < found.memory < 0.12 * 2**30 + 3000 * (points + walls)
    assert math.isnan(found.E) == (scene.method == "sph")


def test_memory_of_wall_particles_and_growing_buffers():
    """They count, with less memory than particles of the material, which the record holds too."""
    for across, each in ((0, 480), (20, 850)):
        scene = gr.scenes.incline_sph(columns=200, height=0.02, columns_across=across)
        thicker = [replace(wall, layers=wall.layers + 4) for wall in scene.walls]
        more = scene.replace(walls=tuple(thicker))
        added = len(more.wall_points()["x"]) - len(scene.wall_points()["x"])
        assert added == 4 * 200 * max(across, 1)
        found = [gr.economy.cost(s).memory for s in (scene, more)]
        assert found[1] - found[0] == pytest.approx(MARGIN * each * added)
    # old and new buffers are there at the same time; those of SPH do not grow
    scene = gr.scenes.cylinder_collapse(points_per_cell=8, cell=0.02)
    sim, cost = gr.Simulation(scene, threads=1), gr.economy.cost(scene)
    buffers = sum(array.nbytes for array in sim.buffers.values())
    assert 0.5 * buffers < cost.peak_memory - cost.memory < 2 * buffers
    still = gr.economy.cost(gr.scenes.incline_sph())
    assert still.peak_memory == still.memory


def test_work_falls_with_what_is_left():
    """When half of a silo has left, half of the points and of the active cells are left."""
    soft = glass_beads.replace(E=1e6)
    sim = gr.Simulation(gr.scenes.silo(orifice=0.2, cell=0.02, material=soft), threads=1)
    sim.step(5)
    points, cells = sim.n_points, len(sim.cell_counts)
    assert sim.cell_counts.sum() == points
    while sim.n_points > 0.5 * points:
        sim.run(until=sim.time + 1 / 60)
    visited = []  # cells that have emptied stay until the points are sorted again
    for _ in range(20):
        visited.append(len(sim.run(until=sim.time + 1e-3).cell_counts))
        assert sim.cell_counts.sum() == sim.n_points
    assert 0.4 < np.mean(visited) / cells < 0.6

"""Wrong arguments to scene functions and damaged scene files are refused by name."""

import inspect
import math

import numpy as np
import pytest

import granular as gr
from granular import MuI, Scene, scenes

NOT_ABOVE_ZERO = {
    *("angle_deg", "jitter", "A", "omega", "rake_deg", "friction"),
    *("settle", "slope_deg", "opens_at", "slip", "slug.headroom", "column_collapse.ramp"),
    *("cylinder_collapse.ramp", "hourglass.ramp", "incline.ramp", "silo.ramp", "chute_ngf.ramp"),
    *("hopper.ramp", "rotating_drum.width", "cohesive_cliff.ramp", "slope.ramp", "slope.depth"),
    *("base_friction", "retaining_wall.speed"),
    *("conveyor.speed", "conveyor.width", "gate_friction", "obstacle_friction"),
    *("belt_speed", "sphere_drop.drop", "settling_bed.drop", "tumbling_block.restitution"),
    *(
        "obstacle.speed",
        "obstacle.gap",
        "obstacle.width",
        "flexible_barrier.speed",
        "plate_nu",
        "grouser_height",
    ),
}
"""Numbers that may be 0 or less in all scenes, or in one."""
CASES = [
    (name, argument)
    for name in scenes.names("mpm")
    for argument, parameter in inspect.signature(scenes.registry[name]).parameters.items()
    if parameter.annotation in ("float", "float | None") and "sponge" not in argument
]


@pytest.mark.parametrize(("name", "argument"), CASES)
def test_numbers(name, argument):
    """Every number is finite and of a right type; most must be above zero."""
    positive = not NOT_ABOVE_ZERO & {argument, f"{name}.{argument}"}
    for value in (math.nan, math.inf, -math.inf, *((0.0, -1.0) if positive else ())):
        with pytest.raises(ValueError, match=rf"{argument}\b.* must be"):
            scenes.registry[name](**{argument: value})
    for value in ("0.1", True, [0.1], 0.1 + 0j, {}):
        with pytest.raises(TypeError, match=rf"{argument} = .* must be"):
            scenes.registry[name](**{argument: value})


@pytest.mark.parametrize("name", scenes.names("mpm"))
@pytest.mark.parametrize(
    ("arguments", "error", "message"),
    [
        ({"points_per_cell": 5}, ValueError, "points_per_cell = 5 must be the"),
        ({"points_per_cell": 0}, ValueError, "points_per_cell = 0"),
        ({"points_per_cell": 4.0}, TypeError, "points_per_cell = 4.0"),
        ({"jitter": 1.01}, ValueError, "jitter = 1.01"),
        ({"jitter": math.nan}, ValueError, "jitter = nan"),
        ({"material": None}, TypeError, "material = None must be an? (Material|NGF)"),
        ({"scheme": "quadratic"}, TypeError, "scheme = 'quadratic' must be a Scheme"),
        ({"seed": -1}, ValueError, "seed = -1"),
        ({"seed": None}, TypeError, "seed = None"),
        ({"cell": 1e-300}, ValueError, "must"),
        ({"nonsense": 1}, TypeError, "nonsense"),
    ],
)
def test_arguments_of_all_scenes(name, arguments, error, message):
    if not arguments.keys() <= {*inspect.signature(scenes.registry[name]).parameters, "nonsense"}:
        error, message = TypeError, "jitter"  # a scene without a fill
    with pytest.raises(error, match=message):
        scenes.registry[name](**arguments)


@pytest.mark.parametrize(
    ("name", "arguments", "error", "message"),
    [
        ("column_collapse", {"lip": 0.1}, ValueError, "lip = 0.1 must not be less than half_width"),
        ("column_collapse", {"ramp": -1}, ValueError, "ramp = -1.0"),
        ("silo", {"orifice": 1.2}, ValueError, "orifice = 1.2 must be less than width = 1.0"),
        ("silo", {"orifice": 1.0}, ValueError, "orifice = 1.0 must be less than width = 1.0"),
        ("silo", {"orifice": 0.98}, ValueError, "by more than two cells"),
        (
            "silo",
            {"orifice": 0.05},
            ValueError,
            "orifice/2 = 0.025 must be a whole number of cells",
        ),
        ("silo", {"width": 0.99}, ValueError, "width/2 = 0.495"),
        ("silo", {"height": 0.995}, ValueError, "height = 0.995"),
        ("silo", {"edge": "node"}, ValueError, "edge = 'node'"),
        ("silo", {"opens_at": -0.1}, ValueError, "opens_at = -0.1"),
        ("hourglass", {"kind": "round"}, ValueError, "kind = 'round' must be one of 'flat'"),
        ("hourglass", {"kind": None}, TypeError, "kind = None"),
        ("hourglass", {"slope_deg": 90}, ValueError, r"slope_deg = 90.0 must be in \(0.0, 90.0\)"),
        ("hourglass", {"orifice_radius": 0.5}, ValueError, "orifice_radius = 0.5 must be less"),
        ("hourglass", {"drop": 0.505}, ValueError, "drop = 0.505 must be a whole number"),
        ("incline", {"angle_deg": 90.0}, ValueError, r"angle_deg = 90.0 must be in \[0.0, 90.0\)"),
        ("incline", {"angle_deg": -1}, ValueError, "angle_deg = -1.0"),
        ("incline", {"columns": 0}, ValueError, "columns = 0"),
        ("incline", {"columns": 1.0}, TypeError, "columns = 1.0"),
        ("incline", {"headroom": 0}, ValueError, "headroom = 0"),
        ("incline", {"height": 0.201}, ValueError, "height = 0.201"),
        ("slug", {"center": (0.1, 0.25)}, ValueError, "must keep the disc"),
        ("slug", {"center": (0.2, 0.1)}, ValueError, "must keep the disc"),
        ("slug", {"wall_at": 0.3}, ValueError, "wall_at = 0.3"),
        ("slug", {"velocity": (1.2,)}, ValueError, "velocity"),
        ("slug", {"velocity": (1.2, math.nan)}, ValueError, "velocity"),
        ("slug", {"velocity": (0.0, 1e200)}, ValueError, "must"),
        ("slug", {"headroom": -1}, ValueError, "headroom = -1.0"),
        ("cylinder_collapse", {"points_per_cell": 4}, ValueError, "cube of an integer"),
        ("chute_ngf", {"angle_deg": 90.0}, ValueError, "angle_deg = 90.0"),
        ("chute_ngf", {"material": MuI()}, TypeError, "must be an NGF"),
        ("clogging_silo", {"material": MuI()}, TypeError, "must be an NGF"),
        ("clogging_silo", {"A": -1.0}, ValueError, "A = -1.0 must be"),
        ("clogging_silo", {"A": math.nan}, ValueError, "A = nan"),
        ("clogging_silo", {"half": 1}, TypeError, "half = 1 must be True or False"),
        ("clogging_silo", {"orifice": 0.595}, ValueError, "orifice"),
        ("clogging_silo", {"orifice": 0.63}, ValueError, "orifice = 0.63 must be less than width"),
        ("clogging_silo", {"sponge": math.nan}, ValueError, r"^sponge = nan must be in \[0"),
        ("clogging_silo", {"sponge": 99.0}, ValueError, r"^sponge = 99.0 must be in \[0.0, .*\)"),
        ("clogging_silo", {"sponge": "up"}, TypeError, "^sponge = 'up' must be"),
        *(
            ("clogging_silo", {"sponge_damping": bad}, ValueError, f"^sponge_damping = {bad} must")
            for bad in (math.nan, 0.0, -1.0)
        ),
        ("cylinder_collapse", {"lip": 0.1}, ValueError, "lip = 0.1 must not be less than radius"),
        ("silo_3d", {"slot": 0.25}, ValueError, "slot = 0.25 must be less than length = 0.25"),
        ("silo_3d", {"slot": 0.02}, ValueError, "slot = 0.02 must be a whole number of cells"),
        (
            "landslide",
            {"bend": 5.0},
            ValueError,
            "bend = 5.0 must end within the slope and the flat",
        ),
        (
            "landslide",
            {"angle_deg": 90.0},
            ValueError,
            r"angle_deg = 90.0 must be in \(0.0, 90.0\)",
        ),
        ("landslide", {"at": (9.0,)}, ValueError, r"at = \(9.0,\) with length = 0.4 must keep"),
        ("landslide", {"at": (0.0, 0.0)}, ValueError, r"at = \(0.0, 0.0\) must be 1 numbers"),
        ("landslide", {"dim": 4}, ValueError, "dim = 4 must be"),
        ("landslide", {"terrain": 3}, TypeError, "terrain = 3 must be a HeightMap, a path or None"),
        ("landslide", {"release": np.ones(3)}, ValueError, "release of shape"),
        ("obstacle", {"kind": "tree"}, ValueError, "kind = 'tree' must be one of 'wall'"),
        ("obstacle", {"width": 0.1, "across": 0.2}, ValueError, "across = 0.2 must be <= width"),
        ("penetration", {"kind": "rod"}, ValueError, "kind = 'rod' must be one of 'ball'"),
        ("penetration", {"duration": 9.0}, ValueError, "duration = 9.0 must be so short"),
        ("sphere_drop", {"drop": -0.1}, ValueError, "drop = -0.1 must be a finite number"),
        ("sphere_drop", {"diameter": 0.2}, ValueError, "diameter = 0.2 must be less than width"),
        ("penetration", {"diameter": 0.8}, ValueError, "diameter = 0.8 must be less than width"),
        ("conveyor", {"opening": 0.3}, ValueError, r"opening = 0.3 must be in \(0.0, 0.3\)"),
        ("conveyor_heap", {"rate": 99.0}, ValueError, "rate = 99.0 must be <= 30"),
        ("conveyor_heap", {"spout": 1.0}, ValueError, "spout = 1.0 must be less than length"),
        ("chute_fed", {"feeder": 2.0}, ValueError, "feeder = 2.0 must be less than length"),
        ("silo_fed", {"orifice": 0.6}, ValueError, "orifice = 0.6 must be less than width"),
        ("conveyor", {"gate": 0.8}, ValueError, "gate = 0.8 must be less than run = 0.8"),
        ("couette", {"outer": 0.11}, ValueError, "outer = 0.11 must exceed inner = 0.0999 by 4"),
        ("couette", {"omega": math.inf}, ValueError, "omega = inf"),
        ("excavation", {"depth": 0.15}, ValueError, "depth = 0.15 must be less than soil = 0.15"),
        ("excavation", {"travel": 1.3}, ValueError, "must be less than length = 1.6"),
        ("excavation", {"ramp": 0.25}, ValueError, "ramp = 0.25 must be less than the shortest"),
        ("excavation", {"blade": (0.01, 0.8, 0.4)}, ValueError, r"blade\[1\] = 0.8 must be <="),
        ("excavation", {"rake_deg": 61.0}, ValueError, "rake_deg = 61.0"),
        ("excavation", {"half": 1}, TypeError, "half = 1 must be True or False"),
        ("wheel", {"slip": 1.0}, ValueError, r"slip = 1.0 must be in \[-10.0, 1.0\)"),
        ("wheel", {"slip": -10.5}, ValueError, "slip = -10.5"),
        ("wheel", {"grousers": 3}, ValueError, "height = 0.0 must be > 0 with grousers"),
        ("wheel", {"start": 0.1}, ValueError, "start = 0.1 must keep the wheel"),
        ("wheel", {"duration": 50.0}, ValueError, "it goes to"),
        ("wheel", {"tread": 0.2}, ValueError, "tread = 0.2 must be <= width"),
        ("excavator", {"duration": 2.0}, ValueError, "duration = 2.0 must exceed"),
        ("excavator", {"bucket": (0.31, 0.04, 0.41)}, ValueError, "bucket = .* must exceed two"),
        ("excavator", {"tilt_deg": (math.nan, 0.0)}, ValueError, r"tilt_deg\[0\]"),
    ],
)
def test_arguments_that_contradict(name, arguments, error, message):
    with pytest.raises(error, match=message):
        scenes.registry[name](**arguments)


@pytest.mark.parametrize(
    "text",
    [
        "",
        "{",
        "[]",
        "null",
        "1e999",
        "NaN",
        "[" * 100_000,
        '{"format": 1}',
        '{"format": true, "scene": {}}',
        '{"format": 1, "scene": {}}',
        '{"format": 1, "scene": 3}',
        '{"format": 1, "scene": {"type": "os"}}',
        '{"format": 1, "scene": {"type": []}}',
        '{"format": 1, "scene": {"type": "Scene"}}',
        '{"format": 1, "scene": {"type": "Grid", "lower": [0, 0], "cell": 1, "shape": [1, 1]}}',
        '{"format": 1, "scene": {"type": "float", "value": "nan"}}',
        '{"format": 1, "scene": {"type": "Parameters", "items": [[1]]}}',
    ],
)
def test_texts_that_are_no_scene(text):
    with pytest.raises(ValueError, match="not the JSON of a scene"):
        Scene.from_json(text)


def test_damaged_texts_give_a_scene_or_a_value_error():
    """Random damage raises ValueError only, and most damage is noticed."""
    rng = np.random.default_rng(0)
    original = scenes.silo().to_json()
    refused = 0
    for _ in range(1500):
        text = list(original)
        for _ in range(rng.integers(1, 4)):
            at = rng.integers(len(text))
            text[at] = rng.choice(list('0123456789.-eE"[]{}:,xytfn '))
        try:
            Scene.from_json("".join(text))
        except ValueError:
            refused += 1
    assert refused > 1000


EXTREMES = [
    ("column_collapse", {"E": 5e-324}),
    ("column_collapse", {"E": 1.7e308}),
    ("column_collapse", {"rho_c": 5e-324}),
    ("column_collapse", {"duration": 1e300}),
    ("column_collapse", {"cell": 5e-324}),
    ("column_collapse_sph", {"aspect": 1.7e308}),
    ("column_collapse_sph", {"kappa": 5e-324}),
    ("column_collapse_sph", {"duration": 1.7e308}),
    ("couette", {"pressure": 1e300}),
    ("fluidised_bed", {"sound_speed": 1e300}),
    ("fluidised_bed", {"sound_speed": 5e-324}),
    ("jet_on_bed", {"sound_speed": 1e300}),
]


@pytest.mark.parametrize(("name", "numbers"), EXTREMES)
def test_numbers_at_the_ends_of_the_range_are_refused(name, numbers):
    """By the scene, or by the estimate of its cost; no OverflowError, ZeroDivisionError."""
    argument = next(iter(numbers))
    with pytest.raises(ValueError, match=argument):
        gr.economy.cost(gr.scenes.registry[name](**numbers))


@pytest.mark.parametrize(
    "scene", [gr.scenes.incline(columns=1), gr.scenes.incline_sph(height=0.05)]
)
def test_more_steps_than_can_be_counted_are_refused(scene):
    for n in (2**63, 10**30):
        with pytest.raises(ValueError, match=f"n = {n} must be an integer from"):
            gr.Simulation(scene, threads=1).step(n)


def test_gravity_at_the_ends_of_the_range_has_an_estimate():
    """The stiffness that is enough goes with it, and nothing softer is there for the largest."""
    low, high = (gr.economy.cost(gr.scenes.incline(gravity=gravity)) for gravity in (1e-30, 1e30))
    assert low.steps > 0 and 0.0 < low.enough_E < 1e-20
    assert high.steps > 0 and "enough" not in str(high)

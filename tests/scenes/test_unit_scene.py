"""Scene: checks that its parts fit, and its exact round trip through JSON."""

import json
import math
import pickle

import numpy as np
import pytest

from granular import Fill, Gravity, Grid, Scene, Solid, SpongeLayer, Wall, materials, schemes
from granular.mpm.scene import Parameters
from granular.shapes import Box, Cylinder, Difference, Intersection, Sphere, Union

PARTS = {
    "name": "box",
    "grid": Grid((0.0, 0.0), 0.1, (10, 10)),
    "fills": (Fill(Box((0.0, 0.0), (1.0, 0.5)), 4),),
    "material": materials.glass_beads,
    "scheme": schemes.dunatunga_kamrin_2015,
    "walls": (Wall(1, 0.0),),
    "gravity": Gravity(),
    "duration": 1.0,
}


def rich_scene() -> Scene:
    """A scene with every kind of part, with numbers that have no short decimal form."""
    third = 1.0 / 3.0
    cylinder = Cylinder(
        third / 2, center=(third, third, 0.15), axis=(0.0, 0.0, 1.0), length=0.1 + 0.2
    )
    ball = Sphere(0.1, center=(0.8, 0.8, 0.8))
    return Scene(
        name="everything é",
        grid=Grid((0.0, 0.0, 0.0), 0.1, (10, 10, 10), (False, True, False), {"x+", "z-"}),
        fills=(
            Fill(Intersection((cylinder, Box((0, 0, 0), (1, 1, third)))), 8, 1200.0, (third, 0, 1)),
            Fill(
                Difference(Union((ball, ball)), Sphere(0.05, center=(0.8, 0.8, 0.7))),
                27,
                jitter=third,
            ),
        ),
        material=materials.glass_beads_5mm,
        scheme=schemes.default.replace(dt=1e-5 / 3),
        walls=(
            Wall(2, 0.0, kind="coulomb", friction=third, opens_at=math.pi),
            Wall(0, 0.5, kind="free_slip", span=((0.0, 1.0), (0.2, 0.6))),
            Solid((0.0, 0.0, 0.8), (0.1, 1.0, 1.0), kind="free_slip"),
        ),
        gravity=Gravity((0.0, third), ((0, 0, 0), (0, third, -9.8))),
        duration=third,
        sponge_layers=(SpongeLayer(2, 0.9),),
        seed=2**62 + 1,
        parameters={"a": 1, "b": -0.0, "c": (1.0, (True, None)), "d": "é", "e": math.inf},
    )


def test_json_and_pickle_round_trip_of_every_part():
    scene = rich_scene()
    assert pickle.loads(pickle.dumps(scene)) == scene
    text = scene.to_json()
    again = Scene.from_json(text)
    assert text.isascii()
    assert again == scene and hash(again) == hash(scene)
    # repr of a float is unique to its bits, and distinguishes 1, 1.0 and True, and 0.0 and -0.0
    assert repr(again) == repr(scene) and again.to_json() == text


def test_json_keeps_random_floats_to_the_last_bit():
    rng = np.random.default_rng(1)
    for bits in rng.integers(1, 2046 << 52, 200):
        value = float(np.int64(bits).view(np.float64))
        scene = Scene(**PARTS | {"parameters": {"q": value}})
        assert Scene.from_json(scene.to_json()).parameters["q"] == value
    kinds = (
        materials.DruckerPrager,
        materials.Elastic,
        materials.HardeningDruckerPrager,
        materials.RegularisedMuI,
    )
    for material in (kind(E=1e6 / 3) for kind in kinds):
        scene = Scene(**PARTS | {"material": material})
        assert Scene.from_json(scene.to_json()) == scene


def test_json_of_an_unknown_class_or_a_newer_format_is_refused():
    class Mine(materials.Elastic):
        pass

    with pytest.raises(TypeError, match="cannot be written"):
        Scene(**PARTS | {"material": Mine()}).to_json()
    data = json.loads(Scene(**PARTS).to_json())
    data["format"] += 1
    with pytest.raises(ValueError, match="format = 2 is newer than 1"):
        Scene.from_json(json.dumps(data))


def test_n_points_is_what_is_seeded_and_html_shows_it():
    scene = Scene(**PARTS)
    assert scene.n_points == 10 * 5 * 4 == len(scene.points().x)
    assert scene.points().density[0] == 1500.0
    assert scene.replace(duration=2).duration == 2.0
    assert scene.duration == 1.0
    with pytest.raises(ValueError, match=r"duration = -2.0"):
        scene.replace(duration=-2.0)
    html = Scene(**PARTS)._repr_html_()
    assert "1 x 1" in html and ">200<" in html and "MuI" in html
    html = materials.glass_beads_5mm._repr_html_()
    assert "mu_2" in html and "0.6435" in html and "947.3" in html
    assert "quadratic" in schemes.default._repr_html_()


def test_parameters_behave_as_a_frozen_mapping():
    p = Parameters({"aspect": np.float64(2.0), "n": np.int64(3), "pair": [1, 2.5]})
    assert dict(p) == {"aspect": 2.0, "n": 3, "pair": (1, 2.5)} == p
    assert type(p["n"]) is int and p.get("half", False) is False and "aspect" in p
    with pytest.raises(TypeError):
        p["aspect"] = 3.0
    with pytest.raises(KeyError):
        p["width"]


OTHER = Grid((0.0, 0.0, 0.0), 0.1, (10, 10, 10))
PERIODIC = Grid((0.0, 0.0), 0.1, (10, 10), (True, False))
SHORT_WALL = {"grid": PERIODIC, "walls": (Wall(1, 0.0, span=((0.2, 0.5),)),)}


@pytest.mark.parametrize(
    ("changes", "error", "message"),
    [
        ({"name": ""}, ValueError, "name"),
        ({"name": 3}, TypeError, "name = 3"),
        ({"grid": None}, TypeError, "grid = None must be a Grid"),
        ({"grid": OTHER}, ValueError, r"fills\[0\] has dimension 2, must have 3"),
        ({"fills": ()}, ValueError, "at least one Fill"),
        ({"fills": PARTS["fills"][0]}, TypeError, "sequence of Fill"),
        ({"fills": (1,)}, TypeError, r"fills\[0\] = 1 must be a Fill"),
        ({"fills": (Fill(Box((0, 0), (1, 2)), 4),)}, ValueError, "along y, must stay in the grid"),
        ({"material": "beads"}, TypeError, "material = 'beads'"),
        ({"scheme": "flip"}, TypeError, "scheme = 'flip'"),
        ({"walls": (Gravity(),)}, TypeError, r"walls\[0\] .* must be a Wall or Solid"),
        ({"walls": (Wall(2, 0.0),)}, ValueError, "dimension 2"),
        ({"walls": (Wall(1, 0.0, span=((0, 1), (0, 1))),)}, ValueError, "dimension 2"),
        ({"walls": (Wall(1, 0.05),)}, ValueError, r"walls\[0\].at = 0.05 must lie on a grid line"),
        ({"walls": (Wall(1, 1.1),)}, ValueError, r"walls\[0\].at = 1.1"),
        ({"walls": (Wall(1, 0.0, span=((0.0, 1.1),)),)}, ValueError, "span along x = 1.1"),
        ({"walls": (Solid((0, 0), (0.55, 1)),)}, ValueError, r"upper\[0\] = 0.55"),
        ({"walls": (Solid((0, 0, 0), (1, 1, 1)),)}, ValueError, "dimension 2"),
        ({"grid": PERIODIC, "walls": (Wall(0, 0.0),)}, ValueError, "normal to the periodic axis"),
        (SHORT_WALL | {"scheme": schemes.default}, ValueError, "no wall may end along it"),
        ({"sponge_layers": (SpongeLayer(2, 0.5),)}, ValueError, "dimension 2"),
        ({"sponge_layers": (SpongeLayer(1, 0.5),) * 2}, ValueError, "one along an axis"),
        ({"sponge_layers": (SpongeLayer(1, 1.0),)}, ValueError, r"above = 1.0 .* \[0.0, 1.0\)"),
        ({"gravity": -9.8}, TypeError, "must be a Gravity"),
        ({"gravity": Gravity((0,), ((0, 0, 0),))}, ValueError, "gravity of dimension 3"),
        ({"duration": 0}, ValueError, "duration = 0.0"),
        ({"duration": math.inf}, ValueError, "duration = inf"),
        ({"seed": -1}, ValueError, "seed = -1"),
        ({"seed": 1.0}, TypeError, "seed = 1.0"),
        ({"parameters": [("a", 1)]}, TypeError, "parameters"),
        ({"parameters": {"a": math.nan}}, ValueError, "a = nan"),
        ({"parameters": {"a": {}}}, TypeError, "a = {}"),
        ({"parameters": {1: 2}}, TypeError, "the name 1"),
    ],
)
def test_parts_that_do_not_fit_are_refused(changes, error, message):
    with pytest.raises(error, match=message):
        Scene(**PARTS | changes)

"""Slips of unit, axis and sign: told before the run, with what was likely meant."""

import math
import re
import warnings

import pytest

import granular as gr
from granular import Wall, cli, materials, shapes
from granular.model.plausible import suspect_numbers

GRAINS = gr.MuI(E=1e6)
HARDENING = materials.HardeningDruckerPrager(E=1e6)
BALL = shapes.Cylinder(0.1, center=(0.0, 0.0))


def scene_of(**parts):
    base = {
        "name": "slip",
        "grid": gr.Grid((0.0, 0.0), 0.02, (50, 30)),
        "fills": (gr.Fill(gr.Box((0.0, 0.0), (0.3, 0.2)), 4),),
        "gravity": gr.Gravity((0.0,), ((0.0, -9.81),)),
        "duration": 1.0,
        "material": GRAINS,
        "walls": (Wall(1, 0.0),),
    }
    return gr.Scene(**base | parts)


def fill(size=(0.3, 0.2), **more):
    return {"fills": (gr.Fill(gr.Box((0.0, 0.0), size), 4, **more),)}


def body(at=(0.7, 0.4), motion=None, **more):
    moving = {} if motion is None else {"motion": gr.Motion(**motion)}
    return {"bodies": (gr.Body(more.pop("shape", BALL), at, **moving, **more),)}


def gravity(*vector):
    return {"gravity": gr.Gravity((0.0,), (vector,))}


def inflow(**more):
    return {"inflows": (gr.Inflow(gr.Box((0.5, 0.5), (0.7, 0.6)), (0.0, -0.5), 4, **more),)}


def grains(**changes):
    return {"material": GRAINS.replace(**changes)}


FINE = {"grid": gr.Grid((0.0, 0.0), 0.005, (200, 120))}
HALF_SPACE = gr.Body(shapes.HalfSpace((0.0, 1.0)), (0.5, 0.05))
CHUTE = {
    "grid": gr.Grid((0.0, 0.0), 0.02, (50, 30), open_sides={"x+"}),
    "walls": tuple(Wall(1, y, kind="coulomb", friction=0.3) for y in (0.0, 0.6)),
}


def turning(radius, omega, **more):
    disc = shapes.Cylinder(radius, center=(0.0, 0.0))
    return body(shape=disc, motion={**STILL, "angular_velocity": (omega,)}, **more)


STILL = {"velocity": ((0.0, 0.0),)}
SLIPS = [
    (grains(mu_s=30.0, mu_2=33.0), r"mu_s = 30 .* tan\(30 deg\) = 0.577"),
    (grains(mu_s=0.01), "mu_s = 0.01 is below the friction of any grains"),
    ({"material": gr.DruckerPrager(E=1e6, mu=40.0)}, r"mu = 40 .* tan\(40 deg\) = 0.839"),
    ({"material": HARDENING.replace(h0_deg=0.7854, h1_deg=0.1, h3_deg=0.05)}, "mean 45"),
    (
        {"walls": (Wall(1, 0.0, kind="coulomb", friction=25.0),)},
        r"walls\[0\].friction = 25 .* 0.466",
    ),
    (body(friction=1e6), r"bodies\[0\].friction = 1e.06 .*sticky"),
    (body(rotation_deg=math.radians(25.0)), r"rotation_deg = 0.436332, in degrees: .* mean 25"),
    (body(shape=shapes.Box(size=(0.1, 0.1), rotation_deg=1.5708)), "shape.rotation_deg .* mean 90"),
    (body(motion={**STILL, "angular_velocity": (360.0,)}), r"360 rad/s.* 6.283 rad/s"),
    (body(motion={**STILL, "angular_velocity": (3000.0,)}), r"mean 52.36 .* 314.2 rad/s, 3000 rpm"),
    (grains(rho_c=1.5), "rho_c = 1.5 kg/m3 .* mean 1500"),
    (grains(rho_c=1.5, rho_s=2.65), "rho_c = 1.5 kg/m3 .* mean 1500"),
    (grains(rho_s=2.65e6), "rho_s = 2.65e.06 kg/m3 .* mean 2650"),
    (fill(density=1.5), r"fills\[0\] has a density of 1.5 kg/m3, 0.001 of rho_c: .* mean 1500"),
    (fill(density=1700.0), r"fills\[0\] has a density of 1700 kg/m3, 1.13 of rho_c"),
    ({"material": gr.NGF(E=1e6, d=2.0)}, "d = 2 m in a domain of 1 m: .* 0.002, this in mm"),
    (grains(E=10.0), r"E = 10 Pa is too soft: .* p/E = .* mean E = 1e.07 Pa"),
    (grains(E=1000.0), r"E = 1000 Pa is too soft: .* mean E = 1e.06 Pa"),
    (grains(E=2e4), "E = 20000 Pa is too soft: .* take E >= 2.9e.06, 1000 times"),
    (grains(E=1e15), "stiffer than diamond"),
    (gravity(0.0, -981.0) | grains(E=1e8), "gravity of 981 m/s2: did you mean 9.81, this in cm/s2"),
    (gravity(0.0, -9810.0) | FINE | grains(E=1e9), "mean 9.81, this in mm/s2"),
    (gravity(0.0, 9.81), "points upwards"),
    (gravity(-9.81, 0.0), "no component along y"),
    (gravity(0.0, 0.0), "there will be no motion"),
    (fill(velocity=(500.0, 0.0)), r"fills\[0\] has a speed of 500 m/s, faster"),
    ({"walls": (Wall(1, 0.0, velocity=(800.0, 0.0)),)}, r"walls\[0\] has a speed of 800 m/s"),
    (body(motion={"velocity": ((0.0, -300.0),)}), r"bodies\[0\] has a speed of 300 m/s"),
    ({"duration": 3e7}, r"duration = 3e.07 s takes .* steps"),
    (fill(size=(0.3, 0.01)), r"fills\[0\] is 0.01 m thin"),
    (body(at=(300.0, 0.4)), r"bodies\[0\] at 300 m is outside of the domain along x"),
    (body(at=(0.7, -0.5), free="y", mass=50.0), "outside of the domain along y, by 0.4 m"),
    (body(free="xy", mass=1e6), r"mass = 1e.06 kg .* per metre of depth"),
    (body(free="xy", mass=0.08, shape=shapes.Box(size=(0.2, 0.2))), "mean 80, this in tonnes"),
    (
        body(free="xy", mass=50.0, inertia=2500.0),
        "impossible .* 50 kg .* mean 0.25 .* kg cm2.* 0.15",
    ),
    (body(free="xy", mass=50.0, inertia=2.5e6), "mean 0.25 kg m2, this in g cm2"),
    (body(free="xy", mass=50.0, inertia=1e-9), "impossible for a body of 50 kg .* about 0.15"),
]


@pytest.mark.parametrize(("slip", "says"), SLIPS)
def test_slips_are_told_with_what_was_meant(slip, says):
    (sentence,) = suspect_numbers(scene_of(**slip))
    assert re.search(says, sentence), sentence


@pytest.mark.parametrize(
    "sound",
    [
        {},
        grains(mu_s=1.2, mu_2=1.4),  # angular rock
        grains(rho_c=40.0, rho_s=100.0, E=1e5),  # aerogel
        grains(rho_c=1e4, rho_s=19e3, E=1e7),  # tungsten
        gravity(0.0, -1500.0) | grains(E=1e8),  # a centrifuge
        gravity(-9.81, 0.0) | {"walls": (gr.Solid((0.0, 0.0), (0.1, 0.6)),)},  # laid on a block
        gravity(0.0, 0.0) | fill(velocity=(1.0, 0.0)),
        gravity(0.0, 0.0) | body(motion={"velocity": ((0.0, -0.1),)}),
        body(at=(0.7, 1.5), motion={"velocity": ((0.0, -2.0),)}),  # comes from above
        body(at=(0.7, 1.5), free="xy", mass=50.0, inertia=0.25),  # falls in
        body(rotation_deg=0.5),
        body(rotation_deg=90.0, motion={**STILL, "angular_velocity": (2 * math.pi,)}),
        inflow(rate=50.0),
        inflow(density=30.0),  # a rain of sand
        inflow(rate=0.1),
        grains(rho_c=15.0, rho_s=25.0, E=1e5),  # beads of foam
        gravity(0.0, -981.0) | FINE | grains(E=1e8),  # a centrifuge
        body(shape=shapes.Box(size=(0.3, 0.04)), free="y", mass=2000.0),  # a footing with its load
        body(
            shape=shapes.Box(size=(0.3, 0.001), rotation_deg=45.0), free="y", mass=0.81
        ),  # a sheet
        body(free="xy", mass=80.0, inertia=2.5),  # a wheel with its motor and gear
        turning(0.3, 62.8),  # a mixer
        turning(0.1, 314.0),  # a cut-off disc
        turning(0.1, 2.0) | gravity(0.0, -1e-4),  # a sampler on an asteroid
        turning(0.1, 2.0, at=(0.7, -0.1)),  # a roller that touches the domain
        {"bodies": (HALF_SPACE, gr.Body(BALL, (0.7, -0.2)))},  # behind a belt
        gravity(9.81, 0.0) | CHUTE,
        gravity(9.81, 0.0) | {"walls": (Wall(0, 1.0),)},  # a floor normal to x
    ],
)
def test_what_may_be_meant(sound):
    assert suspect_numbers(scene_of(**sound)) == []


def test_simulations_and_the_command_tell_them(tmp_path, capsys):
    scene = scene_of(**grains(rho_c=1.5))
    with pytest.warns(gr.StabilityWarning, match="mean 1500"):
        gr.Simulation(scene, threads=1)
    path = tmp_path / "slip.json"
    path.write_text(scene.to_json())
    out = str(tmp_path / "slip.h5")
    cli.main(["run", str(path), "--until", "0.001", "-o", out, "--threads", "1", "--quiet"])
    assert "granular: warning: MuI: rho_c = 1.5" in capsys.readouterr().err


def test_angles_of_ready_scenes_are_in_degrees():
    (sentence,) = suspect_numbers(gr.scenes.incline(angle_deg=math.radians(25.0)))
    assert sentence.startswith("parameters['angle_deg'] = 0.436332, in degrees: did you mean 25")


def test_runs_that_fail_of_soft_grains_name_the_stiffness():
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", gr.StabilityWarning)
        sim = gr.Simulation(scene_of(**grains(E=10.0)), threads=1)
    with pytest.raises(gr.SimulationError, match=r"; E = 10 Pa is too soft: .* p/E = ") as caught:
        sim.run(monitor=False)
    assert caught.value.step == sim.steps

"""SPH scene functions: numbers of the thesis, walls, and wrong arguments."""

import inspect
import math

import numpy as np
import pytest

import granular as gr
from granular import scenes, sph
from granular.cli import main

SMALL = {
    "slump_sph": {"length": 0.1, "height": 0.06, "orifice": 0.03, "duration": 0.1},
    "incline_sph": {"height": 0.05, "duration": 0.1},
    "inclined_collapse": {
        **{"length": 0.06, "height": 0.06, "width": 0.06},
        **{"reach": 0.15, "duration": 0.2, "settle": 0.2},
    },
    "fluidised_bed": {"height": 0.05, "plenum": 0.05, "columns": 4, "duration": 0.02},
    "jet_on_bed": {
        **{"width": 0.2, "depth": 0.1, "headroom": 0.1},
        **{"nozzle": 0.05, "spacing": 0.025, "duration": 0.01},
    },
    "column_collapse_sph": {"spacing": 0.03, "duration": 0.1},
}


@pytest.mark.parametrize("name", sorted({*scenes.names("sph")} - {*scenes.names("mpm")}))
def test_every_scene_is_whole(name):
    make = scenes.registry[name]
    scene = make(**SMALL[name])
    assert sph.Scene.from_json(scene.to_json()) == scene
    known = inspect.signature(make).parameters
    assert make(**{k: v for k, v in scene.parameters.items() if k in known}) == scene
    simulation = gr.Simulation(scene).run(until=min(0.05, scene.duration), monitor=False)
    assert simulation.counts["dropped"] == 0 and np.isfinite(simulation.state.v).all()


def test_the_jet_on_a_bed_is_fed_at_its_speed():
    """Gas of the initial density enters the nozzle, as fast as the scene says."""
    scene = scenes.jet_on_bed(**SMALL["jet_on_bed"])
    (jet,), gas = scene.gas.jets, scene.gas
    assert jet.density == gas.fills[0].density == pytest.approx(gas.pressure / gas.sound_speed**2)
    assert jet.velocity == (0.0, -100.0) and len(scene.walls) == 1


def test_slump_has_the_numbers_of_the_thesis():
    scene = scenes.slump_sph(phi_deg=20.0, dilation=0.5)
    grains = scene.material
    assert (grains.rho0, grains.kappa, grains.dilation) == (1550.0, 1e5, 0.5)
    assert grains.mu_l == grains.mu_h == pytest.approx(0.364, abs=5e-4) and grains.mu_wall is None
    assert scene.n_points == 60 * 50
    *_, floor, plug = scene.walls
    assert floor.span[0] == (0.0, pytest.approx(0.55)) and plug.until == 0.5
    assert scenes.slump_sph(width=0.06).n_points == 6 * 60 * 50


def test_columns_of_the_thesis():
    scene = scenes.column_collapse_sph(aspect=2.0)
    assert scene.n_points == 9 * 18
    assert (scene.material.rho0, scene.material.mu_l, scene.material.mu_wall) == (1404, 0.74, 0.335)
    fine = scenes.column_collapse_sph(aspect=4.0, length=0.025, spacing=0.005, material=sph.glass)
    assert fine.n_points == 5 * 20
    assert (fine.material.rho0, fine.material.mu_h, fine.material.mu_wall) == (1450, 0.456, 0.263)
    assert scenes.column_collapse_sph(width=0.1).n_points == 10 * 162
    gate = scene.walls[2]
    assert (gate.at, gate.side, gate.until) == (pytest.approx(0.09), -1, 0.5)


def test_collapse_by_both_methods_is_the_same_column():
    grid = scenes.column_collapse(aspect=1.0)
    points = scenes.column_collapse(aspect=1.0, method="sph")
    assert isinstance(points, sph.Scene) and points.n_points == grid.n_points
    assert points.duration == grid.duration and points.gravity == grid.gravity
    assert points.grid.upper == pytest.approx(grid.grid.upper)
    mass = points.n_points * points.point_mass
    assert mass == pytest.approx(grid.material.rho_c * 0.04, rel=1e-3)
    given = scenes.column_collapse(method="sph", material=sph.grit)
    assert given.material == sph.grit
    with pytest.raises(ValueError, match="method = 'dem' must be one of"):
        scenes.column_collapse(method="dem")
    with pytest.raises(TypeError, match="material"):
        scenes.column_collapse(method="sph", material="sand")


def test_matching_grains_have_the_friction_of_the_other_law_at_one_pressure():
    beads = gr.materials.glass_beads
    p = 1200.0
    grains = sph.Viscoplastic.matching(beads, p, dilation=0.5)
    rates = np.array([1.0, 10.0, 100.0])
    scaled = rates / (beads.xi * math.sqrt(p))  # I/I0
    theirs = beads.mu_s + (beads.mu_2 - beads.mu_s) / (1.0 / scaled + 1.0)
    ours = grains.mu_l + (grains.mu_h - grains.mu_l) / (grains.D_star / rates + 1.0)
    assert ours == pytest.approx(theirs, rel=1e-12)
    assert grains.dilation == 0.5 and 1.5 * grains.kappa == pytest.approx(beads.K)
    assert grains.shear_modulus == pytest.approx(beads.G, rel=1e-12)
    with pytest.raises(TypeError, match="must be a MuI"):
        sph.Viscoplastic.matching(sph.grit, p)
    with pytest.raises(ValueError, match="pressure = 0"):
        sph.Viscoplastic.matching(beads, 0.0)


def test_walls_push_stiff_particles_no_harder():
    materials = [sph.Viscoplastic(kappa=kappa) for kappa in (1e4, 1e5, 1e7)]
    share = [sph.Numerics().rho0_wall(grains) / grains.rho0 for grains in materials]
    assert share == pytest.approx([0.97, 0.97, 0.9997], abs=1e-12)
    fixed = sph.Numerics(wall_density=0.98)
    assert fixed.rho0_wall(materials[2]) == pytest.approx(0.98 * materials[2].rho0, rel=1e-15)
    # against a seeding lattice at rest
    pressures = [grains.kappa * (s**-1.5 - 1.0) for grains, s in zip(materials, share, strict=True)]
    assert pressures[1:] == pytest.approx([4680, 4500], rel=0.01)


def test_walls_push_a_light_bed_no_harder_than_it_can_bear():
    """Under the gravity of an asteroid, a default bed rests as it does under that of the earth."""
    for g, steps in ((9.81, 300), (0.0981, 3000)):
        scene = scenes.incline_sph(angle_deg=0.0, height=0.08, columns=6, gravity=g)
        simulation = gr.Simulation(scene, threads=1)
        simulation.step(steps)
        assert simulation.state.x[:, 1].max() < 0.08
        assert simulation.state.speed.max() < 0.5 * np.sqrt(g * 0.08)


def test_gate_of_the_channel_lifts_clear_and_goes():
    scene = scenes.inclined_collapse(side_walls=True)
    floor, left, *sides, gate = scene.walls
    assert floor.axis == 2 and left.axis == 0 and [wall.axis for wall in sides] == [1, 1]
    assert gate.velocity == (0.0, 0.0, 2.0) and gate.moves_from == 0.5
    # when removed, its lower edge is higher than the highest particles reach
    risen = 2.0 * (gate.until - gate.moves_from)
    assert risen == pytest.approx(0.14 + 2.0 * scene.h)
    assert scenes.inclined_collapse(side_walls=False).grid.periodic == (False, True, False)
    assert scene.material.mu_l == 0.435 and scene.material.mu_wall is None
    g = scenes.inclined_collapse(angle_deg=22.0).gravity.at(1.0)
    assert math.degrees(math.atan2(g[0], -g[2])) == pytest.approx(22.0)


def test_orifice_opens_and_particles_fall():
    scene = scenes.slump_sph(**SMALL["slump_sph"] | {"settle": 0.3, "duration": 0.4})
    simulation = gr.Simulation(scene)
    simulation.run(0.29, monitor=False)
    assert simulation.state.x[:, 1].min() > 0.0 and simulation.counts["dropped"] == 0
    simulation.run(monitor=False)
    assert simulation.counts["dropped"] > 5
    left = simulation.state.x[:, 0] < 0.07
    assert simulation.state.x[left, 1].min() >= 0.0


@pytest.mark.parametrize(
    ("name", "arguments", "words"),
    [
        ("slump_sph", {"phi_deg": 90.0}, "phi_deg = 90"),
        ("slump_sph", {"orifice": 0.6}, "orifice = 0.6 must be less than length"),
        ("slump_sph", {"width": 0.015}, "width = 0.015 must be a whole number"),
        ("slump_sph", {"settle": 0.0}, "settle = 0"),
        ("inclined_collapse", {"angle_deg": -1.0}, "angle_deg = -1"),
        ("inclined_collapse", {"reach": 0.1}, "reach = 0.1 must exceed length"),
        ("inclined_collapse", {"width": 0.0}, "side_walls = True must have a width"),
        ("inclined_collapse", {"lift": 0.0}, "lift = 0"),
        ("inclined_collapse", {"dilation": 2.0}, "dilation = 2"),
        ("column_collapse_sph", {"aspect": -1.0}, "aspect = -1"),
        ("column_collapse_sph", {"reach": 0.01}, r"reach = 0\.01 must not be less"),
    ],
)
def test_wrong_arguments_are_named(name, arguments, words):
    with pytest.raises(ValueError, match=words):
        getattr(scenes, name)(**arguments)


def test_command_line_runs_them(tmp_path, capsys):
    out = str(tmp_path / "a.h5")
    words = ["--length", "0.1", "--height", "0.06", "--orifice", "0.03", "--duration", "0.05"]
    words += ["--nu", "0.3", "--mu_wall", "0.2"]
    assert main(["run", "slump_sph", *words, "-o", out, "--quiet", "--until", "0.05"]) == 0
    with gr.open(out) as record:
        assert record.scene.name == "slump_sph"
        assert (record.scene.material.nu, record.scene.material.mu_wall) == (0.3, 0.2)
    assert main(["run", "incline_sph", "--E", "1e6", "-o", out, "--quiet"]) == 2
    assert main(["list"]) == 0
    assert "inclined_collapse: " in capsys.readouterr().out

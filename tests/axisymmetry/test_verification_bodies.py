"""Bodies of revolution: volume, areas, the force of Archimedes, the pressure of Janssen."""

import math

import numpy as np
import pytest
from scenes_by_hand import scene_with

import granular as gr
from granular.measure.surface_area import body_surface, wall_surface

CELL, COLUMNS, ROWS = 0.02, 16, 36
SHAPES = {
    "ball": (gr.Cylinder(0.06, center=(0.0, 0.0)), 4 / 3 * math.pi * 0.06**3),
    "ring": (gr.Cylinder(0.05, center=(0.15, 0.0)), math.pi * 0.05**2 * 2 * math.pi * 0.15),
    "cone": (
        gr.Polygon([(-0.08, 0.08), (0.0, -0.08), (0.08, 0.08)]),
        math.pi * 0.08**2 * 0.16 / 3,
    ),
}


@pytest.mark.parametrize("name", SHAPES)
def test_a_bed_holds_bodies_up_by_the_weight_that_they_displace(name):
    """To 4 % with balls 6 cells across, of which no point is lost: the volume is exact to 1e-6."""
    shape, volume = SHAPES[name]
    width, height = COLUMNS * CELL, ROWS * CELL
    scene = scene_with(
        grid=gr.Grid((0.0, 0.0), CELL, (COLUMNS, ROWS + 4), axisymmetric=True),
        fills=(gr.Fill(gr.Box((0.0, 0.0), (width, height)), 9, lithostatic=True, K0=1.0),),
        material=gr.DruckerPrager(E=1e6, mu=0.02, rho_s=2500.0),
        walls=(gr.Wall(1, 0.0, kind="free_slip"), gr.Wall(0, width, kind="free_slip")),
        bodies=(gr.Body(shape, (0.0, 0.35)),),
    )
    sim = gr.Simulation(scene, threads=1)
    assert sim.state.volume.sum() == pytest.approx(math.pi * width**2 * height - volume, rel=1e-6)
    sim.run(until=0.1)
    before, start = sim.bodies[0].impulse.copy(), sim.time
    sim.run(until=0.2)
    force = (sim.bodies[0].impulse - before) / (sim.time - start)
    assert force[1] == pytest.approx(1500.0 * 9.8 * volume, rel=0.04)


def test_areas_are_those_of_rings():
    """Of a ball, a ring and a cone to 1 %; of the floor and the side of a silo exactly."""
    grid = gr.Grid((0.0, 0.0), CELL, (COLUMNS, ROWS), axisymmetric=True)
    R, H = grid.upper
    top = (gr.Fill(gr.Box((0.0, 0.6), grid.upper), 1),)
    walls = (gr.Wall(1, 0.0, span=((0.1, 0.26),)), gr.Wall(0, R))
    areas = {"ball": 4 * math.pi * 0.06**2, "ring": 4 * math.pi**2 * 0.05 * 0.15}
    areas["cone"] = math.pi * 0.08 * (0.08 + math.hypot(0.08, 0.16))
    for name, (shape, _) in SHAPES.items():
        scene = scene_with(grid=grid, fills=top, walls=walls, bodies=(gr.Body(shape, (0.0, 0.35)),))
        assert body_surface(scene, 0).area.sum() == pytest.approx(areas[name], rel=0.01)
    empty = scene_with(grid=grid, fills=top, walls=walls)
    floor, side = (wall_surface(empty, k).area.sum() for k in range(2))
    assert floor == pytest.approx(math.pi * (0.26**2 - 0.1**2), rel=1e-12)
    assert side == pytest.approx(2 * math.pi * R * H, rel=1e-12)


def test_the_wall_of_a_round_bin_bears_the_pressure_of_janssen(tmp_path):
    """At rest, with friction mobilised along the wall; bins add up to the force on the wall."""
    scene = gr.scenes.hopper(
        axisymmetric=True, orifice=0.1, width=0.2, angle_deg=30.0, friction=0.3, fill_height=0.6,
        cell=0.0125, points_per_cell=9, ramp=0.4, opens_at=1.0, duration=0.5, E=1e7, nu=0.4,
    )  # fmt: skip
    gr.Simulation(scene, threads=2, tractions=True).run(save=tmp_path / "bin.h5", every=0.02)
    with gr.open(tmp_path / "bin.h5") as record:
        bins = np.linspace(0.15, 0.5, 6)
        upright = gr.measure.wall_traction(record, body=1, bins=bins)
        whole = gr.measure.wall_traction(record, body=1)
        force = gr.measure.body_force(record, body=1, total=False).force
    rest = upright.mean(0.4, 0.5)
    np.testing.assert_allclose(rest.friction, 0.3, rtol=0.05)
    ratio = scene.material.nu / (1 - scene.material.nu)
    theory = ratio * gr.theory.janssen_pressure(
        0.6 - rest.position, 0.2, friction=0.3, ratio=ratio, rho=scene.material.rho_c, dim=3
    )
    np.testing.assert_allclose(rest.normal, theory, rtol=0.05)
    np.testing.assert_allclose(whole.force, force, rtol=1e-12)
    sums = np.nansum(whole.normal * whole.area, axis=1)
    np.testing.assert_allclose(sums[-5:], whole.force[-5:, 0], rtol=1e-6)

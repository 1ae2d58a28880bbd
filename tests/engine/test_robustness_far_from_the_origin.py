"""Scenes at the coordinates of maps (UTM), whose rounding is far above 1e-9 cells."""

import numpy as np
import pytest
from scenes_by_hand import scene_with

import granular as gr
from granular import Solid, SpongeLayer, Wall
from granular.model.grid import COARSEST
from granular.mpm.cell_codes import cell_flags, fluidity_faces
from granular.mpm.node_codes import node_codes
from granular.mpm.rigid_contact import FAR, obstacles
from granular.mpm.wall_owners import wall_owners

CELL = 0.013
SHIFTS = [(5e5, 5e6), (-3e4, 1e3), (4.5e5, 5.2e6 + 1 / 3)]


def scene_at(shift, basis="quadratic"):
    """Walls with spans and a gate, blocks, a piston and a free body on one, all on grid lines."""

    def at(x, y):
        return tuple((np.array(shift) + np.array([x, y]) * CELL).tolist())

    def x(cells):
        return at(cells, 0)[0]

    def y(cells):
        return at(0, cells)[1]

    piston = gr.Inflow(gr.Box(at(25, 12), at(28, 14)), (0.0, -0.3), 4, driven=True)
    block = gr.shapes.Box(size=(5 * CELL, 4 * CELL))
    corners = [at(7.2, 0.3), at(12.5, 0.0), at(10.0, 5.0)]
    return scene_with(
        grid=gr.Grid(at(0, 0), CELL, (30, 20)),
        fills=(
            gr.Fill(gr.Box(at(0, 0), at(7, 6)), 4, lithostatic=True),
            gr.Fill(gr.Polygon(corners), 4, jitter=0.5),
        ),
        material=gr.MuI(E=1e5),
        scheme=gr.Scheme(basis=basis, transfer="tpic", density=gr.ParticleDensity()),
        walls=(
            Wall(0, x(0)),
            Wall(1, y(0), kind="coulomb", friction=0.4),
            Wall(0, x(7), span=((y(3), y(9)),), kind="free_slip"),
            Wall(1, y(9), span=((x(7), x(13)),), opens_at=0.01),
            Wall(1, y(20), velocity=(0.1, 0.0)),
            Solid(at(13, 0), at(17, 3)),
            Solid(at(17, 0), at(19, 2), kind="free_slip"),
        ),
        bodies=(gr.Body(block, at(19.5, 5.0), mass=5.0, free="xy", inertia=0.1),),
        inflows=(piston,),
        sponge_layers=(SpongeLayer(1, y(18)),),
    )


@pytest.mark.parametrize("basis", ["linear", "ugimp", "quadratic"])
def test_codes_and_runs_are_those_at_the_origin(basis):
    """The codes are the same; a run differs by the roundings of the points, which grow."""
    near = scene_at((0.0, 0.0), basis)
    codes, rows = node_codes(near)
    sim = gr.Simulation(near, threads=1)
    sim.step(50)
    for shift in SHIFTS:
        far = scene_at(shift, basis)
        far_codes, far_rows = node_codes(far)
        assert far_rows == rows and np.array_equal(far_codes.dense(), codes.dense())
        assert np.array_equal(cell_flags(far).dense(), cell_flags(near).dense())
        assert np.array_equal(fluidity_faces(far), fluidity_faces(near))
        assert all(map(np.array_equal, wall_owners(far), wall_owners(near)))
        assert np.array_equal(abs(obstacles(far)) == FAR, abs(obstacles(near)) == FAR)
        other = gr.Simulation(far, threads=1)
        other.step(50)
        assert other.n_points == sim.n_points
        assert np.allclose(other.state.x - shift, sim.state.x, rtol=0, atol=0.01 * CELL)
        assert np.allclose(other.bodies[0].position - shift, sim.bodies[0].position, atol=1e-8)


def test_samples_maps_and_inlets_end_where_the_grid_does():
    """One square or height more would reach beyond it; an inlet may touch a body."""
    x0, y0 = SHIFTS[-1]
    high = (x0 + 30 * CELL, y0 + 20 * CELL)
    plate = gr.sph.ParticleWall(1, y0, 1, span=((x0 - 2 * CELL, x0 + 7 * CELL),))
    assert plate.lines("plate", gr.Grid((x0, y0), CELL, (30, 20))) == [(-2, 7), (-5, 0)]
    mask = gr.Mask.of(lambda x: np.ones(len(x)), SHIFTS[-1], high, CELL / 2)
    assert mask.inside.shape == (60, 40)
    assert gr.Heights.of(1.0, x0, high[0], CELL).z.shape == (31,)
    ground = gr.shapes.HeightMap(np.full(31, 0.1), CELL, origin=(0.0,))
    scene = scene_at(SHIFTS[-1])
    inlet = gr.Inflow(gr.Box((x0 + 2 * CELL, y0 + 16 * CELL), high), (0.0, -0.3), 4)
    for body in (
        gr.Body(ground, (x0, y0 - 1.0)),
        gr.Body(gr.shapes.Box(size=(CELL * 2, CELL * 8)), (x0 + CELL, y0 + 16 * CELL)),
    ):
        scene.replace(bodies=(body,), inflows=(inlet,), sponge_layers=())


def test_grids_whose_cells_are_lost_in_rounding_are_refused():
    with pytest.raises(ValueError, match=f"cell = 0.001 must be .* must be <= {COARSEST}"):
        gr.Grid((0.0, 1e10), 1e-3, (10, 10))

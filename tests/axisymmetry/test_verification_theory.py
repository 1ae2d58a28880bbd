"""Rings against theory: rigid and homogeneous motion, waves and static stresses of cylinders."""

import math

import numpy as np
import pytest
from scenes_by_hand import scene_with
from scipy import special
from stages import living

import granular as gr

ELASTIC = gr.materials.Elastic(E=1e6, nu=0.3, rho_c=1000.0)
LINEAR_FLIP = gr.Scheme(basis="linear", transfer="flip", density=gr.ParticleDensity())
QUADRATIC_APIC = gr.Scheme(transfer="apic", density=gr.ParticleDensity())
SCHEMES = {
    "linear flip": LINEAR_FLIP,
    "quadratic apic": QUADRATIC_APIC,
    "default": gr.schemes.default,
    "cell averaged": gr.schemes.cell_averaged,
}


def cylinder(cells, rows, *, first=0, material=ELASTIC, scheme=QUADRATIC_APIC, walls=(), **parts):
    """A cylinder, or from the radius `first` [cells] on a tube, that fills its grid of radius 1."""
    cell = 1.0 / cells
    low, high = first * cell, (first + cells) * cell
    grid = gr.Grid((low, 0.0), cell, (cells, rows), axisymmetric=True)
    fill = {"jitter": 0.0, "points_per_cell": 4} | parts.pop("fill", {})
    return scene_with(
        grid=grid,
        fills=(gr.Fill(gr.Box((low, 0.0), (high, rows * cell)), **fill),),
        material=material,
        scheme=scheme,
        walls=tuple(walls),
        **{"gravity": 0.0} | parts,
    )


def started(scene, v, affine=None):
    """Simulation with given velocities (n, 2) and velocity gradients (n, 2, 2) of positions."""
    sim = gr.Simulation(scene, threads=1)
    at = living(sim)
    x = sim.buffers["x"][:, at].T
    sim.buffers["v"][:, at] = v(x).T
    if affine is not None and "affine" in sim.buffers:
        sim.buffers["affine"][:, at] = affine(x).reshape(len(x), 4).T
    return sim, x.copy()


@pytest.mark.parametrize("basis", ["linear", "quadratic"])
@pytest.mark.parametrize("transfer", ["apic", "tpic"])
def test_a_homogeneous_flow_is_exact_up_to_the_axis(basis, transfer):
    """v = (a r, b z): the rings stretch at the rate a, wherever the points are."""
    scheme = gr.Scheme(basis=basis, transfer=transfer, density=gr.ParticleDensity(), dt=1e-6)
    a, b = 1.0, -0.7
    scene = cylinder(8, 8, scheme=scheme, fill={"jitter": 1.0}, seed=4)
    sim, x = started(
        scene, lambda x: x * (a, b), lambda x: np.tile(np.diag([a, b]), (len(x), 1, 1))
    )
    assert x[:, 0].min() < 0.1 * scene.grid.cell
    sim.step()
    lame, G = ELASTIC.K - 2 * ELASTIC.G / 3, ELASTIC.G
    stress = sim.state.stress / sim.dt
    np.testing.assert_allclose(sim.state.log_density / sim.dt, -(2 * a + b), rtol=1e-13)
    np.testing.assert_allclose(stress[:, 2], lame * (2 * a + b) + 2 * G * a, rtol=1e-12)
    np.testing.assert_allclose(stress[:, 0], stress[:, 2], rtol=1e-12)


@pytest.mark.parametrize("scheme", SCHEMES.values(), ids=SCHEMES)
def test_free_fall_along_the_axis_is_exact(scheme):
    scene = cylinder(6, 8, scheme=scheme, material=gr.MuI(E=1e6), gravity=9.8, fill={"jitter": 1.0})
    box = gr.Box((0.0, 0.5), (0.8, 1.0))
    sim = gr.Simulation(scene.replace(fills=(gr.Fill(box, 4, jitter=1.0),)), threads=1)
    begin = sim.state.x
    sim.step(60)
    state = sim.state
    moved = state.x - begin
    np.testing.assert_allclose(state.v, np.tile([0.0, -9.8 * sim.time], (state.n, 1)), atol=1e-13)
    np.testing.assert_allclose(moved, np.tile([0.0, moved[0, 1]], (state.n, 1)), atol=1e-14)
    assert moved[0, 1] == pytest.approx(-0.5 * 9.8 * sim.time**2, rel=0.03)
    assert abs(state.log_density).max() < 1e-12


def wave_error(cells, scheme):
    """Error of the displacement of the radial standing wave J1(k r) after a quarter of a period."""
    k, c, amplitude = special.jn_zeros(1, 1)[0], ELASTIC.wave_speed, 1e-4
    smooth = [gr.Wall(0, 1.0, kind="free_slip")]
    smooth += [gr.Wall(1, z / cells, kind="free_slip") for z in (0, 4)]
    scene = cylinder(cells, 4, scheme=scheme, walls=smooth)

    def slope(x):
        out = np.zeros((len(x), 2, 2))
        out[:, 0, 0] = 0.5 * (special.j0(k * x[:, 0]) - special.jn(2, k * x[:, 0]))
        return amplitude * c * k * out

    def wave(x):
        return np.stack([amplitude * c * special.j1(k * x[:, 0]), np.zeros(len(x))], axis=1)

    sim, x = started(scene, wave, slope)
    sim.run(until=math.pi / 2 / (k * c))
    expected = amplitude / k * special.j1(k * x[:, 0]) * math.sin(k * c * sim.time)
    error = sim.state.x[:, 0] - x[:, 0] - expected
    return np.sqrt(np.mean(error**2)) / abs(expected).max()


@pytest.mark.parametrize("scheme", SCHEMES.values(), ids=SCHEMES)
def test_a_radial_wave_converges_with_the_square_of_the_cell(scheme):
    """Bessel's function J1, which the tension of rings alone distinguishes from a plane wave.

    With cell averages, whose density takes no differences across walls, the order is 1.5.
    """
    averaged = scheme is gr.schemes.cell_averaged
    errors = [wave_error(cells, scheme) for cells in (8, 16)]
    assert errors[1] < (1.4e-2 if averaged else 6e-3)
    assert math.log2(errors[0] / errors[1]) > (1.5 if averaged else 1.8)


def lame_error(cells, scheme):
    """Error of the displacement of a pressed tube that expands into its hole, by Lame's solution.

    Its outer surface, of the radius 2, is held; damping lets it come to rest.
    """
    p, a, b = 100.0, 1.0, 2.0
    material = ELASTIC.replace(restitution=0.3, contact_diameter=0.7)
    cell = 1.0 / cells
    grid = gr.Grid((a - 4 * cell, 0.0), cell, (cells + 4, 4), axisymmetric=True)
    walls = [gr.Wall(0, b, kind="free_slip")]
    walls += [gr.Wall(1, z * cell, kind="free_slip") for z in (0, 4)]
    scene = scene_with(
        grid=grid,
        fills=(gr.Fill(gr.Box((a, 0.0), (b, 4 * cell)), 4),),
        material=material,
        scheme=scheme,
        walls=tuple(walls),
        gravity=0.0,
    )
    sim, x = started(scene, np.zeros_like)
    sim.buffers["stress"][:3, living(sim)] = -p
    sim.run(until=40.0 / material.wave_speed)
    lame, modulus = material.K - 2 * material.G / 3, material.K + 4 * material.G / 3
    A = p / (modulus * (1 + (b / a) ** 2) + lame * (1 - (b / a) ** 2))
    r = x[:, 0]
    expected = A * (r - b**2 / r)
    error = sim.state.x[:, 0] - r - expected
    return np.sqrt(np.mean(error**2)) / abs(expected).max()


@pytest.mark.parametrize("scheme", [LINEAR_FLIP, QUADRATIC_APIC], ids=["linear", "quadratic"])
def test_a_thick_tube_has_the_displacement_of_lame(scheme):
    errors = [lame_error(cells, scheme) for cells in (8, 16)]
    assert errors[1] < 5e-4
    assert math.log2(errors[0] / errors[1]) > 1.8


def bed(cells, rows, *, axisymmetric=True, **parts):
    """A bed of granular material that begins at rest under its weight, in a smooth cylinder."""
    cell = 0.01
    grid = gr.Grid((0.0, 0.0), cell, (cells, rows + 6), axisymmetric=axisymmetric)
    walls = [gr.Wall(0, cells * cell, kind="free_slip"), gr.Wall(1, 0.0, kind="free_slip")]
    if not axisymmetric:
        walls.append(gr.Wall(0, 0.0, kind="free_slip"))
    box = gr.Box((0.0, 0.0), (cells * cell, rows * cell))
    given = {"walls": tuple(walls), "material": gr.MuI(E=1e7)}
    fill = gr.Fill(box, 4, lithostatic=True, jitter=0.5)
    return scene_with(grid=grid, fills=(fill,), **given | parts)


def pressure_error(scene):
    """Error of the vertical stress of cells, over that at the floor: of all, and at the axis."""
    sim = gr.Simulation(scene, threads=1)
    sim.run(until=0.5)
    state, cell = sim.state, scene.grid.cell
    mean = gr.measure.cell_average(state, -state.stress[:, 1], weight="volume")
    rows = scene.grid.shape[1] - 6
    inner = mean.cells[:, 1] < rows - 2
    depth = (rows - mean.cells[:, 1] - 0.5) * cell
    full = scene.material.rho_c * 9.8
    error = (mean.value - full * depth) / (full * rows * cell)
    first = inner & (mean.cells[:, 0] == 0)
    return np.sqrt(np.mean(error[inner] ** 2)), np.sqrt(np.mean(error[first] ** 2))


def test_a_bed_at_rest_has_the_pressure_of_its_depth():
    """To 1 % of that at the floor; at the axis, which only one side borders, to 3 %."""
    of_rings, at_axis = pressure_error(bed(16, 20))
    of_plane, _ = pressure_error(bed(16, 20, axisymmetric=False))
    assert of_rings < 0.011
    assert of_rings < 2.0 * of_plane
    assert at_axis < 0.035

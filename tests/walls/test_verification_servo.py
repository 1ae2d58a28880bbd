"""Walls that keep a pressure or move along themselves: shear cells, loading, restart, refusals."""

import itertools
import math
import warnings

import numpy as np
import pytest

import granular as gr
from granular.mpm import engine as core
from granular.mpm.scaling import Froude
from granular.mpm.wall_owners import wall_owners

CELL, KEPT = 0.01, 1000.0
SCHEMES = {"smoothed": gr.schemes.default, "cell_averaged": gr.schemes.cell_averaged}
DENSITIES = pytest.mark.parametrize("density", SCHEMES)
SCALED_I = 0.4
"""I/I0 of the shear cells, in the middle of the range in which mu(I) is well posed."""


def shear_rate(scene):
    """Shear rate [1/s] of a shear cell in steady flow, from I/I0 = shear_rate/(xi sqrt(p))."""
    return SCALED_I * scene.material.xi * math.sqrt(KEPT)


def height(scene):
    return scene.grid.shape[-1] * scene.grid.cell


def cell_between_walls(
    density="smoothed",
    dim=2,
    *,
    columns=4,
    layers=20,
    E=1e6,
    pressure=KEPT,
    speed=None,
    start=KEPT,
    gravity=0.0,
    jitter=0.6,
    filled=1.0,
    **options,
):
    """Periodic columns between two rough walls; the upper one keeps a pressure and moves along x.

    Parameters
    ----------
    speed : float or None
        Of the upper wall [m/s]; None for that which makes I/I0 = SCALED_I.
    start : float
        Pressure of the material at the start [Pa].
    gravity : float
        Along x [m/s2].
    filled : float
        Part of the height that is filled.
    options
        Further arguments of the scene.
    """
    last, material = dim - 1, gr.MuI(E=E)
    top = layers * CELL
    zero = (0.0,) * last
    if speed is None:
        speed = SCALED_I * material.xi * math.sqrt(KEPT) * top
    box = gr.Box((0.0,) * dim, (columns * CELL,) * last + (filled * top,))
    given = {
        "name": "cell",
        "grid": gr.Grid(
            (0.0,) * dim, CELL, (columns,) * last + (layers,), periodic=(True,) * last + (False,)
        ),
        "fills": (
            gr.Fill(
                box, 2**dim, density=material.rho_c * math.exp(start / material.K), jitter=jitter
            ),
        ),
        "material": material,
        "scheme": SCHEMES[density],
        "walls": (
            gr.Wall(last, 0.0),
            gr.Wall(last, top, pressure=pressure, velocity=(speed, *zero) if speed else None),
        ),
        "gravity": gr.Gravity((0.0,), ((gravity, *zero),)),
        "duration": 1.0,
    }
    return gr.Scene(**(given | options))


def in_flow(scene, **options):
    """Simulation of a scene that begins with a uniform shear rate."""
    sim = gr.Simulation(scene, threads=1, **options)
    buffers = sim.buffers
    speed = scene.walls[1].velocity[0]
    buffers["v"][0] = speed * buffers["x"][scene.dim - 1] / height(scene)
    return sim


def quiet(scene):
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", gr.StabilityWarning)
        return gr.Simulation(scene, threads=1)


def mean_pressure(state):
    volume = state.mass / state.density
    return float(volume @ state.pressure / volume.sum())


def layers_of(state, scene, values):
    """Means by mass of values of the points in ten layers of equal height."""
    y, top = state.x[:, -1], height(scene)
    mass = np.histogram(y, 10, (0.0, top), weights=state.mass)[0]
    return np.histogram(y, 10, (0.0, top), weights=state.mass * values)[0] / mass


# ---- steady flow ----


def period_of_the_wave(scene):
    """Period [s] of the longest compression wave between the walls, 2 H sqrt(rho/K).

    Material that yields answers to a compression by K alone. The noise of the points keeps this
    wave going, and the servo, which reads the pressure at one wall, gives it to all material: the
    mean pressure of stiff material swings by a tenth in this period.
    """
    return 2 * height(scene) * math.sqrt(scene.material.rho_c / scene.material.K)


def follow(scene, strain):
    """Means over a shear strain, after one of 7: pressures, profiles, stresses on the wall.

    Four samples to each period of the compression wave: fewer are taken at chance phases of it.
    """
    rate, sim = shear_rate(scene), in_flow(scene)
    sim.run(7.0 / rate)
    before, begin = sim.walls[1], sim.time
    pressures, profiles, speeds = [], [], []
    samples = math.ceil(4 * strain / rate / period_of_the_wave(scene))
    for t in np.linspace(7.0 / rate, (7.0 + strain) / rate, samples + 1)[1:]:
        sim.run(t)
        state = sim.state
        pressures.append(mean_pressure(state))
        profiles.append(layers_of(state, scene, state.pressure))
        speeds.append(layers_of(state, scene, state.v[:, 0]))
    area = (scene.grid.shape[0] * CELL) ** (scene.dim - 1)
    stress = (sim.walls[1].impulse - before.impulse) / (sim.time - begin) / area
    return sim, np.array(pressures), np.mean(profiles, axis=0), np.mean(speeds, axis=0), stress


def slow(*values):
    return pytest.param(*values, marks=pytest.mark.slow)


@pytest.mark.parametrize(
    ("density", "dim", "E", "strain"),
    [
        ("smoothed", 2, 1e6, 15.0),
        ("cell_averaged", 2, 1e6, 15.0),
        slow("smoothed", 2, 1e6, 100.0),
        slow("cell_averaged", 2, 1e6, 100.0),
        slow("smoothed", 2, 1e7, 100.0),
        slow("cell_averaged", 2, 1e7, 100.0),
        slow("smoothed", 3, 1e6, 100.0),
        slow("cell_averaged", 3, 1e6, 100.0),
        slow("smoothed", 3, 1e7, 40.0),
        slow("cell_averaged", 3, 1e7, 40.0),
    ],
)
def test_plane_shear_keeps_its_pressure_and_flows_by_the_law(density, dim, E, strain):
    scene = cell_between_walls(density, dim, E=E, layers=20 if dim == 2 else 12)
    material, speed = scene.material, scene.walls[1].velocity[0]
    sim, pressures, profile, speeds, stress = follow(scene, strain)
    assert abs(stress[-1] / KEPT - 1) < 0.01
    assert abs(pressures.mean() / KEPT - 1) < 0.01
    assert np.abs(profile / KEPT - 1).max() < 0.05
    linear = speed * (np.arange(10) + 0.5) / 10
    inside = np.abs(speeds - linear)[1:-1]  # at walls points store other velocities than they have
    assert inside.max() < 0.01 * speed
    mu = material.mu_s + (material.mu_2 - material.mu_s) / (1 / SCALED_I + 1)
    assert abs(-stress[0] / stress[-1] / mu - 1) < 0.01
    assert abs(sim.walls[1].displacement) < 0.2 * CELL
    assert sim.health().ok


@DENSITIES
def test_without_a_pressure_the_flow_loses_it(density):
    """The closed cell, of which a warning tells, needs the servo."""
    scene = cell_between_walls(density, pressure=None)
    with pytest.warns(gr.StabilityWarning, match="closed in on every side"):
        sim = in_flow(scene)
    sim.run(2.0)
    assert abs(mean_pressure(sim.state) / KEPT - 1) > 0.3


@DENSITIES
def test_flow_along_fixed_walls_under_gravity(density):
    """Between walls at rest: tau/P = mu |1 - 2 y/H|, and mu(I) gives the profile by quadrature.

    The middle does not yield; its pressure along x is what the start has left, so that the stress
    across it is compared.
    """
    mu, top = 0.57, 0.2
    material = gr.MuI(E=1e6)
    gravity = 2 * mu * KEPT / (material.rho_c * top)
    scene = cell_between_walls(density, speed=0.0, gravity=gravity)
    y = np.linspace(0.0, top / 2, 2001)
    friction = np.maximum(mu * (1 - 2 * y / top), material.mu_s)
    rate = material.xi * math.sqrt(KEPT) * (friction - material.mu_s) / (material.mu_2 - friction)
    wide = np.cumsum(rate[:-1] + rate[1:]) * (y[1] - y[0]) / 2
    sim = gr.Simulation(scene, threads=1)
    buffers = sim.buffers
    x = buffers["x"][1]
    buffers["v"][0] = np.interp(np.minimum(x, top - x), y[1:], wide)
    sim.run(0.5)
    before, across, speeds = sim.walls[1].impulse[1], [], []
    for t in np.linspace(0.5, 2.0, 31)[1:]:
        sim.run(t)
        state = sim.state
        across.append(layers_of(state, scene, -state.stress[:, 1]))
        speeds.append(layers_of(state, scene, state.v[:, 0]))
    x = state.x[:, 1]
    expected = layers_of(state, scene, np.interp(np.minimum(x, top - x), y[1:], wide))
    assert abs((sim.walls[1].impulse[1] - before) / 1.5 / (4 * CELL) / KEPT - 1) < 0.01
    assert np.abs(np.mean(across, axis=0) / KEPT - 1).max() < 0.06
    assert np.abs(np.mean(speeds, axis=0) - expected).max() < 0.08 * expected.max()


# ---- loading ----


@DENSITIES
@pytest.mark.parametrize("dim", [2, 3])
@pytest.mark.parametrize("below", [False, True])
def test_loading_is_exponential(density, dim, below):
    """p = P (1 - exp(-t/T)), T = 8 dx/c_w; the work is the energy stored, and the volume p/K."""
    scene = cell_between_walls(density, dim, layers=8, speed=0.0, start=0.0, jitter=0.0)
    if below:
        walls = (gr.Wall(dim - 1, 0.0, pressure=KEPT), gr.Wall(dim - 1, height(scene)))
        scene = scene.replace(walls=walls)
    kept = 0 if below else 1
    material = scene.material
    time = core.SERVO_CELLS * CELL / material.wave_speed
    sim = gr.Simulation(scene, threads=1)
    for times in (0.5, 1.0, 2.0):
        sim.run(times * time)
        expected = KEPT * (1 - math.exp(-sim.time / time))
        delay = 2 * CELL / material.wave_speed * KEPT / time  # of an averaging of the density
        assert abs(mean_pressure(sim.state) - expected) < delay
    sim.run(30 * time)
    state, wall = sim.state, sim.walls[kept]
    np.testing.assert_allclose(
        state.pressure, KEPT, rtol=0.01
    )  # points next to walls sample less well
    strain = wall.displacement / height(scene)
    assert abs(strain + KEPT / material.K) < 0.01 * KEPT / material.K
    stored = float(np.sum(state.mass / state.density * state.pressure**2)) / (2 * material.K)
    # The force before the wall moves, by dt/T of the way, does the work: some 3 % too little.
    assert 0.95 * stored < wall.work <= stored
    assert sim.walls[1 - kept].displacement == sim.walls[1 - kept].work == 0.0


def test_work_of_a_moving_wall():
    """The wall does the work that plastic flow dissipates; none of it counts as created."""
    scene = cell_between_walls()
    sim = in_flow(scene)
    sim.run(0.5)
    before = sim.walls[1]
    sim.run(1.0)
    after, speed = sim.walls[1], scene.walls[1].velocity[0]
    by_drag = -(after.impulse[0] - before.impulse[0]) * speed
    moved = after.displacement - before.displacement
    assert by_drag > 0
    assert abs(after.work - before.work - by_drag + KEPT * 4 * CELL * moved) < 0.01 * by_drag
    assert sim.walls[0].work == 0.0
    assert sim.health()["energy_created"].verdict != "suspect"


# ---- contact, opening, emptiness ----


def test_a_wall_without_contact_waits():
    scene = cell_between_walls(filled=0.5, speed=0.0)
    (warning,) = gr.scene_warnings(scene)
    assert warning.startswith("walls[1] keeps a pressure, but the material does not fill")
    sim = quiet(scene)
    sim.run(0.05)
    assert sim.walls[1].displacement == 0.0 and sim.steps > 100


@DENSITIES
def test_a_wall_that_opens_keeps_nothing(density):
    walls = (gr.Wall(1, 0.0), gr.Wall(1, 0.2, pressure=KEPT, opens_at=0.02))
    scene = cell_between_walls(density, walls=walls, start=0.0)
    assert gr.scene_warnings(scene) == []
    sim = gr.Simulation(scene, threads=1)
    sim.run(0.02)
    there = sim.walls[1].displacement
    assert there < 0
    sim.run(0.1)
    assert sim.walls[1].displacement == there


def test_what_the_wall_moved_by_stops_at_a_tenth_of_the_height():
    """Far more than stiff material needs: here the wall is to keep more than the material bears."""
    scene = cell_between_walls(pressure=3e5, speed=0.0)
    sim = quiet(scene)
    with pytest.warns(gr.StabilityWarning, match="wall_strain"):
        sim.run(2.0, every=0.02)
    assert sim.walls[1].displacement == pytest.approx(-core.MOST_STRAIN * 0.2)


def test_an_empty_domain():
    """All points leave through the open sides; the wall finds nothing to press on."""
    grid = gr.Grid((0.0, 0.0), CELL, (4, 8), open_sides=frozenset({"x-", "x+"}))
    fill = gr.Fill(gr.Box((0.0, 0.0), (0.04, 0.08)), 4, velocity=(5.0, 0.0))
    walls = (gr.Wall(1, 0.0, kind="free_slip"), gr.Wall(1, 0.08, kind="free_slip", pressure=KEPT))
    scene = cell_between_walls(grid=grid, fills=(fill,), walls=walls)
    sim = quiet(scene)
    sim.run(0.1)
    assert sim.n_points == 0
    rest = sim.walls[1]
    sim.run(0.2)
    assert sim.walls[1].displacement == rest.displacement


# ---- the same bits ----


def in_order(sim):
    """Fields of the points in the order of their ids."""
    ids = sim.buffers["id"]
    places = np.flatnonzero(ids >= 0)[np.argsort(ids[ids >= 0])]
    return {name: values[..., places] for name, values in sim.buffers.items()}


@DENSITIES
@pytest.mark.parametrize("dim", [2, 3])
def test_threads_and_a_restart_give_the_same_bits(density, dim, tmp_path):
    scene = cell_between_walls(density, dim, layers=8)
    path = tmp_path / "cell.h5"
    end = 0.03 if dim == 2 else 0.01
    sims = [gr.Simulation(scene, threads=n).run(end) for n in (1, 2)]
    half = gr.Simulation(scene, threads=1)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", gr.StabilityWarning)
        half.run(0.47 * end, save=path, every=0.1 * end)
        resumed = gr.Simulation.resume(path, threads=2)
        assert resumed.scene == scene
        resumed.run(end)
    with gr.open(path) as record:
        moved = record.walls[:, 1, 6]
        assert moved[0] == 0.0 and (moved[1:] != 0.0).all()
        assert moved[-1] == resumed.walls[1].displacement
        assert gr.measure.wall_force(record, 1).force.shape[1] == dim
    points = [in_order(sim) for sim in (*sims, resumed)]
    for other, found in zip((sims[1], resumed), points[1:], strict=True):
        for name, values in points[0].items():
            assert np.array_equal(values, found[name]), name
        assert sims[0].walls[1].displacement == other.walls[1].displacement


def test_the_same_flow_at_a_quarter_of_the_size():
    scene, ratio = cell_between_walls(gravity=1.0), Froude(1 / 4)
    real, model = (gr.Simulation(s, threads=1) for s in (scene, ratio.scene(scene)))
    for sim in (real, model):
        sim.step(200)
    assert np.array_equal(real.state.pressure / 4, model.state.pressure)
    assert np.array_equal(real.state.v / 2, model.state.v)
    assert real.walls[1].displacement / 4 == model.walls[1].displacement != 0


# ---- warnings and refusals ----


def test_closed_domains_are_warned_of():
    closed = cell_between_walls(pressure=None, gravity=1.0)
    (warning,) = gr.scene_warnings(closed)
    assert "closed in on every side" in warning and "pressure=..." in warning
    assert gr.scene_warnings(cell_between_walls()) == []
    assert gr.scene_warnings(cell_between_walls(pressure=None, filled=0.9, gravity=1.0)) == []
    elastic = closed.replace(material=gr.Elastic(E=1e6, rho_c=1500.0))
    assert gr.scene_warnings(elastic) == []
    opening = (closed.walls[0], gr.Wall(1, 0.2, opens_at=1.0))
    assert gr.scene_warnings(closed.replace(walls=opening)) == []
    everywhere = gr.Grid((0.0, 0.0), CELL, (4, 20), periodic=(True, True))
    (warning,) = gr.scene_warnings(closed.replace(grid=everywhere, walls=()))
    assert "closed in on every side" in warning
    blocks = tuple(gr.Solid((0.0, low), (0.04, low + 0.02)) for low in (0.0, 0.18))
    inner = gr.Fill(gr.Box((0.0, 0.02), (0.04, 0.18)), 4)
    (warning,) = gr.scene_warnings(closed.replace(fills=(inner,), walls=blocks))
    assert "closed in on every side" in warning
    (warning,) = gr.scene_warnings(gr.scenes.couette(pressure=500.0, cell=0.01))
    assert "closed in on every side" in warning


REFUSED = [
    ({"pressure": 0.0}, ValueError, r"pressure = 0.0 must be"),
    ({"pressure": -1.0}, ValueError, r"pressure = -1.0 must be"),
    ({"pressure": math.inf}, ValueError, r"pressure = inf must be"),
    ({"pressure": math.nan}, ValueError, r"pressure = nan must be"),
    ({"pressure": "much"}, TypeError, "pressure = 'much'"),
    ({"pressure": 1.0, "span": ((0.0, 0.04),)}, ValueError, "span = .* must be None with a pres"),
    ({"velocity": (1.0,)}, ValueError, "velocity"),
    ({"velocity": 1.0}, TypeError, "velocity"),
    ({"velocity": (math.inf, 0.0)}, ValueError, r"velocity\[0\] = inf"),
    ({"velocity": (1.0, 0.0), "kind": "free_slip"}, ValueError, 'None unless kind is "no_slip"'),
]


@pytest.mark.parametrize(("arguments", "error", "message"), REFUSED)
def test_walls_refuse(arguments, error, message):
    with pytest.raises(error, match=message):
        gr.Wall(1, 0.2, **arguments)


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        (
            {"walls": (gr.Wall(1, 0.0, pressure=1.0), gr.Wall(1, 0.2, pressure=1.0))},
            r"walls\[1\].pressure = 1.0 must be None: walls\[0\] keeps a pressure already",
        ),
        (
            {"walls": (gr.Wall(1, 0.1, pressure=1.0),)},
            r"walls\[0\].at = 0.1 must be an end of the grid, one of \(0.0, 0.2\)",
        ),
        ({"material": gr.Elastic(E=1e6, rho_c=1500.0)}, "must be None for an elastic body"),
        ({"scheme": gr.Scheme(density=gr.ParticleDensity())}, r"None with ParticleDensity\(\)"),
        (
            {"walls": (gr.Wall(1, 0.0, velocity=(0.0, 1.0)),)},
            r"walls\[0\].velocity\[1\] = 1.0 must be 0",
        ),
        ({"walls": (gr.Wall(1, 0.0, velocity=(1.0, 0.0, 0.0)),)}, "the grid's dimension 2"),
        (
            {
                "walls": (gr.Wall(1, 0.0, velocity=(1.0, 0.0)),),
                "scheme": gr.Scheme(transfer="xpic", density=gr.ParticleDensity()),
            },
            'transfer = "xpic" must be another one',
        ),
        ({"scheme": gr.Scheme(dt=2e-4)}, "points or bodies of"),
    ],
)
def test_scenes_refuse(changes, message):
    with pytest.raises(ValueError, match=message):
        gr.Simulation(cell_between_walls(speed=6.0).replace(**changes), threads=1)


def test_the_core_refuses():
    scene = cell_between_walls(pressure=None)
    (servo,) = cell_between_walls().servos
    good = core.servo_arguments(scene, servo)
    engine = core.build(scene, 1.0)
    with pytest.raises(ValueError, match="hold_pressure"):
        engine.hold_pressure(*good)  # the walls are not watched
    engine.watch_walls(2, *wall_owners(scene))
    integers = ((0, -1), (0, 2), (1, 0), (1, 2), (1, -1), (2, 0), (2, 7))
    for i, wrong in (*integers, *itertools.product(range(3, 8), (0.0, -1.0, math.nan))):
        with pytest.raises(ValueError, match="hold_pressure"):
            engine.hold_pressure(*good[:i], wrong, *good[i + 1 :])
    engine.hold_pressure(*good)
    with pytest.raises(ValueError, match="hold_pressure"):
        engine.hold_pressure(*good)
    particle = scene.replace(scheme=gr.Scheme(density=gr.ParticleDensity()))
    other = core.build(particle, 1.0)
    other.watch_walls(2, *wall_owners(particle))
    with pytest.raises(ValueError, match="density that is averaged"):
        other.hold_pressure(*good)


def test_walls_of_different_velocities_meet_at_rest():
    """A lid in motion over a fixed corner: nodes of both rest, and no point leaves."""
    grid = gr.Grid((0.0, 0.0), CELL, (8, 8))
    walls = (
        gr.Wall(1, 0.08, velocity=(1.0, 0.0), pressure=KEPT),
        gr.Wall(0, 0.0),
        gr.Wall(0, 0.08),
    )
    fill = gr.Fill(gr.Box((0.0, 0.0), (0.08, 0.08)), 4)
    scene = cell_between_walls(grid=grid, walls=walls, fills=(fill,))
    sim = gr.Simulation(scene, threads=1)
    sim.run(0.2)
    nodes = sim._engine.nodes()
    lid = np.isclose(nodes["x"][:, 1], 0.08) & (nodes["mass"] > 0)
    corner = lid & (np.isclose(nodes["x"][:, 0], 0.0) | np.isclose(nodes["x"][:, 0], 0.08))
    assert (nodes["v"][corner] == 0).all() and corner.sum() == 2
    assert (nodes["v"][lid & ~corner] == (1.0, 0.0)).all()
    assert sim.n_points == scene.n_points


def test_a_scene_tells_of_its_servo():
    assert "2, walls[1] keeps 1000 Pa" in cell_between_walls()._repr_html_()

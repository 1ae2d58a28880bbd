"""Measures of tools and cylinders, for states and records whose values are known."""

import numpy as np
import pytest
from refusals import refused
from scenes_by_hand import scene_with
from synthetic import RHO_C

import granular as gr
from granular import Body, Box, Cylinder, Fill, Gravity, Grid, Motion, State

CELL = 0.02


def scene_3d(*bodies, elasticity="hencky", **parameters):
    """A box of 0.4 m x 0.2 m x 0.3 m, two thirds full."""
    return scene_with(
        grid=Grid((0.0, 0.0, -0.2), CELL, (20, 10, 15)),
        fills=(Fill(Box((0.0, 0.0, -0.2), (0.4, 0.2, 0.0)), 8),),
        material=gr.materials.MuI(E=1e6, rho_c=RHO_C, elasticity=elasticity),
        scheme=gr.schemes.default,
        bodies=bodies,
        parameters=parameters,
    )


def state_of(scene, time=0.0, **fields):
    """A state of the points of the scene, at rest by default."""
    points = scene.points()
    n = len(points.x)
    known = {"x": points.x, "id": np.arange(n), "mass": points.volume * points.density}
    known |= {"v": np.zeros((n, 3)), "stress": np.zeros((n, 6)), "log_density": np.zeros(n)}
    known = {name: np.array(value) for name, value in (known | fields).items()}
    return State(scene=scene, time=time, step=0, dt=1e-4, fields=known)


# ---- cylinders ----


def turned(scene, state, law, span):
    """State after every point has rotated about (0.2, 0.1) by the angle law(r) span."""
    arm = state.x[:, :2] - [0.2, 0.1]
    r, angle = np.hypot(*arm.T), np.arctan2(arm[:, 1], arm[:, 0])
    angle = angle + law(r) * span
    x = state.x.copy()
    x[:, 0], x[:, 1] = 0.2 + r * np.cos(angle), 0.1 + r * np.sin(angle)
    return state_of(scene, time=state.time + span, x=x)


def test_profile_in_a_cylinder_is_that_of_the_ways():
    scene = scene_3d()
    edges = np.linspace(0.02, 0.1, 5)
    frames = [state_of(scene)]
    for _ in range(3):
        frames.append(turned(scene, frames[-1], lambda r: 0.5 - 4.0 * r, 0.4))
    found = gr.measure.cylinder_profile(frames, edges=edges, axis=(0.2, 0.1))
    assert found.intervals == 3
    assert found.omega == pytest.approx(0.5 - 4.0 * found.r, abs=1e-12)
    assert found.speed == pytest.approx(found.omega * found.r)
    assert found.radial == pytest.approx(0.0, abs=1e-12)
    # mean by mass over the range of points; uniform variation of omega in a ring
    area = np.pi * (0.1**2 - 0.02**2)
    assert found.mass.sum() == pytest.approx(area * 0.2 * RHO_C, rel=0.02)
    assert found.spread == pytest.approx(4.0 * 0.02 / np.sqrt(12), rel=0.15)


def test_profile_of_a_part_and_of_those_who_stay():
    """The upper half rotates, the lower half does not; a third of the points leaves."""
    scene = scene_3d()
    first = state_of(scene)
    last = turned(scene, first, lambda r: 0.3 + 0 * r, 0.5)
    below = first.x[:, 2] < -0.1
    last = state_of(scene, time=0.5, x=np.where(below[:, None], first.x, last.x))
    fields = {name: value[::3].copy() for name, value in last.fields.items()}
    last = State(scene=scene, time=0.5, step=1, dt=1e-4, fields=fields)
    for (above, under), omega in (((-0.1, None), 0.3), ((None, -0.1), 0.0)):
        found = gr.measure.cylinder_profile(
            [first, last], edges=[0.0, 0.1], above=above, below=under, axis=(0.2, 0.1)
        )
        assert found.omega == pytest.approx([omega], abs=1e-12)


def test_profile_knows_the_cylinders_of_its_scene():
    scene = gr.scenes.couette(cell=0.025, height=0.05)
    state = state_of(scene)
    found = gr.measure.cylinder_profile([state, state_of(scene, time=1.0)])
    assert len(found.r) == 4 and found.r[0] > 0.0999 and found.r[-1] < 0.2001
    assert not found.omega.any()
    scene = scene_3d()
    state, late = state_of(scene), state_of(scene, time=1.0)
    profile = gr.measure.cylinder_profile
    refused(
        ("states has 1 frame, at least 2", lambda: profile(state)),
        ("no parameters inner and outer", lambda: profile([state, late])),
        ("times must ascend", lambda: profile([late, state], edges=[0.0, 1.0])),
        (r"edges = .* must be ascending", lambda: profile([state, late], edges=[0.1, 0.1])),
        ("no point from 5", lambda: profile([state, late], edges=[5.0, 6.0])),
    )


# ---- tools ----


@pytest.fixture
def recorded(tmp_path):
    """A record of a box that is pushed through the bed."""

    def run(**parameters):
        motion = Motion(velocity=((0.2, 0.0, -0.1),), angular_velocity=((0.0, 1.0, 0.0),))
        place = (0.2, 0.0 if parameters else 0.1, -0.02)
        box = Body(Box(size=(0.08, 0.08, 0.08)), place, motion=motion, friction=0.3)
        sim = gr.Simulation(scene_3d(box, **parameters), threads=1)
        sim.run(until=0.02, save=tmp_path / "tool.h5", every=0.005, overwrite=True)
        return sim, gr.open(tmp_path / "tool.h5")

    return run


@pytest.mark.parametrize("half", [False, True])
def test_force_on_a_tool(recorded, half):
    sim, record = recorded(**({"half": True, "symmetry": "y"} if half else {}))
    with record:
        force = gr.measure.soil_tools.tool_force(record)
        span = np.diff(record.times)
        whole = gr.measure.soil_tools.tool_force(record, window=4)
        part = gr.measure.soil_tools.tool_force(record, window=4, total=False)
    impulse = sim.bodies[0].impulse * (1 + half)
    assert part.lateral[0] * span.sum() == pytest.approx(sim.bodies[0].impulse[1])
    assert np.linalg.norm(impulse) > 0
    assert force.forward @ span == pytest.approx(-impulse[0])
    assert force.vertical @ span == pytest.approx(impulse[2])
    assert force.lateral @ span == pytest.approx(0.0 if half else impulse[1], abs=1e-12)
    assert force.position[:, 0] == pytest.approx(0.2 + 0.2 * force.times)
    assert whole.forward[0] * span.sum() == pytest.approx(-impulse[0])


def test_history_of_a_wheel(recorded):
    sim, record = recorded()
    with record:
        found = gr.measure.soil_tools.wheel_history(record)
        span = np.diff(record.times)
    felt = sim.bodies[0]
    assert found.drawbar_pull @ span == pytest.approx(felt.impulse[0])
    assert found.load @ span == pytest.approx(felt.impulse[2])
    assert found.torque @ span == pytest.approx(-felt.angular_impulse[1])
    assert found.sinkage == pytest.approx(0.1 * found.times)


def test_a_wheel_in_the_plane_has_the_history_of_one_in_3d(tmp_path):
    """A wheel that slips towards larger x: it pulls, and the soil brakes it."""
    motion = Motion(velocity=((0.2, -0.1),), angular_velocity=(-10.0,))
    wheel = Body(Cylinder(0.06, center=(0.0, 0.0)), (0.2, 0.05), motion=motion, friction=0.5)
    scene = scene_3d().replace(
        grid=Grid((0.0, -0.2), CELL, (20, 15)),
        fills=(Fill(Box((0.0, -0.2), (0.4, 0.0)), 4),),
        gravity=Gravity((0.0,), ((0.0, -9.8),)),
        bodies=(wheel,),
    )
    sim = gr.Simulation(scene, threads=1).run(until=0.05, save=tmp_path / "flat.h5", every=0.01)
    with gr.open(tmp_path / "flat.h5") as record:
        found = gr.measure.soil_tools.wheel_history(record)
        span = np.diff(record.times)
        with pytest.raises(ValueError, match="record of a 3D scene"):
            gr.measure.soil_tools.tool_force(record)
    felt = sim.bodies[0]
    assert found.drawbar_pull @ span == pytest.approx(felt.impulse[0])
    assert found.load @ span == pytest.approx(felt.impulse[1])
    assert found.torque @ span == pytest.approx(felt.angular_impulse)
    assert found.torque @ span > 0.0 and found.load @ span > 0.0
    assert found.sinkage == pytest.approx(0.1 * found.times)


def test_failure_surface_of_a_wedge():
    """All points above the plane z = x - 0.3 move at 0.05 m/s, and hidden ones one cell below."""
    scene = scene_3d()
    points = scene.points().x
    moving = points[:, 2] > points[:, 0] - 0.3
    moving |= (points[:, 0] > 0.36) & (points[:, 2] < -0.18)
    v = np.zeros_like(points)
    v[moving, 0] = 0.05
    state = state_of(scene, v=v)
    found = gr.measure.soil_tools.failure_surface(state, speed=0.1, share=0.25)
    assert found.speed == pytest.approx(0.025)
    assert found.top == pytest.approx(0.0, abs=1e-12)
    wedge = (found.x > 0.12) & (found.x < 0.28)
    # cells across the plane move at half the speed
    assert np.abs(found.z - (found.x - 0.3))[wedge].max() <= CELL / 2 + 1e-9
    assert np.isnan(found.z[found.x > 0.32]).all()
    assert found.z[found.x < 0.08] == pytest.approx(-0.2)
    still = gr.measure.soil_tools.failure_surface(state, speed=1.0, span=(0.05, 0.1))
    assert np.isnan(still.z).all()
    with pytest.raises(ValueError, match="no point in span"):
        gr.measure.soil_tools.failure_surface(state, speed=0.1, span=(5.0, 6.0))
    with pytest.raises(ValueError, match=r"share = 1\.0"):
        gr.measure.soil_tools.failure_surface(state, speed=0.1, share=1.0)


def test_elastic_strain_is_that_of_the_stress():
    """Half of the points with e = diag(-0.01, 0, 0), the others without stress."""
    scene = scene_3d()
    material = scene.material
    n = scene.n_points
    e = np.array([-0.01, 0.0, 0.0])
    mean = e.sum() / 3
    kirchhoff = 2 * material.G * (e - mean) + material.K * e.sum()
    stress = np.zeros((n, 6))
    stress[::2, :3] = kirchhoff * np.exp(0.01)  # rho/rho_c = exp(0.01)
    log_density = np.where(np.arange(n) % 2 == 0, 0.01, -0.3)
    states = [state_of(scene, time=t, stress=stress, log_density=log_density) for t in (0.0, 1.0)]
    found = gr.measure.soil_tools.strain_history(states)
    assert found.times.tolist() == [0.0, 1.0]
    assert found.volumetric == pytest.approx(0.01)
    assert found.deviatoric == pytest.approx(0.01 * np.sqrt(2 / 3))
    assert found.norm == pytest.approx(0.01)
    assert found.deviation == pytest.approx(0.0, abs=1e-12)
    assert np.isnan(gr.measure.soil_tools.strain_history(state_of(scene)).norm).all()
    with pytest.raises(ValueError, match="elasticity = 'hypoelastic'"):
        gr.measure.soil_tools.strain_history(state_of(scene_3d(elasticity="hypoelastic")))


def test_slope_between_parallel_walls():
    """A heap of z = x/2 - 0.2 along x, independent of y."""
    scene = scene_3d()
    points = scene.points().x
    keep = points[:, 2] + 0.2 < points[:, 0] / 2
    fields = {name: value[keep].copy() for name, value in state_of(scene).fields.items()}
    state = State(scene=scene, time=0.0, step=0, dt=1e-4, fields=fields)
    found = gr.measure.repose_angle(state, along="x", side="left")
    assert found.mean_deg == pytest.approx(np.degrees(np.arctan(0.5)), abs=0.5)
    top = gr.measure.surface(state, along="x")
    assert len(top.x) == 20 and top.height[10] == pytest.approx(top.x[10] / 2, rel=0.1)
    with pytest.raises(ValueError, match="along = 'y'"):
        gr.measure.surface(state, along="y")
    # rings are still the default
    scene = scene_3d().replace(
        fills=(Fill(Cylinder(0.1, center=(0.2, 0.1, -0.1), axis=(0.0, 0.0, 1.0), length=0.2), 8),),
    )
    assert len(gr.measure.surface(state_of(scene)).x) != 20

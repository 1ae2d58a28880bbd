"""Forces on intruders: linear in the depth, independent of the speed, and scale-free for a cone."""

import itertools

import numpy as np
import pytest

import granular as gr

WEIGHT = 1500.0 * 9.81


def course(scene, windows=10):
    """Mean depth [m] and upward force [N/m] of successive parts of a run."""
    sim, rows = gr.Simulation(scene, threads=1), []
    for until in np.linspace(0.0, scene.duration, windows + 1):
        if until:
            sim.run(until=until)
        rows.append((sim.time, -sim.bodies[0].position[-1], sim.bodies[0].impulse[-1]))
    t, z, impulse = np.array(rows).T
    return 0.5 * (z[1:] + z[:-1]), np.diff(impulse) / np.diff(t)


def order(z, force):
    return np.polyfit(np.log(z), np.log(force), 1)[0]


def test_force_on_a_ball_grows_with_its_depth_and_not_with_its_speed():
    """From half its diameter down the pressure on its cross-section is 8 times that of the depth
    within 4 % in cells of a quarter of the diameter (7.7 to 7.8 in cells of an eighth). At twice
    the speed it is 6 % more, as the friction of mu(I) grows with it, and 8 % with the damping of
    flutter. With other places of the points the order at the greater speed is 0.86 to 0.97, and
    windows scatter by 4 to 20 % about the mean, which is the same within 0.5 %.
    """
    means = []
    for speed, duration in ((0.1, 1.25), (0.2, 0.65)):
        bed = {"cell": 0.02, "width": 0.64, "speed": speed, "duration": duration}
        z, force = course(gr.scenes.penetration(**bed))
        deep = z > 0.045
        ratio = force[deep] / (WEIGHT * 0.08 * z[deep])
        assert order(z[deep], force[deep]) == pytest.approx(1.0, abs=0.15)
        assert np.ptp(ratio) < 0.15 * ratio.mean()
        means.append(ratio.mean())
    first, second = means
    assert 7.0 < first < 9.0
    assert second == pytest.approx(first, rel=0.1)


def test_force_on_a_wedge_is_that_of_its_depth_squared():
    """Neither the bed nor a slow friction nor the wedge has a length, so that F = C rho g z^2. From
    1.5 cells down the order is 1.88 and C within 7 % (15 % with random places of the points);
    before, there are hardly any points below.
    """
    wedge = {"kind": "cone", "cone_deg": 120.0, "diameter": 0.6, "width": 1.0, "soil": 0.3}
    z, force = course(gr.scenes.penetration(cell=0.02, duration=0.8, **wedge))
    deep = z > 0.03
    assert order(z[deep], force[deep]) == pytest.approx(2.0, abs=0.12)
    scaled = force[deep] / (WEIGHT * z[deep] ** 2)
    assert all(abs(a / b - 1) < 0.1 for a, b in itertools.pairwise(scaled))


def test_in_3d_a_ball_is_pushed_up_along_the_axis():
    """A coarse run: the force is upwards, and those across are a few per cent of it."""
    bed = {"dim": 3, "cell": 0.04, "diameter": 0.12, "width": 0.4, "soil": 0.2, "headroom": 0.12}
    sim = gr.Simulation(gr.scenes.penetration(speed=0.4, duration=0.2, **bed), threads=1)
    sim.run()
    x, y, up = sim.bodies[0].impulse
    assert up > 0 and abs(x) < 0.05 * up and abs(y) < 0.05 * up

"""The figures of the paper: panels, curves and numbers are those that were given."""

import numpy as np
import pytest

import granular as gr
from granular import measure, plot, theory

SOFT = gr.materials.glass_beads.replace(E=1e5)


def states(scene, count):
    start = gr.Simulation(scene, threads=1).state
    return [
        gr.State(
            scene=scene,
            time=0.5 * k,
            step=k,
            dt=1e-4,
            fields={name: array.copy() for name, array in start.fields.items()},
        )
        for k in range(count)
    ]


def titles(figure):
    return [ax.get_title() for ax in figure.axes if ax.get_title()]


def test_figure_2_has_a_row_for_each_time_and_one_for_the_pressure():
    columns = [
        states(gr.scenes.column_collapse(aspect=a, cell=0.05, material=SOFT), 3) for a in (2.0, 1.0)
    ]
    figure = plot.figure_2(columns)
    assert len(titles(figure)) == 2 * 4
    assert titles(figure)[0] == "a = 2, t = 0.00 s"
    labels = [ax.get_ylabel() for ax in figure.axes]
    assert "pressure [Pa]" in labels
    assert "equivalent plastic shear rate [1/s]" in labels
    with pytest.raises(ValueError, match=r"\[3, 2\]"):
        plot.figure_2([columns[0], columns[1][:2]])


def test_figure_4_has_a_column_for_each_orifice():
    silos = [
        states(gr.scenes.silo(orifice=d, cell=0.05, material=SOFT), 2) for d in (0.1, 0.2, 0.3)
    ]
    assert titles(plot.figure_4(silos))[:3] == [f"D = {d} m, t = 0.00 s" for d in (0.1, 0.2, 0.3)]


def test_figures_6_and_7_show_both_hourglasses():
    runs = [
        states(
            gr.scenes.hourglass(
                kind=kind, cell=0.05, orifice_radius=0.05, width=0.5, material=SOFT
            ),
            4,
        )
        for kind in ("flat", "sloped")
    ]
    assert len(titles(plot.figure_6(*runs))) == 8
    figure = plot.figure_7(*runs)
    assert len(titles(figure)) == 8
    for ax in figure.axes[:8]:
        # Seeded material is dense everywhere.
        assert np.all(ax.collections[0].get_array() == 1.0)


def test_figure_11_draws_the_flight_on_its_parabola():
    scene = gr.scenes.slug(cell=0.05, material=SOFT)
    found = states(scene, 4)
    figure = plot.figure_11(found[:2], found[2:3], found[3])
    path = figure.axes[0].lines[-1].get_xydata()
    centre = found[0].x.mean(axis=0)
    assert path[0] == pytest.approx(centre)
    t = 0.5
    assert path[-1] == pytest.approx(centre + np.array([1.2 * t, 3.0 * t - 4.9 * t * t]))
    with pytest.raises(ValueError, match="at least 1"):
        plot.figure_11([], found[2:3], found[3])


def test_figure_3_draws_run_outs_and_the_paper():
    runouts = {"mine": [measure.Runout(1.0, 0.9, 1.2), measure.Runout(2.0, 1.9, 2.1)]}
    figure = plot.figure_3([0.5, 1.0], runouts)
    lines = {line.get_label(): line for line in figure.axes[0].lines}
    x, y = lines["Dunatunga & Kamrin (2015)"].get_data()
    assert np.interp(1.0, x, y) == pytest.approx(2.28, rel=1e-3)
    points = [c for c in figure.axes[0].containers if c.get_label() == "mine"]
    assert points[0].lines[0].get_ydata().tolist() == [1.0, 2.0]
    with pytest.raises(ValueError, match="mine"):
        plot.figure_3([0.5], runouts)


def test_figure_5_draws_the_fit_and_the_rates():
    orifices = np.array([0.1, 0.2])
    rates = theory.beverloo_rate(orifices, 1500.0, C=1.3)
    fit = measure.beverloo(orifices, rates, rho=1500.0)
    times = np.linspace(0, 5, 50)
    histories = {0.1: measure.MassHistory(times, 1500 - 100 * times, 1.0)}
    left, right = plot.figure_5(histories, fit, rho=1500.0).axes
    lines = {line.get_label(): line for line in right.lines}
    assert lines["measured"].get_ydata() == pytest.approx(rates)
    x, y = lines["C = 1.300, 3/2"].get_data()
    assert y == pytest.approx(1.3 * 1500 * np.sqrt(9.8) * x**1.5)
    assert left.get_xlabel() == "time [s]"


def flow(angle, speed):
    times = np.linspace(0.0, 2.0, 5)
    return plot.InclineFlow(angle, times, np.full(5, 0.45), speed * times)


def test_figure_9_draws_friction_speed_and_acceleration():
    figure = plot.figure_9([flow(25.0, 0.3), flow(30.0, 0.6)], mu_s=0.3819, mu_2=0.6435)
    _, centre, right = figure.axes
    assert centre.lines[1].get_ydata()[-1] == pytest.approx(1.2)
    assert right.lines[0].get_ydata() == pytest.approx(np.full(4, 0.3))
    assert right.lines[0].get_xdata() == pytest.approx([0.25, 0.75, 1.25, 1.75])


def incline(time):
    """A state whose velocity is the Bagnold profile, and whose stress has a friction of 0.45."""
    scene = gr.scenes.incline(angle_deg=25.0, cell=0.02, material=SOFT)
    start = gr.Simulation(scene, threads=1).state
    v = np.zeros_like(start.x)
    v[:, 0] = theory.bagnold_profile(start.x[:, 1], 25.0, 0.2, SOFT)
    stress = np.tile([-100.0, -100.0, -100.0, 45.0], (start.n, 1))
    fields = {name: array.copy() for name, array in start.fields.items()}
    fields |= {"v": v, "stress": stress}
    return gr.State(scene=scene, time=time, step=1, dt=1e-4, fields=fields)


def test_flow_down_an_incline_is_measured():
    found = plot.InclineFlow.measured([incline(1.0), incline(2.0)])
    assert found.angle_deg == 25.0
    assert found.friction == pytest.approx([0.45, 0.45])
    assert found.speed == pytest.approx(np.full(2, theory.bagnold_mean(25.0, 0.2, SOFT)), rel=5e-3)
    with pytest.raises(ValueError, match="at least 2"):
        plot.InclineFlow.measured([incline(1.0)])


def test_figure_10_draws_the_profile_on_the_steady_one():
    left, right = plot.figure_10([flow(22.0, 0.1), flow(25.0, 0.4)], incline(2.0)).axes
    lines = {line.get_label(): line for line in right.lines}
    v, y = lines["measured"].get_data()
    steady = lines["steady, eq. 4.6"]
    assert v == pytest.approx(np.interp(y, steady.get_ydata(), steady.get_xdata()), rel=0.02)
    found = {line.get_label(): line for line in left.lines}["measured"]
    assert found.get_ydata() == pytest.approx(np.array([0.2, 0.8]) / np.sqrt(9.8 * 0.2))


def test_figure_13_draws_the_error_of_each_step():
    times = np.linspace(0.0, 1.0, 5)
    exact = np.ones((5, 4)) * 200.0
    reference = theory.ConstitutiveReference(
        times, exact, np.zeros(5), np.ones(5, bool), np.zeros(5), ()
    )
    paths = [
        plot.ConstitutivePath(0.25, times, exact + 2.0, np.zeros(5)),
        plot.ConstitutivePath(0.5, times[::2], exact[::2] + 4.0, np.zeros(3)),
    ]
    *_, order = plot.figure_13(paths, reference).axes
    assert order.lines[0].get_xdata().tolist() == [0.25, 0.5]
    assert order.lines[0].get_ydata() == pytest.approx([0.01, 0.02])
    late = plot.ConstitutivePath(0.3, times + 0.1, exact, np.zeros(5))
    with pytest.raises(ValueError, match="among the reference"):
        plot.figure_13([late], reference)

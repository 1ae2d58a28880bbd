"""Figures of the paper: panels, curves and numbers are those that were given."""

from itertools import pairwise

import numpy as np
import pytest
from matplotlib.backends.backend_agg import FigureCanvasAgg

import granular as gr
from granular import measure, theory
from granular.papers.dunatunga2015 import (
    columns,
    hourglasses,
    inclines,
    silos,
    slug,
    stress_update,
)
from granular.plot.fields import PHASES
from granular.plot.mosaic import Panel, mosaic

SOFT = gr.materials.glass_beads.replace(E=1e5)


def states(scene, count, first=0.0, **changes):
    """Initial state of a scene at several times 0.5 s apart, with some fields replaced."""
    start = gr.Simulation(scene, threads=1).state
    fields = {name: array.copy() for name, array in start.fields.items()} | changes
    times = [first + 0.5 * k for k in range(count)]
    return [gr.State(scene=scene, time=t, step=1, dt=1e-4, fields=fields) for t in times]


def titles(figure):
    return [ax.get_title() for ax in figure.axes if ax.get_title()]


def test_figures_2_and_4_have_a_panel_for_each_time_and_column():
    heaps = [
        states(gr.scenes.column_collapse(aspect=a, cell=0.05, material=SOFT), 3) for a in (2.0, 1.0)
    ]
    figure = columns.figure_2(heaps)
    assert len(titles(figure)) == 2 * 4
    assert titles(figure)[0] == "a = 2, t = 0.00 s"
    labels = [ax.get_ylabel() for ax in figure.axes]
    assert "pressure [Pa]" in labels
    assert "equivalent plastic shear rate [1/s]" in labels
    with pytest.raises(ValueError, match=r"\[3, 2\]"):
        columns.figure_2([heaps[0], heaps[1][:2]])
    draining = [
        states(gr.scenes.silo(orifice=d, cell=0.05, material=SOFT), 2) for d in (0.1, 0.2, 0.3)
    ]
    assert titles(silos.figure_4(draining))[:3] == [
        f"D = {d} m, t = 0.00 s" for d in (0.1, 0.2, 0.3)
    ]


def test_panels_of_a_figure_have_the_shape_of_what_they_show_and_do_not_overlap():
    rows = [
        [Panel(((0.0, 1.0), (0.0, 0.5))), Panel(((0.0, 0.2), (0.0, 0.1)), zoom=3.0)],
        [Panel(((0.0, 0.3), (0.0, 0.9)))],
    ]
    figure, axes, bars = mosaic(rows, (1, 1))
    width, height = figure.get_size_inches()
    assert width <= 10.0 + 1e-9
    assert height <= 12.0 + 1e-9
    boxes = []
    for row, line in zip(rows, axes, strict=True):
        for panel, ax in zip(row, line, strict=True):
            box = ax.get_position()
            across, up = panel.size
            assert box.width * width / (box.height * height) == pytest.approx(across / up)
            boxes.append(box)
    boxes += [bar.get_position() for bar in bars]
    first, second = boxes[:2]
    # 0.2 m enlarged three times beside 1 m
    assert second.width / first.width == pytest.approx(0.6)
    for i, box in enumerate(boxes):
        assert 0.0 <= box.x0 < box.x1 <= 1.0
        assert 0.0 <= box.y0 < box.y1 <= 1.0
        assert not any(box.overlaps(other) for other in boxes[:i])


def colours(ax):
    """Colours of the material in an axes."""
    pixels = np.asarray(ax.images[0].get_array()).reshape(-1, 4)
    return sorted(map(tuple, np.unique(pixels[pixels[:, 3] > 0], axis=0)))


def test_figure_2_gives_each_column_the_same_width_and_the_static_angle():
    heaps = [
        states(gr.scenes.column_collapse(aspect=a, cell=0.05, material=SOFT), 2) for a in (2.0, 0.5)
    ]
    figure = columns.figure_2(heaps)
    panels = [ax for ax in figure.axes if ax.get_title()]
    widths = [ax.get_position(original=True).width for ax in panels]
    assert widths == pytest.approx(np.full(len(panels), widths[0]))
    for ax in panels[2:]:
        (x0, x1), (y0, y1) = ax.lines[-1].get_data()
        assert (y1 - y0) / (x0 - x1) == pytest.approx(SOFT.mu_s)
        # The last points of a block 0.2 m wide are half a spacing inside; 16 per cell of 0.05 m.
        assert x0 == pytest.approx(0.2 - 0.05 / 8)


def test_figures_6_and_7_show_both_hourglasses():
    small = {"cell": 0.05, "orifice_radius": 0.05, "width": 0.5, "material": SOFT}
    runs = [states(gr.scenes.hourglass(kind=kind, **small), 4) for kind in ("flat", "sloped")]
    assert len(titles(hourglasses.figure_6(*runs))) == 8
    figure = hourglasses.figure_7(*runs)
    assert len(titles(figure)) == 8
    for ax in figure.axes[:8]:
        # Seeded material is dense everywhere.
        assert colours(ax) == [PHASES(1.0, bytes=True)]
    # by stress figure 7 shows who bears it
    scene = gr.scenes.hourglass(cell=0.05, orifice_radius=0.05, width=0.5, material=SOFT)
    stress = np.zeros((scene.n_points, 4))
    stress[::2, :3] = -100.0
    loaded = states(scene, 1, stress=stress)
    figure = hourglasses.figure_7(loaded, loaded, by="stress")
    for ax in figure.axes[:2]:
        assert colours(ax) == sorted(PHASES(phase, bytes=True) for phase in (0.0, 1.0))
    assert "stress" in figure.axes[-1].get_ylabel()
    assert "density" in hourglasses.figure_7(loaded, loaded).axes[-1].get_ylabel()
    with pytest.raises(ValueError, match="by"):
        hourglasses.figure_7(loaded, loaded, by="colour")


def test_figure_11_draws_the_flight_on_its_parabola():
    scene = gr.scenes.slug(cell=0.05, material=SOFT)
    found = states(scene, 4)
    figure = slug.figure_11(found[:2], found[2:3], found[3])
    path = figure.axes[0].lines[-1].get_xydata()
    centre = found[0].x.mean(axis=0)
    assert path[0] == pytest.approx(centre)
    t = 0.5
    assert path[-1] == pytest.approx(centre + np.array([1.2 * t, 3.0 * t - 4.9 * t * t]))
    with pytest.raises(ValueError, match="at least 1"):
        slug.figure_11([], found[2:3], found[3])


def test_figure_3_draws_run_outs_and_the_paper():
    runouts = {"mine": [measure.Runout(1.0, 0.9, 1.2), measure.Runout(2.0, 1.9, 2.1)]}
    figure = columns.figure_3([0.5, 1.0], runouts)
    lines = {line.get_label(): line for line in figure.axes[0].lines}
    x, y = lines["Dunatunga & Kamrin (2015)"].get_data()
    assert np.interp(1.0, x, y) == pytest.approx(2.28, rel=1e-3)
    assert {"Mast et al. (2015)", "Lube et al. (2005)"} < lines.keys()
    (narrow,) = (line for label, line in lines.items() if label.endswith("narrow slot: slope 0.65"))
    (x0, x1), (y0, y1) = narrow.get_data()
    assert np.log(y1 / y0) / np.log(x1 / x0) == pytest.approx(0.65)
    points = [c for c in figure.axes[0].containers if c.get_label() == "mine"]
    assert points[0].lines[0].get_ydata().tolist() == [1.0, 2.0]
    with pytest.raises(ValueError, match="mine"):
        columns.figure_3([0.5], runouts)


def figure_5(orifices):
    """Figure of rates by the formula of Beverloo, and of one history."""
    fit = measure.beverloo(orifices, theory.beverloo_rate(orifices, 1500.0, C=1.3), rho=1500.0)
    times = np.linspace(0, 5, 50)
    histories = {0.1: measure.MassHistory(times, 1500 - 100 * times, 1.0)}
    return silos.figure_5(histories, fit, rho=1500.0)


def test_figure_5_draws_the_fit_and_the_rates():
    left, right = figure_5(np.array([0.1, 0.2])).axes
    lines = {line.get_label(): line for line in right.lines}
    rates = theory.beverloo_rate(np.array([0.1, 0.2]), 1500.0, C=1.3)
    assert lines["measured"].get_ydata() == pytest.approx(rates)
    x, y = lines["C = 1.300, 3/2"].get_data()
    assert y == pytest.approx(1.3 * 1500 * np.sqrt(9.81) * x**1.5)
    assert left.get_xlabel() == "time [s]"


def test_the_ticks_of_all_orifices_and_aspects_can_be_read():
    """Tick labels of the scripts must not overlap."""
    aspects = [0.5, 0.75, 1.0, 1.5, 2.0, 3.0, 4.0, 6.0, 8.0]
    runouts = {"mine": [measure.Runout(a, a, a) for a in aspects]}
    for figure in (figure_5(np.arange(6, 21, 2) / 100), columns.figure_3(aspects, runouts)):
        canvas = FigureCanvasAgg(figure)
        canvas.draw()
        labels = figure.axes[-1].get_xticklabels()
        boxes = [text.get_window_extent(canvas.get_renderer()) for text in labels]
        assert len(boxes) >= 8
        gaps = [right.x0 - left.x1 for left, right in pairwise(boxes)]
        assert min(gaps) > 2


def flow(angle, speed):
    times = np.linspace(0.0, 2.0, 5)
    return inclines.InclineFlow(angle, times, np.full(5, 0.45), speed * times)


def test_figure_9_draws_friction_speed_and_acceleration_and_where_flows_end():
    """Shows tan(angle) in the range of steady flow; beyond it mu_2 and the remaining gravity."""
    flows = [flow(19.0, 0.0), flow(25.0, 0.3), flow(34.0, 0.6)]
    left, centre, right = inclines.figure_9(flows, mu_s=0.3819, mu_2=0.6435).axes
    assert centre.lines[2].get_ydata()[-1] == pytest.approx(1.2)
    assert right.lines[1].get_ydata() == pytest.approx(np.full(4, 0.3))
    assert right.lines[1].get_xdata() == pytest.approx([0.25, 0.75, 1.25, 1.75])
    dotted = [line.get_ydata()[0] for line in left.lines if line.get_linestyle() == ":"]
    assert dotted == pytest.approx([np.tan(np.radians(25.0)), 0.6435])
    (late,) = [line.get_ydata()[0] for line in right.lines if line.get_linestyle() == ":"]
    angle = np.radians(34.0)
    assert late == pytest.approx(9.8 * (np.sin(angle) - 0.6435 * np.cos(angle)))


def incline(time):
    """State with the Bagnold velocity profile and stresses of friction 0.45."""
    scene = gr.scenes.incline(angle_deg=25.0, cell=0.02, material=SOFT)
    x = scene.points().x
    v = np.zeros_like(x)
    v[:, 0] = theory.bagnold_profile(x[:, 1], 25.0, 0.2, SOFT, 9.8)
    stress = np.tile([-100.0, -100.0, -100.0, 45.0], (len(x), 1))
    return states(scene, 1, first=time, v=v, stress=stress)[0]


def test_flow_down_an_incline_is_measured():
    found = inclines.InclineFlow.measured([incline(1.0), incline(2.0)])
    assert found.angle_deg == 25.0
    assert found.friction == pytest.approx([0.45, 0.45])
    assert found.speed == pytest.approx(
        np.full(2, theory.bagnold_mean(25.0, 0.2, SOFT, 9.8)), rel=5e-3
    )
    with pytest.raises(ValueError, match="at least 2"):
        inclines.InclineFlow.measured([incline(1.0)])


def test_figure_10_draws_speeds_and_the_profile_on_the_steady_one():
    """Flows are shown up to 2 s, a profile at 6 s."""
    left, right = inclines.figure_10([flow(22.0, 0.1), flow(25.0, 0.4)], incline(6.0)).axes
    speeds, lines = ({line.get_label(): line for line in ax.lines} for ax in (left, right))
    expected = [theory.transient(a, 0.2, SOFT, [2.0], 9.8).mean[0] for a in (22.0, 25.0)]
    unit = np.sqrt(9.8 * 0.2)
    assert speeds["transient, 2 s"].get_ydata() == pytest.approx(np.array(expected) / unit)
    assert speeds["measured"].get_ydata() == pytest.approx(np.array([0.2, 0.8]) / unit)
    assert "transient, 6 s" in lines
    v, y = lines["measured"].get_data()
    steady = lines["steady, eq. 4.6"]
    assert v == pytest.approx(np.interp(y, steady.get_ydata(), steady.get_xdata()), rel=0.02)


def test_figure_13_draws_the_error_of_each_step():
    times = np.linspace(0.0, 1.0, 5)
    exact = np.ones((5, 4)) * 200.0
    reference = theory.ConstitutiveReference(
        times, exact, np.zeros(5), np.ones(5, bool), np.zeros(5), ()
    )
    paths = [
        stress_update.ConstitutivePath(0.25, times, exact + 2.0, np.zeros(5)),
        stress_update.ConstitutivePath(0.5, times[::2], exact[::2] + 4.0, np.zeros(3)),
    ]
    *_, order = stress_update.figure_13(paths, reference).axes
    assert order.lines[0].get_xdata().tolist() == [0.25, 0.5]
    assert order.lines[0].get_ydata() == pytest.approx([0.01, 0.02])
    late = stress_update.ConstitutivePath(0.3, times + 0.1, exact, np.zeros(5))
    with pytest.raises(ValueError, match="among the reference"):
        stress_update.figure_13([late], reference)

"""Verdicts on made-up silos whose state is known, and the history of states made by hand."""

from types import SimpleNamespace

import numpy as np
import pytest
from refusals import refused
from synthetic import RHO_C, isotropic, silo, state

import granular as gr
from granular.measure import Opening, centre_line_pressure
from granular.papers.silo_clogging import SiloHistory, flow_verdict, silo_history

TIMES = np.arange(361) / 240
"""1.5 s in the frames of the paper."""
WIDTH = 0.14
FREE_FALL = RHO_C * np.sqrt(9.8) * WIDTH**1.5
FULL = RHO_C * 0.595**2
POINT = RHO_C * 0.0175**2 / 16
"""Mass of one of the paper's points."""
FLOW = 100.0
"""Outflow [kg/s per metre], 0.41 of free fall."""


def history(velocity, outflow, head=0.5):
    """History with a velocity and an outflow at every frame."""
    velocity, outflow, head = (np.broadcast_to(a, TIMES.shape) for a in (velocity, outflow, head))
    lost = np.concatenate([[0.0], np.cumsum((outflow[1:] + outflow[:-1]) / 2 * np.diff(TIMES))])
    mass = FULL - lost
    return SiloHistory(TIMES, mass, mass / POINT, velocity, head, WIDTH, RHO_C, 9.8)


def stopped(at):
    """A flow that stops within one frame and does not creep afterwards."""
    return history(np.where(TIMES < at, -0.1, -1e-9), np.where(TIMES < at, FLOW, 0.0))


def test_a_steady_flow():
    found = flow_verdict(history(-0.1, FLOW))
    assert (found.verdict, found.published) == ("flowing", "flowing")
    assert found.outflow == pytest.approx(FLOW)
    assert found.relative_outflow == pytest.approx(FLOW / FREE_FALL)
    assert found.speed == pytest.approx(0.1)
    assert found.decay == pytest.approx(1.0)
    assert found.last_crossing == 0.0
    assert found.drained_at is None
    assert found.points_per_frame == pytest.approx(FLOW / POINT / 240)
    assert found.speed_floor == pytest.approx(1e-3 * np.sqrt(9.8 * WIDTH))
    # frames at another interval count the same points
    coarse = history(-0.1, FLOW)
    fewer = SiloHistory(
        *(getattr(coarse, name)[::4] for name in ("times", "mass", "points", "velocity", "head")),
        WIDTH, RHO_C, 9.8,
    )  # fmt: skip
    expected = flow_verdict(coarse).points_per_frame
    assert flow_verdict(fewer).points_per_frame == pytest.approx(expected)


def test_a_jam_that_rings_out_or_creeps():
    """A tenth of a second of flow, then decaying waves of 20 Hz that cross zero to the end."""
    sink = -0.3 * np.exp(-TIMES / 0.05)
    ring = 0.02 * np.exp(-TIMES / 0.3) * np.sin(2 * np.pi * 20 * TIMES)
    found = flow_verdict(history(sink + ring, FLOW * np.exp(-TIMES / 0.05)))
    assert (found.verdict, found.published) == ("static", "static")
    assert found.last_crossing > 0.95
    assert found.relative_outflow < 1e-6
    # one that creeps at 1e-5 m/s is static, though it never crosses zero
    creep = -0.3 * np.exp(-TIMES / 0.05) - 1e-5
    found = flow_verdict(history(creep, FLOW * np.exp(-TIMES / 0.05)))
    assert (found.verdict, found.published) == ("static", "unsure")
    assert found.last_crossing == 0.0
    # both are below the speed floor, which replaces both
    assert found.decay == 1.0
    noisy = creep + 1e-5 * np.random.default_rng(3).standard_normal(len(TIMES))
    assert flow_verdict(history(noisy, 0.0)).verdict == "static"
    strict = flow_verdict(history(creep, 0.0), speed_floor=5e-6)
    assert strict.verdict == "unsure"
    assert strict.decay == pytest.approx(1.0, rel=0.02)


@pytest.mark.parametrize(
    ("at", "verdict"),
    [(0.7, "static"), (1.3, "static"), (1.40, "unsure"), (1.43, "unsure"), (1.46, "unsure")],
)
def test_a_flow_that_stops_late(at, verdict):
    """The verdict compares 1.35 s to 1.425 s with 1.425 s to 1.5 s."""
    assert flow_verdict(stopped(at)).verdict == verdict


def test_half_a_judgement_is_none():
    """Unsure: outflow without sinking, sinking without outflow, flows that just begin or stop."""
    begun = TIMES > 1.0
    assert flow_verdict(history(-1e-5, FLOW)).verdict == "unsure"
    assert flow_verdict(history(-0.1, 0.0)).verdict == "unsure"
    halfway = np.where(TIMES < 1.425, FLOW, 0.0)
    assert flow_verdict(history(-1e-5, halfway)).verdict == "unsure"
    assert flow_verdict(history(-0.1, halfway)).verdict == "unsure"
    assert flow_verdict(history(0.1, FLOW)).verdict == "unsure"
    assert flow_verdict(history(-0.1, 0.05 * FREE_FALL)).verdict == "unsure"
    assert flow_verdict(history(-0.1, 0.05 * FREE_FALL), steady=0.04).verdict == "flowing"
    late = history(np.where(begun, -0.1, -1e-5), np.where(begun, FLOW, 0.0))
    assert flow_verdict(late).verdict == "unsure"
    assert flow_verdict(late).decay == pytest.approx(0.1 / flow_verdict(late).speed_floor)
    dying = history(-0.4 * np.exp(-TIMES / 0.5), FLOW)
    found = flow_verdict(dying)
    # half-way is 0.75 s, the middle of the slower half 1.4625 s; the rest is of second order
    assert found.decay == pytest.approx(np.exp(-0.7125 / 0.5), rel=5e-3)
    assert found.verdict == "unsure"
    assert flow_verdict(dying, persistence=0.2).verdict == "flowing"


def test_drained_silos_waves_and_velocities_of_nothing():
    """The remainder in the corners is at rest, and the paper's rule sees only that."""
    empty = TIMES >= 1.0
    head = np.where(empty, 0.02, 0.5 - 0.3 * TIMES)
    rest = 1e-7 * (-1.0) ** np.arange(len(TIMES))
    found = flow_verdict(history(np.where(empty, rest, -0.1), np.where(empty, 0.0, FLOW), head))
    assert (found.verdict, found.published) == ("flowing", "static")
    assert found.drained_at == pytest.approx(1.0)
    assert found.outflow == pytest.approx(FLOW)
    # a velocity of nothing is no flow, and zero is a crossing
    nothing = flow_verdict(history(np.nan, FLOW))
    assert nothing.verdict == "unsure"
    assert np.isnan(nothing.speed)
    assert np.isnan(nothing.decay)
    assert flow_verdict(history(np.nan, 0.0)).verdict == "unsure"
    # at rest from the first frame to the last: every frame is a crossing
    assert flow_verdict(history(0.0, 0.0)).last_crossing == 1.0
    # starting at rest is not a crossing
    assert flow_verdict(history(np.where(TIMES > 0, -0.1, 0.0), FLOW)).last_crossing == 0.0
    # waves longer than the window that exceed the floor are no flow
    wave = 0.04 * np.cos(2 * np.pi * TIMES / 0.27)
    found = flow_verdict(history(wave, 0.0))
    assert found.verdict == "static"
    assert abs(found.speed) > found.speed_floor
    assert flow_verdict(history(wave, 0.02 * FREE_FALL)).verdict == "unsure"
    assert flow_verdict(history(-0.04, 0.0)).verdict == "unsure"


@pytest.mark.parametrize(
    ("crossing", "lost", "published"),
    [
        (0.95, 1.0, "static"), (0.95, 1.1, "unsure"), (0.95, 11.0, "unsure"),
        (0.89, 0.5, "unsure"), (0.51, 11.0, "unsure"), (0.48, 11.0, "flowing"),
        (0.48, 10.0, "unsure"), (0.48, 0.0, "unsure"),
    ],
)  # fmt: skip
def test_the_votes_of_the_published_rule(crossing, lost, published):
    """One zero crossing between two frames, and a number of points lost in each."""
    velocity = np.where(TIMES < crossing * 1.5, 0.1, -0.1)
    found = flow_verdict(history(velocity, lost * POINT * 240))
    assert found.last_crossing == pytest.approx(crossing, abs=1 / 360)
    assert found.points_per_frame == pytest.approx(lost, abs=1e-9)
    made = SiloHistory(
        TIMES, np.full(361, FULL), 1e5 - lost * np.arange(361), velocity, np.full(361, 0.5),
        WIDTH, RHO_C, 9.8,
    )  # fmt: skip
    assert flow_verdict(made).published == published


@pytest.mark.parametrize("half", [True, False])
def test_the_history_of_states(half):
    s = silo(half=half)
    p = np.array([100.0, 100.0, 0.0, 50.0, 100.0])
    x = [[0.01, 0.3], [0.2, 0.3], [0.05, 0.01], [0.02, 0.2], [0.03, 0.4]]
    v = [[0, -1.0], [0, -0.1], [0, -5.0], [0, -2.0], [0, 0.5]]
    mass = [2.0, 1.0, 1.0, 3.0, 1.0]
    frames = [
        state(s, x[:n], mass=mass[:n], v=v[:n], stress=isotropic(p[:n]), time=t)
        for n, t in ((5, 0.0), (4, 0.5))
    ]
    found = silo_history(frames)
    share = 0.5 if half else 1.0
    assert np.array_equal(found.times, [0.0, 0.5])
    assert np.allclose(found.mass, np.array([8.0, 7.0]) / share)
    assert np.allclose(found.points, np.array([5, 4]) / share)
    # the third point is stress-free, but it is above the opening and counts
    assert np.allclose(found.velocity, [(-2 - 0.1 - 6 + 0.5) / 7, (-2 - 0.1 - 6) / 6])
    assert np.allclose(found.head, np.array([7.0, 6.0]) / (RHO_C * share * WIDTH))
    assert (found.width, found.rho_c, found.gravity) == (WIDTH, RHO_C, 9.8)
    elsewhere = silo_history(frames, opening=Opening(0.1, axis=0.2, floor=0.25))
    assert np.allclose(elsewhere.velocity, [(-2 - 0.1 + 0.5) / 4, -2.1 / 3])
    assert np.allclose(elsewhere.head, 1.0 / (RHO_C * 0.1))


def test_a_record_of_the_local_law_flows_when_it_is_let(tmp_path):
    material = gr.materials.glass_beads.replace(E=1e6)
    verdicts = []
    for opens_at in (0.4, 2.0):
        scene = gr.scenes.silo(
            orifice=0.3, cell=0.05, opens_at=opens_at, ramp=0.4, material=material
        )
        path = tmp_path / f"{opens_at}.h5"
        gr.Simulation(scene, threads=1).run(until=1.0, save=path, every=1 / 100)
        with gr.open(path) as record:
            verdicts.append(flow_verdict(record))
            line = centre_line_pressure(record[20:31])
            # confined elastic compression, nu = 0.3; g grows to 5/8 of its value in the mean
            vertical = 0.625 * 1500 * 9.8 * (1 - line.y[0])
            assert line.value[0] == pytest.approx(vertical * (1 + 3 / 7) / 2, rel=0.03)
    flowing, closed = verdicts
    assert flowing.verdict == "flowing"
    # Beverloo's C = 1.42 for the opening, which this scene makes two cells wider
    assert flowing.relative_outflow == pytest.approx(1.42 * (0.4 / 0.3) ** 1.5, rel=0.3)
    assert closed.verdict == "static"
    assert closed.outflow == 0.0


def test_bad_silos_are_refused():
    few = [SimpleNamespace(**vars(state(silo(half=True), [[0.01, 0.3]] * 9, mass=10, time=t)))
           for t in range(10)]  # fmt: skip
    no_orifice = silo(half=True)
    no_orifice.parameters = {}
    refused(
        ("0 frames", lambda: silo_history([])),
        (r"head is at most 0\.1", lambda: flow_verdict(history(-0.1, FLOW, head=0.1))),
        ("no parameter orifice", lambda: silo_history([state(no_orifice, [[0.1, 0.1]])])),
        ("10 frames until 9 s leave 0 between", lambda: flow_verdict(few)),
        ("times = ", lambda: silo_history([few[0], few[0]])),
        ("shapes", lambda: SiloHistory(TIMES, TIMES[1:], TIMES, TIMES, TIMES, WIDTH, RHO_C, 9.8)),
    )
    for wrong in ({"quiet": 0.2}, {"steady": 0.0}, {"persistence": 2.0}, {"frame": 0.0},
                  {"speed_floor": 0.0}):  # fmt: skip
        (name,) = wrong
        with pytest.raises(ValueError, match=name):
            flow_verdict(history(-0.1, FLOW), **wrong)
    refused(
        ("states = 3", lambda: silo_history(3)),
        (r"opening = 0\.14", lambda: silo_history(few, opening=0.14)),
        ("half = 1", lambda: Opening(0.1, half=1)),
        error=TypeError,
    )
    for wrong in ({"width": 0.0}, {"axis": np.inf}, {"floor": np.nan}):
        (name,) = wrong
        with pytest.raises(ValueError, match=name):
            Opening(**({"width": 0.1} | wrong))

"""Inflows: the same bits for any threads and after a restart or a kill; files."""

import os
import signal
import subprocess
import time
from dataclasses import replace

import inlets
import numpy as np
import pytest
from inlets import chute, stream
from paraview_reader import as_array, paraview
from processes import command
from schemes_by_name import scheme_of

import granular as gr

FLOOR = (gr.Wall(1, 0.0), gr.Wall(0, 0.0), gr.Wall(0, 0.4))


def choked(**more):
    """A stream into a tray, which fills up to the inlet."""
    region = gr.Box((0.1, 0.16), (0.3, 0.2))
    return stream(
        gravity=9.81,
        duration=0.5,
        walls=FLOOR,
        grid=gr.Grid((0.0, 0.0), inlets.CELL, (20, 14)),
        inflows=[gr.Inflow(region, (0.0, -1.0), 4)],
        **more,
    )


def two_materials():
    soft = gr.DruckerPrager(E=5e5)
    return choked(fills=[gr.Fill(gr.Box((0.0, 0.0), (0.4, 0.06)), 4, material=soft)])


CASES = {
    "stream": lambda: stream(gravity=9.81),
    "stream_3d": lambda: stream(dim=3, gravity=9.81, duration=0.15),
    "choked": choked,
    "driven": lambda: chute(end=0.25),
    "two_materials": two_materials,
    "linear": lambda: choked(scheme=scheme_of("linear", "tpic", "cell_averaged")),
    "apic": lambda: choked(scheme=scheme_of("quadratic", "apic", "particle")),
    "sleep": lambda: choked(scheme=gr.Scheme(sleep_speed=1e-2)),
    "nonlocal": lambda: choked(material=gr.materials.silo_grains.replace(d=0.005)),
}

QUICK = ("choked", "driven")


def bits(sim):
    return sim.checkpoint().digest


@pytest.mark.parametrize(
    "case", [c if c in QUICK else pytest.param(c, marks=pytest.mark.slow) for c in CASES]
)
def test_the_same_bits_with_any_threads_and_after_a_restart(case, tmp_path):
    """The restart is in the middle of the inflow, and frames and steps are cut differently."""
    scene = CASES[case]()
    one = gr.Simulation(scene, threads=1).run(every=0.05, monitor=False)
    assert one.inflows[0].points > 0
    if case == "choked":
        assert one.inflows[0].missed > 0
    expected = bits(one)
    path = tmp_path / "run.vtkhdf"
    two = gr.Simulation(scene, threads=2)
    while two.time < 0.3 * scene.duration:
        two.step(1 if two.steps < 50 else 7)
    two.run(until=0.4 * scene.duration, save=path, every=0.03, monitor=False)
    again = gr.Simulation.resume(path, threads=3).run(monitor=False)
    assert bits(again) == expected
    assert again.inflows[0].mass == one.inflows[0].mass


def test_frames_hold_as_many_points_as_there_are(tmp_path):
    """From none to hundreds, for the reader of ParaView, xarray and the package."""
    path = tmp_path / "run.vtkhdf"
    scene = stream(gravity=9.81, duration=0.5)
    counts = []
    sim = gr.Simulation(scene, threads=1)
    sim.run(save=path, every=0.05, hooks=(lambda s: counts.append(s.n_points),))
    assert counts[0] == 0 and max(counts) > 400 and len(set(counts)) > 7
    with gr.open(path) as record:
        assert [frame.n for frame in record] == counts
        np.testing.assert_array_equal(record[-1].x, sim.state.x)
        np.testing.assert_allclose(record.series["mass"], np.array(counts) * sim.state.mass[0])
    for (_, data), count in zip(paraview(path), counts, strict=True):
        part = data.GetPartition(0) if hasattr(data, "GetPartition") else data
        assert part.GetNumberOfPoints() == count
        if count:
            assert len(as_array(part.GetPointData().GetArray("mass"))) == count


def test_xarray_has_a_gap_where_a_point_had_not_entered(tmp_path):
    pytest.importorskip("xarray")
    path = tmp_path / "run.h5"
    gr.Simulation(stream(gravity=9.81, duration=0.2), threads=1).run(save=path, every=0.05)
    with gr.open(path) as record:
        data = gr.export.to_xarray(record)
        held = np.isfinite(data["mass"].values).sum(axis=data["mass"].dims.index("id"))
        assert held.tolist() == [frame.n for frame in record]


CHILD = """
    import sys
    import granular as gr
    from inlets import stream
    gr.Simulation(stream(gravity=9.81, duration=0.6), threads=1).run(
        save=sys.argv[1], every=0.01, checkpoint_minutes=1e-3,
        hooks=(lambda sim: print(sim.time, flush=True),),
    )
"""


@pytest.mark.slow
def test_a_killed_run_goes_on_with_the_same_bits(tmp_path):
    path = tmp_path / "killed.h5"
    child = subprocess.Popen(command(CHILD, path), stdout=subprocess.PIPE, text=True)
    for line in child.stdout:
        if float(line) > 0.2:
            break
    time.sleep(0.01)
    os.kill(child.pid, signal.SIGKILL)
    child.wait()
    child.stdout.close()
    again = gr.Simulation.resume(path).run()
    assert bits(again) == bits(
        gr.Simulation(stream(gravity=9.81, duration=0.6), threads=1).run(monitor=False)
    )


def test_a_checkpoint_with_another_inflow_is_refused():
    scene = stream(duration=0.1)
    point = gr.Simulation(scene, threads=1).run(monitor=False).checkpoint()

    def resumed(change, of=scene):
        arrays = {k: a for k, a in (point.arrays | change).items() if a is not None}
        return gr.Simulation.from_checkpoint(of, replace(point, arrays=arrays))

    state = point.arrays["inflow"]
    assert resumed({}).inflows[0].points == state[1]
    few = state.copy()
    few[0] = 3
    for change in ({"inflow": None}, {"inflow": state[:-1]}, {"inflow": few}, {"inflow": -state}):
        with pytest.raises(ValueError, match="inflow"):
            resumed(change)
    with pytest.raises(ValueError, match="inflow"):
        resumed({}, stream(duration=0.1, inflow={"points_per_cell": 9}))

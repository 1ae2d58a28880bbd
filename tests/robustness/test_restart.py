"""A run that stops and is resumed equals the uninterrupted run to the last bit."""

import numpy as np
import pytest
from schemes_by_name import scheme_of

import granular as gr


def bits(sim):
    """All data that a restart needs, as bytes in the order of the core."""
    point = sim.checkpoint()
    return point.scalars, {name: array.tobytes() for name, array in point.arrays.items()}


def shown(state):
    """The fields of a state that a user sees, as bytes."""
    return state.time, state.step, state.dt, {k: a.tobytes() for k, a in state.fields.items()}


def whole_and_parts(scene, steps, cuts, threads=(1, 1)):
    whole = gr.Simulation(scene, threads=threads[0])
    whole.step(steps)
    for cut in cuts:
        first = gr.Simulation(scene, threads=threads[0])
        first.step(cut)
        point = first.checkpoint()
        first.step(1)  # the checkpoint is a copy: later steps do not change it
        second = gr.Simulation.from_checkpoint(scene, point, threads=threads[1])
        assert second.steps == cut
        second.step(steps - cut)
        yield whole, second


@pytest.mark.parametrize("kind", ["walls", "periodic", "outlet"])
def test_restart_from_memory(small_scene, combination, dim, kind):
    """Restart at three steps, one of them between two evaluations of the adaptive time step."""
    scene = small_scene(kind, dim, combination, E=1e5)
    for whole, second in whole_and_parts(scene, 90, (1, 40, 77)):
        assert bits(whole) == bits(second)
        assert shown(whole.state) == shown(second.state)


def test_restart_with_another_number_of_threads(small_scene, combination):
    scene = small_scene("walls", 2, combination, E=1e5)
    for whole, second in whole_and_parts(scene, 100, (33,), threads=(1, 3)):
        assert bits(whole) == bits(second)


def test_restart_after_points_have_left(small_scene, combination):
    scene = small_scene("outlet", 2, combination, E=1e5, points_per_axis=4)
    for whole, second in whole_and_parts(scene, 250, (200,)):
        assert whole.checkpoint().scalars["dropped"] > 5
        assert bits(whole) == bits(second)


@pytest.mark.parametrize(
    ("basis", "transfer", "density"),
    [
        (basis, transfer, "particle")
        for basis in ("linear", "ugimp", "quadratic")
        for transfer in ("apic", "tpic")
    ]
    + [("quadratic", "tpic", "smoothed"), ("linear", "tpic", "cell_averaged")],
)
def test_a_soft_silo_restarts_in_a_long_run(basis, transfer, density):
    """Half of the silo flows out in 1200 steps, no faster than by a fall from the top."""
    scene = gr.scenes.silo(
        cell=0.025,
        orifice=0.2,
        material=gr.materials.glass_beads.replace(E=1e5),
        scheme=scheme_of(basis, transfer, density),
    )
    whole, points = gr.Simulation(scene, threads=1), []
    for _ in range(12):
        whole.step(100)
        assert np.linalg.norm(whole.state.v, axis=1).max() < np.sqrt(2 * 9.8 * 1.0)
        if whole.steps in (100, 700):
            points.append(whole.checkpoint())
    assert 0.3 * scene.n_points < whole.n_points < 0.7 * scene.n_points
    for point in points:
        second = gr.Simulation.from_checkpoint(scene, point, threads=2)
        second.step(1200 - second.steps)
        assert bits(second) == bits(whole)


def test_frames_leave_out_what_only_a_restart_needs(small_scene, tmp_path):
    scene, path = small_scene("walls", 2, ("quadratic", "tpic", "smoothed")), tmp_path / "run.h5"
    sim = gr.Simulation(scene, threads=1).run(until=0.01, save=path, every=0.005)
    carried = {"affine", "density_gradient", "shift_velocity"}
    with gr.open(path) as record:
        assert set(record[-1].fields) == set(sim.state.fields) - carried
    assert carried < set(sim.checkpoint().arrays)


def test_restart_by_a_record(small_scene, combination, tmp_path):
    """Restart from the file between two outputs, and append to the same record."""
    scene = small_scene("outlet", 2, combination, E=1e5)
    whole, path, other = tmp_path / "whole.h5", tmp_path / "parts.h5", tmp_path / "cut.h5"
    gr.Simulation(scene, threads=1).run(until=0.06, save=whole, every=0.02)
    for until, target in ((0.02, path), (0.03, other)):
        gr.Simulation(scene, threads=1).run(until=until, save=target, every=0.02)
        sim = gr.Simulation.resume(target, threads=2)
        sim.run(until=0.06, every=0.02)
    with gr.open(whole) as one, gr.open(path) as parts, gr.open(other) as cut:
        assert one.checkpoint().digest == parts.checkpoint().digest == cut.checkpoint().digest
        assert [shown(s) for s in one] == [shown(s) for s in parts]
        # a run that ends between two frames stores one more frame
        assert {shown(s)[:2] for s in one} <= {shown(s)[:2] for s in cut}
        assert shown(one[-1]) == shown(cut[-1])


@pytest.mark.parametrize("basis", ["linear", "quadratic"])
def test_a_domain_that_has_emptied_goes_on(small_scene, basis, tmp_path):
    """When all points have left, the run and its frames still reach their end, resumed or not."""
    scene = small_scene("outlet", 2, (basis, None, None), E=1e5)
    scene = scene.replace(walls=tuple(w for w in scene.walls if w.kind == "free_slip"))
    whole, cut = tmp_path / "whole.h5", tmp_path / "cut.h5"
    gr.Simulation(scene, threads=1).run(until=1.2, save=whole, every=0.1)
    gr.Simulation(scene, threads=1).run(until=0.8, save=cut, every=0.1)
    resumed = gr.Simulation.resume(cut, threads=2)
    assert resumed.n_points == 0
    resumed.run(until=1.2, every=0.1)
    with gr.open(whole) as one, gr.open(cut) as other:
        assert len(one) == 13
        assert one.series["n"][0] > 100
        assert one.series["n"][-1] == 0
        assert 1.2 <= one.times[-1] < 1.2 + resumed.dt
        assert [shown(s) for s in one] == [shown(s) for s in other]
    before = resumed.steps
    resumed.step(3)
    assert resumed.steps == before + 3


def test_frames_go_on_as_they_were_asked_for(small_scene, tmp_path):
    """The interval between frames is read from the record, as its frames may be few."""
    scene, path = small_scene("walls", 2, ("linear", "flip", "particle"), E=1e5), tmp_path / "a.h5"
    gr.Simulation(scene, threads=1).run(until=0.01, save=path, every=0.035)
    sim = gr.Simulation.resume(path, threads=1).run(until=0.08)
    with gr.open(path) as record:
        assert record.times == pytest.approx([0.0, 0.01, 0.035, 0.07, 0.08], abs=sim.dt)
        assert record.provenance["every"] == 0.035
    sim.run(until=0.12)
    sim.run(until=0.16, every=0.02)
    gr.Simulation.resume(path, threads=1).run(until=0.19)
    with gr.open(path) as record:
        later = [0.105, 0.12, 0.14, 0.16, 0.18, 0.19]
        assert record.times[5:] == pytest.approx(later, abs=sim.dt)


def test_nothing_that_the_engine_carries_is_left_out(small_scene, combination, dim):
    """A checkpoint holds every field and scalar of the core, and each of them affects the run."""
    scene = small_scene("walls", dim, combination, E=1e5)
    sim = gr.Simulation(scene, threads=1)
    sim.step(20)
    point = sim.checkpoint()
    fields = {name for name, *_ in sim._engine.fields()}
    assert set(point.arrays) == fields | {"id"} == set(sim.buffers)
    assert set(sim._engine.scalars()) <= set(point.scalars)
    assert set(point.scalars) - set(sim._engine.scalars()) == {"mean_mass"}
    for name in point.arrays:
        rest = {k: a for k, a in point.arrays.items() if k != name}
        broken = gr.record.Checkpoint(
            time=point.time, step=point.step, dt=point.dt, scalars=point.scalars, arrays=rest
        )
        with pytest.raises(ValueError, match="checkpoint" if name == "id" else name):
            gr.Simulation.from_checkpoint(scene, broken)
    for name in point.scalars:
        rest = {k: v for k, v in point.scalars.items() if k != name}
        broken = gr.record.Checkpoint(
            time=point.time, step=point.step, dt=point.dt, scalars=rest, arrays=point.arrays
        )
        with pytest.raises(ValueError, match=name):
            gr.Simulation.from_checkpoint(scene, broken)


def test_a_changed_field_changes_the_run(small_scene, combination):
    """The fields of a checkpoint are really read back: another value gives another run."""
    scene = small_scene("walls", 2, combination, E=1e5)
    sim = gr.Simulation(scene, threads=1)
    # one step after an averaging step: the shift momentum correction is still to be subtracted
    sim.step(61)
    point = sim.checkpoint()
    sim.step(20)
    for name in set(point.arrays) - {"id", "shear_rate"}:
        arrays = {k: a.copy() for k, a in point.arrays.items()}
        arrays[name] += 1e-6 * np.maximum(abs(arrays[name]), 1e-3)
        changed = gr.record.Checkpoint(
            time=point.time, step=point.step, dt=point.dt, scalars=point.scalars, arrays=arrays
        )
        other = gr.Simulation.from_checkpoint(scene, changed, threads=1)
        other.step(20)
        assert shown(other.state)[3]["v"] != shown(sim.state)[3]["v"], name


def test_a_checkpoint_of_another_scene_is_refused(small_scene):
    flat = gr.Simulation(small_scene("walls", 2, ("linear", "flip", "particle")), threads=1)
    with pytest.raises(ValueError, match="checkpoint"):
        gr.Simulation.from_checkpoint(
            small_scene("walls", 3, ("linear", "flip", "particle")), flat.checkpoint()
        )
    with pytest.raises(ValueError, match="affine"):
        gr.Simulation.from_checkpoint(
            small_scene("walls", 2, ("linear", "apic", "particle")), flat.checkpoint()
        )


def test_the_core_saves_all_its_fields_in_some_scheme(small_scene):
    """One scheme uses every field that the core knows."""
    scene = small_scene("walls", 2, ("quadratic", "tpic", "smoothed"))
    carried = {name for name, *_ in gr.Simulation(scene, threads=1)._engine.fields()}
    assert carried == {
        "x", "v", "stress", "log_density", "mass", "shear_rate", "affine", "density_gradient",
        "shift_velocity", "weight_correction",
    }  # fmt: skip

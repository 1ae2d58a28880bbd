"""The result is the same to the last bit for any number of threads, and if a run is resumed."""

import os
import subprocess
import sys
import textwrap
from dataclasses import replace

import numpy as np
import pytest
from oracle_fluidity import available
from same_bits import bits, same_bits, shown, stepped
from scenes_by_hand import scene_with, two_clouds
from schemes_by_name import scheme_of

import granular as gr
from granular import cli

# ---- threads and restarts ----


def cut_and_whole(scene, steps, cuts):
    """A run in several calls, with another number of threads after each restart, has the bits of
    one call by one thread."""
    whole = stepped(scene, steps, threads=1)
    part = gr.Simulation(scene, threads=2)
    for threads, cut in zip((2, 5, 3), (*cuts, steps), strict=True):
        point = part.checkpoint()
        part.step(1)  # the checkpoint is a copy: later steps do not change it
        part = gr.Simulation.from_checkpoint(scene, point, threads=threads)
        while part.steps < cut:
            part.step(min(23, cut - part.steps))
    assert bits(part) == bits(whole)
    assert shown(part.state) == shown(whole.state)


def test_threads_and_restarts_give_the_same_bits(small_scene, combination, dim):
    """Restart after the first step, and between two evaluations of the adaptive time step."""
    cut_and_whole(small_scene("walls", dim, combination, E=1e5), 120, (1, 77))


def test_also_in_a_periodic_domain(small_scene, typical_combination, dim):
    cut_and_whole(small_scene("periodic", dim, typical_combination, E=1e5), 120, (1, 77))


def test_also_where_points_leave(small_scene, typical_combination, dim):
    """Points have left before the second restart."""
    scene = small_scene("outlet", dim, typical_combination, E=1e5, points_per_axis=6 - dim)
    assert stepped(scene, 200).checkpoint().scalars["dropped"] > 5
    cut_and_whole(scene, 250, (1, 200))


@pytest.mark.parametrize("dim", [2, 3])
def test_thousands_of_points_change_cells_in_a_step(dim):
    """Two clouds fly through each other: where many points arrive, all threads insert them."""
    scene = two_clouds(dim, *((40, 8, 12) if dim == 2 else (16, 4, 5)))
    one = stepped(scene, 40, threads=1)
    assert bits(stepped(scene, 40, threads=3)) == bits(one)
    before, cell = np.floor(one.state.x / scene.grid.cell), scene.grid.cell
    one.step(1)
    assert (np.floor(one.state.x / cell) != before).any(axis=1).sum() > 1000


@pytest.mark.parametrize(("threads", "steps"), [(100, 20), (gr._core.MAX_THREADS, 5)])
def test_many_more_threads_than_cores(threads, steps):
    """A column that flies apart is grouped anew by them, again and again."""
    cell = 0.05
    scene = scene_with(
        grid=gr.Grid((0.0, 0.0), cell, (60, 20)),
        fills=(gr.Fill(gr.Box((1.0, 0.0), (1.8, 0.7)), 16, jitter=1.0, velocity=(3.0, 0.0)),),
        walls=(gr.Wall(1, 0.0, kind="no_slip"),),
        material=gr.MuI(E=1e5),
    )
    expected = bits(stepped(scene, steps, threads=1))
    assert bits(stepped(scene, steps, threads=threads)) == expected


FUSING = [isa for isa in available() if isa != "baseline"]
"""Instruction sets with a fused multiply-add; one lane is the form of the kernels for a device."""


@pytest.mark.skipif(len(FUSING) < 2, reason="needs a processor with AVX2")
def test_sets_with_a_fused_multiply_add_give_the_same_bits(small_scene, combination, dim):
    """No sum depends on the number of lanes, and no root on the estimates of a processor."""
    local = small_scene("walls", dim, combination, E=1e5)
    grains = local.material
    nonlocal_law = gr.materials.NGF(E=grains.E, rho_c=grains.rho_c, A=0.5, d=2e-3)
    creeping = gr.materials.RegularisedMuI(E=grains.E, rho_c=grains.rho_c)
    for material in (grains, nonlocal_law, creeping):
        if combination[0] == "ugimp" and material is nonlocal_law:
            continue  # which has no uGIMP
        sims = [
            gr.Simulation(local.replace(material=material), threads=1, isa=isa) for isa in FUSING
        ]
        for sim in sims:
            sim.step(70)
        assert all(bits(sim) == bits(sims[0]) for sim in sims[1:])


@pytest.mark.skipif(len(FUSING) < 2, reason="needs a processor with AVX2")
@pytest.mark.parametrize("name", ["cylinder_collapse", "excavation", "conveyor_heap", "silo"])
def test_a_record_goes_on_with_one_lane_and_back(name, tmp_path):
    """Rings, thin bodies with a nonlocal law, an inflow, and cells that rest."""
    scene = gr.scenes.registry[name](
        **{
            "cylinder_collapse": {"cell": 0.05, "axisymmetric": True},
            "excavation": {"cell": 0.025},
            "conveyor_heap": {"cell": 0.02, "duration": 0.5},
            "silo": {"cell": 0.05, "scheme": gr.Scheme(sleep_speed=0.02)},
        }[name]
    )
    alone = gr.Simulation(scene, threads=1)
    alone.step(120)
    sim = gr.Simulation(scene, threads=1)
    for isa in ("one_lane", FUSING[-1], FUSING[-2]):
        sim.step(40)
        sim.run(until=sim.time, save=tmp_path / f"{isa}.h5")
        if isa != FUSING[-2]:
            sim = gr.Simulation.resume(tmp_path / f"{isa}.h5", isa=isa)
    assert bits(sim) == bits(alone)


@pytest.mark.parametrize(
    ("combination", "steps", "repeats"),
    [(("linear", "flip", "particle"), 300, 1), (("quadratic", "tpic", "smoothed"), 150, 10)],
)
def test_many_points_leave(small_scene, combination, steps, repeats):
    """Threads may start in any order, also where points change cells and leave."""
    scene = small_scene("outlet", 2, combination, E=1e5, points_per_axis=4)
    expected = bits(stepped(scene, steps, threads=1))
    assert expected[0]["dropped"] > 5
    for threads in (2, 3, 4) * repeats:
        assert bits(stepped(scene, steps, threads=threads)) == expected


@pytest.mark.parametrize("dim", [2, 3])
def test_the_regularised_law_has_the_same_bits(small_scene, tmp_path, dim):
    """Its iterations end in each lane by themselves, whatever points are beside it."""
    scene = small_scene("walls", dim, ("quadratic", "tpic", "smoothed"), E=1e5)
    creeping = gr.materials.RegularisedMuI(E=1e5, rho_c=scene.material.rho_c)
    scene = scene.replace(material=creeping)
    assert (same_bits(scene, 50, 70, path=tmp_path / "creep.h5").state.shear_rate > 0).any()


@pytest.mark.parametrize("density", ["particle", "smoothed", "cell_averaged", "of one layer"])
def test_cohesive_material_has_the_same_bits(tmp_path, density):
    """A cliff that is torn while it falls, with several threads and resumed from a record; in one
    case it stands on a layer without cohesion.
    """
    layered, density = density == "of one layer", density.replace("of one layer", "smoothed")
    basis = "linear" if density == "cell_averaged" else "quadratic"
    scheme = scheme_of(basis, "tpic", density)
    material = gr.MuI(E=1e6, cohesion=60.0, tensile_strength=30.0)
    scene = gr.scenes.cohesive_cliff(cell=0.05, ramp=0.0, material=material, scheme=scheme)
    if layered:
        low, high = gr.Box((0.0, 0.0), (0.3, 0.075)), gr.Box((0.0, 0.075), (0.3, 0.3))
        fills = [gr.Fill(low, 4, material=gr.DruckerPrager(E=1e6, mu=0.8)), gr.Fill(high, 4)]
        scene = scene.replace(fills=fills)
    one = same_bits(scene, 150, 250, path=tmp_path / "cliff.h5")
    assert 0 < one.checkpoint().arrays["separated"].sum() < 0.9 * scene.n_points


FORK = textwrap.dedent(
    """
    import multiprocessing, sys
    import granular as gr

    scene = gr.scenes.column_collapse(aspect=1.0, cell=0.1, E=1e5)
    context = multiprocessing.get_context({method!r})

    def digest(threads, answer=None):
        sim = gr.Simulation(scene, threads=threads)
        sim.step(30)
        found = sim.checkpoint().digest.hex()
        return found if answer is None else answer.put(found)

    def in_child(threads):
        answer = context.SimpleQueue()
        child = context.Process(target=digest, args=(threads, answer))
        child.start()
        child.join(30)
        if child.exitcode is None:
            child.kill()
            sys.exit("the child hangs")
        return answer.get()

    if __name__ == "__main__":
        fork = {method!r} == "fork"
        found = [in_child(2)] if fork else []
        found += [digest(2), *([in_child(1)] if fork else []), in_child(2)]
        print(*found, sep="\\n")
    """
)


@pytest.mark.parametrize("method", ["fork", "spawn"])  # "forkserver" begins a new process, too
def test_processes_beside_threads(method, tmp_path):
    """A process forked after a run with threads makes threads of its own, with the same result."""
    program = tmp_path / "program.py"
    program.write_text(FORK.format(method=method))
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join(filter(None, sys.path))}
    done = subprocess.run(
        [sys.executable, str(program)], capture_output=True, text=True, env=environment, timeout=120
    )
    assert done.returncode == 0, done.stderr
    same = done.stdout.splitlines()
    assert len(same) > 1 and len(set(same)) == 1 and len(same[0]) == 64


# ---- restarts alone, records ----


@pytest.mark.parametrize("density", ["smoothed", "cell_averaged"])
def test_the_bits_do_not_depend_on_when_points_are_grouped(density):
    """A restart groups the points anew, so that other cells are worked on together.

    Points that leave several cells for the same one must arrive in an order of their own.
    """
    scheme = gr.Scheme(density=gr.schemes.DENSITIES[density]())
    scene = gr.scenes.column_collapse(half_width=0.1, ramp=0.0, E=1e5, scheme=scheme)
    whole = gr.Simulation(scene, threads=1)
    second = gr.Simulation(scene, threads=2)
    for _ in range(40):
        whole.step(10)
        second.step(10)
        second = gr.Simulation.from_checkpoint(scene, second.checkpoint(), threads=2)
        assert bits(whole) == bits(second)


@pytest.mark.parametrize(
    ("basis", "transfer", "density"),
    [
        ("linear", "tpic", "particle"),
        ("ugimp", "apic", "particle"),
        ("quadratic", "apic", "particle"),
        ("quadratic", "tpic", "smoothed"),
        ("linear", "tpic", "cell_averaged"),
    ],
)
def test_a_soft_silo_restarts_in_a_long_run(basis, transfer, density):
    """Half of the silo flows out in 1200 steps, no faster than by a fall from the top."""
    scene = gr.scenes.silo(
        cell=0.025,
        orifice=0.2,
        material=gr.materials.glass_beads.replace(E=1e5),
        scheme=scheme_of(basis, transfer, density),
    )
    whole = gr.Simulation(scene, threads=1)
    for _ in range(12):
        whole.step(100)
        assert np.linalg.norm(whole.state.v, axis=1).max() < np.sqrt(2 * 9.8 * 1.0)
        if whole.steps == 400:
            second = gr.Simulation.from_checkpoint(scene, whole.checkpoint(), threads=2)
    assert 0.3 * scene.n_points < whole.n_points < 0.7 * scene.n_points
    second.step(800)
    assert bits(second) == bits(whole)


def test_frames_leave_out_what_only_a_restart_needs(small_scene, tmp_path):
    scene, path = small_scene("walls", 2, ("quadratic", "tpic", "smoothed")), tmp_path / "run.h5"
    sim = gr.Simulation(scene, threads=1).run(until=0.01, save=path, every=0.005)
    carried = {"affine", "density_gradient", "shift_velocity", "overstress", "mean_shear_rate"}
    with gr.open(path) as record:
        assert set(record[-1].fields) == set(sim.state.fields) - carried
    assert carried < set(sim.checkpoint().arrays)


def test_restart_by_a_record(small_scene, typical_combination, tmp_path):
    """Restart from the file between two outputs, and append to the same record."""
    scene = small_scene("outlet", 2, typical_combination, E=1e5)
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


def test_a_resumed_run_keeps_its_instruction_set(small_scene, tmp_path, monkeypatch):
    """Unless another one is asked for: sums differ in the last bits between them."""
    scene = small_scene("walls", 2, ("quadratic", "tpic", "smoothed"), E=1e5)
    gr.Simulation(scene, threads=1, isa="baseline").run(0.02, every=0.01, save=tmp_path / "a.h5")
    best = gr.Simulation(scene).isa
    whole = gr.Simulation(scene, threads=1, isa="baseline").run(0.05, every=0.01)
    assert gr.Simulation.resume(tmp_path / "a.h5", isa=best).isa == best
    monkeypatch.setenv("GRANULAR_ISA", best)  # for runs that begin
    resumed = gr.Simulation.resume(tmp_path / "a.h5", threads=1)
    assert resumed.isa == "baseline"
    assert bits(resumed.run(0.05)) == bits(whole)
    assert gr.Simulation.resume(tmp_path / "a.h5").isa == "baseline"


def test_a_lost_instruction_set_is_told(small_scene, tmp_path, monkeypatch, capsys):
    scene = small_scene("walls", 2, ("linear", "flip", "particle"), E=1e5)
    sim = gr.Simulation(scene, threads=1).run(0.02, every=0.01, save=tmp_path / "a.h5")
    told = property(lambda self: {"isa": "avx1024", "every": 0.01})
    monkeypatch.setattr(gr.Trajectory, "provenance", told)
    match = f"made with the instruction set 'avx1024', .* continues with '{sim.isa}'"
    with pytest.warns(UserWarning, match=match):
        assert gr.Simulation.resume(tmp_path / "a.h5").isa == sim.isa
    words = ["resume", str(tmp_path / "a.h5"), "--until", "0.03", "--quiet"]
    assert cli.main(words) in (0, 3)
    assert "granular: warning: " in capsys.readouterr().err


def test_nothing_that_the_engine_carries_is_left_out(small_scene, combination):
    """A checkpoint holds every field and scalar of the core, and each field is really read back:
    another value gives another run."""
    scene = small_scene("walls", 2, combination, E=1e5)
    sim = gr.Simulation(scene, threads=1)
    # one step after an averaging step: the shift momentum correction is still to be subtracted
    sim.step(61)
    point = sim.checkpoint()
    fields = {name for name, *_ in sim._engine.fields()}
    assert set(point.arrays) == fields | {"id"} == set(sim.buffers)
    assert set(sim._engine.scalars()) <= set(point.scalars)
    assert set(point.scalars) - set(sim._engine.scalars()) == {"mean_mass"}
    for kind in ("arrays", "scalars"):
        held = getattr(point, kind)
        for name in held:
            broken = replace(point, **{kind: {k: v for k, v in held.items() if k != name}})
            with pytest.raises(ValueError, match="checkpoint" if name == "id" else name):
                gr.Simulation.from_checkpoint(scene, broken)
    sim.step(20)
    for name in fields - {"shear_rate"}:
        arrays = {k: a.copy() for k, a in point.arrays.items()}
        arrays[name] += 1e-6 * np.maximum(abs(arrays[name]), 1e-3)
        other = gr.Simulation.from_checkpoint(scene, replace(point, arrays=arrays), threads=1)
        other.step(20)
        assert shown(other.state)[3]["v"] != shown(sim.state)[3]["v"], name


def test_a_checkpoint_of_another_scene_is_refused(small_scene):
    flat = gr.Simulation(small_scene("walls", 2, ("linear", "flip", "particle")), threads=1)
    for dim, transfer, words in ((3, "flip", "checkpoint"), (2, "apic", "affine")):
        other = small_scene("walls", dim, ("linear", transfer, "particle"))
        with pytest.raises(ValueError, match=words):
            gr.Simulation.from_checkpoint(other, flat.checkpoint())


def test_the_core_saves_all_its_fields_in_some_scheme(small_scene):
    """One scheme uses every field that the core knows."""
    scene = small_scene("walls", 2, ("quadratic", "tpic", "smoothed"))
    carried = {name for name, *_ in gr.Simulation(scene, threads=1)._engine.fields()}
    assert carried == {
        "x", "v", "stress", "log_density", "mass", "shear_rate", "affine", "density_gradient",
        "shift_velocity", "weight_correction", "overstress", "mean_shear_rate",
    }  # fmt: skip

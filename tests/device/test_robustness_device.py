"""A device makes the steps of a run with the bits of a processor; what it lacks is refused."""

from itertools import product

import numpy as np
import pytest
from oracle_fluidity import available
from same_bits import bits, fields, shown
from scenes_by_hand import bed_with_bodies, sleeping_bed, two_clouds
from schemes_by_name import scheme_of
from speed.own_mu_I import mu_I

import granular as gr
from granular.mpm.schemes import Fluidity

FUSING = [isa for isa in available() if isa != "baseline"]
"""Instruction sets with the bits of a device; the last of these is the fastest."""

pytestmark = pytest.mark.skipif("one_lane" not in FUSING, reason="needs a fused multiply-add")


def both(scene, **watch):
    """The same scene on a processor and on the emulated device."""
    return (
        gr.Simulation(scene, threads=1, isa=FUSING[-1], **watch),
        gr.Simulation(scene, threads=3, device="emulated", **watch),
    )


def check_bits(scene, *steps, **watch):
    """The bits of both after these numbers of steps, each in a call of its own."""
    sims = both(scene, **watch)
    assert sims[0].dt == sims[1].dt  # which is found before any step
    for n in steps:
        for sim in sims:
            sim.step(n)
        assert bits(sims[1]) == bits(sims[0])
    assert sims[1]._engine.foreign_array() is None
    assert shown(sims[1].state) == shown(sims[0].state)
    return sims


def test_every_scheme_has_the_bits_of_a_processor(small_scene, combination, dim):
    check_bits(small_scene("walls", dim, combination, E=1e5), 1, 99)


@pytest.mark.parametrize("kind", ["periodic", "outlet"])
def test_also_where_points_enter_again_and_leave(small_scene, kind, typical_combination, dim):
    check_bits(small_scene(kind, dim, typical_combination, E=1e5), 120)


@pytest.mark.parametrize("kind", ["axis", "rings"])
@pytest.mark.parametrize(
    "basis", [("linear", "flip"), ("quadratic", "xpic"), ("quadratic", "apic")]
)
def test_also_in_an_axisymmetric_plane(small_scene, kind, basis):
    check_bits(small_scene(kind, 2, (*basis, "particle"), E=1e5), 100)


def test_also_with_averages_in_an_axisymmetric_plane(small_scene):
    for scheme in (("quadratic", "tpic", "smoothed"), ("linear", "tpic", "cell_averaged")):
        check_bits(small_scene("axis", 2, scheme, E=1e5), 100)


def test_also_with_single_precision(small_scene, dim):
    scene = small_scene("walls", dim, ("quadratic", "tpic", "smoothed"), E=1e5)
    check_bits(scene.replace(scheme=scene.scheme.replace(precision="single")), 120)


FLUIDITY = {"d": 0.02, "A": 0.5, "t0": 1e-2}
LAWS = {
    "elastic": gr.materials.Elastic(E=1e5),
    "Drucker-Prager": gr.materials.DruckerPrager(E=1e5),
    "regularised mu(I)": gr.materials.RegularisedMuI(E=1e5),
    "dilatant mu(I)": gr.DilatantMuI(E=1e5),
    "Hencky mu(I)": gr.MuI(E=1e5, elasticity="hencky"),
    "hardening": gr.materials.HardeningDruckerPrager(E=1e5),
    "restitution": gr.MuI(E=1e5, restitution=0.5, contact_diameter=0.01),
    "NGF": gr.materials.NGF(E=1e5, **FLUIDITY),
    "Hencky NGF": gr.materials.NGF(E=1e5, elasticity="hencky", **FLUIDITY),
}


@pytest.mark.parametrize("material", LAWS.values(), ids=LAWS)
def test_every_law_has_the_bits_of_a_processor(small_scene, material, dim):
    scene = small_scene("walls", dim, ("quadratic", "tpic", "smoothed"))
    check_bits(scene.replace(material=material), 90)


@pytest.mark.parametrize(
    "second",
    [
        gr.materials.DruckerPrager(E=2e5, rho_c=1200.0),
        gr.materials.NGF(E=2e5, rho_c=1200.0, **FLUIDITY),
    ],
    ids=["local", "nonlocal"],
)
def test_also_several_materials(small_scene, second, dim):
    scene = small_scene("walls", dim, ("quadratic", "tpic", "smoothed"), E=1e5)
    fills = (scene.fills[0], scene.fills[1].replace(material=second))
    check_bits(scene.replace(fills=fills), 90)


WAYS = list(product(("explicit", "implicit", "rkl2"), ("faces", "isotropic"), (1, 3)))


@pytest.mark.parametrize(("method", "stencil", "substeps"), WAYS)
@pytest.mark.parametrize("density", ["smoothed", "cell_averaged"])
def test_the_fluidity_diffuses_with_the_bits_of_a_processor(
    small_scene, density, method, stencil, substeps
):
    """In every way, between rough walls and across periodic ends."""
    basis = "quadratic" if density == "smoothed" else "linear"
    dim = 2 if stencil == "faces" or density == "cell_averaged" else 3
    scene = small_scene("periodic", dim, (basis, "tpic", density))
    diffusion = Fluidity(method=method, stencil=stencil, substeps=substeps, initial=0.5)
    scheme = scene.scheme.replace(fluidity=diffusion, dt=2e-4)
    check_bits(scene.replace(material=LAWS["NGF"], scheme=scheme), 40)


@pytest.mark.parametrize("precision", ["double", "single"])
def test_also_on_a_grid_of_many_pages(precision):
    """Sums are of several groups of chunks, and the search for g takes many iterations."""
    diffusion = Fluidity(method="implicit", initial=0.5, tolerance=1e-9)
    scheme = gr.Scheme(precision=precision, fluidity=diffusion, dt=1e-4)
    sand = LAWS["NGF"].replace(d=0.1)
    scene = gr.scenes.column_collapse(cell=0.0016, points_per_cell=1, material=sand)
    fills = tuple(fill.replace(lithostatic=True) for fill in scene.fills)
    sim = check_bits(scene.replace(scheme=scheme, fills=fills), 4)[1]
    assert sim._engine.fluidity()["iterations"] > 20


@pytest.mark.parametrize(
    ("name", "numbers"),
    [
        ("column_collapse", {"cell": 0.05, "points_per_cell": 4}),
        ("cylinder_collapse", {"cell": 0.1}),
        ("cylinder_collapse", {"cell": 0.05, "axisymmetric": True}),
        ("cylinder_collapse", {"cell": 0.05, "axisymmetric": True, "material": LAWS["NGF"]}),
        ("silo_fed", {"cell": 0.02, "duration": 0.3}),
        ("rotating_drum", {"cell": 0.02, "width": 0.04}),
        ("landslide", {"cell": 0.04}),
        ("flexible_barrier", {"cell": 0.025}),
    ],
)
def test_ready_made_scenes_have_the_bits_of_a_processor(name, numbers):
    """Runs in which points are grouped anew; one has an inflow, and some have bodies."""
    check_bits(gr.scenes.registry[name](**numbers), 150)


@pytest.mark.parametrize(
    ("scheme", "thin"),
    [
        (("quadratic", "tpic", "smoothed"), False),
        (("linear", "tpic", "cell_averaged"), False),
        (("quadratic", "xpic", "particle"), False),
        (("quadratic", "apic", "particle"), True),
        (("linear", "flip", "particle"), True),
    ],
)
def test_bodies_have_the_bits_of_a_processor(scheme, thin, dim):
    """A bucket that turns, a free box and a disc that sticks, with their forces and patches."""
    scene = bed_with_bodies(dim, thin).replace(scheme=scheme_of(*scheme))
    sims = check_bits(scene, 1, 79, wall_forces=True, tractions=True)
    for sim in sims:
        sim.apply_load(1, force=(5.0,) * dim)
        sim.step(5)
    assert bits(sims[1]) == bits(sims[0])


@pytest.mark.parametrize("stencil", ["faces", "isotropic"])
def test_the_fluidity_at_bodies_has_the_bits_of_a_processor(stencil):
    """At rough ones, where it is zero, and on both sides of a thin one."""
    scene = bed_with_bodies(2, thin=True)
    bodies = tuple(body.replace(rough=True) for body in scene.bodies)
    diffusion = Fluidity(method="implicit", stencil=stencil, substeps=2, initial=0.5)
    scheme = scene.scheme.replace(fluidity=diffusion)
    check_bits(scene.replace(bodies=bodies, scheme=scheme, material=LAWS["NGF"]), 60)


def test_also_with_single_precision_and_two_sides(dim):
    scheme = scheme_of("quadratic", "apic", "particle", precision="single")
    check_bits(bed_with_bodies(dim, thin=True).replace(scheme=scheme), 80)


@pytest.mark.parametrize("name", ["tumbling_block", "rolling_wheel", "conveyor"])
def test_also_where_bodies_touch_each_other(name):
    """Free bodies that meet solid ones, and one from which material falls on another."""
    check_bits(gr.scenes.registry[name](cell=0.02), 150, wall_forces=True)


@pytest.mark.parametrize(
    ("scheme", "plate"),
    [
        (("quadratic", "tpic", "smoothed"), False),
        (("linear", "tpic", "cell_averaged"), False),
        (("quadratic", "tpic", "particle"), True),
    ],
)
def test_material_sleeps_and_wakes_as_on_a_processor(scheme, plate):
    """A bed falls asleep until a block strikes it, or a thin plate that is pushed into it."""
    motion = gr.Motion(times=(0.18, 0.2), velocity=((0.0, 0.0), (0.0, -0.5)))
    pushed = gr.Body(gr.Box(size=(0.1, 0.04)), position=(0.24, 0.145), motion=motion, friction=0.3)
    more = {"height": 0.0, "bodies": [pushed]} if plate else {"height": 0.45, "top": 0.6}
    sims, still = both(sleeping_bed(scheme, **more), wall_forces=True), []
    for n in (540, 220, 100):
        for sim in sims:
            sim.step(n)
        assert bits(sims[1]) == bits(sims[0])
        still.append((sims[0].state.v == 0).all(axis=1).mean())
    assert sims[1]._engine.foreign_array() is None
    assert still[0] > 0.5 > still[2]


def test_a_body_that_is_driven_from_outside_wakes_a_bed():
    """Between steps, when the threads of a device are not at hand."""
    plate = gr.Body(gr.Box(size=(0.1, 0.06)), position=(0.24, 0.155))
    bed = sleeping_bed(("quadratic", "tpic", "smoothed"), height=0.0, bodies=[plate])
    sims, still = both(bed), []
    for n, velocity in ((560, (0.0, 0.0)), (20, (0.0, -0.3)), (60, (0.1, 0.2))):
        for sim in sims:
            sim.set_motion(0, velocity=velocity)
            sim.step(n)
        assert bits(sims[1]) == bits(sims[0])
        still.append((sims[0].state.v == 0).all(axis=1).mean())
    assert still[0] > 0.5 > still[1]


def test_gravity_that_leans_wakes_a_bed_on_a_device():
    gravity = gr.Gravity(times=(0.0, 0.2, 0.25), vectors=((0.0, -9.8), (0.0, -9.8), (4.0, -9.8)))
    bed = sleeping_bed(("quadratic", "tpic", "smoothed"), height=0.0, gravity=gravity)
    check_bits(bed, 560, 200)


def test_the_impulses_on_walls_and_their_patches_are_those_of_a_processor(small_scene):
    scene = small_scene("outlet", 2, ("quadratic", "tpic", "smoothed"), E=1e5)
    check_bits(scene, 100, wall_forces=True, tractions=True)


@pytest.mark.parametrize("dim", [2, 3])
def test_thousands_of_points_change_cells_in_a_step(dim):
    """Two clouds fly through each other: cells are full, and tiles get rows."""
    numbers = (24, 5, 10) if dim == 2 else (12, 3, 4)
    check_bits(two_clouds(dim, *numbers), 40)


@pytest.mark.parametrize("bodies", [False, True])
def test_a_record_goes_on_with_a_device_and_back(bodies, tmp_path):
    """Without a device, a run goes on with what is fastest on the machine, and the same bits."""
    scene = bed_with_bodies(2, thin=True) if bodies else gr.scenes.column_collapse(cell=0.05)
    fastest = gr._core.build_info()["isa"]
    alone, sim = (gr.Simulation(scene, threads=1, isa=FUSING[-1]) for _ in range(2))
    alone.step(120)
    for k, device in enumerate(("emulated", None, "emulated")):
        sim.step(40)
        sim.run(until=sim.time, save=tmp_path / f"{k}.h5")
        if k < 2:
            sim = gr.Simulation.resume(tmp_path / f"{k}.h5", device=device)
            assert sim.isa == ("one_lane" if device or fastest not in FUSING else fastest)
    assert bits(sim) == bits(alone)


def test_a_failure_is_that_of_a_processor():
    """Its step and point are named, and the points are where they were."""
    scene = gr.scenes.column_collapse(cell=0.05)
    sims, told = both(scene), []
    for sim in sims:
        sim.step(20)
        sim.buffers["v"][0, np.argmax(sim.buffers["id"] == 7)] = 1e9
        with pytest.raises(gr.SimulationError) as error:
            sim.step(5)
        told.append((str(error.value), error.value.step, error.value.point))
    assert told[0] == told[1]
    assert fields(sims[0].state) == fields(sims[1].state)


def small():
    return gr.scenes.column_collapse(cell=0.1)


def own():
    sand = gr.materials.glass_beads.replace(E=1e6)
    numbers = {"mu_s": sand.mu_s, "mu_2": sand.mu_2, "xi": sand.xi}
    return gr.materials.from_function(
        mu_I, parameters=numbers, E=sand.E, nu=sand.nu, rho_c=sand.rho_c
    )


@pytest.mark.parametrize(
    ("scene", "what"),
    [
        (lambda: small().replace(material=own()), "laws of the user"),
        (lambda: gr.scenes.incline_sph(height=0.05), "processors alone compute SPH"),
    ],
)
def test_what_a_device_lacks_is_refused_by_name(scene, what):
    with pytest.raises(ValueError, match=f"device.*{what}"):
        gr.Simulation(scene(), device="emulated")


def test_bad_arguments_are_refused():
    with pytest.raises(ValueError, match="device = 'gpx' must be"):
        gr.Simulation(small(), device="gpx")
    with pytest.raises(ValueError, match="isa = 'avx2' must not be given with device"):
        gr.Simulation(small(), device="emulated", isa="avx2")
    engine = gr.Simulation(small(), device="emulated")._engine
    with pytest.raises(ValueError, match="an engine with a device cannot be shared"):
        engine.share(None, 0, 1, 0, np.zeros(1, dtype=np.int32))
    with pytest.raises(ValueError, match="n = -1 must not be negative"):
        engine.zeros(-1)
    with pytest.raises(MemoryError):
        engine.zeros(2**62)
    alone = pytest.raises(ValueError, match="processes share runs on processors alone")
    with gr.ranks.threads(1) as comm, alone:
        gr.Simulation(small(), device="emulated", comm=comm)


@pytest.mark.skipif(len(FUSING) < 3, reason="needs two other sets with the bits of one lane")
def test_sph_goes_on_with_the_set_of_its_record(tmp_path):
    """Its lanes are neighbours, over which sums go: no two sets have the same bits."""
    sim = gr.Simulation(gr.scenes.incline_sph(height=0.05), isa=FUSING[-2])
    sim.step(2)
    sim.run(until=sim.time, save=tmp_path / "run.h5")
    assert gr.Simulation.resume(tmp_path / "run.h5").isa == FUSING[-2] != FUSING[-1]

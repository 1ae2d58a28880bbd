"""Cohesion at a point: strength, separation, and how separated material coheres again."""

import math

import numpy as np
import oracle_law
import pytest
from scenes_by_hand import scene_with

import granular as gr
from granular import _core, measure, sph, theory
from granular.mpm.scaling import Froude

SOIL = gr.DruckerPrager(E=1e7, cohesion=400.0, mu=0.4)
BEADS = gr.MuI(E=1e7, cohesion=400.0, mu_s=0.4, mu_2=0.6)
MATERIALS = {"drucker_prager": SOIL, "mu_I": BEADS}
DT = 1e-4
ISAS = ("baseline", "")


class Point:
    """Equal points that are strained step by step, in 2D."""

    def __init__(self, material, isa="", from_density=True, pressure=0.0):
        lanes = {"baseline": 2, "": _core.build_info()["lanes"]}[isa]
        self.material, self.isa, self.lanes = material, isa, lanes
        self.from_density = from_density
        self.log_density = np.full(lanes, pressure / material.K)
        self.stress = np.zeros((4, lanes))
        self.stress[:3] = -pressure
        self.rate, self.separated = np.zeros((2, lanes))
        numbers = vars(material) | {"K": material.K, "G": material.G}
        self.numbers = {name: numbers[name] for name, *_ in _core.laws()[material.law][1]}

    def strain(self, xx=0.0, xy=0.0, yy=0.0, dt=DT):
        """One step with the increments of L dt."""
        gradient = np.zeros((1, 4, self.lanes))
        gradient[0] = np.array([xx, xy, 0.0, yy])[:, None]
        self.log_density -= xx + yy
        _core.law_update(
            self.material.law, 2, self.numbers, dt, int(self.from_density), gradient,
            self.log_density, self.stress, self.rate, self.isa, None, None, None, self.separated,
        )  # fmt: skip
        assert (np.ptp(self.stress, axis=1) == 0).all()

    @property
    def pressure(self):
        return -self.stress[:3, 0].mean()

    @property
    def shear(self):
        s = oracle_law.tensor(self.stress[:, :1].T, 2)[0] + self.pressure * np.eye(3)
        return math.sqrt((s**2).sum() / 2)


def expand(point, log_density, steps=20):
    """Strain alike in both directions up to a log-density."""
    step = (point.log_density[0] - log_density) / steps / 2
    for _ in range(steps):
        point.strain(xx=step, yy=step)


@pytest.mark.parametrize("from_density", [True, False])
@pytest.mark.parametrize("isa", ISAS)
@pytest.mark.parametrize("law", MATERIALS)
def test_separation_and_contact(law, isa, from_density):
    """Tension up to the strength; then none until the density is rho_c; then tension again."""
    material = MATERIALS[law]
    loosest = material.tensile_strength / material.K
    point = Point(material, isa, from_density)
    expand(point, -0.999 * loosest)
    assert point.pressure == pytest.approx(-0.999 * material.tensile_strength, rel=1e-3)
    assert not point.separated.any()
    expand(point, -1.001 * loosest, 1)
    assert not point.stress.any() and (point.separated == 1).all()
    expand(point, -3 * loosest)
    expand(point, -0.01 * loosest)  # closer than where it came apart, and yet apart
    assert not point.stress.any() and (point.separated == 1).all()
    expand(point, 0.5 * loosest, 1)
    assert point.pressure > 0 and not point.separated.any()
    if from_density:  # else the pressure grows from that of the step of contact
        assert point.pressure == pytest.approx(0.5 * material.tensile_strength, rel=1e-9)
    expand(point, -0.4 * loosest)
    assert point.pressure < -0.3 * material.tensile_strength
    assert not point.separated.any()


def test_strength_without_tension():
    """With a tensile strength of 0 material separates as without cohesion, and yet coheres."""
    point = Point(SOIL.replace(tensile_strength=0.0), pressure=10.0)
    for _ in range(200):
        point.strain(xy=1e-5)
    assert point.shear == pytest.approx(400.0 + 0.4 * 10.0, rel=1e-12)
    expand(point, -1e-9, 1)
    assert not point.stress.any()


@pytest.mark.parametrize("pressure", [-900.0, -300.0, 0.0, 500.0, 5000.0])
@pytest.mark.parametrize("law", MATERIALS)
def test_plane_strain_is_mohr_and_coulomb(law, pressure):
    """In coaxial flow (s1 - s3)/2 = c cos(phi) + (s1 + s3)/2 sin(phi), also in tension."""
    point = Point(MATERIALS[law], pressure=pressure)
    for _ in range(4000):  # slow: the rate adds nothing
        point.strain(xx=1e-6, yy=-1e-6, dt=1e3)
    s1, s3 = -point.stress[1, 0], -point.stress[0, 0]
    limits = theory.cliff_height(cohesion=400.0, mu=0.4, density=1.0)
    phi = math.asin(0.4)
    expected = limits.coaxial_cohesion * math.cos(phi) + (s1 + s3) / 2 * math.sin(phi)
    assert (s1 - s3) / 2 == pytest.approx(expected, rel=1e-5)
    assert (s1 + s3) / 2 == pytest.approx(pressure, abs=1e-3)


@pytest.mark.parametrize(("pressure", "rate"), [(1000.0, 5.0), (1000.0, 50.0), (20.0, 50.0)])
def test_flow_is_cohesion_and_friction_of_the_rate(pressure, rate):
    point = Point(BEADS, pressure=pressure)
    for _ in range(3000):
        point.strain(xy=rate * DT)
    I_over_I0 = rate / (BEADS.xi * math.sqrt(pressure))
    mu = 0.4 + 0.2 / (1 + 1 / I_over_I0)
    assert point.rate[0] == pytest.approx(rate, rel=1e-6)
    assert point.shear == pytest.approx(400.0 + mu * pressure, rel=1e-6)


def test_flow_in_tension_has_no_rate():
    shear = []
    for rate in (1.0, 1000.0):
        point = Point(BEADS, pressure=-500.0)
        for _ in range(1000):
            point.strain(xy=1e-5, dt=1e-5 / rate)
        shear.append(point.shear)
    assert shear == pytest.approx([400.0 - 0.4 * 500.0] * 2, rel=1e-12)


@pytest.mark.parametrize("make", [gr.DruckerPrager, gr.MuI])
@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"cohesion": -1.0}, "cohesion = -1.0 must be"),
        ({"cohesion": math.nan}, "cohesion = nan must be"),
        ({"cohesion": math.inf}, "cohesion = inf must be"),
        ({"cohesion": 1.0, "tensile_strength": -0.1}, "tensile_strength = -0.1 must be"),
        ({"cohesion": 1.0, "tensile_strength": 3.0}, r"must not exceed .* cohesion/mu = 2\.618"),
        ({"tensile_strength": 1.0}, r"must not exceed .* cohesion/mu = 0"),
        ({"cohesion": 1.0, "elasticity": "hencky"}, r"cohesion = 1\.0 must be 0 with elasticity"),
    ],
)
def test_bad_numbers(make, arguments, message):
    with pytest.raises(ValueError, match=message):
        make(**arguments)
    with pytest.raises(TypeError, match=r"cohesion = '1' must be"):
        make(cohesion="1")


@pytest.mark.parametrize("material", MATERIALS.values())
def test_derived_strength_follows_the_cohesion(material):
    assert material.tensile_strength == 1000.0
    assert material.replace(cohesion=40.0).tensile_strength == 100.0
    weak = material.replace(tensile_strength=30.0)
    assert weak.replace(cohesion=40.0).tensile_strength == 30.0
    assert "tensile_strength" not in material.arguments()
    assert weak.arguments()["tensile_strength"] == 30.0


def test_scenes_with_cohesion():
    """Scenes keep it in files and at other sizes, and refuse more than the density can follow."""
    scene = gr.scenes.cohesive_cliff(cohesion=200.0)
    assert gr.Scene.from_json(scene.to_json()) == scene
    assert Froude(0.25).scene(scene).material.cohesion == 50.0
    assert "separated" not in gr.Simulation(scene.replace(material=gr.MuI(E=1e6))).state.fields
    with pytest.raises(ValueError, match=r"tensile_strength = 26184\.9 must be below .* 16666\.7"):
        gr.scenes.cohesive_cliff(cohesion=1e4)


def test_what_is_for_grains_without_cohesion_says_so():
    with pytest.raises(ValueError, match=r"tensile_strength = 1000 must be 0: material of SPH"):
        sph.Viscoplastic.matching(BEADS, 100.0)
    torn = BEADS.replace(tensile_strength=0.0)
    assert sph.Viscoplastic.matching(torn, 100.0).cohesion == 400.0
    for call in (
        lambda: theory.bagnold_mean(25.0, 0.1, BEADS),
        lambda: theory.plastic_shear_rate(1.0, 0.5, BEADS),
        lambda: theory.transient(25.0, 0.1, BEADS, [1.0]),
        lambda: theory.well_posed_range(BEADS),
        lambda: theory.well_posed_slopes(BEADS),
        lambda: theory.scaled_inertial_number_of_slope(25.0, BEADS),
    ):
        with pytest.raises(ValueError, match=r"cohesion = 400\.0 of the material must be 0"):
            call()
    with pytest.raises(ValueError, match="pressure = None must be given"):
        theory.ill_posedness(1.0, BEADS)


def test_ill_posedness_with_cohesion():
    """C from derivatives of tau(p, rate) taken by differences; without pressure it is that of c."""
    x, p, h = np.array([0.01, 0.5, 20.0]), 300.0, 1e-5

    def tau(pressure, rate):
        number = rate / np.sqrt(pressure / p)
        return 400.0 + (0.4 + 0.2 * number / (1 + number)) * pressure

    q = (tau(p * (1 + h), x) - tau(p * (1 - h), x)) / (2 * h * p)
    r = np.log(tau(p, x * (1 + h)) / tau(p, x * (1 - h))) / (2 * h)
    found = theory.ill_posedness(x, BEADS, np.full(3, p))
    np.testing.assert_allclose(found, q**2 - 4 * r * (1 - r), rtol=1e-6)
    many = theory.ill_posedness(x, BEADS, np.full(3, 1e12))
    plain = theory.ill_posedness(x, BEADS.replace(cohesion=0.0))
    np.testing.assert_allclose(many, plain, rtol=1e-6)


def test_health_of_a_cohesive_flow():
    sim = gr.Simulation(gr.scenes.cohesive_cliff(cell=0.05, material=gr.MuI(E=1e6, cohesion=10.0)))
    sim.run(until=0.3)
    assert 0 <= measure.ill_posed_fraction(sim.state) <= 1
    assert measure.ill_posed_fraction(sim.state) > 0


@pytest.mark.filterwarnings("ignore:the material is closed in on every side")
@pytest.mark.parametrize("compression", [0.05, -0.005])
@pytest.mark.parametrize("material", [
    gr.MuI(E=1e6), gr.MuI(E=1e6, elasticity="hencky"), SOIL.replace(E=1e6),
    gr.Elastic(E=1e6, elasticity="hencky"),
])  # fmt: skip
def test_a_fill_starts_with_the_pressure_that_its_law_keeps(material, compression):
    """A uniform density without gravity: cohesive grains that are loose have come apart."""
    scene = scene_with(
        grid=gr.Grid((0.0, 0.0), 0.02, (8, 8), periodic=(True, True)),
        fills=(gr.Fill(gr.Box((0.0, 0.0), (0.16, 0.16)), 4, density=1500 * math.exp(compression)),),
        material=material,
        gravity=0.0,
    )
    sim = gr.Simulation(scene, threads=1)
    pressure = material.K * compression
    if material.elasticity == "hencky":
        pressure *= math.exp(compression)
    if material.granular:
        pressure = max(pressure, 0.0)
    for steps in (0, 20):
        sim.step(steps) if steps else None
        assert sim.state.pressure == pytest.approx(pressure, rel=1e-12, abs=1e-6)

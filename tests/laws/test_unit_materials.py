"""Materials: relations between moduli, the two forms of the rate constant, refused input."""

import math
import pickle

import pytest

from granular import NGF, DruckerPrager, Elastic, MuI, RegularisedMuI, materials, scenes
from granular.materials import Material, OwnLaw

OWN = {"name": "law", "language": "c", "source": ""}


def test_moduli_of_isotropic_elasticity():
    m = Elastic(E=2.6, nu=0.3, rho_c=2.0)
    assert math.isclose(m.G, 1.0, rel_tol=1e-15)
    assert math.isclose(m.K, 2.6 / 1.2, rel_tol=1e-15)
    # the P-wave modulus by another route: E (1 - nu)/((1 + nu)(1 - 2 nu))
    assert m.wave_speed**2 * 2.0 == pytest.approx(2.6 * 0.7 / (1.3 * 0.4), rel=1e-14)
    # glass beads of the paper: E = 1 GPa, nu = 0.3: M = 1.346 GPa, c = sqrt(M/1500)
    assert materials.glass_beads.wave_speed == pytest.approx(947.3, abs=0.1)


def test_rate_constant_from_grain_size():
    m = materials.glass_beads_5mm
    assert m.xi == pytest.approx(1.1233, abs=5e-5)
    assert (m.I0, m.d) == (0.278, 0.005)
    assert materials.glass_beads.I0 is None and materials.glass_beads.d is None
    assert MuI().xi == 1.1233
    assert MuI(I0=0.3, d=1e-3, rho_s=2500.0).xi == pytest.approx(6.0)


def test_replace_keeps_the_form_of_the_rate_constant():
    sized = materials.glass_beads_5mm
    assert sized.replace(E=1e7).d == 0.005
    assert sized.replace(d=0.0025).xi == pytest.approx(2 * sized.xi)
    assert sized.replace(xi=1.0) == MuI(xi=1.0)
    assert materials.glass_beads.replace(I0=0.278, d=5e-3) == sized
    with pytest.raises(ValueError, match=r"mu_2 = 0.1 must exceed mu_s = 0.3819"):
        sized.replace(mu_2=0.1)


def test_arguments_make_an_equal_material():
    nonlocal_ones = (NGF(), NGF(I0=0.3, A=0.0), NGF(b=1.0, mu_2=math.inf), materials.silo_grains)
    local_ones = (materials.glass_beads, materials.glass_beads_5mm, DruckerPrager(), Elastic(E=1.0))
    for m in (*local_ones, *nonlocal_ones, RegularisedMuI(alpha=1.8, d=0.002)):
        assert type(m)(**m.arguments()) == m
        assert pickle.loads(pickle.dumps(m)) == m
        assert hash(m) == hash(m.replace())


def test_the_two_forms_of_the_nonlocal_rate_constant():
    """b = (mu_2 - mu_s)/I0: the form that was given is kept."""
    by_I0, by_b = NGF(I0=0.279), NGF(b=1.0)
    assert NGF() == by_I0 and by_I0.b == pytest.approx((0.6435 - 0.3819) / 0.279)
    assert by_b.I0 == pytest.approx(0.6435 - 0.3819)
    assert "b" not in by_I0.arguments() and "I0" not in by_b.arguments()
    # another limiting friction leaves the given form
    assert by_I0.replace(mu_2=1.5).I0 == 0.279 and by_b.replace(mu_2=1.5).b == 1.0
    assert by_b.replace(I0=0.279) == by_I0 and by_I0.replace(b=1.0) == by_b
    assert by_I0.xi == pytest.approx(0.279 / (0.005 * math.sqrt(2450.0)))
    assert (NGF(A=0.1).law, NGF(A=0.0).law) == ("ngf", "mu_I")


def test_an_unbounded_friction_keeps_its_slope():
    m = NGF(mu_2=math.inf, b=1.5)
    assert m.I0 == math.inf
    core = m.core_friction()
    assert all(map(math.isfinite, core.values()))
    # mu = mu_s + dmu I/(I + I0) is mu_s + b I to 1e-5 where it is below 10
    for inertial in (1e-3, 0.1, 6.0):
        mu = m.mu_s + (core["mu_2"] - m.mu_s) * inertial / (inertial + core["I0"])
        assert mu - m.mu_s == pytest.approx(1.5 * inertial, rel=2e-5)
    assert NGF(mu_2=0.7, I0=0.3).core_friction()["I0"] == 0.3


def test_names_of_laws_and_of_their_parameters():
    """The core fills the parameters of a law from attributes of these names."""
    for m, law, names in (
        (MuI(), "mu_I", ("K", "G", "mu_s", "mu_2", "xi")),
        (DruckerPrager(), "drucker_prager", ("K", "G", "mu")),
        (Elastic(), "elastic", ("K", "G")),
    ):
        assert m.law == law
        assert all(math.isfinite(getattr(m, name)) for name in names)


@pytest.mark.parametrize(
    ("kind", "arguments", "error", "message"),
    [
        (MuI, {"E": 0.0}, ValueError, "E = 0.0"),
        (MuI, {"E": math.nan}, ValueError, "E = nan"),
        (MuI, {"E": "1e9"}, TypeError, "E = '1e9'"),
        (MuI, {"nu": 0.5}, ValueError, r"nu = 0.5 must be in \[0.0, 0.5\)"),
        (MuI, {"nu": -0.1}, ValueError, "nu = -0.1"),
        (MuI, {"mu_s": 0.0}, ValueError, "mu_s = 0.0"),
        (MuI, {"mu_2": 0.3}, ValueError, "mu_2 = 0.3 must exceed mu_s = 0.3819"),
        (MuI, {"mu_2": 0.3819}, ValueError, "must exceed"),
        (MuI, {"rho_c": 2500.0}, ValueError, "rho_c = 2500.0 must not exceed rho_s = 2450.0"),
        (MuI, {"rho_c": -1.0}, ValueError, "rho_c = -1.0"),
        (MuI, {"xi": 0.0}, ValueError, "xi = 0.0"),
        (MuI, {"xi": True}, TypeError, "xi = True"),
        (MuI, {"xi": 1.0, "I0": 0.3, "d": 1e-3}, ValueError, "xi = 1.0 must not be given together"),
        (MuI, {"xi": 1.0, "d": 1e-3}, ValueError, "xi = 1.0 must not be given together"),
        (MuI, {"I0": 0.3}, ValueError, "I0 = 0.3 and d = None must be given together"),
        (MuI, {"d": 0.3}, ValueError, "I0 = None and d = 0.3 must be given together"),
        (MuI, {"I0": 0.3, "d": 0.0}, ValueError, "d = 0.0"),
        (MuI, {"I0": math.inf, "d": 1.0}, ValueError, "I0 = inf"),
        (NGF, {"A": -0.1}, ValueError, "A = -0.1"),
        (NGF, {"A": math.inf}, ValueError, "A = inf"),
        (NGF, {"d": 0.0}, ValueError, "d = 0.0"),
        (NGF, {"t0": 0.0}, ValueError, "t0 = 0.0"),
        (NGF, {"t0": "1"}, TypeError, "t0 = '1'"),
        (NGF, {"mu_2": 0.3819}, ValueError, "mu_2 = 0.3819 must exceed mu_s = 0.3819"),
        (NGF, {"mu_2": math.nan}, ValueError, "mu_2 = nan"),
        (NGF, {"mu_2": math.inf}, ValueError, "mu_2 = inf must go with b"),
        (NGF, {"I0": 0.3, "b": 1.0}, ValueError, "I0 = 0.3 must not be given together with b"),
        (NGF, {"I0": 0.0}, ValueError, "I0 = 0.0"),
        (NGF, {"b": -1.0}, ValueError, "b = -1.0"),
        (NGF, {"rho_c": 2500.0}, ValueError, "rho_c = 2500.0 must not exceed"),
        (DruckerPrager, {"mu": -0.1}, ValueError, "mu = -0.1"),
        (DruckerPrager, {"rho_s": 1000.0}, ValueError, "rho_c = 1500.0 must not exceed"),
        (Elastic, {"rho_c": 0.0}, ValueError, "rho_c = 0.0"),
        (RegularisedMuI, {"mu_s": -0.1}, ValueError, "mu_s = -0.1"),
        (RegularisedMuI, {"mu_2": 0.3}, ValueError, "mu_2 = 0.3 must exceed mu_s"),
        (RegularisedMuI, {"mu_2": 0.39}, ValueError, "mu_2 = 0.39 must be larger with mu_s"),
        (RegularisedMuI, {"mu_2": math.inf}, ValueError, "mu_2 = inf"),
        (RegularisedMuI, {"d": 0.0}, ValueError, "d = 0.0"),
        (RegularisedMuI, {"I0": math.nan}, ValueError, "I0 = nan"),
        (RegularisedMuI, {"alpha": 0.0}, ValueError, r"alpha = 0.0 must be in \(0.0, 2.0\]"),
        (RegularisedMuI, {"alpha": 2.1}, ValueError, r"alpha = 2.1 must be in \(0.0, 2.0\]"),
        (RegularisedMuI, {"alpha": 0.1}, ValueError, "alpha = 0.1 must be such that the creep"),
        (RegularisedMuI, {"mu_inf": -0.1}, ValueError, "mu_inf = -0.1"),
        (RegularisedMuI, {"elasticity": "hencky"}, ValueError, 'must be "hypoelastic"'),
        (RegularisedMuI, {"I0": 1e200}, ValueError, "I0 = 1e.200 must be at most 1e.30 in size"),
        (OwnLaw, OWN | {"name": 3}, TypeError, "^name = 3 must be a str"),
        (OwnLaw, OWN | {"source": None}, TypeError, "^source = None must be a str"),
        (OwnLaw, OWN | {"history": 3}, TypeError, "^history = 3 must be a Mapping"),
        (Material, {}, TypeError, "abstract"),
    ],
)
def test_refusals(kind, arguments, error, message):
    with pytest.raises(error, match=message):
        kind(**arguments)


def test_finite_strain_and_friction_that_does_not_saturate():
    grains = materials.NGF(elasticity="hencky", rheology="linear_mu_I", A=0.3)
    assert grains.law == "hencky_linear_ngf"
    assert grains.replace(A=0.0).law == "hencky_linear_mu_I"
    assert grains.replace(rheology="mu_I").law == "hencky_ngf"
    assert type(grains)(**grains.arguments()) == grains
    with pytest.raises(ValueError, match='"linear_mu_I" must go with elasticity = "hencky"'):
        materials.NGF(rheology="linear_mu_I")
    with pytest.raises(ValueError, match="elasticity = 'soft' must be one of"):
        materials.MuI(elasticity="soft")


def test_reconnect_fluidity_needs_finite_strain():
    scene = scenes.chute_ngf()
    fluidity = scene.scheme.fluidity.replace(reconnect_fluidity=True)
    reconnected = scene.scheme.replace(fluidity=fluidity)
    message = 'reconnect_fluidity = True must go with elasticity = "hencky"'
    with pytest.raises(ValueError, match=message):
        scene.replace(scheme=reconnected)
    scene.replace(scheme=reconnected, material=scene.material.replace(elasticity="hencky"))

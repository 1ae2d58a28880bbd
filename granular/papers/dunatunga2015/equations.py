"""Equations of the document, and where the package has them."""

from granular.papers.dunatunga2015.document import PAPER
from granular.papers.figure import Equation

MU_I = "csrc/law/frictional.h:frictional_blocks"

PAPER.equations += [
    Equation(
        "2.4", "density follows the divergence of the velocity", ("csrc/mpm/g2p.inl:move_row",)
    ),
    Equation("2.6", "plastic flow along the stress deviator", (MU_I,)),
    Equation(
        "2.7",
        "pressure from the density, K (1 - rho_c/rho)",
        (MU_I,),
        "K ln(rho/rho_c), which is what the rate form 2.9 integrates to, and eq. A 4 without its "
        "last term; the two differ by p/(2 K) of the pressure",
    ),
    Equation("2.8", "Jaumann rate of the stress", ("csrc/law/trial.h:gr_turned",)),
    Equation("2.9", "linear elasticity with constant moduli", ("csrc/law/trial.h:gr_strain",)),
    Equation("2.10", "equivalent shear stress and pressure", ("csrc/law/trial.h:gr_tau_squared",)),
    Equation("2.11", "inertial number", ("granular/materials/laws.py:xi",)),
    Equation("2.12", "friction mu(I)", ("csrc/law/flow_rules.h:gr_flow_mu_I",)),
    Equation(
        "2.13", "shear stress in flow", ("granular/theory/constitutive.py:plastic_shear_rate",)
    ),
    Equation(
        "2.14", "no stress below the critical density", ("csrc/law/frictional.h:gr_bears_stress",)
    ),
    Equation(
        "2.15", "elastoplastic flow otherwise", ("granular/theory/constitutive.py:reference",)
    ),
    Equation(
        "3.1-3.3",
        "linear shape functions at the point",
        ("csrc/mpm/shape.h:gr_shape_1d",),
        "quadratic B-splines by default, since linear functions fail in flows of several columns; "
        "`schemes.dunatunga_kamrin_2015` has the linear ones",
    ),
    Equation("3.4", "mass, momentum and forces of the nodes", ("csrc/mpm/p2g.inl:p2g_cells",)),
    Equation(
        "3.5-3.7", "momentum of the nodes after a step", ("csrc/mpm/node_motion.inl:move_group",)
    ),
    Equation(
        "3.8",
        "velocity, velocity gradient and position of the points",
        ("csrc/mpm/g2p.inl:move_row",),
        "by default points carry the velocity gradient (TPIC) and their density is corrected by "
        "nodal averages; the published scheme is FLIP without either",
    ),
    Equation(
        "3.9",
        "volume of a point",
        ("csrc/mpm/g2p.inl:move_row",),
        "the logarithm of the density is stored, so that the exponential is exact in each step",
    ),
    Equation("3.10", "trial stress", ("csrc/law/trial.h:gr_trial",)),
    Equation(
        "3.11",
        "coefficients of the quadratic equation",
        ("csrc/law/flow_rules.h:gr_flow_mu_I",),
        "H = S2 tau + S0 alpha: the document prints a comma in this product",
    ),
    Equation("3.12-3.13", "return of the stress", (MU_I,)),
    Equation(
        "3.14-3.15",
        "shear stress after a step",
        ("csrc/law/flow_rules.h:gr_flow_mu_I",),
        "the discriminant is a sum of terms that are not negative",
    ),
    Equation(
        "3.16",
        "stress after a step",
        (MU_I,),
        "the pressure has a minus sign: the document prints + p I, although p is positive in "
        "compression",
    ),
    Equation("4.1-4.3", "stress smoothed for pictures", ("granular/measure/fields.py:smooth",)),
    Equation("4.4-4.5", "Beverloo's law", ("granular/theory/beverloo.py:beverloo_rate",)),
    Equation("4.6", "Bagnold profile", ("granular/theory/incline.py:bagnold_profile",)),
    Equation("4.7", "mean speed on an incline", ("granular/theory/incline.py:bagnold_mean",)),
    Equation(
        "A 9",
        "inverse packing fraction in steady shear",
        ("granular/papers/dunatunga2015/volumes.py:inverse_packing",),
        "for figure 12 only: the flow keeps its density",
    ),
    Equation(
        "B 1-B 2",
        "velocity gradient of the test of the stress update",
        ("granular/theory/constitutive.py:appendix_b_velocity_gradient",),
    ),
]

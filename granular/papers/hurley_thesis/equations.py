"""Equations of the thesis, and where the package has them."""

from granular.papers.figure import Equation
from granular.papers.hurley_thesis.document import PAPER

MATRICES = "granular/grain_scale/inference/matrices.py"
STATIC = "granular/grain_scale/inference/static.py"
DYNAMIC = "granular/grain_scale/inference/dynamic.py"
STEADY = "granular/grain_scale/friction_law/steady.py"
SUMS, STRESS = "csrc/sph/sums.inl", "csrc/sph/stress.inl"

PAPER.equations += [
    # ---- chapter 2 ----
    Equation(
        "2.1",
        "mean stress of an assembly",
        ("granular/grain_scale/inference/statistics.py:macroscopic_stress",),
        "contacts with walls count as well unless they are left out: with them the sum is exact",
    ),
    Equation(
        "2.3-2.5",
        "balance of the forces and moments of a grain",
        (f"{MATRICES}:equilibrium_matrix",),
        "arms are from the centroid of each grain, moments are divided by the mean radius",
    ),
    Equation(
        "2.6-2.8",
        "mean stress of a grain from its contact forces",
        (f"{MATRICES}:stress_matrix", f"{MATRICES}:stress_vector"),
    ),
    Equation(
        "2.9-2.12",
        "repulsion, and friction in 2D",
        (f"{MATRICES}:admissibility_matrix",),
        "a sphere has a round cone, as in eq. 3.19, also at rest",
    ),
    Equation("2.13", "forces at rest", (f"{STATIC}:infer_static",)),
    Equation(
        "2.14",
        "forces at rest with a regularisation",
        (f"{STATIC}:infer_static", f"{STATIC}:infer_with_boundary"),
        "squares in place of norms: the same forces with another lambda, which "
        "`Inference.weight_of_norms` converts",
    ),
    Equation(
        "2.15",
        "relative error of the forces",
        ("granular/papers/hurley_thesis/errors.py:relative_error",),
    ),
    Equation(
        "2.16", "noise of the stresses", ("granular/papers/hurley_thesis/errors.py:with_noise",)
    ),
    Equation(
        "2.17",
        "lambda from the force of a load cell",
        (f"{STATIC}:boundary_force", f"{STATIC}:infer_with_boundary"),
        "by a root search; scaling the forces, or the stresses by the virial, has smaller errors",
    ),
    # ---- chapter 3 ----
    Equation("3.1-3.3", "balance of momentum of a moving grain", (f"{MATRICES}:momentum_vector",)),
    Equation(
        "3.4-3.9",
        "balance of angular momentum",
        (f"{MATRICES}:momentum_vector", f"{DYNAMIC}:infer_dynamic"),
        "about the centroid, with I alpha where it is measured; the document neglects it, which "
        "makes errors of some per cent where grains are hit off their centre",
    ),
    Equation(
        "3.10-3.16",
        "mean stress of a moving grain",
        (f"{MATRICES}:stress_vector",),
        "about the centroid, where the product of its position and acceleration vanishes; motion "
        "within a grain is neglected as in the document",
    ),
    Equation(
        "3.17",
        "repulsion and friction, with normals into the grain",
        (f"{MATRICES}:admissibility_matrix",),
        "normals point out of the grain, as in chapter 2",
    ),
    Equation(
        "3.18",
        "forces in motion",
        (f"{DYNAMIC}:infer_dynamic", f"{DYNAMIC}:pareto_front"),
        "squares in place of norms, and rows over their errors where these are known",
    ),
    Equation(
        "3.19", "the same in 3D, with cones", ("granular/grain_scale/inference/solvers.py:conic",)
    ),
    # ---- chapter 4 ----
    Equation("4.1-4.4", "balance of energy of a steady shear flow", (f"{STEADY}:balance",)),
    Equation(
        "4.5-4.6",
        "friction from the dissipation at the contacts",
        (f"{STEADY}:friction_by_law",),
        "over all contacts, since a flag of sliding misses some that slide; the work of dilation "
        "is measured apart (`SteadyShear.balance`)",
    ),
    Equation(
        "4.7",
        "stress from the contacts",
        ("granular/grain_scale/friction_law/contacts.py:sample",),
        "with the kinetic part, which is 0.3 % of the normal stress at I = 0.1 and 7 % at I = 1",
    ),
    Equation(
        "4.8-4.9",
        "viscoelastic and sliding parts of the friction",
        (f"{STEADY}:friction_viscoelastic", f"{STEADY}:friction_sliding"),
    ),
    Equation(
        "4.10",
        "coordination number",
        ("granular/grain_scale/friction_law/fits.py:fit_coordination",),
    ),
    Equation("4.11", "packing fraction", ("granular/calibrate/mu_I.py:fit_packing",)),
    # ---- chapter 5 ----
    Equation("5.1", "balance of momentum", (f"{SUMS}:sph_forces",)),
    Equation("5.2", "rate of strain D = L + L^T", (f"{SUMS}:sph_rates",)),
    Equation(
        "5.3-5.4",
        "stress and yield",
        (f"{STRESS}:sph_stress_of",),
        "the law has no stress at |D| = 0: below the strength there are a spring and a largest "
        "viscosity (`Viscoplastic.nu`, `Numerics.regularisation`), so that slopes do not creep",
    ),
    Equation("5.5", "equation of state", (f"{STRESS}:sph_strength_of",), "gamma is fixed at 3/2"),
    Equation("5.6", "bulk modulus", (f"{SUMS}:sph_filter", "granular/sph/material.py:wave_speed")),
    Equation("5.7", "friction by the rates of shear and dilation", (f"{STRESS}:sph_strength_of",)),
    Equation(
        "5.8",
        "rate of dilation",
        (f"{STRESS}:sph_strength_of",),
        "limited to 0 to 0.5 as in the document's examples; the limit is a parameter",
    ),
    Equation("5.14", "cubic spline kernel", (f"{SUMS}:sph_weight",)),
    Equation(
        "5.15-5.16",
        "sums of a field and of its gradient",
        (f"{SUMS}:sph_sum", f"{SUMS}:sph_add_forces"),
        "the gradient with a plus sign: the document prints a minus",
    ),
    Equation(
        "5.17-5.19",
        "density, and the Shepard filter",
        (f"{SUMS}:sph_densities", f"{SUMS}:sph_filter"),
    ),
    Equation(
        "5.20",
        "acceleration",
        (f"{SUMS}:sph_forces",),
        "with the mass of the neighbour and without a factor rho, which conserves momentum: the "
        "document prints it otherwise",
    ),
    Equation(
        "5.21",
        "velocity gradient",
        (f"{SUMS}:sph_rates", "granular/sph/scene.py:seeding_gradient"),
        "over that of the seeding lattice, so that linear fields have exact gradients there",
    ),
    Equation(
        "5.23-5.24",
        "artificial velocity of walls",
        (f"{SUMS}:sph_factor",),
        "z is at most 1 by default (`Numerics.z_max`), 1.5 in the document: with more, rates count "
        "pairs with walls more than forces do",
    ),
    Equation("5.25-5.27", "velocity Verlet", ("csrc/sph/engine.c:kick", "csrc/sph/engine.c:drift")),
    Equation(
        "5.28",
        "limits of the time step",
        ("csrc/sph/engine.c:gr_sph_stable_dt",),
        "the second limit is sqrt(h/|a|)/4, since h/|a| is no time; the third is not needed, as it "
        "bounds the viscosity",
    ),
    Equation("5.29", "angle of friction", ("granular/scenes/sph_slump.py:slump_sph",)),
    Equation(
        "5.30",
        "Bagnold's profile",
        ("granular/papers/hurley_thesis/sph_measures.py:fitted_profile",),
        "with a slip; the document's own law gives a line without dilation",
    ),
    Equation(
        "5.31",
        "decay of the acceleration",
        ("granular/papers/hurley_thesis/sph_measures.py:fitted_decay",),
    ),
    Equation(
        "5.32",
        "power laws of heights and run-outs",
        ("granular/papers/hurley_thesis/sph_measures.py:power_laws",),
    ),
]

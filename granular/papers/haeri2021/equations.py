"""Equations of the document, and where the package has them."""

from granular.papers.figure import Equation
from granular.papers.haeri2021.document import PAPER

LAW = "csrc/law/hencky.h:gr_hencky_update"
TRIAL = "csrc/law/hencky.h:gr_hencky_trial"
FLOW = "csrc/law/hencky.h:gr_hencky_flow"
NGF = "csrc/law/hencky_linear_ngf.inl:law_hencky_linear_ngf"
UPDATE = "csrc/law/fluidity_update.h:gr_fluidity_update"
P2G = "csrc/mpm/p2g.inl:p2g_cells"
PUBLISHED = "granular/papers/haeri2021/published_step.py:PublishedPoint"
NO_F = (
    "no F is stored, as the stress and the density determine the elastic strain; the explicit form "
    "is in `published_step`"
)

PAPER.equations += [
    Equation("1", "shear rate as an elastic and a plastic part", (FLOW,)),
    Equation("2", "friction mu(I)", ("csrc/law/flow_rules.h:gr_flow_mu_I",)),
    Equation("3", "inertial number", ("granular/measure/profiles.py:inertial_number",)),
    Equation(
        "4",
        "linearised inverse of mu(I)",
        ("csrc/law/flow_rules.h:gr_flow_linear_mu_I",),
        'the friction has no limit mu_2 then; `NGF(rheology="mu_I")` has the limit',
    ),
    Equation(
        "5",
        "plastic shear rate of the local law",
        ("csrc/law/hencky_linear_mu_I.inl:law_hencky_linear_mu_I",),
        "implicit in the stress at the end of the step",
    ),
    Equation(
        "6",
        "dynamical equation of the fluidity",
        (NGF, "csrc/fluidity/diffuse.c:gr_fluidity_diffuse"),
        "diffusion on the grid and reaction at the points in succession; the reaction is implicit, "
        "so that the fluidity remains positive in any time step",
    ),
    Equation(
        "7",
        "steady equation of the fluidity",
        ("granular/theory/couette.py:couette_flow",),
        "with the quadratic term of eq. 6; the limit of slow flow is `couette_quasi_static`",
    ),
    Equation(
        "8",
        "cooperativity length",
        ("granular/theory/couette.py:couette_decay_length",),
        "the length over which the fluidity falls below mu_s; that of eq. 6 in its slow limit",
    ),
    Equation("9", "weak form of the balance of momentum", (P2G,)),
    Equation(
        "10",
        "lumped mass of the nodes",
        (P2G,),
    ),
    Equation(
        "11-13",
        "moving least squares with quadratic B-splines, gradient by 4/dx^2",
        ("csrc/mpm/shape.h:gr_shapes",),
        "by default the derivatives of the splines themselves (TPIC); APIC, with 4/dx^2, in the "
        "published scheme",
    ),
    Equation(
        "14-15",
        "forces of the points on the nodes",
        (P2G, "csrc/mpm/node_motion.inl:move_group"),
        "by default with quadrature weights that make a uniform pressure exert no force",
    ),
    Equation(
        "16",
        "Laplacian by a 7-point stencil",
        ("csrc/fluidity/passes.inl:outflow",),
        "on cells, of normalised means of the fluidity; the published code takes sums that are not "
        'normalised. The recommended 27 points: `Fluidity(stencil="isotropic")`',
    ),
    Equation(
        "17-18",
        "deformation gradient and its explicit step",
        (TRIAL, PUBLISHED),
        f"{NO_F}; the gradient of a step is exp(dt dev L)",
    ),
    Equation("19", "trial elastic deformation gradient", (TRIAL, PUBLISHED), NO_F),
    Equation(
        "20",
        "logarithmic elastic strain",
        ("csrc/law/strain.h:gr_trial_strain",),
        "of the left stretch, which needs no polar decomposition and has the same invariants",
    ),
    Equation(
        "21",
        "Hooke's law between logarithmic strain and Mandel stress",
        (TRIAL,),
        "the rotated form: the Kirchhoff stress",
    ),
    Equation(
        "22",
        "pressure from the trace of the trial stress",
        (FLOW,),
        "from the density, K ln(rho/rho_c): the same without the change of det F^p by which the "
        "explicit step loses pressure in shear",
    ),
    Equation(
        "23",
        "fluidity of points that reconnect",
        ("csrc/law/hencky.h:gr_hencky_nonlocal",),
        "if `Fluidity.reconnect_fluidity` is true, as in the scenes of the document; otherwise 0",
    ),
    Equation("24", "explicit step of the fluidity", (UPDATE, PUBLISHED), "implicit, see eq. 6"),
    Equation("25", "trial shear stress and direction of flow", (FLOW,)),
    Equation("26", "shear stress after the step", (FLOW,)),
    Equation(
        "27",
        "Cauchy stress",
        ("csrc/law/hencky_blocks.h:gr_hencky_blocks",),
    ),
    Equation("28", "friction after the step", (FLOW,)),
    Equation("29", "plastic shear rate", (FLOW,)),
    Equation(
        "30-31",
        "plastic velocity gradient, and explicit step of F^p",
        (FLOW, PUBLISHED),
        f"the elastic strain is scaled along its own direction: volume is kept exactly; {NO_F}",
    ),
]

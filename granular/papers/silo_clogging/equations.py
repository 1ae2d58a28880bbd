"""Equations of the document, and where the package has them."""

from granular.papers.figure import Equation
from granular.papers.silo_clogging.document import PAPER

UPDATE = "csrc/law/fluidity_update.h:gr_fluidity_update"
LAW = "csrc/law/ngf.inl:law_ngf"

PAPER.equations += [
    Equation("2.1", "evolution of the fluidity", (UPDATE, "csrc/fluidity/passes.inl:outflow")),
    Equation("2.2", "shear rate of a fluidity", (LAW,)),
    Equation(
        "3.1",
        "thickness below which a layer does not flow",
        ("granular/theory/stopping.py:stopping_height",),
    ),
    Equation(
        "5.1",
        "Laplacian of the fluidity of the cells",
        ("csrc/fluidity/passes.inl:outflow",),
        'the same with `stencil="faces"`; cells without material have no face',
    ),
    Equation("5.2", "the evolution again, with b = (mu_2 - mu_s)/I0", (UPDATE,)),
    Equation(
        "5.3",
        "step of diffusion",
        ("csrc/fluidity/diffuse.c:explicit_step", "csrc/mpm/fluidity_coupling.inl:store_gain"),
        "backward Euler, balanced with the law, where an explicit step would not be stable",
    ),
    Equation(
        "5.4",
        "step of the law, with g^2 split over its beginning and end",
        (UPDATE,),
        "the pressure under the root is averaged over half a cell with linear functions "
        "(`pressure_averaging`)",
    ),
    Equation("5.5", "shear stress after a step", (UPDATE,)),
    Equation(
        "5.6-5.7",
        "quadratic equation of the fluidity",
        (UPDATE,),
        "f = dt (mu_2 - mu_s)/t0, and the first coefficient has mu_2 + mu_s f, as 5.4 and 5.5 "
        "give: the document leaves t0 out, without which f has a dimension, and prints a minus",
    ),
    Equation(
        "5.8",
        "its root",
        ("csrc/law/fluidity_update.h:gr_fluidity_of_root",),
        "without cancellation, for a fluidity relative to that of the friction mu_2",
    ),
    Equation("5.9", "stress after a step", (LAW,)),
    Equation(
        "B 1-B 2",
        "weak form of the balance of momentum, and the same with shape functions",
        ("csrc/mpm/p2g.inl:p2g_cells",),
    ),
    Equation(
        "B 3-B 4",
        "integrals as sums over the points in each cell",
        ("csrc/mpm/p2g.inl:p2g_cells",),
        "a point has no extent: the document has a fixed one, similar to uGIMP, which is refused "
        "with the nonlocal law",
    ),
    Equation("B 5", "lumped mass", ("csrc/mpm/p2g.inl:p2g_cells",)),
    Equation("C 1-C 2", "momentum and mass of the nodes", ("csrc/mpm/p2g.inl:p2g_cells",)),
    Equation(
        "C 3",
        "forces of the stress",
        ("csrc/mpm/p2g.inl:prepare_force",),
        "with a minus, as follows from B 2: the document prints none, and C 6 adds the forces",
    ),
    Equation(
        "C 4-C 6",
        "other forces of the nodes, and their sum",
        ("csrc/mpm/p2g.inl:p2g_cells", "csrc/mpm/node_motion.inl:move_group"),
        "no tractions (C 5), which are zero in the document too",
    ),
    Equation("C 7-C 9", "velocity of the nodes", ("csrc/mpm/node_motion.inl:move_group",)),
    Equation("C 10-C 13", "motion and volume of the points", ("csrc/mpm/g2p.inl:move_row",)),
    Equation("C 14", "update of the stress", ("csrc/mpm/cell_view.inl:call_law",)),
]

"""Inference of contact forces from images: positions, contacts and mean stresses of grains (GEM).

This is the method of Hurley's thesis, chapters 2 and 3. `Packing` holds the measured data.
`infer_static`, `infer_with_boundary` and `infer_dynamic` infer the forces, and every `Inference`
states how reliable they are. docs/reports/inference.md has the equations and the limits.
"""

from granular.grain_scale.inference.dynamic import ParetoFront, infer_dynamic, pareto_front
from granular.grain_scale.inference.matrices import (
    admissibility_matrix,
    contact_frames,
    equilibrium_matrix,
    friction_of_contacts,
    momentum_vector,
    stress_matrix,
    stress_vector,
)
from granular.grain_scale.inference.packing import OUTSIDE, Packing, isotropic_stiffness
from granular.grain_scale.inference.result import Flag, Inference, InferenceWarning
from granular.grain_scale.inference.solvers import InferenceError
from granular.grain_scale.inference.static import (
    BoundaryForce,
    boundary_force,
    infer_static,
    infer_with_boundary,
)
from granular.grain_scale.inference.statistics import (
    ForceStatistics,
    force_chains,
    force_statistics,
    impulses,
    largest_by_distance,
    macroscopic_stress,
    net_forces,
)

__all__ = [
    "OUTSIDE",
    "BoundaryForce",
    "Flag",
    "ForceStatistics",
    "Inference",
    "InferenceError",
    "InferenceWarning",
    "Packing",
    "ParetoFront",
    "admissibility_matrix",
    "boundary_force",
    "contact_frames",
    "equilibrium_matrix",
    "force_chains",
    "force_statistics",
    "friction_of_contacts",
    "impulses",
    "infer_dynamic",
    "infer_static",
    "infer_with_boundary",
    "isotropic_stiffness",
    "largest_by_distance",
    "macroscopic_stress",
    "momentum_vector",
    "net_forces",
    "pareto_front",
    "stress_matrix",
    "stress_vector",
]

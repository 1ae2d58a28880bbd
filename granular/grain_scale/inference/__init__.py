"""Inference of contact forces from images: positions, contacts and mean stresses of grains (GEM).

This is the method of Hurley's thesis, chapters 2 and 3. `Packing` holds the measured data.
`infer_static`, `infer_with_boundary` and `infer_dynamic` infer the forces, and every `Inference`
states how reliable they are. docs/reports/inference.md has the equations and the limits.
"""

from granular.grain_scale.inference.dynamic import ParetoFront as ParetoFront
from granular.grain_scale.inference.dynamic import infer_dynamic as infer_dynamic
from granular.grain_scale.inference.dynamic import pareto_front as pareto_front
from granular.grain_scale.inference.matrices import admissibility_matrix as admissibility_matrix
from granular.grain_scale.inference.matrices import contact_frames as contact_frames
from granular.grain_scale.inference.matrices import equilibrium_matrix as equilibrium_matrix
from granular.grain_scale.inference.matrices import friction_of_contacts as friction_of_contacts
from granular.grain_scale.inference.matrices import momentum_vector as momentum_vector
from granular.grain_scale.inference.matrices import stress_matrix as stress_matrix
from granular.grain_scale.inference.matrices import stress_vector as stress_vector
from granular.grain_scale.inference.packing import OUTSIDE as OUTSIDE
from granular.grain_scale.inference.packing import Packing as Packing
from granular.grain_scale.inference.packing import isotropic_stiffness as isotropic_stiffness
from granular.grain_scale.inference.result import Flag as Flag
from granular.grain_scale.inference.result import Inference as Inference
from granular.grain_scale.inference.result import InferenceWarning as InferenceWarning
from granular.grain_scale.inference.solvers import InferenceError as InferenceError
from granular.grain_scale.inference.static import BoundaryForce as BoundaryForce
from granular.grain_scale.inference.static import boundary_force as boundary_force
from granular.grain_scale.inference.static import infer_static as infer_static
from granular.grain_scale.inference.static import infer_with_boundary as infer_with_boundary
from granular.grain_scale.inference.statistics import ForceStatistics as ForceStatistics
from granular.grain_scale.inference.statistics import force_chains as force_chains
from granular.grain_scale.inference.statistics import force_statistics as force_statistics
from granular.grain_scale.inference.statistics import impulses as impulses
from granular.grain_scale.inference.statistics import largest_by_distance as largest_by_distance
from granular.grain_scale.inference.statistics import macroscopic_stress as macroscopic_stress
from granular.grain_scale.inference.statistics import net_forces as net_forces
from granular.tools.docstrings import complete as _complete

_complete(__name__)

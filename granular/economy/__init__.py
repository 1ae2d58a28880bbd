"""Cost of a scene, and the cost and expected error of a cheaper one.

`suggest` lists changes that make a scene cheaper (of stiffness, time step, resolution, dimension
or law), each with a reason and an expected error. `apply` makes the cheaper scene, and `cost`
estimates the cost of a run. docs/reports/economy.md has the runs from which the numbers come.
"""

from granular.economy.bias import held_decay
from granular.economy.cost import Cost, cost, time_step
from granular.economy.rules import suggest
from granular.economy.suggestion import Suggestion, Suggestions, apply
from granular.economy.symmetry import mirror_half

__all__ = [
    "Cost",
    "Suggestion",
    "Suggestions",
    "apply",
    "cost",
    "held_decay",
    "mirror_half",
    "suggest",
    "time_step",
]

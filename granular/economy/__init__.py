"""How little is enough: stiffness, time step, resolution, dimension, law, with the error expected.

`suggest` says what a scene could do without and why, `apply` makes the cheaper scene, `cost`
estimates what a run takes. docs/economy.md has the runs behind the figures.
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

"""How little is enough: stiffness, time step, resolution, dimension, law, with the error expected.

`advise` says what a scene could do without and why, `apply` makes the thriftier scene, `cost`
estimates what a run takes. docs/economy.md has the runs behind the figures.
"""

from granular.economy.advice import Advice, AdviceList, apply
from granular.economy.bias import held_decay
from granular.economy.cost import Cost, cost, time_step
from granular.economy.rules import advise
from granular.economy.symmetry import half

__all__ = [
    "Advice",
    "AdviceList",
    "Cost",
    "advise",
    "apply",
    "cost",
    "half",
    "held_decay",
    "time_step",
]

"""Cost of a scene, and the cost and expected error of a cheaper one.

`suggest` lists changes that make a scene cheaper (of stiffness, time step, resolution, dimension
or law), each with a reason and an expected error. `apply` makes the cheaper scene, and `cost`
estimates the cost of a run. docs/reports/economy.md has the runs from which the numbers come.
"""

from granular.economy.answer import Answer as Answer
from granular.economy.answer import answer as answer
from granular.economy.bias import held_decay as held_decay
from granular.economy.cost import Cost as Cost
from granular.economy.cost import cost as cost
from granular.economy.cost import time_step as time_step
from granular.economy.error_bar import Sample as Sample
from granular.economy.rules import suggest as suggest
from granular.economy.suggestion import Suggestion as Suggestion
from granular.economy.suggestion import Suggestions as Suggestions
from granular.economy.suggestion import apply as apply
from granular.economy.symmetry import mirror_half as mirror_half
from granular.tools.docstrings import complete as _complete

_complete(__name__)

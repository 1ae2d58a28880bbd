"""The verification table: measured results of the package against their expected values.

Each check is a small function that yields rows (quantity, measured, expected, passed). `check`
registers it, `main` (``granular verify``) prints its rows and the tests assert them.
"""

from granular.tools.docstrings import complete as _complete

# The modules register their checks on import; this is the order of the table.
from granular.verify import (  # isort: skip  # noqa: F401
    constitutive,
    incline,
    chute,
    silo,
    collapse,
    slug,
    hourglass,
    economy,
    invariants,
    density_correction,
    density_correction_budget,
)
from granular.verify.constitutive import constitutive_path as constitutive_path
from granular.verify.rows import Check as Check
from granular.verify.rows import Row as Row
from granular.verify.rows import check as check
from granular.verify.rows import checks as checks
from granular.verify.table import failures as failures
from granular.verify.table import main as main
from granular.verify.table import rows_of as rows_of

_complete(__name__)

"""The verification table: measured results of the package against their expected values.

Each check is a small function that yields rows (quantity, measured, expected, passed). `check`
registers it, `main` (``granular verify``) prints its rows and the tests assert them.
"""

# The modules register their checks on import; this is the order of the table.
from granular.verify import (  # isort: skip
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
from granular.verify.constitutive import constitutive_path
from granular.verify.rows import Check, Row, check, checks
from granular.verify.table import failures, main, rows_of

__all__ = [
    "Check",
    "Row",
    "check",
    "checks",
    "chute",
    "collapse",
    "constitutive",
    "constitutive_path",
    "density_correction",
    "density_correction_budget",
    "economy",
    "failures",
    "hourglass",
    "incline",
    "invariants",
    "main",
    "rows_of",
    "silo",
    "slug",
]

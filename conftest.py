"""Tests run against the installed package: a fresh checkout holds no compiled core."""

import os
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parent

# For the processes that tests start: Python would put their folder, often this one, first.
os.environ["PYTHONSAFEPATH"] = "1"

if not any(path.suffix in (".so", ".pyd") for path in (ROOT / "granular").glob("_core.*")):
    # `python -m pytest` has done so for this process.
    sys.path[:] = [folder for folder in sys.path if Path(folder or ".").resolve() != ROOT]

"""Entry point: `python -m granular` runs the command `granular`."""

import sys

from granular.cli import main

sys.exit(main())

"""`python -m granular` is the command `granular`."""

import sys

from granular.cli import main

sys.exit(main())

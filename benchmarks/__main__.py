"""Run a benchmark: `python benchmarks NAME [options]`. Without a name, list them.

With --check [TOLERANCE] its results are not stored, but compared with those that are.
"""

import json
import sys
import tempfile
from pathlib import Path

from check import TOLERANCE, differences
from matplotlib import style
from shared import RESULTS, module, scripts


def check(name: str) -> int:
    """Run a script, print what differs from its stored results, and return the exit code."""
    at = sys.argv.index("--check")
    after = sys.argv[at + 1 : at + 2]
    given = bool(after) and after[0].replace(".", "", 1).isdigit()
    tolerance = float(after[0]) if given else TOLERANCE
    del sys.argv[at : at + 1 + given]
    with tempfile.TemporaryDirectory() as folder:
        out = Path(folder, f"{name}.json")
        sys.argv += ["--out", str(out)]
        module(name).main()
        new = json.loads(out.read_text())
    moved = list(differences(json.loads((RESULTS / f"{name}.json").read_text()), new, tolerance))
    print("\n".join(moved) or "as stored")
    return int(bool(moved))


def main() -> None:
    """Run the script that the command line names."""
    names = scripts()
    if len(sys.argv) > 1 and sys.argv[1] in names:
        name = sys.argv.pop(1)
        sys.argv[0] += f" {name}"
        style.use("granular.plot.pages")
        if "--check" in sys.argv:
            sys.exit(check(name))
        module(name).main()
    else:
        print("\n".join(f"{name:28s}{line}" for name, line in names.items()))
        sys.exit(len(sys.argv) > 1)


if __name__ == "__main__":
    main()

"""Run a benchmark: `python benchmarks NAME [options]`. Without a name, list them."""

import sys

from matplotlib import style
from shared import module, scripts


def main() -> None:
    """Run the script that the command line names."""
    names = scripts()
    if len(sys.argv) > 1 and sys.argv[1] in names:
        name = sys.argv.pop(1)
        sys.argv[0] += f" {name}"
        style.use("granular.plot.pages")
        module(name).main()
    else:
        print("\n".join(f"{name:28s}{line}" for name, line in names.items()))
        sys.exit(len(sys.argv) > 1)


if __name__ == "__main__":
    main()

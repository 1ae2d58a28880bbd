"""Columns of contact dynamics by this package and by other codes: error against core-seconds.

    python benchmarks/peers.py [--quick] [--limit 200] [--only CODE ...] [--out FILE] [--core N]
                               [--page FILE] [--pictures FOLDER] [--draw]
"""

from __future__ import annotations

import os
import warnings
from pathlib import Path

from accuracy import columns
from accuracy.columns import ASPECTS, CODES, Column
from accuracy.results import Table
from shared import parser_of

import granular as gr

RESULTS = Path(__file__).parent / "results"
LIMIT = 200.0


COARSE = [(cells, points) for cells in (4, 8, 16) for points in (4, 16)]
FINE = [(32, 4), (32, 16), (64, 4)]


def cases(names):
    for cells, points in [*COARSE, *FINE]:
        for name in names:
            for law in CODES[name].laws:
                for aspect in ASPECTS:
                    yield Column(code=name, law=law, aspect=aspect, cells=cells, points=points)


def main(argv=None):
    parser = parser_of(__doc__)
    parser.set_defaults(out=RESULTS / "peers.json")
    parser.add_argument("--limit", type=float, default=LIMIT)
    parser.add_argument("--only", nargs="*", choices=list(CODES), default=list(CODES))
    parser.add_argument("--core", type=int)
    chosen = parser.parse_args(argv)
    if chosen.core is not None:
        os.sched_setaffinity(0, {chosen.core})
    warnings.simplefilter("ignore", gr.diagnostics.StabilityWarning)
    table = Table(chosen.out)
    for case in cases(chosen.only):
        if table.holds(case):
            continue
        row = columns.run(case, chosen.limit)
        table.add(row)
        print(case, row.get("core_seconds"), row.get("toe"), row.get("mean", [None])[-1], row.get("left_out"), row.get("failed"), flush=True)


if __name__ == "__main__":
    main()

"""Phase diagram of clogging silos by the nonlocal law, and its dependence on the numerics.

Half silos of `scenes.clogging_silo` (Dunatunga & Kamrin, Modelling silo clogging, section 7) over
the amplitude A and the opening W/d of figure 4a, with the scheme of the scene (linear shape
functions) and with splines; the outflow against the substeps of the fluidity; cells of half the
size (figures 9 and 10). Each case has a record in the folder, so that a script that was stopped
continues when it is called again. The seconds of a case are wall-clock time, from the start of its
run to the end of its record.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable, Sequence
from contextlib import ExitStack
from dataclasses import asdict, dataclass, field
from datetime import datetime
from pathlib import Path
from typing import Any

import numpy as np
from shared import markdown, parser_of, write

import granular as gr
from figures.refined_silos import AROUND, FLOWING_FRAME, compare, window
from granular.papers import silo_clogging
from granular.papers.silo_clogging.diagram import AMPLITUDES, BEADS, EVERY, OPENINGS, STATED
from granular.papers.silo_clogging.document import SCHEMES as CHOICE
from granular.papers.silo_clogging.silos import FINE_STEP, FRAME, W
from granular.papers.silo_clogging.velocity_slices import HEIGHTS
from granular.run.sweeping import Sweep

FOLDER = Path("build/clogging")
COMPARED = (1, 5)
"""Openings W/d that are run with cells of half the size, at A = 1."""

LINEAR = "linear"
"""Name of the published scheme in the results."""
SCHEMES = {LINEAR: CHOICE["published"], "splines": CHOICE["splines"]}
SUBSTEPS = (
    *(("implicit", n) for n in (1, 2, 5, 20)),
    # one explicit substep is refused at A = 1, W/d = 5
    *(("explicit", n) for n in (2, 5, 20)),
)

PAPER = {
    kind: [list(case) for case, verdict in STATED.items() if verdict == kind]
    for kind in ("static", "flowing")
} | {"boundary": {"A": BEADS, "opening_over_d": [1.0, 1.5]}}
"""Verdicts in the text of the paper on cases (A, W/d); figure 4a has the others as symbols only.
Its boundary at A = 0.5 is the one of lines W/d = 2 A to 3 A."""

Key = tuple[str | float, ...]


@dataclass(frozen=True)
class Plan:
    """Cases to run: amplitudes, openings, packings, sizes, duration and frame interval [s]."""

    amplitudes: Sequence[float] = AMPLITUDES
    openings: Sequence[int] = OPENINGS
    substeps: Sequence[tuple[str, int]] = SUBSTEPS
    packings: int = 8
    size: dict[str, float] = field(default_factory=lambda: {"cell": 0.0175})
    duration: float = 1.5
    every: float = EVERY

    def silo(self, scheme: gr.Scheme, **keywords: Any) -> gr.Scene:
        return gr.scenes.clogging_silo(
            scheme=scheme, duration=self.duration, **(self.size | keywords)
        )

    def diagram(self) -> dict[Key, gr.Scene]:
        """The cases of figure 4a, by the name of the scheme, A and W/d."""
        return {
            (name, A, ratio): self.silo(scheme, opening_over_d=ratio, A=A)
            for name, scheme in SCHEMES.items()
            for A in self.amplitudes
            for ratio in self.openings
        }

    def subdivided(self) -> dict[Key, gr.Scene]:
        """A = 1, W/d = 5, by the name of the scheme, the method and the number of substeps."""
        return {
            (name, method, n): self.silo(
                scheme.replace(fluidity=gr.schemes.Fluidity(method=method, substeps=n)),
                opening_over_d=5,
                A=1.0,
            )
            for name, scheme in SCHEMES.items()
            for method, n in self.substeps
        }

    def refined(self) -> dict[Key, gr.Scene]:
        """Cells of half the size and a quarter of the time step (table 2), by W/d.

        One cell of the opening between two fixed nodes is not free. So that silos with the same
        free part can be compared, the same grains also flow out of an opening two fine cells
        narrower: the mean of the two has the free part of the coarse one.
        """
        cell = self.size["cell"]
        return {
            (LINEAR, tag, ratio): self.fine(orifice, ratio * orifice / W)
            for tag, orifice in (("refined", W), ("narrow", W - cell))
            for ratio in COMPARED
        }

    def fine(self, orifice: float, ratio: float, **keywords: Any) -> gr.Scene:
        return self.silo(
            SCHEMES[LINEAR].replace(dt=FINE_STEP),
            opening_over_d=ratio,
            orifice=orifice,
            A=1.0,
            cell=self.size["cell"] / 2,
            **keywords,
        )

    def packed(self) -> dict[Key, gr.Scene]:
        """W/d = 5: coarse, refined, and refined with the narrow opening, by the seed.

        The points are displaced by a tenth of a cell at random, to measure the scatter of runs.
        """
        cell = self.size["cell"]
        scenes: dict[Key, gr.Scene] = {}
        for seed in range(self.packings):
            one = {"jitter": 0.1, "seed": seed}
            scenes[LINEAR, "packing", "coarse", seed] = self.silo(
                SCHEMES[LINEAR], opening_over_d=5, A=1.0, **one
            )
            scenes[LINEAR, "packing", "refined", seed] = self.fine(W, 5, **one)
            scenes[LINEAR, "packing", "narrow", seed] = self.fine(
                W - cell, 5 * (1 - cell / W), **one
            )
        return {
            key: scene.replace(duration=min(scene.duration, FLOWING_FRAME + 2 * AROUND))
            for key, scene in scenes.items()
        }


QUICK = Plan(
    amplitudes=(1.0,),
    openings=COMPARED,
    substeps=(("implicit", 2), ("explicit", 2)),
    packings=2,
    size={"cell": 0.035, "width": 0.56, "height": 0.56},
    duration=0.2,
    every=0.002,
)


# ---- numbers of a record ----


def late(record: gr.Trajectory, duration: float) -> list[gr.State]:
    """Frames of the last tenth of the duration."""
    first = int(np.searchsorted(record.times, 0.9 * duration - 1e-9))
    return [record[i] for i in range(first, len(record))]


def stress_free(states: Sequence[gr.State]) -> float:
    """Stress-free share of the points above the bottom."""
    shares = [np.mean(~np.asarray(s.dense, dtype=bool)[s.x[:, 1] > 0]) for s in states]
    return float(np.mean(shares))


def pressure_noise(states: Sequence[gr.State]) -> float:
    """Scatter of the pressures of the points of a cell, relative to their mean.

    It is the standard deviation in a cell, of which the median is taken over cells with 4 dense
    points or more, and then the mean over the states.
    """
    medians = []
    for state in states:
        dense = np.asarray(state.dense, dtype=bool)
        cell = np.floor(state.x[dense] / state.scene.grid.cell).astype(int)
        _, which = np.unique(cell, axis=0, return_inverse=True)
        which = which.ravel()
        p = state.pressure[dense]
        n = np.bincount(which)
        mean = np.bincount(which, p) / n
        deviation = np.sqrt(np.bincount(which, (p - mean[which]) ** 2) / n)
        medians.append(np.median((deviation / mean)[n >= 4]))
    return float(np.mean(medians))


def numbers(record: gr.Trajectory) -> dict[str, Any]:
    """Verdicts, outflow, arch, and noise of a record."""
    history = silo_clogging.silo_history(record)
    verdict = silo_clogging.flow_verdict(history)
    duration = record.scene.duration
    middle = np.interp((duration / 3, 2 * duration / 3), history.times, history.mass)
    states = late(record, duration)
    begin = datetime.fromisoformat(record.provenance["start"]).timestamp()
    row = {
        "verdict": verdict.verdict,
        "published_rule": verdict.published,
        "outflow": verdict.outflow,
        "middle_outflow": float(middle[0] - middle[1]) / (duration / 3),
        "speed": verdict.speed,
        "decay": verdict.decay,
        "mass_left": float(history.mass[-1] / history.mass[0]),
        "stress_free": stress_free(states),
        "pressure_noise": pressure_noise(states),
        "crown": None,
        "seconds": record.path.stat().st_mtime - begin,
    }
    if verdict.verdict == "static":
        row["crown"] = silo_clogging.arch_outline(states).relative_crown
    return {name: round(v, 6) if isinstance(v, float) else v for name, v in row.items()}


def slices(record: gr.Trajectory) -> tuple[np.ndarray, np.ndarray]:
    """x [m] and vertical velocity [m/s] around the frame, by height in units of W of the scene."""
    at = min(FLOWING_FRAME, record.scene.duration - AROUND)
    heights = np.array(HEIGHTS) * W / record.scene.parameters["orifice"]
    sections = silo_clogging.velocity_slices(window(record, at, AROUND), heights)
    return sections.x, sections.velocity


def swept(
    scenes: dict[Key, gr.Scene], measure: Callable, every: float, chosen: argparse.Namespace
) -> Sweep:
    """Measurements of the records of all scenes; cases without a finished record are run."""
    runs = {"folder": chosen.folder, "every": every, "workers": chosen.workers}
    return gr.sweep(scenes, measure=measure, strict=True, **runs)


def scatter(plan: Plan, chosen: argparse.Namespace) -> list[dict[str, Any]]:
    """Velocity slices of coarse and refined silos with equal free parts, averaged over packings.

    For each height: the largest difference of the two means, divided by the peak of the coarse one,
    its standard error there, and the smallest and largest such difference of single packings.
    """
    results = swept(plan.packed(), slices, FRAME, chosen)
    of = {key[2:]: result for key, result in zip(results.keys, results, strict=True)}
    x, _ = of["coarse", 0]

    def at_coarse(tag: str, seed: int) -> np.ndarray:
        positions, rows = of[tag, seed]
        return np.array([np.interp(x, positions, row) for row in rows])

    seeds = range(plan.packings)
    coarse = np.array([at_coarse("coarse", s) for s in seeds])
    fine = np.array([(at_coarse("refined", s) + at_coarse("narrow", s)) / 2 for s in seeds])
    apart, rows = fine.mean(0) - coarse.mean(0), []
    error = np.sqrt((coarse.var(0, ddof=1) + fine.var(0, ddof=1)) / plan.packings)
    for i, height in enumerate(HEIGHTS):
        peak, where = np.abs(coarse.mean(0)[i]).max(), np.abs(apart[i]).argmax()
        single = np.abs(fine - coarse)[:, i].max(axis=1) / np.abs(coarse[:, i]).max(axis=1)
        rows.append(
            {
                "height_over_W": height,
                "largest": round(float(abs(apart[i, where]) / peak), 4),
                "standard_error": round(float(error[i, where] / peak), 4),
                "single": [round(float(v), 4) for v in (single.min(), single.max())],
            }
        )
    return rows


# ---- the table ----


def rows_of(
    scenes: dict[Key, gr.Scene], plan: Plan, chosen: argparse.Namespace
) -> list[dict[str, Any]]:
    """Numbers of each case."""
    results = swept(scenes, numbers, plan.every, chosen)
    return [
        {"scheme": key[0], "case": list(key[1:])} | row
        for key, row in zip(results.keys, results, strict=True)
    ]


def thresholds(rows: list[dict[str, Any]]) -> dict[str, Any]:
    """Lines through the origin for each scheme, by our verdict and by the paper's rule."""
    result: dict[str, Any] = {}
    for scheme in SCHEMES:
        mine = [row for row in rows if row["scheme"] == scheme]
        A, ratio = np.array([row["case"] for row in mine]).T
        result[scheme] = {
            rule: asdict(silo_clogging.flow_threshold(A, ratio, [row[rule] for row in mine]))
            for rule in ("verdict", "published_rule")
        }
    return result


def refinement(folder: Path) -> list[dict[str, Any]]:
    """Comparison of coarse and refined silos, from the records of both."""
    rows = []
    for ratio in COMPARED:
        names = (f"linear_{tag}_{ratio}.h5" for tag in ("1.0", "refined", "narrow"))
        with ExitStack() as stack:
            coarse, *fine = (stack.enter_context(gr.open(folder / name)) for name in names)
            for equal, chosen in (("nodes", fine[:1]), ("free part", fine)):
                row = {"opening_over_d": ratio, "equal": equal}
                rows.append(row | compare(coarse, chosen, ratio))
    return rows


def plain(value: Any) -> Any:
    """Replace nan and infinity, which JSON does not have."""
    if isinstance(value, dict):
        return {name: plain(v) for name, v in value.items()}
    if isinstance(value, (list, tuple)):
        return [plain(v) for v in value]
    return value if not isinstance(value, float) or np.isfinite(value) else None


def seconds(tables: dict[str, Any]) -> float:
    """Sum over all runs."""
    return round(
        sum(r["seconds"] for part in ("diagram", "refined", "substeps") for r in tables[part])
    )


def show(tables: dict[str, Any]) -> None:
    """Print the diagrams (a line per opening, a letter per case) and lines through the origin."""
    rows = tables["diagram"]
    for scheme in SCHEMES:
        cases = {tuple(row["case"]): row for row in rows if row["scheme"] == scheme}
        amplitudes, openings = (sorted(set(values)) for values in zip(*cases, strict=True))
        print(f"{scheme}: verdict (and by the paper's rule); A = {amplitudes}")
        for ratio in reversed(openings):
            line = (cases[A, ratio] for A in amplitudes)
            print(f"  W/d = {ratio}  ", *(f"{r['verdict']}/{r['published_rule']}" for r in line))
        lines = tables["thresholds"][scheme]["verdict"]
        print(f"  static below {lines['static_below']} A, flowing above {lines['flowing_above']} A")


def tables(results: dict[str, Any]) -> dict[str, list[str]]:
    """Tables of the page: verdict and outflow of each case, by scheme."""
    by_scheme: dict[str, dict[tuple[float, int], str]] = {}
    for row in results["diagram"]:
        amplitude, ratio = row["case"]
        outflow = f" {row['outflow']:.0f}" if row["outflow"] >= 0.5 else ""
        agrees = row["verdict"] == row["published_rule"]
        text = f"{row['verdict'][0]}{outflow}{'' if agrees else ' *'}"
        by_scheme.setdefault(row["scheme"], {})[amplitude, ratio] = text
    made = {}
    for scheme, cases in by_scheme.items():
        amplitudes, ratios = (sorted(set(part)) for part in zip(*cases, strict=True))
        head = ("W/d", *(f"A = {a:g}" for a in amplitudes))
        rows = [(r, *(cases.get((a, r), "") for a in amplitudes)) for r in reversed(ratios)]
        made[scheme] = markdown(head, rows)
    return made


def main(argv: list[str] | None = None) -> None:
    parser = parser_of(__name__, __doc__, "coarse and short, to see it runs")
    parser.add_argument("--workers", type=int, help="processes, by default all processors")
    parser.add_argument("--folder", type=Path, default=FOLDER, help=f"of the records ({FOLDER})")
    chosen = parser.parse_args(argv)
    plan = QUICK if chosen.quick else Plan()
    parts: dict[str, Callable[[], Any]] = {
        "diagram": lambda: rows_of(plan.diagram(), plan, chosen),
        "thresholds": lambda: thresholds(tables["diagram"]),
        "refined": lambda: rows_of(plan.refined(), plan, chosen),
        "refinement": lambda: refinement(chosen.folder),
        "packings": lambda: scatter(plan, chosen),
        "substeps": lambda: rows_of(plan.subdivided(), plan, chosen),
        "seconds": lambda: seconds(tables),
    }
    tables: dict[str, Any] = {"paper": PAPER}
    for name, part in parts.items():
        tables[name] = part()
        write(chosen.out, plain(tables))
    show(tables)

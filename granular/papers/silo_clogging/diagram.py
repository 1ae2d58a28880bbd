"""Figure 4a: static and flowing silos over the nonlocal amplitude and the opening."""

from __future__ import annotations

from typing import Any

from granular import scenes
from granular.materials import silo_grains
from granular.papers.figure import Drawn, Number
from granular.papers.runs import Runs
from granular.papers.silo_clogging.document import PAPER, SCHEMES, E
from granular.papers.silo_clogging.flow import flow_verdict
from granular.papers.silo_clogging.phase_diagram import phase_diagram
from granular.papers.silo_clogging.threshold import flow_threshold
from granular.plot.canvas import Picture

AMPLITUDES = (0.1, 0.5, 1.0, 1.5, 2.0, 2.5, 3.0)
OPENINGS = (1, 2, 3, 4, 5)
STATED = {(1.0, 1): "static", (1.0, 2): "static"} | {(A, 5): "flowing" for A in (0.1, 0.5, 1.0)}
"""Verdicts that the text states, by A and W/d; the figure has the others as symbols only."""
EVERY = 1 / 120
"""Time between the frames that the verdict looks at [s]."""


def name_of(A: float, ratio: float) -> str:
    return f"verdict at A = {A:g}, W/d = {ratio:g}"


@PAPER.figure(
    "4a",
    "static and flowing silos over the nonlocal amplitude A and the opening W/d",
    seconds=45.0,
    paper={name_of(*case): verdict for case, verdict in STATED.items()},
    E=E,
    schemes=SCHEMES,
)
def phase(runs: Runs) -> Drawn:
    """Run 35 silos, and judge whether they flow at the end.

    The slopes are those of the steepest line through the origin below which all silos are static,
    and of the flattest above which all flow, by the verdict of the package and by the rule of the
    document.
    """
    amplitudes, openings = ((1.0,), (1, 5)) if runs.quick else (AMPLITUDES, OPENINGS)
    scheme, grains = runs.choose(SCHEMES), runs.grains(silo_grains)
    size: dict[str, Any] = (
        {"cell": 0.035, "width": 0.56, "height": 0.56, "duration": 0.3} if runs.quick else {}
    )
    cases = [(A, ratio) for A in amplitudes for ratio in openings]
    verdicts, published = [], []
    numbers: dict[str, Number] = {}
    for A, ratio in cases:
        scene = scenes.clogging_silo(
            opening_over_d=ratio, A=A, scheme=scheme, material=grains, **size
        )
        name = f"A = {A:g}, W/d = {ratio:g}"
        states = runs.frames(scene, scene.duration, EVERY, lambda s: s, name)
        found = flow_verdict(states)
        verdicts.append(found.verdict)
        published.append(found.published)
        numbers[name_of(A, ratio)] = found.verdict
    amplitude, opening = (list(part) for part in zip(*cases, strict=True))
    lines = flow_threshold(amplitude, opening, verdicts)
    for rule, kinds in (("", verdicts), (", rule of the document", published)):
        slopes = flow_threshold(amplitude, opening, kinds)
        numbers[f"undecided{rule}"] = float(kinds.count("unsure"))
        numbers[f"static below W/d = A times{rule}"] = slopes.static_below
        numbers[f"flowing above W/d = A times{rule}"] = slopes.flowing_above
    picture = Picture(figsize=(5.5, 4.4), layout="tight")
    phase_diagram(amplitude, opening, verdicts, threshold=lines, ax=picture.add_subplot())
    return Drawn({"": picture}, numbers)

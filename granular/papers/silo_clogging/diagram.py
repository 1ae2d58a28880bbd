"""Figure 4a: static and flowing silos over the nonlocal amplitude and the opening."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from granular import scenes
from granular.materials import silo_grains
from granular.papers.figure import Drawn, Number
from granular.papers.runs import Runs
from granular.papers.silo_clogging.document import SCHEMES, figure_of_runs
from granular.papers.silo_clogging.flow import FlowVerdict, flow_verdict
from granular.papers.silo_clogging.phase_diagram import phase_diagram
from granular.papers.silo_clogging.threshold import flow_threshold
from granular.plot.canvas import Picture

AMPLITUDES = (0.1, 0.5, 1.0, 1.5, 2.0, 2.5, 3.0)
OPENINGS = (1, 2, 3, 4, 5)
STATED = {(1.0, 1): "static", (1.0, 2): "static"} | {(A, 5): "flowing" for A in (0.1, 0.5, 1.0)}
"""Verdicts that the text states, by A and W/d; the figure has the others as symbols only."""
BEADS = 0.5
"""Amplitude at which the text has the boundary between both."""
BOUNDARY = f"W/d from static to flowing at A = {BEADS:g}"
EVERY = 1 / 120
"""Time between the frames that the verdict looks at [s]."""


def at(A: float, ratio: float) -> str:
    return f"A = {A:g}, W/d = {ratio:g}"


@figure_of_runs(
    "4a",
    "static and flowing silos over the nonlocal amplitude A and the opening W/d",
    seconds=85.0,
    paper={f"verdict at {at(*case)}": verdict for case, verdict in STATED.items()}
    | {BOUNDARY: "1 to 1.5", "verdicts that W/d/A alone does not separate": "none"},
)
def phase(runs: Runs) -> Drawn:
    """Run 35 silos, and judge whether they flow at the end.

    The slopes are those of the steepest line through the origin below which all silos are static,
    and of the flattest above which all flow, by the verdict of the package and by the rule of the
    document.
    """
    amplitudes, openings = ((1.0,), (1, 5)) if runs.quick else (AMPLITUDES, OPENINGS)
    cases = [(A, ratio) for A in amplitudes for ratio in openings]
    judged = {case: judge(runs, *case) for case in cases}
    verdicts = [one.verdict for one in judged.values()]
    amplitude, opening = (list(part) for part in zip(*cases, strict=True))
    numbers: dict[str, Number] = {}
    for case, one in judged.items():
        numbers[f"verdict at {at(*case)}"] = one.verdict
    for case, one in judged.items():
        numbers[f"outflow at {at(*case)} [kg/(s m)]"] = one.outflow
    published = [one.published for one in judged.values()]
    for rule, kinds in (("", verdicts), (", rule of the document", published)):
        slopes = flow_threshold(amplitude, opening, kinds)
        numbers[f"undecided{rule}"] = float(kinds.count("unsure"))
        numbers[f"static below W/d = A times{rule}"] = slopes.static_below
        numbers[f"flowing above W/d = A times{rule}"] = slopes.flowing_above
    lines = flow_threshold(amplitude, opening, verdicts)
    numbers["verdicts that W/d/A alone does not separate"] = "some" if lines.overlap else "none"
    if BEADS in amplitudes:
        numbers[BOUNDARY] = boundary({r: judged[BEADS, r].verdict for r in openings})
    picture = Picture(figsize=(5.5, 4.4), layout="tight")
    phase_diagram(amplitude, opening, verdicts, threshold=lines, ax=picture.add_subplot())
    return Drawn({"": picture}, numbers)


def judge(runs: Runs, A: float, ratio: float) -> FlowVerdict:
    """Run a silo, and judge whether it flows at the end."""
    size: dict[str, Any] = (
        {"cell": 0.035, "width": 0.56, "height": 0.56, "duration": 0.3} if runs.quick else {}
    )
    scene = scenes.clogging_silo(
        opening_over_d=ratio,
        A=A,
        scheme=runs.choose(SCHEMES),
        material=runs.grains(silo_grains),
        **size,
    )
    return flow_verdict(runs.frames(scene, scene.duration, EVERY, lambda s: s, at(A, ratio)))


def boundary(verdicts: Mapping[int, str]) -> str:
    """Largest opening that is static and least one that flows, from verdicts by W/d."""
    static = [ratio for ratio, verdict in verdicts.items() if verdict == "static"]
    flowing = [ratio for ratio, verdict in verdicts.items() if verdict == "flowing"]
    return f"{max(static, default='?')} to {min(flowing, default='?')}"

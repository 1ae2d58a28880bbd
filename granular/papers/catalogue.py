"""The documents by name, and the drawing of their figures."""

from __future__ import annotations

import textwrap
import warnings
from dataclasses import replace
from importlib import import_module

from granular.papers.figure import Document, Drawn, Figure
from granular.papers.runs import Runs, Settings
from granular.plot.canvas import Picture
from granular.run.diagnostics import StabilityWarning
from granular.tools.checks import one_of

DOCUMENTS = ("dunatunga2015", "silo_clogging", "haeri2021", "hurley_thesis")
"""Names of the documents, which are those of modules of `granular.papers`."""

CHARACTER = 0.042
"""Mean width of a character of 6 points [inches]."""


def document(name: str) -> Document:
    """Document of this name, with all its figures.

    Parameters
    ----------
    name : str
        One of `DOCUMENTS`.

    Raises
    ------
    ValueError
        If there is no such document.
    """
    module = import_module(f"granular.papers.{one_of('document', name, DOCUMENTS)}")
    paper: Document = module.PAPER
    return paper


def draw(name: str, figure: str, settings: Settings | None = None) -> Drawn:
    """Draw a figure or table of a document.

    Parameters
    ----------
    name : str
        Document, one of `DOCUMENTS`.
    figure : str
        Name of the figure, such as "5", "4a" or "table_3".
    settings : Settings, optional

    Returns
    -------
    Drawn
        Pictures, and the numbers that they show. Below the right corner of a picture stand the
        schemes, moduli and cells that were run and the commit; save it with
        ``bbox_inches="tight"``, so that they are not cut off.

    Raises
    ------
    ValueError
        If there is no such figure, or it is not drawn from data; the message says why.
    """
    paper = document(name)
    known = paper.figures[one_of("figure", figure, tuple(paper.figures))]
    if known.function is None:
        reason = f": {known.reason}" if known.reason else ""
        raise ValueError(f"figure = {figure!r} of {name} is a {known.state}{reason}")
    chosen = settings or Settings()
    check_settings(name, known, chosen)
    E = known.quick_E if chosen.size == "quick" else known.E
    runs = Runs(chosen, E, paper.E)
    with warnings.catch_warnings():
        # Many figures are at a limit on purpose; `Drawn.runs` has the verdicts.
        warnings.simplefilter("ignore", StabilityWarning)
        drawn = replace(known.function(runs), runs=runs.verdicts)
    for picture in drawn.pictures.values():
        mark(picture, runs.note)
    return drawn


def check_settings(name: str, figure: Figure, settings: Settings) -> None:
    """Refuse settings that a figure would not follow."""
    label = f"figure {figure.name} of {name}"
    if settings.scheme is not None:
        if not figure.schemes:
            raise ValueError(f"scheme = {settings.scheme!r}: {label} has no choice of a scheme")
        one_of("scheme", settings.scheme, figure.schemes)
    for option in ("E", "tolerance"):
        if figure.E is None and getattr(settings, option) is not None:
            raise ValueError(
                f"{option} = {getattr(settings, option)}: {label} has no modulus to be changed"
            )


def mark(picture: Picture, note: str) -> None:
    """Write what made a picture below its right corner."""
    lines = textwrap.fill(note, round(picture.get_figwidth() / CHARACTER))
    picture.text(0.995, -0.005, lines, ha="right", va="top", fontsize=6, color="0.4")

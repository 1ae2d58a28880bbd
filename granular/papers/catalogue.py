"""The documents by name, and the drawing of their figures."""

from __future__ import annotations

from importlib import import_module

from granular.papers.figure import Document, Drawn
from granular.papers.runs import Runs, Settings
from granular.plot.canvas import Picture
from granular.tools.checks import one_of

DOCUMENTS = ("dunatunga2015", "silo_clogging", "haeri2021", "hurley_thesis")
"""Names of the documents, which are those of modules of `granular.papers`."""


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
        Pictures, each marked in its corner with the schemes, moduli and cells that were run and the
        commit, and the numbers that they show.

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
    E = known.quick_E if chosen.size == "quick" else known.E
    runs = Runs(chosen, E, paper.E)
    drawn = known.function(runs)
    for picture in drawn.pictures.values():
        mark(picture, runs.note)
    return drawn


def mark(picture: Picture, note: str) -> None:
    """Write what made a picture into its corner."""
    picture.text(0.995, 0.005, note, ha="right", va="bottom", fontsize=6, color="0.4")

"""Parts that tests of suggestions share."""

import granular as gr
from granular import Box, Fill, Gravity, Grid, Wall
from granular.materials import glass_beads


def full_silo(**changes):
    """The silo of the paper with both halves, built by hand."""
    floor = [Wall(1, 0.0, span=(s,)) for s in ((-0.5, -0.06), (0.06, 0.5))]
    parts = {
        "name": "full silo",
        "grid": Grid((-0.5, 0.0), 0.01, (100, 104), open_sides=frozenset({"y-"})),
        "fills": (Fill(Box((-0.5, 0.0), (0.5, 1.0)), 4),),
        "material": glass_beads,
        "scheme": gr.schemes.dunatunga_kamrin_2015,
        "walls": (
            *floor,
            Wall(1, 0.0, span=((-0.06, 0.06),), opens_at=0.1),
            Wall(0, -0.5, kind="free_slip"),
            Wall(0, 0.5, kind="free_slip"),
        ),
        "gravity": Gravity(),
        "duration": 40.0,
    }
    return gr.Scene(**(parts | changes))


def item(topic, scene, *tolerance):
    """Suggestion about a topic."""
    return gr.economy.suggest(scene, *tolerance).about(topic)

"""Halves of scenes that are their own mirror images."""

import numpy as np
import pytest
from economy_scenes import full_silo, item

import granular as gr
from granular import Box, Fill, Gravity, Grid, Solid, Wall


def test_half_of_a_silo_is_the_silo_of_the_paper():
    scene = full_silo()
    suggestion = gr.economy.suggest(scene, 0.02)
    assert suggestion.about("dimension").changes == {"half": True}
    found, known = (
        gr.economy.mirror_half(scene),
        gr.scenes.silo(scheme=gr.schemes.dunatunga_kamrin_2015),
    )
    assert np.allclose(found.points().x, known.points().x)
    assert found.grid == known.grid
    assert found.parameters["half"] and set(map(repr, found.walls)) == set(map(repr, known.walls))
    assert gr.economy.apply(scene, suggestion).n_points == scene.n_points / 2
    with pytest.raises(ValueError, match="half already"):
        gr.economy.mirror_half(found)


LEFT, RIGHT = Box((-0.5, 0.0), (0.0, 1.0)), Box((0.0, 0.0), (0.5, 1.0))


@pytest.mark.parametrize(
    ("changes", "reason"),
    [
        ({"fills": (Fill(LEFT, 4), Fill(RIGHT, 4, material=gr.MuI(E=1e6)))}, "fills"),
        ({"fills": (Fill(LEFT, 4), Fill(RIGHT, 4, stagger=True))}, "fills"),
        ({"grid": Grid((-0.5, 0.0), 0.01, (101, 104))}, "no grid line"),
        ({"grid": Grid((-0.5, 0.0), 0.01, (100, 104), open_sides=frozenset({"x+"}))}, "open"),
        ({"gravity": Gravity((0.0,), ((1.0, -9.8),))}, "gravity"),
        ({"fills": (Fill(Box((-0.4, 0.0), (0.5, 1.0)), 4),)}, "fills"),
        ({"fills": (Fill(Box((-0.5, 0.0), (0.5, 1.0)), 4, velocity=(1.0, 0.0)),)}, "fills"),
        ({"walls": (Wall(0, -0.5),)}, "walls"),
        ({"walls": (Solid((-0.5, 0.0), (-0.4, 0.2)),)}, "walls"),
    ],
)
def test_what_is_no_mirror_image_is_not_halved(changes, reason):
    scene = full_silo(**changes)
    with pytest.raises(ValueError, match=reason):
        gr.economy.mirror_half(scene)
    assert not item("dimension", scene).changes


def test_what_lies_on_the_plane_of_symmetry():
    """A no-slip partition is not a plane of symmetry; a free-slip one is."""
    whole = full_silo()
    for wall in (Wall(0, 0.0), Wall(0, 0.0, kind="coulomb", friction=0.3)):
        scene = whole.replace(walls=(*whole.walls, wall))
        assert "on the plane" in item("dimension", scene).reason
    scene = whole.replace(walls=(*whole.walls, Wall(0, 0.0, kind="free_slip")))
    assert gr.economy.mirror_half(scene) == gr.economy.mirror_half(whole)
    # what ends on the plane is not cut to nothing: the middle is off zero by round-off
    grid = Grid((-0.9, 0.0), 0.3, (6, 6))
    middle = 0.5 * (grid.lower[0] + grid.upper[0])
    assert middle < 0.0
    sides = ((-0.9, 0.0), (0.0, 0.9))
    whole = full_silo(
        grid=grid,
        fills=tuple(Fill(Box((low, 0.0), (high, 0.9)), 4) for low, high in sides),
        walls=(
            *(Wall(1, 0.0, span=(side,)) for side in sides),
            *(Solid((low, 1.2), (high, 1.5)) for low, high in sides),
        ),
    )
    found = gr.economy.mirror_half(whole)
    assert len(found.fills) == 1 and len(found.walls) == 3
    assert found.n_points == whole.n_points / 2


def test_half_costs_accuracy_with_other_than_linear_functions():
    whole = full_silo(scheme=gr.schemes.default)
    found = item("dimension", whole, 0.05)
    assert found.changes and found.error > 0
    assert not item("dimension", whole, 0.01).changes
    assert item("dimension", full_silo(), 0.01).error == 0.0


def test_blocks_walls_and_bodies_on_the_plane():
    # a block is cut
    blocks = (Solid((-0.1, 0.5), (0.1, 0.6)), Solid((-0.5, 0.2), (-0.4, 0.3)))
    whole = full_silo(walls=(*blocks, Solid((0.4, 0.2), (0.5, 0.3))))
    kept = [wall for wall in gr.economy.mirror_half(whole).walls if isinstance(wall, Solid)]
    assert [block.lower[0] for block in kept] == [0.0, 0.4]
    # a wheel that rolls and a cylinder that turns have no mirror plane
    for scene in (gr.scenes.wheel(), gr.scenes.couette(cell=0.02)):
        assert item("dimension", scene).changes == {}
        with pytest.raises(ValueError, match=r"cannot be halved: bodies"):
            gr.economy.mirror_half(scene)

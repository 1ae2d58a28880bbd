"""Boundaries in one place: what they are (`granular.walls`), and what they mean to nodes."""

from granular.nodes import WallRow, creases, node_codes, node_positions
from granular.walls import Absorber, Gravity, Solid, Wall

__all__ = [
    "Absorber",
    "Gravity",
    "Solid",
    "Wall",
    "WallRow",
    "creases",
    "node_codes",
    "node_positions",
]

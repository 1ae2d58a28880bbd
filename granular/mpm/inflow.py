"""Checks of the inflows of the material point method."""

from __future__ import annotations

from typing import TYPE_CHECKING

from granular.model.fill import rest_density
from granular.model.inflow import across, standing_points
from granular.mpm.body_distances import distance_from_bodies

if TYPE_CHECKING:
    from granular.mpm.scene import Scene


def check_inflows(scene: Scene) -> None:
    """Refuse inflows that do not fit their scene, or that overlap solids or fills at the start."""
    for i, inflow in enumerate(scene.inflows):
        name = f"inflows[{i}]"
        inflow.check(
            name, scene.grid, rest_density(inflow.material or scene.material, inflow.packing)
        )
        if inflow.lithostatic and not across(scene, inflow).any():
            raise ValueError(
                f"{name}.velocity = {inflow.velocity} must not be along gravity in a lithostatic "
                "inflow, and gravity not 0 at t = 0"
            )
        if inflow.driven and scene.scheme.transfer == "xpic":
            raise ValueError(f'transfer = "xpic" must be another one, as {name} is driven')
        if inflow.points_per_axis != scene.sources[0].points_per_axis:
            raise ValueError(
                f"{name}.points_per_cell = {inflow.points_per_cell} must be "
                f"{scene.sources[0].points_per_cell}, that of the other material"
            )
        _check_free(scene, i, name)
    for servo in scene.servos if scene.inflows else ():
        raise ValueError(
            f"walls[{servo.wall}].pressure = {servo.pressure} must be None with inflows"
        )


def _check_free(scene: Scene, i: int, name: str) -> None:
    """Refuse an inlet within a block or a body, in another inlet, or a piston in a fill."""
    inflow, grid = scene.inflows[i], scene.grid
    x, half = inflow._sites(grid).x, 0.5 * grid.cell / inflow.points_per_axis
    touches = half - grid.slack * grid.cell
    for j, wall in enumerate(scene.walls):
        if wall.encloses(grid, x).any():
            raise ValueError(f"{name}.region must lie outside of walls[{j}], a Solid")
    if scene.bodies and (distance_from_bodies(scene.grid, scene.bodies)(x)[0] < touches).any():
        raise ValueError(f"{name}.region must lie outside of the bodies at their start")
    for j, other in enumerate(scene.inflows):
        if j != i and other.region.contains(x).any():
            raise ValueError(f"{name}.region must not overlap that of inflows[{j}]")
    for j, fill in enumerate(scene.fills if inflow.driven else ()):
        if fill.region.contains(standing_points(scene, i).x).any():
            raise ValueError(
                f"{name}.region must not overlap fills[{j}]: the region of a driven inflow is full "
                "at the start"
            )

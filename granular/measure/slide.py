"""Landslides: front, centre and speed over time, and the deposit."""

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from granular.measure.averaging_grid import require_points
from granular.measure.result import Result, Table, mesh_columns, mesh_units
from granular.model.state import State
from granular.model.symmetric import refuse_rings
from granular.tools.arrays import Array
from granular.tools.checks import in_range

SHARE = 0.99
"""Default share of the mass behind the front, and before the rear."""


@dataclass(frozen=True, eq=False, kw_only=True)
class SlideHistory(
    Result, times="s", front="m", rear="m", centre="m", velocity="m/s", front_speed="m/s"
):
    """A slide at several times, by its mass in the domain.

    Attributes
    ----------
    times : ndarray, shape (k,)
        Times [s].
    front, rear : ndarray, shape (k,)
        Positions x behind which, and before which, the share of the mass lies [m].
    centre : ndarray, shape (k, dim)
        Centre of mass [m].
    velocity : ndarray, shape (k, dim)
        Velocity of the centre of mass [m/s].
    front_speed : ndarray, shape (k,)
        Rate of change of `front` [m/s], by central differences.
    """

    times: Array
    front: Array
    rear: Array
    centre: Array
    velocity: Array
    front_speed: Array

    @property
    def energy_line(self) -> float:
        """Drop of the centre of mass from first to last over its horizontal distance.

        The energy of the drop is dissipated by friction. For a block with friction at its base
        alone the ratio is the friction coefficient; bends and dissipation in the material make it
        larger.
        """
        way = self.centre[-1] - self.centre[0]
        return float(-way[-1] / np.linalg.norm(way[:-1]))


@dataclass(frozen=True, eq=False, kw_only=True)
class Deposit(Result, thickness="m", area="m2; m in 2D", highest="m"):
    """Thickness of the material on the ground, over the columns of cells.

    Attributes
    ----------
    axes : tuple of ndarray
        Centres of the columns along x, and y in 3D [m].
    thickness : ndarray, shape (n_x,) or (n_x, n_y)
        Vertical thickness that the mass of a column would have at rho_c [m].
    area : float
        Area [m2; in 2D their length in m] of the columns in which the thickness is at least a
        quarter of a cell.
    highest : float
        Largest thickness [m].
    """

    axes: tuple[Array, ...]
    thickness: Array
    area: float
    highest: float

    def _table(self) -> Table:
        columns = mesh_columns(self.axes, thickness=self.thickness)
        constants = {"area": self.area, "highest": self.highest}
        return Table(columns, constants, {**mesh_units(self.axes), **self.UNITS})


def slide_history(states: Iterable[State], *, share: float = SHARE) -> SlideHistory:
    """Front, rear, centre and speed of a slide at the times of several states.

    All the material in the domain counts, also a bed at rest that the slide runs over.

    Parameters
    ----------
    states : iterable of State
        At least two, such as a record.
    share : float
        Share of the mass behind the front, and before the rear, 0.5 < share < 1.

    Raises
    ------
    TypeError, ValueError
        For a wrong share, fewer than two states or an empty one.
    """
    share = in_range("share", share, 0.5, 1.0, open_low=True, open_high=True)
    rows = []
    for state in states:
        require_points(state)
        x, mass = np.asarray(state.x), np.asarray(state.mass)
        order = np.argsort(x[:, 0], kind="stable")
        held = np.cumsum(mass[order]) - 0.5 * mass[order]
        total = float(mass.sum())
        ends = np.interp((share * total, (1.0 - share) * total), held, x[order, 0])
        means = [np.average(part, axis=0, weights=mass) for part in (x, np.asarray(state.v))]
        rows.append((state.time, *ends, *means))
    if len(rows) < 2:
        raise ValueError(f"states must be at least 2, are {len(rows)}")
    times, front, rear, centre, velocity = (np.array(part) for part in zip(*rows, strict=True))
    return SlideHistory(
        times=times,
        front=front,
        rear=rear,
        centre=centre,
        velocity=velocity,
        front_speed=np.gradient(front, times),
    )


def deposit(state: State) -> Deposit:
    """Thickness of the material over the columns of cells, whatever solid it lies on.

    All the material in the domain counts, also a bed that was there before the slide.

    Raises
    ------
    ValueError
        If the state is empty.
    """
    refuse_rings(state.scene, "deposit")
    require_points(state)
    grid = state.scene.grid
    levels = range(grid.dim - 1)
    edges = [grid.lower[k] + grid.cell * np.arange(grid.shape[k] + 1) for k in levels]
    x = np.asarray(state.x)[:, : grid.dim - 1]
    solid, _ = np.histogramdd(x, bins=edges, weights=np.asarray(state.rest_section))
    column = grid.cell ** (grid.dim - 1)
    thickness = solid / column
    return Deposit(
        axes=tuple(0.5 * (edge[:-1] + edge[1:]) for edge in edges),
        thickness=thickness,
        area=float(np.count_nonzero(thickness >= grid.cell / 4) * column),
        highest=float(thickness.max()),
    )

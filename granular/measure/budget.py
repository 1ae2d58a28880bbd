"""Energy budget of one step: work done on the grid, and energy lost in each transfer."""

from dataclasses import dataclass
from functools import lru_cache
from typing import TYPE_CHECKING

import numpy as np

from granular.measure.energy import elastic_of, kinetic_of, plastic_power
from granular.measure.result import ENERGY, Result
from granular.model.symmetric import refuse_rings
from granular.mpm.axis_nodes import c0_lines, node_positions
from granular.mpm.grid_map import GridMap
from granular.mpm.node_codes import node_codes
from granular.tools.arrays import Array, BoolArray

if TYPE_CHECKING:
    from granular.mpm.scene import Scene
    from granular.mpm.simulation import Simulation


@dataclass(frozen=True, kw_only=True)
class StepBudget(
    Result,
    time="s",
    dt="s",
    kinetic_before=ENERGY,
    kinetic_after=ENERGY,
    grid_kinetic_before=ENERGY,
    grid_kinetic_after=ENERGY,
    p2g_loss=ENERGY,
    g2p_loss=ENERGY,
    internal_work=ENERGY,
    external_work=ENERGY,
    wall_work=ENERGY,
    grid_residual=ENERGY,
    elastic_before=ENERGY,
    elastic_after=ENERGY,
    plastic_dissipation=ENERGY,
    disconnection_loss=ENERGY,
    kinetic_outflow=ENERGY,
    elastic_outflow=ENERGY,
    strain_residual=ENERGY,
):
    """Energy budget of one step [J; in 2D per metre of depth].

    Two identities follow from the scheme; this table does not enforce them. Their residuals show
    how well they hold. The residual of the grid is round-off, except for the work of bodies, which
    is not among the terms. The residual of the strain is the error of the time integration and,
    with an averaged density, the effect of the averaging on the elastic energy::

        change of grid kinetic energy = internal + external + wall work + grid_residual
        change of elastic energy = -internal work - plastic_dissipation - disconnection_loss
                                   - elastic_outflow - strain_residual

    Attributes
    ----------
    time, dt : float
        Time at the beginning of the step and its length [s].
    kinetic_before, kinetic_after : float
        Kinetic energy of the points, sum m v.v/2.
    grid_kinetic_before, grid_kinetic_after : float
        Kinetic energy of the nodes, before and after the forces are applied.
    p2g_loss, g2p_loss : float
        Kinetic energy lost in the transfer from points to grid (P2G) and from grid to points
        (G2P); the latter includes the loss to a sponge layer. The affine motion of "apic" and
        "tpic" is not counted as energy of the points, so that p2g_loss may be negative there.
    internal_work, external_work : float
        Work on the grid of the stresses (with the shift momentum correction) and of gravity:
        force times the mean of the velocities before and after.
    wall_work : float
        Work of the impulses at the nodes of walls and blocks.
    grid_residual : float
        Residual of the identity of the grid.
    elastic_before, elastic_after : float
        Elastic energy stored in the points, sum V (s:s/(4 G) + p**2/(2 K)).
    plastic_dissipation : float
        sum V tau gdot dt at the end of the step.
    disconnection_loss : float
        Elastic energy lost by points that became stress-free.
    kinetic_outflow, elastic_outflow : float
        Energy at the beginning of the step of the points that left the domain during it.
    strain_residual : float
        Residual of the identity of the strain.
    """

    time: float
    dt: float
    kinetic_before: float
    kinetic_after: float
    grid_kinetic_before: float
    grid_kinetic_after: float
    p2g_loss: float
    g2p_loss: float
    internal_work: float
    external_work: float
    wall_work: float
    grid_residual: float
    elastic_before: float
    elastic_after: float
    plastic_dissipation: float
    disconnection_loss: float
    kinetic_outflow: float
    elastic_outflow: float
    strain_residual: float


@lru_cache(maxsize=4)
def _codes(scene: "Scene") -> tuple[list[Array], GridMap]:
    """Node positions along each axis [cells], and the codes of the nodes, 0 off the walls."""
    grid = scene.grid
    positions = [
        node_positions(scene.scheme.basis, n, periodic, c0_lines(grid, scene.walls, axis))
        for axis, (n, periodic) in enumerate(zip(grid.shape, grid.periodic, strict=True))
    ]
    return positions, node_codes(scene)[0]


def _at_walls(scene: "Scene", x: Array) -> BoolArray:
    """Mask of the nodes at `x`, shape (n, dim), on which a wall may act."""
    positions, codes = _codes(scene)
    nearest = []
    for axis, along in enumerate(positions):
        cells = (x[:, axis] - scene.grid.lower[axis]) / scene.grid.cell
        place = np.clip(np.searchsorted(along, cells), 1, max(len(along) - 1, 1))
        if len(along) == 1:
            place = np.zeros(len(x), dtype=np.int64)
        else:
            place -= cells - along[place - 1] < along[place] - cells
        nearest.append(place)
    return codes.at(nearest) > 0


def _half_square(a: Array, b: Array) -> float:
    """``sum a.b/2`` over nodes and components."""
    return float(np.einsum("ij,ij->", a, b) / 2)


def step_budget(sim: "Simulation") -> StepBudget:
    """Make one step of a simulation and account for its energy.

    The result equals that of `Simulation.step(1)` to the last bit, but the stages are run one by
    one. This is slower and meant for studying a scheme, not for long runs.

    Parameters
    ----------
    sim : Simulation
        It is advanced by one step.

    Raises
    ------
    ValueError
        If the scene has inflows, whose energy it does not account for.
    SimulationError
        As `Simulation.step`.
    """
    refuse_rings(sim.scene, "the budget of a step")
    engine, scene, before = sim._engine, sim.scene, sim.state
    if scene.inflows:
        raise ValueError(
            f"scene {scene.name!r} must have no inflows: their energy is no part of it"
        )
    engine.p2g()
    sums = engine.nodes()
    engine.grid()
    nodes, dt = engine.nodes(), engine.scalars()["dt"]
    if scene.scheme.density.name == "smoothed":  # with another dt the sums are made again
        sums = nodes
    sim._grow(engine.g2p())
    after = sim.state

    used = sums["mass"] > scene.scheme.mass_cutoff * sim._mean_mass
    m, force = sums["mass"][used, None], sums["force"][used]
    old, new = sums["momentum"][used] / m, nodes["v"][used]
    gravity = m * scene.gravity.at(before.time)
    impulse = m * (new - old) - dt * (force + gravity)
    ruled = _at_walls(scene, sums["x"][used])[:, None]
    internal = dt * _half_square(old + new, force)
    external = dt * _half_square(old + new, gravity)
    wall = _half_square(old + new, np.where(ruled, impulse, 0.0))
    grid = [_half_square(m * old, old), _half_square(m * new, new)]

    kinetic, elastic = kinetic_of(before), elastic_of(before)
    _, stay, _ = np.intersect1d(before.id, after.id, assume_unique=True, return_indices=True)
    left = np.ones(before.n, dtype=bool)
    left[stay] = False
    dropped = elastic[stay][~after.stress.any(axis=1)].sum()
    plastic = plastic_power(after) * dt
    elastic_after, outflow = elastic_of(after).sum(), elastic[left].sum()
    return StepBudget(
        time=before.time,
        dt=dt,
        kinetic_before=float(kinetic.sum()),
        kinetic_after=float(kinetic_of(after).sum()),
        grid_kinetic_before=grid[0],
        grid_kinetic_after=grid[1],
        p2g_loss=float(kinetic.sum()) - grid[0],
        g2p_loss=grid[1] - float(kinetic_of(after).sum()) - float(kinetic[left].sum()),
        internal_work=internal,
        external_work=external,
        wall_work=wall,
        grid_residual=grid[1] - grid[0] - internal - external - wall,
        elastic_before=float(elastic.sum()),
        elastic_after=float(elastic_after),
        plastic_dissipation=plastic,
        disconnection_loss=float(dropped),
        kinetic_outflow=float(kinetic[left].sum()),
        elastic_outflow=float(outflow),
        strain_residual=float(elastic.sum() - elastic_after - internal - plastic - dropped)
        - float(outflow),
    )

"""The energy of one step, line by line: what the grid did, and what each transfer lost."""

from dataclasses import dataclass
from functools import lru_cache
from typing import TYPE_CHECKING

import numpy as np

from granular.measure.averaging_grid import Array
from granular.measure.energy import elastic_of, kinetic_of, plastic_power
from granular.mpm.node_codes import c0_lines, node_codes, node_positions

if TYPE_CHECKING:
    from granular.mpm.scene import Scene
    from granular.simulation import Simulation

__all__ = ["StepBudget", "step_budget"]


@dataclass(frozen=True, kw_only=True)
class StepBudget:
    """Energy budget of one step [J, per metre of depth in the plane].

    Two identities hold by construction of the scheme, not of this table; their residuals say how
    well: that of the grid is round-off, that of the strain is the error of the time integration.

        change of grid kinetic energy = internal + external + wall work + grid_residual
        change of elastic energy = -internal work - plastic_dissipation - disconnection_loss
                                   - elastic_outflow - strain_residual

    Attributes
    ----------
    time, dt : float
        Begin and length of the step [s].
    kinetic_before, kinetic_after : float
        Of the points, sum m v.v/2.
    grid_kinetic_before, grid_kinetic_after : float
        Of the nodes, before and after the forces.
    p2g_loss, g2p_loss : float
        What the points had and the grid did not get, and what the grid had and the points did
        not get, or lost to an sponge. The affine motion of "apic" and "tpic" is not counted as
        energy of the points, so a p2g_loss may be negative there.
    internal_work, external_work : float
        Of the stresses (and of the momentum that a shift had lent) and of gravity on the grid,
        force times the mean of the velocities before and after.
    wall_work : float
        Of the impulses at the nodes of walls and blocks.
    grid_residual : float
        What is left of the identity of the grid.
    elastic_before, elastic_after : float
        Stored in the points, sum V (s:s/(4 G) + p**2/(2 K)).
    plastic_dissipation : float
        sum V tau gdot dt at the end of the step.
    disconnection_loss : float
        Elastic energy that points had and dropped when they became stress-free.
    kinetic_outflow, elastic_outflow : float
        Energy of points that left the domain, as of the begin of the step.
    strain_residual : float
        What is left of the identity of the strain.
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
def _ruled_nodes(scene: "Scene") -> tuple[list[Array], Array]:
    """Node positions along each axis [cells], and which nodes a wall may rule, flat, x fastest."""
    grid = scene.grid
    positions = [
        node_positions(scene.scheme.basis, n, periodic, c0_lines(grid, scene.walls, axis))
        for axis, (n, periodic) in enumerate(zip(grid.shape, grid.periodic, strict=True))
    ]
    return positions, node_codes(scene)[0].ravel() > 0


def _at_walls(scene: "Scene", x: Array) -> Array:
    """Which of the nodes at `x` (n, dim) are nodes of walls."""
    positions, ruled = _ruled_nodes(scene)
    number, stride = np.zeros(len(x), dtype=np.int64), 1
    for axis, along in enumerate(positions):
        cells = (x[:, axis] - scene.grid.lower[axis]) / scene.grid.cell
        place = np.clip(np.searchsorted(along, cells), 1, max(len(along) - 1, 1))
        if len(along) == 1:
            place = np.zeros(len(x), dtype=np.int64)
        else:
            place -= cells - along[place - 1] < along[place] - cells
        number += stride * place
        stride *= len(along)
    return ruled[number]


def _half_square(a: Array, b: Array) -> float:
    """sum a.b/2 over nodes and components."""
    return float(np.einsum("ij,ij->", a, b) / 2)


def step_budget(sim: "Simulation") -> StepBudget:
    """Make one step of a simulation and account for its energy.

    The step is that of `Simulation.step(1)` to the last bit, made stage by stage; it is slower, and
    meant for looking into a scheme, not for long runs.

    Parameters
    ----------
    sim : Simulation
        Is one step further on afterwards.

    Returns
    -------
    StepBudget

    Raises
    ------
    SimulationError
        As `Simulation.step`.
    """
    engine, scene, before = sim._engine, sim.scene, sim.state
    engine.p2g()
    sums = engine.nodes()
    engine.grid()
    nodes, dt = engine.nodes(), engine.scalars()["dt"]
    if (
        scene.scheme.density.name == "smoothed"
    ):  # where dt has changed the sums were made anew for it
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

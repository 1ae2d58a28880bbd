"""Tools in soil: forces on a tool, sinkage of a wheel, failure surface in front of a blade."""

from dataclasses import dataclass
from typing import cast

import numpy as np

from granular.materials import Material
from granular.measure.averaging_grid import only_material, require_points
from granular.measure.body import BodyMotion, body_force, body_motion
from granular.measure.opening import each_state
from granular.measure.result import FORCE, TORQUE, Result
from granular.model.state import States
from granular.record.reader import Trajectory
from granular.tools.arrays import Array
from granular.tools.checks import finite, in_range, positive


@dataclass(frozen=True, eq=False, kw_only=True)
class ToolForce(Result, times="s", position="m", forward="N", lateral="N", vertical="N"):
    """Force on a tool that moves along x, averaged between frames.

    Attributes
    ----------
    times : ndarray, shape (k,)
        Middles of the averaging windows [s].
    position : ndarray, shape (k, 3)
        Position of the body at these times [m].
    forward : ndarray, shape (k,)
        Force needed to push the tool: minus the force of the material along x [N].
    lateral, vertical : ndarray, shape (k,)
        Force of the material along y and z [N]; zero along y for the whole of a tool that a plane
        of symmetry cuts.
    """

    times: Array
    position: Array
    forward: Array
    lateral: Array
    vertical: Array


@dataclass(frozen=True, eq=False, kw_only=True)
class WheelHistory(Result, times="s", drawbar_pull=FORCE, load=FORCE, torque=TORQUE, sinkage="m"):
    """Motion of a wheel and the forces on it, averaged between frames.

    Attributes
    ----------
    times : ndarray, shape (k,)
        Middles of the averaging windows [s].
    drawbar_pull : ndarray, shape (k,)
        Force of the material along x, with which the wheel could pull a load [N; in 2D per metre
        of width, as the load and the torque].
    load : ndarray, shape (k,)
        Upward force of the material [N]; it equals the load on the axle while the wheel neither
        rises nor sinks.
    torque : ndarray, shape (k,)
        Torque that drives the wheel towards larger x [N m].
    sinkage : ndarray, shape (k,)
        Depth of the lowest line of the wheel below its initial position [m].
    """

    times: Array
    drawbar_pull: Array
    load: Array
    torque: Array
    sinkage: Array


@dataclass(frozen=True, eq=False, kw_only=True)
class FailureSurface(Result, x="m", z="m", top="m", speed="m/s"):
    """Lower boundary of the moving material, column by column; nan where no cell moves.

    Attributes
    ----------
    x : ndarray, shape (k,)
        Middles of the columns [m].
    z : ndarray, shape (k,)
        Lower end of the lowest moving cell that moving cells connect to the surface [m].
    top : ndarray, shape (k,)
        Upper end of the highest cell with material [m]; nan in empty columns.
    speed : float
        Speed from which a cell counts as moving [m/s].
    """

    x: Array
    z: Array
    top: Array
    speed: float


@dataclass(frozen=True, eq=False)
class StrainHistory(Result, times="s"):
    """Mass-weighted elastic strain of the dense material over time.

    Attributes
    ----------
    times : ndarray, shape (k,)
        Times of the frames [s].
    volumetric : ndarray, shape (k,)
        Mean compression ln(rho/rho_c).
    deviatoric : ndarray, shape (k,)
        Mean norm sqrt(h:h) of the deviator of the logarithmic strain.
    norm, deviation : ndarray, shape (k,)
        Mean norm of the full strain, and the standard deviation of that norm.
    """

    times: Array
    volumetric: Array
    deviatoric: Array
    norm: Array
    deviation: Array


def tool_force(
    record: Trajectory, body: int = 0, *, window: int = 1, total: bool = True
) -> ToolForce:
    """Forward, lateral and vertical force on a tool (Haeri & Skonieczny 2021, figure 13).

    Parameters
    ----------
    record : Trajectory
        Record of a 3D scene.
    body, window, total
        As in `granular.measure.body_force`: by default the force on the whole tool, also where a
        plane of symmetry cuts it in half.

    Raises
    ------
    ValueError
        As `body_force`; also if the scene is 2D.
    """
    if record.scene.dim != 3:
        raise ValueError(f"record = {record!r} must be a record of a 3D scene")
    felt = body_force(record, body, window=window, total=total)
    return ToolForce(
        times=felt.times,
        position=_at(felt.times, body_motion(record, body)),
        forward=-felt.force[:, 0],
        lateral=felt.force[:, 1],
        vertical=felt.force[:, 2],
    )


def wheel_history(
    record: Trajectory, body: int = 0, *, window: int = 1, total: bool = True
) -> WheelHistory:
    """Drawbar pull, load and sinkage of a wheel (Haeri & Skonieczny 2021, figure 18).

    Parameters
    ----------
    record : Trajectory
        Record of a scene with a wheel that rolls along x; in 3D its axle is along y.
    body, window, total
        As in `granular.measure.body_force`: by default the forces on the whole wheel.

    Raises
    ------
    ValueError
        As `body_force`.
    """
    felt = body_force(record, body, window=window, total=total)
    motion = body_motion(record, body)
    # A wheel that rolls towards larger x turns about -z in 2D, but about +y in 3D.
    return WheelHistory(
        times=felt.times,
        drawbar_pull=felt.force[:, 0],
        load=felt.force[:, -1],
        torque=felt.torque if record.scene.dim == 2 else -felt.torque[:, 1],
        sinkage=motion.position[0, -1] - _at(felt.times, motion)[:, -1],
    )


def failure_surface(
    states: States, *, speed: float, share: float = 0.1, span: tuple[float, float] | None = None
) -> FailureSurface:
    """Surface between the soil that moves with a blade and the soil at rest.

    Haeri & Skonieczny 2021 show it in figure 14.

    The cells of a slice along x and z count as moving if their speed is at least a share of that of
    the blade. The speed of a cell is the mass-weighted mean over all frames and over y.

    Parameters
    ----------
    states : State or iterable of State
        In 3D.
    speed : float
        Speed of the blade [m/s], > 0.
    share : float
        Share of the blade's speed from which a cell moves, 0 to 1, ends excluded.
    span : (low, high), optional
        Ends of the slice along y [m]; by default the whole width.

    Raises
    ------
    TypeError, ValueError
        If the states are 2D, a state has no points, no point is in the slice, or `speed` or `share`
        is out of range.
    """
    limit = positive("speed", speed) * in_range(
        "share", share, 0.0, 1.0, open_low=True, open_high=True
    )
    states = list(each_state(states))
    grid = states[0].scene.grid
    if len(grid.shape) != 3:
        raise ValueError(f"states have {len(grid.shape)} dimensions, must have 3")
    low, high = (-np.inf, np.inf) if span is None else (finite("span", v) for v in span)
    shape = (grid.shape[0], grid.shape[2])
    mass, flow = np.zeros(shape), np.zeros(shape)
    for state in states:
        require_points(state)
        x = np.asarray(state.x, dtype=float)
        keep = (x[:, 1] >= low) & (x[:, 1] < high)
        cell = np.floor((x[keep] - grid.lower) / grid.cell).astype(int)
        place = tuple(np.clip(cell[:, axis], 0, grid.shape[axis] - 1) for axis in (0, 2))
        m = np.asarray(state.mass, dtype=float)[keep]
        np.add.at(mass, place, m)
        np.add.at(flow, place, m * np.linalg.norm(state.v[keep], axis=1))
    if not mass.any():
        raise ValueError(f"no point in span = {span}")
    filled = mass > 0
    moving = filled & (flow >= limit * mass)
    highest = shape[1] - 1 - np.argmax(filled[:, ::-1], axis=1)
    lowest = np.full(shape[0], -1)
    for column in np.flatnonzero(filled.any(axis=1)):
        below = np.flatnonzero(~moving[column, : highest[column] + 1])
        lowest[column] = below[-1] + 1 if len(below) else 0
    base = grid.lower[2]
    exists = filled.any(axis=1) & (lowest <= highest)
    return FailureSurface(
        x=grid.lower[0] + grid.cell * (np.arange(shape[0], dtype=float) + 0.5),
        z=np.where(exists, base + grid.cell * lowest, np.nan),
        top=np.where(filled.any(axis=1), base + grid.cell * (highest + 1), np.nan),
        speed=limit,
    )


def strain_history(states: States) -> StrainHistory:
    """Elastic strain of Hencky materials (Haeri & Skonieczny 2021, figure 6).

    The strain follows from the stored stress and density: the Kirchhoff stress is rho_c/rho times
    the stress, and its deviator is 2 G h. Plastic flow preserves the volume in each step, so that
    det F^p of figure 7 is 1 to round-off and needs no history. `granular.measure.density_drift`
    measures how far the density of the points is from the volume that they occupy.

    Parameters
    ----------
    states : State, iterable of State, or Trajectory

    Returns
    -------
    StrainHistory
        nan at frames where no point is dense.

    Raises
    ------
    ValueError
        If the elasticity of the material is not "hencky", or the scene has several materials.
    """
    rows = []
    for state in each_state(states):
        material = cast(Material, only_material(state))
        if material.elasticity != "hencky":
            raise ValueError(f'elasticity = {material.elasticity!r} must be "hencky"')
        dense = state.dense
        if not dense.any():
            rows.append([state.time, *[np.nan] * 4])
            continue
        compression = state.log_density[dense]
        kirchhoff = state.shear_stress[dense] * np.exp(-compression)
        deviatoric = kirchhoff / (np.sqrt(2) * material.G)
        norm = np.hypot(deviatoric, compression / np.sqrt(3))
        m = state.mass[dense]
        mean = np.average(norm, weights=m)
        rows.append(
            [
                state.time,
                np.average(compression, weights=m),
                np.average(deviatoric, weights=m),
                mean,
                np.sqrt(np.average((norm - mean) ** 2, weights=m)),
            ]
        )
    return StrainHistory(*np.array(rows).T)


def _at(times: Array, motion: BodyMotion) -> Array:
    """Position of the body at `times`, interpolated linearly between frames."""
    return np.stack([np.interp(times, motion.times, x) for x in motion.position.T], axis=1)

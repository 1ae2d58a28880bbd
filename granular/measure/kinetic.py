"""Errors of the stress-free gas and of the constant density, estimated after the run.

Dunatunga & Kamrin 2015, appendix A; the closed forms are in `granular.theory.kinetic`.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import product
from typing import Any, cast

import numpy as np
from numpy.typing import ArrayLike

from granular.materials import MuI
from granular.measure.averaging_grid import (
    cell_mass,
    filled_neighbours,
    node_shape,
    only_material,
    require_points,
    values,
)
from granular.measure.fields import nodal
from granular.measure.profiles import grain_diameter, inertial_number
from granular.measure.result import Result
from granular.model.state import State
from granular.model.symmetric import refuse_rings
from granular.tools.arrays import Array, IntArray
from granular.tools.checks import in_range, positive


def packing_fraction(state: State, *, restitution: float, d: float | None = None) -> Array:
    """Packing fraction Phi(I) that steady shear would have (A9).

    Parameters
    ----------
    restitution : float
        Effective coefficient of restitution, in [0, 1].

    Returns
    -------
    ndarray, shape (n,)
        At stress-free points, where I has no meaning, the point's own ``rho/rho_s``.

    Raises
    ------
    TypeError, ValueError
        If the state is empty, the grain diameter is unknown, the restitution is out of range, or
        the scene has several materials.
    """
    from granular.theory.kinetic import packing_fraction_of_inertial_number

    number = inertial_number(state, d=d)
    pressed = np.isfinite(number)
    phi = np.asarray(state.density, dtype=float) / cast(MuI, only_material(state)).rho_s
    steady = packing_fraction_of_inertial_number(np.where(pressed, number, 0.0), restitution)
    return np.where(pressed, steady, phi)


@dataclass(frozen=True)
class StressFreeError(Result, rate="1/s", reference="Pa"):
    """Neglected pressures of material below rho_c, which the law takes as stress-free.

    All are divided by a reference pressure.

    Attributes
    ----------
    shear : float
        Pressure in steady shear (A10), at the margin below jamming.
    volumetric : float
        Bound on the pressure in steady compression (A22, A23), at the same margin.
    coupled_shear : float
        Pressure in steady shear at rho_c itself, where the stiffness of the grains keeps it finite
        (A11, A12).
    rate : float
        Strain rate assumed [1/s].
    reference : float
        Reference pressure [Pa].
    """

    shear: float
    volumetric: float
    coupled_shear: float
    rate: float
    reference: float


def stress_free_error(
    state: State,
    *,
    restitution: float,
    d: float | None = None,
    rate: float | None = None,
    reference: float | None = None,
    margin: float = 0.01,
) -> StressFreeError:
    """Estimate the neglected pressure of material below rho_c; values much less than 1 are good.

    The gas pressures diverge at the packing fraction 0.6, which is identified with that of rho_c
    (the packing fraction of the flow is shifted by ``0.6 - rho_c/rho_s``). They are therefore
    evaluated a margin below it.

    Parameters
    ----------
    restitution : float
        Effective coefficient of restitution, in [0, 1); for elastic grains there is no bound.
    rate : float, optional
        Strain rate [1/s]; by default the conservative ``u_c/d`` with the largest speed u_c.
    reference : float, optional
        Characteristic pressure [Pa]; by default the mean of the dense points, by mass.
    margin : float
        Distance from 0.6 of the packing fraction at which the gas pressures are evaluated, 0 to
        0.6, ends excluded.

    Raises
    ------
    TypeError, ValueError
        If the state is empty, the grain diameter is unknown, no point is dense and no reference
        is given, a number is out of range, or the scene has several materials.
    """
    from granular.theory.kinetic import JAMMED, compression_pressure, coupled_shear, shear_pressure

    require_points(state)
    in_range("margin", margin, 0.0, JAMMED, open_low=True, open_high=True)
    material = cast(MuI, only_material(state))
    size = grain_diameter(state, d)
    if rate is None:
        rate = float(np.linalg.norm(state.v, axis=1).max()) / size
    scale = _mean_pressure(state) if reference is None else positive("reference", reference)
    grains: dict[str, Any] = {"diameter": size, "restitution": restitution, "material": material}
    critical = material.rho_c / material.rho_s
    coupled = coupled_shear(critical, rate, offset=JAMMED - critical, **grains)
    return StressFreeError(
        shear=float(shear_pressure(JAMMED - margin, rate, **grains)) / scale,
        volumetric=float(compression_pressure(JAMMED - margin, rate, **grains)) / scale,
        coupled_shear=coupled.p / scale,
        rate=rate,
        reference=scale,
    )


def _mean_pressure(state: State) -> float:
    p, mass = np.asarray(state.pressure, dtype=float), np.asarray(state.mass, dtype=float)
    dense = p > 0
    if not dense.any():
        raise ValueError("reference = None: no point is dense, give a pressure in Pa")
    return float(np.average(p[dense], weights=mass[dense]))


@dataclass(frozen=True)
class MassBalance(Result, residual="kg/(m3 s)"):
    """Residual of steady mass conservation on the grid's cells.

    Attributes
    ----------
    cells : ndarray of int, shape (k, dim)
        Cells whose nodes are surrounded by filled cells.
    residual : ndarray, shape (k,)
        ``v . grad rho + rho div v`` [kg/(m3 s)] at their centres.
    relative : float
        Root mean square of `residual` divided by that of ``rho |grad v|``; 0 if nothing is sheared.
    """

    cells: IntArray
    residual: Array
    relative: float


def mass_balance_error(
    state: State,
    *,
    restitution: float | None = None,
    d: float | None = None,
    density: str | ArrayLike | None = None,
) -> MassBalance:
    """Error of mass conservation of the density Phi(I) in the computed flow (A25).

    Density and velocity are averaged at the nodes and differentiated in the cells. Cells at walls
    and free surfaces are left out, because nodal means are one-sided there.

    Parameters
    ----------
    state : State
        A state of steady flow, because (A25) has no rate of change.
    restitution : float, optional
        Effective coefficient of restitution in [0, 1], for `packing_fraction`.
    density : str or array_like, shape (n,), optional
        Density [kg/m3] to be examined instead of ``rho_s Phi(I)``.

    Raises
    ------
    TypeError, ValueError
        If the state is empty, neither restitution nor density is given, or no cell is surrounded
        by filled cells; without a `density` also as `packing_fraction`.
    """
    refuse_rings(state.scene, "mass_balance_error")
    if density is None:
        if restitution is None:
            raise ValueError("restitution = None: give it, or a density to be examined")
        phi = packing_fraction(state, restitution=restitution, d=d)
        density = cast(MuI, only_material(state)).rho_s * phi
    rho = nodal(state, values(state, density))
    velocity = nodal(state, "v")
    cells, corners = _surrounded(state)
    dim = cells.shape[1]
    # Gradients of the multilinear shape functions at the middle of a cell.
    slope = (
        np.array(list(product((-1.0, 1.0), repeat=dim))) * 2 ** (1 - dim) / state.scene.grid.cell
    )
    rho_mid, v_mid = rho[corners].mean(axis=0), velocity[corners].mean(axis=0)
    grad_rho = np.einsum("cj,ck->kj", slope, rho[corners])
    grad_v = np.einsum("cj,cki->kij", slope, velocity[corners])
    residual = np.sum(v_mid * grad_rho, axis=1) + rho_mid * np.trace(grad_v, axis1=1, axis2=2)
    scale = np.sqrt(np.mean(rho_mid**2 * np.sum(grad_v**2, axis=(1, 2))))
    rms = np.sqrt(np.mean(residual**2))
    return MassBalance(cells, residual, float(rms / scale) if scale > 0 else 0.0)


def _surrounded(state: State) -> tuple[IntArray, IntArray]:
    """Cells whose nodes have filled cells only around them, and their nodes, shape (2**dim, k)."""
    grid = state.scene.grid
    filled = cell_mass(state) > 0
    nodes = node_shape(grid)
    full = (filled_neighbours(filled, grid) == 2**filled.ndim).ravel()
    cells = np.argwhere(filled)
    corners = np.array(
        [
            np.ravel_multi_index(tuple(((cells + corner) % nodes).T), nodes)
            for corner in product((0, 1), repeat=filled.ndim)
        ]
    )
    keep = full[corners].all(axis=0)
    if not keep.any():
        raise ValueError("no cell is surrounded by filled cells, a balance needs at least 1")
    return cells[keep], corners[:, keep]

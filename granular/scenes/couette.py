"""Flow between two upright cylinders, the inner of which turns."""

from __future__ import annotations

import math
from typing import Any

from granular.materials import Material, couette_beads
from granular.model.fill import Fill
from granular.model.gravity import Gravity
from granular.model.grid import Grid
from granular.mpm.bodies import Body
from granular.mpm.motion import Motion
from granular.mpm.schemes import Scheme
from granular.mpm.walls import Wall
from granular.scenes._build import (
    HEADROOM,
    Parts,
    enough_cells,
    gravity_down,
    reconnected,
    whole_cells,
)
from granular.scenes._registry import scene_function
from granular.shapes import Cylinder, Region, Sphere
from granular.tools.checks import finite, in_range, positive

MARGIN = 3
"""Cells between the outer cylinder and the ends of the grid, as splines extend over two nodes."""

soft_beads = couette_beads.replace(E=couette_beads.E / 100)


@scene_function("mpm")
def couette(
    *,
    inner: float = 0.0999,
    outer: float = 0.2001,
    height: float = 0.1,
    omega: float = 0.025,
    pressure: float | None = None,
    rough: bool = False,
    cell: float = 0.004,
    points_per_cell: int | None = None,
    jitter: float = 0.0,
    gravity: float = 9.81,
    duration: float = 22.0,
    material: Material = soft_beads,
    scheme: Scheme = reconnected,
    seed: int = 0,
    **material_numbers: Any,
) -> Parts:
    """Taylor-Couette cell (Haeri & Skonieczny 2021, section 4.1, figures 9 and 10).

    From the paper: B = 10 MPa, S = 1 MPa, the beads of its table 1, cells of 4 mm, 22 s; the inner
    cylinder turns, the outer one rests, and the top surface is observed. From the scripts of the
    paper: the radii, a height of 0.1 m, 0.025 rad/s, cylinders that material sticks to, a
    free_slip floor, gravity down. The experiment's outer radius was about 195 mm.

    Chosen here: S and B are a hundred times smaller, so that the time steps are ten times longer.
    Then p/B is 1.6 % at the bottom, which is denser by as much; a slow flow does not depend on
    either modulus. There are 8 points per cell, as the paper's 4 are not a cube. The paper's steps
    of 1e-4 s are twice as long as elastic waves allow at 10 MPa. The fill begins with equal
    stresses in all directions, those of steady shear: beads that settle first hang on the cylinders
    in part, and the moment on these is smaller by a tenth.

    Unless `rough` is true, the cylinders do not affect the fluidity: compare with
    `granular.theory.couette_quasi_static` and ``walls="smooth"``. The remaining error is described
    in the documentation, page "Three dimensions".

    With a `pressure` the flow is 2D: a slice without gravity that is everywhere under that pressure
    at the start. This is the case that the theory solves. The ring is closed on every side, and
    its pressure falls as points creep into the cylinders. A simulation warns about this, and only
    the beginning of a run is of use. In 3D the free surface keeps the pressure.

    Parameters
    ----------
    inner, outer : float
        Radii [m].
    height : float
        Height of the fill [m], whole cells; unused in 2D.
    omega : float
        Angular velocity of the inner cylinder [rad/s].
    pressure : float or None
        Initial pressure of the 2D flow [Pa]; None for 3D.
    rough : bool
        If true, the fluidity is 0 at the cylinders; otherwise the cylinders do not affect it.
    gravity : float
        Magnitude [m/s2], constant from the start; unused in 2D.
    {common}; also if the gap has less than 4 cells.
    """
    cell, inner, outer = positive("cell", cell), positive("inner", inner), positive("outer", outer)
    n_z = whole_cells("height", height, cell)
    positive("gravity", gravity)
    if outer - inner < 4 * cell:
        raise ValueError(f"outer = {outer} must exceed inner = {inner} by 4 cells of {cell}")
    n = enough_cells(outer, cell) + MARGIN
    flat = pressure is not None
    dim = 2 if flat else 3
    count = 2**dim if points_per_cell is None else points_per_cell
    fill: dict[str, Any] = {"points_per_cell": count, "jitter": jitter}
    if flat:
        grid = Grid((-n * cell,) * 2, cell, (2 * n,) * 2)
        around: Region = Sphere(outer + cell, center=(0.0, 0.0))  # the cylinders cut the fill
        if not isinstance(material, Material):
            raise TypeError(f"material = {material!r} must be a Material")
        # p = K ln(rho/rho_c)
        fill["density"] = material.rho_c * math.exp(
            in_range("pressure", pressure, 0.0, material.K, open_low=True) / material.K
        )
    else:
        grid = Grid((-n * cell, -n * cell, 0.0), cell, (2 * n, 2 * n, n_z + HEADROOM))
        around = Cylinder(
            outer + cell,
            center=(0.0, 0.0, 0.5 * n_z * cell),
            axis=(0.0, 0.0, 1.0),
            length=n_z * cell,
        )
        fill |= {"lithostatic": True, "K0": 1.0}
    return Parts(
        grid=grid,
        fills=(Fill(around, **fill),),
        walls=() if flat else (Wall(2, 0.0, kind="free_slip"),),
        bodies=(
            _cylinder(inner, dim, finite("omega", omega), rough=rough),
            _cylinder(outer, dim, 0.0, rough=rough, inside=True),
        ),
        gravity=Gravity((0.0,), ((0.0, 0.0),)) if flat else gravity_down(3, gravity),
    )


def _cylinder(radius: float, dim: int, omega: float, *, rough: bool, inside: bool = False) -> Body:
    """An upright sticky cylinder about the origin."""
    axis, origin = (None, (0.0, 0.0, 1.0))[dim - 2], (0.0,) * dim
    turning: Any = omega if dim == 2 else (0.0, 0.0, omega)
    return Body(
        Cylinder(radius, center=origin, axis=axis, inside=inside),
        origin,
        motion=Motion(angular_velocity=(turning,)),
        contact="sticky",
        rough=rough,
    )

"""A layer on a periodic rough incline, with the local law in 2D or 3D and with the nonlocal one."""

from __future__ import annotations

from typing import Any

from granular.materials import NGF, Material, glass_beads
from granular.mpm import schemes
from granular.mpm.schemes import ParticleDensity, Scheme
from granular.mpm.walls import Wall
from granular.scenes._build import Parts, block, down_slope, level_cells, ramped, whole_cells
from granular.scenes._registry import scene_function
from granular.tools.checks import integer, positive


@scene_function("mpm")
def incline(
    *,
    angle_deg: float = 25.0,
    height: float = 0.2,
    cell: float = 0.005,
    columns: int = 1,
    columns_across: int = 0,
    points_per_cell: int = 4,
    jitter: float = 0.0,
    headroom: int = 8,
    gravity: float = 9.8,
    ramp: float = 0.1,
    duration: float = 20.0,
    material: Material = glass_beads,
    scheme: Scheme = schemes.default,
    seed: int = 0,
    **material_numbers: Any,
) -> Parts:
    """Layer on an incline, with x down the slope (Dunatunga & Kamrin 2015, section 4.4).

    From the paper: 0.2 m high, cells of 0.005 m with 4 points, one column of cells, periodic in x,
    no_slip base, angles of 19 to 34 deg, gravity ramped in 0.1 s. Gravity is tilted, not the grid.

    Chosen here: 20 s (near 25 deg the flow is steady after 24 s, near 32 deg after more than
    1000 s, so compare with the transient solution), and 8 free cells above the surface. One column
    cannot show the instabilities of a two-dimensional flow: use 8 or more, and a jitter, for those.
    Four columns differ by 5 to 20 % in velocity with stiff grains (E of 1e8 Pa and more).

    Parameters
    ----------
    angle_deg : float
        Inclination [deg], 0 <= angle < 90.
    height : float
        Height of the layer across the slope [m], whole cells.
    columns : int
        Number of cells along the slope.
    columns_across : int
        Number of cells along the horizontal axis across the slope, also periodic; 0 for 2D.
    headroom : int
        Number of free cells above the surface, >= 1.
    {common}.
    """
    slope = (angle_deg, height, cell, columns, columns_across, headroom, gravity, ramp)
    return _layer(*slope, points_per_cell=points_per_cell, jitter=jitter)


def _layer(
    angle_deg: float,
    height: float,
    cell: float,
    columns: int,
    columns_across: int,
    headroom: int,
    gravity: float,
    ramp: float,
    **fill: Any,
) -> Parts:
    """Layer that is periodic along the slope and across it; `fill` has arguments of `Fill`."""
    cell, level = positive("cell", cell), level_cells(columns, columns_across)
    n_y = whole_cells("height", height, cell)
    rows = n_y + integer("headroom", headroom, 1)
    top, periodic = tuple(n * cell for n in (*level, n_y)), range(len(level))
    return Parts(
        **block(cell, (*level, rows), top, periodic=periodic, **fill),
        walls=(Wall(len(level), 0.0, kind="no_slip"),),
        gravity=ramped(down_slope(len(level) + 1, gravity, angle_deg), ramp),
        parameters={"columns_across": columns_across},
    )


chute_grains = NGF(
    E=1e6, nu=0.3, mu_s=0.3819, mu_2=1.5, rho_s=2450.0, rho_c=1500.0, I0=0.279, A=0.25, d=0.005,
    t0=1e-3,
)  # fmt: skip
linear_flip = Scheme(basis="linear", transfer="flip", density=ParticleDensity())


@scene_function("mpm")
def chute_ngf(
    *,
    angle_deg: float = 27.0,
    height: float = 0.01,
    cell: float = 0.001,
    columns: int = 1,
    points_per_cell: int = 16,
    jitter: float = 0.0,
    headroom: int = 4,
    gravity: float = 9.81,
    ramp: float = 0.1,
    duration: float = 5.0,
    material: NGF = chute_grains,
    scheme: Scheme = linear_flip,
    seed: int = 0,
    **material_numbers: Any,
) -> Parts:
    """Layer on a rough incline by the nonlocal law (Dunatunga & Kamrin, "Modeling silo clogging
    with nonlocal granular rheology", section 6).

    From the paper: cells of 1 mm with 16 points, grains of 5 mm, rho_s = 2450 kg/m3, A = 0.25,
    mu_s = 0.3819, mu_2 = 1.5, t0 = 1 ms, a rough base (no velocity, no fluidity); 27 deg and layers
    of 2, 3, 5, 7 and 20 grains in its figure 2(c).

    Chosen here: I0 = 0.279 and E = 1 MPa, which the paper does not state (1 to 10 MPa are suitable;
    at 100 MPa points at the surface become disconnected), and one periodic column, stress-free at
    the start, under a gravity that grows within 0.1 s, as in `incline`. The law has no hysteresis:
    a layer at rest starts at the same height at which a flowing one stops. The height of a layer is
    a whole number of cells, so vary the grain size to approach the height at which it stops,
    `granular.theory.stopping_height`.

    Parameters
    ----------
    angle_deg, height, cell, columns, points_per_cell, jitter, headroom, gravity, ramp, duration
        See `incline`.
    {common}.
    """
    if not isinstance(material, NGF):
        raise TypeError(f"material = {material!r} must be an NGF")
    slope = (angle_deg, height, cell, columns, 0, headroom, gravity, ramp)
    return _layer(*slope, points_per_cell=points_per_cell, jitter=jitter)

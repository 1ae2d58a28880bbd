"""A silo with an opening a few grains wide, which either flows or clogs under an arch."""

from __future__ import annotations

import warnings
from typing import Any

from granular.checks import non_negative, positive, truth
from granular.diagnostics import StabilityWarning
from granular.materials import NGF, silo_grains
from granular.mpm.scene import Scene
from granular.mpm.schemes import ParticleDensity, Scheme
from granular.mpm.walls import SpongeLayer, Wall
from granular.scenes._build import HEADROOM, block, gravity_down, whole_cells
from granular.scenes._registry import scene_function

JAM_FRICTION = 1.0
"""Friction tau/p at the face of a 2D arch: it is compressed along its face and free across it."""

linear_flip = Scheme(basis="linear", transfer="flip", density=ParticleDensity(), dt=1e-4)


@scene_function("mpm")
def clogging_silo(
    *,
    opening_over_d: float = 1.0,
    A: float = 1.0,
    cell: float = 0.0175,
    orifice: float = 0.14,
    width: float = 0.595,
    height: float = 0.595,
    half: bool = True,
    points_per_cell: int = 16,
    jitter: float = 0.0,
    sponge: float | None = 0.49,
    sponge_damping: float = 1000.0,
    gravity: float = 9.81,
    duration: float = 1.5,
    material: NGF = silo_grains,
    scheme: Scheme = linear_flip,
    seed: int = 0,
    **material_numbers: Any,
) -> Scene:
    """Silo with grains that are nearly as large as its opening (Dunatunga & Kamrin, "Modeling silo
    clogging with nonlocal granular rheology", section 7).

    From the paper: opening 0.14 m between the fixed nodes, 0.595 m wide and filled as high, cells
    of 0.0175 m with 16 points, dt = 1e-4 s (2.5e-5 s in cells of half the size), 1.5 s; E = 1 MPa,
    nu = 0.45, mu_s = 0.3819, mu_2 = 50, b = 1, t0 = 1 ms; the opening is `opening_over_d` grains
    wide. Rough bottom (no velocity, no fluidity), smooth sides, a lithostatic start with the
    orifice open, and no upward motion above 0.49 m, to damp elastic waves. Some lengths are printed
    as a tenth or a fifth of these; only these are consistent with one another.

    Chosen here: square cells in place of pairs of triangles, and the right half in place of the
    whole. Points leave for good as they cross the bottom, y = 0. Upward motion above 0.49 m is
    damped at a finite rate. If it is stopped at once, as in the paper, a bed that its waves have
    compressed stays compressed, with cells of half the size for seconds.

    Parameters
    ----------
    opening_over_d : float
        Width of the opening divided by the grain diameter; it replaces `d` of `material`.
    A : float
        Nonlocal amplitude; it replaces `A` of `material`.
    orifice, width, height : float
        Full widths of the opening and of the silo, and height of the fill [m], whole cells (the
        half-widths too).
    half : bool
        If true, only the right half is modelled, with a symmetry plane at x = 0.
    sponge : float or None
        Height [m] above which upward motion is damped (a sponge layer); None for no damping.
    sponge_damping : float
        Rate of the damping [1/s]; infinity as published. See `granular.mpm.walls.SpongeLayer`.
    {common}

    Warns
    -----
    StabilityWarning
        If the friction cannot reach 1, the friction of an arch, so that the silo cannot jam.
    """
    cell = positive("cell", cell)
    if not isinstance(material, NGF):
        raise TypeError(f"material = {material!r} must be an NGF")
    half, orifice = truth("half", half), positive("orifice", orifice)
    d = orifice / positive("opening_over_d", opening_over_d)
    material = material.replace(A=non_negative("A", A), d=d)
    if material.mu_2 < JAM_FRICTION:
        warnings.warn(
            f"mu_2 = {material.mu_2} is below 1: the face of a 2D arch bears friction 1,"
            " so that this silo cannot jam",
            StabilityWarning,
            stacklevel=3,
        )
    n_x = whole_cells("width/2", positive("width", width) / 2, cell)
    n_y = whole_cells("height", height, cell)
    n_open = whole_cells("orifice/2", orifice / 2, cell)
    if n_open >= n_x:
        raise ValueError(f"orifice = {orifice} must be less than width = {width}")
    low, edge, side = 0.0 if half else -n_x * cell, n_open * cell, n_x * cell
    bottoms = [
        Wall(1, 0.0, kind="no_slip", span=((edge, side),)),
        # Open from the start, so that all that is done near outlets is done near it.
        Wall(1, 0.0, kind="no_slip", span=((max(low, -edge), edge),), opens_at=0.0),
    ]
    if not half:
        bottoms.append(Wall(1, 0.0, kind="no_slip", span=((low, -edge),)))
    return Scene(
        name="clogging_silo",
        **block(
            cell,
            (n_x if half else 2 * n_x, n_y + HEADROOM),
            (side, n_y * cell),
            lower=(low, 0.0),
            open_sides={"y-"},
            points_per_cell=points_per_cell,
            jitter=jitter,
            lithostatic=True,
        ),
        material=material,
        scheme=scheme,
        walls=(*bottoms, *(Wall(0, at, kind="free_slip") for at in (low, side))),
        sponge_layers=() if sponge is None else (SpongeLayer(1, sponge, sponge_damping),),
        gravity=gravity_down(2, gravity),
        duration=duration,
        seed=seed,
    )

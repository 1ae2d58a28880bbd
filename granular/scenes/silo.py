"""Discharge of silos in 2D and 3D; one has an opening a few grains wide, and flows or clogs."""

from __future__ import annotations

import warnings
from typing import Any

from granular.materials import NGF, Material, glass_beads, grc_1, silo_grains
from granular.mpm import schemes
from granular.mpm.schemes import ParticleDensity, Scheme
from granular.mpm.walls import SpongeLayer, Wall
from granular.run.diagnostics import StabilityWarning
from granular.scenes._build import (
    HEADROOM,
    PROMPT,
    Parts,
    block,
    in_soft_soil,
    smooth_sides,
    whole_cells,
)
from granular.scenes._registry import scene_function
from granular.tools.checks import in_range, non_negative, one_of, positive, truth


@scene_function("mpm")
def silo(
    *,
    orifice: float = 0.1,
    width: float = 1.0,
    height: float = 1.0,
    cell: float = 0.01,
    points_per_cell: int = 4,
    jitter: float = 0.0,
    axisymmetric: bool = False,
    edge: str = "last_free_node",
    opens_at: float = 0.1,
    gravity: float = 9.8,
    ramp: float = 0.1,
    duration: float = 40.0,
    material: Material = glass_beads,
    scheme: Scheme = schemes.default,
    seed: int = 0,
    **material_numbers: Any,
) -> Parts:
    """Right half of a silo that empties (Dunatunga & Kamrin 2015, section 4.2), or a round one.

    From the paper: 1 m wide, filled 1 m high, half of it modelled, no_slip bottom, free_slip
    sides, cells of 0.01 m with 4 points, the orifice opened at 0.1 s when gravity is full, 40 s.
    Its orifice D extends from the first to the last vertically free node of the bottom. In the
    whole silo these nodes lie from -D/2 to D/2. Hence the nodes with x <= D/2 are free here and
    the bottom begins one cell further, at D/2 + cell: the default `edge`. The exponent fitted to
    Beverloo's law depends on this definition. Splines have a C0 line where the bottom begins and
    their last free node half a cell before it: by that definition their opening is D + cell.

    Chosen here: points leave for good as they cross the bottom, y = 0.

    Parameters
    ----------
    orifice : float
        Full width D of the opening [m], an even number of cells.
    width, height : float
        Full width of the silo and height of the fill [m], whole cells (the half-width too).
    axisymmetric : bool
        Whether the plane is one of radius and height, of a round silo with a round opening:
        `orifice` and `width` are diameters.
    edge : {"last_free_node", "wall"}
        Beginning of the bottom: at D/2 + cell, as in the paper, or at D/2.
    opens_at : float
        Time at which the orifice opens [s].
    {common}; also if the orifice leaves no bottom.
    """
    cell = positive("cell", cell)
    n_x = whole_cells("width/2", positive("width", width) / 2, cell)
    n_y = whole_cells("height", height, cell)
    free = whole_cells("orifice/2", positive("orifice", orifice) / 2, cell)
    opens_at = non_negative("opens_at", opens_at)
    begin = free + (one_of("edge", edge, ("last_free_node", "wall")) == "last_free_node")
    if begin >= n_x:
        raise ValueError(
            f"orifice = {orifice} must be less than width = {width} by more than two cells"
            f" of {cell}"
        )
    filled = block(
        cell,
        (n_x, n_y + HEADROOM),
        (n_x * cell, n_y * cell),
        open_sides={"y-"},
        axisymmetric=truth("axisymmetric", axisymmetric),
        points_per_cell=points_per_cell,
        jitter=jitter,
    )
    return Parts(
        **filled,
        walls=(
            Wall(1, 0.0, kind="no_slip", span=((begin * cell, n_x * cell),)),
            # The lid has the width of the outlet, so that the rules for points near outlets apply
            # near it.
            Wall(1, 0.0, kind="no_slip", span=((0.0, begin * cell),), opens_at=opens_at),
            *smooth_sides(filled["grid"]),
        ),
        parameters={} if axisymmetric else {"half": True},
    )


soft_grains = grc_1.replace(E=0.15e6, t0=PROMPT, mu_s=0.3819)


@scene_function("mpm")
def silo_3d(
    *,
    length: float = 0.25,
    height: float = 0.125,
    width: float = 0.0625,
    slot: float = 0.025,
    cell: float = 0.00625,
    points_per_cell: int = 8,
    jitter: float = 0.0,
    gravity: float = 9.81,
    duration: float = 12.0,
    material: Material = soft_grains,
    scheme: Scheme = in_soft_soil,
    seed: int = 0,
    **material_numbers: Any,
) -> Parts:
    """Silo with a slot at its left wall, across its whole width (Haeri & Skonieczny 2021, section
    4.3, figure 19).

    From the paper: rough bottom, smooth sides, E = 0.15 MPa, the grains of its table 1 with
    mu_s = 0.3819, 12 s, after which the slope is at the friction angle. From the scripts of the
    paper: 0.25 m long, filled 0.125 m high, a quarter of the length wide, a slot of 0.025 m.

    Chosen here: the fluidity responds within 1e-6 s, because the time step is longer than the 1e-4
    s of the paper; the slot is open from the start, and the fill is under its own weight. Points
    leave for good as they cross the bottom, z = 0, where the paper lets them fall on a floor. mu_2
    is that of table 1 (the scripts have 1.5). The paper's cells of 4 mm do not divide these
    lengths, and its 32 000 points, 8 per cell, fill an eighth of the volume; here the cells are
    6.25 mm with 64 000 points. Between smooth sides nothing depends on y, so that a `width` of two
    cells gives the same result at a fifth of the cost.

    Parameters
    ----------
    length, height, width : float
        Extents of the fill along x, z and y [m], whole cells.
    slot : float
        Width of the opening, which begins at the left wall [m], whole cells.
    {common}; also if the slot leaves no bottom.
    """
    cell = positive("cell", cell)
    lengths = (("length", length), ("width", width), ("height", height))
    n_x, n_y, n_z = (whole_cells(name, value, cell) for name, value in lengths)
    n_slot = whole_cells("slot", slot, cell)
    if n_slot >= n_x:
        raise ValueError(f"slot = {slot} must be less than length = {length}")
    x, y = n_x * cell, n_y * cell
    edge, across = n_slot * cell, (0.0, y)
    filled = block(
        cell,
        (n_x, n_y, n_z + HEADROOM),
        (x, y, n_z * cell),
        open_sides={"z-"},
        points_per_cell=points_per_cell,
        jitter=jitter,
        lithostatic=True,
    )
    return Parts(
        **filled,
        walls=(
            Wall(2, 0.0, kind="no_slip", span=((edge, x), across)),
            # Open from the start, so that the rules for points near outlets apply near it.
            Wall(2, 0.0, kind="no_slip", span=((0.0, edge), across), opens_at=0.0),
            *smooth_sides(filled["grid"]),
        ),
    )


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
) -> Parts:
    """Silo with grains that are nearly as large as its opening (Dunatunga & Kamrin, "Modeling silo
    clogging with nonlocal granular rheology", section 7).

    From the paper: opening 0.14 m between the fixed nodes, 0.595 m wide and filled as high, cells
    of 0.0175 m with 16 points, dt = 1e-4 s (2.5e-5 s in cells of half the size), 1.5 s; E = 1 MPa,
    nu = 0.45, mu_s = 0.3819, mu_2 = 50, b = 1, t0 = 1 ms; the opening is `opening_over_d` grains
    wide. Rough bottom (no velocity, no fluidity), smooth sides, a start with a lithostatic pressure
    (K0 = 1) and the orifice open, and no upward motion above 0.49 m, to damp elastic waves (a
    sponge layer). Some lengths are printed as a tenth or a fifth of these; only these are
    consistent with one another.

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
        Rate of the sponge damping [1/s]; infinity as published. See
        `granular.mpm.walls.SpongeLayer`.
    {common}.

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
            stacklevel=4,
        )
    n_x = whole_cells("width/2", positive("width", width) / 2, cell)
    n_y = whole_cells("height", height, cell)
    n_open = whole_cells("orifice/2", orifice / 2, cell)
    if n_open >= n_x:
        raise ValueError(f"orifice = {orifice} must be less than width = {width}")
    if sponge is not None:
        top = (n_y + HEADROOM) * cell
        sponge = in_range("sponge", sponge, 0.0, top, open_high=True)
    sponge_damping = positive("sponge_damping", sponge_damping, allow_inf=True)
    low, edge, side = 0.0 if half else -n_x * cell, n_open * cell, n_x * cell
    bottoms = [
        Wall(1, 0.0, kind="no_slip", span=((edge, side),)),
        # Open from the start, so that the rules for points near outlets apply near it.
        Wall(1, 0.0, kind="no_slip", span=((max(low, -edge), edge),), opens_at=0.0),
    ]
    if not half:
        bottoms.append(Wall(1, 0.0, kind="no_slip", span=((low, -edge),)))
    return Parts(
        **block(
            cell,
            (n_x if half else 2 * n_x, n_y + HEADROOM),
            (side, n_y * cell),
            lower=(low, 0.0),
            open_sides={"y-"},
            points_per_cell=points_per_cell,
            jitter=jitter,
            lithostatic=True,
            K0=1.0,
        ),
        material=material,
        walls=(*bottoms, *(Wall(0, at, kind="free_slip") for at in (low, side))),
        sponge_layers=() if sponge is None else (SpongeLayer(1, sponge, sponge_damping),),
    )

"""How the equations are solved: basis functions, velocity transfer, density, time step."""

from __future__ import annotations

from dataclasses import dataclass, fields
from dataclasses import replace as _replace
from typing import Any, Self

from granular.checks import in_range, integer, non_negative, one_of, positive
from granular.notebook import table

__all__ = [
    "BASES",
    "DENSITIES",
    "TRANSFERS",
    "Fluidity",
    "Scheme",
    "cell_averaged",
    "default",
    "dunatunga_kamrin_2015",
]

BASES = ("linear", "ugimp", "quadratic")
TRANSFERS = ("flip", "apic", "tpic", "xpic")
DENSITIES = ("particle", "smoothed", "cell_averaged")


DIFFUSIONS = ("auto", "explicit", "implicit", "rkl2")
STENCILS = ("faces", "isotropic")


@dataclass(frozen=True, kw_only=True)
class Fluidity:
    """How the fluidity of a nonlocal law (`granular.materials.NGF`) is diffused; without one, idle.

    Parameters
    ----------
    stencil : {"faces", "isotropic"}
        Of the Laplacian: a cell and those across its faces, or all 26 around it (8 in the plane),
        which errs alike in all directions, at several times the cost.
    method : {"auto", "explicit", "implicit", "rkl2"}
        "explicit" is refused beyond dt = dx^2 t0/(2 dim A^2 d^2); "implicit" is backward Euler, by
        conjugate gradients, which makes no fluidity negative; "rkl2" a Runge-Kutta-Legendre scheme
        of second order, that may undershoot, and with which steady flows depend on the substeps;
        "auto" is explicit where one substep is within that limit, else implicit.
    substeps : int
        Substeps of the law in a time step, each with its diffusion, at a velocity gradient that is
        held. The implicit method is balanced with the law, so that a steady flow does
        not depend on them; more resolve what changes within t0.
    tolerance : float
        Of the conjugate gradients, residual over the first one, 0 < tolerance < 1: so much of what
        the diffusion changes in a step may be wrong.
    initial : float or None
        Fluidity of all points at the start [1/s], >= 0. None for a local phase: the law of `MuI`
        for 10 t0, then g = shear_rate/mu. Where g is 0 everywhere it stays 0 up to a friction
        close to mu_2.
    floor : float
        Fluidity [1/s] below which none falls by decay, so that what came to rest can flow again.
    reconnect_fluidity : bool
        With Hencky elasticity: whether points that become dense again begin with the fluidity
        sqrt(2) abs(D)/mu_2 (Haeri & Skonieczny 2021, eq. 23), and not with none.
    pressure_averaging : float or None
        Depth that the pressure of a point stands for, to either side of it, in cells: the term with
        1/sqrt(p), of which surface cells feel most, has its mean over that depth, as under the
        largest component of gravity alone. None for what it is: half a cell with hats, under which
        a cell has one pressure, and half the spacing of the points with splines. 0 for the value at
        p: thin layers flow too fast then, by 9 % at twice the height at which they stop and 10
        cells high.

    Raises
    ------
    TypeError, ValueError
        Naming argument, value and allowed range.
    """

    method: str = "auto"
    stencil: str = "faces"
    substeps: int = 1
    tolerance: float = 1e-4
    initial: float | None = None
    floor: float = 0.0
    reconnect_fluidity: bool = False
    pressure_averaging: float | None = None

    def __post_init__(self) -> None:
        checked: dict[str, Any] = {
            "method": one_of("method", self.method, DIFFUSIONS),
            "stencil": one_of("stencil", self.stencil, STENCILS),
            "substeps": integer("substeps", self.substeps, 1, 100000),
            "floor": non_negative("floor", self.floor),
            "tolerance": in_range(
                "tolerance", self.tolerance, 0.0, 1.0, open_low=True, open_high=True
            ),
        }
        if not isinstance(self.reconnect_fluidity, bool):
            raise TypeError(
                f"reconnect_fluidity = {self.reconnect_fluidity!r} must be True or False"
            )
        if self.pressure_averaging is not None:
            checked["pressure_averaging"] = in_range(
                "pressure_averaging", self.pressure_averaging, 0.0, 1.0
            )
        if self.initial is not None:
            checked["initial"] = non_negative("initial", self.initial)
        for name, value in checked.items():
            object.__setattr__(self, name, value)

    def replace(self, **changes: Any) -> Self:
        """A copy with some arguments changed, checked as a new one."""
        return _replace(self, **changes)


@dataclass(frozen=True, kw_only=True)
class Scheme:
    """A numerical scheme; without arguments it is `default`.

    In the formulas c_p = ln(rho_p/rho_c), c_w is the compression wave speed of the material, dx
    the cell, L the velocity gradient, and phi_i = m_i/(V_i rho_c) the fullness of a node: its
    mass against the room it stands for. gdot is the plastic shear rate; for points that bear
    nothing, and where cells share their density, the rate of shear of L plus abs(tr L).

    Parameters
    ----------
    basis : {"quadratic", "linear", "ugimp"}
        Shape functions: quadratic B-splines, hats, or hats averaged over points whose half-width
        is half the initial point spacing.
    transfer : {"tpic", "flip", "apic", "xpic"}, optional
        By default "tpic" with the quadratic basis and "flip" with the others.
        How velocity returns from the grid to the points. "tpic" carries the velocity gradient
        of the point, "apic" the affine moment, "xpic" removes the null space of "flip".
    flip_decay : float
        Rate [1/s] at which the difference between the velocity of a point and that of the grid
        dies out under "flip": f = exp(-flip_decay dt) survives a step. A rate, so
        that the result does not depend on the time step.
    xpic_order : int
        Order of the "xpic" filter, 1 to 5 (1 is PIC).
    density : {"smoothed", "cell_averaged", "particle"}, optional
        By default "smoothed" with quadratic "tpic", the only one it is made for, else "particle".
        "particle" integrates the density of each point by itself, as published; "smoothed" spreads
        it among neighbours and ties it to the fullness of the grid; "cell_averaged", for linear "tpic"
        alone, makes the points of a cell one unit, with one density, one velocity gradient and
        their mean stress, and ties that density to the fullness (the numbers below).
    cfl : float
        Time step as a share of dx/(c_w + max speed), 0 < cfl <= 1; a simulation refuses more than
        `granular.mpm.limits.COURANT_LIMIT` of its basis and dimension.
    dt : float or None
        Fixed time step [s]; None for the adaptive one.
    mass_cutoff : float
        Nodes lighter than this share of the mean point mass are left out.
    diffusion : float
        dd: c_p relaxes towards the mean of its neighbours (linearly extrapolated, so that a
        hydrostatic gradient is untouched) at the rate dd c_w/dx + ds gdot/c_p; a shared c towards
        that of the cells on both sides.
    strain_diffusion : float
        ds, see `diffusion`: strain makes the unevenness that is to be averaged, and a strain of
        c_p/ds averages it, so that what is left is a share of c_p with grains of any stiffness,
        and a heap at rest keeps the density it has come to.
    relaxation : float
        kappa: c_p is pulled to the fullness at the rate kappa gdot d, with d the gap ln phi - c
        of the nodes inside the material, averaged over those around each, or that of a cell that
        shares its density. Bound to plastic flow, it leaves heaps at rest and elastic waves alone.
    relaxation_limit : float
        eps: that rate is eps g/c_w at most, with the largest gravity g of the scene, where there
        is any: across a cell such a source of pressure accelerates by about a share eps of g.
        Without it the noise of phi, which is that of the places of the points, drowns the small
        compressions of very stiff materials.
    dead_band : float
        Gap d that may be such noise: material which converges on an outlet would crowd, and is
        driven apart for what it has more.
    compression_rate : float
        kappa_c: at the rate kappa_c gdot (d - dead_band), without a limit.
    shifting : float
        beta: points move by -beta gdot dt dx^2 sum_i max(0, phi_i - 1) grad S_i, and take the
        velocity of where they come to where the density is diffused. Where it is shared, phi_i - 1
        is replaced by (phi_i - 1) V_i/dx^dim, the same for walls apart, and they keep theirs.
    shifting_limit : float
        Largest shift in a step, in cells.
    shifting_outlet_cells : int
        No shift nearer than this to an opening, in cells: it would jam the outlet.
    averaging_time : float
        Time between two averagings of a diffused density, in dx/c_w, to whole steps and at least
        one: the steps between cost no more than plain ones. A time and not a number of steps, so
        that the result does not depend on the step: what an averaging does is nearly complete.
    separation_strain : float
        Points looser than c_p = -separation_strain take no part in the averaging.
    weight_correction : float
        Part of the unevenness of the points, the force E_i = sum_p q_p V_p grad S_i that a uniform
        pressure would make on a node inside the material, that an averaging takes away by the
        weights q_p of the points in the force: q_p += -weight_correction sum_i grad S_i . E_i, in lengths
        of cells; the local mean of q_p is kept at exp(c)/phi, so that the weighted volumes fill
        the room they have. 0 for no weights, 1 at most.
    weight_correction_limit : float
        Largest abs(q_p - 1), at most .8: what weighs more is as much stiffer.
    weight_correction_decay : float
        Part of q_p - 1 that a point loses in an averaging: it forgets where it has been. 0 to 1.
    decay : float
        Under "tpic" v_p = v_pic + f (v_p + dv - v_pic) with f = exp(-decay dt c_w/dx).
    fluidity : Fluidity
        Of a nonlocal law.

    Raises
    ------
    TypeError, ValueError
        Naming argument, value and allowed range.
    """

    basis: str = "quadratic"
    transfer: str = None  # type: ignore[assignment]  # a name once made
    flip_decay: float = 0.0
    xpic_order: int = 2
    density: str = None  # type: ignore[assignment]
    cfl: float = 0.5
    dt: float | None = None
    mass_cutoff: float = 1e-14
    diffusion: float = 0.0
    strain_diffusion: float = 20.0
    relaxation: float = 0.3
    relaxation_limit: float = 1.0
    dead_band: float = 0.03
    compression_rate: float = 3.0
    shifting: float = 8.0
    shifting_limit: float = 0.05
    shifting_outlet_cells: int = 3
    averaging_time: float = 2.0
    separation_strain: float = 0.02
    weight_correction: float = 0.7
    weight_correction_limit: float = 0.5
    weight_correction_decay: float = 0.005
    decay: float = 0.03
    fluidity: Fluidity = Fluidity()

    def __post_init__(self) -> None:
        basis = one_of("basis", self.basis, BASES)
        transfer = self.transfer or ("tpic" if basis == "quadratic" else "flip")
        corrected = basis == "quadratic" and transfer == "tpic"
        checked: dict[str, Any] = {
            "basis": basis,
            "transfer": one_of("transfer", transfer, TRANSFERS),
            "density": one_of(
                "density", self.density or ("smoothed" if corrected else "particle"), DENSITIES
            ),
            "xpic_order": integer("xpic_order", self.xpic_order, 1, 5),
            "cfl": in_range("cfl", self.cfl, 0.0, 1.0, open_low=True),
            "dt": None if self.dt is None else positive("dt", self.dt),
            # A tenth of a point changes a run-out by a fifth: cutoffs are for round-off only.
            "mass_cutoff": in_range("mass_cutoff", self.mass_cutoff, 0.0, 0.01),
            "shifting_limit": in_range("shifting_limit", self.shifting_limit, 0.0, 0.5),
            "weight_correction": in_range("weight_correction", self.weight_correction, 0.0, 1.0),
            "weight_correction_limit": in_range(
                "weight_correction_limit", self.weight_correction_limit, 0.0, 0.8
            ),
            "weight_correction_decay": in_range(
                "weight_correction_decay", self.weight_correction_decay, 0.0, 1.0
            ),
            "shifting_outlet_cells": integer(
                "shifting_outlet_cells", self.shifting_outlet_cells, 0, 1000
            ),
        }
        for name in (
            "flip_decay",
            "diffusion",
            "strain_diffusion",
            "relaxation",
            "relaxation_limit",
            "dead_band",
            "compression_rate",
            "shifting",
            "separation_strain",
            "averaging_time",
            "decay",
        ):
            checked[name] = non_negative(name, getattr(self, name))
        for name, value in checked.items():
            object.__setattr__(self, name, value)
        if not isinstance(self.fluidity, Fluidity):
            raise TypeError(f"fluidity = {self.fluidity!r} must be a Fluidity")
        if self.density == "smoothed" and not corrected:
            raise ValueError(
                f'density = "smoothed" needs basis = "quadratic" and transfer = "tpic", '
                f'not {self.basis!r} and {self.transfer!r}; choose density = "particle"'
            )
        if self.density == "cell_averaged" and (basis, self.transfer) != ("linear", "tpic"):
            raise ValueError(
                f'density = "cell_averaged" needs basis = "linear" and transfer = "tpic", '
                f'not {self.basis!r} and {self.transfer!r}; choose density = "particle"'
            )
        if self.transfer != "flip" and self.flip_decay:
            raise ValueError(
                f"flip_decay = {self.flip_decay} must be 0 with transfer = {self.transfer!r}"
            )

    def replace(self, **changes: Any) -> Self:
        """A copy with some arguments changed, checked as a new one."""
        return _replace(self, **changes)

    def _repr_html_(self) -> str:
        return table("Scheme", {f.name: getattr(self, f.name) for f in fields(self)})


dunatunga_kamrin_2015 = Scheme(basis="linear", transfer="flip", density="particle", dt=3e-6)
"""Scheme of Dunatunga & Kamrin 2015 (section 3, table 2): hats, FLIP, fixed dt = 3e-6 s."""

default = Scheme()
"""Quadratic B-splines, affine transfer, diffused density: keeps two-dimensional shear alive."""

cell_averaged = Scheme(
    basis="linear",
    transfer="tpic",
    density="cell_averaged",
    decay=3.0,
    relaxation=0.7,
    relaxation_limit=0.5,
    dead_band=0.1,
    compression_rate=0.7,
    diffusion=0.5,
    strain_diffusion=0.0,
    shifting=2.0,
)
"""Hats, affine transfer, and the points of a cell as one unit: does the same, at less cost."""

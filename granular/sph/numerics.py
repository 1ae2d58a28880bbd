"""How the equations are discretised: the choices of chapter 5 of Hurley's thesis, and our own."""

from __future__ import annotations

from dataclasses import dataclass

from granular.checks import in_range, positive
from granular.sph.material import Viscoplastic

__all__ = ["Numerics"]

WALL_PUSH, SOFT = 0.03, 1e5
"""Share by which rho0 of walls is lower, and the kappa for which it is so [Pa] (the thesis)."""


@dataclass(frozen=True, kw_only=True)
class Numerics:
    """Numbers of the discretisation.

    Parameters
    ----------
    smoothing : float
        Smoothing length h in spacings of the points, 1 to 2. Below 1 a point has too few
        neighbours to feel shear, above 2 they pair and the cost grows; the thesis takes 1.2.
    skin : float
        How much farther than the kernel the list of neighbours reaches, in h, 0.02 to 1. It changes
        the cost and, in the last bits, the order of the sums.
    cfl : float
        Share that is taken of the limits h/(4 c) and sqrt(h/|a|)/4 of the time step (eq. 5.28), > 0
        and at most 2.
    dt : float or None
        A time step of its own [s]; None for the limits.
    regularisation : float
        Largest viscosity in rho h^2/dt: |D| is not taken smaller than (mu p + c) dt/(k h^2 rho)
        with this k, 0.01 to 1.5. It is the third limit of eq. 5.28 turned round: as |D| goes to
        zero the viscosity grows without bound, and no step would be short enough. Larger k
        jitters. What strains more slowly is held by the spring of `Viscoplastic.nu`; without one it
        creeps at that rate.
    wall_density : float or None
        rho0 of the points of walls, as a share of the material's, 0.9 to 1. Their pressure begins
        earlier, so that grains do not go through; grains next to the wall have less. Against a
        lattice at rest 3 % less is 4.7 % of kappa: 4.7 kPa with the kappa of the thesis, 1e5 Pa,
        and with 1e7 Pa what throws a heap apart. None for 3 % up to 1e5 Pa and less in proportion
        to 1/kappa above, so that stiff grains are pushed no harder.
    z_max : float
        Largest factor of the artificial velocity of walls (eq. 5.24), 1 to 2. With 1 points of a
        wall have its velocity; the thesis takes 1.5. Above 1 rates of strain weigh a wall more than
        forces do, so that it does work on grains at rest: heaps on a floor of less friction than
        their own then keep .05 m/s.

    Raises
    ------
    TypeError, ValueError
        Naming argument, value and allowed range.
    """

    smoothing: float = 1.2
    skin: float = 0.3
    cfl: float = 1.0
    dt: float | None = None
    regularisation: float = 0.5
    wall_density: float | None = None
    z_max: float = 1.0

    def __post_init__(self) -> None:
        ranges = {
            "smoothing": (1.0, 2.0),
            "skin": (0.02, 1.0),
            "cfl": (1e-6, 2.0),
            "regularisation": (0.01, 1.5),
            "z_max": (1.0, 2.0),
        }
        for name, (low, high) in ranges.items():
            object.__setattr__(self, name, in_range(name, getattr(self, name), low, high))
        if self.wall_density is not None:
            share = in_range("wall_density", self.wall_density, 0.9, 1.0)
            object.__setattr__(self, "wall_density", share)
        if self.dt is not None:
            object.__setattr__(self, "dt", positive("dt", self.dt))

    def rho0_wall(self, material: Viscoplastic) -> float:
        """rho0 of the points of walls [kg/m3]."""
        share = self.wall_density
        if share is None:
            share = 1.0 - WALL_PUSH * min(1.0, SOFT / material.kappa)
        return share * material.rho0

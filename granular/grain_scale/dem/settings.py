"""Settings of simulations, frozen and checked: shear cells and packings."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

from granular.grain_scale.dem.grains import Grains
from granular.tools.checks import in_range, integer, non_negative, one_of, positive

SPACING = 1.1
"""Least spacing of the initial cubic array, divided by the diameter of the large grains."""

_DENSE = 0.59
"""Packing fraction from which the width of a cell is computed beforehand."""
_PHASE = 0.2
"""Phase angle [rad] of the stiffest contact per time step, so that a period has some 30 steps."""
_MOST_LOADED = 5.0
"""Force on a strong contact, divided by pressure times diameter squared."""


def _time_step(grains: Grains, pressure: float, speed: float) -> float:
    """Time step [s] that resolves the contacts of the small grains, under pressure or impact."""
    d = grains.diameters[0]
    mass, radius = grains.contact(d)
    pressed = (_MOST_LOADED * pressure * grains.d**2 / (radius * grains.kn)) ** (2 / 3)
    hit = 1.25**0.4 * grains.overlap_scale(speed, d) if speed > 0 else 0.0
    stiffness = 1.5 * radius * grains.kn * math.sqrt(max(pressed, hit))
    damping = mass * grains.gamma_n * radius * math.sqrt(max(pressed, hit))
    return _PHASE / max(math.sqrt(stiffness / mass), damping / mass)


@dataclass(frozen=True)
class Units:
    """Units in which LAMMPS computes: length d, density rho_s, stress p.

    Attributes
    ----------
    length, density, stress : float
        The units in SI: [m], [kg/m3], [Pa].
    """

    length: float
    density: float
    stress: float

    @property
    def speed(self) -> float:
        """Unit of speed, ``sqrt(p/rho_s)`` [m/s]."""
        return math.sqrt(self.stress / self.density)

    @property
    def time(self) -> float:
        """Unit of time, ``d/sqrt(p/rho_s)`` [s]."""
        return self.length / self.speed

    @property
    def mass(self) -> float:
        """Unit of mass, ``rho_s d^3`` [kg]."""
        return self.density * self.length**3

    @property
    def force(self) -> float:
        """Unit of force, ``p d^2`` [N]."""
        return self.stress * self.length**2


@dataclass(frozen=True, kw_only=True)
class Shear:
    """Settings of a simple shear at constant normal stress.

    Parameters
    ----------
    grains : Grains
    inertial_number : float
        ``I = shear_rate d sqrt(rho_s/pressure)``, ``d = <D^3>^(1/3)``, in (0, 10]. It is a nominal
        value; the actual one depends on the dilation and the slip at walls, see
        `Frame.shear_rate`.
    pressure : float
        Normal stress on planes of constant y [Pa], > 0.
    count : int
        Number of grains that flow, at least 50.
    aspect : float
        Height of the dense cell divided by its width, in [0.5, 10]; the width must hold 3 large
        grains.
    approach, strain : float
        Shear strain before and while frames are taken, >= 0 and > 0.
    frames : int
        Number of frames, evenly spaced over `strain`, at least 1.
    drive : {"homogeneous", "walls"}
        "homogeneous": periodic in all directions, and the box itself is sheared. "walls": sheared
        between two rough walls made of grains, with the pressure on the upper one.
    seed : int
        Seed of the initial arrangement, from 0 to 10^8.
    {raises}.
    """

    grains: Grains = field(default_factory=Grains)
    inertial_number: float = 0.1
    pressure: float = 1e3
    count: int = 800
    aspect: float = 1.0
    approach: float = 2.0
    strain: float = 5.0
    frames: int = 500
    drive: str = "homogeneous"
    seed: int = 0

    def __post_init__(self) -> None:
        _check_grains(self.grains)
        in_range("inertial_number", self.inertial_number, 0.0, 10.0, open_low=True)
        positive("pressure", self.pressure)
        integer("count", self.count, 50)
        in_range("aspect", self.aspect, 0.5, 10.0)
        non_negative("approach", self.approach)
        positive("strain", self.strain)
        integer("frames", self.frames, 1)
        one_of("drive", self.drive, ("homogeneous", "walls"))
        integer("seed", self.seed, 0, 10**8)
        if self.width < 3.0 * self.grains.diameters[1]:
            raise ValueError(
                f"count = {self.count} grains with aspect = {self.aspect} make a cell "
                f"{self.width:.3g} m wide, which must hold 3 large grains"
            )

    @property
    def units(self) -> Units:
        """Units in which LAMMPS computes."""
        return Units(self.grains.d, self.grains.rho_s, self.pressure)

    @property
    def shear_rate(self) -> float:
        """Nominal shear rate [1/s]."""
        return self.inertial_number * self.units.speed / self.grains.d_volume

    @property
    def dt(self) -> float:
        """Time step [s]."""
        hit = 2.0 * max(self.inertial_number, 0.1) * self.units.speed
        return _time_step(self.grains, self.pressure, hit)

    @property
    def width(self) -> float:
        """Length of the dense cell along x and z [m]."""
        volume = self.count * math.pi / 6.0 * self.grains.d_volume**3 / _DENSE
        return math.cbrt(volume / self.aspect)


@dataclass(frozen=True, kw_only=True)
class Packing:
    """Settings of a static packing in a periodic box.

    Parameters
    ----------
    grains : Grains
        Grains of the packing; the higher their friction, the less dense the packing.
    stress : (float, float, float)
        Compressive normal stress along x, y, z [Pa], each > 0.
    count : int
        Number of grains, at least 20.
    imbalance : float
        Largest resultant force on a grain, divided by the mean contact force, at which the packing
        counts as at rest, > 0.
    seed : int
        Seed of the initial arrangement, from 0 to 10^8.
    {raises}.
    """

    grains: Grains = field(default_factory=Grains)
    stress: tuple[float, float, float] = (1e3, 1e3, 1e3)
    count: int = 200
    imbalance: float = 1e-6
    seed: int = 0

    def __post_init__(self) -> None:
        _check_grains(self.grains)
        if not isinstance(self.stress, tuple) or len(self.stress) != 3:
            raise TypeError(f"stress = {self.stress!r} must be a tuple of 3 numbers")
        for axis, value in zip("xyz", self.stress, strict=True):
            positive(f"stress along {axis}", value)
        integer("count", self.count, 20)
        positive("imbalance", self.imbalance)
        integer("seed", self.seed, 0, 10**8)

    @property
    def units(self) -> Units:
        """Units in which LAMMPS computes, with the mean of the three stresses."""
        return Units(self.grains.d, self.grains.rho_s, sum(self.stress) / 3.0)

    @property
    def dt(self) -> float:
        """Time step [s]."""
        return _time_step(self.grains, max(self.stress), 0.2 * self.units.speed)

    @property
    def width(self) -> float:
        """Edge of the initial loose box, a cube [m]."""
        return math.ceil(math.cbrt(self.count)) * SPACING * self.grains.diameters[1]


def _check_grains(grains: object) -> None:
    if not isinstance(grains, Grains):
        raise TypeError(f"grains must be Grains, not {type(grains).__name__}")

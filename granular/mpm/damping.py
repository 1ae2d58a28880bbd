"""Flutter damping, and slow-flow damping of noise within averaged cells.

In slow flow of frictional material the strength depends on the pressure, but the pressure does not
depend on the flow. Waves then take energy from gravity: a layer close to yield flutters as a whole
and flows at slopes below its angle of repose (docs/explanation/flutter.md). The scales are those of
the layer alone, its depth h and the speed c_w of compression waves, and so are those of the flutter
damping (csrc/mpm/flutter.inl): with the depth h = p/max(rho_c g, |grad p|) of a point,

    viscosity of what is not steady:     X rho_c c_w h,
    time over which steadiness counts:   M h/c_w,
    shear rate from which there is none: N c_w g mu rho_c/G.

X is `SmoothedDensity.flutter_damping`. Measured on layers at 20 degrees: those of 20 and 40 cells
come to rest with X from 0.01, M from 3 to 20 and N from 2 to infinity. In those of 80 cells the
waves are short and hardly move, so that M must be large: they come to rest with M = 20 and N = 4
but not all with M = 15. Flow whose shear rate changes within T becomes stiffer: a ball that is
pushed into a bed at 0.1 and 0.2 m/s meets 1.8 and 3.5 % more resistance than without flutter
damping (8 and 14 % if h were p/(rho_c g) there, too).

With a cell-averaged density the points of a cell share their stress, and differences of their
velocities are noise of the sampling. If they decay everywhere at a rate proportional to c_w/dx,
run-outs become shorter the stiffer the grains are. Slow-flow damping therefore acts only in slow
flow, at a rate and up to an inertial number that were measured (`granular.CellAveragedDensity`;
docs/reports/accuracy_of_schemes.md).
"""

from __future__ import annotations

import math

from granular.materials import (
    NGF,
    DilatantMuI,
    DruckerPrager,
    HardeningDruckerPrager,
    Material,
    MuI,
    RegularisedMuI,
)
from granular.mpm.scene import Scene
from granular.mpm.schemes import CellAveragedDensity, SmoothedDensity

UNBOUNDED = 1e100
STEADY_CROSSINGS = 20.0  # M
SLOW_FLOW = 4.0  # N
_NUMBERS = (
    "damping_rate",
    "slow_rate",
    "flutter_time",
    "flutter_memory",
    "flutter_end",
    "flutter_depth",
)


def damping(scene: Scene, material: Material, gravity: float) -> dict[str, float]:
    """Numbers of slow-flow and flutter damping of a material by their names in the core.

    They are 0 without damping. In averaged cells ``damping_rate`` [1/s] is the largest rate and
    ``slow_rate`` the shear rate over sqrt(p/K) from which nothing is damped. ``flutter_time`` [s],
    ``flutter_memory`` [s/Pa], ``flutter_end`` [s] and ``flutter_depth`` [m/Pa] are X c_w/g,
    M/(rho_c g c_w), G/(N rho_c c_w g) and 1/(rho_c g), with the largest gravity g of the scene.
    """
    density, numbers = scene.scheme.density, dict.fromkeys(_NUMBERS, 0.0)
    if isinstance(density, CellAveragedDensity):
        numbers["damping_rate"], numbers["slow_rate"] = _of_cells(density, scene, material)
    elif isinstance(density, SmoothedDensity) and material.granular and gravity > 0:
        numbers |= _of_flutter(density, material, gravity)
    return numbers


def _of_flutter(density: SmoothedDensity, material: Material, gravity: float) -> dict[str, float]:
    """Numbers of the flutter damping, bounded where a very small gravity makes them large."""
    if not density.flutter_damping:
        return {}
    c_w, weight = material.wave_speed, material.rho_c * gravity
    numbers = {
        "flutter_time": density.flutter_damping * c_w / gravity,
        "flutter_memory": STEADY_CROSSINGS / (weight * c_w),
        "flutter_end": material.G / (SLOW_FLOW * weight * c_w),
        "flutter_depth": 1.0 / weight,
    }
    return {name: min(number, UNBOUNDED) for name, number in numbers.items()}


def _of_cells(
    density: CellAveragedDensity, scene: Scene, material: Material
) -> tuple[float, float]:
    """Rate, and limit of the shear rate over sqrt(p/K), of slow flow in cells."""
    friction, xi = _flow(material)
    if not friction:
        return 0.0, 0.0
    rate = density.slow_decay * material.wave_speed / scene.grid.cell
    return rate, min(density.slow_inertial_number * xi * math.sqrt(material.K), UNBOUNDED)


def _flow(material: Material) -> tuple[float, float]:
    """Friction in slow flow, and the shear rate over sqrt(p) where I = I0; infinite without one.

    Both 0 for elastic materials.
    """
    if isinstance(material, DruckerPrager):
        return material.mu, math.inf
    if isinstance(material, HardeningDruckerPrager):
        return material.limiting_friction, math.inf
    if isinstance(material, MuI | RegularisedMuI | DilatantMuI):
        return material.mu_s, material.xi
    if isinstance(material, NGF):
        friction = material.core_friction()
        return material.mu_s, friction["xi"]
    return 0.0, 0.0


def velocity_decay(scene: Scene, gravity: float) -> float:
    """Rate at which the difference between the velocity of a point and that of the grid decays
    under FLIP and TPIC [1/s].

    Parameters
    ----------
    gravity : float
        Largest gravity of the scene [m/s2].

    Notes
    -----
    Some per cent of the stress of moving points are noise, a force that remains the same while they
    cross a cell. Where its impulse decays faster, the velocity of points deviates from that of the
    grid by the order of that force over the mass and the rate. This does not depend on c_w, and
    matters in flow that is slow compared with g over the rate. A blade that moves at 0.1 m/s
    through a bed with c_w = 11 m/s (`benchmarks/bodies/three_d.py`, narrow_5, mu(I)) scatters the
    velocities of the points of a cell by 0.09, 0.06, 0.04, 0.025 and 0.015 of their mean at 0.9,
    1.9, 3.1, 6.2 and 16 sqrt(g/dx).
    """
    scheme, cell = scene.scheme, scene.grid.cell
    if scheme.transfer != "tpic":
        return scheme.flip_decay
    least = scheme.tpic_least_decay * math.sqrt(gravity / cell)
    return max(scheme.tpic_decay * scene.wave_speed / cell, least)

"""A thin layer on a rough incline. Due to the finite grain size it flows only above a height."""

from __future__ import annotations

from typing import Any

from granular.materials import NGF
from granular.mpm.scene import Scene
from granular.mpm.schemes import ParticleDensity, Scheme
from granular.scenes._registry import scene_function
from granular.scenes.incline import incline

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
) -> Scene:
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
    {common}
    """
    if not isinstance(material, NGF):
        raise TypeError(f"material = {material!r} must be an NGF")
    return incline(
        angle_deg=angle_deg,
        height=height,
        cell=cell,
        columns=columns,
        points_per_cell=points_per_cell,
        jitter=jitter,
        headroom=headroom,
        gravity=gravity,
        ramp=ramp,
        duration=duration,
        material=material,
        scheme=scheme,
        seed=seed,
    ).replace(name="chute_ngf")

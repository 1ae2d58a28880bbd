"""Ready-made SPH scenes of a granular material with a gas."""

from __future__ import annotations

from typing import Any

from granular.model.fill import Fill
from granular.scenes._build import (
    Parts,
    block,
    cells_across,
    gravity_down,
    level_cells,
    whole_cells,
)
from granular.scenes._registry import scene_function
from granular.shapes import Box
from granular.sph.gas import SOUND_SPEED, Gas, Jet
from granular.sph.material import Viscoplastic
from granular.sph.numerics import Numerics
from granular.sph.walls import ParticleWall
from granular.tools.checks import in_range, non_negative, positive

LAYERS = 5
"""Layers of particles in a wall, as in the thesis."""
bed_soil = Viscoplastic(rho0=1600.0, mu_l=0.8, mu_h=0.8)
"""Soil of the thesis (section 6.2.2)."""


wide = Numerics(smoothing=1.5)
"""Numerics with a wider kernel, which the gas needs, and half the largest viscosity.

With the full viscosity beds never come to rest, and their noise is passed to the gas.
"""


@scene_function("sph")
def fluidised_bed(
    *,
    velocity: float = 0.15,
    height: float = 0.1,
    plenum: float = 0.12,
    freeboard: float = 0.05,
    spacing: float = 0.01,
    columns: int = 5,
    columns_across: int = 0,
    gravity: float = 9.81,
    pressure: float = 1e5,
    sound_speed: float = 100.0,
    permeability: float = 2e-10,
    viscosity: float = 1e-5,
    duration: float = 0.3,
    material: Viscoplastic = bed_soil,
    numerics: Numerics | None = None,
    **material_numbers: Any,
) -> Parts:
    """Bed on a sieve through which a piston below presses gas; periodic sides, open above.

    The pressure gradient of Darcy's law carries the bed if the volume flux of the gas exceeds
    k/eta (1 - e) (rho_s - rho_g) g, the minimum velocity of fluidisation.

    Parameters
    ----------
    velocity : float
        Velocity of the piston and so of the gas below the sieve [m/s], >= 0; the distance velocity
        times duration must not exceed the plenum.
    height, plenum, freeboard : float
        Heights of the bed, of the gas between piston and sieve, and of the gas above the bed [m];
        whole spacings.
    spacing : float
        Spacing of the particles of the material, the walls and the gas [m].
    columns, columns_across : int
        Number of particles along the two horizontal axes; 0 across is for 2D.
    gravity : float
        Its magnitude [m/s2]; it grows from zero within the first 20 ms.
    pressure, sound_speed, permeability, viscosity : float
        See `Gas`. The default speed of sound is low, 100 m/s, so that the time steps are longer;
        the density of the gas is then 10 kg/m3.
    material, numerics
        By default 1600 kg/m3, friction 0.8; h = 1.5 spacings, half the largest viscosity.
    {common}.
    """
    spacing = positive("spacing", spacing)
    parts = {"height": height, "plenum": plenum, "freeboard": freeboard}
    counts = {name: whole_cells(name, part, spacing) for name, part in parts.items()}
    velocity = non_negative("velocity", velocity)
    duration = positive("duration", duration)
    if velocity * duration > plenum:
        raise ValueError(
            f"velocity = {velocity} must be at most {plenum / duration}, plenum/duration"
        )
    level = level_cells(columns, columns_across)
    axis, still = len(level), (0.0,) * len(level)
    ends = tuple(n * spacing for n in level)
    sieve = (counts["plenum"] + LAYERS) * spacing
    top = (counts["plenum"] + LAYERS + counts["height"]) * spacing
    rows = sum(counts.values()) + LAYERS
    return Parts(
        **block(
            spacing,
            (*level, rows + counts["plenum"]),
            (*ends, top),
            base=(*still, sieve),
            periodic=range(axis),
        ),
        numerics=numerics or wide,
        walls=(
            ParticleWall(axis, 0.0, 1, layers=LAYERS, velocity=(*still, velocity)),
            ParticleWall(axis, sieve, 1, layers=LAYERS, permeable=True),
        ),
        gas=Gas(
            fills=(Fill(Box((*still, 0.0), (*ends, rows * spacing)), 1),),
            pressure=pressure,
            sound_speed=sound_speed,
            permeability=permeability,
            viscosity=viscosity,
        ),
        gravity=gravity_down(axis + 1, gravity, 0.02),
        parameters={"duration": duration},
    )


@scene_function("sph")
def jet_on_bed(
    *,
    speed: float = 100.0,
    width: float = 0.5,
    depth: float = 0.25,
    headroom: float = 0.15,
    nozzle: float = 0.1,
    across: float = 0.0,
    spacing: float = 0.01,
    gravity: float = 3.711,
    pressure: float = 1e5,
    sound_speed: float = 300.0,
    permeability: float = 2e-10,
    viscosity: float = 1e-5,
    duration: float = 0.075,
    material: Viscoplastic = bed_soil,
    numerics: Numerics | None = None,
    **material_numbers: Any,
) -> Parts:
    """Jet of gas directed at a bed (Hurley, thesis, section 6.2.2, figure 6.2).

    From the thesis: 0.5 m wide and 0.1 m across, both periodic, 0.25 m of soil on an impermeable
    floor; rho0 1600 kg/m3, friction 0.8, permeability 2e-10 m2, gravity 3.711 m/s2, an ideal gas of
    10 uPa s driven at 100 m/s downward, Darcy's drag up to a porosity of 0.38; the first 75 ms.

    Chosen here, where the thesis states nothing: an ambient pressure of 1e5 Pa and a speed of sound
    of 300 m/s, neither of them artificial; grains of 2500 kg/m3, so that the porosity of the soil
    is 0.36; gas up to 0.15 m above the soil. The nozzle is a box 0.1 m wide and two thirds as high
    below the top of the gas, in which the gas is driven. Gas of the initial density enters at its
    upper end, and gas that rises higher leaves: as much as enters, once the jet is steady. The
    scene is 2D unless `across` is positive.

    Parameters
    ----------
    speed : float
        Speed of the gas in the nozzle [m/s], > 0 and below the speed of sound.
    width, depth, headroom : float
        Width of the domain, depth of the soil, height of the gas above it [m]; whole spacings.
    nozzle : float
        Width of the nozzle [m], at least a spacing and at most the width of the domain.
    across : float
        Extent along the second horizontal axis [m], whole spacings; 0 for 2D.
    spacing : float
        Spacing of the particles of the material, the walls and the gas [m].
    pressure : float
        Initial and ambient pressure of the gas [Pa], > 0.
    sound_speed, permeability, viscosity : float
        See `Gas`.
    material, numerics
        By default those of the thesis; h = 1.5 spacings, half the largest viscosity.
    {common}.
    """
    spacing = positive("spacing", spacing)
    columns = whole_cells("width", width, spacing)
    soil = whole_cells("depth", depth, spacing)
    above = whole_cells("headroom", headroom, spacing)
    level = (columns, *cells_across("across", across, spacing))
    in_range("nozzle", nozzle, spacing, width)
    sound_speed = in_range("sound_speed", sound_speed, *SOUND_SPEED)
    in_range("speed", speed, 0.0, sound_speed, open_high=True, open_low=True)
    density = positive("pressure", pressure) / sound_speed**2
    axis, still = len(level), (0.0,) * len(level)
    ends, top = tuple(n * spacing for n in level), (soil + above) * spacing
    low = max(top - 2.0 / 3.0 * nozzle, soil * spacing)
    middle = 0.5 * width
    box = Box((middle - 0.5 * nozzle, *still[1:], low), (middle + 0.5 * nozzle, *ends[1:], top))
    return Parts(
        **block(spacing, (*level, soil + above), (*ends, soil * spacing), periodic=range(axis)),
        numerics=numerics or wide,
        walls=(ParticleWall(axis, 0.0, 1, layers=LAYERS),),
        gas=Gas(
            fills=(Fill(Box((*still, 0.0), (*ends, top)), 1, density=density),),
            pressure=pressure,
            sound_speed=sound_speed,
            permeability=permeability,
            viscosity=viscosity,
            jets=(Jet(box, (*still, -speed), density),),
        ),
        parameters={"duration": duration},
    )

"""Friction angles in plane strain, and Rankine's pressure on a smooth wall with each.

The laws bound the shear stress by the pressure, tau <= mu p with tau = sqrt(s:s/2). Without
dilation their plastic flow preserves the volume. In plane strain the flow then has no deviatoric
stress out of the plane, so that Mohr's circle has the centre p and the radius mu p. Two angles
follow:

- Where stress and strain rate are coaxial and the strain is uniform, the ratio of the principal
  stresses is that of the circle: ``sin(phi) = mu``.
- A shear band slides along itself and does not widen. Coaxial flow without dilation has its
  principal axes at 45 degrees to the band, where the normal stress is p and the shear stress mu p:
  ``tan(phi) = mu``. It is the angle of Davis (1968, in Soil Mechanics: Selected Topics, eds. Lee,
  Butterworth), ``tan(phi*) = sin(phi) cos(psi)/(1 - sin(phi) sin(psi))``, for the dilation
  psi = 0.

The lower angle is that of slopes, too: a layer on an incline is sheared along its base and yields
at tan(phi) = mu.

With dilation flow at the rate gdot along the deviator has the volume psi gdot, a third of it along
each axis. That there is no strain out of the plane takes the deviatoric stress -2 psi tau/3 there.
Mohr's circle of the plane then has the centre p - psi tau/3 and the radius r tau, r = sqrt(1 -
psi^2/3), and the plane has all of the volume: ``sin(phi) = r mu/(1 - mu psi/3)`` and ``sin(nu) =
psi/r`` for the angle of dilation nu. They are equal where psi = mu, as of associated flow.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from granular.tools.checks import in_range


@dataclass(frozen=True, kw_only=True)
class EarthPressure:
    """Friction angles of a law, and coefficients of earth pressure with them.

    A coefficient is the ratio of the horizontal to the vertical stress in level ground next to a
    smooth upright wall (Rankine): tan(45 deg + phi/2)^2 if the wall is pushed into the ground
    (passive), and the inverse if it gives way (active).

    Attributes
    ----------
    coaxial_deg, band_deg : float
        Friction angle of uniform coaxial plane strain, and that of a shear band [deg].
    triaxial_deg : float
        Friction angle of triaxial compression [deg], where the larger principal stress is along the
        axis: ``sin(phi) = 3 mu/(2 sqrt(3) + mu)``, as tau = (s1 - s3)/sqrt(3) there. It is less
        than the others: the friction is lower in a tall falling cylinder than in plane strain.
    dilation_deg : float
        Angle of dilation nu in plane strain [deg].
    passive_coaxial, passive_band : float
        Passive coefficients with these angles. The force on a smooth wall that is pushed is between
        them: bands form in the ground, but the flow is not in bands alone.
    active_coaxial, active_band : float
        Active coefficients.
    """

    coaxial_deg: float
    band_deg: float
    triaxial_deg: float
    dilation_deg: float
    passive_coaxial: float
    passive_band: float
    active_coaxial: float
    active_band: float


def earth_pressure(mu: float, dilation: float = 0.0) -> EarthPressure:
    """Friction angles and coefficients of earth pressure for a friction coefficient tau/p.

    Parameters
    ----------
    mu : float
        Friction coefficient of the law, such as `mu_s`, 0 to 1 (1 not included: beyond it no
        coaxial state of plane strain is at yield without tension). At the peak of material that
        dilates it includes the dilation, as `DilatantMuI.peak_friction`.
    dilation : float
        Rate of the volume over that of the shear psi, -0.9 to 0.9, negative of loose material: of
        `DilatantMuI` the friction at the peak less `mu_s`.

    Raises
    ------
    TypeError, ValueError
        If `mu` and `dilation` are not numbers in these ranges, or no state is at yield with them.
    """
    mu = in_range("mu", mu, 0.0, 1.0, open_high=True)
    dilation = in_range("dilation", dilation, -0.9, 0.9)
    root = math.sqrt(1.0 - dilation**2 / 3.0)
    sine, widening = root * mu / (1.0 - mu * dilation / 3.0), dilation / root
    if sine >= 1.0:
        raise ValueError(f"dilation = {dilation} must be less with mu = {mu}: phi would be 90 deg")
    coaxial = math.asin(sine)
    band = math.atan2(math.sqrt(1.0 - widening**2) * sine, 1.0 - widening * sine)
    passive = [math.tan(math.pi / 4 + angle / 2) ** 2 for angle in (coaxial, band)]
    return EarthPressure(
        coaxial_deg=math.degrees(coaxial),
        band_deg=math.degrees(band),
        triaxial_deg=math.degrees(math.asin(3.0 * mu / (2.0 * math.sqrt(3.0) + mu))),
        dilation_deg=math.degrees(math.asin(widening)),
        passive_coaxial=passive[0],
        passive_band=passive[1],
        active_coaxial=1 / passive[0],
        active_band=1 / passive[1],
    )

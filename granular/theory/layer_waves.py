"""Growth or decay of small waves in a layer flowing down an incline.

The equations of the elastic-plastic mu(I) material are linearised about the steady flow (Dunatunga
& Kamrin 2015, eqs 2.8-2.15 with eq. 4.6), in 2D, with a free surface and a rough base. Barker et
al. 2015 analyse the incompressible law locally, where the shortest waves decide. Here waves have a
finite length, and the layer has a depth, boundaries and a compressibility.
"""

import math
from dataclasses import dataclass

import numpy as np
import scipy
from numpy.typing import NDArray

from granular.materials import MuI
from granular.model.gravity import EARTH
from granular.theory.constitutive import stress_rate
from granular.theory.incline import check_mu_I
from granular.tools.arrays import Array
from granular.tools.checks import integer, positive

_XX, _YY, _XY = 0, 1, 3
_STEP = 1e-6
"""Relative step of the finite differences that linearise the law."""


@dataclass(frozen=True)
class LayerWaves:
    """Waves exp(i k x + s t) of one length in a layer, in order of decreasing growth rate.

    Attributes
    ----------
    growth : ndarray
        Growth rates, the real parts of s [1/s].
    frequency : ndarray
        Frequency at a fixed position [Hz], negative if the wave moves up the slope.
    """

    growth: Array
    frequency: Array


def layer_waves(
    angle_deg: float,
    height: float,
    material: MuI,
    wavelength: float,
    gravity: float = EARTH,
    cells: int = 60,
) -> LayerWaves:
    """Growth of waves along the slope in a steady flow.

    Velocities are given at the faces of `cells` equal cells over the depth, stresses in the middle
    of the cells. This scheme has no numerical damping, and is of first order at the surface. Waves
    shorter than about twelve cells are not resolved, and may grow where the exact ones do not.

    Parameters
    ----------
    angle_deg : float
        Inclination [degrees], between atan(mu_s) and atan(mu_2).
    height, wavelength : float
        Thickness of the layer and length of the wave [m], > 0.
    material : MuI
        Or any object with ``mu_s``, ``mu_2``, ``xi`` [1/sqrt(kg/m)], ``rho_c`` [kg/m3], ``K``,
        ``G`` [Pa] and ``wave_speed`` [m/s].
    cells : int
        Number of cells over the depth, 4 to 1000.

    Returns
    -------
    LayerWaves
        All 6 `cells` + 1 waves.

    Raises
    ------
    TypeError, ValueError
        If there is no steady flow, an argument is out of range, or the material has a cohesion or
        another law than mu(I).
    """
    check_mu_I(material)
    height, wavelength = positive("height", height), positive("wavelength", wavelength)
    cells, slope = integer("cells", cells, 4, 1000), math.tan(math.radians(angle_deg))
    if not material.mu_s < slope < material.mu_2:
        low, high = (math.degrees(math.atan(mu)) for mu in (material.mu_s, material.mu_2))
        raise ValueError(f"angle_deg = {angle_deg} must be between {low:.4g} and {high:.4g}")
    g = gravity * math.cos(math.radians(angle_deg))
    system = _system(slope, g, height, material, 2 * math.pi / wavelength, cells)
    s = scipy.linalg.eigvals(system)
    s = s[np.argsort(-s.real)]
    return LayerWaves(growth=s.real, frequency=-s.imag / (2 * math.pi))


def _steady(p: float, slope: float, material: MuI) -> tuple[Array, float]:
    """Stress [Pa] and shear rate [1/s] of the steady flow under the normal stress `p`.

    The Jaumann rate causes small differences between the normal stresses, so that only sigma_yy is
    known in advance.
    """
    plain = material.xi * math.sqrt(p) * (slope - material.mu_s) / (material.mu_2 - slope)

    def stress(q: Array) -> Array:
        return np.array([q[0] * p, -p, q[1] * p, slope * p])

    def unsteady(q: Array) -> Array:
        rate = stress_rate(stress(q), np.array([[0.0, q[2] * plain], [0.0, 0.0]]), material)
        return rate[[0, 2, 3]] / (material.G * plain)

    q = scipy.optimize.fsolve(unsteady, np.array([-1.0, -1.0, 1.0]), xtol=1e-9)
    return stress(q), float(q[2]) * plain


def _linear(stress: Array, shear: float, p: float, material: MuI) -> tuple[Array, Array]:
    """Derivatives of the stress rate by stress, (4, 4), and by velocity gradient, (4, 2, 2)."""
    L = np.array([[0.0, shear], [0.0, 0.0]])
    by_stress, by_gradient = np.empty((4, 4)), np.empty((4, 2, 2))
    for c in range(4):
        d = np.zeros(4)
        d[c] = _STEP * p
        change = stress_rate(stress + d, L, material) - stress_rate(stress - d, L, material)
        by_stress[:, c] = change / (2 * d[c])
    for i in range(2):
        for j in range(2):
            d = np.zeros((2, 2))
            d[i, j] = _STEP * shear
            change = stress_rate(stress, L + d, material) - stress_rate(stress, L - d, material)
            by_gradient[:, i, j] = change / (2 * d[i, j])
    return by_stress, by_gradient


def _system(
    slope: float, g: float, height: float, material: MuI, k: float, n: int
) -> NDArray[np.complex128]:
    """Matrix of the linear system of time derivatives.

    The unknowns are, in this order, (u, v) at the faces, stresses / (rho c_w) in the middle of the
    cells, and the elevation of the surface.
    """
    dy, rho = height / n, material.rho_c
    impedance = rho * material.wave_speed
    depth = height - (np.arange(n) + 0.5) * dy
    base, shear = zip(*(_steady(rho * g * d, slope, material) for d in depth), strict=True)
    stress, rate = np.array(base), np.array(shear)
    v_face = np.cumsum(rate) * dy
    v_middle = v_face - rate * dy / 2
    lapse = np.gradient(stress, dy, axis=0)

    A = np.zeros((6 * n + 1, 6 * n + 1), dtype=complex)
    u, v, lift = np.arange(n), n + np.arange(n), 6 * n
    sigma = 2 * n + np.arange(4 * n).reshape(4, n)

    def balance_momentum(j: int) -> None:
        """Rows of the velocities at the face above cell j."""
        top = j == n - 1
        for row, along, across in ((u[j], _XX, _XY), (v[j], _XY, _YY)):
            A[row, row] -= 1j * k * v_face[j]
            for c in (j,) if top else (j, j + 1):
                A[row, sigma[along, c]] += 0.5j * k * impedance / rho
            A[row, sigma[across, j]] -= (2 if top else 1) / dy * impedance / rho
            if not top:
                A[row, sigma[across, j + 1]] += impedance / rho / dy
        A[u[j], v[j]] -= rate[j] if top else (rate[j] + rate[j + 1]) / 2

    def apply_law(j: int) -> None:
        """Rows of the stresses of cell j."""
        by_stress, by_gradient = _linear(stress[j], rate[j], rho * g * depth[j], material)
        for a in range(4):
            row = sigma[a, j]
            A[row, row] -= 1j * k * v_middle[j]
            A[row, sigma[:, j]] += by_stress[a]
            for face, sign in ((j, 1), (j - 1, -1))[: 2 if j else 1]:  # the base is at rest
                for i, w in enumerate((u, v)):
                    part = 0.5j * k * by_gradient[a, i, 0] + sign / dy * by_gradient[a, i, 1]
                    A[row, w[face]] += part / impedance
                A[row, v[face]] -= lapse[j, a] / 2 / impedance

    for j in range(n):
        balance_momentum(j)
        apply_law(j)
    # The boundary condition sigma n = 0 holds at the displaced surface.
    A[u[-1], lift] += 2 / dy * g * slope
    A[v[-1], lift] -= 2 / dy * g
    A[lift, lift] -= 1j * k * v_face[-1]
    A[lift, v[-1]] += 1
    return A

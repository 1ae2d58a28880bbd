"""Diffusion of the fluidity in rings: decay of Bessel functions, and conservation."""

import math

import numpy as np
import pytest
from oracle_fluidity import LINKED, OPEN, ROUGH, diffuse
from scipy import optimize, special

DIFFUSIVITY = 0.01


def mode(inner, outer):
    """Wave number and values of the slowest mode that vanishes at rough walls, not at an axis."""
    if not inner:
        k = special.jn_zeros(0, 1)[0] / outer
        return k, lambda r: special.j0(k * r)

    def cross(k):
        return special.j0(k * inner) * special.y0(k * outer) - special.y0(k * inner) * special.j0(
            k * outer
        )

    k = optimize.brentq(cross, 2.5, 3.5)
    ratio = special.j0(k * outer) / special.y0(k * outer)
    return k, lambda r: abs(special.j0(k * r) - ratio * special.y0(k * r))


def decay_error(cells, stencil, method, inner):
    """Error of the decay in two tenths of the time constant, over the largest fluidity."""
    rows, outer, dx = 4, inner + 1.0, 1.0 / cells
    k, values = mode(inner, outer)
    g = np.tile(values(inner + (np.arange(cells) + 0.5) * dx), (rows, 1))
    faces = np.full((4, rows, cells), LINKED, dtype=np.uint8)
    faces[0, :, 0] = ROUGH if inner else OPEN
    faces[1, :, -1] = ROUGH
    faces[2, 0] = faces[3, -1] = OPEN
    time = 0.2 / (DIFFUSIVITY * k**2)
    steps = math.ceil(4 * time * DIFFUSIVITY / dx**2) + 8
    found, _ = diffuse(
        g, faces=faces, method=method, stencil=stencil, dx=dx, A=1.0, d=math.sqrt(DIFFUSIVITY),
        t0=1.0, dt=time / steps, steps=steps, first_radius=inner / dx,
    )  # fmt: skip
    return abs(found - g * math.exp(-0.2)).max() / abs(g).max()


@pytest.mark.parametrize("inner", [0.0, 0.5])
@pytest.mark.parametrize("method", ["explicit", "implicit", "rkl2"])
@pytest.mark.parametrize("stencil", ["faces", "isotropic"])
def test_bessel_functions_decay_at_their_rate(stencil, method, inner):
    errors = [decay_error(cells, stencil, method, inner) for cells in (8, 16)]
    assert errors[1] < 5e-3
    assert math.log2(errors[0] / errors[1]) > 1.65


@pytest.mark.parametrize("stencil", ["faces", "isotropic"])
def test_the_fluidity_of_rings_is_conserved(stencil):
    """A ring gains as much as others lose, by their circumferences."""
    rng = np.random.default_rng(0)
    dense, r = rng.random((6, 9)) > 0.2, 3.5 + np.arange(9)
    g = np.where(dense, rng.random((6, 9)), 0.0)
    found, _ = diffuse(g, dense=dense, stencil=stencil, dt=1e-3, steps=3, first_radius=3.0)
    assert abs(found - g).max() > 0.1
    assert (found * r).sum() == pytest.approx((g * r).sum(), rel=1e-13)

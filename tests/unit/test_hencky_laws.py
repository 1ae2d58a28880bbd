"""Finite-strain laws at the points of the engine: Cauchy stress, substeps, gains of fluidity."""

import numpy as np
import oracle_hencky as oracle
import pytest
from oracle_fluidity import available

from granular import _core

FLOW_OF = {
    "hencky_elastic": ("elastic", "elastic"),
    "hencky_drucker_prager": ("drucker_prager", "drucker_prager"),
    "hencky_mu_I": ("mu_I", "mu_I"),
    "hencky_linear_mu_I": ("linear_mu_I", "linear_mu_I"),
    "hencky_ngf": ("ngf", "mu_I"),
    "hencky_linear_ngf": ("linear_ngf", "linear_mu_I"),
}
"""Flow rule of each law, and that of its local phase."""
PARAMETERS = oracle.SAND | {"A": 0.48, "reconnect_fluidity": 0.0}


def parameters(law):
    sizes = PARAMETERS["d"] * np.sqrt(PARAMETERS["rho_s"])
    known = PARAMETERS | {"mu": PARAMETERS["mu_s"], "xi": PARAMETERS["I0"] / sizes}
    return {name: known[name] for name, _, _ in _core.laws()[law][1]}


@pytest.mark.parametrize("local", [False, True])
@pytest.mark.parametrize("isa", available())
@pytest.mark.parametrize("law", FLOW_OF)
def test_the_law_is_the_kernel_with_cauchy_stress(law, dim, isa, local):
    """Cauchy stress is rho/rho_c times Kirchhoff stress, before the step and after it."""
    nonlocal_law = "ngf" in law
    flow = FLOW_OF[law][local or not nonlocal_law]
    lanes, blocks, dt = _core.build_info(isa)["lanes"], 5, 1e-4
    n = blocks * lanes
    rng = np.random.default_rng(dim)
    step = np.zeros((n, 3, 3))
    step[:, :dim, :dim] = rng.normal(size=(n, dim, dim)) * 1e-3
    c = rng.uniform(-1e-3, 3e-3, n)
    before = c + np.trace(step, axis1=1, axis2=2)
    h = rng.normal(size=(n, 3, 3)) * 1e-4
    if dim == 2:
        h[:, 2, :2] = h[:, :2, 2] = 0
    kirchhoff = 2 * PARAMETERS["G"] * oracle.deviator(h + h.swapaxes(1, 2))
    kirchhoff -= (PARAMETERS["K"] * before)[:, None, None] * np.eye(3)
    kirchhoff[before <= 0] = 0
    rate, g_star = rng.uniform(0, 5, n), rng.uniform(0, 3, blocks)
    spread = np.repeat(g_star, lanes)
    expected, g, rates = oracle.update(
        flow, PARAMETERS, dt, step, c, kirchhoff, spread, rate, dim=dim, isa=isa
    )
    rows = oracle.components(kirchhoff * np.exp(before)[:, None, None], dim)
    gradient = oracle.gradients(step, dim).reshape(dim * dim, blocks, lanes).swapaxes(0, 1)
    found, shear = np.full(n, 7.0), rate.copy()
    extra = (None if local or not nonlocal_law else g_star, found)
    _core.law_update(
        law,
        dim,
        parameters(law),
        dt,
        1,
        np.ascontiguousarray(gradient),
        c,
        rows,
        shear,
        isa,
        *extra,
    )
    cauchy = oracle.components(expected * np.exp(c)[:, None, None], dim)
    np.testing.assert_allclose(rows, cauchy, rtol=1e-12, atol=1e-9)
    np.testing.assert_allclose(shear, rates, rtol=1e-11, atol=1e-11)
    if nonlocal_law:
        np.testing.assert_allclose(found, g, rtol=1e-11, atol=1e-11)

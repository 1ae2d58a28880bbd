"""Points of `granular.DilatantMuI` driven through the law of the core, and its rate equations."""

import copy
import math
from typing import NamedTuple

import numpy as np
import scipy

from granular import _core
from granular.verify.constitutive import law_parameters

COMPONENTS = ((0, 1, 2, 0, 1, 0), (0, 1, 2, 1, 2, 2))
"""Rows and columns of the components xx, yy, zz, xy, yz, xz of a stress."""


class Point:
    """Points of a material, all at one packing fraction and one pressure at first.

    Attributes
    ----------
    stress, c, bulking, rate : ndarray
        As of the core: (4 or 6, n), (n,); the plastic shear rate of the last step [1/s].
    """

    def __init__(self, material, packing, p, *, dim=2, n=1, isa=""):
        self.material, self.dim, self.isa = material, dim, isa
        lanes = _core.build_info(isa)["lanes"]
        self.n, self._places = n, -(-n // lanes) * lanes
        self.stress = np.zeros((4 if dim == 2 else 6, self._places))
        self.stress[:3] = -p
        self.c = np.full(self._places, p / material.K)
        self.bulking = np.ones(self._places)
        self.bulking[:n] = material.phi_c / packing
        self.rate = np.zeros(self._places)

    def step(self, Ldt, dt):
        """Advance by L dt, shape (dim, dim) or (n, dim, dim)."""
        lanes = _core.build_info(self.isa)["lanes"]
        whole = np.zeros((self._places, self.dim * self.dim))
        whole[: self.n] = np.broadcast_to(Ldt, (self.n, self.dim, self.dim)).reshape(self.n, -1)
        packed = np.ascontiguousarray(
            whole.T.reshape(-1, self._places // lanes, lanes).swapaxes(0, 1)
        )
        self.c -= np.trace(whole.reshape(-1, self.dim, self.dim), axis1=1, axis2=2)
        _core.law_update(
            self.material.law, self.dim, law_parameters(self.material), dt, 1, packed, self.c,
            self.stress, self.rate, self.isa, None, None, None, None, self.bulking,
        )  # fmt: skip

    @property
    def packing(self):
        return self.material.phi_c / self.bulking[: self.n]

    @property
    def p(self):
        return -self.stress[:3, : self.n].sum(axis=0) / 3

    @property
    def tau(self):
        s = self.stress[:, : self.n].copy()
        s[:3] += self.p
        return np.sqrt(0.5 * (s[:3] ** 2).sum(axis=0) + (s[3:] ** 2).sum(axis=0))


def critical_packing(material, p):
    """By the void ratio, e_c = e_0 - slope (p/p_a)^exponent with p_a = 101325 Pa."""
    e_0 = 1 / material.phi_c - 1
    return 1 / (1 + e_0 - material.csl_slope * (p / 101325) ** material.csl_exponent)


def rates(material, packing, p, tau):
    """Plastic shear rate [1/s] and psi at a stress, from the equations of the class."""
    m, p = material, max(p, 1e-3)  # scipy tries states beyond
    critical = critical_packing(m, p)
    psi = m.dilatancy * (packing - critical)
    loosens = m.dilatancy * (critical - m.phi_fast)
    share = (tau / p - m.mu_s - psi) / (m.mu_2 - m.mu_s + loosens)
    if share <= 0:
        return 0.0, psi
    share = min(share, 0.999)
    inertial = m.I0 * share / (1 - share)
    return inertial / m.d * np.sqrt(p / m.rho_s), psi + loosens * share


def tensor_rates(material, stress, log_packing, L):
    """Rates of a Cauchy stress, shape (3, 3), and of ln(phi) at a velocity gradient L [1/s].

    Without the elastic part the stress rate is that of Jaumann; p = K c with Dc = -tr D + psi g.
    """
    D, W = (L + L.T) / 2, (L - L.T) / 2
    p = -np.trace(stress) / 3
    s = stress + p * np.eye(3)
    tau = math.sqrt((s * s).sum() / 2)
    plastic, psi = rates(material, math.exp(min(log_packing, 0.0)), p, tau)
    deviator = D - np.trace(D) / 3 * np.eye(3) - plastic / (2 * max(tau, 1e-9)) * s
    p_rate = material.K * (psi * plastic - np.trace(D))
    rate = 2 * material.G * deviator - p_rate * np.eye(3) + W @ s - s @ W
    return rate, -psi * plastic


def _tensor(components):
    """Symmetric tensors, shape (..., 3, 3), of components of the shape (6, ...), or (4, ...)."""
    components = np.asarray(components)
    tensor, count = np.zeros((*components.shape[1:], 3, 3)), len(components)
    rows, columns = COMPONENTS
    tensor[..., rows[:count], columns[:count]] = np.moveaxis(components, 0, -1)
    tensor[..., columns[:count], rows[:count]] = np.moveaxis(components, 0, -1)
    return tensor


class Element(NamedTuple):
    """An element test: L = gdot (given + x free), with x such that kept : stress is constant.

    Tensors have the shape (3, 3); without `free` and `kept`, L = gdot given.
    """

    given: np.ndarray
    free: np.ndarray | None = None
    kept: np.ndarray | None = None


def exact(material, packing, p, gdot, test, times):
    """Stress, shape (n, 3, 3), and packing at times of an element test, by scipy's Radau.

    The rate of the stress is affine in L, so that x is the solution of one linear equation.
    """

    def flow(_, y):
        stress = _tensor(y[:6])
        rate, packs = tensor_rates(material, stress, y[6], gdot * test.given)
        if test.free is not None:
            more, _ = tensor_rates(material, stress, y[6], gdot * (test.given + test.free))
            by_x = more - rate
            rate = rate - (test.kept * rate).sum() / (test.kept * by_x).sum() * by_x
        return np.concatenate([rate[COMPONENTS], [packs]])

    start = np.concatenate([-p * np.eye(3)[COMPONENTS], [math.log(packing)]])
    scale = np.array([p * 1e-9] * 6 + [1e-12])
    with np.errstate(divide="ignore"):  # Radau, where its error is 0: an elastic path
        found = scipy.integrate.solve_ivp(
            flow, (0.0, times[-1]), start, method="Radau", t_eval=times, rtol=1e-8, atol=scale
        )
    return _tensor(found.y[:6]), np.exp(found.y[6])


class Path(NamedTuple):
    """Of points in an element test after every step: stress, packing, and L dt of the step."""

    stress: np.ndarray
    packing: np.ndarray
    strain: np.ndarray

    @property
    def p(self):
        return -np.trace(self.stress, axis1=2, axis2=3) / 3

    @property
    def tau(self):
        s = self.stress + self.p[..., None, None] * np.eye(3)
        return np.sqrt((s * s).sum(axis=(2, 3)) / 2)


def driven(material, packing, p, gdot, test, end, steps, *, dim=3, turn=None):
    """The path of points, one for each packing, through an element test by the core.

    x is found by the secant method at every step. `turn` is a rotation from the frame of the test
    to that of the core at the beginning and the end of a step.
    """
    packing = np.atleast_1d(packing)
    n, dt = len(packing), end / steps
    point = Point(material, packing, p, dim=dim, n=n)
    free = np.zeros((3, 3)) if test.free is None else test.free
    modulus = material.K + 4 * material.G / 3
    x, path = np.zeros(n), []

    def stepped(x, frame):
        after = copy.copy(point)
        for name in ("stress", "c", "bulking", "rate"):
            setattr(after, name, getattr(point, name).copy())
        L = gdot * dt * (test.given + x[:, None, None] * free)
        turned = frame[1] @ frame[0].T
        spin = (turned - turned.T) / 2
        after.step((frame[0] @ L @ frame[0].T + spin)[:, :dim, :dim], dt)
        return after, L, frame[1].T @ _tensor(after.stress[:, :n]) @ frame[1]

    for k in range(steps):
        frame = (np.eye(3), np.eye(3)) if turn is None else turn(k * dt, dt)
        after, L, stress = stepped(x, frame)
        old, wrong, tries = None, None, 0
        while test.kept is not None:
            excess = (test.kept * (stress + p * np.eye(3))).sum(axis=(1, 2))
            if (abs(excess) < 1e-9 * p).all():
                break
            slope = modulus * gdot * dt * (test.kept * free).sum()
            if old is not None:
                moved = x - old
                measured = (excess - wrong) / np.where(moved == 0, 1, moved)
                slope = np.where(measured > 0, measured, slope)
            old, wrong, x = x, excess, x - excess / slope
            after, L, stress = stepped(x, frame)
            tries += 1
            assert tries < 60, excess
        point = after
        path.append((stress, point.packing, L))
    return Path(*map(np.array, zip(*path, strict=True)))

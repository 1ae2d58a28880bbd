"""Points of `granular.DilatantMuI` driven through the law of the core, and its rate equations."""

import numpy as np

from granular import _core
from granular.verify.constitutive import law_parameters


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


def rates(material, packing, p, tau):
    """Plastic shear rate [1/s] and psi at a stress, from the equations of the class."""
    m, p = material, max(p, 1e-3)  # scipy tries states beyond
    psi = m.dilatancy * (packing - m.phi_c)
    loosens = m.dilatancy * (m.phi_c - m.phi_fast)
    share = (tau / p - m.mu_s - psi) / (m.mu_2 - m.mu_s + loosens)
    if share <= 0:
        return 0.0, psi
    share = min(share, 0.999)
    inertial = m.I0 * share / (1 - share)
    return inertial / m.d * np.sqrt(p / m.rho_s), psi + loosens * share

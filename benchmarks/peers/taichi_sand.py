"""The MLS-MPM in Taichi with the sand of computer graphics, as its public examples have it.

Elastic deformation gradients and their singular values, logarithmic strains, and the return to the
cone of Drucker and Prager at constant volume after Klar et al. (2016), "Drucker-Prager
elastoplasticity for sand animation", with the volume correction of Tampubolon et al. (2017). In two
dimensions its cone yields at the friction coefficient of plane strain.
"""

import math
from typing import Any

import numpy as np
import taichi as ti

import granular as gr
from peers import taichi_mpm
from peers.codes import Missing


class Simulation(taichi_mpm.Simulation):
    """As `taichi_mpm.Simulation`, for Drucker-Prager only.

    Raises
    ------
    Missing
        If the scene has another law, or features that the code lacks.
    """

    def __init__(self, scene: gr.Scene, *, threads: int = 1) -> None:
        if not isinstance(scene.material, gr.DruckerPrager) or scene.material.cohesion:
            raise Missing("taichi_sand: Drucker-Prager without cohesion only")
        super().__init__(scene, threads=threads)

    def _make(self, points: dict[str, np.ndarray]) -> Any:
        return Core(self.scene, points, self.dt)


@ti.data_oriented
class Core(taichi_mpm.Core):
    """The stress is Kirchhoff's, and belongs to the volume at rest: `log_density` is 0."""

    def __init__(self, scene: gr.Scene, points: dict[str, np.ndarray], dt: float) -> None:
        super().__init__(scene, points, dt)
        self.log_density.fill(0.0)
        self.lame = self.K - 2.0 * self.G / 3.0
        self.alpha = self.mu_s / math.sqrt(2.0)
        self.F = ti.Matrix.field(2, 2, ti.f64, self.n)
        self.correction = ti.field(ti.f64, self.n)
        pressure = -points["stress"][:, 1] if "stress" in points else np.zeros(self.n)
        stretch = np.exp(-0.5 * pressure / (self.lame + self.G))
        self.F.from_numpy(stretch[:, None, None] * np.eye(2))

    @ti.func
    def law(self, p, C):
        """Trial deformation, return of its logarithmic strains, stress."""
        U, sigma, V = ti.svd((ti.Matrix.identity(ti.f64, 2) + self.dt * C) @ self.F[p])
        half = 0.5 * self.correction[p]
        e = ti.Vector([ti.log(sigma[0, 0]) + half, ti.log(sigma[1, 1]) + half])
        trace = e.sum()
        deviator = e - 0.5 * trace
        length = deviator.norm() + 1e-300
        self.correction[p] = ti.max(trace, 0.0)
        if trace >= 0.0:
            e = ti.Vector([0.0, 0.0])
        else:
            excess = length + self.alpha * (self.lame + self.G) / self.G * trace
            e -= ti.max(excess, 0.0) / length * deviator
        stretch = ti.Matrix([[ti.exp(e[0]), 0.0], [0.0, ti.exp(e[1])]])
        self.F[p] = U @ stretch @ V.transpose()
        pull = self.lame * e.sum()
        principal = ti.Matrix(
            [[pull + 2.0 * self.G * e[0], 0.0], [0.0, pull + 2.0 * self.G * e[1]]]
        )
        tau = U @ principal @ U.transpose()
        self.stress[p] = ti.Vector([tau[0, 0], tau[1, 1], pull, tau[0, 1]])

"""Implicit MPM of Newton (`pip install newton`) on the CPU, in a slab one cell thick.

Its yield surface is tau <= friction p with the same tau as here. mu(I) enters as the friction of
each point, computed from its velocity gradient and stress of the previous step. Newton is
three-dimensional and has neither periodic sides nor walls that open, so that it can run the column
collapse only.
"""

from __future__ import annotations

import math
from typing import Any

import newton
import numpy as np
import warp as wp
from newton.solvers import SolverImplicitMPM

import granular as gr
from granular.mpm.engine import initial_points
from peers.codes import Missing

STEP = 0.4
"""Number of cells that a point at the speed of a fall through the height crosses in a step."""
LAYERS = 2
"""Number of points across the slab."""
ROUGH = 1e3
"""Friction of a wall to which material sticks."""


class Simulation:
    """Simulation with that part of the API of `granular.Simulation` that the benchmark needs.

    Parameters
    ----------
    scene : Scene
        A column collapse of mu(I) or Drucker-Prager.
    threads : int
        Must be 1.
    **settings
        `step` instead of `STEP`, and numbers of `SolverImplicitMPM.Config`.

    Raises
    ------
    Missing
        For scenes other than the column collapse.
    """

    def __init__(self, scene: gr.Scene, *, threads: int = 1, **settings: Any) -> None:
        if scene.name != "column_collapse" or threads != 1:
            raise Missing("newton: no periodic sides and no wall that opens")
        wp.config.quiet = True
        wp.init()
        wp.set_device("cpu")
        self.scene = scene
        self.time, self.steps = 0.0, 0
        height = scene.parameters["aspect"] * scene.parameters["half_width"]
        fastest = math.sqrt(2 * scene.parameters["gravity"] * height)
        self.dt = settings.pop("step", STEP) * scene.grid.cell / fastest
        self._rates = isinstance(scene.material, gr.MuI)
        points = initial_points(scene)
        self._mass = np.repeat(points["mass"] / LAYERS, LAYERS)
        self.n_points = len(self._mass)
        self._model = self._build(points["x"])
        config = SolverImplicitMPM.Config(voxel_size=scene.grid.cell, **settings)
        self._solver = SolverImplicitMPM(self._model, config=config)
        self._now, self._next = self._model.state(), self._model.state()
        self._step()  # compiles, which is a cost per process, not per run
        self.time, self.steps = 0.0, 0

    def _build(self, place: np.ndarray) -> newton.Model:
        """Model with the points in the x-z plane and the walls around them."""
        cell, material = self.scene.grid.cell, self.scene.material
        builder = newton.ModelBuilder()
        SolverImplicitMPM.register_custom_attributes(builder)
        depth = (np.arange(LAYERS) + 0.5) * cell / LAYERS
        x = np.repeat(place, LAYERS, axis=0)
        y = np.tile(depth, len(place))
        radius = 0.5 * math.sqrt(self._mass[0] * LAYERS / material.rho_c)
        builder.add_particles(
            pos=[wp.vec3(a, b, c) for (a, c), b in zip(x.tolist(), y.tolist(), strict=True)],
            vel=[wp.vec3(0.0)] * len(x),
            mass=(self._mass * cell).tolist(),
            radius=[radius] * len(x),
        )
        walls = (  # normal and distance of a plane; friction
            ((0.0, 0.0, 1.0, 0.0), ROUGH),
            ((1.0, 0.0, 0.0, 0.0), 0.0),
            ((0.0, 1.0, 0.0, 0.0), 0.0),
            ((0.0, -1.0, 0.0, cell), 0.0),
        )
        for plane, friction in walls:
            shape = newton.ModelBuilder.ShapeConfig(mu=friction, density=0.0)
            builder.add_shape_plane(plane=plane, width=0.0, length=0.0, cfg=shape)
        model = builder.finalize(device="cpu")
        model.mpm.young_modulus.fill_(material.E)
        model.mpm.poisson_ratio.fill_(material.nu)
        model.mpm.friction.fill_(material.mu_s if self._rates else material.mu)
        return model

    def _friction(self) -> np.ndarray:
        """mu(I) of every point (eq. 2.13) from its shear rate and pressure."""
        material = self.scene.material
        L = self._now.mpm.particle_qd_grad.numpy().astype(float)
        D = (L + L.transpose(0, 2, 1)) / 2
        D -= np.trace(D, axis1=1, axis2=2)[:, None, None] / 3 * np.eye(3)
        rate = np.sqrt(2 * np.sum(D**2, axis=(1, 2)))
        pressure = -np.trace(self._stress(), axis1=1, axis2=2) / 3
        scale = material.xi * np.sqrt(np.maximum(pressure, 0.0))
        share = rate / np.maximum(rate + scale, 1e-300)
        return material.mu_s + (material.mu_2 - material.mu_s) * share

    def _stress(self) -> np.ndarray:
        """Stress of every point, tension positive; in Newton it is positive in compression."""
        return -self._now.mpm.particle_stress.numpy().astype(float)

    def _step(self) -> None:
        ramp = self.scene.gravity.times[-1]
        share = min(self.time / ramp, 1.0) if ramp > 0 else 1.0
        self._model.set_gravity((0.0, 0.0, share * self.scene.gravity.vectors[-1][1]))
        if self._rates:
            self._model.mpm.friction.assign(self._friction().astype(np.float32))
        self._solver.step(self._now, self._next, None, None, self.dt)
        self._solver.project_outside(self._next, self._next, self.dt)
        self._now, self._next = self._next, self._now
        self.time += self.dt
        self.steps += 1

    def run(self, until: float) -> Simulation:
        """Run to the first step at or after a time."""
        while self.time < until:
            self._step()
        if not np.isfinite(self._now.particle_q.numpy()).all():
            raise gr.SimulationError("a position of the peer is not finite")
        return self

    @property
    def state(self) -> gr.State:
        """2D state of the points, seen from the side."""
        q, v = self._now.particle_q.numpy(), self._now.particle_qd.numpy()
        s = self._stress()
        fields = {
            "x": q[:, [0, 2]],
            "v": v[:, [0, 2]],
            "stress": np.stack([s[:, 0, 0], s[:, 2, 2], s[:, 1, 1], s[:, 0, 2]], axis=1),
            "mass": self._mass,
            "id": np.arange(self.n_points),
        }
        return gr.State(
            scene=self.scene,
            time=self.time,
            step=self.steps,
            dt=self.dt,
            fields={name: np.array(value, dtype=float) for name, value in fields.items()},
        )

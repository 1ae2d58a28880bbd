"""Explicit MLS-MPM in Taichi, a simple peer: quadratic splines, APIC, one thread.

It was written for this benchmark after Hu et al. (2018), "A moving least squares material point
method with displacement discontinuity and two-way rigid body coupling", in double precision. It has
the same law as the package (Dunatunga & Kamrin 2015, eqs 2.7, 3.10-3.16), the particle density and
the stress-free disconnected state. As usual in such codes, the velocities of nodes on and beyond a
wall are prescribed.
"""

import math
from functools import cache
from typing import Any

import numpy as np
import taichi as ti

import granular as gr
from granular.mpm.engine import initial_points
from peers.codes import Missing

PAD = 3
"""Number of cells around the domain, for the splines of points near its ends."""
CFL = 0.4
"""Time step, divided by dx/c."""
CHUNK = 2000
"""Number of steps per call."""


@cache
def _init() -> None:
    """Start Taichi, once in a process."""
    ti.init(
        arch=ti.cpu,
        cpu_max_num_threads=1,
        default_fp=ti.f64,
        fast_math=False,
        offline_cache=True,
        log_level=ti.ERROR,
    )


class Simulation:
    """Simulation with that part of the API of `granular.Simulation` that the benchmark needs.

    Parameters
    ----------
    scene : Scene
        A 2D scene; its scheme is ignored.
    threads : int
        Must be 1.
    hold_on_wall : bool
        Without it, a no-slip wall at the lower end of the domain holds the nodes beyond it only,
        and those on it are free: velocities then vanish closer to the wall.

    Raises
    ------
    Missing
        If the scene has features that this code lacks.
    """

    def __init__(self, scene: gr.Scene, *, threads: int = 1, hold_on_wall: bool = True) -> None:
        if threads != 1 or scene.grid.dim != 2 or scene.sponge_layers:
            raise Missing("taichi: one thread, 2D and no sponge layers only")
        _init()
        self.scene, self._on_wall = scene, hold_on_wall
        self.time, self.steps = 0.0, 0
        self.dt = CFL * scene.grid.cell / scene.material.wave_speed
        points = initial_points(scene)
        self._mass = points["mass"]
        self._core = self._make(points)
        self._hold()
        # Compiles all kernels, which is a cost per process, not per run.
        self._core.advance(0, 0.0)
        _ = self.state

    def _make(self, points: dict[str, np.ndarray]) -> Any:
        """The fields and the step."""
        return Core(self.scene, points, self.dt)

    @property
    def n_points(self) -> int:
        """Number of points that are still in the domain."""
        return int(np.count_nonzero(self._core.alive.to_numpy()))

    def _hold(self) -> None:
        """Velocity components prescribed by walls at present, and the time of the next change."""
        walls = [wall for wall in self.scene.walls if wall.opens_at > self.time]
        self._next = min((wall.opens_at for wall in walls), default=math.inf)
        self._core.hold.from_numpy(held(self.scene, walls, self._core.shape, self._on_wall))

    def run(self, until: float) -> "Simulation":
        """Run to the first step at or after a time."""
        while self.time < until:
            stop = min(until, self._next)
            n = min(max(math.ceil((stop - self.time) / self.dt - 1e-9), 1), CHUNK)
            self._core.advance(n, self.time)
            self.steps += n
            self.time += n * self.dt
            if self.time >= self._next:
                self._hold()
        if not np.isfinite(self._core.v.to_numpy()).all():
            raise gr.SimulationError("a velocity of the peer is not finite")
        return self

    @property
    def state(self) -> gr.State:
        """State of the points that are still in the domain."""
        core = self._core
        alive = core.alive.to_numpy() > 0
        grid = self.scene.grid
        x = core.x.to_numpy() + np.array(grid.lower)
        for d in np.flatnonzero(grid.periodic):
            x[:, d] = grid.lower[d] + (x[:, d] - grid.lower[d]) % (grid.shape[d] * grid.cell)
        fields = {
            "x": x,
            "v": core.v.to_numpy(),
            "stress": core.stress.to_numpy(),
            "log_density": core.log_density.to_numpy(),
            "mass": self._mass,
            "id": np.arange(len(x)),
        }
        fields = {name: np.array(value[alive]) for name, value in fields.items()}
        return gr.State(
            scene=self.scene, time=self.time, step=self.steps, dt=self.dt, fields=fields
        )


def held(scene: gr.Scene, walls: Any, shape: tuple[int, int], on_wall: bool = True) -> np.ndarray:
    """Array that is 1 where a wall prescribes a velocity component of a node.

    These nodes are on the line of the wall and, for a wall at an end of the domain, beyond it.
    Without `on_wall` a no-slip wall at a lower end holds those beyond it alone.
    """
    hold = np.zeros((*shape, 2), dtype=np.int32)
    grid = scene.grid
    place = [grid.lower[d] + (np.arange(shape[d]) - PAD) * grid.cell for d in range(2)]
    near = 1e-6 * grid.cell
    for wall in walls:
        along = 1 - wall.axis
        low, high = wall.extent(grid, along)
        if low <= grid.lower[along] + near:  # a wall to the end of the grid includes the corner
            low = -math.inf
        if high >= grid.upper[along] - near:
            high = math.inf
        if wall.at <= grid.lower[wall.axis] + near:
            free = wall.kind == "no_slip" and not on_wall
            across = place[wall.axis] <= wall.at + (-near if free else near)
        elif wall.at >= grid.upper[wall.axis] - near:
            across = place[wall.axis] >= wall.at - near
        else:
            across = np.abs(place[wall.axis] - wall.at) <= near
        within = (place[along] >= low - near) & (place[along] <= high + near)
        nodes = np.ix_(across, within) if wall.axis == 0 else np.ix_(within, across)
        for component in (0, 1) if wall.kind == "no_slip" else (wall.axis,):
            hold[(*nodes, component)] = 1
    return hold


@ti.data_oriented
class Core:
    """Fields and the step; positions are relative to the lower corner of the domain."""

    def __init__(self, scene: gr.Scene, points: dict[str, np.ndarray], dt: float) -> None:
        grid, material = scene.grid, scene.material
        n = self.n = len(points["mass"])
        self.dt, self.dx = dt, grid.cell
        self.shape = tuple(k + 2 * PAD + 1 for k in grid.shape)
        self.wrap = grid.shape[0] if grid.periodic[0] else 0
        self.floor = 1 if "y-" in grid.open_sides else 0
        self.K, self.G = material.K, material.G
        self.rho_c = material.rho_c
        if isinstance(material, gr.DruckerPrager):  # mu(I) whose two friction coefficients agree
            self.mu_s = self.mu_2 = material.mu
            self.xi = 1.0
        else:
            self.mu_s, self.mu_2, self.xi = material.mu_s, material.mu_2, material.xi
        if len(scene.gravity.times) > 2:
            raise Missing("taichi: gravity is one ramp only")
        self.ramp = scene.gravity.times[-1]
        self.gx, self.gy = scene.gravity.vectors[-1]
        self.x = ti.Vector.field(2, ti.f64, n)
        self.v = ti.Vector.field(2, ti.f64, n)
        self.C = ti.Matrix.field(2, 2, ti.f64, n)
        self.stress = ti.Vector.field(4, ti.f64, n)  # xx, yy, zz, xy
        self.log_density = ti.field(ti.f64, n)
        self.mass = ti.field(ti.f64, n)
        self.alive = ti.field(ti.i32, n)
        self.hold = ti.Vector.field(2, ti.i32, self.shape)
        self.node_v = ti.Vector.field(2, ti.f64, self.shape)
        self.node_m = ti.field(ti.f64, self.shape)
        self.x.from_numpy(points["x"] - np.array(grid.lower))
        self.log_density.from_numpy(points["log_density"])
        self.mass.from_numpy(points["mass"])
        self.alive.fill(1)
        if "stress" in points:
            self.stress.from_numpy(points["stress"])

    @ti.func
    def node(self, i):
        """Index of a node along x; a periodic one is wrapped."""
        k = i
        if ti.static(self.wrap > 0):
            k = (i - PAD) % self.wrap + PAD
        return k

    @ti.func
    def weights(self, p):
        """First node, distance to it in cells, quadratic weights."""
        place = self.x[p] / self.dx + PAD
        base = ti.cast(ti.floor(place - 0.5), ti.i32)
        f = place - base
        w = ti.Matrix.rows([0.5 * (1.5 - f) ** 2, 0.75 - (f - 1.0) ** 2, 0.5 * (f - 0.5) ** 2])
        return base, f, w

    @ti.func
    def scatter(self, p):
        base, f, w = self.weights(p)
        s = self.stress[p]
        volume = self.mass[p] / (self.rho_c * ti.exp(self.log_density[p]))
        sigma = ti.Matrix([[s[0], s[3]], [s[3], s[1]]])
        affine = self.mass[p] * self.C[p] - (4.0 * self.dt * volume / self.dx**2) * sigma
        for i, j in ti.static(ti.ndrange(3, 3)):
            distance = (ti.Vector([i, j]) - f) * self.dx
            weight = w[i, 0] * w[j, 1]
            a, b = self.node(base[0] + i), base[1] + j
            self.node_v[a, b] += weight * (self.mass[p] * self.v[p] + affine @ distance)
            self.node_m[a, b] += weight * self.mass[p]

    @ti.func
    def gather(self, p):
        base, f, w = self.weights(p)
        v = ti.Vector([0.0, 0.0])
        C = ti.Matrix([[0.0, 0.0], [0.0, 0.0]])
        for i, j in ti.static(ti.ndrange(3, 3)):
            distance = (ti.Vector([i, j]) - f) * self.dx
            node = self.node_v[self.node(base[0] + i), base[1] + j]
            weight = w[i, 0] * w[j, 1]
            v += weight * node
            C += (4.0 / self.dx**2) * weight * node.outer_product(distance)
        self.v[p] = v
        self.C[p] = C
        self.x[p] += self.dt * v
        self.law(p, C)
        if self.floor == 1 and self.x[p][1] < 0.0:
            self.alive[p] = 0

    @ti.func
    def law(self, p, C):
        """Trial stress with the Jaumann rate, disconnection, return to mu(I)."""
        dxx, dyy = C[0, 0] * self.dt, C[1, 1] * self.dt
        dxy, spin = 0.5 * (C[0, 1] + C[1, 0]) * self.dt, 0.5 * (C[0, 1] - C[1, 0]) * self.dt
        trace = dxx + dyy
        c = self.log_density[p] - trace
        self.log_density[p] = c
        s = self.stress[p]
        lame = (self.K - 2.0 * self.G / 3.0) * trace
        xx = s[0] + lame + 2.0 * self.G * dxx + 2.0 * spin * s[3]
        yy = s[1] + lame + 2.0 * self.G * dyy - 2.0 * spin * s[3]
        zz = s[2] + lame
        xy = s[3] + 2.0 * self.G * dxy + spin * (s[1] - s[0])
        pressure = -(xx + yy + zz) / 3.0
        if c < 0.0 or pressure <= 0.0:
            self.stress[p] = ti.Vector([0.0, 0.0, 0.0, 0.0])
        else:
            xx, yy, zz = xx + pressure, yy + pressure, zz + pressure
            tau = ti.sqrt(0.5 * (xx * xx + yy * yy + zz * zz) + xy * xy)
            low, high = self.mu_s * pressure, self.mu_2 * pressure
            k = 1.0
            if tau > low:
                alpha = self.xi * self.G * self.dt * ti.sqrt(pressure)
                total = high + tau + alpha
                root = ti.sqrt((tau - high + alpha) ** 2 + 4.0 * alpha * (high - low))
                k = 2.0 * (high + low * alpha / tau) / (total + root)
            self.stress[p] = ti.Vector(
                [k * xx - pressure, k * yy - pressure, k * zz - pressure, k * xy]
            )

    @ti.func
    def update(self, i, j, gravity):
        """Velocity of a node, with gravity and walls."""
        if self.node_m[i, j] > 0.0:
            v = self.node_v[i, j] / self.node_m[i, j] + self.dt * gravity
            for d in ti.static(range(2)):
                if self.hold[i, j][d] == 1:
                    v[d] = 0.0
            self.node_v[i, j] = v

    @ti.kernel
    def advance(self, steps: ti.i32, begin: ti.f64):
        # One serial loop: with one thread, parallel ones would only cost their launch.
        ti.loop_config(serialize=True)
        for k in range(steps):
            share = 1.0
            if ti.static(self.ramp > 0.0):
                share = ti.min((begin + k * self.dt) / self.ramp, 1.0)
            for i, j in ti.ndrange(self.shape[0], self.shape[1]):
                self.node_v[i, j] = ti.Vector([0.0, 0.0])
                self.node_m[i, j] = 0.0
            for p in range(self.n):
                if self.alive[p] == 1:
                    self.scatter(p)
            for i, j in ti.ndrange(self.shape[0], self.shape[1]):
                self.update(i, j, share * ti.Vector([self.gx, self.gy]))
            for p in range(self.n):
                if self.alive[p] == 1:
                    self.gather(p)

"""Plain discrete element method for discs and spheres: packings with known contact forces.

Reference for `granular.grain_scale.inference`, used by its tests and by the scripts in
`benchmarks`. Contacts have linear springs (the tangential one with memory and a Coulomb limit),
walls are free-slip, and several boxes are stored side by side in the same arrays. All vectors have
three components; in 2D the third stays zero.
"""

from dataclasses import dataclass, replace
from functools import cache

import numpy as np
from scipy.signal import filtfilt, firwin
from scipy.sparse import csr_array
from scipy.sparse.linalg import lsqr
from scipy.spatial import cKDTree

from granular.grain_scale.inference import OUTSIDE, Packing


def cross(a, b):
    """Cross products of rows; faster than `numpy.cross`."""
    (ax, ay, az), (bx, by, bz) = a.T, b.T
    return np.stack([ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx], axis=1)


class Grains:
    """Grains, each in a box of walls; with `load` the upper walls of the last axis are pistons.

    Walls are numbered -1 - 2 axis (lower) and -2 - 2 axis (upper); infinite walls are absent.
    Masses are per unit depth in 2D. `drag` [1/s] is the rate at which velocities decay.
    """

    def __init__(self, x, R, m, lower, upper, *, dim, kn, kt, mu, dt, damping=0.3, **options):
        n = len(x)
        self.x, self.R, self.m, self.dim = np.zeros((n, 3)), R, m, dim
        self.x[:, :dim] = x
        self.lower, self.upper = np.full((n, 3), -np.inf), np.full((n, 3), np.inf)
        self.lower[:, :dim], self.upper[:, :dim] = lower, upper
        self.kn, self.kt, self.mu, self.dt = kn, kt, mu, dt
        self.dashpot = damping * 2 * np.sqrt(np.median(m) / 2 * kn)
        self.drag, self.load = options.get("drag", 0.0), options.get("load", 0.0)
        self.gravity = np.zeros(3)
        self.gravity[dim - 1] = -options.get("gravity", 0.0)
        self.box = options.get("box", np.zeros(n, int))
        self.inertia = (0.5 if dim == 2 else 0.4) * m * R**2
        self.v, self.w = np.zeros((n, 3)), np.zeros((n, 3))
        self.piston_v = np.zeros(self.box.max() + 1)
        self.piston_m = np.bincount(self.box, m) / 2
        self.pairs, self.history = np.zeros((0, 2), int), np.zeros((0, 3))
        self.skin = 0.3 * R.min()
        self.search()

    def search(self):
        """Find the pairs that may soon touch; pairs in contact keep the memory of their springs."""
        n = len(self.x)
        largest = np.sort(self.R)[-1] + np.sort(self.R)[-min(n, 2)]
        pairs = cKDTree(self.x).query_pairs(largest + self.skin, output_type="ndarray")
        gap = np.linalg.norm(self.x[pairs[:, 0]] - self.x[pairs[:, 1]], axis=1)
        pairs = pairs[gap < self.R[pairs].sum(axis=1) + self.skin]
        old, memory = self.pairs @ [n, 1], self.history
        self.pairs = pairs[np.lexsort(pairs.T[::-1])]
        self.history = np.zeros((len(pairs), 3))
        _, new, before = np.intersect1d(self.pairs @ [n, 1], old, return_indices=True)
        self.history[new] = memory[before]
        entries = (self.pairs.T.ravel(), np.tile(np.arange(len(pairs)), 2))
        self.add = csr_array((np.ones(2 * len(pairs)), entries), (n, len(pairs)))
        signs = np.repeat([1.0, -1.0], len(pairs))
        self.act = csr_array((signs, entries), (n, len(pairs)))
        self.seen = self.x.copy()

    def pair_forces(self, dt):
        """Normals, arms and forces on the first grain of each pair; springs advance by `dt`."""
        i, j = self.pairs.T
        apart = self.x[j] - self.x[i]
        far = np.sqrt((apart**2).sum(axis=1))
        normal = apart / far[:, None]
        overlap = self.R[i] + self.R[j] - far
        touching = overlap > 0
        arm_i, arm_j = self.R[i] - overlap / 2, self.R[j] - overlap / 2
        spin = arm_i[:, None] * self.w[i] + arm_j[:, None] * self.w[j]
        v = self.v[i] - self.v[j] + cross(spin, normal)
        closing = (v * normal).sum(axis=1)
        push = np.maximum(self.kn * overlap + self.dashpot * closing, 0) * touching
        h = self.history + dt * (v - closing[:, None] * normal)
        h = (h - (h * normal).sum(axis=1)[:, None] * normal) * touching[:, None]
        stretch = self.kt * np.sqrt((h**2).sum(axis=1))
        h *= np.minimum(1, self.mu * push / np.maximum(stretch, 1e-300))[:, None]
        self.history = h
        return normal, arm_i, arm_j, -push[:, None] * normal - self.kt * h, touching

    def wall_forces(self):
        """Penetration and outward push of each grain at lower and upper walls, shape (2, n, 3)."""
        R = self.R[:, None]
        depth = np.stack([self.lower + R - self.x, self.x + R - self.upper])
        speed = np.stack([-self.v, self.v])
        speed[1, :, self.dim - 1] -= self.piston_v[self.box]
        push = self.kn * depth + self.dashpot * speed
        return depth, np.where(depth > 0, np.maximum(push, 0), 0)

    def total(self, dt):
        """Forces and torques on the grains, and the push on each piston."""
        normal, arm_i, arm_j, f, _ = self.pair_forces(dt)
        _, push = self.wall_forces()
        force = self.act @ f + push[0] - push[1] + self.m[:, None] * self.gravity
        # The force on i and its reaction on j give the same torque: arm times normal x force.
        turn = cross(normal, f)
        i, j = self.pairs.T
        n = len(self.x)
        torque = np.stack(
            [
                np.bincount(i, arm_i * turn[:, k], n) + np.bincount(j, arm_j * turn[:, k], n)
                for k in range(3)
            ],
            axis=1,
        )
        return force, torque, np.bincount(self.box, push[1, :, self.dim - 1])

    def step(self, steps):
        """Advance by a number of steps (semi-implicit Euler)."""
        fade = np.exp(-self.drag * self.dt)
        up = self.dim - 1
        for _ in range(steps):
            if np.abs(self.x - self.seen).max() > self.skin / 4:
                self.search()
            force, torque, lift = self.total(self.dt)
            self.v = fade * (self.v + self.dt * force / self.m[:, None])
            self.w = fade * (self.w + self.dt * torque / self.inertia[:, None])
            self.x = self.x + self.dt * self.v
            if self.load:
                self.piston_v = self.piston_v + self.dt * (lift - self.load) / self.piston_m
                self.upper[:, up] += self.dt * self.piston_v[self.box]

    def unbalance(self):
        """Largest net force on a grain over the largest contact force."""
        force, _, _ = self.total(0.0)
        return np.abs(force).max() / np.abs(self.pair_forces(0.0)[3]).max()

    def contacts(self, box=None):
        """Contact arrays of a `Packing` and the contact forces, of all grains or of one box."""
        normal, arm, _, f, touching = self.pair_forces(0.0)
        depth, push = self.wall_forces()
        side, grain, axis = np.nonzero(depth > 0)
        outward = np.zeros((len(grain), 3))
        outward[np.arange(len(grain)), axis] = 2 * side - 1
        i = self.pairs[touching, 0]
        k = np.flatnonzero(touching)
        reach = (self.R[grain] - depth[side, grain, axis])[:, None]
        table = {
            "bodies": np.concatenate(
                [self.pairs[k], np.stack([grain, -1 - 2 * axis - side], axis=1)]
            ),
            "positions": np.concatenate(
                [self.x[i] + arm[k, None] * normal[k], self.x[grain] + reach * outward]
            ),
            "normals": np.concatenate([normal[k], outward]),
            "forces": np.concatenate([f[k], -push[side, grain, axis][:, None] * outward]),
        }
        if box is not None:
            mine = self.box[table["bodies"][:, 0]] == box
            table = {name: array[mine] for name, array in table.items()}
            first = np.flatnonzero(self.box == box)[0]
            table["bodies"] = np.where(
                table["bodies"] >= 0, table["bodies"] - first, table["bodies"]
            )
        flat = {name: array[:, : self.dim] for name, array in table.items()}
        return flat | {"bodies": table["bodies"]}


def volumes(R, dim):
    """Areas of discs or volumes of spheres."""
    return np.pi * R**2 if dim == 2 else 4 / 3 * np.pi * R**3


def sums(table, centroids):
    """Sparse matrices of force and moment sums and of sym(f x), row by row for each grain."""
    dim = centroids.shape[1]
    rows, columns, values = [], [], []
    planes = [(0, 1)] if dim == 2 else [(1, 2), (2, 0), (0, 1)]
    moments = dim + len(planes)
    size = moments + dim + len(planes)
    for c, pair in enumerate(table["bodies"]):
        for p, sign in zip(pair, (1.0, -1.0), strict=True):
            if p < 0:
                continue
            x = sign * (table["positions"][c] - centroids[p])
            entries = [(a, a, sign) for a in range(dim)]
            for k, (a, b) in enumerate(planes):
                entries += [(dim + k, b, x[a]), (dim + k, a, -x[b])]
            entries += [(moments + a, a, x[a]) for a in range(dim)]
            for k, (a, b) in enumerate(planes):
                entries += [(moments + dim + k, a, x[b]), (moments + dim + k, b, x[a])]
            for row, column, value in entries:
                rows.append(size * p + row)
                columns.append(dim * c + column)
                values.append(value)
    shape = (size * len(centroids), dim * len(table["bodies"]))
    matrix = csr_array((values, (rows, columns)), shape)
    which = np.arange(shape[0]) % size
    return matrix[which < moments], matrix[which >= moments]


def balanced(table, centroids, scale):
    """Contact forces in exact equilibrium that are nearest to those of grains still in motion."""
    balance, _ = sums(table, centroids)
    dim = centroids.shape[1]
    size = balance.shape[0] // len(centroids)
    weights = np.where(np.arange(balance.shape[0]) % size < dim, 1.0, 1 / scale)
    scaled = csr_array(balance * weights[:, None])
    f = table["forces"].ravel()
    # Two passes: the first leaves an error of the size of the solver tolerance.
    for _ in range(2):
        f = f - lsqr(scaled, scaled @ f, atol=1e-15, btol=1e-15, iter_lim=20 * len(f))[0]
    return f.reshape(-1, dim)


def average_stresses(table, centroids, volume):
    """Stress of each grain, shape (n, dim, dim): the sum of sym(f x)/V over its contacts."""
    dim = centroids.shape[1]
    found = np.zeros((len(centroids), dim, dim))
    for (p, q), at, f in zip(table["bodies"], table["positions"], table["forces"], strict=True):
        for body, force in ((p, f), (q, -f)):
            if body >= 0:
                outer = np.outer(force, at - centroids[body])
                found[body] += (outer + outer.T) / (2 * volume[body])
    return found


def layered_places(n, across, spacing, dim, rng):
    """n positions with random offsets, in layers of across[0] (x across[1]) points at a spacing."""
    places = np.zeros((n, dim))
    rest = np.arange(n)
    for axis, count in enumerate(across):
        places[:, axis] = rest % count + 0.5
        rest = rest // count
    places[:, dim - 1] = rest + 0.5
    return spacing * (places + rng.uniform(-0.08, 0.08, places.shape))


def oedometers(seeds, *, dim=2, n=58, width=0.039, pressure=30e3, free=5000, damped=4000, mu=0.5):
    """Grains of 2.5 mm to 4 mm compressed in boxes by free-slip pistons, one box for each seed."""
    places, radii, boxes = [], [], []
    across = (int(width / 7.8e-3),) * (dim - 1)
    for k, seed in enumerate(seeds):
        rng = np.random.default_rng(seed)
        x = layered_places(n, across, width / across[0], dim, rng)
        x[:, 0] += 10 * width * k
        places.append(x)
        radii.append(rng.uniform(2.5e-3, 4e-3, n))
        boxes.append(np.full(n, k))
    x, R, box = np.concatenate(places), np.concatenate(radii), np.concatenate(boxes)
    m = 2000 * volumes(R, dim)
    lower, upper = np.zeros((len(x), dim)), np.full((len(x), dim), width)
    lower[:, 0], upper[:, 0] = 10 * width * box, 10 * width * box + width
    upper[:, -1] = x[:, -1].max() + 5e-3
    load = pressure * width ** (dim - 1)
    kn = 2000 * load / width  # the overlap is some thousandths of a radius
    grains = Grains(
        x, R, m, lower, upper, dim=dim, kn=kn, kt=kn, mu=0.98 * mu, load=load, box=box,
        dt=0.2 * np.sqrt(m.min() / kn), drag=0.0,
    )  # fmt: skip
    rng = np.random.default_rng(len(seeds))
    grains.v[:, :dim] = rng.normal(0, 0.3, x.shape)
    beat = np.sqrt(np.median(m) / kn)
    for drag, steps in ((0.001, free), (0.03, damped)):
        grains.drag = drag / beat
        grains.step(steps)
    return grains


@dataclass(frozen=True)
class Case:
    """A packing and its contact forces."""

    packing: Packing
    forces: np.ndarray


def case_of(grains, box=None):
    """Case at rest: relaxed forces, corrected to exact equilibrium, and the resulting stresses."""
    table, dim = grains.contacts(box), grains.dim
    mine = slice(None) if box is None else grains.box == box
    return balanced_case(table, grains.x[mine, :dim], grains.R[mine])


def balanced_case(table, centroids, R):
    """Case of contacts whose forces are approximately balanced."""
    return case_from(table | {"forces": balanced(table, centroids, R.mean())}, centroids, R)


def case_from(table, centroids, R, **motion):
    """Case of contacts with the stresses that their forces make."""
    forces, volume = table["forces"], volumes(R, centroids.shape[1])
    contacts = {name: table[name] for name in ("bodies", "positions", "normals")}
    stresses = average_stresses(table, centroids, volume)
    grains = {"centroids": centroids, "volumes": volume, "stresses": stresses}
    return Case(Packing(**contacts, **grains, **motion), forces)


def jittered_grid(shape, *, shake=0.05, seed=0):
    """Grains on a square or cubic grid with random offsets and similar pushes; any number of
    grains.

    The outermost layers are walls. Contacts lie halfway between centroids.
    """
    rng, dim = np.random.default_rng(seed), len(shape)
    places = np.stack(np.meshgrid(*[np.arange(k) for k in shape], indexing="ij"), axis=-1)
    index = np.arange(np.prod(shape)).reshape(shape)
    border = np.any(
        [(places[..., a] == 0) | (places[..., a] == shape[a] - 1) for a in range(dim)], 0
    )
    number = np.where(border.ravel(), -1, np.cumsum(~border.ravel()) - 1)
    x = places.reshape(-1, dim) + rng.uniform(-shake, shake, (index.size, dim))
    pairs = np.concatenate(
        [
            np.stack([np.delete(index, -1, a).ravel(), np.delete(index, 0, a).ravel()], axis=1)
            for a in range(dim)
        ]
    )
    pairs = pairs[(number[pairs] >= 0).any(axis=1)]
    away = x[pairs[:, 1]] - x[pairs[:, 0]]
    normals = away / np.linalg.norm(away, axis=1)[:, None]
    push = rng.uniform(0.7, 1.3, len(pairs))
    table = {
        "bodies": number[pairs],
        "positions": x[pairs].mean(axis=1),
        "normals": normals,
        "forces": -push[:, None] * normals,
    }
    centroids = x[number >= 0]
    return balanced_case(table, centroids, np.full(len(centroids), 0.5))


def settled(grains, boxes, mu=0.5, rounds=30):
    """Cases of several boxes, stepped on until the forces are admissible in all of them."""
    for _ in range(rounds):
        cases = [case_of(grains, box) for box in boxes]
        if all(admissible(case, mu) for case in cases):
            return cases
        grains.step(400)
    raise AssertionError(f"still moving: unbalance {grains.unbalance():.1e}")


def admissible(case, mu):
    """True if all contacts push and none slips."""
    normals, f = case.packing.normals, case.forces
    push = -(f * normals).sum(axis=1)
    slip = np.linalg.norm(f + push[:, None] * normals, axis=1)
    return (push > 0).all() and (slip <= mu * push).all()


@cache
def pressed_discs(count=10):
    """Ten oedometric tests of section 2.4, or fewer: 58 discs, with other radii in each."""
    seeds = [0, 1, 2, 3, 5, 6, 7, 8, 9, 10][:count]  # seed 4 settles slowly
    return settled(oedometers(seeds), range(len(seeds)))


@cache
def pressed_spheres(n=40):
    """Spheres compressed in a box."""
    grains = oedometers([0], dim=3, n=n, width=0.026, free=12000, damped=1500)
    return settled(grains, [0])[0]


DISC = 22.225e-3
"""Radius of the discs of section 3.3 [m]."""
FRAME = 2e-4
"""Between two frames [s]: 5 kHz."""


@dataclass(frozen=True)
class Record:
    """Frames of grains under impact: their positions and velocities, and the positions of the
    others.

    `frames` holds the cases of those frames, numbered `touching`, that have contacts.
    """

    times: np.ndarray
    x: np.ndarray
    v: np.ndarray
    others: np.ndarray
    masses: np.ndarray
    touching: np.ndarray
    frames: list[Case]


@cache
def impact():
    """Six discs in a corner, hit by a heavy body at 27 degrees off the centre of the last disc."""
    gap, R = 2e-5, np.array([DISC] * 6 + [0.06])
    rise = DISC * (1 + np.sqrt(3)) + gap
    x = np.array(
        [[DISC * (2 * k + 1) + gap * k, DISC] for k in range(3)]
        + [[DISC * (2 * k + 2) + gap * k, rise] for k in range(3)]
        + [[0.0, 0.0]]
    )
    angle = np.radians(27.0)
    x[6] = x[5] + (R[5] + R[6] + 1e-4) * np.array([np.cos(angle), np.sin(angle)])
    m = 1100 * np.pi * R**2
    m[6] = 8.0
    grains = Grains(
        x, R, m, 0.0, np.inf, dim=2, kn=3e6, kt=2e6, mu=0.6, dt=4e-6, damping=0.15
    )  # fmt: skip
    grains.v[6, :2] = -1.141, -0.66
    return film(grains, 6, 140, FRAME)


def film(grains, seen, count, interval):
    """Record frames of the first `seen` grains; the others count as bodies from outside."""
    steps = round(interval / grains.dt)
    d = grains.dim
    x, v, others, frames, touching = [], [], [], [], []
    for k in range(count):
        x.append(grains.x[:seen, :d].copy())
        v.append(grains.v[:seen, :d].copy())
        others.append(grains.x[seen:, :d].copy())
        table = grains.contacts()
        bodies = np.where(table["bodies"] >= seen, OUTSIDE, table["bodies"])
        kept = bodies.max(axis=1) >= 0
        if kept.any():
            table = {name: array[kept] for name, array in (table | {"bodies": bodies}).items()}
            frames.append(moving_case(grains, table, seen))
            touching.append(k)
        grains.step(steps)
    times = interval * np.arange(count)
    series = (np.array(found) for found in (x, v, others))
    return Record(times, *series, grains.m[:seen], np.array(touching), frames)


def moving_case(grains, table, seen):
    """Case in 2D with the exact accelerations of the centroids and the angular accelerations."""
    force, torque, _ = grains.total(0.0)
    motion = {"gravity": grains.gravity[:2]} if grains.gravity.any() else {}
    motion["accelerations"] = (force / grains.m[:, None])[:seen, :2]
    motion["angular_accelerations"] = (torque[:, 2] / grains.inertia)[:seen]
    motion |= {"masses": grains.m[:seen], "inertias": grains.inertia[:seen]}
    return case_from(table, grains.x[:seen, :2], grains.R[:seen], **motion)


def noisy_record(record, seed):
    """Packings as filmed at 5 kHz: stresses wrong by 10 %, centroids by 0.02 mm, no rotation.

    Accelerations of the centroids are low-pass filtered as in section 3.3.2, here at 600 Hz. Errors
    are those an experiment could state: for accelerations their size in frames without contact; for
    stresses a tenth of their size plus a hundredth of the largest one.
    """
    rng, taps = np.random.default_rng(seed), firwin(31, 600, fs=1 / FRAME, window="hamming")

    def smooth(series):
        return filtfilt(taps, [1.0], series, axis=0, padtype="odd", padlen=100)

    x = smooth(record.x + rng.normal(0, 2e-5, record.x.shape))
    a = smooth(np.gradient(np.gradient(x, FRAME, axis=0), FRAME, axis=0))
    idle = np.delete(a, record.touching, axis=0).std()
    found = []
    for k, case in zip(record.touching, record.frames, strict=True):
        noise = np.triu(1 + rng.normal(0, 0.1, case.packing.stresses.shape))
        stresses = case.packing.stresses * (noise + np.triu(noise, 1).transpose(0, 2, 1))
        size = np.sqrt((stresses**2).mean(axis=(1, 2)))
        found.append(
            replace(
                case.packing,
                stresses=stresses,
                stress_errors=0.1 * size + 0.01 * size.max(),
                accelerations=a[k],
                acceleration_errors=np.full(len(size), idle),
                inertias=None,
                angular_accelerations=None,
            )
        )
    return found

"""Plain reference for shapes of bodies: parametrised surfaces, and the sets that they enclose."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy.optimize import minimize
from scipy.spatial.transform import Rotation

from granular import Capsule, Frustum, Prism, Revolve, Sphere, Torus
from granular.shapes import Shape

CENTER = (0.02, -0.01, 0.03)
AXIS = (0.3, -0.5, 1.0)


@dataclass
class Solid:
    """A shape, its surface as functions of two numbers from 0 to 1, and what it contains."""

    shape: Shape
    patches: list[Callable]
    contains: Callable
    second: tuple[float, float]  # the bounds of the second number, an angle where all is round


def _turn():
    """Rotation of the z axis to `AXIS`."""
    return Rotation.align_vectors([AXIS], [(0, 0, 1)])[0]


def _placed(turn, patches):
    return [lambda u, v, patch=patch: turn.apply(patch(u, v)) + CENTER for patch in patches]


def _own(turn, x):
    return turn.inv().apply(np.asarray(x) - CENTER)


def _ring(profile):
    """The surface that a curve (r, z) of u sweeps."""

    def patch(u, v):
        r, z = profile(u)
        return np.array([r * np.cos(2 * np.pi * v), r * np.sin(2 * np.pi * v), z])

    return patch


def _edge(a, b):
    return lambda u: np.array(a) + u * (np.array(b) - np.array(a))


def _arc(center, radius, first, last):
    def curve(u):
        angle = np.radians(first + u * (last - first))
        return np.array(center) + radius * np.array([np.cos(angle), np.sin(angle)])

    return curve


def _in_polygon(vertices, p):
    """By the angle that the polygon is seen under."""
    arms = np.array(vertices) - p
    after = np.roll(arms, -1, axis=0)
    turns = np.arctan2(
        arms[:, 0] * after[:, 1] - arms[:, 1] * after[:, 0], (arms * after).sum(axis=1)
    )
    return abs(turns.sum()) > np.pi


def _revolved(shape, curves, contains):
    turn = _turn()

    def within(x):
        y = _own(turn, x)
        return contains(np.array([np.hypot(y[0], y[1]), y[2]]))

    return Solid(shape, _placed(turn, [_ring(curve) for curve in curves]), within, (-0.2, 1.2))


def _of_profile(shape, profile):
    edges = zip(profile, np.roll(profile, -1, axis=0), strict=True)
    curves = [_edge(a, b) for a, b in edges if a[0] > 0 or b[0] > 0]
    return _revolved(shape, curves, lambda p: _in_polygon(profile, p))


def _wall(shape, line, half):
    """A wall about a line of two pieces that bends to the left, with round ends."""
    a, b, c = (np.array(p, dtype=float) for p in line)
    first, second = (b - a) / np.linalg.norm(b - a), (c - b) / np.linalg.norm(c - b)
    right = [half * np.array([e[1], -e[0]]) for e in (first, second)]
    turns = [np.degrees(np.arctan2(r[1], r[0])) for r in right]
    inner = b - (right[0] + right[1]) / (1 + first @ second)
    curves = [
        _edge(a + right[0], b + right[0]),
        _arc(b, half, *turns),
        _edge(b + right[1], c + right[1]),
        _arc(c, half, turns[1], turns[1] + 180),
        _edge(c - right[1], inner),
        _edge(inner, a - right[0]),
        _arc(a, half, turns[0] - 180, turns[0]),
    ]

    def contains(p):
        ways = [
            min(max(((p - s) @ (e - s)) / ((e - s) @ (e - s)), 0), 1) for s, e in ((a, b), (b, c))
        ]
        feet = [s + t * (e - s) for t, (s, e) in zip(ways, ((a, b), (b, c)), strict=True)]
        return min(np.linalg.norm(p - foot) for foot in feet) < half

    return _revolved(shape, curves, contains)


def _ell(length):
    """An L extended along y, of two rectangles, about `CENTER`."""
    ell = [(-0.1, -0.1), (0.2, -0.1), (0.2, 0.0), (0.0, 0.0), (0.0, 0.25), (-0.1, 0.25)]
    turned = Rotation.from_rotvec((10.0, 20.0, -30.0), degrees=True)

    def side(a, b):
        return lambda u, v: np.array([*_edge(a, b)(u), (v - 0.5) * length])[[0, 2, 1]]

    def cap(low, high, end):
        low, high = np.array(low), np.array(high)
        return lambda u, v: np.array([*(low + [u, v] * (high - low)), end * length / 2])[[0, 2, 1]]

    patches = [side(a, b) for a, b in zip(ell, ell[1:] + ell[:1], strict=True)]
    for end in (-1, 1):
        patches += [cap(ell[0], ell[2], end), cap((-0.1, 0.0), ell[4], end)]

    def contains(x):
        y = _own(turned, x)
        return abs(y[1]) < length / 2 and _in_polygon(ell, y[[0, 2]])

    shape = Prism(ell, length, axis="y", center=CENTER, rotation_deg=(10.0, 20.0, -30.0))
    return Solid(shape, _placed(turned, patches), contains, (0, 1))


def nearest(solid, x):
    """Least distance of x from the surface, and the point there: the best of all patches."""
    best = (np.inf, None)
    grid = [(u, v) for u in np.linspace(0.05, 0.95, 7) for v in np.linspace(0.05, 0.95, 10)]
    for patch in solid.patches:

        def square(w, patch=patch):
            return np.sum((patch(*w) - x) ** 2)

        found = minimize(
            square,
            min(grid, key=square),
            bounds=[(0, 1), solid.second],
            method="L-BFGS-B",
            options={"ftol": 1e-16, "gtol": 1e-10},
        )
        length = np.linalg.norm(patch(*found.x) - x)
        if length < best[0]:
            best = (length, patch(*found.x))
    return best


PLACED = {"center": CENTER, "axis": AXIS}
TRUNCATED = [(0.0, -0.15), (0.08, -0.15), (0.22, 0.15), (0.0, 0.15)]
CONE = [(0.0, -0.15), (0.2, -0.15), (0.0, 0.15)]
BOWL = [(0.0, -0.1), (0.25, -0.1), (0.15, 0.2), (0.1, 0.0), (0.0, 0.05)]
LINE = [(0.05, -0.2), (0.2, 0.0), (0.2, 0.2)]
SLOPE = np.hypot(0.3, 0.14)
OUT = np.array([0.3, -0.14]) / SLOPE * 0.05
HOPPER = [
    (0.08, -0.15),
    (0.08 + OUT[0], -0.15 + OUT[1]),
    (0.22 + OUT[0], 0.15 + OUT[1]),
    (0.22, 0.15),
]
SOLIDS = {
    "sphere": _revolved(
        Sphere(0.2, center=CENTER), [_arc((0, 0), 0.2, -90, 90)], lambda p: np.hypot(*p) < 0.2
    ),
    "capsule": _revolved(
        Capsule(0.1, 0.2, **PLACED),
        [_arc((0, -0.1), 0.1, -90, 0), _edge((0.1, -0.1), (0.1, 0.1)), _arc((0, 0.1), 0.1, 0, 90)],
        lambda p: np.hypot(p[0], max(abs(p[1]) - 0.1, 0)) < 0.1,
    ),
    "torus": _revolved(
        Torus(0.2, 0.06, **PLACED),
        [_arc((0.2, 0), 0.06, 0, 180), _arc((0.2, 0), 0.06, 180, 360)],
        lambda p: np.hypot(p[0] - 0.2, p[1]) < 0.06,
    ),
    "cone": _of_profile(Frustum((0.2, 0.0), 0.3, **PLACED), CONE),
    "frustum": _of_profile(Frustum((0.08, 0.22), 0.3, **PLACED), TRUNCATED),
    "hopper": _of_profile(Frustum((0.08, 0.22), 0.3, thickness=0.05, **PLACED), HOPPER),
    "bowl": _of_profile(Revolve(BOWL, **PLACED), BOWL),
    "silo": _wall(Revolve(LINE, thickness=0.04, **PLACED), LINE, 0.02),
    "ell": _ell(0.3),
}
"""Solids about `CENTER`, of which each parametrised surface is complete."""

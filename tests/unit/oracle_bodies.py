"""Plain reference for rigid bodies: distances, contact, and one step of free motion."""

import numpy as np
from scipy.optimize import brentq
from scipy.spatial.transform import Rotation

from granular.mpm.bodies import Box, Cylinder, Union


def _turn(rotation_deg):
    vector = rotation_deg if np.ndim(rotation_deg) else (0, 0, rotation_deg)
    return Rotation.from_rotvec(np.radians(vector))


def _space(vector):
    return np.array([*vector, 0.0])[:3]


def _box(shape, x):
    y = _turn(shape.rotation_deg).inv().apply(x - _space(shape.center))[: len(shape.size)]
    beyond = np.abs(y) - np.array(shape.size) / 2
    return np.linalg.norm(np.maximum(beyond, 0)) + min(beyond.max(), 0)


def _cylinder(shape, x):
    axis = _space((0, 0) if shape.axis is None else shape.axis)
    axis = np.array([0, 0, 1.0]) if shape.axis is None else axis / np.linalg.norm(axis)
    arm = x - _space(shape.center)
    along = arm @ axis
    radial = np.linalg.norm(arm - along * axis) - shape.radius
    beyond = np.array([radial, abs(along) - shape.length / 2])
    distance = np.linalg.norm(np.maximum(beyond, 0)) + min(beyond.max(), 0)
    return -distance if shape.inside else distance


def distance(shape, x):
    """Signed distance of a position (3,) in coordinates of the body."""
    if isinstance(shape, Union):
        return min(distance(part, x) for part in shape.parts)
    if isinstance(shape, Box):
        return _box(shape, x)
    if isinstance(shape, Cylinder):
        return _cylinder(shape, x)
    normal = _space(shape.normal)
    return normal @ (x - _space(shape.through)) / np.linalg.norm(normal)


def gradient(shape, x, h=1e-6):
    """Unit normal: the gradient of the distance by central differences."""
    dim = shape.dim
    out = np.zeros(3)
    for d in range(dim):
        step = h * np.eye(3)[d]
        out[d] = (distance(shape, x + step) - distance(shape, x - step)) / (2 * h)
    return out / np.linalg.norm(out)


def contact(body, normal, surface, v):
    """Velocity of the material after contact with the body."""
    u = v - surface
    into = u @ normal
    if body.contact == "sticky":
        return surface
    if body.contact == "separating" and into >= 0:
        return v
    along = u - into * normal
    sliding = np.linalg.norm(along)
    share = max(0.0, 1 - body.friction * abs(into) / sliding) if sliding else 1.0
    return surface + share * along


def step(body, nodes, velocity, omega, gravity, dt):
    """Velocities of the nodes after contact, impulse, angular impulse, velocity of the body.

    A free component, of which there is at most one, is integrated by backward Euler: the velocity
    is the root of M (V' - V) - P(V') - M g dt.
    """
    turn = _turn(body.rotation_deg)
    arms = np.array([_space(x) for x in nodes["x"]]) - _space(body.position)
    local = turn.inv().apply(arms)
    within = [
        i for i, x in enumerate(local) if nodes["mass"][i] > 0 and distance(body.shape, x) < 0
    ]
    normals = {i: turn.apply(gradient(body.shape, local[i])) for i in within}
    before = np.array([_space(v) for v in nodes["v"]])

    def after(v_body):
        out = before.copy()
        for i in within:
            surface = v_body + np.cross(omega, arms[i])
            out[i] = contact(body, normals[i], surface, before[i])
        return out

    def impulses(v_body):
        return -nodes["mass"][:, None] * (after(v_body) - before)

    v_new = np.array(velocity, dtype=float)
    if body.free:
        axis = "xyz".index(body.free)

        def rest(value):
            v_new[axis] = value
            change = value - velocity[axis] - gravity[axis] * dt
            return body.mass * change - impulses(v_new).sum(axis=0)[axis]

        v_new[axis] = brentq(rest, -10, 10, xtol=1e-14)
    impulse = impulses(v_new)
    return after(v_new), impulse.sum(axis=0), np.cross(arms, impulse).sum(axis=0), v_new

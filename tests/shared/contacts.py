"""Shear frames made by hand: few grains whose stress and dissipation can be computed on paper."""

import numpy as np

from granular.grain_scale.dem import Contacts, Frame


def contacts(frame_x, pairs, force, *, tangential=None, normal_velocity=None, sliding=None):
    """Contacts of pairs of grains along their branch vectors; `force` is the repulsion [N]."""
    i, j = np.array(pairs, dtype=int).reshape(-1, 2).T
    branch = frame_x[i] - frame_x[j]
    distance = np.linalg.norm(branch, axis=1)
    normal = -branch / distance[:, None]
    nothing = np.zeros((len(i), 3))
    speed = nothing if normal_velocity is None else np.reshape(normal_velocity, (-1, 1)) * normal
    return Contacts(
        i=i,
        j=j,
        normal=normal,
        distance=distance,
        normal_force=np.array(force, dtype=float).reshape(len(i)),
        tangential_force=nothing if tangential is None else np.array(tangential, dtype=float),
        normal_velocity=speed,
        tangential_velocity=nothing if sliding is None else np.array(sliding, dtype=float),
        damped_velocity=speed,
    )


def frame(
    x, v, *, radius=0.5, mass=1.0, time=0.0, box=(2.0, 2.0, 2.0), shear_rate=1.0, wall=None, **made
):
    """Frame of grains at x with velocities v and the contacts returned by `contacts`."""
    x, v = np.array(x, dtype=float), np.array(v, dtype=float)
    n = len(x)
    return Frame(
        time=time,
        box=np.array(box),
        id=np.arange(1, n + 1),
        wall=np.zeros(n, dtype=bool) if wall is None else np.array(wall),
        radius=np.full(n, radius),
        mass=np.full(n, mass),
        x=x,
        v=v,
        force=np.zeros((n, 3)),
        shear_rate=shear_rate,
        contacts=contacts(x, **({"pairs": [], "force": []} | made)),
    )

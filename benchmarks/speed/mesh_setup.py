"""Time and memory of the set-up of large meshes and height maps, and of a distance.

Each case runs in a separate process, on one thread. A ball of 2 m is triangulated by subdividing an
icosahedron (20 * 4^k triangles, the least that is not below N). Times are processor times, which
other jobs change little; the memory is the largest increase of the memory of the process. --library
measures libigl too, the fastest of the libraries tried, for as many points as there are samples:
signed distances by pseudonormals.
"""

from __future__ import annotations

import argparse
import os
import resource
import subprocess
import time

import numpy as np
from shared import python

from granular.shapes import HeightMap, Mesh

os.environ.setdefault("OMP_NUM_THREADS", "1")
os.environ.setdefault("IGL_NUM_THREADS", "1")

SPACINGS = (0.04, 0.02, 0.01)
PLACES = 200_000


def ball(least: int) -> tuple[np.ndarray, np.ndarray]:
    """Vertices (k, 3) and triangles (n, 3) of a ball of radius 1."""
    g = 0.5 * (1 + np.sqrt(5))
    v = [(s * a, t * b, 0.0) for a, b in ((1, g),) for s in (-1, 1) for t in (-1, 1)]
    vertices = np.array([np.roll(x, k) for k in range(3) for x in v])
    edge = np.linalg.norm(vertices[:, None] - vertices, axis=2)
    near = (edge > 1.9) & (edge < 2.1)
    faces = np.array(
        [
            (i, j, k) if np.linalg.det(vertices[[i, j, k]]) > 0 else (i, k, j)
            for i in range(12)
            for j in range(i)
            for k in range(j)
            if near[i, j] and near[j, k] and near[k, i]
        ]
    )
    while len(faces) < least:
        sides = np.sort(faces[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2), axis=1)
        unique, of = np.unique(sides, axis=0, return_inverse=True)
        middle = of.reshape(-1, 3) + len(vertices)
        vertices = np.concatenate(
            [vertices, 0.5 * (vertices[unique[:, 0]] + vertices[unique[:, 1]])]
        )
        (a, b, c), (ab, bc, ca) = faces.T, middle.T
        corners = [(a, ab, ca), (b, bc, ab), (c, ca, bc), (ab, bc, ca)]
        faces = np.concatenate([np.stack(three, axis=1) for three in corners])
    return vertices / np.linalg.norm(vertices, axis=1)[:, None], faces


def memory() -> float:
    """Most memory the process held so far [MB]."""
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1e3


def places() -> np.ndarray:
    x = np.random.default_rng(0).normal(size=(PLACES, 3))
    return (
        x
        * np.random.default_rng(1).uniform(0.97, 1.03, (PLACES, 1))
        / np.linalg.norm(x, axis=1)[:, None]
    )


def mesh(least: int, spacing: float) -> None:
    from granular.mpm.bodies import Body

    vertices, faces = ball(least)
    before, start = memory(), time.process_time()
    shape = Mesh(vertices, faces, spacing=spacing)
    checked = time.process_time()
    tables = shape.samples()[0]
    sampled = time.process_time()
    retained = sum(table.nbytes for table in tables) / 1e6
    x = places()
    at = time.process_time()
    distance = Body(shape, (0.0,) * 3).distance(x)[0]
    took = (time.process_time() - at) / PLACES * 1e6
    error = abs(distance - (np.linalg.norm(x, axis=1) - 1)).max()
    times = f"{checked - start:.1f} + {sampled - checked:.1f}"
    print(
        f"| mesh, {len(faces)} triangles, spacing {spacing} m | {times} "
        f"| {memory() - before:.0f}, {retained:.1f} | {took:.2f} | {error:.1e} |"
    )


def library(least: int, spacing: float) -> None:
    import igl

    vertices, faces = ball(least)
    x = places()
    before, start = memory(), time.process_time()
    signed = igl.signed_distance(
        x, vertices, faces, sign_type=igl.SIGNED_DISTANCE_TYPE_PSEUDONORMAL
    )
    took = time.process_time() - start
    error = abs(signed[0] - (np.linalg.norm(x, axis=1) - 1)).max()
    print(
        f"| libigl, {len(faces)} triangles, {PLACES} points | {took:.1f} | {memory() - before:.0f} "
        f"| {took / PLACES * 1e6:.2f} | {error:.1e} |"
    )


def height_map(posts: int, dtype: str) -> None:
    from granular.mpm.bodies import Body

    n = int(np.ceil(np.sqrt(posts)))
    x = np.linspace(-1.0, 1.0, n)
    z = (0.1 * np.sin(9 * x) + 0.1 * np.cos(7 * x)[:, None]).astype(dtype)
    before, start = memory(), time.process_time()
    shape = HeightMap(z, 2.0 / (n - 1), origin=(-1.0, -1.0))
    shape.samples()
    took = time.process_time() - start
    at = np.random.default_rng(0).uniform(-0.9, 0.9, (PLACES, 3)) * [1, 1, 0]
    at[:, 2] = 0.1 * np.sin(9 * at[:, 0]) + 0.1 * np.cos(7 * at[:, 1])
    at[:, 2] += np.random.default_rng(1).uniform(-4.0, 4.0, PLACES) * shape.spacing[0]
    begin = time.process_time()
    Body(shape, (0.0,) * 3).distance(at)
    each = (time.process_time() - begin) / PLACES * 1e6
    retained = sum(table.nbytes for table in shape.samples()[0]) / 1e6
    print(
        f"| height map, {n} x {n} posts, {dtype} | {took:.2f} "
        f"| {memory() - before:.0f}, {retained:.1f} | {each:.2f} | |"
    )


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--triangles", type=int, default=1_000_000)
    parser.add_argument("--posts", type=int, default=10_000_000)
    parser.add_argument("--library", action="store_true")
    parser.add_argument("--case", nargs=3, help=argparse.SUPPRESS)
    given = parser.parse_args()
    if given.case:
        kind, count, number = given.case
        if kind == "map":
            height_map(int(count), number)
        else:
            {"mesh": mesh, "library": library}[kind](int(count), float(number))
        return
    cases = [("mesh", given.triangles, spacing) for spacing in SPACINGS]
    cases += [("library", given.triangles, 0.0)] if given.library else []
    cases += [("map", given.posts, dtype) for dtype in ("float64", "float32")]
    print("| case | set-up [s] | memory: most, retained [MB] | distance [us] | error [m] |")
    print("|---|---|---|---|---|", flush=True)
    for case in cases:
        subprocess.run([*python("mesh_setup"), "--case", *map(str, case)], check=True)

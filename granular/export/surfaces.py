"""Surfaces of the rigid bodies of a record, in a file that ParaView opens with the record."""

import os
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import scipy

from granular.export.marks import marked
from granular.export.outlines import SIDES, SKIN, Patches, contoured, extended, revolved, thickened
from granular.model.grid import Grid
from granular.mpm.bodies import Body, BodyState, split
from granular.record.layout import LIBVER, TOPOLOGIES
from granular.record.polydata import begin_poly_data, write_steps
from granular.record.reader import Trajectory
from granular.shapes.boxes import Box, HalfSpace
from granular.shapes.height_map import HeightMap
from granular.shapes.mesh import Mesh
from granular.shapes.operations import Union
from granular.shapes.round import Capsule, Cylinder, Frustum, Sphere, Torus
from granular.shapes.sections import Polygon, Prism, Revolve, Section
from granular.shapes.shape import Shape, frame_of
from granular.tools.arrays import Array, IndexArray
from granular.tools.checks import instance

POSE = ("position", "quaternion")
"""Numbers of a body that say where it is."""
DRAWN = (Box, Capsule, Cylinder, Frustum, HalfSpace, Section, Sphere, Torus)
"""Shapes whose surface is made of their numbers."""
MOST_POSTS = 500
"""Posts of a height map that are drawn along an axis at most."""
_FACES = ((0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3))


def write_bodies(
    record: Trajectory, path: str | os.PathLike[str], *, overwrite: bool = False
) -> Path:
    """Write the surfaces of all bodies at all frames, as VTKHDF PolyData.

    It has the times of the record. ParaView reads the points from the record and the bodies from
    this file: open both. A run whose record ends in ".vtkhdf" writes this file when it ends. The
    cell data "body" is the index of the body. "mark" is 1 on every other sector of a body that
    turns, by which its turning is seen, and 0 elsewhere. If no body moves, the surfaces are stored
    once for all frames. Round surfaces have 64 sides. Results of operations are drawn by their
    signed distance on a grid of 64 intervals, which cuts off edges and leaves out walls thinner
    than an interval. Unbounded shapes end at a distance of one size of the grid. In 2D the surfaces
    are flat.

    Parameters
    ----------
    path : path
        File to write, usually ending in ``.vtkhdf``.
    overwrite : bool
        True to replace an existing file.

    Raises
    ------
    ValueError
        If the scene has no bodies, or the record no frames.
    FileExistsError
        If the file exists and `overwrite` is not set.
    """
    instance("record", record, Trajectory)
    scene = record.scene
    if not scene.bodies or not len(record):
        raise ValueError(f"record = {record!r} must have bodies and frames")
    grid = scene.grid
    size = float(np.linalg.norm(np.subtract(grid.upper, grid.lower)))
    surfaces = [marked_surface(body, grid.dim, size) for body in scene.bodies]
    meshes, marks = [mesh for mesh, _ in surfaces], [mark for _, mark in surfaces]
    poses = [split(record.bodies[:, k], 3) for k in range(len(meshes))]
    moving = any(np.ptp(pose[name], axis=0).any() for pose in poses for name in POSE)
    points = np.concatenate(
        [
            _placed(mesh[0], {name: pose[name][: None if moving else 1] for name in POSE})
            for mesh, pose in zip(meshes, poses, strict=True)
        ],
        axis=1,
    )
    polygons = _joined(meshes)[1]
    owner = np.repeat(np.arange(len(meshes)), [len(mark) for mark in marks])
    data = {"body": owner, "mark": np.concatenate(marks)}
    path = Path(path)
    if path.exists() and not overwrite:
        raise FileExistsError(f"{path} exists already; overwrite=True replaces it")
    making = path.with_name(f"{path.name}.{os.getpid()}")  # the file appears as a whole
    try:
        with h5py.File(making, "w", libver=LIBVER) as file:
            _write(file.create_group("VTKHDF"), record.times, points, polygons, data)
        making.replace(path)
    finally:
        making.unlink(missing_ok=True)
    return path


def marked_surface(body: Body, dim: int, size: float) -> tuple[Patches, IndexArray]:
    """Surface of a body in its own coordinates, and the mark of each polygon, see `marked`."""
    patches = surface(body.shape, dim, size)
    return marked(patches) if body.turns else (patches, np.zeros(len(patches[1]), dtype=int))


def placed_surface(grid: Grid, body: Body, pose: BodyState) -> Patches:
    """Surface of a body in a pose, in the coordinates of the scene, in 2D at z = 0."""
    far = float(np.linalg.norm(np.subtract(grid.upper, grid.lower)))
    vertices, polygons = surface(body.shape, grid.dim, far)
    turn, position = np.eye(3), np.zeros(3)
    turn[: grid.dim, : grid.dim], position[: grid.dim] = pose.rotation, pose.position
    return vertices @ turn.T + position, polygons


def _placed(vertices: Array, pose: dict[str, Array]) -> Array:
    """Vertices of a body at every frame, shape (frames, n, 3)."""
    turn = scipy.spatial.transform.Rotation.from_quat(
        pose["quaternion"][:, [1, 2, 3, 0]]
    ).as_matrix()
    return np.einsum("fij,nj->fni", turn, vertices) + pose["position"][:, None]


def _joined(meshes: Sequence[Patches]) -> Patches:
    polygons: list[tuple[int, ...]] = []
    before = 0
    for vertices, faces in meshes:
        polygons += [tuple(before + i for i in face) for face in faces]
        before += len(vertices)
    return np.concatenate([vertices for vertices, _ in meshes]), polygons


def surface(shape: Shape, dim: int, size: float) -> Patches:
    """Surface of a shape (of a union part by part) in the coordinates of its body.

    Of a sheet its middle is drawn, of a height map the posts, or some of them if there are many.
    Where nothing else is known of a shape, its surface is that of its distance.
    """
    if isinstance(shape, Union):
        parts: Any = shape.parts
        return _joined([surface(part, dim, size) for part in parts])
    if isinstance(shape, Mesh):
        return shape.vertices, [(a, b, c) for a, b, c in shape.faces.tolist()]
    if isinstance(shape, HeightMap):
        return _posts(shape, size)
    hollow = shape.inside and not isinstance(shape, Cylinder)
    if len(shape.rows()) > shape.results or not isinstance(shape, DRAWN) or (dim == 2 and hollow):
        return contoured(shape, size)
    if isinstance(shape, Frustum) and shape.walls:
        boxes = [(at, axes, _box(np.minimum(half, size), dim)) for at, axes, half in shape.walls]
        return _joined([(v @ axes.T + at, faces) for at, axes, (v, faces) in boxes])
    centre, turn = frame_of(shape)
    vertices, faces = _patches(shape, turn, dim, size)
    return vertices @ turn.T + centre, faces


def _posts(part: HeightMap, size: float) -> Patches:
    """Quadrilaterals between posts; in 2D a strip below them."""
    sides = [
        np.unique(np.linspace(0, n - 1, min(n, MOST_POSTS)).round().astype(int))
        for n in part.z.shape
    ]
    z = part.z[np.ix_(*sides)].astype(float)
    *_, x = places = [
        low + np.linspace(0, n - 1, n)[side] * (high - low) / (n - 1)
        for low, high, n, side in zip(
            part.origin[::-1], part.upper[::-1], part.z.shape, sides, strict=True
        )
    ]
    if part.dim == 2:
        rows = np.stack([z, z - SKIN * size])
        vertices = np.stack([np.tile(x, 2), rows.ravel(), np.zeros(rows.size)], axis=1)
    else:
        rows = z
        across, along = np.meshgrid(*places, indexing="ij")
        vertices = np.stack([along.ravel(), across.ravel(), z.ravel()], axis=1)
    index = np.arange(rows.size).reshape(rows.shape)
    corners = (index[:-1, :-1], index[:-1, 1:], index[1:, 1:], index[1:, :-1])
    quads = np.stack([corner.ravel() for corner in corners], axis=1)
    return vertices, [(a, b, c, d) for a, b, c, d in quads.tolist()]


def _patches(shape: Shape, turn: Array, dim: int, size: float) -> Patches:
    """Surface of a shape of one part, in its own axes; unbounded parts have a given size."""
    if isinstance(shape, Box):
        return _box(np.minimum(0.5 * np.array((*shape.size, np.inf)[:3]), size), dim)
    if isinstance(shape, Cylinder) or (isinstance(shape, Sphere) and dim == 2):
        half = min(0.5 * getattr(shape, "length", np.inf), size)
        return _cylinder(shape.radius, half, shape.inside, dim, size)
    if isinstance(shape, HalfSpace):  # the normal is the third axis
        return _half_space(turn, dim, size)
    if isinstance(shape, Polygon | Prism):
        length = getattr(shape, "length", np.inf)
        return extended(_outline(shape), min(0.5 * length, size), dim)
    return revolved(_outline(shape), dim)


def _outline(shape: Shape) -> Array:
    """Outline of a polygon, or (r, z) of a solid of revolution, shape (n, 2)."""
    if isinstance(shape, Section):
        vertices = shape.samples()[0][0]
        if shape.thickness is None:
            return vertices
        return thickened(vertices, 0.5 * shape.thickness, radial=isinstance(shape, Revolve))
    if isinstance(shape, Frustum):
        return shape.samples()[0][0]
    if isinstance(shape, Torus):
        angle = 2 * np.pi * np.arange(SIDES) / SIDES
        across, along = np.cos(angle), np.sin(angle)
        return np.stack([shape.radius + shape.tube * across, shape.tube * along], axis=1)
    assert isinstance(shape, Capsule | Sphere)
    half = 0.5 * getattr(shape, "length", 0.0)
    angle = np.pi * (np.arange(SIDES // 2 + 1) / (SIDES // 2) - 0.5)
    side = np.where(angle > 0, half, -half)
    ends = np.stack([shape.radius * np.cos(angle), shape.radius * np.sin(angle) + side], axis=1)
    ends[[0, -1], 0] = 0.0
    return ends


def _box(half: Array, dim: int) -> Patches:
    corners = np.array([[x, y, z] for z in (-1, 1) for y in (-1, 1) for x in (-1, 1)])
    if dim == 2:
        return (corners * half)[:4] * [1, 1, 0], [_FACES[0]]
    return corners * half, list(_FACES)


def _cylinder(radius: float, half: float, inside: bool, dim: int, size: float) -> Patches:
    """Cylinder about the third axis; for a drum the inner surface, in 2D a ring."""
    angle = 2 * np.pi * np.arange(SIDES) / SIDES
    rim = np.stack([np.cos(angle), np.sin(angle), np.zeros(SIDES)], axis=1) * radius
    if dim == 2 and not inside:
        return rim, [tuple(range(SIDES))]
    if dim == 2:
        lower, upper = rim, rim * (1 + SKIN * size / radius)
    else:
        end = np.array([0.0, 0.0, half])
        lower, upper = rim - end, rim + end
    after = np.roll(np.arange(SIDES), -1)
    faces: list[tuple[int, ...]] = [
        (i, int(j), SIDES + int(j), SIDES + i) for i, j in enumerate(after)
    ]
    if dim == 3 and not inside:
        faces += [tuple(range(SIDES)), tuple(range(SIDES, 2 * SIDES))]
    return np.concatenate([lower, upper]), faces


def _half_space(turn: Array, dim: int, size: float) -> Patches:
    """Square part of the face of a half-space; in 2D a strip below the face."""
    if dim == 3:
        corners = np.array([[-1, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0]])
        return corners * size, [(0, 1, 2, 3)]
    corners = np.array([[-1, 0, 0], [1, 0, 0], [1, 0, -SKIN], [-1, 0, -SKIN]], dtype=float)
    if abs(turn[2, 1]) < abs(turn[2, 0]):  # one of the two tangents is out of plane
        corners = corners[:, [1, 0, 2]]
    return corners * size, [(0, 1, 2, 3)]


def _write(
    vtk: h5py.Group,
    times: Array,
    points: Array,
    polygons: list[tuple[int, ...]],
    data: dict[str, IndexArray],
) -> None:
    placed, count = points.shape[:2]
    frames = len(times)
    begin_poly_data(vtk)
    vtk["NumberOfPoints"] = np.full(frames, count, dtype="<i8")
    vtk["Points"] = points.reshape(-1, 3)
    corners = [len(polygon) for polygon in polygons]
    for name in TOPOLOGIES:
        group, filled = vtk.create_group(name), name == "Polygons"
        group["NumberOfCells"] = np.full(frames, len(polygons) * filled, dtype="<i8")
        group["NumberOfConnectivityIds"] = np.full(frames, sum(corners) * filled, dtype="<i8")
        group["Connectivity"] = np.concatenate(polygons if filled else [()]).astype("<i8")
        group["Offsets"] = np.cumsum([0, *(corners if filled else ())], dtype="<i8")
    cells = vtk.create_group("CellData")
    for name, numbers in data.items():
        cells[name] = numbers.astype("<i8")
    first = np.arange(frames, dtype="<i8") if placed == frames else np.zeros(frames, dtype="<i8")
    steps = write_steps(vtk, times, count * first)
    offsets = steps.create_group("CellDataOffsets")
    for name in data:
        offsets[name] = np.zeros(frames, dtype="<i8")

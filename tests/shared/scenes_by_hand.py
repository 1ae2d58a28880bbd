"""Scenes for tests, which name only what matters to the test."""

import numpy as np
from schemes_by_name import scheme_of

import granular as gr


def scene_with(*, gravity=9.8, **parts):
    """A scene of one second of mu(I) material, from the parts that are given.

    `gravity` is that along the last axis [m/s2], a constant vector, or a `gr.Gravity`.
    """
    if isinstance(gravity, (int, float)):
        gravity = (*(0.0,) * (parts["grid"].dim - 1), 0.0 - gravity)
    if not isinstance(gravity, gr.Gravity):
        gravity = gr.Gravity((0.0,), (tuple(gravity),))
    given = {"name": "test", "material": gr.MuI(E=1e6), "duration": 1.0}
    return gr.Scene(gravity=gravity, **given | parts)


def two_clouds(dim, cells, wide, points_per_axis):
    """Two clouds of `wide` cells that fly through each other in a box of so many cells."""
    cell = 0.05
    middle, size = 0.5 * cells * cell, wide * cell
    boxes = [
        gr.Box((middle,) * dim, (middle + size,) * dim),
        gr.Box((middle - size,) * dim, (middle,) * dim),
    ]
    return scene_with(
        grid=gr.Grid((0.0,) * dim, cell, (cells,) * dim, periodic=(True,) + (False,) * (dim - 1)),
        fills=tuple(
            gr.Fill(box, points_per_axis**dim, jitter=1.0, density=3e3, velocity=velocity)
            for box, velocity in zip(boxes, ((9.0,) * dim, (-6.0,) * dim), strict=True)
        ),
        material=gr.MuI(E=1e5),
        gravity=0.0,
    )


def bed_with_bodies(dim, thin=False):
    """A bed with a rotating bucket, a free box and a disc that moves back and forth."""
    up, turning = dim - 1, 3.0 if dim == 2 else (0.0, -3.0, 0.0)
    shape, middle = ((16, 12), ()) if dim == 2 else ((8, 4, 6), (0.2,))
    cell = 0.8 / shape[0]
    edges = (2 * cell,) * (dim - 2)
    # thin: sides separated by duplicate nodes; thick: separated by the nodes alone
    thickness = 0.05 if thin else 2 * cell
    bucket = gr.Union(
        (
            gr.Box(size=(0.2, *edges, thickness)),
            gr.Box(size=(thickness, *edges, 0.2), center=(0.1,) * dim),
        )
    )
    roller = gr.Cylinder(0.06, center=(0.0,) * dim, axis=None if dim == 2 else (0, 1, 0))
    rest = (0.0,) * dim
    bodies = (
        gr.Body(
            bucket,
            (0.2, *middle, 0.3),
            motion=gr.Motion(velocity=(rest,), angular_velocity=(turning,)),
            contact="sticky",
        ),
        gr.Body(
            gr.Box(size=(max(0.15, 2 * cell), *edges, 2 * cell)),
            (0.5, *middle, 0.45),
            free="xy" if dim == 2 else "xyz",
            mass=3.0,
            friction=0.3,
        ),
        gr.Body(
            roller,
            (0.6, *middle, 0.2),
            motion=gr.Motion(
                times=(0.0, 0.02, 0.05),
                velocity=((0.5, *rest[1:]), (-1.0, *rest[1:]), (0.2, *rest[1:])),
            ),
            contact="bilateral",
            friction=0.2,
        ),
    )
    size = tuple(cell * n for n in shape)
    return scene_with(
        grid=gr.Grid((0.0,) * dim, cell, shape),
        fills=(gr.Fill(gr.Box((0.0,) * dim, (*size[:-1], 0.4)), 2**dim, jitter=1.0),),
        scheme=gr.Scheme(density=gr.ParticleDensity()) if thin else gr.Scheme(),
        walls=(gr.Wall(up, 0.0, kind="no_slip"),),
        bodies=bodies,
        seed=2,
    )


def sleeping_bed(combination, sleep_speed=2e-3, *, dim=2, height=0.3, top=0.5, **more):
    """A bed in equilibrium between smooth sides, and a block that falls on it; height 0: none."""
    cell, width, depth, thick = 0.02, 0.48, 0.12, 0.06
    across = () if dim == 2 else (thick,)
    fills = [
        gr.Fill(
            gr.Box((0.0,) * dim, (width, *across, depth)),
            points_per_cell=4 if dim == 2 else 8,
            lithostatic=True,
        )
    ]
    if height:
        block = gr.Box((0.2, *[0.0] * (dim - 2), height), (0.28, *across, height + 0.08))
        fills.append(gr.Fill(block, points_per_cell=4 if dim == 2 else 8))
    sides = [gr.Wall(0, at, kind="free_slip") for at in (0.0, width)]
    sides += [gr.Wall(1, at, kind="free_slip") for at in ((0.0, thick) if dim == 3 else ())]
    return scene_with(
        grid=gr.Grid((0.0,) * dim, cell, tuple(round(a / cell) for a in (width, *across, top))),
        fills=fills,
        walls=[*sides, gr.Wall(dim - 1, 0.0, kind="no_slip")],
        material=gr.materials.glass_beads.replace(E=1e6),
        scheme=scheme_of(*combination).replace(sleep_speed=sleep_speed),
        **more,
    )


def mass(scene):
    """Mass of all points of a scene at the start [kg]."""
    points = scene.points()
    return np.sum(points.volume * points.density)

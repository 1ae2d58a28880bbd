"""Random scenes of fills and bodies that touch: one another, and the ends of the grid."""

from itertools import pairwise

import numpy as np
from scenes_by_hand import scene_with

import granular as gr
from granular import shapes


def _turned(rng, dim):
    return float(rng.uniform(0, 360)) if dim == 2 else tuple(rng.uniform(0, 180, 3).tolist())


def _shape(rng, dim, size):
    """A ball, a box, a keel, a plate or a body with an inner edge."""
    kind = rng.integers(6)
    if kind == 0:
        center = (0.0,) * dim
        return (shapes.Cylinder if dim == 2 else shapes.Sphere)(size, center=center)
    if kind == 1:
        return shapes.Box(size=tuple((size * rng.uniform(0.5, 2, dim)).tolist()))
    if kind == 2:
        keel = [(-size, 0.6 * size), (0.0, -size), (size, 0.6 * size)]
        return shapes.Polygon(keel) if dim == 2 else shapes.Prism(keel, size, axis="y")
    if kind == 3:
        return shapes.Box(size=(2 * size, 0.2 * size, size)[:dim])
    block = shapes.Box(size=(2 * size,) * dim)
    if kind == 4:
        return shapes.Difference(block, shapes.Box(size=(size,) * dim, center=(0.6 * size,) * dim))
    return shapes.Capsule(0.4 * size, size, center=(0.0,) * dim, axis=(1.0,) * dim)


def _bodies(rng, grid):
    """Bodies anywhere, or just touching an end of the grid."""
    dim, found = grid.dim, []
    lower, upper = np.array(grid.lower), np.array(grid.upper)
    for _ in range(rng.integers(4 if dim == 2 else 3)):
        size = float(grid.cell * rng.uniform(1.5, 3.5))
        shape = _shape(rng, dim, size)
        at = rng.uniform(lower - 0.5 * size, upper + 0.5 * size)
        turned = 0.0 if dim == 2 and rng.random() < 0.3 else _turned(rng, dim)
        body = gr.Body(shape, tuple(at.tolist()), rotation_deg=turned)
        if rng.random() < 0.5:  # it touches an end
            axis = int(rng.integers(dim))
            reach = size if isinstance(shape, (shapes.Cylinder, shapes.Sphere)) else None
            reach = float(body.extents()[axis]) if reach is None else reach
            at[axis] = rng.choice([lower[axis] + reach, upper[axis] - reach])
            body = gr.Body(shape, tuple(at.tolist()), rotation_deg=turned)
        found.append(body)
    return tuple(found)


def _slab(rng, low, high, solid):
    """Regions that take a box between them, which touch along whole faces."""
    low, high = np.array(low), np.array(high)
    dim, size = len(low), high - low
    box = (tuple(low.tolist()), tuple(high.tolist()))
    kind = rng.integers(8)
    if kind == 0:
        return [gr.Box(*box)]
    middle, radius = 0.5 * (low + high), 0.45 * size.min()
    disc = gr.Sphere(float(radius), center=tuple(middle.tolist()))
    if kind == 1:
        return [disc, gr.Difference(gr.Box(*box), disc)]
    if kind == 2:  # two parts on both sides of an oblique line
        u, w = low[0] + size[0] * rng.uniform(0.2, 0.8, 2)
        left = [(low[0], low[-1]), (u, low[-1]), (w, high[-1]), (low[0], high[-1])]
        right = [(u, low[-1]), (high[0], low[-1]), (high[0], high[-1]), (w, high[-1])]
        span = {} if dim == 2 else {"span": (low[1], high[1]), "axis": "y"}
        return [gr.Polygon(left, **span), gr.Polygon(right, **span)]
    if kind in (3, 4):  # layers on each other
        count = (5,) * (dim - 1)
        spacing = float((size[:-1] / 4).max())
        z = low[-1] + size[-1] * rng.uniform(0.2, 0.7, count)
        line = gr.Heights(z, tuple(low[:-1].tolist()), spacing)
        ends = (tuple(low[:-1].tolist()), tuple(high[:-1].tolist()))
        ends = tuple(end[0] if dim == 2 else end for end in ends)
        below = gr.Heights(z - low[-1], tuple(low[:-1].tolist()), spacing)
        above = gr.Heights(high[-1] - z, tuple(low[:-1].tolist()), spacing)
        return [gr.Layer(low[-1], below, *ends), gr.Layer(line, above, *ends)]
    if kind == 5:
        x = rng.uniform(low, high, (40, dim))
        x = x[np.all([body.distance(x)[0] > 0 for body in solid], axis=0)] if solid else x
        return [] if not len(x) else [gr.Cloud(x, np.full(len(x), 1e-9 * np.prod(size)))]
    if kind == 6:
        half = middle.copy()
        half[0] = low[0] + size[0] * rng.uniform(0.3, 0.7)
        parts = (gr.Box(box[0], (float(half[0]), *box[1][1:])), disc)
        return [gr.Union(parts)]
    corner = gr.Box(tuple(middle.tolist()), box[1])
    return [gr.Difference(gr.Box(*box), corner), corner]


def random_scene(seed):
    """A scene of any number of bodies, of slabs of regions in contact, at any place."""
    rng = np.random.default_rng(seed)
    dim = 2 if rng.random() < 0.7 else 3
    cell = float(rng.choice([0.1, 1 / 64, 0.013]))
    shape = tuple(rng.integers(*((10, 18) if dim == 2 else (5, 9)), dim).tolist())
    origin = float(rng.choice([0.0, -0.37, 31.7, 5e6]))
    solid = _bodies(rng, gr.Grid((origin,) * dim, cell, shape))
    periodic = (False,) * dim if solid else tuple((rng.random(dim) < 0.2).tolist())
    grid = gr.Grid((origin,) * dim, cell, shape, periodic)
    low, high = np.array(grid.lower), np.array(grid.upper)
    axis, count = int(rng.integers(dim)), int(rng.integers(1, 4))
    cuts = np.sort(rng.uniform(low[axis], high[axis], count - 1))
    if rng.random() < 0.5:
        cuts = np.rint((cuts - low[axis]) / cell) * cell + low[axis]
    ends = np.array([low[axis], *cuts, high[axis]])
    fills = []
    for a, b in pairwise(ends):
        if b - a < 2 * cell:  # too thin to hold a point
            continue
        begin, end = low.copy(), high.copy()
        begin[axis], end[axis] = a, b
        for region in _slab(rng, begin, end, solid):
            fills.append(
                gr.Fill(
                    region,
                    int(rng.integers(1, 4)) ** dim,
                    jitter=float(rng.choice([0.0, 0.3, 1.0])),
                    stagger=bool(rng.random() < 0.3),
                )
            )
    fills = fills or [gr.Fill(gr.Box(tuple(low.tolist()), tuple(high.tolist())), 2**dim)]
    return scene_with(
        name=f"random {seed}",
        grid=grid,
        fills=tuple(fills),
        scheme=gr.Scheme(transfer="tpic", density=gr.ParticleDensity()),
        bodies=solid,
        seed=seed,
    )

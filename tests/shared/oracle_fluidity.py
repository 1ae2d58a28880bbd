"""Plain reference for the fluidity: a dense matrix for the grid, 60 digits for a single point."""

from decimal import Decimal, localcontext

import numpy as np
from numpy.polynomial.legendre import legval

from granular import _core

LINKED, OPEN, ROUGH = 0, 1, 2


def available():
    """Instruction sets that this machine supports."""
    found = []
    for name in ("one_lane", "baseline", "avx2", "avx512"):
        try:
            _core.build_info(name)
        except ValueError:
            continue
        found.append(name)
    return found


# ---- the grid ----


def faces_of(shape, **sides):
    """Faces, all linked inside; `sides` sets the ends of the grid: {"x_low": ROUGH, ...}."""
    faces = np.full((2 * len(shape), *shape), LINKED, dtype=np.uint8)
    for name, kind in sides.items():
        axis, side = "xyz".index(name[0]), name.endswith("high")
        where = [slice(None)] * len(shape)
        where[len(shape) - 1 - axis] = -1 if side else 0
        faces[(2 * axis + side, *where)] = kind
    return faces


def random_parts(shape, rng, shares=(0.8, 0.1, 0.1), dense=0.85):
    """Random faces inside and at the ends, a random mask, some axes periodic."""
    faces = rng.choice([LINKED, OPEN, ROUGH], (2 * len(shape), *shape), p=shares)
    return {
        "faces": faces.astype(np.uint8),
        "dense": rng.random(shape) < dense,
        "periodic": tuple(bool(a) for a in rng.random(len(shape)) < 0.5),
    }


def outflow(dense, faces, periodic, first_radius=None):
    """The matrix L of the outflow: lap g = -L g/dx^2, cells in the order of `dense.ravel()`.

    In rings the first axis begins at `first_radius` [cells], and faces normal to it count by their
    radius over that of the cell.
    """
    shape, dim = dense.shape, dense.ndim
    number = np.arange(dense.size).reshape(shape)
    L = np.zeros((dense.size, dense.size))
    for cell in np.ndindex(shape):
        if not dense[cell]:
            continue
        i = number[cell]
        for axis in range(dim):
            for side in (0, 1):
                kind = faces[(2 * axis + side, *cell)]
                face = 1.0
                if first_radius is not None and axis == 0:
                    face += (side - 0.5) / (first_radius + cell[-1] + 0.5)
                if kind == ROUGH:
                    L[i, i] += 2 * face
                    continue
                beyond = list(cell)
                place = dim - 1 - axis
                beyond[place] += 2 * side - 1
                if periodic[axis]:
                    beyond[place] %= shape[place]
                beyond = tuple(beyond)
                if not 0 <= beyond[place] < shape[place] or not dense[beyond] or beyond == cell:
                    continue
                if kind == LINKED and faces[(2 * axis + 1 - side, *beyond)] == LINKED:
                    L[i, i] += face
                    L[i, number[beyond]] -= face
    return L


def stages(ratio):
    """Smallest odd number of rkl2 stages that is stable for `ratio` explicit limits."""
    s = 3
    while not ratio < (s * s + s - 2) / 4:
        s += 2
    return s


def step(method, L, k, g, ratio=None):
    """One step of g' = -L g with k = dt A^2 d^2/(t0 dx^2), without clamping at zero."""
    if method == "explicit":
        return g - k * (L @ g)
    if method == "implicit":
        return np.linalg.solve(np.eye(len(L)) + k * L, g)
    # Of rings L is symmetric in an inner product: its eigenvalues are real, too.
    find = np.linalg.eigh if np.array_equal(L, L.T) else np.linalg.eig
    value, vectors = find(L)
    s = stages(ratio)
    b, w1 = (s * s + s - 2) / (2 * s * (s + 1)), 4 / (s * s + s - 2)
    growth = 1 - b + b * legval(1 - w1 * k * value, [0] * s + [1])
    return vectors @ (growth * np.linalg.solve(vectors, g))


def diffuse(
    g, *, faces=None, dense=None, periodic=None, distance=None, threads=1, isa="", **numbers
):
    """Apply `_core.fluidity_diffuse` to a copy of g; return the copy and the report."""
    g = g.copy()
    given = {
        "method": "implicit", "stencil": "faces", "dx": 0.01, "A": 0.5, "d": 0.005, "t0": 1e-3,
        "dt": 1e-3, "steps": 1,
        "tolerance": 1e-13, "max_iterations": 10_000, "first_radius": -1.0,
    } | numbers  # fmt: skip
    report = _core.fluidity_diffuse(
        g=g,
        faces=faces_of(g.shape) if faces is None else faces,
        dense=np.ones(g.shape, dtype=bool) if dense is None else dense,
        periodic=(False,) * g.ndim if periodic is None else periodic,
        distance=distance,
        threads=threads,
        isa=isa,
        **given,
    )
    return g, report


def number_k(dt, *, dx=0.01, A=0.5, d=0.005, t0=1e-3):
    """k of `step` for the arguments of `diffuse`."""
    return dt * A**2 * d**2 / (t0 * dx**2)


# ---- a point ----


def exactly(a):
    """Exact decimal value of a floating-point number."""
    return a if isinstance(a, Decimal) else Decimal(float(a))


def point(q, dt, m, p, g_star, rate):
    """mu, X = G dt g/p and the condition number of X at one point, in 60 digits.

    X solves the quadratic that follows from (5.6), here derived again and without a division. It is
    the larger of the two roots, the only one with X >= 0 and mu < mu_2. The condition number is the
    relative change of X over that of the terms in the linear coefficient.
    """
    with localcontext() as context:
        context.prec = 60
        G, mu_s, mu_2, I0, rho_s, d, t0 = (
            Decimal(q[name]) for name in ("G", "mu_s", "mu_2", "I0", "rho_s", "d", "t0")
        )
        dt, m, p, g_star, rate = map(exactly, (dt, m, p, g_star, rate))
        spread = Decimal(q["p_averaging"])
        roots = (p + spread).sqrt() + max(p - spread, Decimal(0)).sqrt()
        f = dt * (mu_2 - mu_s) / t0
        growth = 1 + f * rate * d * rho_s.sqrt() * 2 / roots / I0
        start = G * dt * g_star / p
        a = growth * mu_2 + f * mu_s
        b = growth * (mu_2 - m) + f * (mu_s - m) - mu_2 * start
        c = -(mu_2 - m) * start
        root = (b * b - 4 * a * c).sqrt()
        X, other = (-b + root) / (2 * a), (-b - root) / (2 * a)
        if c:  # for c = 0 the other root is g = 0, from which the larger one has grown
            assert other < 0 or m / (1 + other) >= mu_2
        X = X if c else max(Decimal(0), -b / a)
        assert X >= 0
        assert m / (1 + X) < mu_2
        size = growth * abs(mu_2 - m) + f * abs(mu_s - m) + mu_2 * start
        return m / (1 + X), X, size / root


def residual(q, dt, m, p, g_star, rate, mu, X):
    """Residual of the fluidity equation (5.4), divided by its largest term."""
    with localcontext() as context:
        context.prec = 60
        G, mu_s, mu_2, I0, rho_s, d, t0 = (
            Decimal(q[name]) for name in ("G", "mu_s", "mu_2", "I0", "rho_s", "d", "t0")
        )
        dt, p, g_star, rate = (Decimal(float(a)) for a in (dt, p, g_star, rate))
        g, dmu = X * p / (G * dt), mu_2 - mu_s
        terms = (
            (g - g_star) / dt,
            dmu * (mu_s - mu) / (mu_2 - mu) * g / t0,
            dmu / I0 * (rho_s * d * d / p).sqrt() * rate * g / t0,
        )
        return float(abs(sum(terms)) / max(map(abs, (*terms, Decimal("1e-300")))))

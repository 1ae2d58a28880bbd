"""States made by hand, with the attributes of `granular.State`, whose measures are known."""

from types import SimpleNamespace

import numpy as np

from granular import Gravity, Grid

RHO_C = 1500.0
RHO_S = 2450.0
XI = 1.1233


def material(**changes):
    """Glass beads (table 1) with their rate constant given as xi."""
    E, nu = 1e7, 0.3
    numbers = dict(
        E=E, nu=nu, K=E / (3 * (1 - 2 * nu)), G=E / (2 * (1 + nu)), mu_s=0.3819, mu_2=0.6435,
        rho_s=RHO_S, rho_c=RHO_C, xi=XI, I0=None, d=None, granular=True,
    )  # fmt: skip
    return SimpleNamespace(**(numbers | changes))


def scene(shape, cell, *, lower=None, periodic=None, gravity=None, parameters=None, grains=None):
    """Grid, material and constant gravity of a scene."""
    dim = len(shape)
    grains = grains or material()
    down = (0.0,) * (dim - 1) + (-9.8,) if gravity is None else gravity
    return SimpleNamespace(
        name="synthetic",
        method="mpm",
        grid=Grid((0.0,) * dim if lower is None else lower, cell, tuple(shape), periodic or ()),
        material=grains,
        materials=(grains,),
        gravity=Gravity((0.0,), (down,)),
        duration=1.0,
        parameters=parameters or {},
    )


def silo(*, half, cell=0.0175, rows=36, width=0.14, left=None, **changes):
    """A silo 0.595 m wide, or half of it; the middle of the opening is at x = 0 by default."""
    columns = round((0.2975 if half else 0.595) / cell)
    left = (0.0 if half else -columns * cell / 2) if left is None else left
    parameters = {"orifice": width, "half": half}
    return scene((columns, rows), cell, lower=(left, 0.0), parameters=parameters, **changes)


def state(scene, x, *, mass=None, rho=RHO_C, per_cell=4, time=0.0, ids=None, **fields):
    """A state; the mass defaults to that of `per_cell` points in a cell at rho_c."""
    x = np.asarray(x, dtype=float).reshape(-1, len(scene.grid.shape))
    n, dim = x.shape
    mass = RHO_C * scene.grid.cell**dim / per_cell if mass is None else mass
    mass = np.broadcast_to(np.asarray(mass, dtype=float), n)
    stress = np.asarray(fields.get("stress", np.zeros((n, 4 if dim == 2 else 6))), dtype=float)
    v = np.asarray(fields.get("v", np.zeros((n, dim))), dtype=float)
    rho = np.broadcast_to(np.asarray(rho, dtype=float), n)
    p = -stress[:, :3].sum(axis=1) / 3
    rate = np.broadcast_to(np.asarray(fields.get("shear_rate", 0.0), dtype=float), n)

    def of_material(name, missing=np.nan):
        value = getattr(scene.material, name, None)
        return np.full(n, missing if value is None else value)

    rest_volume = mass / getattr(scene.material, "rho_c", RHO_C)
    return SimpleNamespace(
        scene=scene, time=time, step=0, dt=0.0, n=n, dim=dim,
        x=x, v=v, stress=stress, mass=mass, density=rho,
        of_material=of_material, rest_volume=rest_volume, rest_section=rest_volume,
        volume=mass / rho, section=mass / rho, rings=np.ones(n), quadrature_volume=mass / rho,
        pressure=p, dense=p > 0, shear_rate=rate, log_density=np.log(rho / RHO_C),
        id=np.arange(n) if ids is None else np.asarray(ids),
    )  # fmt: skip


def regular_points(scene, per_axis=2, keep=None):
    """Regularly spaced points, `per_axis`**dim in every cell of the grid, where keep(x) is true."""
    grid = scene.grid
    axes = [
        low + grid.cell * (np.arange(count * per_axis) + 0.5) / per_axis
        for low, count in zip(grid.lower, grid.shape, strict=True)
    ]
    x = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, len(axes))
    return x if keep is None else x[keep(x)]


def filled(scene, per_axis=2, keep=None, **fields):
    """State of regular points with their mass; fields that are functions are those of x."""
    x = regular_points(scene, per_axis, keep)
    made = {name: f(x) if callable(f) else f for name, f in fields.items()}
    return state(scene, x, **({"per_cell": per_axis ** x.shape[1]} | made))


def isotropic(p, dim=2):
    """Stress rows of the pressures p."""
    p = np.asarray(p, dtype=float)
    stress = np.zeros((len(p), 4 if dim == 2 else 6))
    stress[:, :3] = -p[:, None]
    return stress

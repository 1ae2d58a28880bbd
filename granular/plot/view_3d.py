"""Pictures of 3D states and their bodies, drawn off-screen by pyvista."""

import os
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.colors import LogNorm
from numpy.typing import ArrayLike, NDArray

from granular.checks import in_range, integer, one_of
from granular.mpm.bodies import BodyState, state_of
from granular.plot.fields import MISSING, Brush
from granular.record import Trajectory
from granular.record.surfaces import surface
from granular.simulation import Simulation
from granular.state import State

CAMERAS = ("iso", "xy", "xz", "yz", "yx", "zx", "zy")
TOOL = "#9aa0a6"
"""Colour of bodies."""
BAR = {
    "vertical": True, "position_x": 0.8, "position_y": 0.15, "height": 0.7, "width": 0.08,
    "n_labels": 3, "fmt": "%.3g", "title_font_size": 14, "label_font_size": 12,
}  # fmt: skip


def view(
    source: State | Simulation | Trajectory,
    path: str | os.PathLike[str],
    color: str | ArrayLike = "shear_rate",
    *,
    frame: int = -1,
    bodies: Sequence[BodyState] | None = None,
    slab: tuple[str, float, float] | None = None,
    camera: str | tuple[float, float, float] = "iso",
    limits: tuple[float, float] | None = None,
    log: bool | None = None,
    cmap: str | None = None,
    opacity: float = 1.0,
    window: tuple[int, int] = (960, 720),
) -> Path:
    """Draw 3D material points and bodies to a file, without opening a window.

    Parameters
    ----------
    source : State, Simulation or Trajectory
        State to draw; a simulation or a record also shows its bodies at their positions.
    path : path
        PNG file to write.
    color, limits, log, cmap
        See `granular.plot.frame`.
    frame : int
        Frame of a record; by default the last one.
    bodies : sequence of BodyState, optional
        If `source` is a state: the poses of the bodies of its scene, in their order (`sim.bodies`).
        Without them no body is drawn.
    slab : (axis, low, high), optional
        Draw only the slice of points between two coordinates [m] along the axis "x", "y" or "z".
    camera : {"iso", "xy", "xz", "yz", "yx", "zx", "zy"} or (float, float, float)
        The axes to the right and up, or the direction from the middle to the eye, with z up.
    opacity : float
        Opacity of the bodies, 0 to 1.
    window : (int, int)
        Width and height of the picture [pixels].

    Returns
    -------
    Path

    Raises
    ------
    ModuleNotFoundError
        If pyvista is not installed: ``pip install 'granular[pictures3d]'``.
    TypeError, ValueError
        Naming argument, value and allowed range.
    """
    pyvista = _pyvista()
    state, poses = _look(source, frame, bodies)
    size = tuple(integer(f"window[{k}]", n, 16) for k, n in enumerate(window))
    brush = Brush.fitted([state], color, limits=limits, log=log, cmap=cmap)
    solid = in_range("opacity", opacity, 0.0, 1.0)
    seen = _within(state, slab)
    plotter = pyvista.Plotter(off_screen=True, window_size=size)
    try:
        if seen.any():
            cloud = pyvista.PolyData(np.ascontiguousarray(state.x[seen]))
            cloud[brush.quantity.title] = brush.paint(state).filled(np.nan)[seen]
            plotter.add_mesh(
                cloud,
                clim=(brush.norm.vmin, brush.norm.vmax),
                log_scale=isinstance(brush.norm, LogNorm),
                cmap=brush.cmap,
                nan_color=MISSING,
                point_size=_pixels(state, min(size)),
                render_points_as_spheres=True,
                scalar_bar_args=BAR,
            )
        for mesh in _meshes(pyvista, state, poses):
            plotter.add_mesh(mesh, color=TOOL, opacity=solid)
        plotter.add_text(f"t = {state.time:.3g} s", font_size=10)
        _aim(plotter, camera)
        plotter.screenshot(str(path))
    finally:
        plotter.close()
    return Path(path)


def _pixels(state: State, width: int) -> float:
    """Diameter of a point in pixels, a little more than the spacing if all points are in view."""
    spacing = float(state.volume.mean()) ** (1 / 3)
    spread = float(np.ptp(state.x, axis=0).max()) + spacing
    return max(2.0, 1.2 * width * spacing / spread)


def _meshes(pyvista: Any, state: State, poses: Sequence[BodyState]) -> list[Any]:
    """Surfaces of the bodies in their poses."""
    grid, found = state.scene.grid, []
    far = float(np.linalg.norm(np.subtract(grid.upper, grid.lower)))
    for body, pose in zip(state.scene.bodies, poses, strict=bool(poses)):
        vertices, polygons = surface(body.shape, 3, far)
        faces = np.concatenate([(len(polygon), *polygon) for polygon in polygons])
        found.append(pyvista.PolyData(vertices @ pose.rotation.T + pose.position, faces))
    return found


def _pyvista() -> Any:
    try:
        import pyvista
    except ModuleNotFoundError as error:
        raise ModuleNotFoundError(
            f"{error}: 3D pictures need pyvista: pip install 'granular[pictures3d]'"
        ) from error
    return pyvista


def _look(
    source: State | Simulation | Trajectory, frame: int, bodies: Sequence[BodyState] | None
) -> tuple[State, Sequence[BodyState]]:
    """Return the 3D state to draw, and the poses of its bodies."""
    poses: Sequence[BodyState]
    if isinstance(source, Trajectory):
        state = source[integer("frame", frame, -len(source), len(source) - 1)]
        poses = [state_of(numbers, state.dim) for numbers in source.bodies[frame]]
    elif isinstance(source, Simulation):
        state, poses = source.state, getattr(source, "bodies", ())
    else:
        state, poses = source, () if bodies is None else tuple(bodies)
        if poses and len(poses) != len(state.scene.bodies):
            raise ValueError(
                f"bodies: {len(poses)} must be as many as those of the scene, "
                f"{len(state.scene.bodies)}"
            )
    if state.dim != 3:
        raise ValueError(f"source of dimension {state.dim} must have 3: see plot.frame")
    return state, poses


def _within(state: State, slab: tuple[str, float, float] | None) -> NDArray[np.bool_]:
    if slab is None:
        return np.ones(state.n, dtype=bool)
    axis, low, high = slab
    one_of("slab[0]", axis, ("x", "y", "z"))
    if not low < high:
        raise ValueError(f"slab = {slab} must ascend")
    along = state.x[:, "xyz".index(axis)]
    return (along >= low) & (along <= high)


def _aim(plotter: Any, camera: str | tuple[float, float, float]) -> None:
    """Aim the camera."""
    if isinstance(camera, str):
        plotter.camera_position = one_of("camera", camera, CAMERAS)
        return
    direction = np.asarray(camera, dtype=float)
    if direction.shape != (3,) or not np.isfinite(direction).all() or not direction.any():
        raise ValueError(f"camera = {camera} must be three finite numbers, not all 0")
    up = (0.0, 0.0, 1.0) if direction[:2].any() else (0.0, 1.0, 0.0)
    plotter.view_vector(tuple(direction), viewup=up)

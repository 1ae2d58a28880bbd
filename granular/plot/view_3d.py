"""Views, pictures and movies of 3D states and their bodies, drawn by pyvista."""

from __future__ import annotations

import math
import os
import sys
from collections.abc import Sequence
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.colors import LogNorm
from numpy.typing import ArrayLike, NDArray

from granular.export.surfaces import marked_surface
from granular.model.state import State
from granular.plot.encoding import Movie, check_movie, make_movie, sampled
from granular.plot.fields import MISSING, Brush
from granular.plot.volume import filled_volume, inside_slab
from granular.record import Trajectory
from granular.run.simulation import Simulation
from granular.tools.checks import in_range, integer, one_of
from granular.tools.extras import imported
from granular.tools.notebook import in_notebook

CAMERAS = ("iso", "xy", "xz", "yz", "yx", "zx", "zy")
STYLES = ("surface", "points")
TOOLS = "#9aa0a6", "#5f666d"
"""Colours of bodies, and of the mark of those that turn."""
GLOSS = {"ambient": 0.25, "diffuse": 0.8, "specular": 0.15, "specular_power": 20.0}
"""Light on material and bodies: no part is black, and edges are visible."""
BAR = {
    "vertical": True, "position_x": 0.86, "position_y": 0.15, "height": 0.7, "width": 0.06,
    "n_labels": 3, "fmt": "%.3g", "title_font_size": 14, "label_font_size": 12, "color": "black",
}  # fmt: skip

Slab = tuple[str, float, float]


def view(
    source: State | Simulation | Trajectory,
    path: str | os.PathLike[str] | None = None,
    color: str | ArrayLike = "shear_rate",
    *,
    frame: int = -1,
    style: str = "surface",
    slab: Slab | None = None,
    camera: str | tuple[float, float, float] = "iso",
    limits: tuple[float, float] | None = None,
    log: bool | None = None,
    cmap: str | None = None,
    opacity: float = 1.0,
    window: tuple[int, int] = (960, 720),
) -> Any:
    """Show a 3D state and its bodies, to be turned with the mouse, or draw them to a file.

    In a notebook the view is part of the page; from a script it is a window, and the script goes on
    when it is closed. With a path a picture is drawn to a file instead, and no window is opened.

    Parameters
    ----------
    source : State, Simulation or Trajectory
        State to draw, with its bodies in their poses.
    path : path, optional
        PNG file to write.
    color, limits, log, cmap
        See `granular.plot.frame`.
    frame : int
        Frame of a record; by default the last one.
    style : {"surface", "points"}
        Draw the body of the material, up to its free surface, or its points as spheres. The free
        surface is where the filling fraction is one half, after smoothing over 1.5 spacings of the
        points; within a spacing or two of it single points are not visible.
    slab : (axis, low, high), optional
        Draw only the slice of material between two coordinates [m] along the axis "x", "y" or "z",
        whose cut faces have the colours of the inside.
    camera : {"iso", "xy", "xz", "yz", "yx", "zx", "zy"} or (float, float, float)
        The axes to the right and up, or the direction from the middle to the eye, with z up.
    opacity : float
        Opacity of the bodies, 0 to 1.
    window : (int, int)
        Width and height of the picture [pixels], at least 16.

    Returns
    -------
    Path or object
        The path of the file. Without one, in a notebook, the widget of PyVista, which shows itself;
        in a script None.

    Raises
    ------
    ModuleNotFoundError
        If pyvista is not installed: ``pip install 'granular-flow[pictures3d]'``; or in a notebook
        trame: ``pip install 'granular-flow[notebook]'``.
    RuntimeError
        If no path is given and there is no display for a window.
    TypeError, ValueError
        Naming argument, value and allowed range.
    """
    state = _state_of(source, frame)
    pyvista = imported("pyvista", "pictures3d")
    if path is None:
        _check_display(pyvista)
    brush = Brush.fitted([state], color, limits=limits, log=log, cmap=cmap)
    interactive = path is None
    stage = _Stage([state], brush, style, slab, camera, opacity, window, interactive=interactive)
    stage.show(state)
    if path is None:
        return stage.plotter.show(return_viewer=True)
    try:
        stage.plotter.screenshot(str(path))
    finally:
        stage.plotter.close()
    return Path(path)


def view_movie(
    record: Sequence[State] | Trajectory,
    path: str | os.PathLike[str] | None = None,
    color: str = "shear_rate",
    *,
    style: str = "surface",
    slab: Slab | None = None,
    camera: str | tuple[float, float, float] = "iso",
    limits: tuple[float, float] | None = None,
    log: bool | None = None,
    cmap: str | None = None,
    opacity: float = 1.0,
    window: tuple[int, int] = (960, 720),
    fps: float = 25.0,
    overwrite: bool = False,
    progress: bool = False,
) -> Movie:
    """Make a movie of 3D states as `view` draws them, with one camera and one scale of colours.

    Parameters
    ----------
    record : Trajectory or sequence of State
    path, fps, overwrite, progress
        See `granular.plot.movie`.
    color, style, slab, camera, limits, log, cmap, opacity, window
        See `view`. Scale and camera are fitted to 16 of the frames.

    Raises
    ------
    ModuleNotFoundError
        If pyvista is not installed.
    FileExistsError, FileNotFoundError, RuntimeError, TypeError, ValueError
        As `view` and `granular.plot.movie`.
    """
    check_movie(path, fps=fps, overwrite=overwrite)
    sample = [_state_of(record[i], -1) for i in sampled(len(record))]
    brush = Brush.fitted(sample, color, limits=limits, log=log, cmap=cmap)
    stage = _Stage(sample, brush, style, slab, camera, opacity, window)
    try:

        def shot(i: int) -> NDArray[np.uint8]:
            stage.show(record[i])
            pixels = np.asarray(stage.plotter.screenshot(return_img=True))
            height, width = (n - n % 2 for n in pixels.shape[:2])
            return np.ascontiguousarray(pixels[:height, :width, :3])

        return make_movie(path, len(record), shot, fps=fps, overwrite=overwrite, progress=progress)
    finally:
        stage.plotter.close()


class _Stage:
    """Plotter with a fixed camera, in which one state after the other is shown."""

    def __init__(
        self,
        states: Sequence[State],
        brush: Brush,
        style: str,
        slab: Slab | None,
        camera: str | tuple[float, float, float],
        opacity: float,
        window: tuple[int, int],
        *,
        interactive: bool = False,
    ) -> None:
        self._pyvista = imported("pyvista", "pictures3d")
        self._brush, self._slab = brush, _checked(slab)
        self._style = one_of("style", style, STYLES)
        self._opacity = in_range("opacity", opacity, 0.0, 1.0)
        self._size = tuple(integer(f"window[{k}]", n, 16) for k, n in enumerate(window))
        self._surfaces = _surfaces(self._pyvista, states[0])
        direction = _direction(camera)
        # by default pyvista itself decides between a window and a part of a notebook
        off_screen = None if interactive else True
        self.plotter = self._pyvista.Plotter(off_screen=off_screen, window_size=self._size)
        self.plotter.set_background("white")
        low, high = self._bounds(states)
        self._aim(camera, direction)
        self.plotter.reset_camera(bounds=tuple(np.stack([low, high], axis=1).ravel()))
        # The scale is at the right.
        self.plotter.camera.SetWindowCenter(0.12, 0.0)

    def _bounds(self, states: Sequence[State]) -> tuple[NDArray, NDArray]:
        """Box of the material and of the bodies of some states."""
        points = []
        for state in states:
            visible = state.x[inside_slab(state.x, self._slab)]
            points += [visible] if len(visible) else []
            points += [np.asarray(mesh.points) for mesh in self._placed(state)]
        every = np.concatenate(points) if points else np.array([states[0].scene.grid.lower])
        return every.min(axis=0), every.max(axis=0)

    def _placed(self, state: State) -> list[Any]:
        """Surfaces of the bodies in their poses."""
        placed = []
        for mesh, pose in zip(self._surfaces, state.bodies, strict=True):
            placed.append(mesh.copy())
            placed[-1].points = mesh.points @ pose.rotation.T + pose.position
        return placed

    def _aim(self, camera: str | tuple[float, float, float], direction: Any) -> None:
        if direction is None:
            self.plotter.camera_position = camera
        else:
            up = (0.0, 0.0, 1.0) if direction[:2].any() else (0.0, 1.0, 0.0)
            self.plotter.view_vector(tuple(direction), viewup=up)

    def show(self, state: State) -> None:
        """Show another state."""
        plotter, brush = self.plotter, self._brush
        plotter.clear_actors()
        scale = {
            "clim": (brush.norm.vmin, brush.norm.vmax),
            "cmap": brush.cmap,
            "nan_color": MISSING,
            "log_scale": isinstance(brush.norm, LogNorm),
            "scalar_bar_args": BAR | {"title": f"{brush.quantity.title}\n"},
        }
        mesh = self._material(state)
        if mesh is not None:
            points = {
                "point_size": _pixels(state, min(self._size)),
                "render_points_as_spheres": True,
            }
            options = points if self._style == "points" else {"smooth_shading": True} | GLOSS
            if self._style == "surface":
                options["split_sharp_edges"] = True
            plotter.add_mesh(mesh, reset_camera=False, **scale, **options)
        look: dict[str, Any] = {"opacity": self._opacity, "reset_camera": False} | GLOSS
        look |= {"scalars": "mark", "cmap": list(TOOLS), "clim": (0, 1), "show_scalar_bar": False}
        for body in self._placed(state):
            plotter.add_mesh(body, smooth_shading=True, split_sharp_edges=True, **look)
        plotter.add_text(f"t = {state.time:.3g} s", font_size=10, color="black", name="time")

    def _material(self, state: State) -> Any:
        """Mesh or points of the material with their values; None if there are none."""
        values = self._brush.paint(state).filled(np.nan)
        if self._style == "surface":
            mesh = filled_volume(state, values, self._brush, self._slab)
            return None if mesh is None else mesh.extract_surface(algorithm="dataset_surface")
        visible = inside_slab(state.x, self._slab)
        if not visible.any():
            return None
        cloud = self._pyvista.PolyData(np.ascontiguousarray(state.x[visible]))
        cloud[self._brush.quantity.title] = values[visible]
        return cloud


def _pixels(state: State, width: int) -> float:
    """Diameter of a point in pixels, a little more than the spacing if all points are in view."""
    spacing = float(state.volume.mean()) ** (1 / 3)
    spread = float(np.ptp(state.x, axis=0).max()) + spacing
    return max(2.0, 1.2 * width * spacing / spread)


def _surfaces(pyvista: Any, state: State) -> list[Any]:
    """Surfaces of the bodies in their own coordinates."""
    grid, meshes = state.scene.grid, []
    far = math.dist(grid.upper, grid.lower)
    for body in state.scene.bodies:
        (vertices, polygons), mark = marked_surface(body, 3, far)
        faces = np.concatenate([(len(polygon), *polygon) for polygon in polygons])
        meshes.append(pyvista.PolyData(vertices, faces))
        meshes[-1].cell_data["mark"] = mark
    return meshes


def _check_display(pyvista: Any) -> None:
    """Refuse a view that cannot be shown, before the work is done."""
    if in_notebook():
        static = pyvista.global_theme.jupyter_backend in ("static", "none")
        if not static and find_spec("trame_pyvista") is None:
            raise ModuleNotFoundError(
                "views in a notebook need trame: pip install 'granular-flow[notebook]', "
                "or give a path for a picture"
            )
    elif (
        sys.platform.startswith("linux")
        and not (os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY"))
        and not pyvista.OFF_SCREEN
    ):
        raise RuntimeError("path = None opens a window and there is no display: give a path")


def _state_of(source: State | Simulation | Trajectory, frame: int) -> State:
    """Return the 3D state to draw."""
    if isinstance(source, Trajectory):
        state = source[integer("frame", frame, -len(source), len(source) - 1)]
    else:
        state = source.state if isinstance(source, Simulation) else source
    if state.dim != 3:
        raise ValueError(f"source of dimension {state.dim} must have 3: see plot.frame")
    return state


def _checked(slab: Slab | None) -> Slab | None:
    if slab is None:
        return None
    axis, low, high = slab
    one_of("slab[0]", axis, ("x", "y", "z"))
    if not low < high:
        raise ValueError(f"slab = {slab} must ascend")
    return slab


def _direction(camera: str | tuple[float, float, float]) -> NDArray | None:
    """Direction to the eye; None for a camera with a name."""
    if isinstance(camera, str):
        one_of("camera", camera, CAMERAS)
        return None
    direction = np.asarray(camera, dtype=float)
    if direction.shape != (3,) or not np.isfinite(direction).all() or not direction.any():
        raise ValueError(f"camera = {camera} must be three finite numbers, not all 0")
    return direction

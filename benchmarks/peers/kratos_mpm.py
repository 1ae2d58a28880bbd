"""MPM of Kratos Multiphysics (`pip install KratosMPMApplication`), in plane strain.

Mohr-Coulomb without cohesion or dilation and with sin(phi) equal to the friction coefficient, which
in plane strain yields at the same tau/p as Drucker-Prager. The background mesh has square elements
with linear shape functions. Points start free of stress, as the code has no initial stress: gravity
is applied at once.
"""

from __future__ import annotations

import json
import math
import tempfile
from pathlib import Path
from typing import Any

import KratosMultiphysics as Kratos
import KratosMultiphysics.MPMApplication as Mpm
import numpy as np
from KratosMultiphysics.MPMApplication.mpm_analysis import MpmAnalysis

import granular as gr
from granular.mpm.engine import initial_points
from peers.codes import Missing

CFL = 0.4
"""Time step, divided by dx/c."""
EXPLICIT = {
    "analysis_type": "linear",
    "time_integration_method": "explicit",
    "scheme_type": "forward_euler",
    "stress_update": "usl",
}
"""Settings of an explicit run."""
FAR = 1e-6
"""Distance of a node from a wall, in cells, up to which the node is on it."""


class Simulation:
    """Simulation with that part of the API of `granular.Simulation` that the benchmark needs.

    Parameters
    ----------
    scene : Scene
        A 2D scene of Drucker-Prager material between walls at the ends of the grid.
    threads : int
        Must be 1.
    **settings
        `cfl` instead of `CFL`, and settings of the solver instead of `EXPLICIT`.

    Raises
    ------
    Missing
        If the scene has features that this code lacks.
    """

    def __init__(self, scene: gr.Scene, *, threads: int = 1, **settings: Any) -> None:
        if threads != 1 or scene.grid.dim != 2 or not isinstance(scene.material, gr.DruckerPrager):
            raise Missing("kratos: one thread, 2D and Drucker-Prager only")
        Kratos.Logger.GetDefaultOutput().SetSeverity(Kratos.Logger.Severity.WARNING)
        Kratos.ParallelUtilities.SetNumThreads(1)
        self.scene = scene
        self.dt = settings.pop("cfl", CFL) * scene.grid.cell / scene.material.wave_speed
        self.steps = 0
        points = initial_points(scene)
        self.n_points = len(points["x"])
        with tempfile.TemporaryDirectory() as folder:
            here = Path(folder)
            _write_grid(here / "grid.mdpa", scene)
            spacing = math.sqrt(points["mass"][0] / scene.material.rho_c)
            _write_body(here / "body.mdpa", points["x"], spacing)
            (here / "law.json").write_text(json.dumps(_material(scene.material)))
            parameters = json.dumps(_parameters(scene, self.dt, settings, here))
            self._model = Kratos.Model()
            self._analysis = MpmAnalysis(self._model, Kratos.Parameters(parameters))
            self._analysis.Initialize()
        self.time = 0.0
        self._part = self._model.GetModelPart("MPM_Material")

    def run(self, until: float) -> Simulation:
        """Run to the first step at or after a time."""
        solver = self._analysis._GetSolver()
        while self.time < until:
            self.time = solver.AdvanceInTime(self.time)
            self._analysis.time = self.time
            try:
                self._analysis.InitializeSolutionStep()
                solver.Predict()
                solver.SolveSolutionStep()
                self._analysis.FinalizeSolutionStep()
            except RuntimeError as error:
                reason = str(error).split("Error: ")[-1].split("\n")[0]
                raise gr.SimulationError(f"kratos, step {self.steps}: {reason}") from error
            self.steps += 1
        if not np.isfinite(self._values(Mpm.MP_VELOCITY)).all():
            raise gr.SimulationError("a velocity of the peer is not finite")
        return self

    def _values(self, name: Any) -> np.ndarray:
        info = self._part.ProcessInfo
        values = [e.CalculateOnIntegrationPoints(name, info)[0] for e in self._part.Elements]
        return np.array([list(value) if hasattr(value, "__len__") else value for value in values])

    @property
    def state(self) -> gr.State:
        """State of the points that are still in the mesh."""
        fields = {
            "x": self._values(Mpm.MP_COORD)[:, :2],
            "v": self._values(Mpm.MP_VELOCITY)[:, :2],
            "mass": self._values(Mpm.MP_MASS),
            "id": np.array([e.Id for e in self._part.Elements]),
        }
        fields = {name: np.array(value, dtype=float) for name, value in fields.items()}
        return gr.State(
            scene=self.scene, time=self.time, step=self.steps, dt=self.dt, fields=fields
        )


def _nodes(places: np.ndarray) -> list[str]:
    rows = (f"{i} {x:.15g} {y:.15g} 0.0" for i, (x, y) in enumerate(places.tolist(), 1))
    return ["Begin Nodes", *rows, "End Nodes"]


def _elements(kind: str, corners: np.ndarray, first: int) -> list[str]:
    rows = (f"{i} 0 {a} {b} {c} {d}" for i, (a, b, c, d) in enumerate(corners.tolist(), first))
    return [f"Begin Elements {kind}", *rows, "End Elements"]


def _part(name: str, nodes: Any, elements: Any = ()) -> list[str]:
    """Part of a mesh with the numbers of its nodes and elements."""
    return [
        f"Begin SubModelPart {name}",
        *("Begin SubModelPartNodes", *map(str, nodes), "End SubModelPartNodes"),
        *("Begin SubModelPartElements", *map(str, elements), "End SubModelPartElements"),
        "End SubModelPart",
    ]


HEAD = ["Begin ModelPartData", "End ModelPartData", "Begin Properties 0", "End Properties"]


def _write_grid(path: Path, scene: gr.Scene) -> None:
    """Background mesh, with a part for the nodes of each wall."""
    grid = scene.grid
    n, m = grid.shape
    j, i = np.mgrid[: m + 1, : n + 1]
    places = np.array(grid.lower) + grid.cell * np.stack([i.ravel(), j.ravel()], axis=1)
    first = (np.arange(m)[:, None] * (n + 1) + np.arange(n)).ravel() + 1
    corners = np.stack([first, first + 1, first + n + 2, first + n + 1], axis=1)
    lines = [*HEAD, *_nodes(places), *_elements("Element2D4N", corners, 1)]
    lines += _part("Parts_Grid", range(1, len(places) + 1), range(1, len(corners) + 1))
    for k, wall in enumerate(scene.walls):
        on = np.abs(places[:, wall.axis] - wall.at) < FAR * grid.cell
        lines += _part(f"Wall_{k}", np.flatnonzero(on) + 1)
    path.write_text("\n".join(lines) + "\n")


def _write_body(path: Path, x: np.ndarray, spacing: float) -> None:
    """Mesh of squares around the points, of which each makes one point."""
    square = 0.5 * spacing * np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]])
    places = (x[:, None, :] + square).reshape(-1, 2)
    corners = np.arange(1, len(places) + 1).reshape(-1, 4)
    kind = "MPMUpdatedLagrangian2D4N"
    lines = [*HEAD, *_nodes(places), *_elements(kind, corners, 1)]
    lines += _part("Parts_Body", range(1, len(places) + 1), range(1, len(corners) + 1))
    path.write_text("\n".join(lines) + "\n")


def _material(material: gr.DruckerPrager) -> dict[str, Any]:
    numbers = {
        "THICKNESS": 1.0,
        "MATERIAL_POINTS_PER_ELEMENT": 1,
        "DENSITY": material.rho_c,
        "YOUNG_MODULUS": material.E,
        "POISSON_RATIO": material.nu,
        "COHESION": material.cohesion,
        "INTERNAL_FRICTION_ANGLE": math.asin(material.mu),
        "INTERNAL_DILATANCY_ANGLE": 0.0,
    }
    law = {"name": "HenckyMCPlasticPlaneStrain2DLaw"}
    material_ = {"constitutive_law": law, "Variables": numbers, "Tables": {}}
    part = {"model_part_name": "Initial_MPM_Material.Parts_Body", "properties_id": 1}
    return {"properties": [part | {"Material": material_}]}


def _parameters(
    scene: gr.Scene, dt: float, settings: dict[str, Any], folder: Path
) -> dict[str, Any]:
    """Parameters of the analysis: explicit central differences."""
    solver = {
        "solver_type": "Dynamic",
        "model_part_name": "MPM_Material",
        "domain_size": 2,
        "model_import_settings": {"input_type": "mdpa", "input_filename": str(folder / "body")},
        "grid_model_import_settings": {
            "input_type": "mdpa",
            "input_filename": str(folder / "grid"),
        },
        "material_import_settings": {"materials_filename": str(folder / "law.json")},
        "time_stepping": {"time_step": dt},
    }
    walls = [
        {
            "python_module": "assign_vector_variable_process",
            "kratos_module": "KratosMultiphysics",
            "Parameters": {
                "model_part_name": f"Background_Grid.Wall_{k}",
                "variable_name": "DISPLACEMENT",
                "constrained": [wall.kind == "no_slip" or wall.axis == d for d in range(2)]
                + [True],
                "value": [0.0, 0.0, 0.0],
                "interval": [0.0, "End"],
            },
        }
        for k, wall in enumerate(scene.walls)
    ]
    gravity = {
        "python_module": "assign_gravity_to_material_point_process",
        "kratos_module": "KratosMultiphysics.MPMApplication",
        "process_name": "AssignGravityToMaterialPointProcess",
        "Parameters": {
            "model_part_name": "MPM_Material",
            "modulus": -scene.gravity.vectors[-1][1],
            "direction": [0.0, -1.0, 0.0],
        },
    }
    data = {"problem_name": "column", "parallel_type": "OpenMP", "echo_level": 0}
    return {
        "problem_data": data | {"start_time": 0.0, "end_time": scene.duration},
        "solver_settings": solver | (settings or EXPLICIT),
        "processes": {"constraints_process_list": walls, "gravity": [gravity]},
        "output_processes": {},
    }

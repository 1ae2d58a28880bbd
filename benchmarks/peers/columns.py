"""Columns of contact dynamics: the cases of `peers.py` and the measures of each."""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from dataclasses import asdict, dataclass
from importlib.metadata import version
from typing import Any

import numpy as np
from accuracy.runs import PROBE, TooLong

import granular as gr
from granular.verify.external import columns as external
from peers import codes

ASPECTS = (0.5, 1.42, 6.26)
"""Nominal aspect ratios of the data."""
FRICTION = 0.32
"""Friction coefficient of Drucker-Prager, which mu(I) has at rest."""
LAWS = ("mu_I", "drucker_prager")
REPEATS, SHORT = 3, 1.0
"""Runs that take less than SHORT core-seconds are made so often, and the least time counts."""
PLACES = 401
"""Number of points at which the surface of a deposit is stored."""


@dataclass(frozen=True, kw_only=True)
class Column:
    """One run.

    Parameters
    ----------
    code : str
        Name in `CODES`.
    law : {"mu_I", "drucker_prager"}
    aspect : float
        Nominal aspect ratio, one of `ASPECTS`.
    cells : int
        Cells along the lesser of height and half-width.
    points : int
        Points per cell of the plane of motion.
    """

    code: str
    law: str
    aspect: float
    cells: int
    points: int

    def row(self) -> dict[str, Any]:
        """The case as the first entries of its row of results."""
        return asdict(self)


@dataclass(frozen=True)
class Code:
    """A code with its settings.

    Parameters
    ----------
    label : str
        Name in the chart and in the tables.
    laws : tuple of str
        Laws that it has.
    make : callable
        Makes a simulation of a scene, as `granular.Simulation` does.
    scheme : Scheme, optional
        Scheme of this package.
    package : str
        The package that is installed, whose version is stored.
    """

    label: str
    laws: tuple[str, ...]
    make: Callable[..., Any]
    scheme: gr.Scheme | None = None
    package: str = "granular"


def _granular(name: str, laws: tuple[str, ...] = LAWS) -> Code:
    return Code(f"granular, {name}", laws, gr.Simulation, external.SCHEMES[name])


def _peer(label: str, name: str, package: str, laws: tuple[str, ...], **settings: Any) -> Code:
    """A code of others, which is imported when it is run."""

    def make(scene: gr.Scene, *, threads: int) -> Any:
        return codes.simulation(name)(scene, threads=threads, **settings)

    return Code(label, laws, make, package=package)


IMPLICIT = {
    "time_integration_method": "implicit",
    "scheme_type": "newmark",
    "analysis_type": "non_linear",
    "convergence_criterion": "residual_criterion",
    "linear_solver_settings": {"solver_type": "LinearSolversApplication.sparse_lu"},
}
"""Settings of an implicit run of Kratos, as in the example of a collapse of Kratos."""

CODES = {
    "default": _granular("default"),
    "cell_averaged": _granular("cell_averaged"),
    "published": _granular("published", LAWS[:1]),
    "taichi": _peer("Taichi, MLS-MPM", "taichi", "taichi", LAWS),
    "taichi_wall": _peer(
        "Taichi, nodes on the floor free", "taichi", "taichi", LAWS, hold_on_wall=False
    ),
    "taichi_sand": _peer("Taichi, sand of Klar et al.", "taichi_sand", "taichi", LAWS[1:]),
    "newton": _peer("Newton, implicit MPM", "newton", "newton", LAWS),
    "newton_long": _peer("Newton, steps of a cell", "newton", "newton", LAWS, step=1.0),
    "kratos": _peer("Kratos, explicit MPM", "kratos", "KratosMPMApplication", LAWS[1:]),
    "kratos_implicit": _peer(
        "Kratos, implicit MPM", "kratos", "KratosMPMApplication", LAWS[1:], cfl=2.0, **IMPLICIT
    ),
}


def scene_of(case: Column) -> gr.Scene:
    """The scene of a case. Its half-width reaches the foremost disc."""
    scheme = CODES[case.code].scheme or gr.schemes.default  # not used by peers
    flat = gr.DruckerPrager(E=external.STIFF, mu=FRICTION, rho_c=external.RHO, rho_s=external.RHO)
    data = external.Discs.load(case.aspect)
    return external.column_of_discs(
        data,
        case.cells,
        half_width=float(data.facts["R0"][0]),
        material=None if case.law == "mu_I" else flat,
        scheme=scheme,
        points_per_cell=case.points,
    )


def places(aspect: float) -> np.ndarray:
    """Positions of the stored surfaces [m]."""
    return np.linspace(0.0, 2.0 * external.Discs.load(aspect).facts["xf"].max(), PLACES)


def discs(aspect: float) -> dict[str, Any]:
    """The deposit of contact dynamics in the form of a row of results."""
    data = external.Discs.load(aspect)
    facts, h = data.facts, np.interp(places(aspect), data.x, data.h, right=0.0)
    return {"surface": h, "mean": facts["xm"][1:], "toe": facts["q999"][-1] - facts["R0"][0]}


def once(case: Column, limit: float) -> dict[str, Any]:
    """Run a case; its times, and the measures of the deposit [m]. Only the steps are timed.

    Raises
    ------
    TooLong
        If it would take more core-seconds than the limit, estimated from its first steps.
    """
    facts = external.Discs.load(case.aspect).facts
    scene = scene_of(case)
    sim = CODES[case.code].make(scene, threads=1)
    start = sim.state.fields["mass"].sum()
    ends = facts["t"][1:] / math.sqrt(external.G)
    points, mean, seconds = sim.n_points, [], 0.0
    for k, until in enumerate([min(PROBE * sim.dt, ends[0] / 4), *ends]):
        begin = time.process_time()
        sim.run(until=float(until))
        seconds += time.process_time() - begin
        if k == 0 and (foreseen := seconds * ends[-1] / sim.time) > limit:
            raise TooLong(f"{foreseen:.0f} core-seconds foreseen")
        if seconds > 2 * limit:
            raise TooLong(f"{seconds:.0f} core-seconds at {sim.time / ends[-1]:.0%}")
        if k > 0:
            far, _, (_, toe) = external.moments(sim.state)
            mean.append(far)
    now = sim.state.fields["mass"]
    h = external.height_at(sim.state, places(case.aspect))
    return {
        "n_points": points,
        "steps": sim.steps,
        "core_seconds": seconds,
        "kept": float(f"{now.sum() / start:.6g}"),
        "mean": [float(f"{m:.6g}") for m in mean],
        "toe": float(f"{toe - facts['R0'][0]:.6g}"),
        "surface": [round(float(value), 5) for value in h],
    }


def run(case: Column, limit: float) -> dict[str, Any]:
    """Row of a case: its results, or the reason why there are none."""
    try:
        result = once(case, limit)
        times = [result["core_seconds"]]
        while result["core_seconds"] < SHORT and len(times) < REPEATS:
            times.append(once(case, limit)["core_seconds"])
    except (codes.Missing, TooLong) as reason:
        return case.row() | {"left_out": str(reason)}
    except (gr.SimulationError, ValueError) as error:  # an outcome, too: it is in the table
        return case.row() | {"failed": str(error).splitlines()[0]}
    more = {"repeats": len(times), "core_seconds": round(min(times), 4)}
    package = CODES[case.code].package
    more["version"] = gr.__version__ if package == "granular" else version(package)
    return case.row() | result | more

"""Indicators of failure of MPM runs, and remedies for those beyond their limits."""

from __future__ import annotations

from typing import TYPE_CHECKING

from granular.materials.own import OwnLaw
from granular.model.indicators import Row, common
from granular.model.seeding import DEEPEST
from granular.mpm.filling import is_full
from granular.mpm.support import unsupported

if TYPE_CHECKING:
    from granular.mpm.scene import Scene


POINTS_PER_CELL = 4
"""Least number of points per cell in a flow, from the map "incline_seeding"."""

JITTER = 0.5
"""Jitter of a fill with which hardly a row of points is left that stretching could draw into
strings."""

STRAIN_STEP = 0.2
"""Largest norm of the velocity gradient times dt. The step is the first order of a finite strain:
the neglected second order, half of the square, is then a tenth of it. The ready scenes have 0.1 at
most."""

OWN = (
    Row(
        "strings",
        "later",
        0.025,
        "share of the cells inside the material among which full and empty ones alternate: beyond "
        "the limit stretching has drawn the points into strings, and pressures and volumes are off",
    ),
    Row(
        "strain_step",
        "largest",
        STRAIN_STEP,
        "largest strain and rotation of a point in a step: beyond the limit it is not resolved",
    ),
    Row(
        "in_solids",
        "largest",
        0.0,
        "share, by mass, of the points more than a cell within a Solid: beyond the limit blocks "
        "leak, or were filled at the start",
    ),
    Row(
        "in_bodies",
        "largest",
        0.0,
        f"share, by mass, of the points more than {DEEPEST} cells within a body: beyond the limit "
        "bodies leak",
    ),
    Row(
        "weights_at_limit",
        "later",
        0.5,
        "share, by mass, of the stressed points whose quadrature weights are at their limit: "
        "beyond 0.5 their correction no longer balances the forces",
    ),
    Row(
        "wall_strain",
        "largest",
        0.025,
        "displacement of a wall that keeps a pressure over the height of the domain: beyond the "
        "limit the domain is no longer the one that the grid has",
    ),
)


def indicators(scene: Scene) -> tuple[Row, ...]:
    """Indicators of a scene."""
    return (*common(scene, remedies(scene)), *OWN)


def remedies(scene: Scene) -> dict[str, str]:
    """Remedies for indicators beyond their limits: only those that the scene does not have yet."""
    fixed = scene.scheme.dt is not None
    step = "a smaller dt" if fixed else "half of cfl"
    stiffer = "take a larger E"
    is_user_defined = any(isinstance(material, OwnLaw) for material in scene.materials)
    separation = "give the `separation` of the user-defined law, or " if is_user_defined else ""
    texts = {
        "disconnected": _connect(scene),
        "density_drift": _keep_volume(scene),
        "strings": _spread(scene),
        "gaps": "take more points per cell",
        "courant": "take no fixed dt" if fixed else "take a smaller cfl",
        "mach": stiffer,
        "compression": f"{stiffer}, and check the law and its input",
        "dilution": "check the law and its input: with its material at rest the density is rho_c",
        "energy_created": f"take {_scheme(scene)}{step}, and compare",
        "strain_step": f"take {step}, and check the fastest points",
        "in_bodies": f"take smaller cells, {step}, or a thicker body",
        "in_solids": "put a Wall on the faces that material hits fast, and fill no blocks",
        "weights_at_limit": f"{separation}take more points per cell",
        "wall_strain": _fill(scene, stiffer),
    }
    if unsupported(scene):  # no other remedy would help: material at the end of the grid lies flat
        floor = "put a Wall below the material"
        texts |= dict.fromkeys(
            ("disconnected", "density_drift", "dilution", "energy_created"), floor
        )
    return texts


def _fill(scene: Scene, otherwise: str) -> str:
    """Fill a domain with a wall that keeps a pressure; that takes long to see in others."""
    filled = not scene.servos or is_full(scene)
    return otherwise if filled else "fill the domain, without a free surface"


def _scheme(scene: Scene) -> str:
    # Imported here: schemes need the limits of the scenes.
    from granular.mpm import schemes

    if scene.materials[0].dilates and len(scene.materials) == 1:  # of bands the smoothing makes it
        averages = scene.scheme.density.name == "cell_averaged"
        return "" if averages else "schemes.cell_averaged, else "
    return "" if scene.scheme.replace(dt=None) == schemes.default else "the default scheme, else "


def _connect(scene: Scene) -> str:
    """Remedy for grains that do not bear stress."""
    fewest = min(source.points_per_cell for source in scene.sources)
    known = []
    if scene.scheme.density.name != "smoothed":
        known.append("SmoothedDensity() (the default)")
    if fewest < POINTS_PER_CELL:
        known.append(f"{POINTS_PER_CELL} or more points per cell")
    if known:
        return f"take {' and '.join(known)}"
    return "take smaller cells and compare"


def _spread(scene: Scene) -> str:
    """Remedy for points in strings; a fill of a `Cloud` has no jitter."""
    known = []
    if scene.scheme.density.name == "particle":
        known.append("SmoothedDensity() (the default), whose shifting acts between cells")
    if any(fill.jitter < JITTER for fill in scene.fills):
        known.append(f"fills with jitter = {JITTER}")
    return f"take {' and '.join(known)}" if known else "take smaller cells and compare"


def _keep_volume(scene: Scene) -> str:
    """Remedy for densities that do not follow the volume."""
    density = scene.scheme.density.name
    if density == "particle":
        return "take SmoothedDensity() (the default)"
    possible = density != "cell_averaged" and len(scene.materials) == 1
    averaged = ", or schemes.cell_averaged" if possible else ""
    return f"take a larger E{averaged}"

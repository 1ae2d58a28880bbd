"""Effective width of an opening: in cells it acts wider or narrower by a part of a cell.

A rate of discharge is proportional to the power dim - 1/2 of the width. Its limit in fine cells
thus gives the effective width of an opening of n cells, which differs from the width between its
edges by about the same part of a cell for any n (`docs/how-to/choose_a_scheme.md` has the runs).
"""

from dataclasses import dataclass

from granular.measure.result import Result
from granular.model.typing import AnyScene
from granular.mpm.scene import Scene

WIDER = {
    ("quadratic", "SmoothedDensity"): (-1.05, 0.1),
    ("linear", "CellAveragedDensity"): (-1.4, 0.1),
}
"""Cells by which the effective width of a slot exceeds that between its edges, and half of the
scatter. Measured with slots in a 2D floor of grid walls, 8 to 32 cells and two seeds, against the
limit of each scheme, for a mu(I) law. The limits differ by 2 % in the rate. Edges of bodies are not
included, because they depend on the contact: -1.1 cells between plates with friction, -2.3 where
material sticks.
"""
EDGES = 2.0
"""Cells between the edges of the bottom of `scenes.silo` beyond its orifice, if that is counted
from the last free node as in the paper."""


@dataclass(frozen=True, kw_only=True)
class EffectiveOpening(Result, width="m", effective="m", uncertainty="m"):
    """Effective width of an opening.

    Attributes
    ----------
    width : float
        Width between its edges [m]: that of the orifice, or two cells more in a `scenes.silo` whose
        `edge` is "last_free_node".
    effective : float
        Effective width in cells of this size [m].
    uncertainty : float
        Uncertainty of that width [m], half of the measured scatter.
    power : float
        Power of the width to which a rate is proportional, dim - 1/2.
    """

    width: float
    effective: float
    uncertainty: float
    power: float

    @classmethod
    def of(cls, scene: AnyScene) -> "EffectiveOpening | None":
        """Effective opening of a scene with a parameter ``orifice``; None where it is not known."""
        if not isinstance(scene, Scene) or scene.dim != 2 or scene.bodies:
            return None
        kind = scene.scheme.basis, type(scene.scheme.density).__name__
        if kind not in WIDER or "orifice" not in scene.parameters:
            return None
        (wider, error), cell = WIDER[kind], scene.grid.cell
        between = EDGES * cell * (scene.parameters.get("edge") == "last_free_node")
        width = float(scene.parameters["orifice"]) + between
        return cls(
            width=width,
            effective=width + wider * cell,
            uncertainty=error * cell,
            power=scene.grid.dim_of_whole - 0.5,
        )

    @property
    def factor(self) -> float:
        """Factor that converts the rate of a run to the width between the edges."""
        return (self.width / self.effective) ** self.power

    @property
    def relative_uncertainty(self) -> float:
        """Uncertainty of that factor, over it."""
        return self.power * self.uncertainty / self.effective

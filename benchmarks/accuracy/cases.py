"""Cases of the benchmark: scenes, schemes and resolutions."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import asdict, dataclass, replace
from itertools import product
from typing import Any

import granular as gr

SOFT_STEP = gr.schemes.dunatunga_kamrin_2015.replace(dt=None)
"""The published scheme with a time step of half its limit, as the paper's 3e-6 s is for 1 GPa."""

SCHEMES = {
    "default": gr.schemes.default,
    "cell_averaged": gr.schemes.cell_averaged,
    "published": gr.schemes.dunatunga_kamrin_2015,
    "linear flip": SOFT_STEP,
    "linear xpic": SOFT_STEP.replace(transfer="xpic"),
    "linear apic": SOFT_STEP.replace(transfer="apic"),
    "ugimp flip": SOFT_STEP.replace(basis="ugimp"),
    "ugimp xpic": SOFT_STEP.replace(basis="ugimp", transfer="xpic"),
    "quadratic flip": SOFT_STEP.replace(basis="quadratic"),
    "quadratic xpic": SOFT_STEP.replace(basis="quadratic", transfer="xpic"),
    "quadratic apic": SOFT_STEP.replace(basis="quadratic", transfer="apic"),
    "quadratic tpic": SOFT_STEP.replace(basis="quadratic", transfer="tpic"),
}
"""Schemes by their names in the chart. "quadratic tpic" is the default one without its density
correction."""

HYDRODYNAMICS = "sph"
"""Name of the scheme of cases with SPH, with as many particles and the same stiffness."""

PEERS = ("taichi", "newton")
SCENES = ("incline", "incline_2d", "collapse", "silo")
MODULI = (1e5, 1e6, 1e7, 1e8, 1e9)


@dataclass(frozen=True, kw_only=True)
class Case:
    """One run.

    Parameters
    ----------
    scene : {"incline", "incline_2d", "collapse", "silo"}
    solver : {"granular", "taichi", "newton"}
    scheme : str
        Name in `SCHEMES`, or `HYDRODYNAMICS`; a peer has a name of its own.
    E : float
        Young's modulus [Pa].
    cell : float
        Cell size [m].
    points : int
        Points per cell.
    angle_deg : float or None
        Inclination of an incline [deg].
    seed : int
        Seed of the jitter.
    until : float or None
        Duration [s], if it differs from the scene's.
    """

    scene: str
    solver: str = "granular"
    scheme: str = "default"
    E: float = 1e7
    cell: float = 0.01
    points: int = 4
    angle_deg: float | None = None
    seed: int = 0
    until: float | None = None

    @property
    def published(self) -> bool:
        """True if these are the settings of Dunatunga & Kamrin 2015."""
        return self.scheme == "published"

    def row(self) -> dict[str, Any]:
        """The case as the first entries of its row of results."""
        return asdict(self)


INCLINE = Case(scene="incline", angle_deg=25.0)
INCLINE_2D = Case(scene="incline_2d", angle_deg=25.0)
COLLAPSE = Case(scene="collapse", cell=0.0125, points=16)
SILO = Case(scene="silo")


def _vary(base: Case, **values: Any) -> Iterator[Case]:
    """The case with all combinations of the given values, the last one varying fastest."""
    for chosen in product(*values.values()):
        yield replace(base, **dict(zip(values, chosen, strict=True)))


CURED = ("default", "cell_averaged")
OTHERS = tuple(s for s in SCHEMES if s not in (*CURED, "published"))
BOTH = ("default", "linear flip")


def _incline() -> Iterator[Case]:
    yield from _vary(INCLINE, scheme=BOTH, E=MODULI)
    yield from _vary(INCLINE, angle_deg=(23.0, 28.0, 31.0), E=MODULI[:4])
    yield from _vary(INCLINE, scheme=BOTH, E=(1e8,), cell=(0.04, 0.02, 0.005))
    yield from _vary(INCLINE, scheme=BOTH, E=(1e8,), points=(9, 16))
    yield from _vary(INCLINE, scheme=OTHERS)


def _incline_2d() -> Iterator[Case]:
    yield from _vary(INCLINE_2D, E=MODULI[:3])
    yield from _vary(INCLINE_2D, scheme=OTHERS, E=(1e6,))
    yield from _vary(INCLINE_2D, E=(1e6,), points=(4, 9), seed=(0, 1, 2))
    yield from _vary(INCLINE_2D, E=(1e6,), cell=(0.04, 0.02, 0.005))
    yield replace(INCLINE_2D, E=1e6, points=16)
    yield from _vary(INCLINE_2D, scheme=("linear flip",), E=(1e5, 1e7))
    worst = ("linear flip", "ugimp flip", "quadratic apic", "quadratic tpic")
    yield from _vary(INCLINE_2D, scheme=worst, E=(1e6,), points=(9,))
    yield from _vary(INCLINE_2D, points=(9,), cell=(0.02, 0.01))


def _collapse() -> Iterator[Case]:
    yield from _vary(COLLAPSE, cell=(0.025, 0.0125), seed=(0, 1))
    yield from _vary(COLLAPSE, E=MODULI[:3])
    yield from _vary(COLLAPSE, cell=(0.025,), E=MODULI[:4])
    yield from _vary(COLLAPSE, scheme=OTHERS)
    yield from _vary(COLLAPSE, points=(4, 9), cell=(0.025, 0.0125))
    yield from _vary(COLLAPSE, scheme=("linear flip",), cell=(0.025, 0.0125, 0.00625))
    yield from _vary(COLLAPSE, scheme=("linear flip",), E=MODULI[1:4])


def _silo() -> Iterator[Case]:
    yield from _vary(SILO, scheme=BOTH, cell=(0.02, 0.01))
    yield from _vary(SILO, scheme=BOTH, cell=(0.02,), E=MODULI[:4])
    yield from _vary(SILO, E=MODULI[:3])
    yield from _vary(SILO, scheme=OTHERS, cell=(0.02,))
    yield from _vary(SILO, points=(4, 9, 16), cell=(0.02,))
    yield replace(SILO, points=9)


def _cell_averaged() -> Iterator[Case]:
    """The main cases of the default scheme, repeated."""
    line, plane, heap, silo = (
        replace(base, scheme="cell_averaged") for base in (INCLINE, INCLINE_2D, COLLAPSE, SILO)
    )
    yield from _vary(line, E=MODULI[:4])
    yield from _vary(line, E=(1e8,), cell=(0.04, 0.02, 0.005))
    yield from _vary(plane, E=MODULI[:3])
    yield from _vary(plane, E=(1e6,), points=(4, 9), seed=(0, 1))
    yield from _vary(plane, E=(1e6,), cell=(0.04, 0.02, 0.005))
    yield from _vary(plane, points=(9,), cell=(0.02, 0.01))
    yield from _vary(heap, cell=(0.025, 0.0125), E=MODULI[:3])
    yield from _vary(heap, cell=(0.025, 0.0125), points=(4,))
    yield replace(heap, cell=0.00625)
    yield from _vary(silo, cell=(0.02, 0.01), E=MODULI[:3])
    yield replace(silo, cell=0.02, points=9)
    yield replace(silo, cell=0.005)


def _hydrodynamics() -> Iterator[Case]:
    """The collapse and the incline with SPH."""
    heap, plane = (replace(base, scheme=HYDRODYNAMICS) for base in (COLLAPSE, INCLINE_2D))
    yield from _vary(heap, points=(4,), cell=(0.025, 0.0125), E=MODULI[:3])
    yield from _vary(heap, E=MODULI[:2])
    yield from _vary(plane, cell=(0.02, 0.01), E=MODULI[:2])


def _peers(solver: str) -> Iterator[Case]:
    """The same scenes for a peer."""
    for base in (INCLINE, INCLINE_2D, SILO, replace(COLLAPSE, cell=0.025)):
        yield replace(base, solver=solver, scheme=solver, E=1e6)
    if solver == "taichi":
        yield replace(COLLAPSE, solver=solver, scheme=solver, E=1e6)
        # these show how the error of its walls falls
        base = replace(INCLINE, solver=solver, scheme=solver, E=1e6)
        yield from _vary(base, cell=(0.02, 0.005))


def _long() -> Iterator[Case]:
    """The finest runs, for the references, and the published settings."""
    yield replace(COLLAPSE, cell=0.00625)
    yield replace(SILO, cell=0.005, scheme="linear flip")
    yield replace(INCLINE, scheme="published", E=1e9, cell=0.005)
    yield replace(COLLAPSE, scheme="published", E=1e9)
    yield replace(SILO, scheme="published", E=1e9)
    yield from _peers("newton")
    yield replace(SILO, cell=0.005)
    yield replace(INCLINE_2D, scheme="published", E=1e9, cell=0.005)
    yield replace(COLLAPSE, cell=0.005)
    yield replace(INCLINE_2D, E=1e8)


def full() -> list[Case]:
    """All cases, each once, in the order in which they are run."""
    parts = (
        _incline(),
        _incline_2d(),
        _collapse(),
        _silo(),
        _cell_averaged(),
        _hydrodynamics(),
        _peers("taichi"),
        _long(),
    )
    return list(dict.fromkeys(case for part in parts for case in part))


def quick() -> list[Case]:
    """Four coarse and short cases, to check that everything runs."""
    small = {"E": 1e5, "points": 4}
    return [
        replace(INCLINE, cell=0.04, until=0.2, **small),
        replace(INCLINE, scheme="linear flip", cell=0.04, until=0.2, **small),
        replace(INCLINE_2D, cell=0.04, until=0.2, **small),
        replace(COLLAPSE, cell=0.05, until=0.5, **small),
        replace(COLLAPSE, scheme=HYDRODYNAMICS, cell=0.05, until=0.5, **small),
        replace(SILO, cell=0.02, **small),
    ]

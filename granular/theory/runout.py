"""Run-out laws of collapsing columns: run-out as a function of the aspect ratio.

Run-out is (final half-width - initial half-width)/initial half-width, aspect ratio is initial
height/initial half-width (Dunatunga & Kamrin 2015, section 4.1 and table 3).
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType

import numpy as np
from numpy.typing import ArrayLike

from granular.tools.arrays import Array


@dataclass(frozen=True, kw_only=True)
class Piece:
    """Run-out ``coefficient * a**exponent`` for ``lower <= a < upper``.

    Attributes
    ----------
    lower, upper : float
        Ends of the range of the aspect ratio a.
    coefficient, exponent : float
        Numbers of the power law. A coefficient of nan means that the source gives the exponent
        only.
    coefficient_error, exponent_error : float
        Their errors as stated by the source; 0 if none is stated.
    """

    lower: float
    upper: float
    coefficient: float
    exponent: float
    coefficient_error: float = 0.0
    exponent_error: float = 0.0


@dataclass(frozen=True, kw_only=True)
class RunoutLaw:
    """A published law; call it with aspect ratios.

    Attributes
    ----------
    source, method : str
        Publication, and the method by which the law was determined.
    pieces : tuple of Piece
        Power laws in the order of the aspect ratio.
    """

    source: str
    method: str
    pieces: tuple[Piece, ...]

    def __call__(self, aspect: ArrayLike) -> Array:
        """Run-out at aspect ratios, an array of any shape; nan where the source gives no law.

        Raises
        ------
        ValueError
            If an aspect ratio is not positive, or the law has no coefficient.
        """
        aspect = np.asarray(aspect, dtype=float)
        if not np.all(aspect > 0):
            raise ValueError(f"aspect = {aspect} must be > 0")
        if any(math.isnan(piece.coefficient) for piece in self.pieces):
            raise ValueError(f"{self.source} gives exponents only: see pieces")
        runout = np.full(aspect.shape, np.nan)
        for piece in self.pieces:
            mine = (aspect >= piece.lower) & (aspect < piece.upper)
            runout[mine] = piece.coefficient * aspect[mine] ** piece.exponent
        return runout


def _two(source: str, method: str, ends: tuple[float, float], low: tuple, high: tuple) -> RunoutLaw:
    """Two power laws, below ends[0] and from ends[1]; low, high: coefficient, exponent, errors."""
    names = ("coefficient", "exponent", "coefficient_error", "exponent_error")
    pieces = (
        Piece(lower=0.0, upper=ends[0], **dict(zip(names, low, strict=False))),
        Piece(lower=ends[1], upper=math.inf, **dict(zip(names, high, strict=False))),
    )
    return RunoutLaw(source=source, method=method, pieces=pieces)


def _exponent(method: str, exponent: float, error: float) -> RunoutLaw:
    piece = Piece(
        lower=0.0, upper=math.inf, coefficient=math.nan, exponent=exponent, exponent_error=error
    )
    return RunoutLaw(source="Balmforth & Kerswell (2005)", method=method, pieces=(piece,))


#: Table 3 of Dunatunga & Kamrin 2015, by short name; the last row is their own.
RUNOUT_LAWS: Mapping[str, RunoutLaw] = MappingProxyType(
    {
        "balmforth_wide": _exponent("experiment, wide channel", 0.9, 0.10),
        "balmforth_narrow": _exponent("experiment, narrow slot", 0.65, 0.05),
        "staron": _two(
            "Staron & Hinch (2005)",
            "discrete elements",
            (2.0, 2.0),
            (2.5, 1.0),
            (3.25, 0.71, 0.0, 0.02),
        ),
        "lube": _two("Lube et al. (2005)", "experiment", (1.8, 2.8), (1.2, 1.0), (1.9, 2 / 3)),
        "lagree": _two(
            "Lagrée et al. (2011)", "non-Newtonian model", (7.0, 7.0), (2.2, 1.0), (3.9, 0.7)
        ),
        "mast": _two(
            "Mast et al. (2015)",
            "continuum plasticity",
            (1.5, 1.5),
            (1.01, 1.52, 0.16, 0.04),
            (1.30, 0.75, 0.22, 0.01),
        ),
        "dunatunga": _two(
            "Dunatunga & Kamrin (2015)",
            "continuum plasticity",
            (2.83, 2.83),
            (2.28, 1.0),
            (3.24, 0.66),
        ),
    }
)

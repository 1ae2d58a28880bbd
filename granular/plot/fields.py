"""Colours of a picture: values, names, units and scales."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any, Self

import matplotlib
import numpy as np
from matplotlib.colors import Colormap, ListedColormap, LogNorm, Normalize
from numpy.typing import ArrayLike

from granular import measure
from granular.measure.derived import DERIVED, derived
from granular.model.state import State
from granular.tools.arrays import Array
from granular.tools.checks import finite

SIGNED = "coolwarm"
"""Colour map of fields that are positive and negative; its middle is grey, not white."""
DECADES = 4
"""Number of decades of a logarithmic scale."""
PHASES = ListedColormap(["#e08214", "#2d5d8f"], name="phases")
"""Colours of disconnected and dense points."""
MISSING = "#c8c8c8"
"""Colour of points without a value."""


@dataclass(frozen=True)
class Quantity:
    """Presentation of a field: label, unit and scale.

    Attributes
    ----------
    label, unit : str
        Text and unit of the colour bar; the unit may be empty.
    log : bool
        True for a logarithmic scale.
    cmap : str
        Name of a matplotlib colour map.
    two : bool
        True for a field of two values: disconnected (0) or dense (1).
    signed : bool
        True for a field whose scale is symmetric about zero.
    counts : bool
        True for whole numbers, such as that of the material, between which there is nothing.
    """

    label: str
    unit: str = ""
    log: bool = False
    cmap: str = "viridis"
    two: bool = False
    signed: bool = False
    counts: bool = False

    @property
    def title(self) -> str:
        """Label and unit."""
        return f"{self.label} [{self.unit}]" if self.unit else self.label


QUANTITIES: dict[str, Quantity] = {
    "shear_rate": Quantity("equivalent plastic shear rate", "1/s", log=True, cmap="plasma"),
    "shear_strain": Quantity("accumulated plastic shear strain", cmap="plasma"),
    "pressure": Quantity("pressure", "Pa"),
    "shear_stress": Quantity("equivalent shear stress", "Pa"),
    "mu": Quantity("friction, shear stress/pressure", cmap="cividis"),
    "density": Quantity("density", "kg/m³", cmap="cividis"),
    "packing": Quantity("packing fraction", cmap="cividis"),
    "nodal_density": Quantity("nodal density", "kg/m³", cmap="cividis"),
    "log_density": Quantity("ln(rho/rho_c)", cmap="cividis"),
    "speed": Quantity("speed", "m/s"),
    "inertial_number": Quantity("inertial number", log=True, cmap="plasma"),
    "scaled_inertial_number": Quantity("I/I0", log=True, cmap="plasma"),
    "dense": Quantity("phase by stress borne", two=True),
    "phase": Quantity("phase by nodal density", two=True),
    "material": Quantity("number of the material", cmap="cividis", counts=True),
    "mass": Quantity("mass", "kg"),
    "volume": Quantity("volume", "m³"),
    "id": Quantity("id", counts=True),
} | {f"stress_{ij}": Quantity(f"stress {ij}", "Pa") for ij in ("xx", "yy", "zz")}
"""Known fields; other stored fields are labelled by their name."""
QUANTITIES |= {
    f"v_{i}": Quantity(f"velocity along {i}", "m/s", cmap=SIGNED, signed=True) for i in "xyz"
} | {
    f"stress_{ij}": Quantity(f"stress {ij}", "Pa", cmap=SIGNED, signed=True)
    for ij in ("xy", "yz", "xz")
}

_COMPONENTS = {"v": ("x", "y", "z"), "stress": ("xx", "yy", "zz", "xy", "yz", "xz")}


def names(state: State) -> list[str]:
    """Names of the fields that a state can be coloured by."""
    plain = [name for name, field in state.fields.items() if field.ndim == 1]
    wanted = [name for name in QUANTITIES if _component(state, name) is not None or "_" not in name]
    return sorted({*plain, *wanted, *DERIVED, "shear_rate", "log_density"})


def _component(state: State, name: str) -> Array | None:
    """A component such as `v_x` or `stress_xy`; None if there is no such component."""
    field, _, part = name.rpartition("_")
    if part not in _COMPONENTS.get(field, ()):
        return None
    column = _COMPONENTS[field].index(part)
    array = getattr(state, field)
    return array[:, column] if column < array.shape[1] else None


Color = str | ArrayLike | Callable[[State], ArrayLike]
"""Name of a field, numbers of the points, or a function of a state that returns them."""


def values(state: State, color: Color, *, smooth: bool = False) -> Array:
    """Values of the points by which they are coloured, shape (n,); nan where there is none.

    Raises
    ------
    ValueError
        If there is no such field, or it does not have one number per point.
    """
    if state.n == 0 and isinstance(color, str):
        return np.zeros(0)
    array = _by_name(state, color) if isinstance(color, str) else color
    if callable(array):
        array = array(state)
    try:
        array = np.asarray(array, dtype=float)
    except (TypeError, ValueError):
        array = np.zeros(())
    if array.shape != (state.n,):
        what = repr(color) if isinstance(color, str) else f"array of shape {array.shape}"
        raise ValueError(
            f"color = {what} must hold one number for each of the {state.n} points; "
            f"names are {', '.join(names(state))}"
        )
    return measure.smooth(state, array) if smooth else array


def _by_name(state: State, name: str) -> Any:
    if name in DERIVED:
        return derived(state, name)
    column = _component(state, name)
    return getattr(state, name, None) if column is None else column


@dataclass(frozen=True)
class Brush:
    """Map from values to colours, the same for all states of a picture.

    `Brush.fitted` makes one; `paint` returns the values of a state, clipped to the scale.
    """

    color: Color
    quantity: Quantity
    norm: Normalize
    cmap: Colormap
    smooth: bool = False

    @classmethod
    def fitted(
        cls,
        states: Sequence[State],
        color: Color = "shear_rate",
        *,
        limits: tuple[float, float] | None = None,
        log: bool | None = None,
        cmap: str | None = None,
        label: str | None = None,
        smooth: bool = False,
    ) -> Self:
        """Make a brush whose scale fits the given states, unless `limits` are given.

        Raises
        ------
        ValueError
            If the field or the colour map is unknown, or the limits do not ascend (or are not
            positive on a logarithmic scale).
        """
        name = color if isinstance(color, str) else ""
        quantity = QUANTITIES.get(name, Quantity(name or "value"))
        if label is not None:
            quantity = replace(quantity, label=label, unit="")
        if log is not None:
            quantity = replace(quantity, log=log)
        samples = [values(state, color, smooth=smooth) for state in states]
        if not name and not smooth and states:
            numbers = np.asarray(color(states[0]) if callable(color) else color)
            quantity = replace(quantity, counts=numbers.dtype.kind in "iub")
        if quantity.two:
            return cls(color, quantity, Normalize(0.0, 1.0), PHASES, smooth)
        every = np.concatenate(samples) if samples else np.zeros(0)
        low, high = _checked(limits, quantity.log) if limits else _limits(every, quantity)
        if quantity.signed and low != -high:
            # Its middle would not be zero.
            quantity = replace(quantity, cmap=Quantity.cmap)
        norm = LogNorm(low, high) if quantity.log else Normalize(low, high)
        colors = (_colormap(cmap or quantity.cmap)).with_extremes(bad=MISSING)
        return cls(color, quantity, norm, colors, smooth)

    def with_values(self, values: ArrayLike) -> Self:
        """Return a brush of the same scale for other values, one number per point."""
        return replace(self, color=np.asarray(values))

    def paint(self, state: State) -> np.ma.MaskedArray:
        """Values of a state, clipped to the scale and masked where there are none."""
        numbers = values(state, self.color, smooth=self.smooth)
        # Zero is not on a logarithmic scale and counts as its low end.
        return np.ma.masked_invalid(np.clip(numbers, self.norm.vmin, self.norm.vmax))

    @property
    def blends(self) -> bool:
        """True if there are values between those of neighbouring points."""
        return not (self.quantity.two or self.quantity.counts)


def _colormap(name: str) -> Colormap:
    try:
        return matplotlib.colormaps[name]
    except KeyError:
        raise ValueError(f"cmap = {name!r} must be the name of a matplotlib colour map") from None


def _checked(limits: tuple[float, float], log: bool) -> tuple[float, float]:
    low, high = (finite(f"limits[{i}]", end) for i, end in enumerate(limits))
    if not low < high or (log and low <= 0):
        wanted = "ascend and be > 0 on a logarithmic scale" if log else "ascend"
        raise ValueError(f"limits = {(low, high)} must {wanted}")
    return low, high


def _limits(numbers: Array, quantity: Quantity) -> tuple[float, float]:
    """Ends of a scale; the outermost 0.5 % of the points do not extend it."""
    numbers = numbers[np.isfinite(numbers)]
    if quantity.log:
        numbers = numbers[numbers > 0]
        high = 10.0 ** math.ceil(math.log10(np.percentile(numbers, 99.5))) if len(numbers) else 1.0
        return high * 10.0**-DECADES, high
    if not len(numbers):
        return 0.0, 1.0
    low, high = np.percentile(numbers, (0.5, 99.5)).tolist()
    if quantity.signed:
        most = max(abs(low), abs(high)) or 1.0
        return -most, most
    # A pressure or a speed begins at zero.
    low = 0.0 if 0.0 <= low < 0.5 * high else low
    return low, high if high > low else low + 1.0

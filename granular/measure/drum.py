"""Flow in a rotating drum: slope of the surface, flowing layer, and its balance of mass."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from granular.measure.averaging_grid import mean_of, only_material, require_points, sums_of
from granular.measure.opening import each_state
from granular.measure.result import Result
from granular.model.state import State, States
from granular.tools.arrays import Array
from granular.tools.checks import in_range, integer, positive


@dataclass(frozen=True, eq=False, kw_only=True)
class DrumFlow(
    Result,
    slope_deg="deg",
    slope_spread_deg="deg",
    s="m",
    surface="m",
    thickness="m",
    speed="m/s",
    surface_speed="m/s",
    flux="m2/s",
    balance="m2/s",
):
    """Flow of a drum, averaged over frames, in sections across its surface.

    The coordinates are s along the surface, towards larger x, and n out of it, from the axis of the
    drum: s goes up the slope for omega > 0, and down for omega < 0.

    Attributes
    ----------
    slope_deg : float
        Mean slope of the surface to the horizontal [deg], positive where it rises with x.
    slope_spread_deg : float
        Standard deviation of the slopes of single frames [deg]; nan for one frame.
    s : ndarray, shape (k,)
        Middles of the sections [m].
    surface : ndarray, shape (k,)
        Coordinate n of the surface [m].
    thickness : ndarray, shape (k,)
        Thickness of the flowing layer [m], by mass: its mass per area of base over rho_c.
    speed : ndarray, shape (k,)
        Mean velocity of the layer down the slope, by mass [m/s].
    surface_speed : ndarray, shape (k,)
        Velocity down the slope at the surface [m/s]: that of the uppermost bin.
    flux : ndarray, shape (k,)
        ``thickness * speed`` [m2/s].
    balance : ndarray, shape (k,)
        Flux down the slope that balances the rigid bed below the layer [m2/s]; see `drum_flow`.
    frames : int
        Number of frames.
    """

    slope_deg: float
    slope_spread_deg: float
    s: Array
    surface: Array
    thickness: Array
    speed: Array
    surface_speed: Array
    flux: Array
    balance: Array
    frames: int


def drum_flow(
    states: States,
    *,
    radius: float | None = None,
    omega: float | None = None,
    slip: float = 0.02,
    sections: int | None = None,
) -> DrumFlow:
    """Slope, and thickness, speed and flux of the flowing layer, in sections over the drum.

    A frame's surface is the level to which the mass of a column about one cell wide fills it above
    the wall at rho_c. The slope is that of the straight line by least squares through the columns
    with abs(x) < radius/2. Sections are bins of s of one cell, bins of n in them half a cell.
    Relative to the rotation of the drum, material slips down the slope by ``u = omega (-n) - v_s``
    (for omega > 0). The flowing layer is all above the highest bin in which abs(u) is less than
    `slip` times its value at the surface.

    In steady flow as much goes down through a section as goes up. Below the layer, from the wall at
    ``n = -sqrt(R^2 - s^2)`` to its base at n_b, the bed turns with the drum, so that the flux of
    the layer must be

        abs(omega) (R^2 - s^2 - n_b^2)/2.

    For a thin layer on a half-filled drum this is omega (R^2 - s^2)/2 (Elperin & Vikhansky 1998,
    Europhys. Lett. 42, 619; Orpe & Khakhar 2001, Phys. Rev. E 64, 031302). While the slope still
    grows, the flux is smaller: the volume (at rho_c) by which the material beyond the section grows
    from the first frame to the last, over the time between them, is subtracted from the balance.
    Flux and balance agree only if material keeps its density and does not slip at the wall.

    Parameters
    ----------
    states : State or iterable of State
        Of a drum about the origin, in 2D or with its axis along y.
    radius, omega : float, optional
        Radius [m], > 0, and angular velocity [rad/s], not 0, of the drum; by default the parameters
        of the scene.
    slip : float
        Share of the slip at the surface at which the layer begins, from 0 to 1, both excluded.
    sections : int, optional
        Number of sections from -radius to radius; by default one a cell.

    Returns
    -------
    DrumFlow
        Of the sections with a layer above a bed; none if there is no flow.

    Raises
    ------
    TypeError, ValueError
        If there are no states or points, the radius or angular velocity is unknown, a number is out
        of range, or the scene has several materials.
    """
    share = in_range("slip", slip, 0.0, 1.0, open_low=True, open_high=True)
    frames = list(each_state(states))
    scene = frames[0].scene
    R = positive("radius", _known(scene.parameters, "radius", radius))
    turning = float(_known(scene.parameters, "omega", omega))
    if not math.isfinite(turning) or turning == 0.0:
        raise ValueError(f"omega = {turning} must be finite and not 0")
    cell = scene.grid.cell
    count = integer("sections", round(2 * R / cell) if sections is None else sections, 1)
    levels = math.ceil(4 * R / cell)
    slopes = np.array([_slope(state, R) for state in frames])
    mass, moment = np.zeros((count, levels)), np.zeros((count, levels))
    along = np.array([math.cos(slopes.mean()), math.sin(slopes.mean())])
    for state in frames:
        x, v = (np.asarray(a, dtype=float)[:, [0, -1]] for a in (state.x, state.v))
        s, n = x @ along, x @ [-along[1], along[0]]
        column = np.clip(np.floor((s / R + 1) * count / 2), 0, count - 1).astype(np.int64)
        level = np.clip(np.floor((n / R + 1) * levels / 2), 0, levels - 1).astype(np.int64)
        m, place = np.asarray(state.mass, dtype=float), column * levels + level
        mass += sums_of(place, m, count * levels).reshape(mass.shape)
        moment += sums_of(place, m * (v @ along), count * levels).reshape(mass.shape)
    depth = math.prod(c * cell for c in scene.grid.shape[1:-1])
    per_area = len(frames) * scene.material.rho_c * (2 * R / count) * depth
    rows = _layers(mass / per_area, moment / per_area, R=R, omega=turning, slip=share)
    s, surface, base, thickness, flux, top = rows
    lifted = 0.5 * abs(turning) * (R**2 - s**2 - base**2)
    stored = _growth(frames[0], frames[-1], along * math.copysign(1.0, turning), s)
    stored /= scene.material.rho_c * depth
    return DrumFlow(
        slope_deg=math.degrees(slopes.mean()),
        slope_spread_deg=math.degrees(slopes.std(ddof=1)) if len(slopes) > 1 else math.nan,
        s=s,
        surface=surface,
        thickness=thickness,
        speed=flux / thickness,
        surface_speed=top,
        flux=flux,
        balance=lifted - stored,
        frames=len(frames),
    )


def _known(parameters: object, name: str, given: float | None) -> float:
    """Return the given value, or else the parameter of the scene."""
    if given is not None:
        return given
    if name not in parameters:  # type: ignore[operator]
        raise ValueError(f"{name} = None: the scene has no parameter {name}, give it")
    return parameters[name]  # type: ignore[index]


def _slope(state: State, radius: float) -> float:
    """Slope of the surface of a frame [rad]."""
    require_points(state)
    x, grid = np.asarray(state.x, dtype=float)[:, 0], state.scene.grid
    count = max(round(radius / grid.cell), 3)
    width = radius / count
    column = np.floor(x / width + count / 2).astype(np.int64)
    near = (column >= 0) & (column < count)
    depth = math.prod(c * grid.cell for c in grid.shape[1:-1])
    mass = sums_of(column[near], np.asarray(state.mass, dtype=float)[near], count)
    ends = np.linspace(-radius / 2, radius / 2, count + 1)
    # The mean elevation of the wall in a column, from the area of the segment below a chord.
    areas = 0.5 * (ends * np.sqrt(radius**2 - ends**2) + radius**2 * np.arcsin(ends / radius))
    level = mass / (only_material(state).rho_c * width * depth) - np.diff(areas) / width
    middles = 0.5 * (ends[1:] + ends[:-1])
    return math.atan(float(np.polyfit(middles, level, 1)[0]))


def _growth(first: State, last: State, up: Array, s: Array) -> Array:
    """Rate at which the mass beyond sections at s grows, on the side to which `up` points."""
    span = last.time - first.time
    if not span > 0:
        return np.zeros_like(s)
    sign = math.copysign(1.0, up[0])

    def beyond(state: State) -> Array:
        place = np.asarray(state.x, dtype=float)[:, [0, -1]] @ up
        order = np.argsort(place)
        total = np.append(np.cumsum(np.asarray(state.mass, dtype=float)[order][::-1])[::-1], 0.0)
        return total[np.searchsorted(place[order], sign * s)]

    return (beyond(last) - beyond(first)) / span


def _layers(height: Array, flow: Array, *, R: float, omega: float, slip: float) -> list[Array]:
    """Middle, surface, base, thickness, flux and speed at the surface of each section.

    `height` and `flow` are the thickness and the flux up the slope of each bin, at rho_c.
    """
    count, levels = height.shape
    spacing = 2 * R / levels
    n = (np.arange(levels) + 0.5) * spacing - R
    velocity, sign = mean_of(flow, height), math.copysign(1.0, omega)
    rows = []
    for k in range(count):
        s = (2 * k + 1) * R / count - R
        # A bin that was seldom filled is above the mean surface.
        filled = np.flatnonzero(height[k] > 0.5 * spacing)
        if len(filled) < 3:
            continue
        relative = sign * (-omega * n - velocity[k])
        rigid = filled[abs(relative[filled]) < slip * abs(relative[filled[-1]])]
        if not len(rigid) or rigid[-1] == filled[-1]:
            continue
        base = rigid[-1] + 1
        rows.append(
            (
                s,
                n[filled[-1]] + spacing / 2,
                base * spacing - R,
                height[k, base:].sum(),
                -sign * flow[k, base:].sum(),
                -sign * velocity[k, filled[-1]],
            )
        )
    return list(np.array(rows, dtype=float).reshape(-1, 6).T)

"""Hourglasses (Dunatunga & Kamrin 2015, section 4.3)."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np
from numpy.typing import NDArray

from granular import materials, measure, scenes, schemes
from granular.schemes import Scheme
from granular.simulation import Simulation
from granular.state import State
from granular.verify.collapse import REPOSE
from granular.verify.rows import Row, at_least, at_most, beside, check, holds
from granular.verify.silo import mass_is_exact

PUBLISHED = schemes.published.replace(dt=None)

LOOSE = 0.05
"""Shortfall of the nodal density that still counts as dense. The threshold of the paper is rho_c
itself, which a regular lattice of points straddles by quadrature noise alone."""

FRAMES = (0.5, 0.6, 0.7, 0.8, 0.9, 1.0)
"""Times at which the states are looked at [s]; the falling column holds some 60 points in each."""


def hourglass(kind: str, scheme: Scheme, E: float = 1e6) -> Simulation:
    """An hourglass, still to be run."""
    material = materials.glass_beads.replace(E=E)
    return Simulation(scenes.hourglass(kind=kind, material=material, scheme=scheme), threads=1)


def bearing_and_falling(state: State) -> tuple[NDArray[np.bool_], NDArray[np.bool_]]:
    """Points that must bear load, and points that must fall freely, by where they are.

    The first are above the divider, five radii of the opening away from it and three cells below
    the surface of the crater; the second 60 to 90 % of the way up from the base to the opening.
    """
    parameters = state.scene.parameters
    drop, cell = parameters["drop"], parameters["cell"]
    x, y = state.x.T
    crater = measure.surface(state, above=drop)
    column = np.clip(np.floor(x / cell).astype(int), 0, len(crater.x) - 1)
    far = x > 5 * parameters["orifice_radius"]
    bears = far & (y > drop) & (y < drop + crater.height[column] - 3 * cell)
    return bears, (y > 0.6 * drop) & (y < 0.9 * drop)


def states_as_figure_7(
    states: Sequence[State], name: str, *, stressed_share: float
) -> Iterator[Row]:
    """Rows of the state plot: load-bearing material dense, the falling column disconnected.

    By the nodal density of the paper, and by the stress of the points. The column is hardly
    wider than a cell: its nodal density comes near rho_c, so that most of it must be loose
    (here half), not all. Under stress must be `stressed_share`: the published scheme loses the
    stress of many points that lie in a dense heap.
    """
    shares = []
    for dense in (lambda s: measure.phase(s, tolerance=LOOSE), lambda s: s.dense):
        pooled = [(dense(state), *bearing_and_falling(state)) for state in states]
        bears = np.concatenate([phase[bears] for phase, bears, _ in pooled])
        falls = np.concatenate([phase[falls] for phase, _, falls in pooled])
        shares.append((float(bears.mean()), float(falls.mean())))
    (bears, falls), (stressed, falling) = shares
    yield at_least(f"dense above the divider, nodal density, {name}", bears, 0.9)
    yield at_most(f"dense in the falling column, nodal density, {name}", falls, 0.5)
    yield at_least(f"share under stress above the divider, {name}", stressed, stressed_share)
    yield at_most(f"share under stress in the falling column, {name}", falling, 0.2)


def heaps(state: State, name: str, *, bound: bool) -> Iterator[Row]:
    """Rows of the heap on the base; over the frictionless divider none is left in the end."""
    repose = measure.repose_angle(state, below=0.9 * state.scene.parameters["drop"], side="right")
    mean, largest = f"mean slope [deg], {name}", f"largest slope over 5 columns [deg], {name}"
    if bound:
        yield at_most(mean, repose.mean_deg, 20.9)
        yield at_most(largest, repose.largest_deg, 21.9)
    else:
        yield beside(mean, f"{repose.mean_deg:.1f}", f"{REPOSE:.1f}")
        yield beside(largest, f"{repose.largest_deg:.1f}", f"{REPOSE + 1:.1f}")


def frames(sim: Simulation) -> list[State]:
    """States at `FRAMES`."""
    return [sim.run(until=time).state for time in FRAMES]


@check()
def hourglass_quick() -> Iterator[Row]:
    """The flat hourglass up to 1 s, E = 1e6, published scheme."""
    sim = hourglass("flat", PUBLISHED)
    yield from states_as_figure_7(frames(sim), "flat, published", stressed_share=0.5)
    yield holds("mass is exact, flat, published", mass_is_exact(sim))


def _full(kind: str, scheme: Scheme, name: str, *, bound: bool) -> Iterator[Row]:
    sim = hourglass(kind, scheme)
    yield from states_as_figure_7(
        frames(sim), f"{kind}, {name}", stressed_share=0.9 if bound else 0.5
    )
    sim.run(until=10.0)
    yield holds(f"mass is exact, {kind}, {name}", mass_is_exact(sim))
    yield from heaps(sim.state, f"{kind}, {name}", bound=bound)


@check(slow=True)
def hourglass_published() -> Iterator[Row]:
    """Both hourglasses, 10 s, E = 1e6, published scheme; its slopes are known to be too steep."""
    yield from _full("flat", PUBLISHED, "published", bound=False)
    yield from _full("sloped", PUBLISHED, "published", bound=False)


@check(slow=True)
def hourglass_default() -> Iterator[Row]:
    """Both hourglasses, 10 s, E = 1e6, default scheme: heaps of both at rest within the bound."""
    yield from _full("flat", schemes.default, "default", bound=True)
    yield from _full("sloped", schemes.default, "default", bound=True)

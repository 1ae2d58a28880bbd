"""Figures 4.3 to 4.8: the friction law of sheared grains."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from granular import calibrate, plot
from granular.grain_scale import friction_law
from granular.grain_scale.friction_law import SteadyShear
from granular.materials import glass_beads_5mm
from granular.papers.dunatunga2015.panels import axes_grid
from granular.papers.figure import Drawn, Number
from granular.papers.hurley_thesis.document import PAPER
from granular.papers.hurley_thesis.shear_flows import (
    DENSITY,
    IMPACT,
    NAMES,
    PRESSURE,
    RESTITUTION,
    flows,
    grains,
)
from granular.papers.runs import Runs


@PAPER.figure(
    "4.3",
    "coefficient of restitution against the impact speed of both sets of grains",
    seconds=20.0,
    paper={"restitution of the first set at 0.1 sqrt(p/rho_s)": "below that of the second set"},
)
def restitution(runs: Runs) -> Drawn:
    """Restitution of a head-on collision (panel b); panel a is a diagram.

    The curves of the thesis are in its picture alone. Those here were chosen to lie apart.
    """
    unit = (PRESSURE / DENSITY) ** 0.5
    speeds = unit * np.geomspace(1e-3, 10.0, 20 if runs.quick else 80)
    picture, ((ax,),) = axes_grid(1)
    for name, dashes in (("low", "--"), ("high", "-")):
        values = [grains(name).restitution(speed) for speed in speeds]
        ax.semilogx(speeds / unit, values, dashes, color="black", label=NAMES[name])
    ax.axvline(IMPACT / unit, color="0.6", linewidth=0.9, linestyle=":")
    ax.set(xlabel=r"impact speed / $\sqrt{p/\rho_s}$", ylabel="restitution", ylim=(0.0, 1.0))
    ax.legend()
    numbers: dict[str, Number] = {
        f"restitution of the {order} set at 0.1 sqrt(p/rho_s)": grains(name).restitution(IMPACT)
        for order, name in (("first", "low"), ("second", "high"))
    }
    return Drawn({"": picture}, numbers)


@PAPER.figure(
    "4.4",
    "friction and packing fraction against the inertial number",
    seconds=540.0,
    paper={
        "packing fraction at I = 0": 0.59,
        "friction from the slowest flow to the fastest": "rises towards a plateau",
    },
)
def friction_and_packing(runs: Runs) -> Drawn:
    """Fit mu(I) and phi(I) to the first set; the data of other authors are in its picture alone."""
    sets = flows(runs, *(("low", "high") if runs.quick else RESTITUTION))
    first = next(iter(sets.values()))
    fit = friction_law.fit_rheology(first)
    numbers: dict[str, Number] = {name: getattr(fit, name) for name in ("mu_s", "mu_2", "I0")}
    packing = packing_fit(first)
    numbers["packing fraction at I = 0"] = packing.phi_max
    numbers["95 % interval of that fraction"] = interval(packing, "phi_max")
    numbers["slope m of phi = phi_max - m I"] = packing.m
    slowest, fastest = first[0], first[-1]
    numbers["friction from the slowest flow to the fastest"] = (
        f"{slowest.friction:.2f} to {fastest.friction:.2f}"
    )
    of, I0 = glass_beads_5mm, float(glass_beads_5mm.I0 or 0.0)
    beads = calibrate.MuIFit(of.mu_s, of.mu_2, I0, {}, np.zeros(0))
    return Drawn({"": plot.friction_and_packing(sets, {"glass beads": beads})}, numbers)


@PAPER.figure(
    "4.5",
    "friction by eq. 4.6 and by the stress",
    seconds=380.0,
    paper={"largest difference of both [%]": "excellent agreement"},
)
def law_and_stress(runs: Runs) -> Drawn:
    """Compare the friction that follows from the dissipation at the contacts with the stress."""
    first = flows(runs, "low")[NAMES["low"]]
    off = [100 * abs(one.friction_by_law / one.friction - 1) for one in first]
    numbers: dict[str, Number] = {
        "largest difference of both [%]": max(off),
        "largest error of the friction by stress [%]": max(
            100 * one.friction_error / one.friction for one in first
        ),
    }
    return Drawn({"": plot.friction_by_law(first)}, numbers)


@PAPER.figure(
    "4.6",
    "contributions of viscoelasticity and of sliding to the friction, of both sets",
    seconds=515.0,
    paper={
        "share of sliding in the slowest flow, first set": "most",
        "largest difference of the friction of both sets up to I = 0.4 [%]": "similar",
        "sliding of the second set over that of the first, I near 0.1": "larger",
    },
)
def shares(runs: Runs) -> Drawn:
    """Split the friction by eq. 4.9."""
    sets = flows(runs, "low", "high")
    low, high = sets.values()
    slow, fast = low[0], low[-1]
    pairs = [(nearest(low, one.inertial_number), one) for one in high]
    off = [100 * abs(b.friction / a.friction - 1) for a, b in pairs if b.inertial_number < 0.45]
    first, second = min(pairs, key=lambda pair: abs(pair[1].inertial_number - 0.1))
    numbers: dict[str, Number] = {
        "share of sliding in the slowest flow, first set": slow.friction_sliding
        / slow.friction_by_law,
        "share of sliding in the fastest flow, first set": fast.friction_sliding
        / fast.friction_by_law,
        "largest difference of the friction of both sets up to I = 0.4 [%]": max(off),
        "sliding of the second set over that of the first, I near 0.1": second.friction_sliding
        / first.friction_sliding,
    }
    return Drawn({"": plot.friction_shares(sets)}, numbers)


def nearest(of: Sequence[SteadyShear], inertial: float) -> SteadyShear:
    """Flow of the nearest inertial number."""
    return min(of, key=lambda one: abs(np.log(one.inertial_number / inertial)))


EXPONENTS = {"exponent of Gamma_n": 2.4, "exponent of Gamma_s": 1.87}


@PAPER.figure(
    "4.7",
    "coordination number, packing fraction, dissipation rates and Z phi/I",
    seconds=380.0,
    paper={
        "Z at I = 0": 4.0,
        "packing fraction at I = 0": 0.59,
        "exponent of Z phi/I up to I = 0.1": -1.0,
        "exponent of Z phi/I from there on": -2.0,
    }
    | EXPONENTS,
)
def dilation(runs: Runs) -> Drawn:
    """Fit eqs. 4.10 and 4.11, and powers of the inertial number."""
    first = flows(runs, "low")[NAMES["low"]]
    inertial = np.array([one.inertial_number for one in first])
    product = np.array([one.coordination * one.packing_fraction for one in first]) / inertial
    number = friction_law.fit_coordination(inertial, [one.coordination for one in first])
    numbers: dict[str, Number] = {
        "Z at I = 0": number.quasi_static,
        "packing fraction at I = 0": packing_fit(first).phi_max,
    }
    for name, part in (("up to I = 0.1", inertial < 0.11), ("from there on", inertial > 0.095)):
        power = np.nan
        if np.count_nonzero(part) >= 3:
            power = friction_law.fit_power(inertial[part], product[part]).exponent
        numbers[f"exponent of Z phi/I {name}"] = float(power)
    return Drawn({"": plot.scaling_of_dilation(first)}, numbers | exponents(first))


@PAPER.figure(
    "4.8",
    "dissipation rates of a contact on logarithmic scales",
    seconds=380.0,
    paper=EXPONENTS | {"exponent of Gamma_s in the slowest flows": 1.0},
)
def dissipation(runs: Runs) -> Drawn:
    """Fit powers to the flows from I = 0.05 on, and the slope between the two slowest."""
    first = flows(runs, "low")[NAMES["low"]]
    slow = [
        (np.log(one.inertial_number), np.log(one.sliding / one.dissipation_unit))
        for one in first[:2]
    ]
    slope = (slow[1][1] - slow[0][1]) / (slow[1][0] - slow[0][0])
    numbers = exponents(first) | {"exponent of Gamma_s in the slowest flows": float(slope)}
    return Drawn({"": plot.scaling_of_dissipation(first)}, numbers)


def exponents(first: Sequence[SteadyShear]) -> dict[str, Number]:
    """Exponents of both dissipation rates for I >= 0.05, with their intervals."""
    numbers: dict[str, Number] = {}
    for name, kind in (("Gamma_n", "viscoelastic"), ("Gamma_s", "sliding")):
        fit = friction_law.fit_dissipation(first, kind)
        numbers[f"exponent of {name}"] = fit.exponent
        numbers[f"95 % interval of that of {name}"] = interval(fit, "exponent")
    return numbers


def packing_fit(first: Sequence[SteadyShear]) -> calibrate.PackingFit:
    """Fit of eq. 4.11."""
    inertial = [one.inertial_number for one in first]
    return calibrate.fit_packing(inertial, [one.packing_fraction for one in first])


def interval(fit: Any, name: str) -> str:
    low, high = fit.intervals[name]
    return f"{low:.3g} to {high:.3g}"

"""Figures 4.4 to 4.8 of Hurley's thesis: friction of sheared grains from their contacts."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence

import numpy as np
from matplotlib.axes import Axes
from numpy.typing import ArrayLike

from granular import calibrate
from granular.grain_scale import friction_law
from granular.grain_scale.friction_law import SteadyShear
from granular.plot.canvas import MARKERS, Picture
from granular.tools.arrays import Array

Flows = Sequence[SteadyShear]


def _axes(columns: int, rows: int = 1) -> tuple[Picture, np.ndarray]:
    fig = Picture(figsize=(3.8 * columns if columns > 1 else 5.5, 3.6 * rows), layout="tight")
    axes = fig.subplots(rows, columns, squeeze=False)
    for ax in axes.ravel():
        ax.set(xscale="log", xlabel="inertial number I")
    return fig, axes


def _column(flows: Flows, name: str) -> Array:
    return np.array([getattr(flow, name) for flow in flows])


def _along(flows: Flows) -> Array:
    inertial = _column(flows, "inertial_number")
    return np.geomspace(0.8 * inertial.min(), 1.2 * inertial.max(), 200)


def _needs(sets: Mapping[str, Flows]) -> Flows:
    """Return the first set of flows, for which the laws are drawn; refuse empty sets."""
    if not sets or not all(len(flows) for flows in sets.values()):
        raise ValueError("sets holds no flows, or a set without any")
    return next(iter(sets.values()))


def friction_and_packing(
    sets: Mapping[str, Flows], laws: Mapping[str, Callable[[ArrayLike], Array]] | None = None
) -> Picture:
    """Figure 4.4: friction and packing fraction against the inertial number, with mu(I), phi(I).

    Friction and inertial number are computed from the invariants of the stress, as in the fit to
    the first set (`granular.grain_scale.friction_law.fit_rheology`). Bars are standard deviations
    in time.

    Parameters
    ----------
    sets : mapping of str to sequence of SteadyShear
        Sets of flows by name.
    laws : mapping of str to callable, optional
        Other laws mu(I) for comparison: functions of the inertial number, by name.

    Raises
    ------
    ValueError
        If there are no flows, or too few for the fit.
    """
    first = _needs(sets)
    fit = friction_law.fit_rheology(first)
    fig, ((left, right),) = _axes(2)
    along = _along(first)
    constants = rf"$\mu_s$ {fit.mu_s:.3f}, $\mu_2$ {fit.mu_2:.3f}, $I_0$ {fit.I0:.3f}"
    left.plot(along, fit(along), color="black", label=constants)
    for (name, law), dashes in zip((laws or {}).items(), ("--", ":", "-."), strict=False):
        left.plot(along, law(along), dashes, color="0.5", label=name)
    if fit.packing is not None:
        label = rf"$\phi$ = {fit.packing.phi_max:.3f} - {fit.packing.m:.3f} I"
        right.plot(along, fit.packing(along), color="black", label=label)
    for (name, flows), marker in zip(sets.items(), MARKERS, strict=False):
        friction, inertial = np.array([flow.invariants for flow in flows]).T
        style = {"fmt": marker, "markersize": 5, "capsize": 2, "label": name}
        left.errorbar(inertial, friction, _column(flows, "friction_spread"), **style)
        packing, spread = _column(flows, "packing_fraction"), _column(flows, "packing_spread")
        right.errorbar(inertial, packing, spread, **style)
    left.set_ylabel(r"friction $\mu$")
    right.set_ylabel(r"packing fraction $\phi$")
    for ax in (left, right):
        ax.legend()
    return fig


def friction_by_law(flows: Flows) -> Picture:
    """Figure 4.5: friction from the stress and from the law, and their ratio.

    The ratio is drawn together with the energy balance and its error (`SteadyShear.balance`). A
    flow that has not been sheared far may still expand or contract, and the law does not include
    the work of that.

    Parameters
    ----------
    flows : sequence of SteadyShear
    """
    _needs({"": flows})
    fig, ((left, right),) = _axes(2)
    inertial = _column(flows, "inertial_number")
    by_stress, by_law = _column(flows, "friction"), _column(flows, "friction_by_law")
    left.plot(inertial, by_stress, "o", color="black", fillstyle="none", label="stress, eq. 4.7")
    left.plot(inertial, by_law, "x", color="C3", label="law, eq. 4.6")
    left.set(ylabel=r"friction $\mu$", ylim=(0.0, None))
    left.legend()
    right.axhspan(0.98, 1.02, color="0.9", label="2 %")
    right.axhline(1.0, color="0.6", linewidth=0.9)
    right.plot(inertial, by_law / by_stress, "x", color="C3", label="law / stress")
    balance, error = _column(flows, "balance"), _column(flows, "law_error")
    style = {"fmt": "o", "fillstyle": "none", "capsize": 2}
    right.errorbar(inertial, balance, error, color="black", label="with dilation", **style)
    right.set_ylabel("ratio")
    right.legend()
    return fig


def friction_shares(sets: Mapping[str, Flows]) -> Picture:
    """Figure 4.6: contributions of viscoelasticity and sliding to friction, and their sum.

    Parameters
    ----------
    sets : mapping of str to sequence of SteadyShear
        Sets of flows by name.
    """
    _needs(sets)
    fig, ((left, right),) = _axes(2)
    for k, ((name, flows), marker) in enumerate(zip(sets.items(), MARKERS, strict=False)):
        inertial, color = _column(flows, "inertial_number"), f"C{k}"
        total = np.zeros(len(flows))
        for part, dashes, fill in (("sliding", "-", "full"), ("viscoelastic", "--", "none")):
            share, label = _column(flows, f"friction_{part}"), f"{part}, {name}"
            left.plot(inertial, share, marker + dashes, color=color, fillstyle=fill, label=label)
            total += share
        right.plot(inertial, total, marker + "-", color=color, label=name)
    left.set(ylabel=r"parts of the friction, eq. 4.9", ylim=(0.0, None))
    right.set(ylabel=r"friction $\mu$ by the law", ylim=(0.0, None))
    for ax in (left, right):
        ax.legend()
    return fig


def _power_line(ax: Axes, x: Array, exponent: float, at: tuple[float, float], label: str) -> None:
    """Draw a dashed line of a given slope through a point."""
    ax.plot(x, at[1] * (x / at[0]) ** exponent, "--", color="0.5", linewidth=1.0, label=label)


def _dissipation(ax: Axes, flows: Flows) -> None:
    inertial, along = _column(flows, "inertial_number"), _along(flows)
    unit = _column(flows, "dissipation_unit")
    for name, marker, symbol in (("viscoelastic", "s", "n"), ("sliding", "o", "s")):
        rate = _column(flows, name) / unit
        fit = friction_law.fit_dissipation(flows, name)
        label = rf"$\Gamma_{symbol}$, exponent {fit.exponent:.2f}"
        (line,) = ax.plot(inertial, rate, marker, fillstyle="none", label=label)
        fitted = along[along >= 0.05]  # as `fit_dissipation` takes flows
        ax.plot(fitted, fit(fitted), color=line.get_color(), linewidth=0.9)
    ax.set(yscale="log", ylabel=r"$\langle\Gamma\rangle / \tilde\Gamma$")


def scaling_of_dilation(flows: Flows) -> Picture:
    """Figure 4.7: coordination Z, packing fraction phi, dissipation of a contact and Z phi/I.

    Each is drawn with its law.

    Parameters
    ----------
    flows : sequence of SteadyShear
        At least 4, with different inertial numbers, 3 of them from 0.05 on.
    """
    _needs({"": flows})
    fig, ((upper, packing), (rates, dilation)) = _axes(2, 2)
    inertial, along = _column(flows, "inertial_number"), _along(flows)
    z, phi = _column(flows, "coordination"), _column(flows, "packing_fraction")
    number = friction_law.fit_coordination(inertial, z)
    label = f"Z = {number.Z1:.2f} + {number.Z2:.2f}/({number.b:.2f} + I)"
    upper.plot(along, number(along), color="black", label=label)
    upper.errorbar(inertial, z, _column(flows, "coordination_error"), fmt="o", color="C0")
    upper.set(ylabel="coordination Z", ylim=(0.0, None))
    law = calibrate.fit_packing(inertial, phi)
    label = rf"$\phi$ = {law.phi_max:.3f} - {law.m:.3f} I"
    packing.plot(along, law(along), color="black", label=label)
    packing.errorbar(inertial, phi, _column(flows, "packing_error"), fmt="o", color="C0")
    packing.set_ylabel(r"packing fraction $\phi$")
    _dissipation(rates, flows)
    product = z * phi / inertial
    dilation.plot(inertial, product, "o", fillstyle="none")
    for exponent, k in ((-1, inertial.argmin()), (-2, inertial.argmax())):
        _power_line(dilation, along, exponent, (inertial[k], product[k]), str(exponent))
    dilation.set(yscale="log", ylabel=r"$Z \phi / I$")
    for ax in (upper, packing, rates, dilation):
        ax.legend()
    return fig


def scaling_of_dissipation(flows: Flows) -> Picture:
    """Figure 4.8: dissipation of a contact, with the fits and the exponents of the thesis.

    Parameters
    ----------
    flows : sequence of SteadyShear
        At least 3 that `fit_dissipation` counts, of different inertial numbers from 0.05 on.
    """
    _needs({"": flows})
    fig, ((ax,),) = _axes(1)
    _dissipation(ax, flows)
    inertial, along = _column(flows, "inertial_number"), _along(flows)
    unit, middle = _column(flows, "dissipation_unit"), int(np.argsort(inertial)[len(inertial) // 2])
    for name, exponent in (("viscoelastic", 2.4), ("sliding", 1.87)):
        rate = _column(flows, name) / unit
        _power_line(ax, along, exponent, (inertial[middle], rate[middle]), f"thesis, {exponent}")
    slow = int(inertial.argmin())
    start = (inertial[slow], (_column(flows, "sliding") / unit)[slow])
    few = along[along < 10 * along[0]]
    ax.plot(
        few, start[1] * few / start[0], ":", color="black", linewidth=1.2, label="quasi-static, 1"
    )
    ax.legend()
    return fig

"""Figures of the friction law show the data they are given."""

import numpy as np
import pytest

from granular import plot
from granular.grain_scale.friction_law import SteadyShear

INERTIAL = (0.01, 0.1, 0.2, 0.5, 1.0)


def flows(sliding=1.0):
    """Flows with isotropic normal stress, so that friction is that of the invariants."""
    found = []
    for i in INERTIAL:
        shear = 100.0 * (0.3 + 0.4 * i / (0.3 + i))
        found.append(
            SteadyShear(
                inertial_number=i,
                shear_rate=1.0,
                normal_stress=100.0,
                stress=(-100.0, shear, 0.0, shear, -100.0, 0.0, 0.0, 0.0, -100.0),
                coordination=0.1 + 1.0 / (0.3 + i),
                packing_fraction=0.6 - 0.1 * i,
                viscoelastic=i**2.5,
                sliding=sliding * i**1.5,
                dissipation_unit=10.0,
                **{"dilation": 0.0, "slipping": 0.1, "kinetic": 0.0, "friction_spread": 0.02},
                **{"packing_spread": 0.01, "law_error": 0.01},
                **{"coordination_error": 0.01, "packing_error": 0.001},
            )
        )
    return found


def texts(figure):
    return [text.get_text() for ax in figure.axes for text in ax.get_legend().get_texts()]


def markers(ax):
    """Ordinates of the data drawn with markers."""
    return [line.get_ydata() for line in ax.get_lines() if line.get_marker() not in ("", "None")]


def test_friction_and_packing_say_the_constants_of_their_laws():
    figure = plot.friction_and_packing({"one": flows()}, {"other": lambda i: 0.4 + 0.0 * i})
    said = texts(figure)
    assert r"$\mu_s$ 0.300, $\mu_2$ 0.700, $I_0$ 0.300" in said
    assert r"$\phi$ = 0.600 - 0.100 I" in said
    assert {"one", "other"} <= set(said)
    (drawn,) = markers(figure.axes[0])[:1]
    assert drawn == pytest.approx([f.friction for f in flows()])


def test_law_beside_stress_and_their_ratio():
    given = flows()
    figure = plot.friction_by_law(given)
    by_stress, by_law = markers(figure.axes[0])
    assert by_stress == pytest.approx([f.friction for f in given])
    assert by_law == pytest.approx([f.friction_by_law for f in given])
    ratio, balance, *_caps = (y for y in markers(figure.axes[1]) if len(y) == len(given))
    assert ratio == pytest.approx(by_law / by_stress)
    assert balance == pytest.approx([f.balance for f in given])


def test_shares_add_up_and_scalings_say_their_exponents():
    figure = plot.friction_shares({"one": flows(), "two": flows(2.0)})
    parts, sums = markers(figure.axes[0]), markers(figure.axes[1])
    assert (len(parts), len(sums)) == (4, 2)
    assert parts[0] + parts[1] == pytest.approx(sums[0])
    assert parts[2] == pytest.approx(2.0 * parts[0])
    said = texts(plot.scaling_of_dilation(flows()))
    assert "Z = 0.10 + 1.00/(0.30 + I)" in said
    assert r"$\Gamma_n$, exponent 2.50" in said
    assert r"$\Gamma_s$, exponent 1.50" in said
    said = texts(plot.scaling_of_dissipation(flows()))
    assert "thesis, 2.4" in said
    assert r"$\Gamma_n$, exponent 2.50" in said


@pytest.mark.parametrize("empty", [{}, {"one": []}])
def test_no_flows_make_no_figure(empty):
    for function in (plot.friction_and_packing, plot.friction_shares):
        with pytest.raises(ValueError, match="no flows"):
            function(empty)
    with pytest.raises(ValueError, match="without any"):
        plot.friction_by_law(np.array([]))

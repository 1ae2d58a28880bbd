"""Results of suggestions, and halves of symmetric scenes that flow as half of the whole."""

import numpy as np
import pytest
from economy_scenes import full_silo

import granular as gr
from granular import Box, Fill, Gravity, Grid, Wall
from granular.economy import rules
from granular.materials import glass_beads
from granular.mpm.limits import damps_by_step
from granular.mpm.schemes import BASES, TRANSFERS
from granular.verify.quantities import change, quantities


def test_half_of_a_scene_flows_as_half_of_the_whole():
    """A column that falls to both sides: with linear functions its halves are mirror images."""
    whole = gr.Scene(
        name="column of two sides",
        grid=Grid((-0.4, 0.0), 0.025, (32, 12)),
        fills=(Fill(Box((-0.1, 0.0), (0.1, 0.2)), 4),),
        material=glass_beads.replace(E=1e6),
        scheme=gr.schemes.dunatunga_kamrin_2015.replace(dt=2e-4),
        walls=(Wall(1, 0.0), Wall(0, -0.4, kind="free_slip"), Wall(0, 0.4, kind="free_slip")),
        gravity=Gravity(),
        duration=0.3,
    )
    half = gr.economy.mirror_half(whole)
    full, right = (gr.Simulation(scene, threads=1).run().state for scene in (whole, half))
    assert full.n == 2 * right.n
    assert np.ptp(right.x[:, 0]) > 0.12  # it has fallen
    kept = full.x[:, 0] > 0
    order, known = (np.lexsort(np.round(x.T, 6)) for x in (full.x[kept], right.x))
    assert full.x[kept][order] == pytest.approx(right.x[known], abs=1e-9)


def mean_velocity(scheme):
    """Mean velocity [m/s] of one column on an incline of 25 degrees after one second."""
    grains = glass_beads.replace(E=1e6)
    scene = gr.scenes.incline(cell=0.02, material=grains, scheme=scheme)
    state = gr.Simulation(scene, threads=1).run(until=1.0).state
    return np.average(state.v[:, 0], weights=state.mass)


@pytest.mark.parametrize("basis", BASES)
@pytest.mark.parametrize("transfer", TRANSFERS)
def test_which_transfers_damp_by_the_step(transfer, basis):
    """Where a fifth of the step changes the flow, suggestions keep step, cells and E."""
    scheme = gr.Scheme(basis=basis, transfer=transfer, density=gr.ParticleDensity())
    coarse, fine = (mean_velocity(scheme.replace(cfl=cfl)) for cfl in (0.5, 0.1))
    assert (abs(fine / coarse - 1) > 0.005) == damps_by_step(scheme), fine / coarse


def test_half_of_a_silo_with_the_default_scheme():
    """The flow differs from that with linear functions, within the stated error."""
    whole = full_silo(
        grid=Grid((-0.5, 0.0), 0.02, (50, 54), open_sides=frozenset({"y-"})),
        material=glass_beads.replace(E=2e5),
        scheme=gr.schemes.default,
        walls=(
            *(Wall(1, 0.0, span=(side,)) for side in ((-0.5, -0.1), (0.1, 0.5))),
            Wall(1, 0.0, span=((-0.1, 0.1),), opens_at=0.1),
            *(Wall(0, side, kind="free_slip") for side in (-0.5, 0.5)),
        ),
    )
    rates = []
    for scene, parts in ((whole, 1), (gr.economy.mirror_half(whole), 2)):
        sim = gr.Simulation(scene, threads=1)
        mass = [sim.run(until=time).state.mass.sum() for time in (0.4, 0.9)]
        rates.append(parts * (mass[0] - mass[1]))
    assert 0 < abs(rates[1] / rates[0] - 1) <= rules.HALVED


def test_quantities_tell_soft_from_stiff():
    """Numbers of a run and their change: an incline with ten times softer grains flows faster."""
    soft, stiff = (
        quantities(
            gr.scenes.incline(
                cell=0.02,
                duration=1.0,
                material=glass_beads.replace(E=E),
                scheme=gr.schemes.dunatunga_kamrin_2015.replace(dt=None),
            )
        )
        for E in (1e5, 1e7)
    )
    assert soft.steps < stiff.steps / 9
    assert stiff.point_steps == 40 * stiff.steps
    moved = change(soft.numbers["mean velocity"], stiff.numbers["mean velocity"])
    assert 0.02 < moved < 0.2
    with pytest.raises(ValueError, match=r"scene\.name"):
        quantities(gr.scenes.silo().replace(name="another"))

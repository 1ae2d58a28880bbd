"""Earth pressure of dense sand, which dilates, and of critical sand on a smooth wall and base."""

import math

import pytest

import granular as gr

HEIGHT, SPEED, PATH = 0.1, 0.02, 0.002
SAND = gr.DilatantMuI(E=3e6, mu_s=0.4, mu_2=0.66, d=3e-4)


def pushed(packing, speed, sand=SAND, base=0.0, cells=10, **scheme):
    """A bed and a wall that is pushed into it, on a base with a friction."""
    cell = HEIGHT / cells
    motion = gr.Motion(times=(0.0, 0.02), velocity=((0.0, 0.0), (speed, 0.0)))
    return gr.Scene(
        name="wall",
        grid=gr.Grid((-2 * cell, 0.0), cell, (3 * cells + 2, cells + 3)),
        fills=(gr.Fill(gr.Box((0.0, 0.0), (0.3, HEIGHT)), 4, packing=packing, lithostatic=True),),
        material=sand,
        walls=(
            gr.Wall(1, 0.0, kind="coulomb", friction=base),
            gr.Wall(0, 0.3, kind="free_slip"),
        ),
        bodies=(gr.Body(gr.HalfSpace((1.0, 0.0)), (0.0, 0.0), motion=motion),),
        gravity=(0.0, -9.8),
        duration=1.0,
        **scheme,
    )


def coefficient(packing, speed):
    """Mean force over rho g H^2/2 on the last fifth of the path of the wall."""
    scene = pushed(packing, speed)
    sim, end = gr.Simulation(scene, threads=1), PATH / abs(speed) + 0.01
    sim.run(until=0.8 * end, monitor=False)
    before, begin = sim.bodies[0].impulse[0], sim.time
    sim.run(until=end, monitor=False)
    force = (before - sim.bodies[0].impulse[0]) / (sim.time - begin)
    return force / (0.5 * packing * SAND.rho_s * 9.8 * HEIGHT**2)


@pytest.mark.parametrize(("speed", "sign"), [(SPEED, 1), (-SPEED, -1)])
@pytest.mark.parametrize("packing", [0.585, 0.62])
def test_all_of_the_ground_yields_at_the_peak(packing, speed, sign):
    """Rankine's coefficient by hand, with the dilation psi = 4 (0.62 - 0.585) of dense sand.

    The bed is shortened by less than a hundredth, which changes its height and the force.
    """
    psi = 4.0 * (packing - 0.585)
    root = math.sqrt(1.0 - psi**2 / 3.0)
    sine = (0.4 + psi) * root / (1.0 - (0.4 + psi) * psi / 3.0)
    known = (1.0 + sign * sine) / (1.0 - sign * sine)
    assert coefficient(packing, speed) == pytest.approx(known, rel=0.03)
    found = gr.theory.earth_pressure(SAND.peak_friction(packing), dilation=psi)
    both = {1: found.passive_coaxial, -1: found.active_coaxial}
    assert both[sign] == pytest.approx(known)
    assert math.sin(math.radians(found.dilation_deg)) == pytest.approx(psi / root)


def test_averaged_cells_gain_no_energy_in_a_band_that_dilates():
    """The smoothing of the density takes a band for noise, and its remedy is said."""
    sand = SAND.replace(mu_s=0.12, mu_2=0.38, dilatancy=12.0)
    created, remedies = [], []
    for scheme in (gr.schemes.default, gr.schemes.cell_averaged):
        sim = gr.Simulation(pushed(0.62, 0.005, sand, base=0.54, cells=8, scheme=scheme))
        sim.run(until=0.2)
        rows = sim.health().indicators
        row = next(row for row in rows if row.name == "energy_created")
        created.append(row.value)
        remedies.append(row.remedy)
    assert created[0] > 0.02
    assert created[1] < 1e-6
    assert "schemes.cell_averaged" in remedies[0]
    assert "schemes.cell_averaged" not in remedies[1]

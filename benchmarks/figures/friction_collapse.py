"""From grains to a heap: mu(I) of sheared spheres, then a column of them that collapses.

The flows are from `friction_law`. Their rheology is used as a continuum material in
the column collapse of figure 2, and compared with the glass beads of the paper.
"""

import json

import numpy as np
from shared import RESULTS

import granular as gr
from figures.common import parser_of, save, tell
from granular import calibrate, plot
from granular.grain_scale import friction_law
from granular.grain_scale.friction_law import SteadyShear

TABLE = RESULTS / "friction_law.json"


def rheology() -> tuple[calibrate.MuIFit, dict]:
    """Fit to the flows of the table, and the grains of these flows."""
    table = json.loads(TABLE.read_text())
    flows = [SteadyShear(**row["flow"]) for row in table["rows"] if row["set"] == "low"]
    return friction_law.fit_rheology(flows), table["grains"]["low"]


def heap(material: gr.materials.MuI, quick: bool) -> gr.State:
    """State of the column at the end of its run."""
    size = {"cell": 0.05, "duration": 0.5} if quick else {}
    scene = gr.scenes.column_collapse(aspect=1.0, material=material, **size)
    simulation = gr.Simulation(scene)
    return tell(simulation.run(until=scene.duration)).state


def main(argv: list[str] | None = None) -> None:
    parser = parser_of(__doc__)
    parser.add_argument("--E", type=float, default=1e7, help="Young's modulus [Pa] (1e7)")
    chosen = parser.parse_args(argv)
    chosen.note = f"E = {chosen.E:g} Pa"
    fit, grains = rheology()
    # The diameter belongs to a sphere of the mean volume, as in the table's inertial numbers.
    d = gr.grain_scale.dem.Grains(**grains).d_volume
    materials = {
        "sheared grains": fit.material(d=d, rho_s=grains["rho_s"], E=chosen.E),
        "glass beads": gr.materials.glass_beads_5mm.replace(E=chosen.E),
    }
    fig = plot.Picture(figsize=(7.0, 2.5), layout="tight")
    left, right = fig.subplots(1, 2, width_ratios=(2, 3))
    inertial, end = np.geomspace(1e-3, 1.0, 200), 0.0
    for name, material in materials.items():
        mu_I = calibrate.MuIFit(material.mu_s, material.mu_2, material.I0, {}, np.zeros(0))
        left.plot(inertial, mu_I(inertial), label=name)
        state = heap(material, chosen.quick)
        runout, surface = gr.measure.runout(state), gr.measure.surface(state)
        right.plot(surface.x, surface.height, label=f"{name}: run-out {runout.quantile:.2f}")
        print(f"{name}: {material}, run-out {runout.quantile:.3f} half-widths")
        end = max(end, float(surface.x[surface.height > 0].max()))
    left.set(xscale="log", xlabel="inertial number I", ylabel=r"friction $\mu$")
    right.set(xlabel="x [m]", ylabel="height [m]", aspect="equal", xlim=(0.0, 1.05 * end))
    for ax in (left, right):
        ax.legend()
    save(fig, chosen, "friction_collapse")

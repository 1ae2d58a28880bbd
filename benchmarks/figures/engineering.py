"""Pictures of the guides on loads and on soil: pressure on walls."""

from __future__ import annotations

from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

import granular as gr
from figures.common import BLUE, GREY, ORANGE, panels, tell
from granular.plot import Picture


def wall_pressure(quick: bool) -> Picture:
    """Pressure and friction along a bin at rest and in flow, and along its cone with an insert."""
    cell = 0.02 if quick else 0.01
    scene = gr.scenes.hopper(
        angle_deg=20.0, orifice=0.12, width=0.3, fill_height=0.8, friction=0.3, cell=cell,
        ramp=0.3, opens_at=0.5, duration=1.0, mu_s=0.5, nu=0.4, E=1e6 if quick else 1e7,
    )  # fmt: skip
    wedge = gr.Polygon(((0.0, 0.18), (0.03, 0.24), (0.0, 0.30), (-0.03, 0.24)))
    insert = gr.Body(wedge, (0.0, 0.0), friction=0.3)
    made, (axes,) = panels(1, 3, 3.8, sharey=True)
    changed = scene.replace(bodies=(*scene.bodies, insert))
    with TemporaryDirectory() as folder:
        records = []
        for k, one in enumerate((scene, changed)):
            path = Path(folder, f"{k}.h5")
            gr.Simulation(one, tractions=True).run(save=path, every=0.01)
            records.append(gr.open(path))
        upright = gr.measure.wall_traction(records[0], body=1, bins=np.linspace(0.26, 0.8, 19))
        cones = [
            gr.measure.wall_traction(record, body=0, bins=np.linspace(0.0, 0.24, 9))
            for record in records
        ]
        tell(records[0])
    rest, flow = upright.mean(0.4, 0.5), upright.mean(0.7, 0.9)
    _along_bin(axes, scene, rest, flow, cones[0])
    for cone, color, label in zip(cones, (ORANGE, BLUE), ("no insert", "with insert"), strict=True):
        mean = cone.mean(0.7, 0.9)
        axes[2].errorbar(
            1e-3 * mean.normal, mean.position, xerr=1e-3 * mean.normal_scatter, fmt="o-",
            color=color, ms=4, label=label,
        )  # fmt: skip
    axes[2].set(title="cone in flow", xlabel="pressure [kPa]")
    axes[2].legend()
    return made


def _along_bin(
    axes: np.ndarray,
    scene: gr.Scene,
    rest: gr.measure.TractionProfile,
    flow: gr.measure.TractionProfile,
    cone: gr.measure.WallTraction,
) -> None:
    """Pressure and mobilised friction along the bin, and the pressure along its cone."""
    ratio = scene.material.nu / (1 - scene.material.nu)
    z = np.linspace(0.25, 0.8, 50)
    janssen = ratio * gr.theory.janssen_pressure(
        0.8 - z, 0.3, friction=0.3, ratio=ratio, rho=scene.material.rho_c
    )
    axes[0].plot(1e-3 * janssen, z, color=GREY, ls="--", label="Janssen")
    for mean, color, label in ((rest, BLUE, "at rest"), (flow, ORANGE, "in flow")):
        axes[0].errorbar(
            1e-3 * mean.normal, mean.position, xerr=1e-3 * mean.normal_scatter, fmt="o-",
            color=color, ms=4, label=label,
        )  # fmt: skip
        axes[1].plot(mean.friction, mean.position, "o-", color=color, ms=4, label=label)
    for begin, end, color in ((0.4, 0.5, BLUE), (0.7, 0.9, ORANGE)):
        mean = cone.mean(begin, end)
        axes[0].plot(1e-3 * mean.normal, mean.position, "s:", color=color, ms=4)
    axes[0].axhline(0.25, color=GREY, lw=0.8)
    axes[0].annotate("cone", (0.03, 0.24), xycoords=("axes fraction", "data"), va="top")
    axes[0].set(title="bin and cone", xlabel="pressure [kPa]", ylabel="elevation [m]")
    axes[0].legend()
    axes[1].axvline(0.3, color=GREY, ls="--", label="friction of the wall")
    axes[1].set(title="bin", xlabel="mobilised friction", xlim=(0.0, 0.35))
    axes[1].legend(loc="lower left")

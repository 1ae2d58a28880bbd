"""Figures 9 and 10: flow down inclines over time, against the angle, and its profile."""

import granular as gr
from figures.common import frames, options, save, states_at
from granular import plot


def main(argv: list[str] | None = None) -> None:
    chosen = options(__doc__, argv)
    angles = (19, 22, 25, 28, 31, 34) if chosen.quick else range(19, 35)
    until, cell = (2.0, 0.01) if chosen.quick else (20.0, 0.005)

    def scene(angle: float) -> gr.Scene:
        return gr.scenes.incline(angle_deg=float(angle), cell=cell, **chosen.settings)

    def last_and_flow(angle: float) -> plot.dunatunga_kamrin_2015.InclineFlow:
        name, every = f"{angle} deg", until / 100
        return plot.dunatunga_kamrin_2015.InclineFlow.measured(
            frames(scene(angle), until, every, lambda s: s, chosen, name=name)
        )

    flows = [last_and_flow(angle) for angle in angles]
    (state,) = states_at(scene(25), (3 * until,), chosen, name="profile at 25 deg")
    grains = chosen.material
    shown = [flow for flow in flows if flow.angle_deg in (19, 22, 25, 28, 31, 34)]
    picture = plot.dunatunga_kamrin_2015.figure_9(shown, mu_s=grains.mu_s, mu_2=grains.mu_2)
    save(picture, chosen, "figure_9")
    save(plot.dunatunga_kamrin_2015.figure_10(flows, state), chosen, "figure_10")

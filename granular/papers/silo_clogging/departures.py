"""Effect of each departure from the numerics of the document on the outflow of a silo."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any, cast

from granular import scenes
from granular.materials import NGF, MuI
from granular.model.state import State
from granular.mpm.scene import Scene
from granular.papers.figure import Drawn
from granular.papers.runs import Runs
from granular.papers.silo_clogging.document import PAPER, SCHEMES

WINDOW = (0.5, 1.0)
"""Time over which the outflow is measured [s]."""
FLOWS: dict[str, Any] = {"A": 1.0, "opening_over_d": 5.0}


def changed() -> Mapping[str, tuple[Scene, Scene]]:
    """Scenes with a departure, and without it, by the departure."""
    plain = scenes.clogging_silo(**FLOWS)
    fluidity = plain.scheme.fluidity

    def with_fluidity(**numbers: Any) -> Scene:
        scheme = plain.scheme.replace(fluidity=fluidity.replace(**numbers))
        return scenes.clogging_silo(**FLOWS, scheme=scheme)

    return {
        "sponge of a finite rate": (
            plain,
            scenes.clogging_silo(**FLOWS, sponge_damping=math.inf),
        ),
        "half of the silo": (plain, scenes.clogging_silo(**FLOWS, half=False)),
        "implicit diffusion": (plain, with_fluidity(method="explicit", substeps=20)),
        "averaged root of the pressure": (plain, with_fluidity(pressure_averaging=0.0)),
        "splines": (scenes.clogging_silo(**FLOWS, scheme=SCHEMES["splines"]), plain),
        "points without an extent, local law": (local("linear"), local("ugimp")),
    }


def local(basis: str) -> Scene:
    """The silo of the local law, as uGIMP is refused with the nonlocal one."""
    scene = scenes.clogging_silo(A=0.0, opening_over_d=FLOWS["opening_over_d"])
    m = cast(NGF, scene.material)
    names = ("E", "nu", "rho_c", "rho_s", "mu_s", "mu_2", "I0", "d")
    grains = MuI(**{name: getattr(m, name) for name in names})
    return scene.replace(material=grains, scheme=scene.scheme.replace(basis=basis))


@PAPER.figure(
    "departures",
    "outflow of a silo, A = 1 and W/d = 5, with each departure from the published numerics over "
    "that without it",
    seconds=27.0,
)
def departures(runs: Runs) -> Drawn:
    """Run a silo with each departure and without it."""
    numbers: dict[str, float] = {}
    for name, (here, there) in changed().items():
        ratio = outflow(runs, here, name) / outflow(runs, there, f"without {name}")
        numbers[f"outflow with {name} over that without"] = ratio
    return Drawn({}, numbers)


def outflow(runs: Runs, scene: Scene, name: str) -> float:
    """Outflow of the full silo [kg/(s m)]."""
    end = 0.1 if runs.quick else 1.0
    times = [end * time for time in WINDOW]
    first, last = (left(state) for state in runs.states_at(scene, times, name))
    return (2 if scene.parameters["half"] else 1) * (first - last) / (times[1] - times[0])


def left(state: State) -> float:
    """Mass in the silo [kg/m]."""
    return float(state.mass.sum())

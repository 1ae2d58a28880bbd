"""Settings of a figure, and the simulations that it needs."""

from __future__ import annotations

import hashlib
import os
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, TypeVar

from granular.economy import apply, suggest
from granular.materials import Material
from granular.model.state import State
from granular.model.typing import AnyScene
from granular.mpm.scene import Scene
from granular.mpm.schemes import Scheme
from granular.record import Trajectory, open_trajectory
from granular.run.simulation import Simulation
from granular.tools.checks import integer, one_of, positive
from granular.tools.progress import bar
from granular.tools.version import commit

SIZES = ("quick", "normal", "full")
T = TypeVar("T")
M = TypeVar("M", bound=Material)


@dataclass(frozen=True)
class Settings:
    """Settings of a figure.

    Parameters
    ----------
    size : {"normal", "quick", "full"}
        "quick" is coarse and short, to look at. "full" has the sizes and times of the document
        where the normal ones are smaller.
    scheme : str or None
        Name of one of the schemes of the figure; None for the first.
    E : float or None
        Young's modulus [Pa]; None for that of the figure.
    tolerance : float or None
        Start from the modulus of the document, or from `E`, and apply what `granular.economy`
        suggests at this tolerance.
    threads : int or None
        Threads of each simulation; no result depends on it.
    shift : float
        Displacement of all points at the start along the first axis [m]. Two runs that differ by
        1e-6 show how far a number is determined.
    folder : path
        Folder of the records of long runs. Finished ones are read, not made again.
    """

    size: str = "normal"
    scheme: str | None = None
    E: float | None = None
    tolerance: float | None = None
    threads: int | None = None
    shift: float = 0.0
    folder: Path = Path("figures_of_papers")

    def __post_init__(self) -> None:
        one_of("size", self.size, SIZES)
        for name in ("E", "tolerance"):
            if getattr(self, name) is not None:
                positive(name, getattr(self, name))
        if self.threads is not None:
            integer("threads", self.threads, 1)


class Runs:
    """Simulations of a figure, and the scenes that were run, which the picture is marked with.

    Attributes
    ----------
    quick, full : bool
        Size of the figure.
    remarks : list of str
        What else made the picture, where it is not made by scenes.
    verdicts : dict of str to str
        Verdict on each run, by its name: "ok", or the indicators that are suspect.
    """

    def __init__(self, settings: Settings, E: float | None, published_E: float | None) -> None:
        self.settings = settings
        self.quick, self.full = settings.size == "quick", settings.size == "full"
        start = published_E if settings.tolerance is not None else E
        self.E = settings.E if settings.E is not None else start
        self.scenes: list[AnyScene] = []
        self.materials: list[Material] = []
        self.remarks: list[str] = []
        self.verdicts: dict[str, str] = {}
        self._known: dict[str, Any] = {}

    # ---- parts of scenes ----

    def choose(self, schemes: Mapping[str, Scheme]) -> Scheme:
        """Scheme that the settings name, by default the first."""
        name = self.settings.scheme or next(iter(schemes))
        return schemes[one_of("scheme", name, tuple(schemes))]

    def grains(self, material: M) -> M:
        """The material with the Young's modulus of the figure."""
        changed = material if self.E is None else material.replace(E=self.E)
        self.materials.append(changed)
        return changed

    # ---- simulations ----

    def once(self, name: str, make: Callable[[], T]) -> T:
        """Result of `make`, which is called once: for runs that several figures need."""
        if name not in self._known:
            self._known[name] = make()
        return self._known[name]

    def simulation(self, scene: AnyScene) -> Simulation:
        """Simulation of a scene, or with a tolerance of the cheaper one that is suggested."""
        return self._made(self._suggested(scene))

    def _suggested(self, scene: AnyScene) -> AnyScene:
        if self.settings.tolerance is None or not isinstance(scene, Scene):
            return scene
        return apply(scene, suggest(scene, self.settings.tolerance))

    def _made(self, scene: AnyScene) -> Simulation:
        threads = self.settings.threads
        simulation: Simulation = Simulation(scene, threads=threads)
        if self.settings.shift:
            simulation = _shifted(simulation, self.settings.shift, threads)
        self.scenes.append(scene)
        return simulation

    def run(self, simulation: Simulation, name: str = "", **options: Any) -> Simulation:
        """Run a simulation, note the verdict on it, and return it."""
        simulation.run(**options)
        self.judge(simulation, name)
        return simulation

    def judge(self, simulation: Simulation, name: str = "") -> None:
        """Note the verdict on a run."""
        health = simulation.health()
        suspect = ", ".join(indicator.name for indicator in health.suspect)
        text = health.failure or (f"suspect: {suspect}" if suspect else "ok")
        self.verdicts[name or simulation.scene.name] = text

    def states_at(self, scene: AnyScene, times: Sequence[float], name: str = "") -> list[State]:
        """States of a run at ascending times, each of the first step at or after its time."""
        simulation, states = self.simulation(scene), []
        for time in bar(iterable=times, desc=name or scene.name, unit="state", leave=False):
            if time > 0:
                simulation.run(until=time)
            states.append(simulation.state)
        self.judge(simulation, name)
        return states

    def frames(
        self,
        scene: AnyScene,
        until: float,
        every: float,
        measure: Callable[[State], T],
        name: str = "",
    ) -> list[T]:
        """Results of `measure` at each frame of a run; the states are not stored."""
        results: list[T] = []
        simulation = self.simulation(scene)
        with bar(total=until, desc=name or scene.name, unit="s", leave=False) as progress:

            def look(running: Any) -> None:
                results.append(measure(running.state))
                progress.update(min(running.time, until) - progress.n)

            simulation.run(until=until, every=every, hooks=(look,))
        self.judge(simulation, name)
        return results

    def record(self, scene: AnyScene, name: str, *, every: float, **options: Any) -> Trajectory:
        """Record of a whole run in the folder of the settings, which is made only once.

        The name of the file ends with a digest of all that the run depends on, so that each size,
        scheme or displacement has a record of its own. `options` are those of `Simulation.run`.
        """
        scene = self._suggested(scene)
        run = f"{scene.to_json()} {every} {self.settings.shift} {options} {commit()}"
        digest = hashlib.sha256(run.encode()).hexdigest()[:8]
        path = self.settings.folder / f"{name}-{digest}.h5"
        if path.exists():
            self.scenes.append(scene)
            return open_trajectory(path)
        path.parent.mkdir(parents=True, exist_ok=True)
        # Of this process alone: a figure that is drawn at the same time may need the same run.
        partial = path.with_suffix(f".{os.getpid()}.h5")
        self.run(self._made(scene), name, every=every, save=partial, overwrite=True, **options)
        partial.replace(path)
        return open_trajectory(path)

    # ---- what was drawn ----

    @property
    def note(self) -> str:
        """Schemes, moduli and cells or spacings of the scenes, remarks, and the commit."""
        mpm = [scene for scene in self.scenes if isinstance(scene, Scene)]
        sph = [scene for scene in self.scenes if not isinstance(scene, Scene)]
        materials = [scene.material for scene in mpm] or self.materials
        parts = [
            _list(_words(scene.scheme) for scene in mpm),
            _list(f"E = {material.E:g} Pa" for material in materials),
            _list(f"cells of {1e3 * scene.grid.cell:.4g} mm" for scene in mpm),
            _list(f"SPH in {scene.dim}D" for scene in sph),
            _list(f"particles {1e3 * scene.grid.cell:.4g} mm apart" for scene in sph),
            _list(self.remarks),
        ]
        return "; ".join([*filter(None, parts), f"commit {commit()}"])


def _words(scheme: Scheme) -> str:
    single = ", single precision" if scheme.precision == "single" else ""
    return f"{scheme.basis} {scheme.transfer}, {scheme.density.name} density{single}"


def _list(texts: Iterable[str]) -> str:
    """Different texts of an iterable, at most three of them."""
    different = list(dict.fromkeys(texts))
    if len(different) > 3:
        different[2:-1] = ["..."]
    return " and ".join(different)


def _shifted(simulation: Simulation, by: float, threads: int | None) -> Simulation:
    """Simulation that has not begun, with all points displaced along the first axis."""
    start = simulation.checkpoint()
    x = start.arrays["x"].copy()
    # A row for each component; with SPH the particles of the material come first.
    x[0, : simulation.n_points] += by
    moved = replace(start, arrays={**start.arrays, "x": x})
    return Simulation.from_checkpoint(simulation.scene, moved, threads=threads)

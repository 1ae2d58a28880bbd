"""Interface of simulations to their methods, and the class that solves a kind of scenes."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, ClassVar, Self

from numpy.typing import NDArray

from granular import _core
from granular.model.state import State
from granular.run.restarts import check_numbers
from granular.tools.resources import Resource

if TYPE_CHECKING:
    from granular.measure.cell_sums import CellSums
    from granular.model.typing import AnyScene
    from granular.record.checkpoint import Checkpoint
    from granular.record.layout import Rows
    from granular.run.machine import Machine
    from granular.run.monitor import Energies, Monitor
    from granular.tools.arrays import BoolArray


_METHODS: dict[type, type[Method]] = {}
"""Class of the simulation for each class of scenes."""

_SHARED: dict[type, type[Method]] = {}
"""Class of a simulation that several processes share, for each class of those of one process."""


class Method(Resource):
    """Interface that each method implements; the base of `granular.Simulation`."""

    scene: AnyScene
    _engine: _core.Engine | _core.Sph
    _monitor: Monitor
    _same_bits: ClassVar[tuple[str, ...]] = ()
    """Instruction sets with which a run has the same bits."""
    _instead = (
        "sim.checkpoint() holds its state, and Simulation.from_checkpoint(sim.scene, checkpoint) "
        "makes another one of it"
    )

    def __init_subclass__(cls, *, scenes: type | None = None, shares: type | None = None) -> None:
        if scenes is not None:
            _METHODS[scenes] = cls
        if shares is not None:
            _SHARED[shares] = cls

    @classmethod
    def _of(cls, scene: object) -> type[Self]:
        """Return the class that simulates a scene, this one or a subclass."""
        for kind in type(scene).__mro__:
            method = _METHODS.get(kind)
            if method is not None and issubclass(method, cls):
                return method
        known = [kind for kind, method in _METHODS.items() if issubclass(method, cls)]
        kinds = [f"a {kind.__module__.removesuffix('.scene')}.{kind.__name__}" for kind in known]
        raise TypeError(f"scene = {scene!r} must be {' or '.join(sorted(kinds))}")

    @classmethod
    def _shared(cls) -> type[Any]:
        """Return the class of simulations of this method that several processes share."""
        for kind in cls.__mro__:
            if kind in _SHARED:
                return _SHARED[kind]
        raise ValueError("comm: processes share runs by the material point method alone")

    @staticmethod
    def _attend(comm: Any) -> Any:
        """Return the processes of an argument `comm`; all but rank 0 work for it, and exit."""
        (shared,) = set(_SHARED.values())
        return shared._attend(comm)

    def _make_steps(self, max_steps: int, until: float) -> None:
        """Run the core for `max_steps` steps or up to the time `until`, whichever is first."""
        raise NotImplementedError

    def _fields(self, recorded: bool) -> dict[str, NDArray]:
        """Return the fields of a state, ordered by id; with `recorded` only fields of records."""
        raise NotImplementedError

    def _checkpoint_data(self) -> tuple[dict[str, float | int], dict[str, NDArray | Rows]]:
        """Return the numbers and arrays of a checkpoint."""
        raise NotImplementedError

    @classmethod
    def _restored(cls, scene: Any, checkpoint: Checkpoint, machine: Machine) -> Self:
        """Return a simulation in the state of a checkpoint whose numbers are checked first."""
        check_numbers(checkpoint)
        sim = cls._filled(scene, checkpoint, machine)
        sim._monitor.restore(checkpoint.arrays, checkpoint.step)
        return sim

    @classmethod
    def _filled(cls, scene: Any, checkpoint: Checkpoint, machine: Machine) -> Self:
        """Return a simulation in the state of a checkpoint."""
        raise NotImplementedError

    @classmethod
    def _adapted(cls, before: AnyScene, scene: AnyScene, checkpoint: Checkpoint) -> Checkpoint:
        """Return a checkpoint of one scene with which a run goes on under a changed one."""
        return checkpoint

    @property
    def buffers(self) -> dict[str, NDArray]:
        """Arrays of the core, not copied: {field: (component, capacity)} and "id"."""
        raise NotImplementedError

    def _body_rows(self) -> NDArray | None:
        """Return the states of the rigid bodies for a frame; None for a method without any."""
        return None

    def _wall_rows(self) -> NDArray | None:
        """Return the impulses on the walls for a frame; none for a method that has none."""
        return None

    def _patches(self) -> dict[str, NDArray] | None:
        """Return the patches of walls and bodies for a frame; None if they are not asked for."""
        return None

    def _extra_state(self) -> dict[str, Any]:
        """Return the attributes of a state of the method besides the fields of its points."""
        return {}

    def _marked(self, state: State, thorough: bool) -> dict[str, BoolArray]:
        """Return points whose mass is summed for a sample, by the names of `_indicators`.

        Those that take long are computed only if it is `thorough`.
        """
        return {}

    def _indicators(self, sums: CellSums) -> dict[str, float]:
        """Return the numbers that the method adds to a sample, see `Scene.indicators`."""
        return {}

    def _energies(self) -> Energies | None:
        """Return the energies for a sample; None for a method that does not account for them."""
        return None

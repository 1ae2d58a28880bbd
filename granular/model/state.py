"""A snapshot of the material points, ordered by their ids."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from functools import cached_property
from typing import TYPE_CHECKING, TypeAlias

import numpy as np

from granular.shapes.region import Region
from granular.tools.arrays import Array, BoolArray
from granular.tools.checks import instance
from granular.tools.notebook import table

if TYPE_CHECKING:
    from granular.model.typing import AnyScene
    from granular.mpm.bodies import BodyState
    from granular.sph.gas import GasState


class State:
    """State of the points at one time: read-only arrays with one row per point, ordered by id.

    Parameters
    ----------
    scene : Scene
    time : float
        Time [s].
    step : int
        Number of steps made.
    dt : float
        Time step [s].
    fields : mapping of str to ndarray
        The stored fields: `x` (n, dim) [m], `v` (n, dim) [m/s], `stress` (n, 4) = xx, yy, zz, xy
        in 2D or (n, 6) = xx, yy, zz, xy, yz, xz in 3D [Pa, tension positive], `log_density` (n,)
        = ln(rho/rho_c), `mass` (n,) [kg, per metre of depth in 2D], `id` (n,), `shear_rate` (n,),
        the equivalent plastic shear rate [1/s], and the other fields that the scheme stores.
        Each is an attribute of the state.
    gas : GasState, optional
        The particles of the gas, for a scene with a gas; other states have no such attribute.
    bodies : sequence of BodyState, optional
        Positions, rotations and impulses of the rigid bodies of the scene, in their order; by
        default those at the start.

    Raises
    ------
    ValueError
        If `bodies` are not as many as those of the scene.
    """

    gas: GasState

    def __init__(
        self,
        *,
        scene: AnyScene,
        time: float,
        step: int,
        dt: float,
        fields: Mapping[str, Array],
        gas: GasState | None = None,
        bodies: Sequence[BodyState] = (),
    ) -> None:
        self.scene = scene
        self.time = float(time)
        self.step = int(step)
        self.dt = float(dt)
        self.fields = dict(fields)
        for array in self.fields.values():
            array.flags.writeable = False
        if gas is not None:
            self.gas = gas
        described = scene.bodies
        if bodies and len(bodies) != len(described):
            raise ValueError(
                f"bodies: {len(bodies)} must be as many as those of the scene, {len(described)}"
            )
        self.bodies = tuple(bodies) or tuple(body.at_start() for body in described)

    def __getattr__(self, name: str) -> Array:
        try:
            return self.__dict__["fields"][name]
        except KeyError:
            raise AttributeError(f"a state of this scene has no field {name!r}") from None

    @property
    def n(self) -> int:
        """Number of points."""
        return len(self.fields["x"])

    @property
    def dim(self) -> int:
        """Dimension, 2 or 3."""
        return self.fields["x"].shape[1]

    def within(self, region: Region) -> State:
        """Return the state of only those points that lie in a shape, or in another region.

        Any measure takes it, such as ``gr.measure.repose_angle(state.within(box))``.

        Raises
        ------
        TypeError, ValueError
            If it is no region, or does not have the dimension of the state.
        """
        instance("region", region, Region)
        inside = region.contains(self.x)
        return State(
            scene=self.scene,
            time=self.time,
            step=self.step,
            dt=self.dt,
            fields={name: array[inside] for name, array in self.fields.items()},
            gas=getattr(self, "gas", None),
            bodies=self.bodies,
        )

    def of_material(self, name: str, missing: float = np.nan) -> Array:
        """Attribute of the material of every point, such as "rho_c" or "mu_s", shape (n,).

        Parameters
        ----------
        name : str
            Name of a number of materials.
        missing : float
            Value where the material of a point does not have it, or it is None.
        """
        given = [getattr(material, name, None) for material in self.scene.materials]
        values = np.array([missing if value is None else value for value in given])
        if len(values) == 1:
            return np.full(self.n, values[0])
        return values[self.material.astype(int)]

    @cached_property
    def density(self) -> Array:
        """Density of the points [kg/m3], shape (n,)."""
        return self.of_material("rho_c") * np.exp(self.log_density) / self._bulking

    @property
    def _bulking(self) -> Array | float:
        """Volume of the points when free of stress over that at rho_c."""
        return self.bulking if "bulking" in self.fields else 1.0

    @property
    def packing(self) -> Array:
        """Packing fraction of the points, density over that of the grains, shape (n,).

        nan where the material has no rho_s.
        """
        return self.density / self.of_material("rho_s")

    @cached_property
    def rest_volume(self) -> Array:
        """Volume of the points at the density at which they are free of stress, shape (n,).

        That density is rho_c of the material, or of material that dilates that of its rest.

        In m3; in 2D per metre of depth, unless the grid is axisymmetric.
        """
        return self.mass / self.of_material("rho_c") * self._bulking

    @cached_property
    def volume(self) -> Array:
        """Volume of the points [m3; in 2D per metre of depth or of rings], shape (n,)."""
        return self.mass / self.density

    @cached_property
    def rings(self) -> Array:
        """Circumference of the rings that the points stand for [m], shape (n,).

        It is 1 unless the grid is axisymmetric: mass and volume over it are those of a plane, per
        metre of depth.
        """
        return np.broadcast_to(np.asarray(self.scene.grid.rings(self.x)), (self.n,))

    @cached_property
    def section(self) -> Array:
        """Area of the points in a 2D grid [m2, shape (n,)], in 3D their volume [m3]."""
        return self.volume / self.rings

    @cached_property
    def rest_section(self) -> Array:
        """The same at the density at which they are free of stress, shape (n,)."""
        return self.rest_volume / self.rings

    @cached_property
    def quadrature_volume(self) -> Array:
        """Quadrature volume of the stress of a point in the balance of forces, shape (n,).

        It is `volume` times the quadrature weight of the point, if the scheme corrects the weights
        (`Scheme.weight_correction`). Force, power and energy of the stresses are sums over these
        volumes.
        """
        if "weight_correction" in self.fields:
            return (1.0 + self.weight_correction) * self.volume
        return self.volume

    @cached_property
    def speed(self) -> Array:
        """Speed of the points [m/s], shape (n,)."""
        return np.linalg.norm(self.v, axis=1)

    @cached_property
    def pressure(self) -> Array:
        """Pressure -tr(stress)/3 [Pa], compression positive, shape (n,)."""
        return -self.stress[:, :3].sum(axis=1) / 3.0

    @cached_property
    def shear_stress(self) -> Array:
        """Equivalent shear stress sqrt(s:s/2) of the deviator s [Pa], shape (n,) (eq. 2.10)."""
        deviator = self.stress[:, :3] + self.pressure[:, None]
        square = 0.5 * (deviator**2).sum(axis=1) + (self.stress[:, 3:] ** 2).sum(axis=1)
        return np.sqrt(square)

    @cached_property
    def mu(self) -> Array:
        """Friction coefficient, shear stress by pressure, shape (n,); nan unless that is > 0."""
        return np.divide(
            self.shear_stress, self.pressure, out=np.full(self.n, np.nan), where=self.pressure > 0
        )

    @cached_property
    def dense(self) -> BoolArray:
        """True for points under pressure, shape (n,)."""
        return self.pressure > 0

    def __repr__(self) -> str:
        return f"State({self.scene.name}, t = {self.time:.6g} s, step {self.step}, {self.n} points)"

    def _repr_html_(self) -> str:
        rows = {
            "time [s]": self.time,
            "step": self.step,
            "points": self.n,
            "mass [kg]": float(self.mass.sum()),
            "stress-free": float((self.pressure == 0).mean()) if self.n else 0.0,
            "fields": ", ".join(self.fields),
        }
        return table(f"State of {self.scene.name}", rows)


States: TypeAlias = State | Iterable[State]
"""A state, or several: a trajectory or a sequence of states."""

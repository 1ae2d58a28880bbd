"""Data of an experiment: contacts, grains, their average stresses, and their motion."""

from __future__ import annotations

from dataclasses import dataclass, fields

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from granular.tools.arrays import Array, IndexArray
from granular.tools.checks import in_range, one_of, positive

OUTSIDE = -1_000_000
"""Number of the body that stands for all grains left out of a subset."""

UNIT = 1e-6
"""Largest deviation of the length of a normal from one."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Packing:
    """Contacts and grains in 2D (d = 2) or 3D (d = 3), as measured.

    In 2D volumes are areas of the faces, and masses, moments of inertia and forces are per unit
    depth. The shapes of the grains are not needed, only contacts, centroids and volumes.

    Parameters
    ----------
    bodies : array_like of int, shape (c, 2)
        The two bodies of each contact: grains are numbered from 0 on, walls (and other bodies
        without a balance) by any negative numbers. One of the two must be a grain.
    positions : array_like, shape (c, d)
        Positions of the contacts [m].
    shifts : array_like, shape (c, d), optional
        Vector from this position to the position of the contact at the second body [m], which is
        the length of the box across a periodic side. Zero by default.
    normals : array_like, shape (c, d)
        Unit vectors that point out of the first body. (Chapter 3 of the thesis has them inward.)
    centroids : array_like, shape (n, d)
        Centroids of the grains [m].
    volumes : array_like, shape (n,)
        Volumes of the grains [m3], in 2D [m2].
    stresses : array_like, shape (n, d, d), optional
        Average stress of each grain [Pa], tension positive. Give either these or the next two.
    strains : array_like, shape (n, d, d), optional
        Average strain of each grain, with `stiffness`.
    stiffness : array_like, shape (d, d, d, d) or (n, d, d, d, d), optional
        Elastic stiffness [Pa], such as that of `isotropic_stiffness`.
    masses : array_like, shape (n,), optional
        Masses [kg], in 2D [kg/m]; with `accelerations` or `gravity`.
    accelerations : array_like, shape (n, d), optional
        Accelerations of the centroids [m/s2]; zero by default.
    gravity : array_like, shape (d,), optional
        Gravity [m/s2]; zero by default.
    inertias : array_like, shape (n,) or (n, 3, 3), optional
        Moments of inertia about the centroids [kg m2], in 2D [kg m]; with `angular_accelerations`.
    angular_accelerations : array_like, shape (n,) or in 3D (n, 3), optional
        Angular accelerations [rad/s2]. Without them the rate of the angular momentum is taken as
        zero, which causes errors of some per cent where grains are hit off their centre, unless
        ``moments=False`` leaves the balance of moments out. (The gyroscopic term of non-spherical
        grains is neglected.)
    stress_errors : array_like, shape (n,), optional
        Standard deviation of each component of the average stress of a grain [Pa], > 0: the smaller
        it is, the more the stress of the grain counts.
    acceleration_errors : array_like, shape (n,), optional
        Standard deviation of each component of the acceleration [m/s2], > 0, with masses. The
        angular accelerations are assumed to cause the same error at the rim of the grain.

    Raises
    ------
    TypeError
        For an argument that is not an array of numbers.
    ValueError
        For a wrong shape; a value that is not finite; a contact that names a missing grain, the
        same body twice or no grain; normals that are not of unit length or mostly point inward;
        volumes, masses, moments of inertia or errors that are not positive; stresses that are not
        symmetric, or given both directly and by strains, or not at all; a motion without masses.
        The message names the first such contact or grain.
    """

    bodies: IndexArray
    positions: Array
    normals: Array
    centroids: Array
    volumes: Array
    stresses: Array = None  # type: ignore[assignment]  # an array once made
    strains: Array | None = None
    stiffness: Array | None = None
    masses: Array | None = None
    accelerations: Array | None = None
    gravity: Array | None = None
    inertias: Array | None = None
    angular_accelerations: Array | None = None
    stress_errors: Array | None = None
    acceleration_errors: Array | None = None
    shifts: Array | None = None

    def __post_init__(self) -> None:
        self._check_grains()
        self._check_contacts()
        self._check_stresses()
        self._check_motion()

    def _set(self, name: str, value: NDArray) -> None:
        value = value.copy()
        value.flags.writeable = False
        object.__setattr__(self, name, value)

    def _take(self, name: str, *shapes: tuple[int | None, ...]) -> Array:
        """Store an argument as finite floats of one of these shapes (None: any number)."""
        value = _numbers(name, getattr(self, name))
        if not any(_fits(value.shape, shape) for shape in shapes):
            wanted = " or ".join(_written(shape) for shape in shapes)
            raise ValueError(f"{name} has shape {value.shape}, must be {wanted}")
        self._set(name, value)
        return value

    def _check_grains(self) -> None:
        centroids = self._take("centroids", (None, 2), (None, 3))
        if not len(centroids):
            raise ValueError("centroids is empty: a packing must hold at least one grain")
        volumes = self._take("volumes", (self.n,))
        _all_positive("volumes", volumes)

    def _check_contacts(self) -> None:
        given = np.asarray(self.bodies)
        if given.dtype.kind not in "iu":
            raise TypeError(f"bodies must hold integers, not {given.dtype}")
        if given.ndim != 2 or given.shape[1] != 2:
            raise ValueError(f"bodies has shape {given.shape}, must be (any, 2)")
        if not len(given):
            raise ValueError("bodies is empty: a packing must hold at least one contact")
        self._set("bodies", given.astype(np.intp))
        bodies, c = self.bodies, len(given)
        for wrong, what in (
            (bodies.max(axis=1) >= self.n, f"must name grains from 0 to {self.n - 1} or walls < 0"),
            (bodies.max(axis=1) < 0, "must name at least one grain"),
            (bodies[:, 0] == bodies[:, 1], "must name two different bodies"),
        ):
            if wrong.any():
                k = int(np.argmax(wrong))
                raise ValueError(f"bodies[{k}] = {bodies[k].tolist()} {what}")
        self._take("positions", (c, self.dim))
        if self.shifts is not None:
            self._take("shifts", (c, self.dim))
        normals = self._take("normals", (c, self.dim))
        length = np.linalg.norm(normals, axis=1)
        if (abs(length - 1) > UNIT).any():
            k = int(np.argmax(abs(length - 1)))
            raise ValueError(f"normals[{k}] has length {length[k]:.9g}, must be 1")
        self._check_outward()

    def _check_outward(self) -> None:
        # For convex grains all normals point outward; for other grains a few may not.
        outward = np.concatenate(
            [
                sign * np.einsum("ka,ka->k", self.normals[contacts], arms)
                for contacts, _, sign, arms in self.sides()
            ]
        )
        inward = np.count_nonzero(outward <= 0)
        if 2 * inward > len(outward):
            raise ValueError(
                f"normals point into the first body at {inward} of {len(outward)} contacts, "
                "must point out of it"
            )

    def _check_stresses(self) -> None:
        d, n = self.dim, self.n
        if (self.stresses is None) == (self.strains is None):
            raise ValueError("give either stresses or strains with stiffness")
        if (self.strains is None) != (self.stiffness is None):
            raise ValueError("strains and stiffness must be given together")
        if self.strains is not None:
            strains = self._take("strains", (n, d, d))
            stiffness = self._take("stiffness", (d,) * 4, (n, *(d,) * 4))
            subscripts = "abij,nij->nab" if stiffness.ndim == 4 else "nabij,nij->nab"
            object.__setattr__(self, "stresses", np.einsum(subscripts, stiffness, strains))
        stresses = self._take("stresses", (n, d, d))
        skew = abs(stresses - stresses.transpose(0, 2, 1)).max(axis=(1, 2))
        if (skew > 1e-9 * abs(stresses).max()).any():
            k = int(np.argmax(skew))
            raise ValueError(f"stresses[{k}] = {stresses[k].tolist()} must be symmetric")

    def _check_motion(self) -> None:
        d, n = self.dim, self.n
        if self.masses is not None:
            _all_positive("masses", self._take("masses", (n,)))
        shapes = {"accelerations": (n, d), "gravity": (d,), "acceleration_errors": (n,)}
        for name, shape in shapes.items():
            if getattr(self, name) is not None:
                if self.masses is None:
                    raise ValueError(f"{name} need masses")
                self._take(name, shape)
        if (self.inertias is None) != (self.angular_accelerations is None):
            raise ValueError("inertias and angular_accelerations must be given together")
        if self.inertias is not None:
            inertias = self._take("inertias", (n,), *([(n, 3, 3)] if d == 3 else []))
            least = inertias if inertias.ndim == 1 else np.linalg.eigvalsh(inertias)[:, 0]
            _all_positive("inertias", least)
            self._take("angular_accelerations", (n,) if d == 2 else (n, 3))
        for name in ("stress_errors", "acceleration_errors"):
            if getattr(self, name) is not None:
                _all_positive(name, self._take(name, (n,)))

    @property
    def dim(self) -> int:
        """Dimension, 2 or 3."""
        return self.centroids.shape[1]

    @property
    def n(self) -> int:
        """Number of grains."""
        return len(self.centroids)

    @property
    def radius(self) -> float:
        """Mean radius of discs or spheres of these volumes [m], used as the length scale."""
        return float(self.radii.mean())

    @property
    def radii(self) -> Array:
        """Radii of discs or spheres of these volumes [m], shape (n,)."""
        if self.dim == 2:
            return np.sqrt(self.volumes / np.pi)
        return np.cbrt(3 * self.volumes / (4 * np.pi))

    def sides(self) -> list[tuple[IndexArray, IndexArray, float, Array]]:
        """Contacts as seen from the first and from the second body, without walls.

        Returns
        -------
        list of (contacts, grains, sign, arms)
            The force on the grain is the contact's force times the sign; the arms are the vectors
            from the centroids to the contacts [m].
        """
        views = []
        for side, sign in enumerate((1.0, -1.0)):
            contacts = np.flatnonzero(self.bodies[:, side] >= 0)
            grains = self.bodies[contacts, side]
            arms = self.seen_from(side)[contacts] - self.centroids[grains]
            views.append((contacts, grains, sign, arms))
        return views

    def seen_from(self, side: int) -> Array:
        """Positions of the contacts at the first (0) or second (1) bodies [m], shape (c, d)."""
        shifts = self.shifts if side == 1 else None
        return self.positions if shifts is None else self.positions + shifts

    def clusters(self) -> IndexArray:
        """Number of the connected cluster of each grain, shape (n,). Walls do not connect
        grains."""
        joined = self.bodies[(self.bodies >= 0).all(axis=1)]
        graph = coo_array((np.ones(len(joined)), joined.T), (self.n, self.n))
        return connected_components(graph, directed=False)[1].astype(np.intp)

    def rattlers(self) -> IndexArray:
        """Grains without a contact."""
        count = np.bincount(self.bodies[self.bodies >= 0], minlength=self.n)
        return np.flatnonzero(count == 0)

    def subset(self, grains: ArrayLike) -> tuple[Packing, IndexArray]:
        """Some grains with all their contacts, for inference within a window.

        Parameters
        ----------
        grains : array_like of int
            Numbers of the grains; grain i of the result is grains[i].

        Returns
        -------
        packing : Packing
            The subset, in whose contacts the grains left out are the body `OUTSIDE`.
        contacts : ndarray of int
            Numbers of its contacts in this packing, in order.

        Raises
        ------
        ValueError
            If a grain is missing or named twice.
        """
        chosen = np.asarray(grains)
        if chosen.ndim != 1 or not len(chosen) or chosen.dtype.kind not in "iu":
            raise ValueError(f"grains = {grains!r} must be integers, at least one")
        if chosen.min() < 0 or chosen.max() >= self.n or len(np.unique(chosen)) < len(chosen):
            raise ValueError(
                f"grains = {chosen.tolist()} must be different, from 0 to {self.n - 1}"
            )
        number = np.full(self.n, OUTSIDE)
        number[chosen] = np.arange(len(chosen))
        bodies = np.where(self.bodies >= 0, number[np.maximum(self.bodies, 0)], self.bodies)
        contacts = np.flatnonzero((bodies >= 0).any(axis=1))
        if not len(contacts):
            raise ValueError(f"grains = {chosen.tolist()} have no contacts")
        arguments = {
            f.name: getattr(self, f.name) for f in fields(self) if f.name not in _DERIVED_FROM
        }
        per_grain = {
            k: v[chosen] for k, v in arguments.items() if v is not None and k in _PER_GRAIN
        }
        return Packing(
            **(arguments | per_grain),
            bodies=bodies[contacts],
            positions=self.positions[contacts],
            normals=self.normals[contacts],
            shifts=None if self.shifts is None else self.shifts[contacts],
        ), contacts


_PER_GRAIN = (
    *("centroids", "volumes", "stresses", "masses", "accelerations", "inertias"),
    *("angular_accelerations", "stress_errors", "acceleration_errors"),
)
_DERIVED_FROM = ("bodies", "positions", "normals", "shifts", "strains", "stiffness")
"""Fields that a subset does not inherit: it has other contacts, and its stresses are known."""


def isotropic_stiffness(E: float, nu: float, dim: int, *, plane: str = "stress") -> Array:
    """Hooke's law of an isotropic grain as a tensor.

    Parameters
    ----------
    E : float
        Young's modulus [Pa], > 0.
    nu : float
        Poisson's ratio, 0 <= nu < 1/2, or up to 1/2 in plane stress.
    dim : int
        2 or 3.
    plane : {"stress", "strain"}
        In 2D: "stress" if the faces are free (discs), "strain" if they are fixed (long cylinders).

    Returns
    -------
    ndarray, shape (dim, dim, dim, dim)
        Stiffness [Pa].
    {raises}.
    """
    positive("E", E)
    one_of("dim", dim, (2, 3))
    one_of("plane", plane, ("stress", "strain"))
    free = dim == 2 and plane == "stress"
    in_range("nu", nu, 0.0, 0.5, open_high=not free)
    shear = E / (2 * (1 + nu))
    volumetric = E * nu / (1 - nu**2) if free else E * nu / ((1 + nu) * (1 - 2 * nu))
    one = np.eye(dim)
    pairs = np.einsum("ai,bj->abij", one, one) + np.einsum("aj,bi->abij", one, one)
    return volumetric * np.einsum("ab,ij->abij", one, one) + shear * pairs


def _numbers(name: str, value: ArrayLike) -> Array:
    try:
        numbers = np.asarray(value, dtype=np.float64)
    except (TypeError, ValueError):
        raise TypeError(f"{name} must be an array of real numbers") from None
    if not np.isfinite(numbers).all():
        where = np.argwhere(~np.isfinite(np.atleast_1d(numbers)))[0].tolist()
        raise ValueError(f"{name}{where} must be finite")
    return numbers


def _fits(shape: tuple[int, ...], wanted: tuple[int | None, ...]) -> bool:
    return len(shape) == len(wanted) and all(
        w is None or s == w for s, w in zip(shape, wanted, strict=True)
    )


def _written(shape: tuple[int | None, ...]) -> str:
    return str(tuple("any" if s is None else s for s in shape)).replace("'", "")


def _all_positive(name: str, values: NDArray[np.floating]) -> None:
    if (values <= 0).any():
        k = int(np.argmax(values <= 0))
        raise ValueError(f"{name}[{k}] = {values[k]} must be > 0")

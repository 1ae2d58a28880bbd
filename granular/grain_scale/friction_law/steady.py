"""Steady shear: averages over frames, and the friction law of the thesis (chapter 4)."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from granular.grain_scale import dem
from granular.grain_scale.dem import Grains
from granular.grain_scale.friction_law.contacts import Sample, sample
from granular.measure.stress import friction_of, pressure
from granular.tools.arrays import Array
from granular.tools.checks import integer


@dataclass(frozen=True, kw_only=True)
class SteadyShear:
    """Time averages of a shear flow, and quantities derived from them.

    Attributes
    ----------
    inertial_number : float
        ``I = shear_rate d sqrt(rho_s/normal_stress)`` of the averages.
    shear_rate, normal_stress : float
        Shear rate [1/s]; -sigma_yy [Pa].
    stress : tuple of 9 floats
        Mean stress, tension positive [Pa], row by row.
    coordination, packing_fraction : float
        Z, twice the number of contacts divided by that of grains, and phi.
    viscoelastic, sliding : float
        Mean dissipation per contact [W]: <Gamma_n> and <Gamma_s> of eq. 4.8.
    dissipation_unit : float
        ``Gamma~ = pi d^2 normal_stress^1.5/(3 sqrt(rho_s))`` [W].
    dilation : float
        Growth of ln V per shear strain during the average, zero in a steady flow. A material that
        expands does work on its load, so that the contacts dissipate `friction` less `dilation`.
    slipping, kinetic : float
        Share of the contacts at the limit of friction; share of the normal stress due to the
        motion.
    friction_error, coordination_error, packing_error, law_error : float
        Standard errors of the means of `friction`, `coordination`, `packing_fraction` and
        `balance`, from blocks of frames; nan with too few frames.
    friction_spread, packing_spread : float
        Standard deviations in time of `friction` and `packing_fraction`.
    frames : int
        Number of frames averaged.
    """

    inertial_number: float
    shear_rate: float
    normal_stress: float
    stress: tuple[float, ...]
    coordination: float
    packing_fraction: float
    viscoelastic: float
    sliding: float
    dissipation_unit: float
    dilation: float
    slipping: float
    kinetic: float
    friction_error: float = math.nan
    coordination_error: float = math.nan
    packing_error: float = math.nan
    law_error: float = math.nan
    friction_spread: float = math.nan
    packing_spread: float = math.nan
    frames: int = 1

    @property
    def friction(self) -> float:
        """Effective friction from the stress (eq. 4.7): sigma_yx divided by the normal stress."""
        return self.stress[3] / self.normal_stress

    @property
    def _dilation(self) -> float:
        return self.coordination * self.packing_fraction / self.inertial_number

    @property
    def friction_viscoelastic(self) -> float:
        """mu_n of eq. 4.9."""
        return self._dilation * self.viscoelastic / self.dissipation_unit

    @property
    def friction_sliding(self) -> float:
        """mu_s of eq. 4.9."""
        return self._dilation * self.sliding / self.dissipation_unit

    @property
    def friction_by_law(self) -> float:
        """Effective friction from the law (eq. 4.6): ``(Z phi/I) <Gamma>/Gamma~``."""
        return self.friction_viscoelastic + self.friction_sliding

    @property
    def balance(self) -> float:
        """Dissipated power divided by the supplied one, ideally 1.

        It is `friction_by_law` divided by the difference of `friction` and `dilation`.
        """
        return self.friction_by_law / (self.friction - self.dilation)

    @property
    def invariants(self) -> tuple[float, float]:
        """``tau/p`` of the invariants of the stress, and the inertial number with that p.

        These are the friction and the pressure of the continuum laws; the shear rate is the same.
        """
        s = np.array(self.stress).reshape(3, 3)
        s = 0.5 * (s + s.T)
        rows = np.array([[s[0, 0], s[1, 1], s[2, 2], s[0, 1], s[1, 2], s[0, 2]]])
        p = float(pressure(rows)[0])
        return float(friction_of(rows)[0]), self.inertial_number * math.sqrt(self.normal_stress / p)


def average(samples: Sequence[Sample], grains: Grains, *, blocks: int = 10) -> SteadyShear:
    """Average frames of a steady shear flow.

    The law is formed from products of averages, as in eq. 4.4, so that it is the balance of energy
    over these frames.

    Parameters
    ----------
    samples : sequence of Sample
        Samples in the order of time.
    blocks : int
        Number of blocks of equal length from whose scatter the standard errors are estimated, at
        least 2.

    Raises
    ------
    ValueError
        Without samples, or if the mean normal stress, shear rate or number of contacts is not > 0.
    """
    blocks = integer("blocks", blocks, 2)
    if len(samples) == 0:
        raise ValueError("samples has 0 frames, at least 1 is needed")
    whole = _averaged(samples, grains)
    if len(samples) < 2 * blocks:
        return SteadyShear(**whole, frames=len(samples))
    ends = np.linspace(0, len(samples), blocks + 1).round().astype(int)
    pieces = [SteadyShear(**_averaged(samples[a:b], grains)) for a, b in pairwise(ends)]

    def error(name: str) -> float:
        return float(np.std([getattr(p, name) for p in pieces], ddof=1) / math.sqrt(blocks))

    stress = np.array([s.stress for s in samples])
    return SteadyShear(
        **whole,
        friction_error=error("friction"),
        coordination_error=error("coordination"),
        packing_error=error("packing_fraction"),
        law_error=error("balance"),
        friction_spread=float(np.std(stress[:, 1, 0] / whole["normal_stress"])),
        packing_spread=float(np.std([s.solid / s.volume for s in samples])),
        frames=len(samples),
    )


def _averaged(samples: Sequence[Sample], grains: Grains) -> dict:
    """The averages, without errors."""

    def mean(name: str) -> float:
        return float(np.mean([getattr(s, name) for s in samples]))

    stress: Array = np.mean([s.stress for s in samples], axis=0)
    kinetic = float(np.mean([s.kinetic[1, 1] for s in samples]))
    normal, rate, contacts = -float(stress[1, 1]), mean("shear_rate"), mean("contacts")
    for name, value in (("normal stress", normal), ("shear rate", rate), ("contacts", contacts)):
        if not value > 0:
            raise ValueError(f"the mean {name} = {value:.6g} of the samples must be > 0")
    d = grains.d_volume
    first, last = samples[0], samples[-1]
    strain = rate * (last.time - first.time)
    growth = math.log(first.solid / first.volume) - math.log(last.solid / last.volume)
    return {
        "inertial_number": rate * d * math.sqrt(grains.rho_s / normal),
        "shear_rate": rate,
        "normal_stress": normal,
        "stress": tuple(float(s) for s in stress.ravel()),
        "coordination": 2.0 * contacts / mean("grains"),
        "packing_fraction": mean("solid") / mean("volume"),
        "viscoelastic": mean("viscoelastic") / contacts,
        "sliding": mean("sliding") / contacts,
        "dissipation_unit": math.pi * d**2 * normal**1.5 / (3.0 * math.sqrt(grains.rho_s)),
        "dilation": growth / strain if strain > 0 else 0.0,
        "slipping": mean("slipping") / contacts,
        "kinetic": -kinetic / normal,
    }


def steady_shear(
    settings: dem.Shear,
    *,
    layer: tuple[float, float] | None = None,
    timeout: float = 3600.0,
    command: Sequence[str] | None = None,
) -> SteadyShear:
    """Shear grains with LAMMPS and average.

    Parameters
    ----------
    settings : granular.grain_scale.dem.Shear
    layer : (float, float), optional
        Layer to evaluate between walls, as fractions of the height: see `sample`. Away from the
        walls the flow is that of the bulk. But energy comes from the walls, so that more is
        dissipated there than stress and shear rate account for.
    timeout, command
        See `granular.grain_scale.dem.shear`, also for the exceptions.
    """
    samples = dem.shear(
        settings,
        lambda frame: sample(frame, settings.grains, layer),
        timeout=timeout,
        command=command,
    )
    return average(samples, settings.grains)

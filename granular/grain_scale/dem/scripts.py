"""Input for LAMMPS: the initial grains, and the scripts of shear cells and packings.

All numbers are in the scaled units of `granular.grain_scale.dem.settings.Units`, in which they are
near one. This is necessary: where `fix deform/pressure` corrects the velocity of grains that cross
a boundary, it uses the rate of strain in place of the rate of length (LAMMPS of July 2025). For
boxes some ten units long the error is a tenth of a small correction; for boxes of millimetres,
expressed in metres, it blows the grains apart.
"""

from __future__ import annotations

import math

import numpy as np

from granular.grain_scale.dem.dumps import ATOM_COLUMNS, CONTACT_COLUMNS
from granular.grain_scale.dem.settings import SPACING, Packing, Shear
from granular.tools.arrays import Array, IntArray

_MIXING = 0.1
"""Inertial number at which a cell is compacted and its grains are mixed."""
_MIXED = 2.0
"""Shear strain by which the grains are mixed."""
_COMPACTION = 40.0
"""Duration of a compaction."""
_COMPRESSION = 0.1
"""Rate of compression when nothing resists."""
_YIELDING = 0.5
"""Rate of compression of dense cells when nothing resists, divided by the shear rate."""
_INERTIA = 1.0
"""Time in which the height would double if nothing resisted."""
_SETTLING = 200.0
"""Time in which a packing comes to rest."""
_SINKING = 0.2
"""Speed at which the upper wall sinks onto loose grains."""


def start(settings: Shear | Packing) -> str:
    """Data file: grains of both sizes in random order on a loose, randomly perturbed cubic array.

    With walls, there is a layer of grains of the mean size on either side (type 3 below, type 4
    above), side by side and at random heights.
    """
    unit, rng = settings.units.length, np.random.default_rng(settings.seed)
    walls = isinstance(settings, Shear) and settings.drive == "walls"
    large, width = settings.grains.diameters[1] / unit, settings.width / unit
    across = max(int(width / (SPACING * large)), 2)
    spacing = width / across
    layers = math.ceil(settings.count / across**2)
    sites = np.stack(np.meshgrid(*map(np.arange, (across, layers, across)), indexing="ij"), axis=-1)
    sites = rng.permutation(sites.reshape(-1, 3))[: settings.count]
    free = 0.5 * (spacing - large)
    x = (sites + 0.5) * spacing + rng.uniform(-free, free, sites.shape)
    kinds = 1 + np.arange(settings.count) % 2
    parts = [(kinds, np.where(kinds == 1, *settings.grains.diameters) / unit, x)]
    height, margin = layers * spacing, 2.0 if walls else 0.0
    if isinstance(settings, Shear) and walls:
        parts += [_wall(settings, 3, 0.0, rng), _wall(settings, 4, height, rng)]
    kinds, diameters, x = (np.concatenate(column) for column in zip(*parts, strict=True))
    lines = [
        "grains",
        f"{len(kinds)} atoms",
        f"{4 if walls else 2} atom types",
        f"0 {width:.17g} xlo xhi",
        f"{-margin:.17g} {height + margin:.17g} ylo yhi",
        f"0 {width:.17g} zlo zhi",
        "" if walls else "0 0 0 xy xz yz",
        "\nAtoms # sphere\n",
    ]
    for number, (kind, diameter, place) in enumerate(zip(kinds, diameters, x, strict=True), 1):
        where = " ".join(f"{c:.17g}" for c in place)
        lines.append(f"{number} {kind} {diameter:.17g} 1.0 {where}")
    return "\n".join(lines) + "\n"


def _wall_grains(settings: Shear) -> int:
    """Number of grains along each side of a wall."""
    return max(int(settings.width / settings.grains.d), 2)


def _wall(
    settings: Shear, kind: int, y: float, rng: np.random.Generator
) -> tuple[IntArray, Array, Array]:
    """Types, diameters and positions of the grains of a wall whose inner face is at y."""
    across = _wall_grains(settings)
    d = settings.grains.d / settings.units.length
    sites = np.stack(np.meshgrid(*2 * [np.arange(across)], indexing="ij"), axis=-1).reshape(-1, 2)
    outwards = -1.0 if kind == 3 else 1.0
    x = np.empty((across**2, 3))
    x[:, ::2] = (sites + 0.5) * settings.width / settings.units.length / across
    x[:, 1] = y + outwards * d * (0.5 + rng.uniform(0.0, 0.5, across**2))
    return np.full(across**2, kind), np.full(across**2, d), x


def _head(settings: Shear | Packing, boundary: str) -> list[str]:
    """Script lines for units, grains and contact law."""
    g, u = settings.grains, settings.units
    law = (g.kn / u.stress, g.kt / u.stress, g.gamma_n * u.length * u.time)
    return [
        "units lj",
        "atom_style sphere",
        f"boundary {boundary}",
        "newton off",
        "comm_modify vel yes",  # of images, which move with the box
        "read_data start",
        "neighbor 0.2 bin",
        "neigh_modify every 1 delay 0 check yes",
        f"pair_style gran/hertz/history {' '.join(f'{k:.17g}' for k in law)} 0.0 {g.mu_p:.17g} 0",
        "pair_coeff * *",
        f"timestep {settings.dt / u.time:.17g}",
        "thermo_modify norm no",
        f"thermo {_steps(settings, _COMPACTION)}",
    ]


def _output(every: int) -> list[str]:
    """Script lines for both dumps, with enough digits for the overlaps, as small differences."""
    contacts = " ".join(f"c_contact[{k + 1}]" for k in range(len(CONTACT_COLUMNS)))
    lines = [
        "compute pair all property/local patom1 patom2 cutoff radius",
        f"compute contact all pair/local {' '.join(CONTACT_COLUMNS)} cutoff radius",
        f"dump atoms all custom {every} atoms {' '.join(ATOM_COLUMNS)}",
        f"dump contacts all local {every} contacts c_pair[1] c_pair[2] {contacts}",
    ]
    return lines + [
        f"dump_modify {name} first no time yes format float %.10g" for name in ("atoms", "contacts")
    ]


def _steps(settings: Shear | Packing, duration: float) -> int:
    """Number of time steps of a scaled duration."""
    return max(math.ceil(duration * settings.units.time / settings.dt), 1)


def shear_script(settings: Shear) -> str:
    """Script of a shear cell: compaction, approach, frames."""
    steps = _steps(settings, settings.strain / _rate(settings))
    every = max(round(steps / settings.frames), 1)
    stages = _walls(settings) if settings.drive == "walls" else _homogeneous(settings)
    if settings.drive == "homogeneous":
        stages.append(f"fix growth all ave/time {every} 1 {every} f_motion[5] file growth")
    last = [*_output(every), f"thermo {every * settings.frames}", f"run {every * settings.frames}"]
    return "\n".join([*stages, *last]) + "\n"


def _rate(settings: Shear) -> float:
    """Scaled shear rate."""
    return settings.shear_rate * settings.units.time


def _homogeneous(settings: Shear) -> list[str]:
    """Script lines for a box that is sheared at a given rate and whose height has inertia.

    The height moves like a wall with inertia, which takes no energy on the average. A height that
    followed the stress without inertia would take energy, because it would yield while the stress
    is high: a tenth of the work of the shear at I = 0.01.
    """
    rate = _rate(settings)
    mixing = _MIXING * rate / settings.inertial_number
    # W d(rate)/dt = V (stress - 1) with W = (n + 1) ptemp Pdamp^2. By default ptemp would be the
    # temperature at the start of a run, with which the wall of a fast flow would be sluggish.
    inertia = f"$({_INERTIA}*sqrt(vol/(atoms+1)):%.17g) ptemp 1.0"
    return [
        *_head(settings, "p p p"),
        f"variable flow atom {mixing:.17g}*y",
        "velocity all set v_flow NULL NULL",
        "fix motion all nve/sphere",
        "compute relative all temp/deform",  # the temperature excludes the mean flow
        "thermo_modify temp relative",
        _servo(mixing, _COMPRESSION),
        f"run {_steps(settings, _COMPACTION)}",
        _servo(mixing, _YIELDING * mixing),
        f"run {_steps(settings, _MIXED / mixing)}",
        "unfix cell",
        "unfix motion",
        f"fix cell all deform 1 xy erate {rate:.17g} remap v",
        f"fix motion all nph/sphere y 1.0 1.0 {inertia} scalexy no scaleyz no scalexz no",
        "fix_modify motion temp relative",
        f"run {_steps(settings, settings.approach / rate)}",
        "unfix cell",
        "reset_timestep 1",  # so that the first frame is due after `every` steps, not at once
        'print "$(ly:%.17g)" file height',  # length to which the rate of `fix deform` refers
        f"fix cell all deform 1 xy erate {rate:.17g} remap v",
    ]


def _servo(rate: float, gain: float) -> str:
    """Script line for shear at a height that follows the stress, until the state is dense."""
    return (
        f"fix cell all deform/pressure 1 xy erate {rate:.17g} y pressure 1.0 {gain:.17g}"
        f" normalize/pressure yes max/rate {max(gain, 0.1 * rate):.17g} remap v"
    )


def _walls(settings: Shear) -> list[str]:
    """Script lines for two walls of grains that move in opposite directions.

    The pressure acts on the upper wall.
    """
    width = settings.width / settings.units.length
    load = width**2 / _wall_grains(settings) ** 2
    half = 0.5 * _rate(settings) * width * settings.aspect
    return [
        *_head(settings, "p s p"),
        "group lower type 3",
        "group upper type 4",
        "group walls union lower upper",
        "group flowing subtract all walls",
        "neigh_modify exclude type 3 3",
        "neigh_modify exclude type 4 4",
        f"velocity lower set {-half:.17g} 0 0",
        f"velocity upper set {half:.17g} 0 0",
        "fix motion flowing nve/sphere",
        # No force moves the walls, except the force on the upper one along y.
        "fix plates walls rigid group 2 lower upper force 1 off off off force 2 off on off"
        " torque * off off off",
        f"fix load upper addforce 0 {-load:.17g} 0",
        f"fix brake upper viscous {load / _SINKING:.17g}",
        f"run {_steps(settings, 2 * _COMPACTION)}",
        "unfix brake",
        f"run {_steps(settings, settings.approach / _rate(settings))}",
        "reset_timestep 1",
    ]


def packing_script(settings: Packing) -> str:
    """Script of a packing, which is compressed along three axes and then brought to rest."""
    speeds = [f"variable v{a} atom normal(0,1,{settings.seed + k})" for k, a in enumerate("xyz", 1)]

    def pressed(gain: float) -> str:
        stress = [p / settings.units.stress for p in settings.stress]
        axes = " ".join(f"{a} pressure {p:.17g} {gain}" for a, p in zip("xyz", stress, strict=True))
        return f"fix cell all deform/pressure 1 {axes} normalize/pressure yes max/rate {gain}"

    lines = [
        *_head(settings, "p p p"),
        *speeds,
        "velocity all set v_vx v_vy v_vz",  # without velocities the regular array would remain
        "fix motion all nve/sphere",
        pressed(_COMPRESSION),
        f"run {_steps(settings, _COMPACTION)}",
        "fix drag all viscous 1.0",
        pressed(0.1 * _COMPRESSION),
        f"run {_steps(settings, _SETTLING)}",
        "unfix cell",
        f"run {_steps(settings, _SETTLING)}",
        *_output(1),
        "run 0",
    ]
    return "\n".join(lines) + "\n"

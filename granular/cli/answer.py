"""The command `granular answer`: a number of a scene with its uncertainty."""

from __future__ import annotations

import argparse
import importlib
import os
import sys
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any

from granular.cli.commands import UNFINISHED
from granular.cli.words import number, truth, whole

if TYPE_CHECKING:
    from granular.mpm.scene import Scene
    from granular.record import Trajectory


def add_answer(commands: Any, add_command: Any) -> None:
    """Add the command and its options."""
    text = "compute a number with its uncertainty: runs in several cells, with other E and points"
    command = add_command(commands, "answer", text)
    text = "name of a scene, see `granular list`, or its file (.toml, .json)"
    command.add_argument("scene", metavar="SCENE|FILE", help=text)
    text = "discharge, runout, height, repose_angle, mean_speed, or module:function of a record"
    command.add_argument("--measure", required=True, metavar="NAME", help=text)
    text = "size of the cells [m]; default that of the scene"
    command.add_argument("--cell", type=number, metavar="X", help=text)
    text = "relative uncertainty to reach; default 0.03"
    command.add_argument("--tolerance", type=number, default=0.03, metavar="X", help=text)
    text = "power of the size of cells to which errors are proportional; default 1"
    command.add_argument("--order", type=number, default=1.0, metavar="X", help=text)
    text = "largest processor time [s]; default 3600"
    command.add_argument("--budget", type=number, default=3600.0, metavar="T", help=text)
    text = "whether E is a number of the method; default no if a material bears tension, else yes"
    command.add_argument("--rigid", type=truth, metavar="yes|no", help=text)
    for name, text in (("wall-forces", "forces on walls"), ("tractions", "pressures on walls")):
        text = f"record {text}, for measures that need them"
        command.add_argument(f"--{name}", action="store_true", help=text)
    text = "time between frames [s]; default 1/60"
    command.add_argument("--every", type=number, metavar="T", help=text)
    text = "threads of each run; no result depends on it"
    command.add_argument("--threads", type=whole, metavar="N", help=text)
    text = "folder of the records, whose runs are not made again"
    command.add_argument("--folder", type=Path, metavar="FOLDER", help=text)
    command.add_argument("--quiet", action="store_true", help="no progress bar")
    command.set_defaults(command=answer)


def answer(arguments: argparse.Namespace) -> int:
    """Print a number with its uncertainty, and the runs that it took."""
    from granular import economy

    result = economy.answer(
        _scene(arguments.scene, arguments.cell),
        _measure(arguments.measure),
        tolerance=arguments.tolerance,
        order=arguments.order,
        budget=arguments.budget,
        rigid=arguments.rigid,
        wall_forces=arguments.wall_forces,
        tractions=arguments.tractions,
        every=arguments.every,
        folder=arguments.folder,
        threads=arguments.threads,
        progress=not arguments.quiet,
    )
    print(result.runs_table())
    print(result)
    return 0 if result.reached else UNFINISHED


def _scene(name: str, cell: float | None) -> Scene:
    """Scene of a name or a file."""
    from granular.mpm.scene import Scene
    from granular.scenes import registry
    from granular.scenes.files import SUFFIXES, read_scene
    from granular.tools.checks import one_of

    given = {} if cell is None else {"cell": cell}
    if Path(name).suffix in SUFFIXES:
        scene = read_scene(name, **given).scene
    else:
        scene = registry[one_of("scene", name, tuple(registry))](**given)
    if not isinstance(scene, Scene):
        raise ValueError(f"scene = {name!r} must be one of the material point method")
    return scene


def _measure(name: str) -> str | Callable[[Trajectory], float]:
    """Name of a measure, or the function of a module of this folder or of the environment."""
    module, colon, function = name.partition(":")
    if not colon:
        return name
    sys.path.insert(0, os.getcwd())
    try:
        measure: Callable[[Trajectory], float] = getattr(importlib.import_module(module), function)
    except AttributeError as error:
        raise ValueError(f"measure = {name!r}: {error}") from error
    finally:
        sys.path.pop(0)
    return measure

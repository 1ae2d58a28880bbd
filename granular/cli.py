"""The command `granular`: new, run, resume, info, compare, plot, verify, list, completion.

Exit codes: 0 all is well, 1 the run or a check failed, or two records differ, 2 the user asked for
something impossible (one line on stderr says what), 3 with `--strict`: the run ended, but an
indicator of failure is suspect (stderr says which, and what to do), 130 Ctrl-C.
"""

from __future__ import annotations

import argparse
import inspect
import math
import os
import sys
import warnings
from collections.abc import Callable, Sequence
from dataclasses import fields
from pathlib import Path
from typing import TYPE_CHECKING, Any, NoReturn, get_type_hints

if TYPE_CHECKING:
    from granular.diagnostics import Health
    from granular.simulation import Simulation
    from granular.typing import AnyScene

__all__ = ["main"]

FAILED, REFUSED, SUSPECT, INTERRUPTED = 1, 2, 3, 130

PICTURES = (".png", ".pdf", ".svg")

BY_SCENE, UNSET = "chosen by the scene", "none"
"""Default of a keyword of a scene and of its material that is None."""

OWN_OPTIONS = ("material", "scheme", "numerics")
"""Arguments of scene functions that have options of their own."""
ARRAYS = ("release",)
"""Arguments of scene functions that are arrays, which only Python can give."""

_Keyword = tuple[str, Callable[[str], Any], Any]
"""Name, converter from text, and default of a keyword."""

USER_ERRORS = (
    ValueError,
    TypeError,
    FileNotFoundError,
    FileExistsError,
    PermissionError,
    IsADirectoryError,
    NotADirectoryError,
    BlockingIOError,
)
"""Exceptions raised for arguments and files that cannot be used."""


class _Parser(argparse.ArgumentParser):
    """Parser whose errors are one line and whose options cannot be abbreviated."""

    def __init__(self, **kwargs: Any) -> None:
        super().__init__(allow_abbrev=False, **kwargs)

    def error(self, message: str) -> NoReturn:
        self.exit(REFUSED, f"{self.prog}: error: {' '.join(message.split())}\n")


def main(argv: Sequence[str] | None = None) -> int:
    """Run the command with arguments (by default those of the process); return the exit code."""
    try:
        words = sys.argv[1:] if argv is None else argv
        arguments = _parser(words).parse_args(words)
    except SystemExit as stop:  # --help, --version, or a refused argument
        return int(stop.code or 0)
    try:
        return arguments.command(arguments)
    except KeyboardInterrupt:
        print("granular: interrupted", file=sys.stderr)
        return INTERRUPTED
    except BrokenPipeError:  # the reader of our output has left, as `head` does
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return FAILED
    except USER_ERRORS as error:
        return _complain(error, REFUSED)
    except (RuntimeError, MemoryError, OSError) as error:  # SimulationError is a RuntimeError
        return _complain(error, FAILED)


def _complain(error: BaseException, code: int) -> int:
    """Print an error with its notes in one line; return the exit code."""
    notes = getattr(error, "__notes__", ())
    text = "; ".join([str(error) or type(error).__name__, *notes])
    print(f"granular: error: {' '.join(text.split())}", file=sys.stderr)
    return code


# ---- commands and options ----


def _parser(words: Sequence[str] = ()) -> argparse.ArgumentParser:
    """Parser of the command; a file of a scene among the words is one of its scenes."""
    from granular import __version__

    parser = _Parser(prog="granular", description="Dense granular flow as a continuum.")
    parser.add_argument("--version", action="version", version=f"granular {__version__}")
    commands = parser.add_subparsers(required=True, metavar="COMMAND")
    text = "print a file of a scene, with all its numbers, for `granular run`"
    command = commands.add_parser("new", help=text)
    command.add_argument("scene", metavar="SCENE")
    command.set_defaults(command=_new)
    _add_run(commands, words)
    command = _add_file_command(commands, _resume, "go on with a record where it stopped")
    _add_run_options(command, "default as before")
    _add_file_command(commands, _info, "contents of a record, which is verified")
    command = _add_file_command(commands, _plot, "picture or animation of a record")
    command.add_argument("--frame", type=_whole, default=-1, help="default -1, the last one")
    command.add_argument("-o", "--output", metavar="PNG")
    _add_picture_options(command)
    command.add_argument("--quiet", action="store_true", help="no progress bar")
    text = "numbers in which two records differ; exit code 1 if they do"
    command = commands.add_parser("compare", help=text)
    command.add_argument("first", metavar="FILE")
    command.add_argument("second", metavar="FILE")
    command.set_defaults(command=_compare)
    command = commands.add_parser("verify", help="check the package against theory")
    command.add_argument("--slow", action="store_true", help="the long checks too")
    command.set_defaults(command=_verify)
    command = commands.add_parser("list", help="the scenes and their keywords")
    command.set_defaults(command=_list)
    command = commands.add_parser("completion", help="print a script that completes words")
    command.add_argument("shell", choices=("bash", "zsh", "tcsh"))
    command.set_defaults(command=_completion, parser=parser)
    return parser


def _add_run(commands: Any, words: Sequence[str]) -> None:
    from granular.scenes import registry
    from granular.scenes.files import SUFFIXES

    text = "simulate a scene, or that of a file (.toml, .json), and record it"
    command = commands.add_parser("run", help=text)
    scenes = command.add_subparsers(required=True, metavar="SCENE|FILE")
    for name in words[1:2]:
        if Path(name).suffix in SUFFIXES:
            scene = scenes.add_parser(name)
            _add_recording(scene)
            scene.set_defaults(file=name)
    for name, function in registry.items():
        scene = scenes.add_parser(name, help=_summary(function))
        group = scene.add_argument_group("keywords of the scene")
        _add_keywords(group, _keywords(function), BY_SCENE)
        group = scene.add_argument_group("material")
        _add_keywords(group, _material_keywords(function), UNSET)
        if "mpm" in function.methods:
            choices = ("default", "cell_averaged", "dunatunga_kamrin_2015")
            scene.add_argument("--scheme", choices=choices, help="default that of the scene")
        _add_recording(scene)
        scene.set_defaults(scene=function, scheme=None, file=None)


def _add_recording(scene: Any) -> None:
    """Add the options of a run of any scene."""
    _add_run_options(scene, "default 1/60")
    text = "HDF5 record, for ParaView ending in .vtkhdf"
    scene.add_argument("-o", "--output", metavar="FILE", required=True, help=text)
    text = "change a number of the scene, such as scheme.cfl=0.3 or bodies.0.friction=0.4"
    scene.add_argument("--set", action="append", default=[], metavar="PLACE=VALUE", help=text)
    text = "run even if the estimated memory exceeds that of the machine"
    scene.add_argument("--force", action="store_true", help=text)
    scene.add_argument("--picture", metavar="PNG", help="picture of the last state")
    _add_picture_options(scene)
    scene.set_defaults(command=_run)


def _add_keywords(group: Any, keywords: Sequence[_Keyword], none: str) -> None:
    """Add an option for each keyword, which may be spelled with hyphens too."""
    for name, kind, default in keywords:
        spelled = dict.fromkeys((f"--{name}", f"--{name.replace('_', '-')}"))
        shown = f"default {_shown(default, none)}"
        group.add_argument(
            *spelled, dest=f"scene_{name}", type=kind, metavar=METAVARS[kind], help=shown
        )


def _add_file_command(commands: Any, run: Callable[..., int], text: str) -> Any:
    """Add the command of a record whose function is `run`, with the same name."""
    command = commands.add_parser(run.__name__.removeprefix("_"), help=text)
    command.add_argument("file", metavar="FILE")
    command.set_defaults(command=run)
    return command


def _add_run_options(command: Any, every: str) -> None:
    command.add_argument("--until", type=_number, metavar="T", help="stop at this time [s]")
    command.add_argument("--threads", type=_whole, metavar="N", help="default: as fits")
    command.add_argument("--every", type=_number, help=f"time between frames [s]; {every}")
    command.add_argument("--quiet", action="store_true", help="no progress bar")
    text = "exit code 3 if an indicator of failure is suspect at the end"
    command.add_argument("--strict", action="store_true", help=text)


def _add_picture_options(command: Any) -> None:
    command.add_argument("--gif", metavar="GIF", help="animation of all frames")
    text = "field in pictures; default shear_rate"
    command.add_argument("--color", default="shear_rate", metavar="F", help=text)
    command.add_argument("--overwrite", action="store_true", help="existing files may go")


def _number(text: str) -> float:
    try:
        value = float(text)
    except ValueError:
        value = math.nan
    if math.isnan(value):
        raise argparse.ArgumentTypeError(f"{text!r} is not a number")
    return value


def _whole(text: str) -> int:
    try:
        return int(text)
    except ValueError:
        raise argparse.ArgumentTypeError(f"{text!r} is not a whole number") from None


def _numbers(text: str) -> tuple[float, ...]:
    return tuple(_number(part) for part in text.split(","))


def _truth(text: str) -> bool:
    try:
        return {"yes": True, "no": False}[text]
    except KeyError:
        raise argparse.ArgumentTypeError(f"{text!r} is not yes or no") from None


METAVARS = {_number: "X", _whole: "N", _numbers: "X,Y", str: "NAME", _truth: "yes|no"}
"""Placeholders of values in the help, by converter."""


def _converter(hint: Any) -> Callable[[str], Any]:
    """Converter from text to a type, or to the first of several alternatives."""
    kinds: dict[str, Callable[[str], Any]] = {
        "float": _number,
        "int": _whole,
        "str": str,
        "tuple": _numbers,
        "bool": _truth,
    }
    options = [option for option in getattr(hint, "__args__", ()) if option is not type(None)]
    # tuple[float, float] has arguments too, which are not alternatives.
    if getattr(hint, "__origin__", None) is tuple or not options:
        options = [hint]
    return kinds[options[0].__name__]


def _keywords(function: Callable[..., Any]) -> list[_Keyword]:
    """Keywords of a scene function, from its signature."""
    from granular.scenes._registry import own_keywords

    hints = get_type_hints(function)
    return [
        (name, _converter(hints[name]), default)
        for name, default in own_keywords(inspect.signature(function)).items()
        if name not in (*OWN_OPTIONS, *ARRAYS)
    ]


def _material_keywords(function: Callable[..., Any]) -> list[_Keyword]:
    """Numbers of the default material of a scene function, except its own keywords."""
    own = inspect.signature(function).parameters
    material = own["material"].default
    hints = get_type_hints(type(material))
    return [
        (field.name, _converter(hints[field.name]), getattr(material, field.name))
        for field in fields(material)
        if field.name not in own
    ]


def _summary(function: Callable[..., Any]) -> str:
    """First paragraph of the docstring in one line."""
    return " ".join((inspect.getdoc(function) or "").partition("\n\n")[0].split())


def _shown(value: Any, none: str) -> str:
    """Default value in the help; `none` stands for None."""
    if isinstance(value, tuple):
        return ",".join(f"{part:g}" for part in value)
    if isinstance(value, bool):
        return "yes" if value else "no"
    return none if value is None else f"{value}"


# ---- execution of the commands ----


def _run(arguments: argparse.Namespace) -> int:
    from granular import Simulation
    from granular.diagnostics import StabilityWarning, scene_warnings
    from granular.economy import cost

    scene = _scene(arguments)
    if not arguments.quiet:
        print(f"{scene.name}: {cost(scene)}")
    _check_output(arguments.output, arguments.overwrite)
    _check_pictures(arguments.picture, arguments.gif, arguments.overwrite)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", StabilityWarning)  # printed below in one line each
        simulation = Simulation(scene, threads=arguments.threads, force=arguments.force)
    for warning in scene_warnings(scene):
        print(f"granular: warning: {warning}", file=sys.stderr)
    if arguments.picture or arguments.gif:
        from granular.plot.fields import values

        values(simulation.state, arguments.color)  # refuses an unknown field before the run
    code = _simulate(simulation, arguments, save=arguments.output, overwrite=arguments.overwrite)
    if code in (0, SUSPECT):
        _draw(arguments.output, arguments.picture, -1, arguments)
    return code


def _scene(arguments: argparse.Namespace) -> AnyScene:
    """Make the scene of a run; the options of a file are added to the arguments."""
    from granular.mpm import schemes
    from granular.scenes.files import changed, read_scene

    if arguments.file is not None:
        found = read_scene(arguments.file)
        for name, value in found.run.items():
            if getattr(arguments, name) is None:
                setattr(arguments, name, value)
        return changed(found.scene, arguments.set)
    given = {
        name.removeprefix("scene_"): value
        for name, value in vars(arguments).items()
        if name.startswith("scene_") and value is not None
    }
    if arguments.scheme not in (None, "default"):
        given["scheme"] = getattr(schemes, arguments.scheme)
    return changed(arguments.scene(**given), arguments.set)


def _new(arguments: argparse.Namespace) -> int:
    from granular.scenes.files import template

    print(template(arguments.scene), end="")
    return 0


def _compare(arguments: argparse.Namespace) -> int:
    from granular.comparing import compare

    found = compare(arguments.first, arguments.second)
    print(found)
    return 0 if found.same_bits and not found.numbers else FAILED


def _completion(arguments: argparse.Namespace) -> int:
    try:
        import shtab
    except ImportError:
        raise ValueError(
            "completion needs the package shtab: pip install 'granular[completion]'"
        ) from None
    print(shtab.complete(arguments.parser, arguments.shell))
    return 0


def _resume(arguments: argparse.Namespace) -> int:
    from granular import Simulation

    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        simulation = Simulation.resume(arguments.file, threads=arguments.threads)
    for warning in caught:
        print(f"granular: warning: {warning.message}", file=sys.stderr)
    return _simulate(simulation, arguments)


def _simulate(simulation: Simulation, arguments: argparse.Namespace, **options: Any) -> int:
    from granular.diagnostics import StabilityWarning

    until = simulation.scene.duration if arguments.until is None else arguments.until
    if until <= simulation.time:
        raise ValueError(f"until = {until} must exceed the time of the record, {simulation.time}")
    progress = not arguments.quiet
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", StabilityWarning)  # printed below
            simulation.run(until, every=arguments.every, progress=progress, **options)
    except KeyboardInterrupt:
        message = f"interrupted at t = {simulation.time:.6g} s"
        if simulation.record is not None:
            message += f"; `granular resume {simulation.record}` goes on"
        print(f"granular: {message}", file=sys.stderr)
        return INTERRUPTED
    if not arguments.quiet:
        print(f"{simulation.record}: {simulation}")
    return _judge(simulation.health(), arguments.quiet, arguments.strict)


def _judge(health: Health, quiet: bool, strict: bool) -> int:
    """Print the verdict on a run and what to do about it; return the exit code."""
    verdict, *explained = health.verdict.splitlines()
    if not quiet or not health.ok:
        print(verdict, file=sys.stdout if health.ok else sys.stderr)
    for line in explained:
        print(f"granular: warning: {line}", file=sys.stderr)
    return SUSPECT if strict and not health.ok else 0


def _info(arguments: argparse.Namespace) -> int:
    from granular.record import info, open_trajectory

    found = info(arguments.file)
    provenance = found.pop("provenance")
    damage = found.pop("damage")
    for name, value in found.items():
        if isinstance(value, tuple):
            value = " to ".join(f"{end:g}" for end in value)
        print(f"{name:>16}  {value}")
    for name in ("granular", "start", "threads", "cpu"):
        if name in provenance:
            print(f"{name:>16}  {provenance[name]}")
    with open_trajectory(arguments.file) as record:
        seen = record.health()
        print(seen)
        print(seen.verdict)
    for message in damage:
        print(f"{'damage':>16}  {message}")
    return FAILED if damage else 0


def _plot(arguments: argparse.Namespace) -> int:
    if arguments.output is None and arguments.gif is None:
        raise ValueError("give -o PNG or --gif GIF")
    _check_pictures(arguments.output, arguments.gif, arguments.overwrite)
    _draw(arguments.file, arguments.output, arguments.frame, arguments)
    return 0


def _check_output(name: str, overwrite: bool) -> None:
    """Refuse a file that could not be written, before the work is done."""
    path = Path(name)
    if not path.parent.is_dir():
        raise FileNotFoundError(f"{path.parent} is not a folder")
    if path.exists() and not overwrite:
        raise FileExistsError(f"{path} exists already; --overwrite replaces it")


def _check_pictures(picture: str | None, gif: str | None, overwrite: bool) -> None:
    if picture is not None:
        _check_output(picture, overwrite)
        if Path(picture).suffix.lower() not in PICTURES:
            raise ValueError(f"{picture} must end in one of {', '.join(PICTURES)}")
    if gif is not None:
        from granular.plot import check_movie

        _check_output(gif, overwrite)
        check_movie(gif, overwrite=overwrite)


def _draw(record: str, picture: str | None, frame: int, arguments: argparse.Namespace) -> None:
    """Draw a frame of a record, and its animation if one was asked for."""
    gif, color = arguments.gif, arguments.color
    if picture is None and gif is None:
        return
    from granular import open_trajectory, plot

    with open_trajectory(record) as states:
        try:
            if picture is not None:
                plot.frame(states[frame], color).savefig(picture, dpi=150)
        except IndexError as error:
            raise ValueError(str(error)) from None
        if gif is not None:
            options = {"overwrite": arguments.overwrite, "progress": not arguments.quiet}
            plot.movie(states, gif, color=color, **options)


def _verify(arguments: argparse.Namespace) -> int:
    from granular import verify

    return verify.main(slow=arguments.slow)


def _list(arguments: argparse.Namespace) -> int:
    from granular.scenes import registry

    for name, function in registry.items():
        print(f"{name}: {_summary(function)} [{', '.join(function.methods)}]")
        for keyword, kind, default in _keywords(function):
            print(f"    --{keyword} {METAVARS[kind]}  ({_shown(default, BY_SCENE)})")
        print("  material")
        for keyword, kind, default in _material_keywords(function):
            print(f"    --{keyword} {METAVARS[kind]}  ({_shown(default, UNSET)})")
    return 0

"""Commands and options of the command `granular`."""

from __future__ import annotations

import argparse
import re
from collections.abc import Callable, Iterable, Sequence
from pathlib import Path
from typing import Any, NoReturn

from granular.cli import commands as do
from granular.cli.words import (
    BY_SCENE,
    METAVARS,
    UNSET,
    keywords_of,
    material_keywords,
    names,
    number,
    shown,
    summary,
    whole,
)


class _Parser(argparse.ArgumentParser):
    """Parser whose errors are one line and whose options cannot be abbreviated."""

    def __init__(self, **kwargs: Any) -> None:
        super().__init__(allow_abbrev=False, **kwargs)

    def error(self, message: str) -> NoReturn:
        self.exit(do.REFUSED, f"{self.prog}: error: {' '.join(message.split())}\n")


class _Place(argparse.Action):
    """An option named like a place in the scene, such as --material.mu_s 0.5."""

    def __call__(
        self,
        parser: argparse.ArgumentParser,
        namespace: argparse.Namespace,
        values: Any,
        option_string: str | None = None,
    ) -> None:
        place = str(option_string).removeprefix("--")
        namespace.set = [*namespace.set, f"{place}={values}"]


PLACE = re.compile(r"(--[A-Za-z_]\w*(?:\.\w+)+)(?:=.*)?", re.S)
"""A word that is such an option; the first group is its name."""


def command_parser(words: Sequence[str] = ()) -> argparse.ArgumentParser:
    """Parser of the command.

    A file of a scene among the words is one of its scenes, and places in a scene are options.
    """
    from granular import __version__

    parser = _Parser(prog="granular", description="Dense granular flow as a continuum.")
    parser.add_argument("--version", action="version", version=f"granular {__version__}")
    commands = parser.add_subparsers(required=True, metavar="COMMAND")
    text = "print a file of a scene, with all its numbers, for `granular run`"
    command = commands.add_parser("new", help=text)
    command.add_argument("scene", metavar="SCENE")
    command.set_defaults(command=do.new)
    _add_run(commands, words)
    command = _add_file_command(commands, do.resume, "go on with a record where it stopped")
    _add_run_options(command, "default as before")
    _add_file_command(commands, do.info, "contents of a record, which is verified")
    command = _add_file_command(commands, do.plot, "picture or animation of a record")
    command.add_argument("--frame", type=whole, default=-1, help="default -1, the last one")
    command.add_argument("-o", "--output", metavar="PNG")
    _add_picture_options(command)
    command.add_argument("--quiet", action="store_true", help="no progress bar")
    text = "movie, verdict and scene of a record, in a browser"
    command = _add_file_command(commands, do.show, text, "open")
    command.add_argument("-o", "--output", metavar="HTML", help="write the page, open nothing")
    command.add_argument("--color", default="speed", metavar="F", help="field; default speed")
    command.add_argument("--overwrite", action="store_true", help="an existing file may go")
    text = "numbers in which two records differ; exit code 1 if they do"
    command = commands.add_parser("compare", help=text)
    command.add_argument("first", metavar="FILE")
    command.add_argument("second", metavar="FILE")
    command.set_defaults(command=do.compare)
    text = "check the package against theory; exit code 1 if a check or tolerance is not met"
    command = commands.add_parser("verify", help=text)
    kind = command.add_mutually_exclusive_group()
    kind.add_argument("--slow", action="store_true", help="the long checks too")
    text = "compare with data of other authors instead; all cases, or those named"
    kind.add_argument("--external", nargs="*", metavar="CASE", help=text)
    text = "with --external: coarse runs of seconds, to see that the cases work"
    command.add_argument("--quick", action="store_true", help=text)
    command.set_defaults(command=do.verify)
    command = commands.add_parser("list", help="the scenes and their keywords")
    command.set_defaults(command=do.list_scenes)
    command = commands.add_parser("completion", help="print a script that completes words")
    command.add_argument("shell", choices=("bash", "zsh", "tcsh"))
    command.set_defaults(command=do.completion, parser=parser)
    return parser


def _add_run(commands: Any, words: Sequence[str]) -> None:
    from granular.scenes import registry
    from granular.scenes.files import SUFFIXES, function_of

    text = "simulate a scene, or that of a file (.toml, .json), and record it"
    command = commands.add_parser("run", help=text)
    scenes = command.add_subparsers(required=True, metavar="SCENE|FILE")
    places = dict.fromkeys(found[1] for word in words if (found := PLACE.fullmatch(word)))
    for name in words[1:2]:
        if Path(name).suffix in SUFFIXES:
            scene = scenes.add_parser(name)
            function = function_of(name)
            if function is not None:
                _add_numbers(scene, function, by_file=True)
            _add_recording(scene, places)
            scene.set_defaults(scene=Path(name).stem, file=name)
    for name, function in registry.items():
        scene = scenes.add_parser(name, help=summary(function))
        _add_numbers(scene, function)
        if "mpm" in function.methods:
            choices = ("default", "cell_averaged", "dunatunga_kamrin_2015")
            scene.add_argument("--scheme", choices=choices, help="default that of the scene")
        _add_recording(scene, places)
        scene.set_defaults(scene=name, scheme=None, file=None)


def _add_numbers(scene: Any, function: Callable[..., Any], *, by_file: bool = False) -> None:
    """Add the keywords of a scene function and those of its material."""
    for title, keywords, none in (
        ("keywords of the scene", keywords_of(function), BY_SCENE),
        ("material", material_keywords(function), UNSET),
    ):
        group = scene.add_argument_group(title)
        for name, kind, default in keywords:
            # Each may be spelled with hyphens too.
            spelled = dict.fromkeys((f"--{name}", f"--{name.replace('_', '-')}"))
            text = "default that of the file" if by_file else f"default {shown(default, none)}"
            group.add_argument(
                *spelled, dest=f"scene_{name}", type=kind, metavar=METAVARS[kind], help=text
            )


def _add_recording(scene: Any, places: Iterable[str]) -> None:
    """Add the options of a run of any scene, and these places in it."""
    _add_run_options(scene, "default 1/60")
    text = "HDF5 record; default the name of the scene or file, ending in .vtkhdf as for ParaView"
    scene.add_argument("-o", "--output", metavar="FILE", help=text)
    text = "quantities that frames hold too, as ParaView shows them: pressure,speed,..."
    scene.add_argument("--fields", type=names, metavar="F,F", help=text)
    text = "precision of the numbers in frames; checkpoints are always exact"
    scene.add_argument("--precision", choices=("double", "single"), help=text)
    text = "change a number of the scene; --material.E 1e6 is short for --set material.E=1e6"
    scene.add_argument("--set", action="append", default=[], metavar="PLACE=VALUE", help=text)
    for place in places:
        scene.add_argument(place, action=_Place, metavar="VALUE", help="number of the scene")
    text = "run even if the estimated memory exceeds that of the machine"
    scene.add_argument("--force", action="store_true", help=text)
    scene.add_argument("--picture", metavar="PNG", help="picture of the last state")
    _add_picture_options(scene)
    scene.set_defaults(command=do.run)


def _add_file_command(
    commands: Any, run: Callable[..., int], text: str, name: str | None = None
) -> Any:
    """Add the command of a record, by default with the name of the function that runs it."""
    command = commands.add_parser(name or run.__name__, help=text)
    command.add_argument("file", metavar="FILE")
    command.set_defaults(command=run)
    return command


def _add_run_options(command: Any, every: str) -> None:
    command.add_argument("--until", type=number, metavar="T", help="stop at this time [s]")
    command.add_argument("--threads", type=whole, metavar="N", help="default: as fits")
    command.add_argument("--every", type=number, help=f"time between frames [s]; {every}")
    command.add_argument("--quiet", action="store_true", help="no progress bar")
    text = "exit code 3 if an indicator of failure is suspect at the end"
    command.add_argument("--strict", action="store_true", help=text)


def _add_picture_options(command: Any) -> None:
    command.add_argument("--gif", metavar="GIF", help="animation of all frames")
    text = "field in pictures; default shear_rate"
    command.add_argument("--color", default="shear_rate", metavar="F", help=text)
    command.add_argument("--overwrite", action="store_true", help="existing files may go")

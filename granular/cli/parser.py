"""Commands and options of the command `granular`."""

from __future__ import annotations

import argparse
import os
import re
import sys
from collections.abc import Callable, Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any, NoReturn

from granular.cli import commands as do
from granular.cli.answer import add_answer
from granular.cli.figure import add_figure
from granular.cli.words import (
    BY_SCENE,
    METAVARS,
    UNSET,
    default_text,
    duration,
    keywords_of,
    material_keywords,
    names,
    number,
    summary,
    whole,
)

NEGATIVE_LIST = re.compile(r"-\.?\d[^,]*,.*")
"""A word such as -1,0, which would be taken for an option."""


class _Parser(argparse.ArgumentParser):
    """Parser whose errors are one line and whose options cannot be abbreviated."""

    def __init__(self, **kwargs: Any) -> None:
        super().__init__(allow_abbrev=False, **kwargs)

    def parse_known_args(self, args: Any = None, namespace: Any = None) -> Any:
        """Parse words; a list that begins with a negative number is no option."""
        words: list[str] = []
        for word in sys.argv[1:] if args is None else args:
            takes = words and words[-1].startswith("--") and "=" not in words[-1]
            if takes and NEGATIVE_LIST.fullmatch(word):
                words[-1] += f"={word}"
            else:
                words.append(word)
        return super().parse_known_args(words, namespace)

    def error(self, message: str) -> NoReturn:
        self.exit(do.REFUSED, f"{self.prog}: error: {' '.join(message.split())}\n")


class _Place(argparse.Action):
    """An option named by a path in the scene, such as --material.mu_s 0.5."""

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

    A file of a scene among the words is one of its scenes, and paths in a scene are options.
    """
    from granular import __version__

    parser = _Parser(prog="granular", description="Simulate dense granular flow as a continuum.")
    parser.add_argument("--version", action="version", version=f"granular {__version__}")
    commands = parser.add_subparsers(required=True, metavar="COMMAND")
    text = "print a file of a scene (TOML), with all its numbers, for `granular run`"
    command = _add_command(commands, "new", text)
    command.add_argument("scene", metavar="SCENE", help="name of a scene, see `granular list`")
    command.set_defaults(command=do.new)
    _add_run(commands, words)
    command = _add_file_command(commands, do.resume, "continue a record from where it stopped")
    _add_run_options(command, every="as before")
    text = "verify a record and print its contents; exit code 1 if it is damaged"
    _add_file_command(commands, do.info, text)
    command = _add_file_command(commands, do.plot, "draw a picture or an animation of a record")
    text = "frame of the picture, from 0, or from the end if negative; default -1, the last one"
    command.add_argument("--frame", type=whole, default=-1, metavar="N", help=text)
    text = "picture of a frame (.png, .pdf, .svg)"
    command.add_argument("-o", "--output", metavar="PNG", help=text)
    _add_picture_options(command)
    command.add_argument("--quiet", action="store_true", help="no progress bar")
    text = "show the movie, verdict and scene of a record in a browser"
    command = _add_file_command(commands, do.show, text, "open")
    command.add_argument("-o", "--output", metavar="HTML", help="write the page without opening it")
    text = "field that the movie shows, such as pressure; default speed"
    command.add_argument("--color", default="speed", metavar="F", help=text)
    command.add_argument("--overwrite", action="store_true", help="replace an existing page")
    text = "print the differences between two records; exit code 1 if there are any"
    command = _add_command(commands, "compare", text)
    command.add_argument("first", metavar="FILE", help="record of a run")
    command.add_argument("second", metavar="FILE", help="the other record")
    command.set_defaults(command=do.compare)
    text = "check the package against theory; exit code 1 if a check or tolerance is not met"
    command = _add_command(commands, "verify", text)
    kind = command.add_mutually_exclusive_group()
    kind.add_argument("--slow", action="store_true", help="the long checks too, about an hour")
    text = "compare with data of other authors instead; all cases, or those named"
    kind.add_argument("--external", nargs="*", metavar="CASE", help=text)
    text = "with --external: coarse runs of seconds, to check that the cases work"
    command.add_argument("--quick", action="store_true", help=text)
    command.set_defaults(command=do.verify)
    add_answer(commands, _add_command)
    add_figure(commands, _add_command)
    command = _add_command(commands, "list", "print the scenes, their keywords and defaults")
    command.set_defaults(command=do.list_scenes)
    text = "print a script for a shell to complete the words of this command"
    command = _add_command(commands, "completion", text)
    command.add_argument("shell", choices=("bash", "zsh", "tcsh"), help="shell of the script")
    command.set_defaults(command=do.completion, parser=parser)
    return parser


def _add_run(commands: Any, words: Sequence[str]) -> None:
    from granular.scenes import registry
    from granular.scenes.files import SUFFIXES, function_of

    text = "simulate a scene, given by its name or by a file (.toml, .json), and record it"
    command = _add_command(commands, "run", text)
    scenes = command.add_subparsers(required=True, metavar="SCENE|FILE")
    places = dict.fromkeys(match[1] for word in words if (match := PLACE.fullmatch(word)))
    for name in words[1:2]:
        if Path(name).suffix in SUFFIXES or _is_path(name, registry):
            scene = scenes.add_parser(name)
            function = function_of(name) if Path(name).suffix in SUFFIXES else None
            if function is not None:
                _add_numbers(scene, function, by_file=True)
            _add_recording(scene, places, name, by_file=True)
            scene.set_defaults(scene=Path(name).stem, file=name)
    for name, function in registry.items():
        text = summary(function)
        scene = scenes.add_parser(name, help=text, description=text)
        _add_numbers(scene, function, explained=not words or name in words)
        if "mpm" in function.methods:
            choices = ("default", "cell_averaged", "dunatunga_kamrin_2015")
            scene.add_argument("--scheme", choices=choices, help="default: the scheme of the scene")
        _add_recording(scene, places, name)
        scene.set_defaults(scene=name, scheme=None, file=None)


def _is_path(word: str, names: Iterable[str]) -> bool:
    """True for a word that means a file and no scene, even if there is no such file."""
    if word.startswith("-") or word in names:
        return False
    return bool(Path(word).suffix) or os.sep in word or Path(word).exists()


def _add_numbers(
    scene: Any, function: Callable[..., Any], *, by_file: bool = False, explained: bool = True
) -> None:
    """Add the keywords of a scene function and of its material."""
    from granular.scenes.files import explanations

    of_scene, of_material = explanations(function) if explained else ({}, {})
    for title, keywords, texts, none in (
        ("keywords of the scene", keywords_of(function), of_scene, BY_SCENE),
        ("material", material_keywords(function), of_material, UNSET),
    ):
        group = scene.add_argument_group(title)
        for name, kind, default in keywords:
            # Each may be spelled with hyphens too.
            spelled = dict.fromkeys((f"--{name}", f"--{name.replace('_', '-')}"))
            text = f"{_explained(name, texts)}Default: "
            text += "that of the file" if by_file else default_text(default, none)
            group.add_argument(
                *spelled,
                dest=f"scene_{name}",
                type=kind,
                metavar=METAVARS[kind],
                help=f"{text}.".replace("%", "%%"),
            )


def _explained(name: str, texts: Mapping[str, str]) -> str:
    """Description of a keyword, which begins with the names of all if it is that of several."""
    text = texts.get(name, "")
    if not text:
        return ""
    names = [other for other in texts if texts[other] == text]
    return f"{', '.join(names)}: {text} " if len(names) > 1 else f"{text} "


def _add_recording(scene: Any, places: Iterable[str], name: str, *, by_file: bool = False) -> None:
    """Add the options of a run of a scene or file, and these paths in it."""
    first = "that of the file, else " if by_file else ""
    _add_run_options(scene, first, every="1/60")
    text = "record to write (HDF5), for ParaView ending in .vtkhdf; "
    text += f"default {Path(name).stem}.vtkhdf".replace("%", "%%")
    scene.add_argument("-o", "--output", metavar="FILE", help=text)
    text = "further quantities to store in frames, for ParaView: pressure,speed,..."
    scene.add_argument("--fields", type=names, metavar="F,F", help=text)
    text = "precision of the numbers in frames; checkpoints are always exact; "
    text += f"default {first}double"
    scene.add_argument("--precision", choices=("double", "single"), help=text)
    text = "change a number of the scene; --material.E 1e6 is short for --set material.E=1e6"
    scene.add_argument("--set", action="append", default=[], metavar="KEY=VALUE", help=text)
    for place in places:
        scene.add_argument(place, action=_Place, metavar="VALUE", help="number of the scene")
    text = "run even if the estimated memory exceeds that of the machine"
    scene.add_argument("--force", action="store_true", help=text)
    text = "picture of the last state (.png, .pdf, .svg)"
    scene.add_argument("--picture", metavar="PNG", help=text)
    _add_picture_options(scene)
    scene.set_defaults(command=do.run)


def _add_command(commands: Any, name: str, text: str) -> Any:
    """Add a command, whose own help begins with the same text."""
    return commands.add_parser(name, help=text, description=f"{text[0].upper()}{text[1:]}.")


def _add_file_command(
    commands: Any, run: Callable[..., int], text: str, name: str | None = None
) -> Any:
    """Add the command of a record, by default with the name of the function that runs it."""
    command = _add_command(commands, name or run.__name__, text)
    command.add_argument("file", metavar="FILE", help="record of a run")
    command.set_defaults(command=run)
    return command


def _add_run_options(command: Any, first: str = "", *, every: str) -> None:
    """Add options of a run; their defaults are preceded by what counts first."""
    text = f"time at which the run stops [s]; default {first}the duration of the scene"
    command.add_argument("--until", type=number, metavar="T", help=text)
    text = f"number of threads; default {first}1 for few points, else the number of processors"
    command.add_argument("--threads", type=whole, metavar="N", help=text)
    text = "what makes the steps instead of the processor, with the same bits"
    command.add_argument("--device", choices=("gpu", "emulated"), help=text)
    text = f"time between frames [s]; default {first}{every}"
    command.add_argument("--every", type=number, metavar="T", help=text)
    text = "wall-clock time after which the run ends, such as 3h50m, 45m or 600s, to be resumed"
    command.add_argument("--time-limit", type=duration, metavar="T", help=text)
    text = "no progress bar; print only warnings and a suspect verdict"
    command.add_argument("--quiet", action="store_true", help=text)
    text = "run the code in C of a law of the file; read it before"
    command.add_argument("--trust-code", action="store_true", help=text)
    text = "exit code 3 if an indicator of failure is suspect at the end"
    command.add_argument("--strict", action="store_true", help=text)


def _add_picture_options(command: Any) -> None:
    command.add_argument("--gif", metavar="GIF", help="animation of all frames (.gif, .mp4)")
    text = "field in pictures, such as speed or pressure; default shear_rate"
    command.add_argument("--color", default="shear_rate", metavar="F", help=text)
    command.add_argument("--overwrite", action="store_true", help="replace existing files")

"""Functions of the commands, by their names, and exit codes."""

from __future__ import annotations

import argparse
import sys
import tempfile
import warnings
import webbrowser
from html import escape
from pathlib import Path
from typing import TYPE_CHECKING, Any

from granular.cli.words import (
    BY_SCENE,
    METAVARS,
    UNSET,
    default_text,
    keywords_of,
    material_keywords,
    summary,
)

if TYPE_CHECKING:
    from granular.model.typing import AnyScene
    from granular.run.diagnostics import Health
    from granular.run.simulation import Simulation

FAILED, REFUSED, SUSPECT, UNFINISHED, INTERRUPTED = 1, 2, 3, 4, 130

PICTURES = (".png", ".pdf", ".svg")


def run(arguments: argparse.Namespace) -> int:
    from granular import Simulation, ranks
    from granular.economy import cost
    from granular.materials import trust_code
    from granular.run.diagnostics import StabilityWarning, scene_warnings

    comm = ranks.attended()
    scene = _scene(arguments)
    if arguments.trust_code:
        trust_code(scene)
    if arguments.output is None:
        arguments.output = f"{arguments.scene}.vtkhdf"
    _check_output(arguments.output, arguments.overwrite)
    _check_pictures(arguments.picture, arguments.gif, arguments.overwrite)
    if not arguments.quiet:
        print(f"{scene.name}: {cost(_to_the_end(scene, arguments.until))}")
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", StabilityWarning)  # printed below in one line each
        simulation = Simulation(
            scene,
            threads=arguments.threads,
            device=arguments.device,
            force=arguments.force,
            comm=comm,
        )
    for warning in scene_warnings(scene):
        print(f"granular: warning: {warning}", file=sys.stderr)
    if arguments.picture or arguments.gif:
        from granular.plot.fields import values

        values(simulation.state, arguments.color)  # refuses an unknown field before the run
    options = {"save": arguments.output, "overwrite": arguments.overwrite}
    options |= {"fields": arguments.fields, "precision": arguments.precision}
    code = _simulate(simulation, arguments, **options)
    if code in (0, SUSPECT):
        _draw(arguments.output, arguments.picture, -1, arguments)
    return code


def _to_the_end(scene: AnyScene, until: float | None) -> AnyScene:
    """Scene whose duration is the time at which the run stops."""
    from granular.tools.checks import positive

    return scene if until is None else scene.replace(duration=positive("until", until))


def _scene(arguments: argparse.Namespace) -> AnyScene:
    """Make the scene of a run; the options of a file are added to the arguments."""
    from granular.mpm import schemes
    from granular.scenes import registry
    from granular.scenes.files import changed, read_scene

    given = {
        name.removeprefix("scene_"): value
        for name, value in vars(arguments).items()
        if name.startswith("scene_") and value is not None
    }
    if arguments.file is not None:
        scene_file = read_scene(arguments.file, **given)
        for name, value in scene_file.run.items():
            if getattr(arguments, name) is None:
                setattr(arguments, name, value)
        return changed(scene_file.scene, arguments.set)
    if arguments.scheme is not None:
        given["scheme"] = getattr(schemes, arguments.scheme)
    return changed(registry[arguments.scene](**given), arguments.set)


def new(arguments: argparse.Namespace) -> int:
    from granular.scenes.files import template

    print(template(arguments.scene), end="")
    return 0


def compare(arguments: argparse.Namespace) -> int:
    from granular.run.comparing import compare

    comparison = compare(arguments.first, arguments.second)
    print(comparison)
    return 0 if comparison.same_bits and not comparison.numbers else FAILED


def completion(arguments: argparse.Namespace) -> int:
    try:
        import shtab
    except ImportError:
        raise ValueError(
            "completion needs the package shtab: pip install 'granular-flow[completion]'"
        ) from None
    print(shtab.complete(arguments.parser, arguments.shell))
    return 0


def resume(arguments: argparse.Namespace) -> int:
    from granular import Simulation, ranks

    comm = ranks.attended()
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        simulation = Simulation.resume(
            arguments.file,
            threads=arguments.threads,
            device=arguments.device,
            trust_code=arguments.trust_code,
            comm=comm,
        )
    for warning in caught:
        print(f"granular: warning: {warning.message}", file=sys.stderr)
    return _simulate(simulation, arguments)


def _simulate(simulation: Simulation, arguments: argparse.Namespace, **options: Any) -> int:
    from granular.run.diagnostics import StabilityWarning
    from granular.tools.checks import positive

    until = simulation.scene.duration if arguments.until is None else arguments.until
    until = positive("until", until)
    if until <= simulation.time and arguments.until is None:  # the run has reached its end
        if not arguments.quiet:
            print(f"{simulation.record}: {simulation}, the end of the scene; --until goes on")
        return _judge(simulation.health(), arguments.quiet, arguments.strict)
    if until <= simulation.time:
        raise ValueError(f"until = {until} must exceed the time of the record, {simulation.time}")
    progress = not arguments.quiet
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", StabilityWarning)  # printed below
            options |= {"every": arguments.every, "time_limit": arguments.time_limit}
            simulation.run(until, progress=progress, **options)
    except KeyboardInterrupt:
        return _unfinished(simulation, "interrupted", INTERRUPTED)
    if simulation.time < until:
        return _unfinished(simulation, "time limit reached", UNFINISHED)
    if not arguments.quiet:
        print(f"{simulation.record}: {simulation}")
    return _judge(simulation.health(), arguments.quiet, arguments.strict)


def _unfinished(simulation: Simulation, why: str, code: int) -> int:
    """Print how far a run has come, and how it goes on; return the exit code."""
    message = f"{why} at t = {simulation.time:.6g} s"
    if simulation.record is not None:
        message += f"; `granular resume {simulation.record}` goes on"
    print(f"granular: {message}", file=sys.stderr)
    return code


def _judge(health: Health, quiet: bool, strict: bool) -> int:
    """Print the verdict on a run and what to do about it; return the exit code."""
    verdict, *explained = health.verdict.splitlines()
    if not quiet or not health.ok:
        print(verdict, file=sys.stdout if health.ok else sys.stderr)
    for line in explained:
        print(f"granular: warning: {line}", file=sys.stderr)
    return SUSPECT if strict and not health.ok else 0


def info(arguments: argparse.Namespace) -> int:
    from granular.record import info, open_trajectory

    summary = info(arguments.file)
    provenance = summary.pop("provenance")
    damage = summary.pop("damage")
    for name, value in summary.items():
        if isinstance(value, tuple):
            value = " to ".join(f"{end:g}" for end in value)
        print(f"{name:>16}  {value}")
    for name in ("granular", "start", "threads", "cpu"):
        if name in provenance:
            print(f"{name:>16}  {provenance[name]}")
    with open_trajectory(arguments.file) as record:
        health = record.health()
        print(health)
        print(health.verdict)
    for message in damage:
        print(f"{'damage':>16}  {message}")
    return FAILED if damage else 0


def plot(arguments: argparse.Namespace) -> int:
    if arguments.output is None and arguments.gif is None:
        raise ValueError("give -o PNG or --gif GIF")
    _check_pictures(arguments.output, arguments.gif, arguments.overwrite)
    _draw(arguments.file, arguments.output, arguments.frame, arguments)
    return 0


def show(arguments: argparse.Namespace) -> int:
    """Write a page with the movie of a record, and open it in a browser."""
    from granular import plot
    from granular.record import open_trajectory

    target = arguments.output
    if target is not None:
        _check_output(target, arguments.overwrite)
    with open_trajectory(arguments.file) as record:
        health = record.health()
        parts = [plot.movie(record, color=arguments.color), health.verdict, health, record]
        parts += [record.scene, record.scene.material]
        body = "\n".join(_html(part) for part in parts)
    page = f"<!doctype html><meta charset='utf-8'><title>{escape(arguments.file)}</title>\n{body}\n"
    path = Path(tempfile.mkdtemp(), "record.html") if target is None else Path(target)
    path.write_text(page, encoding="utf-8")
    if target is None:
        print(path)
        webbrowser.open(path.as_uri())
    return 0


def _html(part: Any) -> str:
    """Part of a page, as a notebook shows it."""
    if hasattr(part, "_repr_html_"):
        return str(part._repr_html_())
    return f"<pre>{escape(str(part))}</pre>"


def _check_output(name: str, overwrite: bool) -> None:
    """Refuse a file that could not be written, before the work is done."""
    from granular.tools.files import check_file

    path = Path(name)
    if not path.parent.is_dir():
        raise FileNotFoundError(f"{name}: its folder {path.parent} does not exist")
    if path.exists():
        check_file(path)
        if not overwrite:
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


def verify(arguments: argparse.Namespace) -> int:
    from granular import verify

    if arguments.external is not None:
        from granular.verify import external

        return external.main(arguments.external, quick=arguments.quick)
    if arguments.quick:
        raise ValueError(
            "--quick is for --external only: the checks without --slow are the quick ones"
        )
    return verify.main(slow=arguments.slow)


def list_scenes(arguments: argparse.Namespace) -> int:
    from granular.scenes import registry

    for name, function in registry.items():
        print(f"{name}: {summary(function)} [{', '.join(function.methods)}]")
        for keyword, kind, default in keywords_of(function):
            print(f"    --{keyword} {METAVARS[kind]}  ({default_text(default, BY_SCENE)})")
        print("  material")
        for keyword, kind, default in material_keywords(function):
            print(f"    --{keyword} {METAVARS[kind]}  ({default_text(default, UNSET)})")
    return 0

"""Errors of the command line: one line, exit code 2, nothing written; also failures and Ctrl-C."""

import os
import signal
import subprocess
import sys
import time

import pytest

import granular as gr
from granular import cli
from granular.record.sealed import MAGIC

QUICK = ["--cell", "0.05", "--E", "5e5", "--until", "0.02", "--quiet"]


@pytest.mark.parametrize(
    ("arguments", "named"),
    [
        ([], "COMMAND"),
        (["fly"], "fly"),
        (["run"], "SCENE"),
        (["run", "heap", "-o", "a.h5"], "heap"),
        (["run", "silo", "--scheme.cfk", "1", "-o", "a.h5"], "scheme.cfk: 'cfk' must be one of"),
        (["run", "silo", "--material.mu_s", "steep", "-o", "a.h5"], "mu_s = 'steep'"),
        (["run", "silo", "--material.mu_s"], "expected one argument"),
        (["run", "silo.toml", "--cell", "1"], "--cell"),
        (["run", "silo", "--orifise", "1", "-o", "a.h5"], "--orifise"),
        (["run", "silo", "--orifice", "wide", "-o", "a.h5"], "wide"),
        (["run", "silo", "--orifice", "nan", "-o", "a.h5"], "nan"),
        (["run", "silo", "--orifice", "3", "-o", "a.h5"], "orifice = 3"),
        (["run", "silo", "--points_per_cell", "2.5", "-o", "a.h5"], "2.5"),
        (["run", "silo", "--edge", "sharp", "-o", "a.h5"], "sharp"),
        (["run", "slug", "--center", "1", "-o", "a.h5"], "center"),
        (["run", "clogging_silo", "--half", "maybe", "-o", "a.h5"], "'maybe' is not yes or no"),
        (["run", "clogging_silo", "--opening_over_d", "0", "-o", "a.h5"], "opening_over_d = 0"),
        (["run", "silo", "--E", "-1", "-o", "a.h5"], "E = -1"),
        (["run", "silo", "--nu", "0.7", "-o", "a.h5"], "nu = 0.7 must be in [0.0, 0.5)"),
        (["run", "silo", "--mu_s", "steep", "-o", "a.h5"], "steep"),
        (["run", "silo", "--I0", "0.3", "-o", "a.h5"], "together with I0 or d"),
        (["run", "silo", "--kappa", "1e5", "-o", "a.h5"], "--kappa"),
        (["run", "clogging_silo", "--d", "0.05", "-o", "a.h5"], "d = 0.05 must not be given"),
        (["run", "slump_sph", "--kappa", "0", "-o", "a.h5"], "kappa = 0"),
        (["run", "slump_sph", "--scheme", "default", "-o", "a.h5"], "--scheme"),
        (["run", "silo", "--until", "-1", "-o", "a.h5"], "until = -1"),
        (["run", "silo", "--every", "0", "-o", "a.h5"], "every = 0"),
        (["run", "silo", "--threads", "0", "-o", "a.h5"], "threads = 0"),
        (["run", "silo", "--scheme", "best", "-o", "a.h5"], "best"),
        (["run", "silo", "--fields", "presure", "-o", "a.h5"], "fields: 'presure' must be one of"),
        (["run", "silo", "-o", "missing/a.h5"], "missing"),
        (["run", "silo", "-o", "a.h5", "--gif", "a.avi"], "a.avi"),
        (["run", "silo", "-o", "a.h5", "--picture", "a.txt"], "a.txt"),
        (["run", "silo", "-o", "a.h5", "--picture", "a.png", "--color", "hue"], "hue"),
        (["resume", "missing.h5"], "missing.h5"),
        (["info", "missing.h5"], "missing.h5"),
        (["plot", "missing.h5", "-o", "a.png"], "missing.h5"),
        (["plot", "missing.h5"], "-o PNG"),
    ],
)
def test_refused_in_one_line(arguments, named, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    assert cli.main(arguments) == 2
    said = capsys.readouterr().err
    assert named in said
    assert said.count("\n") == 1
    assert "Traceback" not in said
    assert list(tmp_path.iterdir()) == []


def test_existing_files_are_kept_unless_overwritten(tmp_path, capsys):
    options = {"-o": "a.h5", "--picture": "a.png", "--gif": "a.gif"}
    paths = {option: tmp_path / name for option, name in options.items()}
    words = [word for option, path in paths.items() for word in (option, str(path))]
    arguments = ["run", "column_collapse", *QUICK, *words, "--color", "speed"]
    for path in paths.values():
        path.write_text("precious")
        assert cli.main(arguments) == 2
        assert "exists already; --overwrite" in capsys.readouterr().err
        assert path.read_text() == "precious"
        path.unlink()
    for path in paths.values():
        path.write_text("precious")
    assert cli.main([*arguments, "--overwrite"]) == 0
    starts = {"-o": b"\x89HDF", "--picture": b"\x89PNG", "--gif": b"GIF89a"}
    assert all(paths[name].read_bytes().startswith(start) for name, start in starts.items())


def test_a_foreign_file_and_a_frame_that_is_not_there(tmp_path, capsys):
    path = tmp_path / "text.h5"
    path.write_text("no record")
    for command in (["info"], ["resume"], ["plot", "-o", str(tmp_path / "a.png")]):
        assert cli.main([command[0], str(path), *command[1:]]) == 2
        assert "text.h5" in capsys.readouterr().err
    path = tmp_path / "a.h5"
    assert cli.main(["run", "column_collapse", *QUICK, "-o", str(path)]) == 0
    assert cli.main(["plot", str(path), "--frame", "99", "-o", str(tmp_path / "a.png")]) == 2
    assert "frame 99" in capsys.readouterr().err
    assert not (tmp_path / "a.png").exists()


@pytest.mark.parametrize("error", [gr.SimulationError("point 3 ran away"), OSError(28, "full")])
def test_a_failing_run_exits_with_one(error, tmp_path, monkeypatch, capsys):
    def fail(*_, **__):
        raise error

    monkeypatch.setattr(gr.Simulation, "run", fail)
    assert cli.main(["run", "column_collapse", *QUICK, "-o", str(tmp_path / "a.h5")]) == 1
    said = capsys.readouterr().err
    assert said.startswith("granular: error: ")
    assert said.count("\n") == 1


def frames_in(log):
    return log.read_bytes().count(MAGIC) - 1 if log.exists() else 0


@pytest.mark.usefixtures("ctrl_c")
def test_ctrl_c_leaves_a_record_that_goes_on(tmp_path):
    path = tmp_path / "a.h5"
    long = ["run", "column_collapse", "--cell", "0.02", "--every", "0.01"]
    process = subprocess.Popen(
        [sys.executable, "-m", "granular", *long, "--quiet", "--threads", "1", "-o", str(path)],
        stderr=subprocess.PIPE,
        text=True,
        env=os.environ | {"PYTHONPATH": os.pathsep.join(filter(None, sys.path))},
    )
    log = tmp_path / "a.h5.parts" / "log"
    deadline = time.monotonic() + 20
    while frames_in(log) < 2 and time.monotonic() < deadline:
        time.sleep(0.02)
    process.send_signal(signal.SIGINT)
    said = process.communicate(timeout=20)[1]
    assert process.returncode == 130
    assert "resume" in said
    assert said.count("\n") == 1
    with gr.open(path) as states:
        assert len(states) >= 2
        stopped = states.checkpoint().time
        spacing = states.times[1]
    until = stopped + spacing
    assert cli.main(["resume", str(path), "--until", str(until), "--quiet"]) == 0
    with gr.open(path) as states:
        assert states.times[-1] >= until


@pytest.fixture
def strange_files(tmp_path, monkeypatch):
    """Things that may lie at a path, by the end of its name, in the working folder."""
    monkeypatch.chdir(tmp_path)
    texts = {
        "empty": b"",
        "text": b"hello\n",
        "binary": bytes(range(256)) * 20,
        "latin": 'scene = "column_collapse"\n# caf\u00e9\n'.encode("latin-1"),
        "utf16": 'scene = "column_collapse"\n'.encode("utf-16"),
    }
    for end in ("h5", "toml", "json"):
        (tmp_path / f"folder.{end}").mkdir()
        os.mkfifo(tmp_path / f"pipe.{end}")
        (tmp_path / f"loop.{end}").symlink_to(f"loop.{end}")
        for name, content in texts.items():
            (tmp_path / f"{name}.{end}").write_bytes(content)
    return tmp_path


STRANGE = ("folder", "pipe", "loop", "empty", "text", "binary", "latin", "utf16", "missing")
FEW = ("folder", "pipe", "binary", "missing")
"""Those for commands that read a path as another one does."""


@pytest.mark.parametrize(
    ("words", "end", "names"),
    [
        ("info", "h5", STRANGE),
        ("run", "toml", STRANGE),
        ("run", "json", STRANGE),
        *((w, "h5", FEW) for w in ("run", "resume", "open", "plot -o a.png", "compare text.h5")),
    ],
)
def test_strange_files_are_refused_in_one_line(words, end, names, strange_files, capsys):
    """Every command that takes a path; a pipe would be waited for without end."""
    before, words = sorted(strange_files.iterdir()), words.split()
    wrong = [f"{name}.{end}" for name in names]
    if names is STRANGE:
        wrong += ["text.h5/a.h5", "a" * 300 + f".{end}"]
        wrong += [] if words == ["run"] else [".", "", os.devnull]
    for name in wrong:
        assert cli.main([*words, name]) == 2, name
        said = capsys.readouterr().err
        assert said.count("\n") == 1 and "Traceback" not in said, name
        assert sorted(strange_files.iterdir()) == before


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["info", "."], "path = '.' must be a file, is a folder"),
        (["info", "pipe.h5"], "path = 'pipe.h5' must be a file, is a pipe"),
        (["info", os.devnull], "must be a file, is a device"),
        (["run", "folder.toml"], "path = 'folder.toml' must be a file, is a folder"),
        (["run", "text.h5"], "path = 'text.h5' must end in one of .toml, .json"),
        (["run", "latin.toml"], "in UTF-8, has the byte 0xe9 at byte 31, in line 2"),
        (["run", "latin.json"], "in UTF-8, has the byte 0xe9 at byte 31, in line 2"),
        (["run", "utf16.toml"], "in UTF-8, has the byte 0xff at byte 0, in line 1"),
        (["run", "silo", "-o", "pipe.h5"], "must be a file, is a pipe"),
        (["run", "silo", "-o", "pipe.h5", "--overwrite"], "must be a file, is a pipe"),
        (["run", "silo", "-o", "folder.h5", "--overwrite"], "must be a file, is a folder"),
        (["run", "silo", "--picture", "folder.h5", "--overwrite"], "must be a file, is a folder"),
        (["run", "silo", "--gif", "pipe.h5", "--overwrite"], "must be a file, is a pipe"),
        (["open", "text.h5", "-o", "pipe.h5", "--overwrite"], "must be a file, is a pipe"),
    ],
)
def test_what_lies_at_a_path_is_named(words, message, strange_files, capsys):
    """It is not replaced either: a run as the administrator would have replaced a device."""
    before = [(path, path.lstat().st_mode) for path in sorted(strange_files.iterdir())]
    assert cli.main(words) == 2
    assert message in capsys.readouterr().err
    assert [(path, path.lstat().st_mode) for path in sorted(strange_files.iterdir())] == before
    with pytest.raises(ValueError, match="is a pipe"):
        gr.Simulation(gr.scenes.column_collapse(cell=0.1)).run(0.01, save="pipe.h5", overwrite=True)


def test_a_mark_of_utf_8_is_no_text(tmp_path, capsys):
    """Editors of some systems begin a file with it."""
    path = tmp_path / "a.toml"
    path.write_bytes(b'\xef\xbb\xbfscene = "column_collapse"\n[arguments]\ncell = 0.05\n')
    assert (
        cli.main(["run", str(path), *QUICK[2:4], "--until", "1e-3", "-o", str(path) + ".h5"]) == 0
    )

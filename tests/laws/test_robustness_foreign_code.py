"""Files of others: a law in C that came with one runs nowhere unless the user has allowed it."""

import copy
import json
import pickle
import textwrap
import warnings
from dataclasses import replace

import numpy as np
import pytest

import granular as gr
from granular.cli import main
from granular.materials import from_function, own, trust_code


def source_that_writes(marker):
    """Source of a law that makes a file as soon as it is loaded."""
    return textwrap.dedent(f"""
    int system(const char *);
    __attribute__((constructor)) static void evil(void)
    {{
        if (system("touch '{marker}'")) return;
    }}
    void update(int64_t n, int64_t dim, double dt, const double *parameters, const double *gradient,
                const double *log_density, double *stress, double *shear_rate, double *history)
    {{
        for (int64_t k = 0; k < 2 * dim * n; k++) stress[k] *= 0.999;
    }}
    """)


@pytest.fixture
def foreign(tmp_path, monkeypatch):
    """A scene and a record with such a law, in a process that has not seen it."""
    marker = tmp_path / "written"
    law = from_function(source_that_writes(marker), name="evil", E=1e5)
    scene = gr.scenes.column_collapse(aspect=1.0, cell=0.1, duration=0.01, material=law)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        gr.Simulation(scene, threads=1).run(save=tmp_path / "run.vtkhdf")
    (tmp_path / "scene.json").write_text(scene.to_json())
    assert marker.exists()  # it was given to from_function here
    marker.unlink()
    monkeypatch.setattr(own, "_FUNCTIONS", {})
    monkeypatch.setattr(own, "_TRUSTED", set())
    return tmp_path


def toml_of(folder):
    """The same law as numbers of a material in TOML."""
    path = folder / "scene.toml"
    text = json.dumps(source_that_writes(folder / "written"))
    path.write_text(
        'scene = "column_collapse"\n[arguments]\ncell = 0.1\nduration = 0.01\n[material]\n'
        f'law = "OwnLaw"\nname = "evil"\nlanguage = "c"\nE = 1e5\nsource = {text}\n'
    )
    return path


REFUSED = r"the law 'evil' is C code that came with a file.*__attribute__"


def test_nothing_in_python_runs_it(foreign):
    """Looking, estimates, pictures, checks and copies work without it; simulations name it."""
    marker, path = foreign / "written", foreign / "run.vtkhdf"
    scene = gr.scenes.read_scene(foreign / "scene.json").scene
    assert gr.scenes.read_scene(toml_of(foreign)).scene.material.digest == scene.material.digest
    assert gr.Scene.from_json(scene.to_json()) == scene
    gr.scene_warnings(scene)
    gr.economy.cost(scene)
    gr.economy.suggest(scene)
    scene._repr_html_(), scene.material._repr_html_(), repr(scene), hash(scene)
    copy.copy(scene), copy.deepcopy(scene), pickle.loads(pickle.dumps(scene))
    scene.replace(material=scene.material.replace(E=2e5))
    gr.plot.scene(scene)
    with gr.open(path) as record:
        states = [state.pressure for state in record]
        checkpoint = record.checkpoint()
        assert len(states) == len(record) and not record.damage()
        gr.plot.frame(record[-1])
    for run in (
        lambda: gr.Simulation(scene),
        lambda: gr.Simulation(gr.open(path).scene),
        lambda: gr.Simulation.resume(path),
        lambda: gr.Simulation.resume(path, scene=scene),
        lambda: gr.Simulation.from_checkpoint(scene, checkpoint),
    ):
        with pytest.raises(ValueError, match=f"(?s){REFUSED}"):
            run()
    with pytest.warns(RuntimeWarning, match="C code that came with a file"):
        gr.sweep([scene], workers=1, progress=False)
    assert not marker.exists()


@pytest.mark.parametrize(
    "words",
    [
        ("run", "scene.json", "-o", "new.h5"),
        ("run", "scene.toml", "-o", "new.h5"),
        ("resume", "run.vtkhdf", "--until", "0.02"),
    ],
)
def test_the_command_runs_it_on_request_only(words, foreign, monkeypatch, capsys):
    monkeypatch.chdir(foreign)
    marker = foreign / "written"
    toml_of(foreign)
    assert main([*words, "--quiet", "--threads", "1"]) == 2
    assert "__attribute__" in capsys.readouterr().err
    assert not marker.exists()
    assert main([*words, "--quiet", "--threads", "1", "--trust-code"]) == 0
    assert marker.exists()


def test_the_source_is_shown_as_it_is(monkeypatch, tmp_path, capsys):
    """Escapes for the terminal stand as their codes, lines as lines, and a cut is told."""
    head = "// fine\x1b[2J\r\u202e\nint system(const char *);\n"
    law = own.OwnLaw(name="e\x1bvil", language="c", source=head + "//" + " " * 5000 + "\nevil();")
    scene = gr.scenes.column_collapse(aspect=1.0, cell=0.1, material=law)
    (tmp_path / "long.json").write_text(scene.to_json())
    short = scene.replace(material=replace(law, source=head))
    (tmp_path / "short.json").write_text(short.to_json())
    shown = ["    | // fine\\x1b[2J\\r\\u202e", "    | int system(const char *);"]
    monkeypatch.chdir(tmp_path)
    for name in ("short", "long"):
        assert main(["run", f"{name}.json", "--quiet", "-o", "new.h5"]) == 2
        text = capsys.readouterr().err
        lines = text.splitlines()
        assert lines[0].startswith("granular: error: the law 'e\\x1bvil' is C code that came with")
        assert lines[1:3] == shown and not {"\x1b", "\r", "\u202e"} & {*text}
    size = len(law.source)
    assert f"has {size} characters" in lines[0] and "code_of(scene)" in lines[0]
    assert lines[-1] == f"    | [cut here: {size - own.MOST_SHOWN} characters more are not shown]"
    assert gr.materials.code_of(scene).splitlines()[:3] == [r"law 'e\x1bvil':", *shown]
    assert gr.materials.code_of(scene).endswith("\n    | evil();")
    with pytest.raises(TypeError, match="must be a scene or a material"):
        gr.materials.code_of("run.h5")


@pytest.mark.parametrize(
    "words",
    [
        ("info", "run.vtkhdf"),
        ("plot", "run.vtkhdf", "-o", "p.png"),
        ("open", "run.vtkhdf", "-o", "p.html"),
        ("compare", "run.vtkhdf", "run.vtkhdf"),
    ],
)
def test_commands_that_look_do_not_run_it(words, foreign, monkeypatch):
    monkeypatch.chdir(foreign)
    assert main([*words]) == 0
    assert not (foreign / "written").exists()


def test_trust_goes_to_the_processes_of_a_sweep_and_to_records(foreign):
    scene = gr.scenes.read_scene(foreign / "scene.json").scene
    trust_code(scene)
    assert len(gr.sweep([scene], workers=1, progress=False)[0]) > 0
    assert (foreign / "written").exists()
    sim = gr.Simulation.resume(foreign / "run.vtkhdf", threads=1)
    sim.step(2)
    assert np.isfinite(sim.state.stress).all()


def test_resume_may_trust(foreign):
    sim = gr.Simulation.resume(foreign / "run.vtkhdf", threads=1, trust_code=True)
    assert (foreign / "written").exists() and sim.steps
    with pytest.raises(TypeError, match="trust_code = 'yes' must be"):
        gr.Simulation.resume(foreign / "run.vtkhdf", trust_code="yes")
    with pytest.raises(TypeError, match=r"scene = 'run.vtkhdf' must be a scene or a material"):
        trust_code("run.vtkhdf")

"""The command line: printed output, written files and exit codes."""

import inspect
from dataclasses import fields

import numpy as np
import pytest

import granular as gr
from granular import cli
from granular.run import monitor
from granular.scenes import registry


def collapse(path, *more, until="0.1"):
    """Run a small column collapse from the command line."""
    words = "run column_collapse --aspect 1 --cell 0.05 --points-per-cell 4 --E 1e5 --quiet"
    words += f" --scheme dunatunga_kamrin_2015 --until {until} --every 0.02 --threads 1"
    assert cli.main([*words.split(), "-o", str(path), *more]) == 0


@pytest.fixture(scope="module")
def record(tmp_path_factory):
    path = tmp_path_factory.mktemp("cli") / "run.h5"
    collapse(path)
    return path


def test_run_writes_the_record_of_the_scene_asked_for(record):
    with gr.open(record) as states:
        scene = states.scene
        assert scene.parameters["aspect"] == 1.0
        assert scene.parameters["points_per_cell"] == 4
        assert scene.material.E == 1e5
        assert scene.scheme == gr.schemes.dunatunga_kamrin_2015
        assert len(states) == 6
        expected = [0.0, 0.02, 0.04, 0.06, 0.08, 0.1]
        assert states.times == pytest.approx(expected, abs=3.1e-6)
    # it equals the same run in Python
    scheme = gr.schemes.dunatunga_kamrin_2015
    given = {"aspect": 1.0, "cell": 0.05, "points_per_cell": 4, "E": 1e5, "scheme": scheme}
    scene = gr.scenes.column_collapse(**given)
    simulation = gr.Simulation(scene, threads=1).run(until=0.1)
    with gr.open(record) as states:
        assert (states[-1].x == simulation.state.x).all()


def test_resume_goes_on_bitwise_with_the_same_spacing_or_another(record, tmp_path):
    path = tmp_path / "half.h5"
    collapse(path, until="0.06")
    assert cli.main(["resume", str(path), "--until", "0.08", "--quiet"]) == 0
    assert cli.main(["resume", str(path), "--until", "0.1", "--quiet"]) == 0
    with gr.open(path) as parts, gr.open(record) as whole:
        assert list(parts.times) == list(whole.times)
        assert (parts[-1].x == whole[-1].x).all()
    path = str(tmp_path / "a.h5")
    collapse(path, until="0.02")
    assert cli.main(["resume", path, "--until", "0.05", "--every", "0.01", "--quiet"]) == 0
    with gr.open(path) as states:
        assert states.times == pytest.approx([0.0, 0.02, 0.03, 0.04, 0.05], abs=3.1e-6)


def test_resume_of_a_run_at_its_end_says_so(tmp_path, capsys):
    """A batch script may resume once more; only a time that is asked for has to come."""
    path = str(tmp_path / "a.h5")
    scene = gr.scenes.column_collapse(cell=0.1, E=1e5, points_per_cell=4, duration=0.01)
    gr.Simulation(scene).run(save=path)
    assert cli.main(["resume", path]) == 0
    assert "the end of the scene; --until goes on" in capsys.readouterr().out
    assert cli.main(["resume", path, "--quiet"]) == 0 and not capsys.readouterr().out
    assert cli.main(["resume", path, "--until", "0.005"]) == 2
    assert "must exceed the time of the record" in capsys.readouterr().err
    assert cli.main(["resume", path, "--until", "0.02", "--quiet"]) == 0


def test_info_and_a_picture_of_a_record(record, tmp_path, capsys):
    assert cli.main(["info", str(record)]) == 0
    said = capsys.readouterr().out
    assert "column_collapse" in said and "0 to 0.1" in said
    picture = tmp_path / "first.png"
    assert cli.main(["plot", str(record), "--frame", "0", "-o", str(picture)]) == 0
    assert picture.read_bytes().startswith(b"\x89PNG")


def test_list_names_all_scenes_and_keywords(capsys):
    assert cli.main(["list"]) == 0
    said = capsys.readouterr().out
    for name in registry:
        assert f"\n{name}: " in f"\n{said}"
    assert "section 4.1). [mpm, sph]" in said and "section 5.4.3). [sph]" in said
    assert "--orifice X  (0.1)" in said
    assert "--center X,Y  (0.2,0.25)" in said
    assert "--half" in said and "(yes)" in said
    assert "--material" not in said
    beads = said[said.index("\nsilo: ") : said.index("\nsilo_3d: ")]
    assert beads.index("  material\n") < beads.index("--mu_s X  (0.3819)")
    assert "--elasticity NAME  (hypoelastic)" in beads and "--I0 X  (none)" in beads


@pytest.mark.parametrize("name", registry)
def test_numbers_of_the_material_are_options(name, capsys):
    material = inspect.signature(registry[name]).parameters["material"].default
    assert cli.main(["run", name, "--help"]) == 0
    said = capsys.readouterr().out
    for field in fields(material):
        assert said.count(f"\n  --{field.name} ") == 1  # once, also if it is a keyword of the scene
    assert ("--scheme" in said) == ("mpm" in registry[name].methods)


def test_tuples_words_and_negative_numbers_reach_the_scene(tmp_path):
    out = tmp_path / "slug.h5"
    arguments = ["run", "slug", "--velocity", "2,1", "--cell", "0.05", "--E", "1e5", "--quiet"]
    arguments += ["--mu-s", "0.4", "--elasticity", "hencky", "--I0", "0.3", "--d", "1e-3"]
    assert cli.main([*arguments, "--until", "0.002", "-o", str(out)]) == 0
    with gr.open(out) as states:
        assert states.scene.parameters["velocity"] == (2.0, 1.0)
        assert states[0].v[0].tolist() == [2.0, 1.0]
        numbers = {"E": 1e5, "mu_s": 0.4, "elasticity": "hencky", "I0": 0.3, "d": 1e-3}
        assert states.scene.material == gr.materials.glass_beads.replace(**numbers)
    path = tmp_path / "back.h5"
    words = "run slug --velocity -1.5,-0.5 --cell 0.05 --until 0.001 --every 0.001 --quiet"
    assert cli.main([*words.split(), "-o", str(path)]) == 0
    with gr.open(path) as record:
        assert record[0].v == pytest.approx(np.tile((-1.5, -0.5), (len(record[0].v), 1)))


def test_a_run_ends_with_its_verdict(tmp_path, capsys, monkeypatch):
    """On stdout if it is ok, with a remedy on stderr if it is suspect, then with the exit code 3 if
    that was asked for."""
    words = ["run", "column_collapse", "--cell", "0.05", "--E", "5e5", "--until", "0.3"]
    words += ["--threads", "1", "--overwrite", "-o", str(tmp_path / "a.h5")]
    assert cli.main(words) == 0
    said = capsys.readouterr()
    assert said.out.startswith("column_collapse: ") and " steps: about " in said.out
    assert "\nverdict: ok, " in said.out and "courant = " in said.out
    assert "warning" not in said.err
    assert cli.main([*words, "--quiet"]) == 0
    assert capsys.readouterr() == ("", "")
    monkeypatch.setattr(monitor.Bulk, "disconnected", lambda self, pressed: 0.5)
    picture = tmp_path / "a.png"
    assert cli.main([*words, "--quiet", "--picture", str(picture)]) == 0
    said = capsys.readouterr()
    assert said.out == "" and picture.exists()
    verdict, warning = said.err.splitlines()
    assert verdict.startswith("verdict: suspect, disconnected = 0.5 (limit 0.1)")
    assert warning.startswith("granular: warning: disconnected = 0.5") and "; take " in warning
    assert cli.main(["resume", words[-1], "--until", "0.31", "--quiet", "--strict"]) == 3
    assert cli.main(["info", words[-1]]) == 0


def test_what_is_not_said_is_that_of_the_scene(tmp_path, capsys):
    """Defaults are those of the scene: other numbers of the material, scheme, yes or no."""
    out = tmp_path / "silo.h5"
    words = ["run", "clogging_silo", "--half", "no", "--cell", "0.07", "--width", "0.7"]
    words += ["--height", "0.7", "--E", "2e6", "--quiet", "--until", "2e-4", "-o", str(out)]
    assert cli.main(words) == 0
    with gr.open(out) as states:
        given = {"half": False, "cell": 0.07, "width": 0.7, "height": 0.7, "E": 2e6}
        assert states.scene == gr.scenes.clogging_silo(**given)
    assert cli.main([*words, "--scheme", "default", "--overwrite"]) == 0
    with gr.open(out) as states:
        assert states.scene == gr.scenes.clogging_silo(**given, scheme=gr.schemes.default)
    # in 2D the published scheme gives warnings on stderr, one line each, and the run goes on
    capsys.readouterr()
    options = ["--until", "1e-3", "--quiet", "--cell", "0.05", "-o"]
    words = ["run", "column_collapse", "--E", "5e5", *options, str(tmp_path / "a.h5")]
    assert cli.main([*words, "--scheme", "dunatunga_kamrin_2015"]) == 0
    said = capsys.readouterr().err.splitlines()
    assert len(said) == 1
    assert said[0].startswith("granular: warning: ParticleDensity()")
    assert cli.main([*words, "--overwrite"]) == 0
    assert capsys.readouterr().err == ""


def test_verify_passes_its_exit_code_on_and_help_is_there(monkeypatch, capsys):
    import granular.verify

    seen = []
    monkeypatch.setattr(
        granular.verify, "main", lambda *, slow: seen.append(slow) or 1, raising=False
    )
    assert cli.main(["verify"]) == 1
    assert cli.main(["verify", "--slow"]) == 1
    assert seen == [False, True]
    assert cli.main(["--version"]) == 0
    assert gr.__version__ in capsys.readouterr().out
    assert cli.main(["run", "silo", "--help"]) == 0
    assert "--orifice" in capsys.readouterr().out

"""Scenes as files, and two records beside each other."""

import dataclasses
import json

import numpy as np
import pytest

import granular as gr
from granular import cli, scenes
from granular.run.comparing import compare
from granular.scenes.files import changed, read_scene, template


@pytest.fixture
def file(tmp_path):
    """Function that writes a file of a scene."""

    def write(text, name="scene.toml"):
        path = tmp_path / name
        path.write_text(text)
        return path

    return write


@pytest.mark.parametrize("name", scenes.names())
def test_the_template_of_a_scene_is_that_scene(name, file):
    text = template(name)
    assert read_scene(file(text)).scene == scenes.registry[name]()
    # What is commented out is the default as well, and each number, or a few together, says what it
    # means.
    lines = text.splitlines()
    blocks = [block.splitlines() for block in text.split("\n\n")]
    assert all(block[0].startswith(("# ", "[", "scene = ")) for block in blocks)
    for k, line in enumerate(lines):
        words = line.removeprefix("# ").split(" = ")
        if len(words) == 2 and words[0].isidentifier() and not words[1].endswith("..."):
            lines[k] = line.removeprefix("# ")
            assert words[0] == "scene" or lines[k - 1], line
    assert read_scene(file("\n".join(lines))).scene == scenes.registry[name]()


def test_a_file_changes_what_it_names(file):
    path = file(
        """
        scene = "slug"
        arguments = {center = [0.3, 0.5], radius = 0.1}
        material = {law = "DruckerPrager", E = 1e6, mu = 0.5}
        run = {until = 0.2, threads = 1}
        [scheme]
        cfl = 0.3
        density = {name = "smoothed", relaxation = 0.1}
        fluidity = {substeps = 2}
        """
    )
    found = read_scene(path)
    material = gr.materials.DruckerPrager(E=1e6, mu=0.5)
    scheme = gr.Scheme(
        cfl=0.3, density=gr.SmoothedDensity(relaxation=0.1), fluidity=gr.Fluidity(substeps=2)
    )
    assert found.scene == scenes.slug(
        center=(0.3, 0.5), radius=0.1, material=material, scheme=scheme
    )
    assert found.run == {"until": 0.2, "threads": 1}
    whole = file(found.scene.to_json(), "scene.json")
    assert read_scene(whole).scene == found.scene


@pytest.mark.parametrize(
    ("text", "named"),
    [
        ("", "must name a scene"),
        ('scene = "heap"', "scene = 'heap'"),
        ("scene = [1", "scene.toml"),
        ('scene = "silo"\nduration = 1', "the file has 'duration'"),
        ('scene = "silo"\narguments = 3', "arguments = 3 must be a table"),
        ('scene = "silo"\narguments.orifise = 1', "[arguments] has 'orifise'"),
        ('scene = "silo"\narguments.orifice = "wide"', "orifice = 'wide'"),
        ('scene = "silo"\narguments.orifice = 3', "orifice = 3"),
        ('scene = "silo"\nmaterial.mu = 3', "[material] has 'mu'"),
        ('scene = "silo"\nmaterial.mu_s = -1', "mu_s = -1"),
        ('scene = "silo"\nmaterial.law = "Sand"', "law = 'Sand'"),
        ('scene = "silo"\nmaterial = {law = "Elastic", mu_s = 1}', "[material] has 'mu_s'"),
        ('scene = "silo"\nscheme.order = 2', "[scheme] has 'order'"),
        ('scene = "silo"\nscheme.density.beta = 2', "[scheme.density] has 'beta'"),
        ('scene = "silo"\nscheme.density.name = "mean"', "name = 'mean'"),
        ('scene = "slump_sph"\nscheme.cfl = 0.2', "slump_sph has no scheme"),
        ('scene = "silo"\nrun.stop = 2', "[run] has 'stop'"),
    ],
)
def test_what_is_wrong_in_a_file_is_named(text, named, file):
    with pytest.raises((TypeError, ValueError)) as error:
        read_scene(file(text))
    assert named in str(error.value) and "scene.toml" in str(error.value)


def test_other_files_are_refused_and_completion_knows_scenes(file, capsys):
    with pytest.raises(ValueError, match=r"must end in one of \.toml, \.json"):
        read_scene("scene.yaml")
    with pytest.raises(ValueError, match=r"scene\.json: not the JSON of a scene"):
        read_scene(file("{}", "scene.json"))
    assert cli.main(["completion", "bash"]) == 0
    assert "column_collapse" in capsys.readouterr().out


def test_numbers_anywhere_in_a_scene():
    scene = scenes.rotating_drum()
    found = changed(
        scene,
        ["scheme.cfl=0.3", "bodies.0.friction = 0.4", "bodies.0.rough=true", "duration=1"],
    )
    assert found.scheme.cfl == 0.3 and found.duration == 1.0
    assert found.bodies[0].friction == 0.4 and found.bodies[0].rough
    assert changed(scene, ["walls=[]"]) == scene
    opened = changed(scenes.silo(), ["walls.3.opens_at=inf"]).walls[3]
    assert opened.opens_at == float("inf")
    for wrong, named in (
        ("scheme.cfl", "must be KEY=VALUE"),
        ("scheme.cfk=1", "'cfk' must be one of flip_decay"),
        ("bodies.1.friction=1", "'1' must be a number from 0 to 0"),
        ("duration.x=1", "'x' must be one of nothing"),
        ("scheme.cfl=2", "cfl = 2"),
    ):
        with pytest.raises(ValueError) as error:
            changed(scene, [wrong])
        assert named in str(error.value)


def test_the_command_makes_runs_and_compares(tmp_path, capsys, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert cli.main(["new", "column_collapse"]) == 0
    text = capsys.readouterr().out
    for old, new in (
        ("# cell = ...", "cell = 0.05"),
        ("# until = ...", "until = 0.02"),
        ("# fields = ...", 'fields = ["pressure"]'),
        ("# precision = ...", 'precision = "single"'),
    ):
        assert old in text
        text = text.replace(old, new)
    (tmp_path / "a.toml").write_text(text.replace("E = 1000000000.0", "E = 1e5"))
    run = ["run", "a.toml", "--quiet", "--threads", "1"]
    other = ["--fields", "speed,mu", "--precision", "double"]
    assert cli.main([*run, "-o", "a.h5"]) == 0
    assert cli.main([*run, "-o", "b.h5"]) == 0
    assert cli.main([*run, "-o", "c.h5", "--set", "scheme.cfl=0.25", *other]) == 0
    capsys.readouterr()
    assert cli.main(["compare", "a.h5", "b.h5"]) == 0
    assert "all frames are equal to the last bit" in capsys.readouterr().out
    assert cli.main(["compare", "a.h5", "c.h5"]) == 1
    said = capsys.readouterr().out
    assert "scheme.cfl: 0.5 | 0.25" in said and "kinetic energy [J]" in said
    found = compare("a.h5", "c.h5")
    assert found.numbers == (("scheme.cfl", 0.5, 0.25),) and not found.same_bits
    rows = {name: (a, b) for name, a, b in found.results}
    assert rows["points"][0] == rows["points"][1]
    assert rows["mean pressure [Pa]"][0] == pytest.approx(rows["mean pressure [Pa]"][1], rel=0.3)
    with gr.open("a.h5") as record:
        assert found.time == record.times[-1]
        pressure = record[-1].fields["pressure"]
        assert np.array_equal(pressure, pressure.astype("f4"))
        assert pressure == pytest.approx(record[-1].pressure, rel=1e-5, abs=0.1)
        assert json.loads(record.scene.to_json())["scene"]["material"]["E"] == 1e5
    with gr.open("c.h5") as record:  # the command line goes before the file
        assert {"speed", "mu"} < set(record[-1].fields) and "pressure" not in record[-1].fields
        assert np.array_equal(record[-1].fields["speed"], record[-1].speed)


def test_numbers_of_a_file_are_options(tmp_path, capsys, monkeypatch):
    """Keywords of its scene, numbers of its material and places in the scene, and a usual name."""
    monkeypatch.chdir(tmp_path)
    assert cli.main(["new", "hopper"]) == 0
    (tmp_path / "bin.toml").write_text(capsys.readouterr().out)
    run = ["run", "bin.toml", "--cell", "0.025", "--until", "0.005", "--threads", "1"]
    more = ["--mu-s", "0.4", "--material.nu", ".2", "--scheme.cfl=0.3", "--bodies.0.friction", "0"]
    assert cli.main([*run, *more]) == 0
    assert sorted(path.name for path in tmp_path.iterdir()) == [
        *("bin.toml", "bin.vtkhdf", "bin_bodies.vtkhdf")
    ]
    with gr.open("bin.vtkhdf") as record:
        found = record.scene
        wanted = scenes.hopper(cell=0.025, mu_s=0.4)
        wanted = wanted.replace(
            material=wanted.material.replace(nu=0.2),
            scheme=wanted.scheme.replace(cfl=0.3),
            bodies=(dataclasses.replace(wanted.bodies[0], friction=0.0), *wanted.bodies[1:]),
        )
        assert found.replace(parameters=wanted.parameters) == wanted
        assert found.parameters["cell"] == 0.025
        (tmp_path / "whole.json").write_text(found.to_json())
    steps = int(capsys.readouterr().out.split(" points, ")[1].split(" steps")[0].replace(",", ""))
    assert 20 < steps < 400  # the estimate is for the time that was asked for
    assert cli.main([*run, *more]) == 2
    assert "bin.vtkhdf exists already" in capsys.readouterr().err
    assert cli.main(["run", "whole.json", "--until", "0.005", "--quiet", "--threads", "1"]) == 0
    assert cli.main(["compare", "bin.vtkhdf", "whole.vtkhdf"]) == 0


def test_a_record_as_a_page(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    gr.Simulation(scenes.slug(E=1e5, cell=0.1), threads=1).run(until=0.02, save="slug.h5")
    assert cli.main(["open", "slug.h5", "-o", "slug.html"]) == 0
    page = (tmp_path / "slug.html").read_text()
    assert "base64," in page and "verdict: " in page and "slug" in page
    assert cli.main(["open", "slug.h5", "-o", "slug.html"]) == 2
    opened = []
    monkeypatch.setattr("webbrowser.open", opened.append)
    assert cli.main(["open", "slug.h5"]) == 0
    assert opened[0].startswith("file://") and opened[0].endswith(".html")

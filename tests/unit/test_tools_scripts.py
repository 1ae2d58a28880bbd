"""The scripts of tools in soil and of their pictures run at the smallest size."""

import importlib
import json
from pathlib import Path

import pytest
from PIL import Image

import granular as gr

BENCHMARKS = Path(__file__).parents[2] / "benchmarks"


@pytest.fixture
def runs(monkeypatch, tmp_path):
    """The script with tiny cases of two names, with its results in a separate folder."""
    monkeypatch.syspath_prepend(BENCHMARKS)
    script = importlib.import_module("three_d")
    size = {"cell": 0.05, "length": 0.6, "width": 0.2, "start": 0.2, "headroom": 0.15}
    fast = {"speed": 0.2, "dive_speed": 0.1, "travel": 0.1, "blade": (0.05, 0.1, 0.4)}
    roll = {"length": 0.6, "soil": 0.1, "width": 0.2, "tread": 0.1, "start": 0.2, "duration": 0.4}
    ring = {"inner": 0.05, "outer": 0.1, "height": 0.03, "omega": 1.0, "duration": 0.3}
    cases = {
        "couette_shallow": lambda: gr.scenes.couette(cell=0.01, **ring),
        "excavation_5": lambda: script.excavation(0.05, **size, **fast),
        "excavation_5_whole": lambda: script.excavation(0.05, half=False, **size, **fast),
        "narrow_5": lambda: script.excavation(0.05, **size, **fast),
        "wheel_20": lambda: gr.scenes.wheel(cell=0.05, settle=0.1, ramp=0.05, **roll),
        "excavator": lambda: gr.scenes.excavator(cell=0.05, speed=0.4, duration=0.6, ramp=0.02),
    }
    monkeypatch.setattr(script, "CASES", cases)
    monkeypatch.setattr(script, "RESULTS", tmp_path / "results.json")
    return script


@pytest.mark.slow
def test_runs_and_pictures(runs, monkeypatch, tmp_path, capsys):
    runs.main([*runs.CASES, "--records", str(tmp_path / "records")])
    table = json.loads((tmp_path / "results.json").read_text())
    assert list(table) == list(runs.CASES)
    assert table["excavation_5"]["lateral"] == 0 != table["excavation_5_whole"]["lateral"]
    assert 0 < table["couette_shallow"]["mean_error"] < table["couette_shallow"]["error"] < 0.5
    assert table["narrow_5"]["forward"] > 0 and len(table["narrow_5"]["course"]) == 5
    assert table["wheel_20"]["load"] > 0 and table["wheel_20"]["pull_over_load"] == pytest.approx(
        table["wheel_20"]["drawbar_pull"] / table["wheel_20"]["load"]
    )
    monkeypatch.syspath_prepend(BENCHMARKS / "figures")
    pictures = importlib.import_module("tools_in_soil")
    places = {"results": tmp_path / "results.json", "out": tmp_path / "out"}
    options = [text for name, path in places.items() for text in (f"--{name}", str(path))]
    pictures.main(["--records", str(tmp_path / "records"), *options])
    written = sorted(path.stem for path in (tmp_path / "out").iterdir())
    tools = ("below_wheels", "convergence", "excavation_5", "excavator", "failure", "forces")
    assert written == ["couette_profile", *(f"tools_{name}" for name in (*tools, "wheel"))]
    for path in (tmp_path / "out").iterdir():
        with Image.open(path) as picture:
            assert min(picture.size) > 300


def test_unknown_cases_are_refused(runs, capsys):
    with pytest.raises(SystemExit):
        runs.main(["nonsense"])
    assert "must be among" in capsys.readouterr().err
    runs.main([])
    assert capsys.readouterr().out.split() == list(runs.CASES)


def test_all_cases_are_scenes(monkeypatch):
    """Each case can be built: its sizes fit together."""
    monkeypatch.syspath_prepend(BENCHMARKS)
    scenes = [make() for make in importlib.import_module("three_d").CASES.values()]
    assert all(scene.bodies for scene in scenes)

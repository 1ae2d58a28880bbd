"""Numbers with an error bar: intervals contain what is known, and the command prints them."""

import re

import numpy as np
import pytest
from scenes_by_hand import scene_with

import granular as gr
from granular.cli import main
from granular.economy import answer
from granular.economy.error_bar import Sample, error_bar
from granular.economy.quantities import QUANTITIES

PLAN = [(1.0, 1, 0), (1.5, 1, 0), (2.0, 1, 0), (1.5, 1, 1), (2.0, 1, 1), (1.5, 4, 0)]
"""Cells, softness and seed of the first runs."""


def sample(cell, softness, seed, value):
    return Sample(cell, 1e6 / softness, softness, seed, value, 1.0, "ok")


def samples_of(law):
    return [sample(*run, law(*run)) for run in PLAN]


@pytest.mark.parametrize("power", [0.5, 1.0])
def test_a_law_without_scatter(power):
    """y = 3 + dx/10 + b E^-power: exact in the cells, and in E between both powers."""
    found = error_bar(samples_of(lambda dx, softer, _: 3 + 0.1 * dx + 0.04 * softer**power), 1.0)
    assert found.of_cells == pytest.approx(0.1, rel=1e-9)
    assert found.of_scatter < 1e-9
    assert abs(found.value - 3) <= found.of_stiffness * (1 + 1e-9)
    assert found.of_stiffness == pytest.approx(0.04 * (4**power - 1) * 2 / 3, rel=1e-9)


@pytest.mark.parametrize("order", [0.8, 1.0, 2.0])
@pytest.mark.parametrize("noise", [0.002, 0.02])
def test_intervals_contain_limits(order, noise):
    """Nineteen of twenty of 1000 laws with errors of 5 % in cells, 2 % of E, and scatter."""
    rng = np.random.default_rng(5)
    inside, widths = [], []
    for _ in range(1000):
        a, b = 0.05 * rng.uniform(-1, 1), 0.02 * rng.uniform(-1, 1)
        found = error_bar(
            samples_of(
                lambda dx, softer, _: (
                    1 + a * dx**order + b * np.sqrt(softer) + noise * rng.standard_normal()  # noqa: B023
                )
            ),
            1.0,
        )
        inside.append(abs(found.value - 1) <= found.uncertainty)
        widths.append(found.uncertainty)
    assert np.mean(inside) >= 0.95
    assert np.median(widths) < 0.1 + 7 * noise


def test_seeds_without_effect_are_counted_once():
    found = error_bar(samples_of(lambda dx, softer, _: 1 + 0.1 * dx**2), 1.0)
    twice = error_bar([s for s in samples_of(lambda dx, *_: 1 + 0.1 * dx**2) if not s.seed], 1.0)
    assert found.of_scatter == twice.of_scatter > 0.1


INCLINE = {"angle_deg": 24.0, "height": 0.2, "columns": 4, "E": 1e6, "jitter": 0.1}


def test_a_layer_accelerates_as_in_theory(tmp_path):
    """Mean speed after 1 s, which the equation in one dimension has for rigid grains."""
    scene = gr.scenes.incline(**INCLINE, cell=0.025, duration=1.0)
    rigid = scene.material.replace(E=1e9)
    known = gr.theory.transient(24.0, 0.2, rigid, [1.0], 9.8, 0.1).mean[0]
    found = answer(scene, "mean_speed", folder=tmp_path, progress=False)
    assert found.reached and found.uncertainty <= 0.03 * found.value
    assert found.value == pytest.approx(known, abs=found.uncertainty)
    assert found.suspect == ()
    again = answer(scene, "mean_speed", folder=tmp_path, progress=False)
    assert (again.value, again.uncertainty) == (found.value, found.uncertainty)
    assert again.core_seconds < 0.3 * found.core_seconds  # records are read, not made again
    part = max(tmp_path.iterdir())
    gr.Simulation(gr.open(part).scene, threads=1).run(until=0.1, save=part, overwrite=True)
    damaged = min(tmp_path.iterdir())  # and a record of the first tenth
    damaged.write_bytes(damaged.read_bytes()[:1000])
    assert answer(scene, "mean_speed", folder=tmp_path, progress=False).value == found.value
    assert list(again.to_dataframe().value) == [s.value for s in found.samples]


def of_user(cell=0.025, seed=0):
    scene = gr.scenes.incline(**INCLINE, cell=cell, seed=seed, duration=0.05)
    return scene.replace(name="mine")


def test_a_scene_of_a_user_and_a_budget():
    found = answer(of_user, QUANTITIES["mean_speed"], tolerance=1e-3, budget=1e-3, progress=False)
    assert not found.reached
    assert re.search(r"the next \d runs would take .* and the budget is 0.001 s", found.remark)
    assert found.remark in str(found)
    assert len(found.samples) == 6


def no_number(record):
    return float("nan")


READY = gr.scenes.incline(**INCLINE, cell=0.025, duration=0.01)


@pytest.mark.parametrize(
    ("scene", "measure", "options", "message"),
    [
        (READY.replace(name="mine"), "mean_speed", {}, "give a function that makes it"),
        (lambda cell=0.1: READY, "mean_speed", {}, "must have the keywords cell and seed"),
        (lambda cell=0.1, seed=0: None, "mean_speed", {}, "must be a Scene"),
        (lambda cell=0.1, seed=0: READY, "mean_speed", {}, "has cells of 0.025 m, must have"),
        (READY, "rate", {}, "measure = 'rate' must be one of"),
        (READY, no_number, {}, "returned nan in cells of 0.05 m, must be a finite"),
        (READY, "mean_speed", {"tolerance": 0.0}, "tolerance = 0.0"),
        (READY, "mean_speed", {"order": 9.0}, "order = 9.0"),
        (READY, "mean_speed", {"budget": -1.0}, "budget = -1.0"),
        (3, "mean_speed", {}, "scene = 3 must be a Scene"),
    ],
)
def test_refusals(scene, measure, options, message):
    with pytest.raises((ValueError, TypeError), match=re.escape(message)):
        answer(scene, measure, progress=False, **options)


def test_a_scene_that_fits_no_coarser_cells():
    with pytest.raises(ValueError, match=r"cell = 0\.2 must be one of which .* times fits"):
        answer(gr.scenes.incline(**INCLINE, cell=0.2, duration=0.01), "mean_speed")


def test_the_command(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    numbers = {k: v for k, v in INCLINE.items() if k != "E"} | {"cell": 0.025, "duration": 0.05}
    lines = [f"{name} = {value}" for name, value in numbers.items()]
    text = ['scene = "incline"', "[arguments]", *lines, "[material]", "E = 1e6"]
    (tmp_path / "layer.toml").write_text("\n".join(text))
    (tmp_path / "mine.py").write_text("def speed(record):\n    return record[-1].speed.mean()\n")
    words = ["answer", "layer.toml", "--measure", "mine:speed", "--quiet", "--every", "0.05"]
    assert main([*words, "--tolerance", "1"]) == 0
    printed = capsys.readouterr().out
    assert len(printed.splitlines()) > 7 and "+-" in printed
    assert main([*words, "--tolerance", "0.001", "--budget", "0.01", "--rigid", "no"]) == 4
    assert "tolerance not reached" in capsys.readouterr().out
    assert main(["answer", "layer.toml", "--measure", "mine:nothing"]) == 2
    assert main(["answer", "nosuch", "--measure", "discharge"]) == 2


def test_a_seed_without_effect_is_not_repeated():
    def still(cell=0.025, seed=0):
        return of_user(cell)

    result = answer(still, "mean_speed", tolerance=1e-3, budget=1.0, progress=False)
    assert max(sample.seed for sample in result.samples) <= 1
    assert np.isfinite(result.uncertainty)


def test_a_run_that_is_not_possible_ends_the_search():
    """A time step that is too long for finer cells; what was found is returned."""

    def stepped(cell=0.025, seed=0):
        scene = of_user(cell, seed)
        return scene.replace(scheme=scene.scheme.replace(dt=1.2e-4))

    result = answer(stepped, "mean_speed", tolerance=1e-3, budget=60.0, progress=False)
    assert not result.reached and "a further run failed: ValueError: dt = " in result.remark


def sagging(cell=0.1, seed=0):
    """An elastic bed whose weight is switched on: it settles by its E."""
    return scene_with(
        grid=gr.Grid((0.0, 0.0), cell, (round(0.6 / cell), round(1.2 / cell)), (True, False)),
        fills=(gr.Fill(gr.Box((0.0, 0.0), (0.6, 0.6)), 4, jitter=0.1),),
        walls=(gr.Wall(1, 0.0, kind="free_slip"),),
        material=gr.materials.Elastic(E=1e5, nu=0.3, rho_c=1500.0),
        gravity=gr.Gravity((0.0, 0.5), ((0.0, 0.0), (0.0, -9.8))),
        duration=0.5,
        seed=seed,
    )


def settled(record):
    return float(record[0].x[:, 1].mean() - record[-1].x[:, 1].mean())


def test_the_E_of_a_solid_is_kept():
    """Settlement of the middle of a bed, rho g H^2/(3 M) for the mean of a linear stress."""
    result = answer(sagging, settled, tolerance=0.1, budget=20.0, progress=False)
    M = 1e5 * 0.7 / (1.3 * 0.4)
    assert {sample.E for sample in result.samples} == {1e5} and result.of_stiffness == 0.0
    assert result.value == pytest.approx(1500 * 9.8 * 0.6**2 / (3 * M), rel=0.1)

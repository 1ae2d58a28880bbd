"""The stability map: the script runs, and the committed map agrees with the package."""

from pathlib import Path

import numpy as np
import pytest
from PIL import Image

import granular as gr
from granular.mpm.limits import COURANT_LIMIT, LOCKING

RESULTS = Path(__file__).parents[2] / "benchmarks" / "results" / "stability_map.json"
FAST = ("patch", "arrangement", "courant", "courant_space", "courant_speed", "transfers", "tearing")
"""Maps that take a few seconds together."""


@pytest.fixture
def script(module):
    """The script, as a module."""
    return module("stability_map")


def ends(script, folder, *options):
    out, figures = folder / "map.json", folder / "figures"
    script.main(["--quick", "--out", str(out), "--figures", str(figures), *options])
    for path in figures.iterdir():
        with Image.open(path) as picture:
            assert min(picture.size) > 200
    return script.read(out)


@pytest.mark.slow
def test_a_quick_map_is_written_and_drawn(script, tmp_path):
    maps = ends(script, tmp_path, "--only", *FAST)
    assert len(maps) == 14
    patch = {(c.row, c.column): c for c in maps["patch"].cells}
    assert patch["quadratic", "16, 0.2"].verdict == "stable"
    assert patch["linear", "1, 1"].verdict == "degraded"
    again = ends(script, tmp_path, "--only", "patch")  # the other maps are kept
    assert list(again) == list(maps)


@pytest.mark.parametrize(("dim", "tries"), [(2, 300), (3, 40)])
def test_a_single_point_is_stable_within_the_limits(script, dim, tries):
    """No limit exceeds 2/sqrt(lambda_max) of a single point, nor is it far below."""
    part, rng = script.arrangements, np.random.default_rng(2)
    x = rng.uniform(1.0, 2.0, (tries, 1, dim))
    for basis, shape in (("quadratic", part.spline), ("ugimp", part.averaged_linear(0.25))):
        worst = max(part.largest_eigenvalue(at, shape, 2, 1.0) for at in x)
        assert COURANT_LIMIT[basis][dim] <= 2 / np.sqrt(worst) < 1.2 * COURANT_LIMIT[basis][dim]


def test_points_that_weigh_unlike_are_stable_within_the_limits(script, dim):
    """Worst case of a search: two points in the corner of a cell; single points have weight 1."""
    part, most = script.arrangements, gr.schemes.default.density.weight_correction_limit
    x = np.array([np.full(dim, 1.501), np.full(dim, 1.499)])

    def step(x, u):
        return 2 / np.sqrt(part.largest_eigenvalue(x, part.spline, 2, 1.0, np.array(u)))

    pair, even = step(x, [most, -most]), step(x, [0.0, 0.0])
    assert COURANT_LIMIT["quadratic"][dim] < pair < 0.97 * even
    assert step(x[:1], [most]) == pytest.approx(step(x[:1], [0.0]), rel=1e-12)


@pytest.mark.slow
def test_every_quick_map_is_written(script, tmp_path):
    drawn = {name for members in script.draw.FIGURES.values() for name in members}
    assert set(ends(script, tmp_path)) == drawn


def test_the_committed_map_is_whole_and_within_the_limits(script):
    maps = script.read(RESULTS)
    assert set(maps) == {name for members in script.draw.FIGURES.values() for name in members}
    for found in maps.values():
        for cell in found.cells:
            assert cell.verdict in ("refused", found.verdict(cell.value)), (found.name, cell)
    # the analysis bounds the limits in every dimension, with one exception
    for cell in script.read(RESULTS)["arrangement"].cells:
        dim = max(int(cell.column[0]), 2)
        basis = cell.row.partition(",")[0]
        if basis != "linear":
            assert cell.value >= COURANT_LIMIT[basis][dim]


def test_what_the_map_shows_as_failing_is_refused(script):
    """No accepted time step gains energy on the map, except with linear shape functions."""
    maps = script.read(RESULTS)
    seen = 0
    for name, found in maps.items():
        if not name.startswith("courant_") or "published" in name or "cell_averaged" in name:
            continue
        dim = 3 if name == "courant_space" else 2
        for cell in found.cells:
            basis = "ugimp" if "ugimp" in f"{name} {cell.row}".lower() else "quadratic"
            courant = float(cell.column)
            assert (cell.verdict == "refused") == (courant > COURANT_LIMIT[basis][dim])
            assert cell.verdict != "degraded", (name, cell)
            seen += cell.verdict == "refused"
    assert seen > 30


def test_locking_begins_at_the_limits(script):
    """Stable up to the limit of the basis; beyond it linear shape functions lock."""
    for cell in script.read(RESULTS)["locking"].cells:
        shape = script.elastic.SCHEMES[cell.row].basis
        if float(cell.column) <= LOCKING[shape]:
            assert cell.verdict == "stable"
        # one stress per cell does not lock
        elif shape != "quadratic" and cell.row != "cell_averaged":
            assert cell.verdict == "degraded"


def test_what_the_page_says_of_refinement_is_on_the_map(script):
    """Errors fall with the cell, but for several columns near the angle of repose, and those of
    several columns are those of one."""
    cells = script.read(RESULTS)["incline_refinement"].cells
    values = {(cell.row, cell.column): cell.value for cell in cells}
    for angle in {column for _, column in values}:
        one = [values[row, angle] for row in ("1, 10", "1, 20", "1, 40")]
        many = [values[row, angle] for row in ("4, 10", "8, 20", "16, 40")]
        assert one == sorted(one, reverse=True)
        assert all(m < 1.1 * o < 0.055 for m, o in zip(many, one, strict=True))
        assert (many == sorted(many, reverse=True)) != angle.startswith("22")

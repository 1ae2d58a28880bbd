"""The lessons run unchanged, assert numbers, and are stored with the outputs that they have."""

import re

import pytest

pytest.importorskip("nbclient", reason="needs the extra: notebook")
pytest.importorskip("ipykernel", reason="needs the extra: notebook")

import nbformat
from run_notebooks import FOLDER, LESSONS, execute

# Warnings of the notebook machinery are not checked; the kernel is a separate process.
pytestmark = pytest.mark.filterwarnings("default")

QUICK = {"05_materials", "06_cost_and_error"}
"""Lessons of two seconds."""
LARGEST = 400_000
"""Size of a stored lesson [bytes]."""


def read(path):
    notebook = nbformat.read(path, as_version=4)
    nbformat.validate(notebook)
    return notebook


def code(notebook):
    return [cell for cell in notebook.cells if cell.cell_type == "code"]


def told(notebook):
    """Words that a notebook prints, but not numbers, whose last digits may differ, and costs."""
    text = "".join(out.get("text", "") for cell in code(notebook) for out in cell.outputs)
    text = re.sub(r"^.* on one core.*$", "", text, flags=re.M)  # as fast as the machine is
    return re.sub(r"[-+]?\d[\d.,]*(e[-+]?\d+)?", "#", text).split()


def pictures(notebook):
    return sum(
        "image/png" in out.get("data", {}) for cell in code(notebook) for out in cell.outputs
    )


def test_lessons_are_numbered_from_one():
    assert [int(path.name[:2]) for path in LESSONS] == list(range(1, len(LESSONS) + 1))
    assert sorted(FOLDER.glob("*.ipynb")) == LESSONS
    assert {path.stem for path in LESSONS} > QUICK
    gallery = (FOLDER.parent / "docs/lessons/index.md").read_text()
    for path in LESSONS:
        assert f":link: {path.stem}\n" in gallery and f"\n{path.stem}\n" in gallery


@pytest.mark.parametrize("path", LESSONS, ids=lambda path: path.stem)
def test_lesson_is_complete(path):
    """It has a title, text, exercises with hints, a check, and the outputs of one run in order."""
    notebook = read(path)
    text = [cell.source for cell in notebook.cells if cell.cell_type == "markdown"]
    assert text[0].startswith("# ") and len(text[0]) > 300
    assert "## Exercises" in text[-1] and text[-1].count("\n2. ") == 2  # the second has a hint
    assert "<details><summary>Hints</summary>" in text[-1]
    cells = code(notebook)
    assert "assert " in cells[-1].source
    assert [cell.execution_count for cell in cells] == list(range(1, len(cells) + 1))
    assert pictures(notebook) >= 2
    assert [cell.metadata.get("tags") for cell in cells].count(["thumbnail"]) == 1
    kinds = {out.get("name", out.output_type) for cell in cells for out in cell.outputs}
    assert kinds <= {"stdout", "execute_result", "display_data"}
    assert path.stat().st_size < LARGEST


def run_together(paths):
    """Notebooks that were run one after the other by one kernel, with names of their own each."""
    notebooks, whole = [read(path) for path in paths], nbformat.v4.new_notebook()
    for notebook in notebooks:
        for cell in code(notebook):
            cell.outputs = []
        whole.cells += [*notebook.cells, nbformat.v4.new_code_cell("%reset -f")]
    execute(whole)
    return dict(zip(paths, notebooks, strict=True))


@pytest.fixture(scope="module")
def quick():
    """The quick lessons, run by one kernel, as it takes longer to start than some of them."""
    return run_together([path for path in LESSONS if path.stem in QUICK])


def check_run(path, fresh):
    stored = read(path)
    left_out = "are left out" in " ".join(told(fresh))  # parts that need an extra
    assert left_out or told(fresh) == told(stored)
    assert left_out or pictures(fresh) == pictures(stored)


@pytest.mark.parametrize(
    "path", [p for p in LESSONS if p.stem in QUICK], ids=lambda path: path.stem
)
def test_quick_lesson_runs_and_tells_what_is_stored(path, quick):
    check_run(path, quick[path])


@pytest.mark.slow
@pytest.mark.parametrize(
    "path", [p for p in LESSONS if p.stem not in QUICK], ids=lambda path: path.stem
)
def test_long_lesson_runs_and_tells_what_is_stored(path):
    check_run(path, run_together([path])[path])

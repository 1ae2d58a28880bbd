"""The pages: every public name is in the reference, code of tutorials and guides runs."""

import ast
import importlib
import inspect
import math
import re
import shlex
import subprocess
import sys
import types
import warnings
from pathlib import Path

import matplotlib
import numpy as np
import pytest
from matplotlib.colors import to_rgb
from paraview_reader import as_array, paraview
from PIL import Image

import granular as gr
from granular.cli import command_parser
from granular.plot.bodies import STYLE

DOCS = Path(__file__).parents[2] / "docs"
GUIDES = sorted([*DOCS.glob("tutorials/*.md"), *DOCS.glob("how-to/*.md"), DOCS / "index.md"])
PROSE = [*GUIDES, *DOCS.glob("reference/*.md"), *DOCS.glob("explanation/*.md")]

# ---- the reference ----

MODULES = (
    *("granular", "granular.materials", "granular.schemes", "granular.bodies", "granular.scaling"),
    *("granular.scenes", "granular.measure", "granular.papers.silo_clogging"),
    *("granular.measure.soil_tools", "granular.theory", "granular.theory.layer_waves"),
    *("granular.theory.well_posed", "granular.plot"),
    *("granular.papers", "granular.economy", "granular.sph"),
    *("granular.verify", "granular.record", "granular.run.diagnostics", "granular.run.sweeping"),
    *("granular.run.comparing", "granular.run.stop"),
    *("granular.grain_scale.dem", "granular.grain_scale.friction_law"),
    "granular.grain_scale.inference",
)


def module_of(name):
    """A public module; some stand at the top of the package under a shorter name."""
    try:
        return importlib.import_module(name)
    except ModuleNotFoundError:
        return getattr(gr, name.rpartition(".")[2])


def own_names(module):
    """Names that a module without `__all__` defines, or, of a package, offers."""
    if Path(module.__file__).stem == "__init__":
        return [name for name in vars(module) if not name.startswith("_")]
    found = []
    for statement in ast.parse(inspect.getsource(module)).body:
        targets = getattr(statement, "targets", [getattr(statement, "target", statement)])
        found += [getattr(target, "id", getattr(target, "name", "_")) for target in targets]
    return [name for name in found if not name.startswith("_") and name != "Array"]


def public_objects():
    """Public objects by their names; modules are in the reference by what they hold."""
    for prefix in MODULES:
        module = module_of(prefix)
        for name in getattr(module, "__all__", None) or own_names(module):
            value = getattr(module, name)
            if not isinstance(value, types.ModuleType):
                yield f"{prefix}.{name}", value


def listed_names():
    """Names that the pages of the API list, in autosummary tables or as data."""
    for page in DOCS.glob("reference/api/*.md"):
        text = page.read_text()
        yield from re.findall(r"^\.\. autodata:: (\S+)$", text, re.M)
        for module, table in re.findall(
            r"currentmodule:: (\S+)\n\n\.\. autosummary::\n(.*?)```", text, re.S
        ):
            yield from (f"{module}.{name}" for name in re.findall(r"^   (\w+)$", table, re.M))


def test_every_public_name_is_in_the_reference():
    listed = list(listed_names())
    assert len(listed) == len(set(listed)) > 300
    objects = {}
    for name in listed:
        prefix, _, last = name.rpartition(".")
        objects[id(getattr(module_of(prefix), last))] = name
    missing = [name for name, value in public_objects() if id(value) not in objects]
    assert not missing


# ---- code ----

CODE = re.compile(r"^(<!-- not run: .* -->\n)?```python\n(.*?)^```$", re.M | re.S)


def blocks(page):
    return [code for left_out, code in CODE.findall(page.read_text()) if not left_out]


@pytest.fixture
def run_page(tmp_path, monkeypatch):
    """Function that runs the blocks of a page like a script and returns its names.

    The folder is the same for all pages of a test. Each page must import what it uses.
    """
    monkeypatch.chdir(tmp_path)

    def run(page):
        code, names = "\n".join(blocks(page)), {"__name__": "__main__"}
        script = tmp_path / "script.py"
        script.write_text(code)  # laws of one's own read it
        if "__main__" in code:  # processes import it as a script
            command = [sys.executable, "-W", "error", str(script)]
            done = subprocess.run(command, capture_output=True, text=True, timeout=300)
            assert done.returncode == 0, done.stderr
            return names
        matplotlib.use("Agg")
        warnings.simplefilter("error")  # those of stability, too; pytest restores the filters
        exec(compile(code, str(script), "exec"), names)
        return names

    with matplotlib.rc_context():  # a page may choose a style
        yield run


FIRST_HOUR = (
    *("index", "tutorials/install", "tutorials/first_collapse", "tutorials/own_scene"),
    *("how-to/hopper", "how-to/pictures_and_paraview"),
)
"""Pages in the order of someone who begins and wants to empty a hopper."""


SLOW = (
    *("how-to/own_law", "tutorials/a_sweep", "how-to/sweep_on_a_cluster"),
    *("how-to/calibrate_friction", "how-to/error_bar"),
)
"""Pages whose code takes long: numba compiles a law, processes of sweeps have to start, and answers
take many runs."""


def coupled(names):
    """Both programs move the wheel alike, and the sand carries the vehicle, 80 kg."""
    assert np.abs(np.subtract(names["heights"], names["heights_mujoco"])).max() < 1e-3
    for forces in (names["forces"], names["forces_mujoco"]):
        assert np.mean(forces[len(forces) // 2 :], axis=0)[1] == pytest.approx(784.0, rel=0.05)


def pressed(names):
    """Janssen's pressure on the bin at rest, and friction that is mobilised in flow."""
    deep = names["depth"] > 0.1
    assert names["rest"].normal[deep] == pytest.approx(names["janssen"][deep], rel=0.1)
    assert names["flow"].friction[deep] == pytest.approx(np.full(deep.sum(), 0.3), abs=0.01)


def pushed(names):
    """The wall of Rankine, and the footings of Prandtl and of the tables."""
    active = gr.theory.earth_pressure(0.5).active_coaxial
    assert -names["force"][-1] / names["unit"] == pytest.approx(active, rel=0.1)
    assert names["pressure"][-1] / 2e4 == pytest.approx(2 + math.pi, rel=0.12)
    assert names["known"].cohesion == pytest.approx(30.1, abs=0.1)


KNOWN = {
    "how-to/couple_with_another_program": coupled,
    "how-to/wall_pressure": pressed,
    "how-to/walls_and_footings": pushed,
    # Griffiths & Lane 1999, example 1, in cells of a tenth of the height
    "how-to/slope_stability": lambda names: names["safety"].value == pytest.approx(1.4, rel=0.08),
    # friction of 0.5 under 300 N
    "how-to/tools_in_soil": lambda names: 0.0 < names["pull"] < 150.0 and names["efficiency"] < 1.0,
    "how-to/arching": lambda names: gr.measure.speed_percentile(names["arch"].state) < 0.01,
    # a hub of 0.2 x 0.2 x 0.1 m and what of the lug is outside of it
    "how-to/meshes": lambda names: names["whole"].mass == pytest.approx(7800 * 0.00416, rel=0.01),
}
"""Jobs of engineers, and what is known of the results that their pages print."""


@pytest.mark.parametrize(
    "name",
    [
        pytest.param(name, marks=pytest.mark.slow if name in SLOW else ())
        for name, page in ((str(p.relative_to(DOCS).with_suffix("")), p) for p in GUIDES)
        if blocks(page) and name not in FIRST_HOUR
    ],
)
def test_code_of_guides_runs(name, run_page):
    """The blocks of a page run one after the other, issue no warning, and meet what is known."""
    names = run_page(DOCS / f"{name}.md")
    assert KNOWN.get(name, lambda _: True)(names) in (True, None)


def test_a_first_hour(run_page, tmp_path):
    """Code of the first pages, in one folder, makes a hopper that can be watched and measured."""
    names = {page: run_page(DOCS / f"{page}.md") for page in FIRST_HOUR}
    hopper = names["how-to/hopper"]
    (x0, y0), _, _, (x1, y1) = hopper["scene"].bodies[0].shape.profile
    assert math.degrees(math.atan2(x1 - x0, y1 - y0)) == pytest.approx(30.0)

    history, discharge = hopper["history"], hopper["rate"]
    flowing = (history.mass < 330.0) & (history.mass > 220.0)
    slope = np.polyfit(history.times[flowing], history.mass[flowing], 1)[0]
    assert discharge.rate == pytest.approx(-slope, rel=0.02)
    assert discharge.rate == pytest.approx(
        gr.theory.beverloo_rate(0.16, 1500.0, gravity=9.8), rel=0.15
    )

    without = hopper["scene"].replace(bodies=())
    bare = [
        gr.State(scene=without, time=s.time, step=s.step, dt=s.dt, fields=s.fields)
        for s in (hopper["record"][0], hopper["record"][-1])
    ]
    gr.plot.movie(bare, "bare.gif", color="speed", dpi=60)
    assert share_of_bodies("hopper.gif") > 0.07
    assert share_of_bodies("bare.gif") < 1e-3

    seen = list(paraview(tmp_path / "hopper.vtkhdf"))
    assert [time for time, _ in seen] == list(history.times)
    points, last = seen[-1][1].GetPointData(), hopper["record"][-1]
    assert np.array_equal(as_array(points.GetArray("pressure")), last.pressure)
    assert np.array_equal(as_array(points.GetArray("speed")), last.speed)
    _, walls = next(paraview(tmp_path / "intruder_bodies.vtkhdf"))
    assert walls.GetNumberOfPolys() > 0
    header = (tmp_path / "last.csv").read_text().partition("\n")[0].split(",")
    assert {"id", "x", "y", "v_x", "pressure", "speed"} <= set(header)


def share_of_bodies(movie):
    """Share of the pixels of the last frame of a GIF that have the colour of bodies."""
    with Image.open(movie) as picture:
        picture.seek(picture.n_frames - 1)
        pixels = np.asarray(picture.convert("RGB"), float)
    colour = 255 * np.array(to_rgb(STYLE["facecolor"]))
    return (np.abs(pixels - colour).max(axis=2) < 8).mean()


SHELL = re.compile(r"^```sh\n(.*?)^```$", re.M | re.S)
README = DOCS.parent / "README.md"


def test_commands_of_the_pages_are_understood(tmp_path, monkeypatch):
    """Each line of a page that calls `granular` has a command and options that exist."""
    monkeypatch.chdir(tmp_path)  # with the file that a page has made before it is run
    Path("hopper.toml").write_text(gr.scenes.template("hopper"))
    lines = [
        line.partition("granular ")[2].partition(">")[0]
        for page in (README, *PROSE)
        for line in "\n".join(SHELL.findall(page.read_text())).replace("&&", "\n").splitlines()
        if re.match(r"\s*(\S*/)?granular ", line)
    ]
    assert len(lines) >= 10
    for line in lines:
        words = shlex.split(line)
        assert command_parser(words).parse_args(words).command, line


# ---- links and pictures ----

LINK = re.compile(r"\]\(([^)\s#]+)(?:#[^)]*)?\)")
SITE = re.compile(r"[a-z]+:")


def test_no_line_begins_with_a_percent_sign():
    """To MyST it is a comment: what follows on the line is lost from the page in silence."""
    lines = [
        f"{page}:{number}"
        for page in DOCS.rglob("*.md")
        for number, line in enumerate(page.read_text(encoding="utf-8").splitlines(), 1)
        if re.match(r"\s*%", line)
    ]
    assert not lines


def test_links_within_the_repository_lead_somewhere():
    """Files and pictures that the pages and the README link to exist; Sphinx checks the anchors."""
    pages = [README, DOCS.parent / "CHANGELOG.md", *DOCS.rglob("*.md")]
    links = [
        (page, target)
        for page in pages
        for target in LINK.findall(re.sub(r"^```.*?^```$", "", page.read_text(), flags=re.M | re.S))
        if not SITE.match(target)
    ]
    assert len(links) > 200
    notebooks = DOCS.parent / "notebooks"  # the build copies them to docs/lessons
    dead = [
        f"{page.relative_to(DOCS.parent)}: {target}"
        for page, target in links
        if not (page.parent / target).exists() and not (notebooks / Path(target).name).exists()
    ]
    assert not dead


def test_every_guide_has_a_picture_and_every_picture_a_page():
    shown = {
        page: set(re.findall(r"pictures/([\w.]+)", page.read_text()))
        for page in [README, *DOCS.rglob("*.md")]
    }
    guides = set(DOCS.glob("how-to/*.md")) - {DOCS / "how-to" / "index.md"}
    bare = {page.stem for page in guides if not shown[page]}
    assert bare == {"forces_between_grains"}  # its lesson has them
    assert set().union(*shown.values()) == {path.name for path in DOCS.glob("pictures/*")}


# ---- prose ----

NUMBER = re.compile(r"(?<![\w.])-?\d+(?:[.,]\d+)*(?:e-?\d+)?")


def paragraphs(page):
    """Paragraphs and items of lists, without code, formulas, tables and targets of links."""
    text = re.sub(r"^```.*?^```$", "\n", page.read_text(), flags=re.M | re.S)
    text = re.sub(r"\$\$.*?\$\$", "", text, flags=re.S)
    text = re.sub(r"\$[^$]*\$|`[^`]*`|\]\([^)]*\)", "", text)
    for block in re.split(r"\n\s*\n|\n(?=\s*(?:- |\d+\. ))", text):
        if not block.lstrip().startswith(("|", "!", "#")):
            yield " ".join(block.split())


def test_paragraphs_outside_reports_have_few_numbers():
    full = {
        f"{page.relative_to(DOCS)}: {paragraph[:60]}": len(NUMBER.findall(paragraph))
        for page in PROSE
        for paragraph in paragraphs(page)
        if len(NUMBER.findall(paragraph)) > 12
    }
    assert not full

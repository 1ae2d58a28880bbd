"""Identity of laws of the user's own: all that they read is a part of them, or refused."""

import importlib
import importlib.util
import itertools
import re
import sys
import textwrap
import types
from dataclasses import replace

import numpy as np
import pytest
from refusals import refused

import granular as gr
from granular.materials import from_function, law_functions

HEAD = "def law(dt, parameters, gradient, log_density, stress, shear_rate, history):\n"
count = itertools.count()


@pytest.fixture
def made(tmp_path, monkeypatch):
    """A law of a module of its own, from text before it and its body."""
    monkeypatch.syspath_prepend(tmp_path)

    def make(before, body="stress *= GIVEN", **more):
        name = f"law_of_test_{next(count)}"
        text = textwrap.dedent(before) + "\n" + HEAD + textwrap.indent(body, "    ") + "\n"
        (tmp_path / f"{name}.py").write_text(text)
        importlib.invalidate_caches()
        module = importlib.import_module(name)
        monkeypatch.delitem(sys.modules, name)
        return from_function(module.law, **more)

    return make


def stress_of(law):
    """Stress that a law leaves in points at rest with a trial stress."""
    scene = gr.scenes.column_collapse(aspect=1.0, cell=0.1, material=law)
    sim = gr.Simulation(scene, threads=1)
    sim.step(3)
    return sim.state.stress


ARRAY = "import numpy as np\nGIVEN = np.full(600, {})"


@pytest.mark.parametrize(
    "before, body",
    [
        ("GIVEN = {}", "stress *= GIVEN"),
        ("GIVEN = ({}, 1)", "stress *= GIVEN[0]"),
        ("GIVEN = [{}]", "stress *= GIVEN[0]"),
        ("GIVEN = dict(a={})", 'stress *= GIVEN["a"]'),
        ("GIVEN = dict(a=[(1, {})])", 'stress *= GIVEN["a"][0][1]'),
        ("GIVEN = slice(int(4 * {}))", "stress[GIVEN] = 0"),
        (ARRAY, "stress *= GIVEN[599]"),
        ("import numpy as np\nGIVEN = np.float32({})", "stress *= GIVEN"),
        ("def given():\n    return {}", "stress *= given()"),
        ("A = {}\ndef f():\n    return A\ndef given():\n    return f()", "stress *= given()"),
        ("given = lambda x: x * {}", "stress[:] = given(stress)"),
        ("A = {}", "stress *= sum([A for _ in range(1)])"),
        ("A = {}", "inner = lambda: A\nstress *= inner()"),
    ],
)
def test_what_a_law_reads_is_a_part_of_it(before, body, made):
    """Two laws of one text and other values are two, and each has the results of its own."""
    laws = [made(before.format(value), body) for value in (0.5, 0.25)]
    assert laws[0].digest != laws[1].digest
    assert made(before.format(0.5), body).digest == laws[0].digest
    assert not np.array_equal(*map(stress_of, laws))


def test_numba_has_the_same_rules(made):
    """Values, helpers and their options are parts of the law."""
    pytest.importorskip("numba")
    before = "import numba\nA = {}\n@numba.njit({})\ndef given():\n    return A[0]"

    def law(value, options):
        return made(before.format(value, options), "stress *= given()", compiler="numba")

    laws = [law("(0.5, 1)", ""), law("(0.25, 1)", ""), law("(0.5, 1)", "fastmath=True")]
    assert len({law.digest for law in laws}) == 3
    assert not np.array_equal(*map(stress_of, laws[:2]))
    refused(
        ("parallel=True: the core has threads", lambda: law("(0.5, 1)", "parallel=True")),
        ("must not be compiled for given types", lambda: law("(0.5, 1)", "'f8()'")),
    )


def test_a_law_is_a_copy_that_nothing_changes(tmp_path, monkeypatch):
    monkeypatch.syspath_prepend(tmp_path)
    (tmp_path / "changing_law.py").write_text(
        f"import numpy as np\nA, B, C = [0.5], np.array([0.5]), 0.5\n"
        f"def f():\n    return C\n{HEAD}    stress *= A[0] * B[0] * f()\n"
    )
    module = importlib.import_module("changing_law")
    monkeypatch.delitem(sys.modules, "changing_law")
    law = from_function(module.law)
    before = stress_of(law)
    module.A[0], module.B[0], module.C = 1.0, 1.0, 1.0
    assert np.array_equal(stress_of(law), before)
    assert from_function(module.law).digest != law.digest


def test_the_source_can_be_read(made):
    before = """
        import math
        import numpy as np
        TABLE = np.arange(3.0)
        def scale(x):
            return x * TABLE[1] * math.pi
    """
    assert made(before, "stress[:] = scale(stress)").source == (
        f"{HEAD}    stress[:] = scale(stress)\n# scale = function 1\n# function 1:\n"
        "def scale(x):\n    return x * TABLE[1] * math.pi\n"
        "# TABLE = array of <f8, (3,): [0.0, 1.0, 2.0]\n# math.pi = 3.141592653589793"
    )


def test_what_cannot_be_a_part_of_a_law_is_refused_by_name(made, tmp_path):
    (tmp_path / "module_of_mine.py").write_text("X = 0.5\ndef f():\n    return X\n")
    law = made("import module_of_mine as m", "stress *= m.X * m.f()")
    assert "# m.X = 0.5\n# m.f = function 1" in law.source
    thing = "class Thing:\n    x = 1\n"
    refused(
        (
            "GIVEN = <.*Thing object.* must be a plain value.*parameters=",
            lambda: made(f"{thing}GIVEN = Thing()"),
        ),
        ("GIVEN = <class .*Thing'> must", lambda: made(f"{thing}GIVEN = Thing")),
        ("GIVEN = <generator", lambda: made("GIVEN = (k for k in range(3))")),
        ("GIVEN = array.* must be", lambda: made("import numpy as np\nGIVEN = np.array([None])")),
        (
            "GIVEN = functools.partial",
            lambda: made("import functools\nGIVEN = functools.partial(int)"),
        ),
        (r"GIVEN = \[\[...\]\] must be", lambda: made("GIVEN = []\nGIVEN.append(GIVEN)")),
        ("GIVEN is not defined", lambda: made("")),
        ("must not change the global A", lambda: made("A = 1", "global A\nA = 2")),
        ("must not import numpy", lambda: made("", "import numpy")),
        ("must not define a class", lambda: made("", "class A: pass")),
        ("eval must not be used", lambda: made("", "stress *= eval('1')")),
        ("open must not be used", lambda: made("def f():\n    open('x')", "f()")),
        ("m is a module, of which", lambda: made("import module_of_mine as m", "print(m)")),
        (
            "f.* must be a plain function without default",
            lambda: made("def f(x=1):\n    pass", "f()"),
        ),
        ("f.* without default", lambda: made("def f(*, x=1):\n    pass", "f()")),
        ("f.* must have no attributes", lambda: made("def f():\n    pass\nf.x = 1", "f.x")),
        (
            "must not use variables of an enclosing",
            lambda: made("def g(c):\n    return lambda: c\nf = g(1)", "f()"),
        ),
        ("time must not be used: the law", lambda: made("import time", "time.time()")),
        ("time must not be used", lambda: made("from time import time as now", "now()")),
        ("numpy.random must not", lambda: made("import numpy as np", "np.random.rand()")),
        ("without yield", lambda: made("", "yield")),
        ("alone in its line", lambda: made("f, g = lambda: 1, lambda: 2", "f()")),
    )


@pytest.mark.parametrize("name", ["parameters", "history"])
def test_the_order_of_numbers_is_a_part_of_a_law(name, made, tmp_path):
    """The function reads them by position: other orders are other materials, in files, too."""
    source = "GIVEN = 0.5"
    one, other = (made(source, **{name: given}) for given in ({"a": 9, "b": 2}, {"b": 2, "a": 9}))
    assert one.digest == other.digest and one != other and len({one, other}) == 2
    assert one == made(source, **{name: {"a": 9, "b": 2}})
    scenes = [gr.scenes.column_collapse(aspect=1.0, cell=0.1, material=law) for law in (one, other)]
    assert [gr.Scene.from_json(scene.to_json()) == scenes[1] for scene in scenes] == [False, True]
    gr.Simulation(scenes[0], threads=1).run(until=1e-3, save=tmp_path / "run.h5")
    assert gr.open(tmp_path / "run.h5").scene == scenes[0]
    if name == "history":  # whose values the points keep
        with pytest.raises(ValueError, match=r"materials\[0\].history = \('b', 'a'\) must be"):
            gr.Simulation.resume(tmp_path / "run.h5", scene=scenes[1])
    else:
        assert gr.Simulation.resume(tmp_path / "run.h5", scene=scenes[1]).scene == scenes[1]
    filled = scenes[0].replace(
        fills=(*scenes[0].fills, replace(scenes[0].fills[0], material=other))
    )
    assert len(filled.materials) == 2


def test_a_module_of_ones_own_with_a_name_of_python(made, tmp_path, monkeypatch):
    """Where a file lies tells whose it is, not what it is called."""

    def law(value, before, body):
        monkeypatch.delitem(sys.modules, "profile", raising=False)
        (tmp_path / "profile.py").write_text(f"X = {value}\ndef f():\n    return X + 0\n")
        return made(before, body)

    for before, body in (
        ("import profile", "stress *= profile.f()"),
        ("from profile import f", "stress *= f()"),
    ):
        laws = [law(value, before, body) for value in ("0.50", "0.125")]
        assert laws[0].digest != laws[1].digest
        assert not np.array_equal(*map(stress_of, laws))
    monkeypatch.delitem(sys.modules, "profile")


def test_what_is_put_into_an_installed_module_is_a_part_of_a_law(made, monkeypatch):
    """It runs with what it was made with, in numba, too."""
    kinds = [None] + ["numba"] * (importlib.util.find_spec("numba") is not None)
    body = "a = np.linalg.norm(np.ones(4)) * math.sqrt(1.0) / 2\nstress *= np.my_factor * a"
    for kind in kinds:
        laws = []
        for value in (0.5, 0.25):
            monkeypatch.setattr(np, "my_factor", value, raising=False)
            laws.append(made("import math\nimport numpy as np", body, compiler=kind))
        assert laws[0].digest != laws[1].digest and "# np.my_factor = 0.5" in laws[0].source
        assert not np.array_equal(*map(stress_of, laws))
    monkeypatch.setattr(np, "my_factor", lambda: 0.5)
    assert "# np.my_factor = function 1" in made("import numpy as np", "np.my_factor()").source


def test_what_installed_modules_reach_is_refused_by_name(made, monkeypatch):
    heads = "import numpy as np\nimport os, sys, operator, fractions, builtins\n"
    monkeypatch.setattr(np, "my_box", types.SimpleNamespace(k=0.5), raising=False)
    cases = (
        ("numpy.random must not", "", "np.random.rand()"),
        ("numpy.random.* must not", "from numpy.random import default_rng as d", "d()"),
        ("r: numpy.random must not", "from numpy import random as r", "r.rand()"),
        ("np is a module, of which only", "", "r = np\nr.random.rand()"),
        ("getattr must not be used", "", "getattr(np, 'ran' + 'dom')"),
        ("os: os must not", "", "os.environ['F']"),
        ("sys: sys must not", "", "sys.modules"),
        ("np.load: numpy.load must not", "", "np.load('t.npy')"),
        ("l: numpy.loadtxt must not", "from numpy import loadtxt as l", "l('t')"),
        ("builtins must not", "", "builtins.open"),
        ("open must not", "from builtins import open as o", "o('t')"),
        ("g: os.getenv must not", "from os import getenv as g", "g('F')"),
        ("_?operator.attrgetter must not", "", "operator.attrgetter('x')"),
        ("np.my_box = .* must be a plain", "", "np.my_box.k"),
        ("np.interp is a function or a class", "", "np.interp.x"),
        ("fractions.Fraction is a .* class", "", "fractions.Fraction.x"),
        ("the attribute __globals__", "def f():\n    return 1", "f.__globals__['K']"),
        ("the attribute __class__", "", "stress.__class__"),
        ("the attribute gi_frame", "", "(k for k in ()).gi_frame"),
        ("__builtins__ must not", "", "__builtins__"),
        ("must not change the attribute x", "def f():\n    return 1", "f.x = 1"),
    )
    refused(*((told, lambda b=heads + b, s=s: made(b, s)) for told, b, s in cases))


def test_a_file_that_was_changed_after_it_was_imported_is_told(tmp_path, monkeypatch):
    """The text would not be that of what runs."""
    monkeypatch.syspath_prepend(tmp_path)
    path = tmp_path / "edited_law.py"
    path.write_text(f"{HEAD}    stress *= 0.5\n")
    module = importlib.import_module("edited_law")
    path.write_text(f"{HEAD}    stress *= 0.25 + 0\n")
    with pytest.raises(ValueError, match="was the file changed after it was imported"):
        from_function(module.law)


def test_another_value_does_not_resume_and_is_named(made, tmp_path, monkeypatch):
    law = made("GIVEN = 0.5")
    scene = gr.scenes.column_collapse(aspect=1.0, cell=0.1, material=law)
    gr.Simulation(scene, threads=1).run(until=1e-3, save=tmp_path / "run.h5")
    monkeypatch.setattr("granular.materials.own._FUNCTIONS", {})
    made("GIVEN = 0.25")
    with pytest.raises(ValueError, match=r"(?s)-# GIVEN = 0.25.*\+# GIVEN = 0.5"):
        gr.Simulation.resume(tmp_path / "run.h5")


def test_results_are_changed_in_place(made):
    """Else the stress would stay the trial stress, without a word."""
    made("", "stress *= 0.5; stress[0] = 1.0; log_density = 2.0; shear_rate += 1.0")
    rebound = "must change stress in place, as by stress"
    refused(
        (rebound, lambda: made("", "stress = stress * 0.5")),
        (rebound, lambda: made("", "a, stress = 1, stress * 0.5")),
        (rebound, lambda: made("", "for stress in (1, 2): pass")),
        (rebound, lambda: made("", "stress = 2 * stress\ng = lambda: stress")),
        ("must change history in place", lambda: made("", "history = None")),
    )
    returns = r"the law 'law' returned .*array.*: it must change stress"
    law = made("", "return 0.5 * stress")
    with pytest.raises(TypeError, match=returns):
        stress_of(law)
    if importlib.util.find_spec("numba"):
        with pytest.raises(TypeError, match=returns):
            made("", "return 0.5 * stress", compiler="numba")
        made("", "stress *= 0.5", compiler="numba")


# ---- C ----

UPDATE = """
void update(int64_t n, int64_t dim, double dt, const double *parameters, const double *gradient,
            const double *log_density, double *stress, double *shear_rate, double *history)
{ %s }
"""


def test_c_source_must_be_all_of_the_law():
    law = from_function(
        '/* ## #include "x.h" */ #include <float.h>\n'.replace("*/ ", "*/\n")
        + "#define A \\\n 2.0\nstatic const double t[2] = {0.5, A};\nenum { K };\n"
        + "struct pair { double a, b; };\ntypedef struct { int x; } other;\n"
        + "static double f(double x);\nstatic double f(double x) { return x * t[K]; }\n"
        + UPDATE % 'const char *s = "## asm"; stress[0] = s[0] ? f(stress[0]) : 0.0;'
    )
    assert law.language == "c"
    refused(
        *(
            (f"(?s)has {line!r}: it must be all of the law", lambda s=text: from_function(s))
            for text, line in (
                ('#include "x.h"\n' + UPDATE % "", '#include "x.h"'),
                ("#include </etc/x.h>\n" + UPDATE % "", "#include </etc/x.h>"),
                ("# /* */ inc\\\nlude <stdio.h>\n" + UPDATE % "", "#   include <stdio.h>"),
                ("%: include <stdlib.h>\n" + UPDATE % "", "%: include <stdlib.h>"),
                ("#define H <math.h>\n#include H\n" + UPDATE % "", "#include H"),
                ("#include_next <math.h>\n" + UPDATE % "", "#include_next <math.h>"),
            )
        ),
        *(
            (f"has the variable '{name}", lambda s=text: from_function(s))
            for text, name in (
                ("double total;\n" + UPDATE % "", "double total"),
                ("static double t[2] = {1, 2};\n" + UPDATE % "", "static double t"),
                (UPDATE % "static int calls = 0; calls++;", "static int calls"),
                ("struct p { int a; } q;\n" + UPDATE % "", "struct p q"),
            )
        ),
        *(
            (f"must not have {re.escape(word)}: with it", lambda s=text: from_function(s))
            for text, word in (
                ("#define S sta##tic\n" + UPDATE % "S double a = 0; a++;", "##"),
                ("%: define S sta%:%:tic\n" + UPDATE % "", "%:%:"),
                ("#define S sta#\\\n#tic\n" + UPDATE % "", "##"),
                ('__asm__(".incbin \\"/etc/passwd\\"");\n' + UPDATE % "", "__asm__"),
                (UPDATE % 'asm("");', "asm"),
                (UPDATE % "int c = '\"'; asm(\"\"); c = '\"';", "asm"),
                (UPDATE % 'const char *s = R"(")"; asm(s);', 'R"'),
                ("#define S sta#\\ \n#tic\n" + UPDATE % "", "##"),
                ('#if __has_include("/etc/x.h")\n#endif\n' + UPDATE % "", "__has_include"),
                ('_Pragma("once")\n' + UPDATE % "", "_Pragma"),
            )
        ),
        ("has '#embed", lambda: from_function("int a[] = {\n#embed </etc/x>\n};" + UPDATE % "")),
    )


def test_what_is_no_update_in_c_is_told():
    refused(
        *(
            ("must compile, and define void update", lambda s=text: from_function(s))
            for text in (
                "void updates(int64_t n) { (void)n; }",
                "int update(int64_t n) { return (int)n; }",
                "",
                "this is no C",
                UPDATE % "nowhere(n);",
                UPDATE % "stress[0] = sizeof __DATE__;",
                "#if 0\n" + UPDATE % "",
            )
        )
    )
    with pytest.raises(ValueError, match=r"error: .*nowhere"):
        from_function(UPDATE % "nowhere(n);", name="calling")


def test_the_environment_does_not_change_a_law_in_c(tmp_path, monkeypatch):
    """Neither other headers nor flags of the user's shell reach the compiler."""
    (tmp_path / "math.h").write_text("#error another one\n")
    for name in ("CPATH", "C_INCLUDE_PATH"):
        monkeypatch.setenv(name, str(tmp_path))
    monkeypatch.setenv("CFLAGS", "-no-such-flag")
    assert from_function(UPDATE % "stress[0] = sqrt(2.0);", name="in an environment").digest
    monkeypatch.setenv("CC", "no-such-compiler")
    assert from_function(UPDATE % "stress[0] = sqrt(3.0);").digest
    monkeypatch.setattr(law_functions.shutil, "which", lambda name: None)
    with pytest.raises(ValueError, match="there is no C compiler"):
        from_function(UPDATE % "stress[0] = sqrt(4.0);")


def test_what_is_installed_is_known_by_name_and_version(made):
    before = """
        import itertools
        from math import sqrt
        import numpy as np
        from numpy import exp, float64, linalg, pi, where
        from scipy.special import erf
        R, D, S = range(3), np.dtype("f4"), {"b", "a"}
    """
    body = (
        "itertools.chain, np.add.reduce, sqrt, exp, float64, linalg.norm, pi, where, erf, R, D, S"
    )
    source = made(before, body).source
    assert [re.sub(r" [0-9.]+$", "", line) for line in source.splitlines()[2:]] == [
        "# D = dtype <f4",
        "# R = range(0, 3)",
        "# S = set('a', 'b')",
        "# erf = scipy.special.erf",
        "# exp = numpy.exp",
        "# float64 = numpy.float64",
        "# itertools.chain = itertools.chain of Python",
        "# linalg.norm = numpy.linalg.norm",
        "# np.add = numpy.add",
        "# pi =",
        "# sqrt = math.sqrt of Python",
        "# where = numpy.where",
    ]

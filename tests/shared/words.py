"""One standard term for one thing: words that are no longer used, with their replacements.

`python tests/shared/words.py [path ...]` prints file, line, word and replacement of each
occurrence, and exits with 1 if there is any. It needs nothing but Python.
"""

import os
import re
import sys
from pathlib import Path

ROOT = Path(__file__).parents[2]
ROOMS = ("csrc", "granular", "tests", "benchmarks", "docs", "notebooks")
ROOMS += ("README.md", "CHANGELOG.md")
WITH_EXAMPLES = ("tests/shared/words.py", "tests/project/test_unit_words.py")
ENDINGS = (".c", ".h", ".inl", ".py", ".pyi", ".md", ".ipynb", ".sh")
ANY, CORE = ("",), ("csrc/",)
ENGINE = ("csrc/", "granular/mpm/", "granular/run/diagnostics.py")
OUTSIDE_GRAIN_SCALE = (
    *("csrc/", "granular/mpm/", "granular/scenes/", "granular/sph/", "granular/measure/"),
    *("granular/theory/", "granular/verify/", "granular/plot/", "granular/economy/"),
    *("docs/tutorials/", "docs/how-to/", "docs/reference/", "docs/explanation/core.md"),
    *("docs/explanation/limits.md", "docs/reports/stability.md"),
)
CODE = ("csrc/", "granular/", "benchmarks/")
PROSE = (
    *(*CODE, "docs/explanation/", "docs/how-to/", "docs/tutorials/", "docs/reference/"),
    *("docs/reports/", "docs/contributing.md", "docs/index.md", "notebooks/"),
    *("README.md", "CHANGELOG.md"),
)
PARTICIPLES = "(found|told|kept|shown|said|asked|worth|own)"
"""Not names of variables and functions."""

WORDS = (
    (r"\b([Hh]ats?|HATS?)\b", "linear shape functions", ANY),
    (r"\b[Cc]reas(e|es|ed)\b", "C0 line", ANY),
    (r"\b[Ss]catter\w*", "P2G", CORE),
    (r"\b[Gg]ather\w*", "G2P, or sum over cells", ENGINE),
    (r"\b[Cc]ure[sd]?\b|\bgr_cure|\bcure_", "density correction", ANY),
    (r"[\"'`](tracked|diffused|shared)[\"'`]", "particle, smoothed, cell_averaged", ANY),
    (r"\b(tracked|diffused|shared) density", "particle, smoothed, cell-averaged density", ANY),
    (r"\bfullness\b", "filling fraction", ANY),
    (r"\brooms?\b", "volume, or capacity where it is memory", ANY),
    (r"\bfeedback\w*", "relaxation to the nodal density", ANY),
    (r"\bpull(s|ed)? (to|towards)\b|\bpull_to", "relax to", ANY),
    (r"\bcrowd\w*", "over-compressed", ANY),
    (r"\blent\b|\blent_", "shift momentum, or borrowed", ANY),
    (r"\boverweight|\bunevenness\b", "quadrature weight correction, residual force", ANY),
    (r"\btension_reach\b", "separation_strain", ANY),
    (
        r"\bloose(r|ly)?\b(?! (sand|material|packing)| than critical| and dense)",
        "disconnected, stress-free, or less dense",
        OUTSIDE_GRAIN_SCALE,
    ),
    (r"\bbears? nothing\b", "is stress-free", ANY),
    (r"\bgifts?\b|\blook_around\b", "contribution, cell_state", ANY),
    (r"\bsets?_out\b|\bsets? out\b", "begin substeps", ANY),
    (r"\bleavers?\b", "migrants", ANY),
    (r"\bplates?(\b|_)", "thin body", CORE),
    (r"_plates?\b", "thin body", CORE),
    (r"\btwins?\b", "duplicate node", ANY),
    (r"\bkindl\w+", "reconnect_fluidity", ANY),
    (r"\bfrictionless\b", "free-slip", OUTSIDE_GRAIN_SCALE),
    (r"\brough walls?\b", "no-slip wall", OUTSIDE_GRAIN_SCALE),
    (r"\b[Aa]bsorb(er|ers|s|ing)\b", "sponge layer", ANY),
    (r"\b[Dd]oubt(s|ful|ed)?\b", "scene_warnings; suspect", ANY),
    (r"\b(a|the|each|all|no|these|two|many) looks?\b", "sample", ANY),
    (r"\bthrift\w*|\badvi[sc]e[sd]?\b|\beconomy\.half\b", "cheaper, suggest, mirror_half", ANY),
    (r"\bWritten\b\)|\bclass Written\b|\b_kept\b|\bcalled_with\b", "see the glossary", ANY),
    (r"\bin space\b(?! and)", "3D", ANY),
    (r"\bin the plane\b(?! of)", "2D", ANY),
    (r"(?<![Ss]moothed )[Pp]article hydrodynamics", "SPH", ANY),
    (r"(?<![Ss]eeding )\b[Ll]attices?\b", "grid, seeding lattice, averaging grid", ANY),
    (r"\bschemes\.published\b", "schemes.dunatunga_kamrin_2015", ANY),
    (r"\b(mu_i|local_saturating|hencky_mu_i)\b", "mu_I", ANY),
    (r"[\"']saturating[\"']", "mu_I", ANY),
    (r"\"\"\"(What|Whether|How)\b", "a noun or a verb", ANY),
    (r"\bwarn(ed|s) of it\b|\b(is|are|was|were|be) warned of\b", "a warning reports", PROSE),
    (r"\b[Hh]eld beside\b", "compared with", PROSE),
    (r"\b[Bb]eside\b", "next to, or compared with", CODE),
    (r"\btold\b|\bblame\w*", "reported, cause", PROSE),
    (r"\bwhat (flows|falls|rests)\b", "moving material, material at rest", PROSE),
    (r"\bwhat (is|was) (found|told|kept|worth|shown|solid)\b", "a noun", PROSE),
    (r"\b(one|the user|a user)'s own\b(?=[.,;:)])", "user-defined, given", PROSE),
    (r"\b[Pp]laces (of|per) (a |the )?points?\b|\bspare places?\b", "slots, capacity", PROSE),
    (r"\bfeet of (a |the )?(points?|bod(y|ies)|shapes?)\b", "contact points", PROSE),
    (rf"\b_?{PARTICIPLES}( [-+|&]?= |\.(append|extend|update|add)\()", "a noun", CODE),
    (rf"\b(for|def|as) _?{PARTICIPLES}\b(,.*)?( in |\()", "a noun", CODE),
    (r"(?<!:[+-])(?<=[\s(=<>~+-])\.\d", "a zero before the point", ANY),
)


def any_of(words):
    """One expression for all: those that begin with a boundary are tried there alone."""
    first = [word.removeprefix(r"\b") for word in words if word.startswith(r"\b")]
    rest = [word for word in words if not word.startswith(r"\b")]
    return re.compile("|".join([rf"\b({'|'.join(first)})", *rest]))


def files(paths):
    """Files that are read, as paths from the root; also in a copy without the history of git."""
    entries = []
    for path in (ROOT / p for p in paths):
        entries += [path] if path.is_file() else sorted(path.rglob("*"))
    names = [Path(os.path.relpath(path, ROOT)).as_posix() for path in entries if path.is_file()]
    return [name for name in names if name.endswith(ENDINGS) and "__pycache__" not in name]


def hits(paths):
    """File, line, word and what stands for it now."""
    present = any_of([word for word, _, _ in WORDS])
    for name in files(paths):
        if name in WITH_EXAMPLES:
            continue
        text = (ROOT / name).read_text()
        if not present.search(text):  # of most files; one by one the words take ten times as long
            continue
        for word, now in [(word, now) for word, now, where in WORDS if name.startswith(where)]:
            for hit in re.finditer(word, text):
                before = text[: hit.start()].split("\n")
                line = (before[-1] + text[hit.start() :].partition("\n")[0]).strip()
                yield f"{name}:{len(before)}: {hit.group()!r}: {now}: {line[:90]}"


if __name__ == "__main__":
    lines = list(hits(sys.argv[1:] or ROOMS))
    sys.stdout.writelines(f"{line}\n" for line in lines)
    sys.exit(bool(lines))

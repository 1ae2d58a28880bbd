"""The examples of chapter 5 of Hurley's thesis, with SPH, in more variants than its figures.

The figures are drawn by `granular figure hurley_thesis 5.2`. Here are runs without a spring, with
other times to settle, and columns in 3D. Runs every case that the table does not hold yet and
writes the table after each, so that a benchmark that was stopped continues where it was. Then the
orderings and exponents are computed; docs/reports/sph.md has them.
"""

from __future__ import annotations

import json
import time
from collections.abc import Callable, Iterator
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from shared import markdown, parser_of, rounded, stored, table, write

import granular as gr
from granular import sph
from granular.papers.hurley_thesis import studies
from granular.papers.hurley_thesis.channels import FLOORS, height_at_wall
from granular.papers.hurley_thesis.columns import GLASS, GRIT
from granular.papers.hurley_thesis.inclines import ANGLES, LayerFlow, layer, sample
from granular.papers.hurley_thesis.sph_measures import far, power_laws, rate_of_the_law, slope_deg

BETAS = (0.0, 0.5)
PHIS = (30.0, 20.0, 40.0, 25.0, 35.0)
STUDY = {"aspect": studies.ASPECT, "length": studies.LENGTH, "reach": studies.REACH}
DIGITS = 5
"""Number of digits of the results in the table."""

Case = tuple[str, dict[str, Any]]


# ---- runs ----


def watched(scene: sph.Scene, threads: int, every: float, look: Callable[[gr.State], Any]) -> tuple:
    """Run a scene; return simulation, times, samples, and the common entries of a row."""
    times, looks = [], []

    def hook(simulation: gr.Simulation) -> None:
        times.append(simulation.time)
        looks.append(look(simulation.state))

    begin = time.process_time()
    simulation = gr.Simulation(scene, threads=threads)
    simulation.run(every=every, hooks=(hook,))
    row = cost(simulation, begin) | {
        "wall_points": len(scene.wall_points()["wall"]),
        "mach": simulation.health()["mach"].value,
    }
    return simulation, np.array(times), looks, row


def cost(simulation: gr.Simulation, begin: float) -> dict[str, float]:
    """Size of a run, its processor time since `begin`, and the particles that it has lost."""
    return {
        "points": simulation.scene.n_points,
        "steps": simulation.steps,
        "dt": simulation.dt,
        "core_seconds": time.process_time() - begin,
        "dropped": simulation.counts["dropped"],
        "stopped": simulation.counts["stopped"],
    }


def choices(creeping: bool, cfl: float) -> tuple[sph.Numerics, dict[str, float]]:
    """Numerics and changes of the material; "creeping" is as close to the thesis as possible."""
    if not creeping:
        return sph.Numerics(cfl=cfl), {}
    return sph.Numerics(cfl=cfl, regularisation=1.0, z_max=1.5), {"nu": 0.5}


def repose(
    threads: int, creeping: bool = False, cfl: float = 1.0, **keywords: Any
) -> dict[str, Any]:
    """Angle at the end, averaged over a second, its fall in the two seconds before, and largest.

    A run of less than these three seconds has no fall (None).
    """
    numerics, changes = choices(creeping, cfl)
    scene = gr.scenes.slump_sph(numerics=numerics, **keywords)
    scene = scene.replace(material=scene.material.replace(**changes))

    def look(state: gr.State) -> tuple[float, float]:
        return slope_deg(state), float(np.sqrt(np.mean((state.v**2).sum(axis=1))))

    _, times, looks, row = watched(scene, threads, 0.25, look)
    angles, speeds = (np.array(values) for values in zip(*looks, strict=True))
    last = angles[times > times[-1] - 1.1].mean()
    earlier = angles[(times > times[-1] - 3.1) & (times < times[-1] - 1.9)]
    creep = float((earlier.mean() - last) / 2.0) if len(earlier) else None
    return row | {
        "angle_deg": float(last),
        "creep_deg_per_s": creep,
        "largest_deg": float(angles.max()),
        "speed": float(speeds[-1]),
    }


def column(threads: int, material: str, dilation: float, **keywords: Any) -> dict[str, Any]:
    """Run-out and height at rest, and their changes in the last half second."""
    creeping = keywords.pop("creeping", False)
    numerics, changes = choices(creeping, keywords.pop("cfl", 1.0))
    numerics = replace(numerics, wall_density=keywords.pop("wall_density", None))
    changes |= {k: keywords.pop(k) for k in ("kappa", "mu_l", "mu_wall") if k in keywords}
    if "mu_l" in changes:
        changes["mu_h"] = changes["mu_l"]
    grains = getattr(sph, material).replace(dilation=dilation, **changes)
    scene = gr.scenes.column_collapse_sph(material=grains, numerics=numerics, **keywords)
    if creeping:
        return at_rest(scene, threads)
    _, times, looks, row = watched(scene, threads, 0.1, far)
    before = looks[int(np.searchsorted(times, times[-1] - 0.5))]
    return row | looks[-1] | {"L99_last_half_second": looks[-1]["L99"] - before["L99"]}


def at_rest(scene: sph.Scene, threads: int) -> dict[str, Any]:
    """A collapse at the time at which it comes to rest, before it creeps."""
    begin = time.process_time()
    simulation = gr.Simulation(scene, threads=threads)
    end = sph.run_to_rest(simulation, after=scene.parameters["settle"], interval=0.05)
    rest_at = end and end - scene.parameters["settle"]
    return far(simulation.state) | {"rest_at": rest_at} | cost(simulation, begin)


def inclined(threads: int, **keywords: Any) -> dict[str, Any]:
    """Run-out at three times after the gate lifts, and the height at the upper wall."""
    scene = gr.scenes.inclined_collapse(**keywords)
    simulation, times, looks, row = watched(scene, threads, 0.1, far)
    settle = scene.parameters["settle"]
    late = [looks[int(np.searchsorted(times, settle + t - 1e-6))] for t in (0.2, 0.4, 0.8)]
    top = height_at_wall(simulation.state)
    return row | looks[-1] | {"L99_at": [look["L99"] for look in late], "H_upper_wall": top}


def incline(threads: int, angle_deg: float, dilation: float, duration: float) -> dict[str, Any]:
    """Shear rate, profiles, slip, and the acceleration with its fit (figures 5.3 and 5.4)."""
    scene = layer(angle_deg, dilation, duration)
    _, _, looks, row = watched(scene, threads, 0.05, partial(sample, scene.duration - 1.0))
    last = [state for _, state in looks if state is not None]
    flow = LayerFlow.of(scene, [seen for seen, _ in looks], last)
    (a, b, c), (rate, line, bagnold) = flow.decay, flow.rates
    return row | {
        "rate": rate,
        "rate_of_the_law": rate_of_the_law(scene, angle_deg),
        "misfit_line": line,
        "misfit_bagnold": bagnold,
        "slip": flow.slip,
        "fit_a": a,
        "fit_b": b,
        "fit_c": c,
        "last_acceleration": float(flow.accelerations[1][-20:].mean()),
    }


RUNS = {
    "repose": repose,
    "column": column,
    "inclined": inclined,
    "incline": incline,
    "study": column,
}


def cases() -> Iterator[Case]:
    """All cases in the order in which they are run."""
    for way in ({}, *OTHERS, CREEPING):
        for material, aspects, size in (("grit", GRIT, {}), ("glass", GLASS, FINE)):
            for dilation in BETAS:
                for aspect in aspects:
                    of = {"material": material, "dilation": dilation, "aspect": aspect}
                    yield "column", of | size | way
    for phi in PHIS:
        for dilation in BETAS:
            yield "repose", {"phi_deg": phi, "dilation": dilation, "duration": 16.0}
    for angle in ANGLES:
        for dilation in BETAS:
            yield "incline", {"angle_deg": angle, "dilation": dilation, "duration": 10.0}
    yield from changed()
    for phi in PHIS[:3]:
        for step in (1.0, 0.25):
            of = {"phi_deg": phi, "dilation": 0.0, "duration": 8.0}
            yield "repose", of | CREEPING | {"cfl": step}
    yield from in_space()
    for side_walls, width in ((False, 0.04), (True, 0.1)):
        for angle, reach in FLOORS.items():
            for dilation in BETAS:
                of = {"angle_deg": angle, "side_walls": side_walls, "width": width}
                yield "inclined", of | {"dilation": dilation, "reach": reach, "duration": 0.9}


CREEPING = {"creeping": True, "cfl": 0.25}
"""Run without a spring, stopped at rest; a quarter of the time step reduces the creep."""
OTHERS = tuple({"settle": t} for t in (0.55, 0.6, 0.65))
"""Settling times other than 0.5 s, which show the random scatter of the run-out."""
FINE = {"length": 0.025, "spacing": 0.005}


def in_space() -> Iterator[Case]:
    """Columns with a periodic width, as in the thesis."""
    for dilation in BETAS:
        for aspect in GRIT[::2]:
            of = {"material": "grit", "dilation": dilation, "aspect": aspect}
            yield "column", of | {"width": 0.06}


def changed() -> Iterator[Case]:
    """Stiffness, friction and spacing, changed one at a time, in 2D."""
    common = {"material": "grit", "dilation": 0.0} | STUDY
    for kappa in studies.KAPPAS:
        yield "study", common | {"kappa": kappa}
    for kappa in (1e6, 1e7):
        yield "study", common | {"kappa": kappa, "wall_density": 0.97}
    for mu, mu_wall in studies.FRICTIONS[1:]:
        yield "study", common | {"mu_l": mu, "mu_wall": mu_wall}
    for spacing in studies.SPACINGS[1:]:
        yield "study", common | {"spacing": spacing}
    yield "study", common | {"dilation": 0.5}


def quick() -> Iterator[Case]:
    """A small and short case of each kind, to check that all of them run."""
    yield "repose", {"length": 0.2, "height": 0.12, "orifice": 0.04, "duration": 0.2}
    for aspect in (1.8, 2.4):
        yield "column", {"material": "glass", "dilation": 0.0, "aspect": aspect} | FINE
    yield "inclined", {"side_walls": False, "width": 0.0, "reach": 0.4, "duration": 0.9}
    yield "incline", {"angle_deg": 24.0, "dilation": 0.0, "duration": 1.5}


# ---- evaluation ----


def kind_of_column(row: dict[str, Any]) -> str:
    """Name of the set of columns to which a row belongs in the fits."""
    name = f"{row['material']} beta {row['dilation']:g}"
    creeping = " creeping" if row.get("creeping") else ""
    return name + creeping + (" 3D" if row.get("width") else "")


def exponents(rows: list[dict[str, Any]]) -> dict[str, Any]:
    """Fits H0/H = l1 a^a1 and (L - L0)/L0 = l2 a^a2 for a > 1.7, of L and of L99 (eq. 5.32)."""
    result = {}
    columns = [row for row in rows if row["kind"] == "column"]
    for key in dict.fromkeys(map(kind_of_column, columns)):
        these = [row for row in columns if kind_of_column(row) == key]
        if len(these) < 2:
            continue
        entry = power_laws([row["aspect"] for row in these], these[0].get("length", 0.09), these)
        result[key] = entry | {"columns": len(these)}
    return result


def orderings(rows: list[dict[str, Any]]) -> dict[str, Any]:
    """Run-outs of the inclined collapses by angle, side walls and dilation."""
    result: dict[str, Any] = {}
    for row in rows:
        if row["kind"] == "inclined" and "angle_deg" in row:
            walls = "side walls" if row["side_walls"] else "periodic"
            name = f"{walls}, beta {row['dilation']:g}"
            result.setdefault(f"{row['angle_deg']:g} deg", {})[name] = [row["L99"], row["L"]]
    return result


def tables(results: dict[str, Any]) -> dict[str, list[str]]:
    """Tables of the page, by their names."""
    rows = [row for row in results["rows"] if not row.get("creeping")]
    return {
        "repose": repose_table([row for row in rows if row["kind"] == "repose"]),
        "inclines": incline_table([row for row in rows if row["kind"] == "incline"]),
        "columns": column_table(results["exponents"]),
        "studies": study_table([row for row in rows if row["kind"] == "study"]),
        "inclined": inclined_table([row for row in rows if row["kind"] == "inclined"]),
    }


def by_dilation(rows: list[dict[str, Any]], key: str) -> list[dict[str, Any]]:
    """Rows without (a) and with dilation (b), by an angle."""
    pairs: dict[float, list[dict[str, Any]]] = {}
    for row in sorted(rows, key=lambda row: (row[key], row["dilation"])):
        pairs.setdefault(row[key], []).append(row)
    return [{"angle": angle, "a": pair[0], "b": pair[1]} for angle, pair in pairs.items()]


def repose_table(rows: list[dict[str, Any]]) -> list[str]:
    """Slopes, and the speeds of the particles that still roll."""
    pairs = by_dilation(rows, "phi_deg")
    for pair in pairs:
        pair["mm"] = [1e3 * pair[k]["speed"] for k in "ab"]
    columns = {"phi [deg]": "{angle:g}", "beta = 0": "{a[angle_deg]:.1f}"}
    columns |= {"beta 0 to 0.5": "{b[angle_deg]:.1f}", "speed [mm/s]": "{mm[0]:.0f}, {mm[1]:.0f}"}
    return table(pairs, columns)


def incline_table(rows: list[dict[str, Any]]) -> list[str]:
    """Shear rates, misfits of a line and of Bagnold's profile, slip and acceleration."""

    def both(pair: dict[str, Any], key: str) -> str:
        sizes = [abs(pair[k][key]) for k in "ab"]
        return "; ".join(f"{v:.{1 if key == 'rate' and v > 1 else 2}f}" for v in sizes)

    pairs = by_dilation(rows, "angle_deg")
    for pair in pairs:
        law = pair["a"]["rate_of_the_law"]
        fits = [
            f"{r['misfit_line']:.2f}, {r['misfit_bagnold']:.2f}" for r in (pair["a"], pair["b"])
        ]
        flows = max(pair["a"]["rate"], pair["b"]["rate"]) > 0.1
        pair |= {name: both(pair, name) for name in ("rate", "slip", "last_acceleration")}
        pair |= {"law": "none" if law is None else f"{law:.1f}"}
        pair |= {"fits": "; ".join(fits) if flows else ""}
    return table(
        pairs,
        {
            "angle [deg]": "{angle:g}",
            "shear rate of the law, beta = 0 [1/s]": "{law}",
            "measured; beta 0 to 0.5": "{rate}",
            "line, Bagnold": "{fits}",
            "slip of the lowest row [m/s]": "{slip}",
            "acceleration [m/s2]": "{last_acceleration}",
        },
    )


def column_table(fits: dict[str, dict[str, float]]) -> list[str]:
    """Exponents and prefactors of heights and run-outs."""
    rows = [{"name": name.replace("creeping", "no spring")} | fit for name, fit in fits.items()]
    columns = {"": "{name}", "a1": "{alpha_1:.2f}", "a2, farthest": "{alpha_L:.2f}"}
    columns |= {"a2, 99 %": "{alpha_L99:.2f}", "l1": "{lambda_1:.2f}", "l2": "{lambda_L:.2f}"}
    return table(rows, columns)


def study_table(rows: list[dict[str, Any]]) -> list[str]:
    """Run-outs and heights, with the change."""
    made = []
    for row in rows:
        given = {k: v for k, v in row["case"][1].items() if k not in UNCHANGED and v}
        words = ", ".join(f"`{k}` = {v:g}" for k, v in given.items())
        made.append((words, *(f"{100 * row[key]:.1f}" for key in ("L", "L99", "H"))))
    return markdown(("", "L [cm]", "by 99 % [cm]", "H [cm]"), made)


UNCHANGED = ("material", "aspect", "length", "reach")
"""Keywords that all studies have in common."""


def inclined_table(rows: list[dict[str, Any]]) -> list[str]:
    """Distances within which 99 % of the mass lies, at two times after the gate began to lift."""
    by_angle: dict[float, dict[str, str]] = {}
    for row in rows:
        walls = "side walls" if row["side_walls"] else "periodic"
        name = f"{walls}, {'beta 0 to 0.5' if row['dilation'] else 'beta = 0'}"
        late = ", ".join(f"{100 * far:.1f}" for far in row["L99_at"][1:])
        by_angle.setdefault(row["angle_deg"], {})[name] = late
    head = ("angle [deg]", *next(iter(by_angle.values()), {}))
    return markdown(head, [(f"{angle:g}", *cases.values()) for angle, cases in by_angle.items()])


def store(rows: list[dict[str, Any]], out: Path) -> None:
    """The table with its evaluation."""
    rest = {"exponents": exponents(rows), "inclined": orderings(rows)}
    write(out, {"rows": rows} | rounded(rest, DIGITS))


def main(argv: list[str] | None = None) -> None:
    parser = parser_of(__name__, __doc__, "a few small cases, to see it runs")
    parser.add_argument("--only", choices=tuple(RUNS), help="the cases of this kind")
    parser.add_argument("--threads", type=int, default=1)
    chosen = parser.parse_args(argv)
    rows = stored(chosen.out, rows=[])["rows"]
    held = {json.dumps(row["case"], sort_keys=True) for row in rows}
    for kind, keywords in quick() if chosen.quick else cases():
        case = json.dumps([kind, keywords], sort_keys=True)
        if case in held or chosen.only not in (None, kind):
            continue
        result = rounded(RUNS[kind](chosen.threads, **keywords), DIGITS)
        rows.append({"case": [kind, keywords], "kind": kind} | keywords | result)
        print(kind, keywords, result, flush=True)
        store(rows, chosen.out)
    store(rows, chosen.out)

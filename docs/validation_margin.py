"""How much thrust is to spare: tau and what encloses it, the boundary where it is 1, the free final stage."""

# ruff: noqa: E501 (lines of the page)

from __future__ import annotations

import os
from collections.abc import Callable
from pathlib import Path

import numpy as np
from validation_text import percent, spread, table

from landing_cli.parallel.plan import WorkPlan
from landing_cli.reach.figures.margin_map import margin_figure
from landing_cli.reach.pipeline import RunOptions, run
from landing_cli.reach.records import Verdict
from landing_cli.reach.stored import CaseResult, ReachRun
from landing_cli.results.plotting import style, write_png
from landing_cli.results.surface_map import map_surface
from landing_cli.scenario.load import load

ROOT = Path(__file__).resolve().parent.parent
IMAGE = ROOT / "docs" / "images" / "validation-margin.png"
TOF_S, FIXED_S = 700, 200
NORTH_POLE = "[{name: north_pole, position_km: [0, 0, 0.8]}]"
MARGIN = (f"reach.tof_s=[{TOF_S}]", "reach.margin=true")
FREE_STAGE = (
    f"reach.tof_s=[{TOF_S}]",
    f"reach.initial_states={NORTH_POLE}",
    "reach.final_stage_s=free",
    f"reach.final_stage_compared_s={FIXED_S}",
)


def margins(say: Callable[[str], None] = lambda _: None) -> str:
    """The section on the margin; draws its map."""
    measured = _solved("bennu-margin", MARGIN, say)
    freed = _solved("bennu-free-stage", FREE_STAGE, say).cases[0]
    with style():
        write_png(margin_figure(measured.cases[0], map_surface(measured.asteroid.mesh)), IMAGE)
    levels = table(
        (
            "case",
            "1 - tau, least / median / largest",
            "unknown",
            "bound below tau by, median / 90 % / largest",
            "the same, 0.9 < tau < 1.1",
            "flown above tau by, largest",
            "proved before / with the margin",
        ),
        [_level_row(result) for result in measured.cases],
    )
    lines = table(
        (
            "case",
            "lines",
            "length, m",
            "area within, m²",
            "reachable facets, m²",
            "apart",
            "centroids on the wrong side of tau = 1",
        ),
        [_line_row(result) for result in measured.cases],
    )
    s = freed.summary
    durations, gained = s["final_stage_s"], s["gained_by_free_stage"]
    before = int((freed.solutions.rows["compared_verdict"] == Verdict.REACHABLE).sum())
    lost, saved = _saving(freed)
    return f"""## 12. How much thrust is to spare

`reach.margin: true` asks every facet for tau, the least share of the thrust bound at which it is reached. What
encloses it: from below a certificate (the ellipsoid left out), from above a flight that was integrated accurately and
keeps every other limit. Bennu, {TOF_S} s:

{levels}

The boundary of the domain is the line tau = 1 on the mesh, every facet split at its centroid, so it is finer than the
facets, which can only follow their own edges:

{lines}

![The least thrust level over Bennu, its contours, and the boundary where it is 1](images/{IMAGE.name})

**A free final stage** (`final_stage_s: free`). {freed.case.name}: with {FIXED_S} s for every facet {before} facets are
reachable; with a duration of its own ({durations["min"]:.0f} to {durations["max"]:.0f} s, median {durations["median"]:.0f} s) for each
{s["reachable"]}: {gained["facets"]} more, {gained["area_m2"]:.0f} m² ({percent(gained["area_m2"], s["reachable_area_m2"] - gained["area_m2"])} more area). Of the facets
that {FIXED_S} s reach {lost} are lost, and J falls by {saved} % (least / median / largest) on these.
"""


def _solved(name: str, overrides: tuple[str, ...], say: Callable[[str], None]) -> ReachRun:
    say(f"scenario {name}")
    plan = WorkPlan(jobs=len(os.sched_getaffinity(0)))
    loaded = load(str(ROOT / "configs" / "bennu.yaml"), overrides)
    output = ROOT / "runs" / f"{name}.h5"
    return run(loaded, output, RunOptions(plan, resume=True), lambda done, total: None, say).run


def _level_row(result: CaseResult) -> tuple[object, ...]:
    rows, s = result.solutions.rows, result.summary
    level = 1.0 - rows["thrust_margin"]
    below, above = level - rows["thrust_level_bound"], rows["thrust_level_flown"] - level
    near = np.abs(level - 1.0) < 0.1
    return (
        result.case.name,
        " / ".join(f"{s['thrust_margin'][k]:.3f}" for k in ("min", "median", "max")),
        s["thrust_margin"]["unknown"],
        _tail(below),
        _tail(below[near]),
        f"{np.nanmax(above):.1e}",
        f"{_proved_by_energy(result)} / {percent(s['proved'], s['unreachable'])}",
    )


def _proved_by_energy(result: CaseResult) -> str:
    """Share that the plain run of the same case proves."""
    from landing_cli.reach.free_descent import prepare, solve_prepared, survey

    lost = result.solutions.rows["facet"][result.solutions.rows["verdict"] == Verdict.UNREACHABLE]
    plain = solve_prepared(prepare(result.case, survey(result.case)), lost).rows
    return percent(int(plain["proved"].sum()), len(lost))


def _tail(values: np.ndarray) -> str:
    found = values[np.isfinite(values)]
    return " / ".join(f"{x:.4f}" for x in (np.median(found), np.percentile(found, 90), found.max()))


def _line_row(result: CaseResult) -> tuple[object, ...]:
    s, rows = result.summary, result.solutions.rows
    b = s["boundary"]
    wrong = (rows["thrust_margin"] >= 0.0) != (rows["verdict"] == Verdict.REACHABLE)
    return (
        result.case.name,
        b["lines"],
        f"{b['length_m']:.0f}",
        f"{b['area_within_m2']:.0f}",
        f"{s['reachable_area_m2']:.0f}",
        f"{100.0 * (b['area_within_m2'] / s['reachable_area_m2'] - 1.0):+.2f} %",
        int(wrong.sum()),
    )


def _saving(freed: CaseResult) -> tuple[int, str]:
    """Facets that are lost by the freedom, and how much less energy the others need than at the fixed time."""
    from landing_cli.reach.free_descent import prepare, solve_prepared, survey

    rows = freed.solutions.rows
    before = rows["compared_verdict"] == Verdict.REACHABLE
    case = freed.case.with_final_stage(float(FIXED_S))
    fixed = solve_prepared(prepare(case, survey(case)), rows["facet"][before]).rows
    cost = rows["performance_index_m2_s3"][before]
    saved = 100.0 * (1.0 - cost / fixed["performance_index_m2_s3"])
    return int(np.isnan(cost).sum()), spread(saved, "{:.2f}")

"""When each facet of Bennu is reachable: the study, and its agreement with single runs."""

# ruff: noqa: E501 (lines of the page)

from __future__ import annotations

import os
from collections.abc import Callable
from pathlib import Path

import numpy as np
from validation_text import exact, percent, spread, table

from landing_cli.parallel.plan import WorkPlan
from landing_cli.reach.free_descent import survey
from landing_cli.reach.records import Verdict
from landing_cli.reach.stored import ReachRun
from landing_cli.results.plotting import style, write_png
from landing_cli.results.surface_map import map_surface
from landing_cli.scenario.load import load
from landing_cli.studies.isochrone.figures.growth import growth_figure
from landing_cli.studies.isochrone.figures.isochrones import isochrone_figure
from landing_cli.studies.isochrone.intervals import interval_at
from landing_cli.studies.isochrone.pipeline import RunOptions, run
from landing_cli.studies.isochrone.records import End, IsochroneRun, StateResult
from landing_cli.studies.isochrone.verify import verify_run
from landing_cli.studies.isochrone.work import Study, solve_at

ROOT = Path(__file__).resolve().parent.parent
RANGE = ("isochrone.tof_min_s=400", "isochrone.tof_max_s=1200")
# Off the ladder: this share of a step after every so many of the grid's times.
OFF_GRID_SHARE, OFF_GRID_TIMES = 0.377, 6


def isochrones(single: ReachRun, images: Path, say: Callable[[str], None]) -> str:
    """The section: intervals, agreement with `reach run`, ends, re-flight."""
    loaded = load(str(ROOT / "configs" / "bennu.yaml"), RANGE)
    output = ROOT / "runs" / "bennu-reach-isochrone.h5"
    options = RunOptions(WorkPlan(jobs=len(os.sched_getaffinity(0))), resume=True)
    found = run(loaded, output, options, lambda done, total: None, say).run
    with style():
        surface = map_surface(found.asteroid.mesh)
        write_png(isochrone_figure(found.cases[0], surface), images / "bennu-isochrones.png")
        write_png(growth_figure(found.cases), images / "validation-isochrone-growth.png")
    grid = found.cases[0].grid
    return f"""## 13. When each facet is reachable

`reach isochrone bennu.yaml --tof-s 400:1200`: every facet is asked at {len(grid.tof_s)} times of flight from
{grid.tof_s[0]:g} to {grid.tof_s[-1]:g} s; every change of verdict between two of them is halved until the two
sides of each end are at most {grid.finest_s:.3g} s apart. "Several" counts facets with more than one interval,
"lost again" those that are out of reach again at the longest time.

{table(("initial state", "facets", "reachable at some time", "several intervals", "lost again", "unresolved intervals", "first time, s: min / median / max"), [_row(r) for r in found.cases])}

![First times of flight over Bennu, from over the north pole](images/bennu-isochrones.png)

![Growth of the domain](images/validation-isochrone-growth.png)

**Against single runs.** At the times of the scenario the verdicts must be those of `reach run`, facet by facet.

{table(("case", "facets", "other verdicts", "largest difference of J, relative"), _against_runs(found, single))}

At times off the grid nothing was asked: the domain is read off the intervals, and every facet solved at that time for
comparison. Facets between the two sides of an end are left open by the study; the others must agree, unless an
interval or a gap shorter than a step was missed.

{table(("case", "facets", "between two sides", "other verdicts"), _off_grid(found))}

**The ends again, and their flights.** `landing results verify`: both sides of a sample of ends and some of the grid
solved again, every flight flown by another integrator.

{table(("initial state", "asked again", "otherwise", "flown", "worst miss, m", "worst integrators apart, m", "verified"), _verified(found))}
"""


def _row(result: StateResult) -> tuple[object, ...]:
    s = result.summary
    first = result.facets["first_tof_s"][result.facets["begin"] != End.OPEN]
    return (
        result.case.name,
        s["facets"],
        f"{s['reachable']} ({percent(s['reachable'], s['facets'])})",
        s["several"],
        s["lost_again"],
        s["unresolved_intervals"],
        spread(first),
    )


def _against_runs(found: IsochroneRun, single: ReachRun) -> list[tuple[object, ...]]:
    rows = []
    states = {result.case.name: result for result in found.cases}
    for case in single.cases:
        result = states[case.initial_state]
        (k,) = np.flatnonzero(result.grid.tof_s == case.case.tof_s)
        own, j = case.solutions.rows, result.answers.performance_index_m2_s3[k]
        both = np.isfinite(j) & np.isfinite(own["performance_index_m2_s3"])
        apart = np.abs(j[both] / own["performance_index_m2_s3"][both] - 1.0)
        other = int((result.answers.verdict[k] != own["verdict"]).sum())
        rows.append((case.case.name, len(own), other, exact(apart.max()) if both.any() else "-"))
    return rows


def _off_grid(found: IsochroneRun) -> list[tuple[object, ...]]:
    grid = found.cases[0].grid
    study = Study(tuple(r.case for r in found.cases), grid, survey(found.cases[0].case))
    steps = np.unique(np.linspace(2, len(grid.tof_s) - 2, OFF_GRID_TIMES).round().astype(int))
    rows = []
    for index, result in enumerate(found.cases):
        for k in steps:
            tof_s = round(float(grid.tof_s[k] + OFF_GRID_SHARE * (grid.tof_s[k + 1] - grid.tof_s[k])), 3)
            row, verdict = interval_at(result.intervals, study.facets, tof_s)
            solved = solve_at(study, index, tof_s, np.arange(study.facets)).rows["verdict"]
            between = (verdict == Verdict.UNRESOLVED) & (row < 0)
            other = int((~between & (verdict != solved)).sum())
            rows.append((f"{result.case.name} {tof_s:g} s", study.facets, int(between.sum()), other))
    return rows


def _verified(found: IsochroneRun) -> list[tuple[object, ...]]:
    return [
        (
            report.case,
            report.questions,
            report.disagreeing,
            report.flights,
            exact(report.worst["touchdown_miss_m"].value),
            exact(report.worst["integrators_apart_m"].value),
            "yes" if report.verified else f"no: {report.reason}",
        )
        for report in verify_run(found.cases, jobs=2)
    ]

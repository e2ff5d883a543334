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
from landing_cli.studies.isochrone.figures.times import several_figure
from landing_cli.studies.isochrone.intervals import interval_at
from landing_cli.studies.isochrone.pipeline import RunOptions, run
from landing_cli.studies.isochrone.records import End, IsochroneRun, StateResult
from landing_cli.studies.isochrone.verify import verify_run
from landing_cli.studies.isochrone.work import Study, solve_at

ROOT = Path(__file__).resolve().parent.parent
# Head on, 3.7 m/s: full thrust stops within 684 m, the keep-out zone is 610 m away.
APPROACH = (
    "reach.initial_states=[{name: approach, position_km: [-1, 0, 0], velocity_m_s: [3.7, 0, 0]}]",
    "reach.ellipsoid_m=[390, 380, 365]",
    "isochrone.tof_min_s=350",
    "isochrone.tof_max_s=1100",
)
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

{_approach(images, options)}"""


def _approach(images: Path, options: RunOptions) -> str:
    """Facets in reach early and late but not in between: a start that comes in too fast to stop and wait."""
    loaded = load(str(ROOT / "configs" / "bennu.yaml"), APPROACH)
    output = ROOT / "runs" / "bennu-approach.h5"
    found = run(loaded, output, options, lambda done, total: None).run
    (result,) = found.cases
    with style():
        write_png(several_figure(result), images / "validation-isochrone-several.png")
    several = result.facets["intervals"] > 1
    missing = _missing_s(result)[several]
    gone, proved = _between(result)
    asked, sure = int(gone[several].sum()), int(proved[several].sum())
    wholly = int((gone == proved)[several].sum())
    (report,) = verify_run(found.cases, jobs=2)
    worst_m = exact(report.worst["touchdown_miss_m"].value)
    rows = (
        ("reachable at some time", result.summary["reachable"]),
        ("in several intervals", int(several.sum())),
        ("unresolved intervals", result.summary["unresolved_intervals"]),
        ("out of reach in between, s: min / median / max", spread(missing)),
        ("unreachable at the grid's times in between / of these proved", f"{asked} / {percent(sure, asked)}"),
        ("proved unreachable at every time in between", f"{wholly} of {int(several.sum())}"),
        ("asked again by `landing results verify` / otherwise", f"{report.questions} / {report.disagreeing}"),
        ("flown again / worst miss, m", f"{report.flights} / {worst_m}"),
    )
    return f"""**Longer is not always easier.** A spacecraft that rests where it starts, and has the thrust to hover
there, can wait and then fly what it can fly now: nothing above is lost again. One that comes in at 3.7 m/s from
1 km, with 10 mm/s² to brake and 100 m of room added to the ellipsoid, cannot: it needs 684 m to stop, and the zone
is 610 m away. It lands straight out of its approach, or it swerves around the zone and comes back.

    reach isochrone bennu.yaml --tof-s 350:1100:25 --set 'reach.ellipsoid_m=[390, 380, 365]' \\
      --set 'reach.initial_states=[{{name: approach, position_km: [-1, 0, 0], velocity_m_s: [3.7, 0, 0]}}]'

{table(("", f"of {len(several)} facets"), rows)}

Collocation says the same of six facets at 425, 500, 650 and 800 s (`bennu_approach` in section 5).

![Facets of Bennu that are reachable in two intervals](images/validation-isochrone-several.png)
"""


def _missing_s(result: StateResult) -> np.ndarray:
    """For how long each facet is out of reach between its first and last time."""
    facets = result.facets
    return facets["last_tof_s"] - facets["first_tof_s"] - facets["reachable_s"] - facets["unresolved_s"]


def _between(result: StateResult) -> tuple[np.ndarray, np.ndarray]:
    """How often each facet is unreachable between its first and last time, and how often that is proved."""
    tof_s, facets, answers = result.grid.tof_s[:, None], result.facets, result.answers
    gone = (tof_s > facets["first_tof_s"]) & (tof_s < facets["last_tof_s"])
    gone &= answers.verdict == Verdict.UNREACHABLE
    return gone.sum(axis=0), (gone & (answers.proved == 1)).sum(axis=0)


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

"""``reach isochrone``: the times of flight at which each facet is reachable."""

from __future__ import annotations

import re
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from landing_cli.cli import console
from landing_cli.cli.carry_out import carry_out, judge_domain, work_plan
from landing_cli.cli.options import (
    Backend,
    BackendName,
    DryRun,
    Jobs,
    Json,
    Output,
    Overrides,
    Quiet,
    Resume,
    ScenarioName,
    Scheduler,
    StartOver,
)
from landing_cli.errors import UsageError

if TYPE_CHECKING:
    from landing_cli.scenario.load import LoadedScenario
    from landing_cli.studies.isochrone.records import IsochroneRun, StateResult
    from landing_cli.studies.isochrone.verify import IsochroneReport

_COUNTS = (
    "case",
    "facets",
    "reachable",
    "unreachable",
    "unresolved",
    "several",
    "lost_again",
    "reachable_area_m2",
)
_VERIFIED = ("touchdown_miss_m", "touchdown_speed_m_s", "integrators_apart_m", "stored_performance_index")

# where `landing results` finds stored, exports, figures and verify
PACKAGE = "landing_cli.studies.isochrone"
# what `landing results export` writes of a study
TABLES = ("facets", "intervals", "domain", "growth", "summary")
HAS_FACETS = True

_RANGE = re.compile(r"([^:]+):([^:]+)(?::([^:]+))?")


def isochrone(
    scenario: ScenarioName,
    tof_s: Annotated[
        str | None,
        typer.Option(
            "--tof-s",
            metavar="FIRST:LAST[:STEP]",
            help="Times of flight, s, as 400:1600:25. Replaces isochrone.tof_min_s, tof_max_s and step_s.",
        ),
    ] = None,
    output: Output = None,
    jobs: Jobs = None,
    backend: BackendName = Backend.THREADS,
    scheduler: Scheduler = None,
    resume: Resume = False,
    force: StartOver = False,
    overrides: Overrides = None,
    dry_run: DryRun = False,
    as_json: Json = False,
    quiet: Quiet = False,
) -> None:
    """Find the times of flight at which each facet is reachable: an interval, or several.

    Every facet is asked on a grid of times, as `reach run` would; each change of verdict is halved down to
    isochrone.tolerance_s. Writes runs/NAME-reach-isochrone.h5 unless -o says otherwise. The domain at any
    time: landing results export RUN.h5 --table domain --tof-s T.
    """
    plan = work_plan(jobs, backend, scheduler)
    from landing_cli.scenario.load import load

    voice = console.Console(quiet)
    loaded = load(scenario, [*_replacements(tof_s), *(overrides or ())])
    voice.say(f"read {loaded.source}")
    path = output or Path("runs") / f"{loaded.scenario.name}-reach-isochrone.h5"
    if dry_run:
        _say_plan(loaded, path, as_json)
        return
    from landing_cli.studies.isochrone.pipeline import RunOptions, run as run_isochrone

    options = RunOptions(plan=plan, resume=resume, force=force)
    outcome = carry_out(
        lambda progress: run_isochrone(loaded, path, options, progress, voice.say), path, voice, "facets"
    )
    print_run(outcome.run, path, as_json)
    judge_domain(
        outcome.run.lost_items,
        "questions",
        any(result.summary["reachable"] for result in outcome.run.cases),
        path,
        "no facet is reachable at any of these times",
        "lengthen isochrone.tof_max_s (or --tof-s), or raise spacecraft.thrust_max_n",
    )


def print_run(run: IsochroneRun, path: Path, as_json: bool) -> None:
    """Print a study: its initial states, and the growth of their domains; or one JSON object.

    Parameters
    ----------
    run : IsochroneRun
        As it was solved, or read from its file.
    path : Path
        Its file.
    as_json : bool
        Print JSON.
    """
    from landing_cli.studies.isochrone.summary import growth

    mesh = run.asteroid.mesh
    grown = {r.case.name: growth(mesh, r.grid, r.answers) for r in run.cases}
    if as_json:
        cases = [
            {"case": r.case.name, "initial_state": r.case.name, **r.summary, "growth": grown[r.case.name]}
            for r in run.cases
        ]
        console.print_json({"run": str(path), "scenario": run.asteroid.name, "cases": cases})
        return
    rows = []
    for result in run.cases:
        told = {"case": result.case.name, **result.summary}
        first = told["first_tof_s"]
        rows.append([*(told[key] for key in _COUNTS), *(first[key] for key in ("min", "median", "max"))])
    columns = [*_COUNTS, "first_min_s", "first_median_s", "first_max_s"]
    console.print_table(columns, rows, title=f"When facets are reachable: {run.asteroid.name}")
    console.print_text("")
    columns = ["tof_s", *(f"{name}{what}" for name in grown for what in ("", "_km2"))]
    lines = [
        [
            times[0]["tof_s"],
            *(cell for one in times for cell in (one["reachable"], one["reachable_area_m2"] / 1e6)),
        ]
        for times in zip(*grown.values(), strict=True)
    ]
    console.print_table(columns, lines, title="Reachable facets and area by time of flight")


def print_facet(cases: Sequence[StateResult], facet: int, path: Path, as_json: bool) -> None:
    """Print when one facet is reachable: a sentence an initial state, and its numbers.

    Parameters
    ----------
    cases : sequence of StateResult
        Of one study.
    facet : int
        0-based.
    path : Path
        The study's file.
    as_json : bool
        Print JSON.
    """
    from landing_cli.studies.isochrone.facet_story import facet_facts, tell_facet

    told = {result.case.name: tell_facet(result, facet) for result in cases}
    facts = [facet_facts(result, facet) for result in cases]
    shown = [key for key in facts[0] if key not in ("facet", "interval_list")]
    rows = [[key, *(values[key] for values in facts)] for key in shown]
    console.print_told(told, facts, rows, facet, path, as_json)


def print_verification(reports: Sequence[IsochroneReport], path: Path, as_json: bool) -> None:
    """Print what asking and flying again found: a table, or JSON with every check.

    Parameters
    ----------
    reports : sequence of IsochroneReport
        One an initial state.
    path : Path
        The study's file.
    as_json : bool
        Print JSON.
    """
    if as_json:
        console.print_reports_json(reports, path)
        return
    rows: list[list[Any]] = [
        [
            report.case,
            report.questions,
            report.disagreeing,
            report.flights,
            *(max(0.0, report.worst[name].value) if name in report.worst else None for name in _VERIFIED),
            report.polyhedron_miss_m,
            "verified" if report.verified else "FAILED",
        ]
        for report in reports
    ]
    columns = ["case", "asked_again", "disagreeing", "flown", *_VERIFIED, "polyhedron_miss_m", "verdict"]
    console.print_table(columns, rows, title="Verification")


def _replacements(tof_s: str | None) -> list[str]:
    """Turn ``--tof-s`` into the scenario keys that it stands for."""
    if tof_s is None:
        return []
    parts = _RANGE.fullmatch(tof_s)
    if parts is None:
        raise UsageError(
            f"{tof_s[:60]!r} is no range", where="--tof-s", fix="write FIRST:LAST:STEP, as 400:1600:25"
        )
    try:
        numbers = [float(part) for part in parts.groups() if part is not None]
    except ValueError as error:
        told = f"{tof_s[:60]!r} holds what is no number"
        raise UsageError(
            told, where="--tof-s", fix="write FIRST:LAST:STEP in seconds, as 400:1600:25"
        ) from error
    if numbers[1] <= numbers[0]:
        raise UsageError(
            f"{tof_s[:60]!r} ends before it begins", where="--tof-s", fix="give the earlier time first"
        )
    keys = ("tof_min_s", "tof_max_s", "step_s")
    return [f"isochrone.{key}={number:.12g}" for key, number in zip(keys, numbers, strict=False)]


def _say_plan(loaded: LoadedScenario, path: Path, as_json: bool) -> None:
    from landing_cli.scenario.build import build
    from landing_cli.scenario.sections import fixed_stage_reach
    from landing_cli.studies.isochrone.pipeline import grid_of, states_of

    reach = fixed_stage_reach(loaded, "reach isochrone")
    built = build(loaded)
    states = states_of(reach, built)
    grid = grid_of(loaded, states)
    facets = len(built.asteroid.mesh.faces)
    rows = [
        {
            "case": case.name,
            "tof_min_s": float(grid.tof_s[0]),
            "tof_max_s": float(grid.tof_s[-1]),
            "times": len(grid.tof_s),
            "resolution_s": grid.finest_s,
            "facets": facets,
            "grid_solves": facets * len(grid.tof_s),
        }
        for case in states
    ]
    if as_json:
        console.print_json({"run": str(path), "scenario": loaded.scenario.name, "cases": rows})
    else:
        console.print_table(list(rows[0]), [list(row.values()) for row in rows])

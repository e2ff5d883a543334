"""``reach sweep``: the reachable domain over a grid of scenario values."""

from __future__ import annotations

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

if TYPE_CHECKING:
    from landing_cli.reach.verify import CaseReport
    from landing_cli.studies.sweep.grid import Grid
    from landing_cli.studies.sweep.records import CellResult, SweepRun

# where `landing results` finds stored, exports, figures and verify
PACKAGE = "landing_cli.studies.sweep"
# what `landing results export` writes of a sweep
TABLES = ("summary", "facets")
HAS_FACETS = True

_COUNTS = ("reachable", "unreachable", "proved", "unresolved", "reachable_area_m2")
_FLOWN = ("touchdown_miss_m", "touchdown_speed_m_s")

Over = Annotated[
    list[str] | None,
    typer.Option(
        "--over",
        metavar="KEY=VALUES",
        help="An axis: a scenario key, and FIRST:LAST:STEP (inclusive) or VALUE,VALUE,... Repeatable.",
    ),
]


def sweep(
    scenario: ScenarioName,
    over: Over = None,
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
    """Find the reachable domain for every combination of some scenario values.

    Every cell of the grid is what `reach run --set KEY=VALUE ...` finds, bit for bit, without the flights.
    Several times of flight in the scenario are an axis too. Writes runs/NAME-reach-sweep.h5 unless -o says
    otherwise, and prints a table of the cells.
    """
    plan = work_plan(jobs, backend, scheduler)
    from landing_cli.studies.sweep.pipeline import RunOptions, grid_of, run as run_sweep

    voice = console.Console(quiet)
    grid = grid_of(scenario, overrides or (), over or (), voice.say)
    voice.say(f"read {grid.question.source}")
    voice.say(_size(grid))
    path = output or Path("runs") / f"{grid.first.scenario.name}-reach-sweep.h5"
    if dry_run:
        _say_grid(grid, path, as_json)
        return
    options = RunOptions(plan=plan, resume=resume, force=force)
    outcome = carry_out(
        lambda progress: run_sweep(grid, path, options, progress, voice.say),
        path,
        voice,
        "facets",
        "scenario, axes, shape and version",
    )
    print_run(outcome.run, path, as_json)
    judge_domain(
        outcome.run.lost_facets,
        "facets",
        any(case.summary["reachable"] for case in outcome.run.cases),
        path,
        "no facet is reachable in any cell",
        "sweep longer times of flight, or stronger thrust",
    )


def print_run(run: SweepRun, path: Path, as_json: bool) -> None:
    """Print the summary of a sweep: a table, or the JSON object that scripts rely on.

    Parameters
    ----------
    run : SweepRun
        As it was solved, or read from its file.
    path : Path
        Its file.
    as_json : bool
        Print JSON.
    """
    if as_json:
        cases = [
            {"case": case.name, "at": case.at, "initial_state": case.initial_state, **case.summary}
            for case in run.cases
        ]
        top = {"run": str(path), "scenario": run.asteroid.name, "axes": _axes(run.grid)}
        console.print_json({**top, "initial_states": run.grid.states, "cases": cases})
        return
    rows = [
        [
            *case.at.values(),
            case.initial_state,
            *(case.summary[key] for key in _COUNTS),
            *(case.summary["delta_v_m_s"][key] for key in ("min", "median", "max")),
            case.summary["performance_index_m2_s3"]["median"],
            case.summary["paths_through_rock"],
        ]
        for case in run.cases
    ]
    spread = ("dv_min_m_s", "dv_median_m_s", "dv_max_m_s", "j_median_m2_s3", "paths_through_rock")
    columns = [*(axis.name for axis in run.grid.question.axes), "initial_state", *_COUNTS, *spread]
    console.print_table(columns, rows, title=f"Reachable domains: {run.asteroid.name}")


def print_facet(cases: Sequence[CellResult], facet: int, path: Path, as_json: bool) -> None:
    """Print for which cells a facet is reachable: a line an initial state and choice on the other axes.

    Parameters
    ----------
    cases : sequence of CellResult
        Of one sweep.
    facet : int
        0-based.
    path : Path
        The sweep's file.
    as_json : bool
        Print JSON: what is known in every cell.
    """
    from landing_cli.reach.records import Binding, Verdict
    from landing_cli.studies.sweep.facet_answers import facet_lines

    lines = list(facet_lines(cases, facet))
    if as_json:
        words = {"verdict": Verdict, "binding": Binding}
        known: list[dict[str, Any]] = [
            {
                "case": case.name,
                "at": case.at,
                "initial_state": case.initial_state,
                **{
                    name: words[name](int(values[facet])).name.lower() if name in words else values[facet]
                    for name, values in case.columns.items()
                },
            }
            for case in cases
        ]
        console.print_json({"run": str(path), "facet": facet, "cases": known})
        return
    found = sum(sum(line.reachable) for line in lines)
    console.print_text(f"facet {facet} is reachable in {found} of {len(cases)} cases")
    first, *others = (axis.name for axis in cases[0].grid.question.axes)
    rows = [[line.initial_state, *(value for _, value in line.at), line.told] for line in lines]
    console.print_table(["initial_state", *others, f"reachable_at_{first}"], rows)


def print_verification(reports: Sequence[CaseReport], path: Path, as_json: bool) -> None:
    """Print what solving some cases again, and flying them, found: a table, or JSON with every check.

    Parameters
    ----------
    reports : sequence of CaseReport
        One a case that was taken.
    path : Path
        The sweep's file.
    as_json : bool
        Print JSON.
    """
    if as_json:
        console.print_reports_json(reports, path)
        return
    rows = [
        [
            report.case,
            report.facets,
            len(report.faults),
            report.worst["again_performance_index_m2_s3"].value,
            report.flown,
            *(report.worst[name].value if name in report.worst else None for name in _FLOWN),
            "verified" if report.verified else "FAILED",
        ]
        for report in reports
    ]
    columns = ["case", "solved_again", "faults", "j_apart", "flown", *_FLOWN, "verdict"]
    console.print_table(columns, rows, title="Verification")


def _axes(grid: Grid) -> list[dict[str, Any]]:
    return [{"key": axis.key, "name": axis.name, "values": axis.values} for axis in grid.question.axes]


def _size(grid: Grid) -> str:
    shape = " x ".join(f"{len(axis.texts)} {axis.name}" for axis in grid.question.axes)
    return (
        f"{shape} = {grid.question.cells} cells; with {len(grid.states)} initial states and "
        f"{grid.facets} facets {grid.solves} solves; the flights are not stored"
    )


def _say_grid(grid: Grid, path: Path, as_json: bool) -> None:
    if as_json:
        console.print_json(
            {
                "run": str(path),
                "scenario": grid.first.scenario.name,
                "axes": _axes(grid),
                "initial_states": grid.states,
                "cells": grid.question.cells,
                "facets": grid.facets,
                "solves": grid.solves,
            }
        )
        return
    rows = [[axis.name, axis.key, len(axis.texts), _values(axis.texts)] for axis in grid.question.axes]
    console.print_table(["axis", "key", "count", "values"], rows)
    console.print_text(f"{grid.question.cells} cells, {grid.solves} solves")


def _values(texts: Sequence[str]) -> str:
    return ", ".join(texts if len(texts) <= 12 else [*texts[:6], "...", *texts[-3:]])

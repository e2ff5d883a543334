"""``plan observe``: the landing that sees the landmarks it navigates by."""

from __future__ import annotations

import re
from collections.abc import Sequence
from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from landing_cli.cli import console
from landing_cli.cli.carry_out import carry_out, work_plan
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
from landing_cli.cli.plan_source import site_override
from landing_cli.errors import NothingFeasible, PartialResult, UsageError

if TYPE_CHECKING:
    from landing_cli.observe.pipeline import Outcome, Request
    from landing_cli.observe.stored import ObservationEntry, ObserveRun
    from landing_cli.results.verification import FieldReport

# where `landing results` finds stored, exports, figures and verify
PACKAGE = "landing_cli.observe"
# what `landing results export` writes of an observation
TABLES = ("summary", "trajectory", "landmarks", "view")
HAS_FACETS = False

_COUNTS = re.compile(r"[0-9]{1,3}(,[0-9]{1,3})*")


class Objective(StrEnum):
    """What is least."""

    ENERGY = "energy"
    INFORMATION = "information"


def observe(
    scenario: ScenarioName,
    objective: Annotated[
        Objective | None,
        typer.Option(
            "--objective",
            help="What is least: energy (through the paper's waypoints), or information (the navigation "
            "error against the energy). Replaces observe.objective.",
        ),
    ] = None,
    waypoints: Annotated[
        str | None,
        typer.Option(
            "--waypoints",
            metavar="M[,M...]",
            help="Numbers of waypoints, as 0,1,3,7. Replaces observe.steering.waypoints.",
        ),
    ] = None,
    site: Annotated[
        str | None,
        typer.Option(
            "--site",
            metavar="SITE",
            help="Where to land: facet:N, LON,LAT in degrees, or X,Y,Z:NX,NY,NZ in metres.",
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
    """Plan a landing that sees the landmarks it navigates by (Shen et al. 2026).

    Bends the energy-optimal landing towards the landmarks by waypoints, or, with --objective information,
    finds the path that knows best where it is. Writes runs/NAME-plan-observe.h5 unless -o says otherwise.
    """
    work = work_plan(jobs, backend, scheduler)
    voice = console.Console(quiet)
    request = _request(scenario, [*_replacements(objective, waypoints, site), *(overrides or ())], voice)
    path = output or Path("runs") / f"{request.loaded.scenario.name}-plan-observe.h5"
    if dry_run:
        _say_tasks(request, path, as_json)
        return
    from landing_cli.observe.pipeline import RunOptions, run as run_observe

    options = RunOptions(plan=work, resume=resume, force=force)
    outcome = carry_out(
        lambda progress: run_observe(request, path, options, progress, voice.say), path, voice, "observations"
    )
    print_run(outcome.run, path, as_json)
    _judge(outcome, path, voice)


def print_run(run: ObserveRun, path: Path, as_json: bool) -> None:
    """Print observations: a table, or the JSON object that scripts rely on.

    Parameters
    ----------
    run : ObserveRun
        As it was solved, or read from its file.
    path : Path
        Its file.
    as_json : bool
        Print JSON: at the top stand the fields of the last observation of the objective that was asked for;
        ``observations`` lists them all.
    """
    from landing_cli.observe.summary import summarise

    found = [summarise(entry) for entry in run.cases]
    if as_json:
        asked = [one for one in found if one["objective"] == found[0]["objective"]]
        top = {"run": str(path), "scenario": run.asteroid.name, **asked[-1]}
        console.print_json({**top, "observations": found})
        return
    nominal = found[0]["nominal"]
    least = min(one["performance_index_m2_s3"] for one in found)
    rows = [_row("nominal", nominal, least), *(_row(one["name"], one, least) for one in found)]
    columns = list(rows[0])
    title = f"Observations: {run.asteroid.name}, {found[0]['landmarks']} landmarks"
    console.print_table(columns, [list(row.values()) for row in rows], title=title)


def print_verification(reports: Sequence[FieldReport], path: Path, as_json: bool) -> None:
    """Print what the re-flight of paths found: a table, or JSON with every check.

    Parameters
    ----------
    reports : sequence of FieldReport
        One a path.
    path : Path
        The run's file.
    as_json : bool
        Print JSON.
    """
    if as_json:
        console.print_reports_json(reports, path)
        return
    names = ("touchdown_miss_m", "touchdown_speed_m_s", "waypoint_miss_m", "stored_path_m", "stored_visible")
    rows = [
        [
            report.case,
            report.status,
            *(max(0.0, report.worst[name].value) if name in report.worst else None for name in names),
            report.polyhedron_miss_m,
            ("verified" if report.flown else "-") if report.verified else "FAILED",
        ]
        for report in reports
    ]
    columns = ["case", "status", *names, "polyhedron_miss_m", "verdict"]
    console.print_table(columns, rows, title="Verification")


def _row(name: str, summary: dict[str, Any], least: float) -> dict[str, Any]:
    seen = summary["features_seen"]
    return {
        "name": name,
        "status": summary["status"],
        "tof_s": summary["tof_s"],
        "performance_index_m2_s3": summary["performance_index_m2_s3"],
        "above_least_%": 100.0 * (summary["performance_index_m2_s3"] / least - 1.0),
        "propellant_%": 100.0 * summary["propellant_mass_fraction"],
        "clearance_m": summary["clearance_min_m"],
        "distinct": seen["distinct"],
        "mean_in_view": seen["mean_in_view"],
        "longest_gap_s": seen["longest_gap_s"],
        "mean_sigma_m": summary["position_sigma_m"]["mean"],
        "final_sigma_m": summary["position_sigma_m"]["final"],
    }


def _replacements(objective: Objective | None, waypoints: str | None, site: str | None) -> list[str]:
    """Turn options into the scenario keys that they stand for."""
    found = []
    if objective is not None:
        found.append(f"observe.objective={objective.value}")
    if waypoints is not None:
        if not _COUNTS.fullmatch(waypoints):
            told = f"{waypoints[:60]!r} is no list of numbers"
            raise UsageError(told, where="--waypoints", fix="write 3, or 0,1,3,7")
        found.append(f"observe.steering.waypoints=[{waypoints}]")
    if site is not None:
        found.append(site_override(site, "observe"))
    return found


def _request(scenario: str, overrides: Sequence[str], voice: console.Console) -> Request:
    from landing_cli.scenario.load import load
    from landing_cli.scenario.sections import observe_section

    loaded = load(scenario, overrides)
    voice.say(f"read {loaded.source}")
    section = observe_section(loaded)  # before the solvers are imported
    from landing_cli.observe.pipeline import request_of

    request = request_of(loaded, voice.say)
    if section.sensor.kind == "camera" and request.case.sun_direction is None:
        voice.say(
            "illumination is off: the scenario says neither body.sun_direction nor body.orbit "
            "(with epoch_utc and pole)"
        )
    return request


def _say_tasks(request: Request, path: Path, as_json: bool) -> None:
    case = request.case
    rows: list[dict[str, Any]] = [
        {
            "name": task.name,
            "time_of_flight": case.time_of_flight,
            "tof_s": case.tof_s,
            "landmarks": len(case.landmarks.position_m),
            "site_facet": case.frame.facet if case.frame.facet >= 0 else None,
        }
        for task in request.tasks
    ]
    if as_json:
        name = request.loaded.scenario.name
        console.print_json({"run": str(path), "scenario": name, "observations": rows})
    else:
        console.print_table(list(rows[0]), [list(row.values()) for row in rows])


def _judge(outcome: Outcome, path: Path, voice: console.Console) -> None:
    """Turn what was found into the exit code, and say what is wrong with the paths."""
    entries = outcome.run.cases
    if outcome.lost:
        name, reason = next(iter(outcome.lost.items()))
        raise PartialResult(
            f"{len(outcome.lost)} observations were lost to failures ({name}: {reason})",
            where=str(path),
            fix="--resume tries them again",
        )
    refused = [entry for entry in entries if entry.observation.steered.path.status != "planned"]
    if len(refused) == len(entries):
        first = refused[0]
        told = first.observation.steered.path.message
        raise NothingFeasible(
            told if len(refused) == 1 else f"no path: {first.name}: {told}",
            where=str(path),
            fix="change observe.tof_s or observe.initial_state, raise spacecraft.thrust_max_n, or loosen "
            "observe.clearance_m and observe.glide_slope_half_angle_deg",
        )
    for entry in refused:
        path_ = entry.observation.steered.path
        voice.warn(f"{entry.name}: {path_.status}: {path_.message}")
    _warn_of_blindness(entries, voice)


def _warn_of_blindness(entries: Sequence[ObservationEntry], voice: console.Console) -> None:
    nominal = entries[0].observation.nominal.path
    if nominal.status != "planned":
        voice.warn(f"nominal: {nominal.status}: {nominal.message}")
    for entry in entries:
        because = entry.observation.parameters.get("unseen_because")
        if because:
            voice.warn(f"{entry.name} sees no landmark: {because}")

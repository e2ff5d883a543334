"""``plan``: how the spacecraft flies to one site, clear of the terrain."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from types import ModuleType
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
    Scheduler,
    StartOver,
    _complete_scenario,
    new_program,
)
from landing_cli.cli.plan_source import Source, request_of_source
from landing_cli.errors import NothingFeasible, PartialResult, VerificationFailed

if TYPE_CHECKING:
    from landing_cli.plan.pipeline import Outcome, Request
    from landing_cli.plan.stored import PlanRun
    from landing_cli.plan.tasks import PlanTask
    from landing_cli.results.verification import FieldReport

# where `landing results` finds stored, exports, figures and verify
PACKAGE = "landing_cli.plan"
# what `landing results export` writes of a plan
TABLES = ("trajectory", "summary")
HAS_FACETS = False

app = new_program("How a spacecraft flies to one site on an asteroid, clear of the terrain.")

_COLUMNS = (
    "name",
    "status",
    "tof_s",
    "fuel_kg",
    "delta_v_m_s",
    "peak_thrust_n",
    "clearance_surface_m",
    "clearance_vertices_m",
    "landing_angle_deg",
    "cone_entry_s",
    "cpu_s",
)

OptionalScenario = Annotated[
    str | None,
    typer.Argument(
        metavar="[SCENARIO]",
        help="A path, a bare name (found in ., ./configs, the checkout or the package), or - for stdin.",
        autocompletion=_complete_scenario,
    ),
]
SiteName = Annotated[
    str | None,
    typer.Option(
        "--site",
        metavar="SITE",
        help="Where to land: facet:N, LON,LAT in degrees, or X,Y,Z:NX,NY,NZ (position and normal) in metres.",
    ),
]
FacetNumber = Annotated[
    int | None, typer.Option("--facet", min=0, metavar="N", help="Where to land: --site facet:N.")
]
FromRun = Annotated[
    Path | None,
    typer.Option(
        "--from-run",
        metavar="RUN.h5",
        help="Take body, spacecraft, initial state and time of flight from a reach result.",
    ),
]
FromCase = Annotated[
    str | None,
    typer.Option(
        "--case",
        metavar="NAME",
        help="Which of its cases; the one that reaches the facet with the least propellant unless given.",
    ),
]


@dataclass(frozen=True)
class _Way:
    """How a command is carried out and told."""

    output: Path | None
    jobs: int | None
    backend: Backend
    scheduler: str | None
    resume: bool
    force: bool
    dry_run: bool
    as_json: bool
    quiet: bool


@app.command()
def bezier(
    scenario: OptionalScenario = None,
    shortest: Annotated[
        bool, typer.Option("--shortest", help="Search the shortest time that the thruster allows.")
    ] = False,
    site: SiteName = None,
    from_run: FromRun = None,
    facet: FacetNumber = None,
    case: FromCase = None,
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
    """Plan a Bezier curve through two guide points (Lyu et al. 2026) in milliseconds.

    Of all curves that keep clear of the terrain and end in the safety cone, the one of least fuel.
    Writes runs/NAME-plan-bezier.h5 unless -o says otherwise, and prints a table of the plans.
    """
    source = Source(scenario, from_run, case, facet, site, tuple(overrides or ()))
    way = _Way(output, jobs, backend, scheduler, resume, force, dry_run, as_json, quiet)
    told = "bezier --shortest" if shortest else "bezier"
    _carry_out(told, source, way, lambda request: _tasks().bezier_tasks(request, shortest))


@app.command()
def convex(
    scenario: OptionalScenario = None,
    bezier_degree: Annotated[
        list[int] | None,
        typer.Option(
            "--bezier-degree",
            min=6,
            max=14,
            metavar="N",
            help="A Bezier curve of degree N, its N - 5 inner control points free in space. Repeatable.",
        ),
    ] = None,
    site: SiteName = None,
    from_run: FromRun = None,
    facet: FacetNumber = None,
    case: FromCase = None,
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
    """Plan the optimum of fuel or energy with free control, by successive convexification.

    The same constraints as `plan bezier`, under any gravity model. plan.convex.terminal says whether the
    path ends at rest alone or under the paper's eq 4.
    """
    degrees = tuple(dict.fromkeys(bezier_degree or ()))
    source = Source(scenario, from_run, case, facet, site, tuple(overrides or ()))
    way = _Way(output, jobs, backend, scheduler, resume, force, dry_run, as_json, quiet)
    told = " ".join(["convex", *(f"--bezier-degree {degree}" for degree in degrees)])
    _carry_out(told, source, way, lambda request: _tasks().convex_tasks(request, degrees))


@app.command()
def pseudospectral(
    scenario: OptionalScenario = None,
    site: SiteName = None,
    from_run: FromRun = None,
    facet: FacetNumber = None,
    case: FromCase = None,
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
    """Plan by a Gauss pseudospectral transcription, the method the paper compares with."""
    source = Source(scenario, from_run, case, facet, site, tuple(overrides or ()))
    way = _Way(output, jobs, backend, scheduler, resume, force, dry_run, as_json, quiet)
    _carry_out("pseudospectral", source, way, lambda request: _tasks().pseudospectral_tasks(request))


@app.command()
def compare(
    scenario: OptionalScenario = None,
    site: SiteName = None,
    from_run: FromRun = None,
    facet: FacetNumber = None,
    case: FromCase = None,
    output: Output = None,
    backend: BackendName = Backend.THREADS,
    scheduler: Scheduler = None,
    resume: Resume = False,
    force: StartOver = False,
    overrides: Overrides = None,
    dry_run: DryRun = False,
    as_json: Json = False,
    quiet: Quiet = False,
) -> None:
    """Plan by every method and set them side by side (Table 2 of the paper), one after the other.

    Pseudospectral, Bezier, Bezier with free guide points, and free control with and without eq 4's
    conditions at touchdown. The CPU times are of one processor, compiled kernels loaded.
    """
    source = Source(scenario, from_run, case, facet, site, tuple(overrides or ()))
    way = _Way(output, 1, backend, scheduler, resume, force, dry_run, as_json, quiet)
    _carry_out("compare", source, way, lambda request: _tasks().compare_tasks(request))


@app.command()
def sweep(
    scenario: OptionalScenario = None,
    site: SiteName = None,
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
    """Plan Bezier curves from initial positions all round the body: from where can it land.

    The initial state is turned about the spin axis, plan.sweep.longitudes times. Every accepted plan is
    flown again by an integrator; every refusal has its cause.
    """
    source = Source(scenario, None, None, None, site, tuple(overrides or ()))
    way = _Way(output, jobs, backend, scheduler, resume, force, dry_run, as_json, quiet)
    _carry_out("sweep", source, way, lambda request: _tasks().sweep_tasks(request))


def _tasks() -> ModuleType:
    """The tasks of each command; imported once BLAS is held to one thread."""
    from landing_cli.plan import commands

    return commands


def _carry_out(
    command: str, source: Source, way: _Way, tasks_of: Callable[[Request], Sequence[PlanTask]]
) -> None:
    """Read, build, solve, store, print, judge."""
    work = work_plan(way.jobs, way.backend, way.scheduler)
    voice = console.Console(way.quiet)
    request = request_of_source(f"plan {command}", source, voice)
    tasks = tasks_of(request)
    plan = request.loaded.scenario.plan
    if plan is not None and plan.clearance_m == "auto":
        voice.say(f"clearance_m: auto is {tasks[0].case.clearance_m:.4g} m, 1 % of the body's length")
    name = f"{request.loaded.scenario.name}-plan-{command.split()[0]}.h5"
    path = way.output or Path("runs") / name
    if way.dry_run:
        _say_tasks(request, tasks, path, way.as_json)
        return
    from landing_cli.plan.pipeline import RunOptions, run as run_plans

    options = RunOptions(plan=work, resume=way.resume, force=way.force)
    outcome = carry_out(
        lambda progress: run_plans(request, tasks, path, options, progress, voice.say), path, voice, "plans"
    )
    print_run(outcome.run, path, way.as_json)
    _judge(outcome, path, voice)


def print_run(run: PlanRun, path: Path, as_json: bool) -> None:
    """Print plans: a table, or the JSON object that scripts rely on.

    Parameters
    ----------
    run : PlanRun
        As it was solved, or read from its file.
    path : Path
        Its file.
    as_json : bool
        Print JSON: the fields of a single plan stand at the top; ``plans`` lists them all.
    """
    from landing_cli.plan.summary import is_sweep, summarise, summarise_sweep

    plans = [summarise(entry) for entry in run.cases]
    sweep_of = summarise_sweep(run.cases) if is_sweep(run.cases) else None
    if as_json:
        top: dict[str, Any] = {"run": str(path), "scenario": run.asteroid.name}
        if len(plans) == 1:
            top |= plans[0]
        if sweep_of is not None:
            top["sweep"] = sweep_of
        console.print_json({**top, "plans": plans})
        return
    if sweep_of is not None:
        shown = [[key, _short(value)] for key, value in sweep_of.items()]
        console.print_table(["quantity", "value"], shown, title=f"Initial positions: {run.asteroid.name}")
        return
    rows = [[plan[key] for key in _COLUMNS] for plan in plans]
    console.print_table(_COLUMNS, rows, title=f"Plans: {run.asteroid.name}")


def print_verification(reports: Sequence[FieldReport], path: Path, as_json: bool) -> None:
    """Print what the re-flight of plans found: a table, or JSON with every check.

    Parameters
    ----------
    reports : sequence of FieldReport
        One a plan.
    path : Path
        The run's file.
    as_json : bool
        Print JSON.
    """
    if as_json:
        console.print_reports_json(reports, path)
        return
    names = (
        "touchdown_miss_m",
        "touchdown_speed_m_s",
        "thrust_excess",
        "clearance_shortfall_m",
        "stored_path_m",
    )
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
    console.print_table(
        ["case", "status", *names, "polyhedron_miss_m", "verdict"], rows, title="Verification"
    )


def _short(value: object) -> object:
    if isinstance(value, dict):
        return ", ".join(f"{key} {count}" for key, count in value.items()) or "none"
    return value


def _say_tasks(request: Request, tasks: Sequence[PlanTask], path: Path, as_json: bool) -> None:
    rows: list[dict[str, Any]] = [
        {
            "name": task.name,
            "method": task.method,
            "tof_s": task.case.tof_s,
            "clearance_m": task.case.clearance_m,
            "site_facet": task.case.site.facet if task.case.site.facet >= 0 else None,
        }
        for task in tasks
    ]
    if as_json:
        console.print_json({"run": str(path), "scenario": request.loaded.scenario.name, "plans": rows})
    else:
        console.print_table(list(rows[0]), [list(row.values()) for row in rows])


def _judge(outcome: Outcome, path: Path, voice: console.Console) -> None:
    """Turn what was found into the exit code, and say why plans were refused."""
    from landing_cli.plan.summary import is_sweep

    entries = outcome.run.cases
    if outcome.lost:
        name, reason = next(iter(outcome.lost.items()))
        raise PartialResult(
            f"{len(outcome.lost)} plans were lost to failures ({name}: {reason})",
            where=str(path),
            fix="--resume tries them again",
        )
    failed = [e for e in entries if e.plan.parameters.get("reflight", "verified") != "verified"]
    if failed:
        told = f"{len(failed)} accepted plans fail their re-flight: {failed[0].plan.parameters['reflight']}"
        raise VerificationFailed(told, where=str(path))
    refused = [entry for entry in entries if entry.plan.status != "planned"]
    if len(refused) == len(entries):
        first = refused[0]
        what = first.plan.message if len(refused) == 1 else f"no plan: {first.name}: {first.plan.message}"
        raise NothingFeasible(
            what,
            where=str(path),
            fix="lengthen plan.tof_s, raise spacecraft.thrust_max_n, or lower plan.clearance_m",
        )
    if not is_sweep(entries):
        for entry in refused:
            voice.warn(f"{entry.name}: {entry.plan.status}: {entry.plan.message}")

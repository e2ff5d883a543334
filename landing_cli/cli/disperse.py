"""``reach disperse``: how surely each facet is reachable."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

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
    from landing_cli.studies.disperse.records import CaseDispersion, DispersionRun
    from landing_cli.studies.disperse.request import Request
    from landing_cli.studies.disperse.verify import DispersionReport

# where `landing results` finds stored, exports, figures and verify
PACKAGE = "landing_cli.studies.disperse"
# what `landing results export` writes of a dispersion
TABLES = ("facets", "samples", "summary")
HAS_FACETS = True

_COUNTS = ("case", "facets", "samples", "always", "sometimes", "never", "unresolved", "reachable_mean")
_AREAS = ("mean", "p05", "p95")
_CHECKS = (
    "draws_apart",
    "tables_apart",
    "touchdown_miss_m",
    "touchdown_speed_m_s",
    "descent_thrust_excess",
    "final_thrust_excess",
    "ellipsoid_depth",
    "glide_slope_excess_deg",
)


def disperse(
    scenario: ScenarioName,
    samples: Annotated[
        int | None,
        typer.Option("--samples", metavar="N", help="Dispersed starts to draw. Replaces disperse.samples."),
    ] = None,
    seed: Annotated[
        int | None,
        typer.Option("--seed", metavar="K", help="Seed of the draws. Replaces disperse.seed."),
    ] = None,
    cases: Annotated[
        list[str] | None,
        typer.Option(
            "--case",
            metavar="NAME",
            help="Disperse this case only, as north_pole_700s. Repeatable. Replaces disperse.cases.",
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
    """Find how surely each facet is reachable when the start is not known exactly.

    Draws initial state, mass, thrust and GM as the scenario's disperse section spreads them, and solves every
    facet for every sample. The control is optimised again for each sample, as a guidance would that knows
    where it is: the probability is that of the site being reachable, not of one plan hitting it.

    Writes runs/NAME-reach-disperse.h5 unless -o says otherwise. Sample K depends on the seed and K alone.
    """
    plan = work_plan(jobs, backend, scheduler)
    from landing_cli.scenario.load import load

    voice = console.Console(quiet)
    loaded = load(scenario, [*_replacements(samples, seed, cases), *(overrides or ())])
    voice.say(f"read {loaded.source}")
    path = output or Path("runs") / f"{loaded.scenario.name}-reach-disperse.h5"
    from landing_cli.scenario.sections import disperse_section, fixed_stage_reach

    fixed_stage_reach(loaded, "reach disperse"), disperse_section(loaded)  # before the solver is imported
    if dry_run:
        from landing_cli.studies.disperse.request import request_of

        _say_plan(request_of(loaded, say=voice.say), path, as_json)
        return
    from landing_cli.studies.disperse.pipeline import RunOptions, run as run_dispersion

    options = RunOptions(plan=plan, resume=resume, force=force)
    outcome = carry_out(
        lambda progress: run_dispersion(loaded, path, options, progress, voice.say), path, voice, "solves"
    )
    print_run(outcome.run, path, as_json)
    judge_domain(
        outcome.run.lost_solves,
        "solves",
        any(result.summary["reachable_mean"] for result in outcome.run.cases),
        path,
        "no facet is reachable in any sample of any case",
        "lengthen reach.tof_s, or raise spacecraft.thrust_max_n",
    )


def print_run(run: DispersionRun, path: Path, as_json: bool) -> None:
    """Print the summary of a dispersion: a table, or the JSON object that scripts rely on.

    Parameters
    ----------
    run : DispersionRun
        As it was solved, or read from its file.
    path : Path
        Its file.
    as_json : bool
        Print JSON.
    """
    cases = [
        {
            "case": result.case.name,
            "initial_state": result.initial_state,
            "tof_s": result.case.tof_s,
            **result.summary,
        }
        for result in run.cases
    ]
    if as_json:
        console.print_json({"run": str(path), "scenario": run.asteroid.name, "cases": cases})
        return
    rows = [
        [
            *(case[key] for key in _COUNTS),
            *(case["reachable_area_m2"][key] for key in _AREAS),
            case["widest_interval"],
            case["driver"],
            case["driver_correlation"],
        ]
        for case in cases
    ]
    columns = [
        *_COUNTS,
        *(f"area_{key}_m2" for key in _AREAS),
        "widest_interval",
        "area_driver",
        "correlation",
    ]
    console.print_table(columns, rows, title=f"Dispersed domain: {run.asteroid.name}")


def print_facet(cases: Sequence[CaseDispersion], facet: int, path: Path, as_json: bool) -> None:
    """Print how surely one facet is reachable: a sentence a case, and its numbers.

    Parameters
    ----------
    cases : sequence of CaseDispersion
        Of one run.
    facet : int
        0-based.
    path : Path
        The run's file.
    as_json : bool
        Print JSON.
    """
    from landing_cli.studies.disperse.facet_story import facet_facts, tell_facet

    told = {result.case.name: tell_facet(result, facet) for result in cases}
    facts = [facet_facts(result, facet) for result in cases]
    shown = [key for key in facts[0] if key not in ("facet", "correlation")]
    rows = [[key, *(values[key] for values in facts)] for key in shown]
    rows += [
        [f"correlation_{key}", *(values["correlation"][key] for values in facts)]
        for key in facts[0]["correlation"]
    ]
    console.print_told(told, facts, rows, facet, path, as_json)


def print_verification(reports: Sequence[DispersionReport], path: Path, as_json: bool) -> None:
    """Print what the second look at a dispersion found: a table, or JSON with every check.

    Parameters
    ----------
    reports : sequence of DispersionReport
        One a case.
    path : Path
        The run's file.
    as_json : bool
        Print JSON.
    """
    if as_json:
        console.print_reports_json(reports, path)
        return
    rows = [
        [
            report.case,
            report.pairs,
            report.flights,
            *(max(0.0, report.worst[name].value) if name in report.worst else None for name in _CHECKS),
            "verified" if report.verified else "FAILED",
        ]
        for report in reports
    ]
    console.print_table(
        ["case", "solved_again", "flown_again", *_CHECKS, "verdict"], rows, title="Verification"
    )


def _replacements(samples: int | None, seed: int | None, cases: list[str] | None) -> list[str]:
    """Turn options into the scenario keys that they stand for."""
    found = [
        f"disperse.{key}={value}"
        for key, value in (("samples", samples), ("seed", seed))
        if value is not None
    ]
    if cases:
        found.append(f"disperse.cases=[{', '.join(cases)}]")
    return found


def _say_plan(request: Request, path: Path, as_json: bool) -> None:
    facets, samples = len(request.built.asteroid.mesh.faces), request.drawing.samples
    cases = [
        {
            "case": case.name,
            "initial_state": state,
            "tof_s": case.tof_s,
            "facets": facets,
            "samples": samples,
            "solves": facets * samples,
        }
        for state, case in request.cases
    ]
    if as_json:
        console.print_json({"run": str(path), "scenario": request.loaded.scenario.name, "cases": cases})
    else:
        console.print_table(list(cases[0]), [list(case.values()) for case in cases])

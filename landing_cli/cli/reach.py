"""``reach``: where on the asteroid the spacecraft can land."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from landing_cli.cli import console, guard
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
    new_program,
)

if TYPE_CHECKING:
    from landing_cli.reach.stored import CaseResult, ReachRun
    from landing_cli.reach.verify import CaseReport
    from landing_cli.scenario.load import LoadedScenario

_COUNTS = ("case", "facets", "reachable", "unreachable", "proved", "unresolved", "reachable_area_m2")
_TRACE = (
    "N",
    "ratio",
    "seeds",
    "rounds",
    "loops",
    "closed",
    "domain_facets",
    "domain_area_m2",
    "iou",
    "misclassified",
    "missed_components",
)
_BOUNDARY = ("lines", "length_m", "area_within_m2")
_SECTION = ("P_d", "P_r", "P_e", "n", "N", "ratio", "iou", "misclassified")

_VERIFICATION = (
    "case",
    "flown",
    "miss_m",
    "speed_mm_s",
    "over_thrust",
    "in_ellipsoid",
    "over_glide_deg",
    "polyhedron",
    "median_miss_m",
    "worst_miss_m",
    "verdict",
)

# where `landing results` finds stored, exports, figures and verify
PACKAGE = "landing_cli.reach"
# what `landing results export` writes of a run
TABLES = ("facets", "boundary", "trajectory", "summary", "why_not")
HAS_FACETS = True

app = new_program("Where on an asteroid the spacecraft can land.")


@app.command()
def run(
    scenario: ScenarioName,
    output: Output = None,
    jobs: Jobs = None,
    backend: BackendName = Backend.THREADS,
    scheduler: Scheduler = None,
    resume: Resume = False,
    force: StartOver = False,
    overrides: Overrides = None,
    compare: Annotated[
        bool,
        typer.Option("--compare", help="Run section (or trace) and the traversal, and compare them."),
    ] = False,
    dry_run: DryRun = False,
    as_json: Json = False,
    quiet: Quiet = False,
) -> None:
    """Find the reachable domain of every case of a scenario.

    Writes runs/NAME-reach-run.h5 unless -o says otherwise, and prints a table of the cases. The same
    scenario, shape and version again is up to date and not solved again.
    """
    plan = work_plan(jobs, backend, scheduler)
    from landing_cli.scenario.load import load

    voice = console.Console(quiet)
    loaded = load(scenario, overrides or ())
    voice.say(f"read {loaded.source}")
    path = output or Path("runs") / f"{loaded.scenario.name}-reach-run.h5"
    if dry_run:
        _say_plan(loaded, path, as_json)
        return
    from landing_cli.reach.pipeline import RunOptions, run as run_reach

    options = RunOptions(plan=plan, resume=resume, force=force, compare=compare)
    outcome = carry_out(
        lambda progress: run_reach(loaded, path, options, progress, voice.say), path, voice, "facets"
    )
    print_run(outcome.run, path, as_json)
    judge_domain(
        outcome.run.lost_facets,
        "facets",
        any(result.summary["reachable"] for result in outcome.run.cases),
        path,
        "no facet is reachable in any case",
        "lengthen reach.tof_s, or raise spacecraft.thrust_max_n",
    )


def print_run(run: ReachRun, path: Path, as_json: bool) -> None:
    """Print the summary of a run: a table, or the JSON object that scripts rely on.

    Parameters
    ----------
    run : ReachRun
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
            *(case["delta_v_m_s"][key] for key in ("min", "median", "max")),
            case["paths_through_rock"],
        ]
        for case in cases
    ]
    columns = [*_COUNTS, "dv_min_m_s", "dv_median_m_s", "dv_max_m_s", "paths_through_rock"]
    console.print_table(columns, rows, title=f"Reachable domain: {run.asteroid.name}")
    margins = [case for case in cases if case.get("thrust_margin")]
    if margins:
        rows = [
            [
                case["case"],
                *(case["thrust_margin"][key] for key in ("min", "median", "max", "unknown")),
                *((case.get("boundary") or {}).get(key) for key in _BOUNDARY),
            ]
            for case in margins
        ]
        columns = ["case", "margin_min", "margin_median", "margin_max", "unknown", *_BOUNDARY]
        console.print_table(columns, rows, title="Thrust margin 1 - tau, and the boundary tau = 1")
    stages = [case for case in cases if case.get("final_stage_s")]
    if stages:
        rows = [
            [
                case["case"],
                *(case["final_stage_s"][key] for key in ("min", "median", "max")),
                *((case.get("gained_by_free_stage") or {}).get(key) for key in ("facets", "area_m2")),
            ]
            for case in stages
        ]
        columns = ["case", "shortest_s", "median_s", "longest_s", "facets_gained", "area_gained_m2"]
        console.print_table(columns, rows, title="Free final stage, and what it adds to the compared one")
    for method, shown, title in (
        ("section", _SECTION, "Section and expansion"),
        ("trace", _TRACE, "Trace of the boundary"),
    ):
        told = [(case["case"], case[method]) for case in cases if case.get(method)]
        if told:
            rows = [[name, *(facts.get(key) for key in shown)] for name, facts in told]
            console.print_table(["case", *shown], rows, title=title)


def print_facet(cases: Sequence[CaseResult], facet: int, path: Path, as_json: bool) -> None:
    """Print what is known about one facet: a sentence a case, and its columns; vectors for a single case.

    Where it is not reachable, what would make it so is searched for and told.

    Parameters
    ----------
    cases : sequence of CaseResult
        Of one run.
    facet : int
        0-based.
    path : Path
        The run's file.
    as_json : bool
        Print JSON.
    """
    from landing_cli.reach.facet_story import facet_facts, tell_facet
    from landing_cli.reach.relaxation_story import relaxation_facts, tell_relaxations
    from landing_cli.reach.why_not_table import why_not_facet

    told = {result.case.name: tell_facet(result, facet) for result in cases}
    facts = [facet_facts(result, facet) for result in cases]
    reasons = [why_not_facet(result, facet, guard.tell) for result in cases]
    for result, why in zip(cases, reasons, strict=True):
        if why is not None:
            told[result.case.name] += f"; {tell_relaxations(result.case, why)}"
    known = [
        {**values, "why_not": why and relaxation_facts(why)}
        for values, why in zip(facts, reasons, strict=True)
    ]
    shown = [
        key
        for key, value in facts[0].items()
        if key != "facet" and not (isinstance(value, list) and facts[1:])
    ]
    rows = [[key, *(_short(values[key]) for values in facts)] for key in shown]
    console.print_told(told, known, rows, facet, path, as_json)


def print_verification(reports: Sequence[CaseReport], path: Path, as_json: bool) -> None:
    """Print what the re-flight of a run found: a table, or JSON with every check.

    Parameters
    ----------
    reports : sequence of CaseReport
        One a case.
    path : Path
        The run's file.
    as_json : bool
        Print JSON.
    """
    if as_json:
        console.print_reports_json(reports, path)
        return
    console.print_table(
        _VERIFICATION, [_verification_row(report) for report in reports], title="Verification"
    )


def _verification_row(report: CaseReport) -> list[object]:
    def worst(*names: str, scale: float = 1.0) -> float | None:
        values = [report.worst[name].value * scale for name in names if name in report.worst]
        return max(0.0, *values) if values else None

    model = report.polyhedron
    return [
        report.case,
        report.flown,
        worst("touchdown_miss_m"),
        worst("touchdown_speed_m_s", scale=1e3),
        worst("descent_thrust_excess", "final_thrust_excess"),
        worst("ellipsoid_depth"),
        worst("glide_slope_excess_deg"),
        model and model.facets,
        model and model.median_m,
        model and model.worst_m,
        "verified" if report.verified else "FAILED",
    ]


def _short(value: object) -> object:
    """Vectors on one line; scalars as they are."""
    return " ".join(f"{x:.5g}" for x in value) if isinstance(value, list) else value


def _say_plan(loaded: LoadedScenario, path: Path, as_json: bool) -> None:
    from landing_cli.scenario.build import build
    from landing_cli.scenario.sections import reach_section

    reach = reach_section(loaded)
    facets = len(build(loaded).asteroid.mesh.faces)
    cases = [
        {"case": name, "initial_state": state.name, "tof_s": tof_s, "facets": facets}
        for name, state, tof_s in reach.cases()
    ]
    if as_json:
        console.print_json({"run": str(path), "scenario": loaded.scenario.name, "cases": cases})
    else:
        console.print_table(list(cases[0]), [list(case.values()) for case in cases])

"""``reach``: where on the asteroid the spacecraft can land."""

from __future__ import annotations

import os
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from landing_cli.cli import console, guard
from landing_cli.cli.options import (
    Backend,
    Json,
    Output,
    Overrides,
    Quiet,
    ScenarioName,
    new_program,
)
from landing_cli.errors import NothingFeasible, PartialResult

if TYPE_CHECKING:
    from landing_cli.scenario.load import LoadedScenario

app = new_program("Where on an asteroid the spacecraft can land.")

Jobs = Annotated[
    int | None,
    typer.Option("--jobs", "-j", metavar="N", help="Threads or processes; all processors unless given."),
]


@app.command()
def run(
    scenario: ScenarioName,
    output: Output = None,
    jobs: Jobs = None,
    backend: Annotated[Backend, typer.Option(help="Where the solving runs.")] = Backend.THREADS,
    scheduler: Annotated[
        str | None,
        typer.Option(metavar="ADDRESS", help="Dask scheduler, tcp://HOST:8786; for --backend dask."),
    ] = None,
    resume: Annotated[bool, typer.Option("--resume", help="Continue an unfinished run.")] = False,
    force: Annotated[bool, typer.Option("--force", help="Start over, whatever the output holds.")] = False,
    overrides: Overrides = None,
    compare: Annotated[
        bool, typer.Option("--compare", help="Run the section method and the traversal, and compare them.")
    ] = False,
    dry_run: Annotated[
        bool, typer.Option("--dry-run", help="Check everything, say what would run, and stop.")
    ] = False,
    as_json: Json = False,
    quiet: Quiet = False,
) -> None:
    """Find the reachable domain of every case of a scenario.

    Writes runs/NAME-reach-run.h5 unless -o says otherwise, and prints a table of the cases. The same
    scenario, shape and version again is up to date and not solved again.
    """
    from landing_cli.parallel.plan import WorkPlan, pin_blas_threads

    plan = WorkPlan(
        jobs=len(os.sched_getaffinity(0)) if jobs is None else jobs,
        backend=backend.value,
        scheduler=scheduler,
    )
    pin_blas_threads()
    from landing_cli.scenario.load import load

    voice = console.Console(quiet)
    loaded = load(scenario, overrides or ())
    voice.say(f"read {loaded.source}")
    path = output or Path("runs") / f"{loaded.scenario.name}-reach-run.h5"
    if dry_run:
        _say_plan(loaded, path, as_json)
        return
    from landing_cli.reach.pipeline import RunOptions
    from landing_cli.reach.pipeline import run as run_reach

    guard.hint_on_interrupt(f"finished facets are kept: continue with --resume (output {path})")
    options = RunOptions(plan=plan, resume=resume, force=force, compare=compare)
    with voice.progress("facets") as progress:
        outcome = run_reach(loaded, path, options, progress)
    guard.hint_on_interrupt("")
    if outcome.up_to_date:
        voice.say(f"{path} is up to date: same scenario, shape and version (--force solves again)")
    else:
        voice.say(f"wrote {path}")
    _print_summary(outcome.summary, as_json)
    _judge(outcome.summary, outcome.lost_facets)


def _say_plan(loaded: LoadedScenario, path: Path, as_json: bool) -> None:
    from landing_cli.scenario.build import build

    facets = len(build(loaded).asteroid.mesh.faces)
    reach = loaded.scenario.reach
    cases = [
        {"case": name, "initial_state": state.name, "tof_s": tof_s, "facets": facets}
        for name, state, tof_s in reach.cases()
    ]
    if as_json:
        console.print_json({"run": str(path), "scenario": loaded.scenario.name, "cases": cases})
    else:
        console.print_table(list(cases[0]), [list(case.values()) for case in cases])


def _print_summary(summary: dict[str, Any], as_json: bool) -> None:
    if as_json:
        console.print_json(summary)
        return
    columns = [
        "case",
        "facets",
        "reachable",
        "unreachable",
        "unresolved",
        "area_m2",
        "dv_min",
        "dv_median",
        "dv_max",
    ]
    rows = [
        [
            case["case"],
            case["facets"],
            case["reachable"],
            case["unreachable"],
            case["unresolved"],
            case["reachable_area_m2"],
            *(case["delta_v_m_s"][key] for key in ("min", "median", "max")),
        ]
        for case in summary["cases"]
    ]
    console.print_table(columns, rows, title=f"Reachable domain: {summary['scenario']} (delta-v in m/s)")
    sections = [case for case in summary["cases"] if case.get("section")]
    if sections:
        keys = ["P_d", "P_r", "P_e", "n", "N", "ratio", "iou", "misclassified"]
        console.print_table(
            ["case", *keys],
            [[case["case"], *(case["section"].get(key) for key in keys)] for case in sections],
        )


def _judge(summary: dict[str, Any], lost_facets: int) -> None:
    """Turn what the run found into its exit code."""
    if lost_facets:
        raise PartialResult(
            f"{lost_facets} facets were lost to failures and stand as unresolved",
            where=str(summary["run"]),
            fix="--resume tries them again",
        )
    if not any(case["reachable"] for case in summary["cases"]):
        raise NothingFeasible(
            "no facet is reachable in any case",
            where=str(summary["scenario"]),
            fix="lengthen reach.tof_s, or raise spacecraft.thrust_max_n",
        )

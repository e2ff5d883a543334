"""``tour``: which asteroids a spare spacecraft can visit on the way."""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from landing_cli.cli import console
from landing_cli.cli.carry_out import carry_out, say_written, work_plan
from landing_cli.cli.options import (
    Backend,
    BackendName,
    DryRun,
    Force,
    Jobs,
    Json,
    Output,
    Overrides,
    Quiet,
    Resume,
    ScenarioName,
    Scheduler,
    StartOver,
    _complete_scenario,
    new_program,
)
from landing_cli.cli.tour_tables import (
    case_facts,
    print_comparison,
    print_escape,
    print_facts,
    print_search,
)
from landing_cli.errors import NothingFeasible, PartialResult, UsageError

if TYPE_CHECKING:
    from landing_cli.results.verification import Report
    from landing_cli.scenario.load import LoadedTour
    from landing_cli.tour.cases import TourCase
    from landing_cli.tour.escape_records import EscapeRun
    from landing_cli.tour.pipeline import Outcome, RunOptions
    from landing_cli.tour.run_records import TourRun

# where `landing results` finds stored, exports, figures and verify
PACKAGE = "landing_cli.tour"
# what `landing results export` writes of a tour
TABLES = ("summary", "flybys", "trajectory")
HAS_FACETS = False

# what decides whether a result is up to date
_SAME = "scenario, catalogue and version"

app = new_program("Which asteroids a spare spacecraft can fly by on its way.")

# what the Minor Planet Center publishes; the files change daily, so no hash is known beforehand
_PUBLISHED = {
    "nea": "https://www.minorplanetcenter.net/iau/MPCORB/NEA.txt",
    "nea-extended": "https://www.minorplanetcenter.net/Extended_Files/nea_extended.json.gz",
    "mpcorb": "https://www.minorplanetcenter.net/iau/MPCORB/MPCORB.DAT.gz",
}

CatalogueFile = Annotated[
    str | None,
    typer.Option(
        "--catalogue",
        metavar="FILE",
        help="Catalogue to search, instead of tour.catalogue: MPCORB, MPC JSON, SBDB CSV; also gzipped.",
    ),
]
OptionalScenario = Annotated[
    str | None,
    typer.Argument(
        metavar="[SCENARIO]",
        help="A path, a bare name, or - for stdin; ranges of the paper (Fig. 1) unless given.",
        autocompletion=_complete_scenario,
    ),
]


@app.command()
def search(
    scenario: ScenarioName,
    catalogue: CatalogueFile = None,
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
    """Search chains of flybys, and fly each again under the Sun, planets, Earth and Moon.

    Prints the chains that hold, best first, with their N-body delta-v; the two-body number of the search
    beside it is a hint. Writes runs/NAME-tour-search.h5 unless -o says otherwise.
    """
    loaded = _loaded(scenario, catalogue, overrides, quiet)
    _carry_out("search", loaded, output, (jobs, backend, scheduler, resume, force), dry_run, as_json, quiet)


@app.command()
def compare(
    scenario: ScenarioName,
    catalogue: CatalogueFile = None,
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
    """Fly the schemes of Liu et al. (2023), Table 2, and set what comes out beside what is printed.

    Schemes whose asteroids the catalogue does not hold, or tour.targets.exclude leaves out, are told as such.
    """
    loaded = _loaded(scenario, catalogue, overrides, quiet)
    _carry_out("compare", loaded, output, (jobs, backend, scheduler, resume, force), dry_run, as_json, quiet)


@app.command()
def escape(
    scenario: OptionalScenario = None,
    output: Output = None,
    resume: Resume = False,
    force: StartOver = False,
    overrides: Overrides = None,
    dry_run: DryRun = False,
    as_json: Json = False,
    quiet: Quiet = False,
) -> None:
    """Tell what it takes to leave the Moon and the Earth, over altitudes of periapsis and apoapsis.

    Eqs 1-2 of Liu et al. (2023), corrected; two orbits about the Earth are flown in N-body beside them.
    Draw the maps with `landing results plot`.
    """
    from landing_cli.parallel.blas import pin_blas_threads
    from landing_cli.parallel.plan import WorkPlan

    pin_blas_threads()
    from landing_cli.tour.escape_run import escape_request, run_escape
    from landing_cli.tour.pipeline import RunOptions

    voice = console.Console(quiet)
    loaded = None if scenario is None else _loaded(scenario, None, overrides, quiet)
    if loaded is None and overrides:
        raise UsageError("--set changes a scenario, and none is given", fix="name one")
    request = escape_request(loaded)
    path = output or Path("runs") / f"{request.name}-tour-escape.h5"
    if dry_run:
        facts = {"run": str(path), "scenario": request.name, **request.asked()}
        print_facts(facts, as_json)
        return
    outcome = run_escape(request, path, RunOptions(WorkPlan(), resume, force), voice.say)
    say_written(outcome, path, voice, _SAME)
    print_run(outcome.run, path, as_json)


@app.command()
def fetch(
    catalogue: Annotated[
        str | None,
        typer.Argument(
            metavar="[CATALOGUE]",
            help="nea, nea-extended or mpcorb of the Minor Planet Center; nea unless given.",
        ),
    ] = None,
    url: Annotated[str | None, typer.Option(metavar="URL", help="Another file, http or https.")] = None,
    sha256: Annotated[
        str | None,
        typer.Option(metavar="HEX", help="What the file must be; recorded on first use unless given."),
    ] = None,
    folder: Annotated[Path, typer.Option("--into", metavar="FOLDER", help="Where to put it.")] = Path(
        "catalog"
    ),
    force: Force = False,
    quiet: Quiet = False,
) -> None:
    """Download a catalogue of asteroids and check it; then: tour search SCENARIO --catalogue FILE."""
    from landing_cli.sources.catalogue_files import read_catalogue
    from landing_cli.sources.download import fetch_file

    if url is not None and catalogue is not None:
        raise UsageError("name a catalogue or a --url, not both")
    address = url or _PUBLISHED.get(catalogue or "nea")
    if address is None:
        raise UsageError(
            f"no catalogue {catalogue!r} is known", fix=f"take one of {', '.join(_PUBLISHED)}, or give --url"
        )
    voice = console.Console(quiet)
    fetched = fetch_file(address, folder, sha256=sha256, force=force)
    voice.say(f"{'downloaded' if fetched.fresh else 'found'} {fetched.path} (sha256 {fetched.sha256})")
    found = read_catalogue(fetched.path)
    voice.say(f"{len(found)} asteroids, {len(found.bad_rows)} bad rows left out")
    console.print_text(str(fetched.path))


def print_run(run: TourRun | EscapeRun, path: Path, as_json: bool) -> None:
    """Print a run: tables, or the JSON object that scripts rely on.

    Parameters
    ----------
    run : TourRun or EscapeRun
        As it was found, or read from its file.
    path : Path
        Its file.
    as_json : bool
        Print JSON.
    """
    from landing_cli.tour.escape_records import EscapeRun

    if isinstance(run, EscapeRun):
        print_escape(run, path, as_json)
    elif run.facts.kind == "compare":
        print_comparison(run, path, as_json)
    else:
        print_search(run, path, as_json)


def print_verification(reports: Sequence[Report], path: Path, as_json: bool) -> None:
    """Print what the re-flight of chains found: a table, or JSON with every check.

    Parameters
    ----------
    reports : sequence of Report
        One a chain.
    path : Path
        The run's file.
    as_json : bool
        Print JSON.
    """
    if as_json:
        console.print_reports_json(reports, path)
        return
    names = list(dict.fromkeys(name for report in reports for name in report.worst))
    rows = [
        [
            report.case,
            report.status,
            *(report.worst[name].value if name in report.worst else None for name in names),
            ("verified" if report.flown else "-") if report.verified else "FAILED",
        ]
        for report in reports
    ]
    console.print_table(["case", "status", *names, "verdict"], rows, title="Verification")


def _loaded(scenario: str, catalogue: str | None, overrides: Sequence[str] | None, quiet: bool) -> LoadedTour:
    from landing_cli.scenario.load import load_tour

    changed = list(overrides or ())
    if catalogue is not None:
        changed.append(f"tour.catalogue={json.dumps(catalogue)}")
    loaded = load_tour(scenario, changed)
    console.Console(quiet).say(f"read {loaded.source}")
    return loaded


def _carry_out(
    command: str,
    loaded: LoadedTour,
    output: Path | None,
    way: tuple[int | None, Backend, str | None, bool, bool],
    dry_run: bool,
    as_json: bool,
    quiet: bool,
) -> None:
    """Read, search, fly, store, print, judge."""
    jobs, backend, scheduler, resume, force = way
    work = work_plan(jobs, backend, scheduler)
    from landing_cli.tour.cases import tour_case
    from landing_cli.tour.pipeline import Request, RunOptions, run_compare, run_search

    voice = console.Console(quiet)
    case = tour_case(loaded)
    _say_catalogue(case, voice)
    known = set(case.catalogue.designations)
    for name in loaded.scenario.tour.targets.exclude:
        if name not in known:
            voice.say(f"tour.targets.exclude: {name} is not in {case.catalogue.source}")
    path = output or Path("runs") / f"{case.name}-tour-{command}.h5"
    if dry_run:
        print_facts({"run": str(path), **case_facts(case)}, as_json)
        return
    options: RunOptions = RunOptions(work, resume, force)
    request = Request(f"tour {command}", loaded, case)
    run = run_search if command == "search" else run_compare
    outcome = carry_out(
        lambda progress: run(request, path, options, progress, voice.say), path, voice, "flights", _SAME
    )
    print_run(outcome.run, path, as_json)
    _judge(outcome, path, voice)


def _say_catalogue(case: TourCase, voice: console.Console) -> None:
    catalogue = case.catalogue
    voice.say(f"{catalogue.source}: {len(catalogue)} asteroids, of which {len(case.targets)} are targets")
    if catalogue.bad_rows:
        first = catalogue.bad_rows[0]
        voice.warn(
            f"{catalogue.source}: {len(catalogue.bad_rows)} bad rows left out, "
            f"the first in line {first.line}: {first.reason}"
        )


def _judge(outcome: Outcome, path: Path, voice: console.Console) -> None:
    """Turn what was found into the exit code, and say what broke."""
    from landing_cli.tour.run_records import TourRun

    if outcome.lost:
        name, reason = next(iter(outcome.lost.items()))
        raise PartialResult(
            f"{len(outcome.lost)} flights were lost to failures ({name}: {reason})",
            where=str(path),
            fix="--resume tries them again",
        )
    run = outcome.run
    if not isinstance(run, TourRun) or run.facts.kind == "compare":
        return
    if run.broken:
        first = run.broken[0]
        voice.say(
            f"{len(run.broken)} chains broke in N-body and were dropped "
            f"({', '.join(first.targets)}: {first.message})"
        )
    if not run.cases:
        raise NothingFeasible(
            f"no chain of flybys keeps to the limits; {_nearest(run)}",
            where=str(path),
            fix="raise tour.limits.delta_v_m_s, move tour.limits.end_utc, or search a larger --catalogue",
        )


def _nearest(run: TourRun) -> str:
    chain = run.nearest
    if chain is None:
        return "none came near"
    reason = f": {chain.message}" if chain.message else ""
    return f"the nearest is {', '.join(chain.targets)} for {chain.delta_v_m_s:.1f} m/s (two-body){reason}"

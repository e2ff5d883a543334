"""``landing results``: look at, export, draw, verify and compare result files."""

from __future__ import annotations

import importlib
import os
from dataclasses import replace
from enum import StrEnum
from pathlib import Path
from types import ModuleType
from typing import TYPE_CHECKING, Annotated, Any

import typer

from landing_cli.cli import console, disperse, isochrone, observe, plan, reach, sweep, tour
from landing_cli.cli.comparison import Comparison
from landing_cli.cli.options import Force, Jobs, Json, Output, Quiet, ResultFile, new_group
from landing_cli.errors import InputRefused, OutputRefused, UsageError, VerificationFailed

if TYPE_CHECKING:
    from landing_cli.results.store import StoredResult

app = new_group("Look at, export, draw, verify and compare result files.")

# missions whose results this version reads: how to print them; each brings stored, figures, verify
MISSIONS: dict[str, ModuleType] = {
    "reach": reach,
    "plan": plan,
    "observe": observe,
    "tour": tour,
    "isochrone": isochrone,
    "sweep": sweep,
    "dispersion": disperse,
}

CaseName = Annotated[
    str | None,
    typer.Option(
        "--case", metavar="NAME", help="One case, as north_pole_700s or chain_01; all unless given."
    ),
]
Facet = Annotated[
    int | None, typer.Option("--facet", metavar="N", help="One facet, 0-based, in the shape file's order.")
]


class ExportedTable(StrEnum):
    """What can be exported."""

    FACETS = "facets"
    BOUNDARY = "boundary"
    TRAJECTORY = "trajectory"
    SUMMARY = "summary"
    FLYBYS = "flybys"
    LANDMARKS = "landmarks"
    VIEW = "view"
    WHY_NOT = "why_not"
    INTERVALS = "intervals"
    DOMAIN = "domain"
    GROWTH = "growth"
    SAMPLES = "samples"


class ExportFormat(StrEnum):
    """How it can be written."""

    CSV = "csv"
    JSON = "json"
    PLY = "ply"
    VTP = "vtp"
    OBJ = "obj"
    OEM = "oem"


MAP_FORMATS = (ExportFormat.PLY, ExportFormat.VTP, ExportFormat.OBJ)


@app.command()
def show(
    run: ResultFile, case: CaseName = None, facet: Facet = None, as_json: Json = False, quiet: Quiet = False
) -> None:
    """Print what a result holds: the table of its cases, or what is known about one facet, and why."""
    result = _read(run)
    voice = console.Console(quiet)
    identity = result.identity
    voice.say(f"{run}: {identity.command}, version {identity.package_version}, {_state(result)}")
    for name in ("command_line", "finished_utc", "wall_s", "machine"):
        if name in result.provenance:
            voice.say(f"  {name}: {result.provenance[name]}")
    found, printer = _run_of(result), MISSIONS[result.mission]
    cases = _module(result, "exports").chosen_cases(found, case)
    if facet is not None:
        _refuse_facet(result)
        printer.print_facet(cases, facet, run, as_json)
    else:
        printer.print_run(replace(found, cases=cases), run, as_json)


@app.command()
def verify(
    run: ResultFile,
    case: CaseName = None,
    everything: Annotated[
        bool, typer.Option("--all", help="Fly every control under the polyhedron too, not a sample.")
    ] = False,
    jobs: Jobs = None,
    as_json: Json = False,
    quiet: Quiet = False,
) -> None:
    """Fly every stored control again by another integrator and check all that the result says about it.

    In the scenario's own gravity each flight must meet its touchdown to 5 cm and 1 mm/s and keep every
    constraint; what does not ends with exit code 5. How far the same controls miss under the gravity of
    the mesh as a uniform polyhedron, the error of the gravity model, is reported and fails nothing. Of a
    sweep, which stores no flights, some cases are solved again first (--all: every case).
    """
    result = _read(run)
    cases = _module(result, "exports").chosen_cases(_run_of(result), case)
    with console.Console(quiet).progress("flights") as progress:
        reports = _module(result, "verify").verify_run(
            cases,
            polyhedron_for_all=everything,
            jobs=len(os.sched_getaffinity(0)) if jobs is None else jobs,
            progress=progress,
        )
    MISSIONS[result.mission].print_verification(reports, run, as_json)
    failing = [report for report in reports if not report.verified]
    if failing:
        more = f"; {len(failing)} of {len(reports)} cases fail" if len(reports) > 1 else ""
        worst = max(failing, key=lambda report: report.badness)
        raise VerificationFailed(f"{worst.reason}{more}", where=str(run), fix="--json lists every check")


@app.command()
def export(
    run: ResultFile,
    table: Annotated[
        ExportedTable | None,
        typer.Option(help="Of a reach run facets unless given, of a plan trajectory, else summary."),
    ] = None,
    case: CaseName = None,
    facet: Facet = None,
    tof_s: Annotated[
        float | None,
        typer.Option("--tof-s", metavar="T", help="Time of flight of an isochrone study's domain, s."),
    ] = None,
    form: Annotated[
        ExportFormat,
        typer.Option(
            "--format",
            help="csv, json; ply, vtp, obj: a map of facets; vtp, obj: a boundary; oem: a trajectory.",
        ),
    ] = ExportFormat.CSV,
    output: Output = None,
    jobs: Jobs = None,
    force: Force = False,
    quiet: Quiet = False,
) -> None:
    """Write a table, a map or a trajectory of a result for other programs; to stdout without -o.

    The table why_not is searched for when it is asked for: the least change of each thing alone that would
    make an unreachable facet reachable.
    """
    if form is ExportFormat.PLY and output is None:
        raise UsageError("ply is binary", fix="name a file with -o")
    result = _read(run)
    chosen = table or (_usual_table(result, form) if tof_s is None else ExportedTable.DOMAIN)
    _refuse_nonsense(result, chosen, form, facet)
    _refuse_time(chosen, tof_s)
    if output is not None:
        _refuse_existing(output, run, force)
    if chosen is ExportedTable.WHY_NOT:
        data = _why_not(result, form, case, jobs, console.Console(quiet))
    else:
        data = _exported(result, chosen, form, case, facet, tof_s)
    if output is None:
        console.print_text(data.decode())
        return
    from landing_cli.results.disk import replace_file

    replace_file(output, data)
    console.Console(quiet).say(f"wrote {output}")


@app.command()
def plot(
    run: ResultFile,
    case: CaseName = None,
    facet: Facet = None,
    out: Annotated[
        Path | None,
        typer.Option(
            "--out", "-o", metavar="DIR", help="Folder for the figures; beside the result unless given."
        ),
    ] = None,
    as_json: Json = False,
    quiet: Quiet = False,
) -> None:
    """Draw a result as PNG files: an overview and the maps of every case, or the flight to a facet.

    The paths of the figures go to stdout as they are written. With --facet: the histories and the path
    of the stored flight to that facet, flown again.
    """
    found = _read(run)
    if facet is not None:
        _refuse_facet(found)
    stem = _folder(run.parent if out is None else out) / run.stem
    written = []
    for path in _module(found, "figures").write_figures(_run_of(found), stem, case, facet):
        written.append(str(path))
        if not as_json:
            console.print_text(str(path))
    if as_json:
        console.print_json(written)


@app.command()
def diff(
    before: Annotated[Path, typer.Argument(metavar="A.h5", help="The earlier result.")],
    after: Annotated[Path, typer.Argument(metavar="B.h5", help="The later result.")],
    table: Annotated[
        Path | None,
        typer.Option(
            "--table",
            metavar="FILE.csv",
            help="Write what changed as CSV: of reach runs the facets, else the table that is printed.",
        ),
    ] = None,
    plot_it: Annotated[
        bool, typer.Option("--plot", help="Draw maps of what changed as PNG files, one a case (reach runs).")
    ] = False,
    out: Annotated[
        Path | None,
        typer.Option("--out", "-o", metavar="DIR", help="Folder for --plot; beside B.h5 unless given."),
    ] = None,
    force: Force = False,
    as_json: Json = False,
    quiet: Quiet = False,
) -> None:
    """Compare two results: what was asked differently, and what came out differently.

    Of reach runs: facets and area gained and lost, changes of J, of the thrust margin and of what binds;
    --json lists the facets.
    """
    old, new = _read(before), _read(after)
    if old.mission != new.mission:
        raise InputRefused(
            f"{before} is of {old.mission}, {after} of {new.mission}", fix="compare like with like"
        )
    voice = console.Console(quiet)
    for line in new.identity.differences(old.identity):
        voice.say(line)
    equal = old.digest == new.digest
    if equal:
        voice.say("the results are equal in every dataset and attribute")
    comparison = Comparison(_module(new, "compare_runs"), _run_of(old), _run_of(new))
    if out is not None and not plot_it:
        raise UsageError("is the folder for figures", where="--out", fix="add --plot")
    if plot_it and not comparison.has_facets:
        raise UsageError(f"results of {new.mission} have no map of what changed", where="--plot")
    cases = comparison.cases()
    if table is not None:
        for run in (before, after):
            _refuse_existing(table, run, force)
        from landing_cli.results.disk import replace_file

        replace_file(table, comparison.csv().encode())
        voice.say(f"wrote {table}")
    if plot_it:
        stem = _folder(after.parent if out is None else out) / f"{before.stem}-{after.stem}"
        for path in comparison.figures(stem):
            voice.say(f"wrote {path}")
    if as_json:
        console.print_json({"equal": equal, "cases": comparison.with_facets(cases)})
    else:
        console.print_table(list(cases[0]), [list(case.values()) for case in cases])


def _folder(folder: Path) -> Path:
    """Make the folder that figures go to."""
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        fix = "choose another folder with --out"
        raise OutputRefused(f"cannot be made: {error.strerror}", where=str(folder), fix=fix) from error
    return folder


def _usual_table(result: StoredResult, form: ExportFormat) -> ExportedTable:
    if form is ExportFormat.OEM:
        return ExportedTable.TRAJECTORY
    if form in MAP_FORMATS:
        return ExportedTable.FACETS
    return ExportedTable(MISSIONS[result.mission].TABLES[0])


def _refuse_facet(result: StoredResult) -> None:
    if not MISSIONS[result.mission].HAS_FACETS:
        raise UsageError(
            f"a result of {result.mission} has no facets", where="--facet", fix="choose with --case"
        )


def _refuse_nonsense(
    result: StoredResult, table: ExportedTable, form: ExportFormat, facet: int | None
) -> None:
    """Refuse what cannot be written of this result, or not in the chosen form."""
    flown = table is ExportedTable.TRAJECTORY
    mission = MISSIONS[result.mission]
    if table.value not in mission.TABLES:
        what = "map" if form in MAP_FORMATS else f"{table} table"
        raise UsageError(
            f"a result of {result.mission} has no {what}", fix=f"its tables are {', '.join(mission.TABLES)}"
        )
    if facet is not None:
        _refuse_facet(result)
    if form in MAP_FORMATS and table not in (ExportedTable.FACETS, ExportedTable.DOMAIN):
        lines = table is ExportedTable.BOUNDARY
        if not lines or form is ExportFormat.PLY:
            fix = "take csv, json, vtp or obj for it" if lines else "take csv or json for this table"
            raise UsageError(f"{form} is a map of facets, not of a {table}", fix=fix)
    if form is ExportFormat.OEM and not flown:
        raise UsageError(f"an oem holds a trajectory, not the {table} table", fix="take csv or json for it")
    if flown and facet is None and mission.HAS_FACETS:
        raise UsageError("a trajectory leads to one facet", fix="name it with --facet")
    if facet is not None and not flown:
        raise UsageError(f"--facet does not go with the {table} table", fix="add --table trajectory")


def _refuse_time(table: ExportedTable, tof_s: float | None) -> None:
    """A domain is of one time of flight, and nothing else is."""
    if (tof_s is None) == (table is ExportedTable.DOMAIN):
        told = (
            "a domain is of one time of flight"
            if tof_s is None
            else f"--tof-s does not go with the {table} table"
        )
        raise UsageError(told, fix="name it with --tof-s" if tof_s is None else "add --table domain")


def _refuse_existing(path: Path, run: Path, force: bool) -> None:
    if path.exists() and path.samefile(run):
        raise OutputRefused("is the result that is exported", where=str(path), fix="take another name")
    if path.exists() and not force:
        raise OutputRefused("is there already", where=str(path), fix="take another name, or --force")


def _exported(
    result: StoredResult,
    table: ExportedTable,
    form: ExportFormat,
    case: str | None,
    facet: int | None,
    tof_s: float | None,
) -> bytes:
    """Make what is to be written."""
    run, exports = _run_of(result), _module(result, "exports")
    if form in MAP_FORMATS and table is ExportedTable.BOUNDARY:
        return bytes(exports.export_lines(run, form.value, case))
    at = {} if tof_s is None else {"tof_s": tof_s}
    if form in MAP_FORMATS:
        return bytes(exports.export_map(run, form.value, case, **at))
    if table is not ExportedTable.TRAJECTORY:
        return str(exports.export_table(run, table.value, form.value, case, **at)).encode()
    cases = exports.chosen_cases(run, case)
    if len(cases) > 1:
        names = exports.names_of(cases)
        raise UsageError("a trajectory is of one case", where="--case", fix=f"take one of {names}")
    flown = exports.trajectory_of(cases[0], facet)
    if form is not ExportFormat.OEM:
        return str(exports.export_table(run, table.value, form.value, case, flown)).encode()
    from datetime import UTC, datetime

    from landing_cli.scenario.document import parse

    scenario = parse(result.identity.scenario, "the stored scenario").tree
    created = datetime.now(UTC).isoformat()
    return str(exports.export_oem(run, flown, scenario, created)).encode()


def _why_not(
    result: StoredResult, form: ExportFormat, case: str | None, jobs: int | None, voice: console.Console
) -> bytes:
    """Search for what would make facets reachable."""
    from landing_cli.parallel import WorkPlan, pin_blas_threads

    pin_blas_threads()
    plan = WorkPlan(len(os.sched_getaffinity(0)) if jobs is None else jobs)
    run, exports = _run_of(result), _module(result, "exports")
    with voice.progress("facets") as progress:
        return str(exports.export_why_not(run, form.value, case, plan, progress)).encode()


def _read(path: Path) -> StoredResult:
    from landing_cli.results.store import read

    result = read(path)
    if result.mission not in MISSIONS:
        raise InputRefused(
            f"holds a result of '{result.mission}', which this version does not read",
            where=str(path),
            fix=f"it reads those of {', '.join(MISSIONS)}",
        )
    return result


def _module(result: StoredResult, name: str) -> Any:
    """Find the mission's own part of a command."""
    return importlib.import_module(f"{MISSIONS[result.mission].PACKAGE}.{name}")


def _run_of(result: StoredResult) -> Any:
    return _module(result, "stored").run_from_result(result)


def _state(result: StoredResult) -> str:
    return "complete" if result.complete else "incomplete: some parts were lost to failures"

"""``landing results``: look at, export, draw, verify and compare result files."""

from __future__ import annotations

import importlib
from pathlib import Path
from types import ModuleType
from typing import TYPE_CHECKING, Annotated, Any

import typer

from landing_cli.cli import console, reach
from landing_cli.cli.options import Json, Quiet, ResultFile, new_group
from landing_cli.errors import InputRefused

if TYPE_CHECKING:
    from landing_cli.results.store import StoredResult

app = new_group("Look at, export, draw, verify and compare result files.")

# missions whose results this version reads: how to print them; each brings stored, figures, verify
MISSIONS: dict[str, ModuleType] = {"reach": reach}


@app.command()
def show(run: ResultFile, as_json: Json = False, quiet: Quiet = False) -> None:
    """Print what a result holds: the table of its cases, and on stderr how it was made."""
    result = _read(run)
    voice = console.Console(quiet)
    identity = result.identity
    voice.say(f"{run}: {identity.command}, version {identity.package_version}, {_state(result)}")
    for name in ("command_line", "finished_utc", "wall_s", "machine"):
        if name in result.provenance:
            voice.say(f"  {name}: {result.provenance[name]}")
    MISSIONS[result.mission].print_run(_run_of(result), run, as_json)


@app.command()
def diff(
    before: Annotated[Path, typer.Argument(metavar="A.h5", help="The earlier result.")],
    after: Annotated[Path, typer.Argument(metavar="B.h5", help="The later result.")],
    as_json: Json = False,
    quiet: Quiet = False,
) -> None:
    """Compare two results: what was asked differently, and which facets were gained or lost."""
    old, new = _read(before), _read(after)
    if old.mission != new.mission:
        raise InputRefused(
            f"{before} is of {old.mission}, {after} of {new.mission}", fix="compare like with like"
        )
    voice = console.Console(quiet)
    for line in new.identity.differences(old.identity):
        voice.say(line)
    if old.digest == new.digest:
        voice.say("the results are equal in every dataset and attribute")
    cases = _module(new, "compare_runs").compare_runs(_run_of(old), _run_of(new))
    if as_json:
        console.print_json({"equal": old.digest == new.digest, "cases": cases})
    else:
        console.print_table(list(cases[0]), [list(case.values()) for case in cases])


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
    return importlib.import_module(f"landing_cli.{result.mission}.{name}")


def _run_of(result: StoredResult) -> Any:
    return _module(result, "stored").run_from_result(result)


def _state(result: StoredResult) -> str:
    return "complete" if result.complete else "incomplete: some parts were lost to failures"

"""What the command groups share: the style of an app, and options that read alike everywhere."""

from __future__ import annotations

from enum import StrEnum
from pathlib import Path
from typing import Annotated, Any

import typer

from landing_cli import __version__

EPILOG = "Every command takes --traceback (or LANDING_TRACEBACK=1): show where an error came from."
STYLE: dict[str, Any] = {
    "no_args_is_help": True,
    "epilog": EPILOG,
    "context_settings": {"help_option_names": ["-h", "--help"]},
    "rich_markup_mode": None,  # plain help comes in a third of the time
    "pretty_exceptions_enable": False,
}


class Backend(StrEnum):
    """Where the solving runs."""

    THREADS = "threads"
    LOKY = "loky"
    DASK = "dask"


def _complete_scenario(incomplete: str) -> list[str]:
    from landing_cli.scenario.locate import search_folders

    names = {path.name for folder in search_folders() for path in folder.glob("*.yaml")}
    return sorted(name for name in names if name.startswith(incomplete))


def _print_version(wanted: bool) -> None:
    if wanted:
        typer.echo(f"landing {__version__}")
        raise typer.Exit


ScenarioName = Annotated[
    str,
    typer.Argument(
        metavar="SCENARIO",
        help="A path, a bare name (found in ., ./configs, the checkout or the package), or - for stdin.",
        autocompletion=_complete_scenario,
    ),
]
ResultFile = Annotated[Path, typer.Argument(metavar="RUN.h5", help="A result file.")]
Overrides = Annotated[
    list[str] | None,
    typer.Option(
        "--set", metavar="KEY=VALUE", help="Replace a scenario key, dotted: reach.tof_s=900. Repeatable."
    ),
]
Output = Annotated[
    Path | None,
    typer.Option("--output", "-o", metavar="PATH", help="Where to write; a name is chosen unless given."),
]
Jobs = Annotated[
    int | None,
    typer.Option("--jobs", "-j", metavar="N", help="Threads or processes; all processors unless given."),
]
BackendName = Annotated[Backend, typer.Option("--backend", help="Where the solving runs.")]
Scheduler = Annotated[
    str | None,
    typer.Option(
        "--scheduler", metavar="ADDRESS", help="Dask scheduler, tcp://HOST:8786; for --backend dask."
    ),
]
Resume = Annotated[bool, typer.Option("--resume", help="Continue an unfinished run.")]
StartOver = Annotated[bool, typer.Option("--force", help="Start over, whatever the output holds.")]
DryRun = Annotated[bool, typer.Option("--dry-run", help="Check everything, say what would run, and stop.")]
Json = Annotated[bool, typer.Option("--json", help="Print one JSON object for machines.")]
Quiet = Annotated[bool, typer.Option("--quiet", "-q", help="No progress and no remarks on stderr.")]
Force = Annotated[bool, typer.Option("--force", help="Write over what is there.")]
Version = Annotated[
    bool,
    typer.Option("--version", help="Print the version and exit.", callback=_print_version, is_eager=True),
]


def new_group(text: str) -> typer.Typer:
    """Make an empty group of commands.

    Parameters
    ----------
    text : str
        Its help.

    Returns
    -------
    typer.Typer
    """
    return typer.Typer(help=text, add_completion=False, **STYLE)


def new_program(text: str) -> typer.Typer:
    """Make the top of a console script: with ``--version`` and shell completion.

    Parameters
    ----------
    text : str
        Its help.

    Returns
    -------
    typer.Typer
    """
    app = typer.Typer(**STYLE)

    @app.callback(help=text, epilog=EPILOG)
    def top(version: Version = False) -> None:
        pass

    return app

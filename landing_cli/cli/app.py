"""Entry points of the console scripts; nothing is imported before signals are caught."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NoReturn

from landing_cli.cli import guard


def landing() -> NoReturn:
    """Run the umbrella command ``landing``."""
    _run("landing")


def reach() -> NoReturn:
    """Run ``reach``: where on the asteroid the spacecraft can land."""
    _run("reach")


def plan() -> NoReturn:
    """Run ``plan``: how it flies to one site."""
    _run("plan")


def tour() -> NoReturn:
    """Run ``tour``: which asteroids it can visit on the way."""
    _run("tour")


def main(program: str, arguments: Sequence[str]) -> int:
    """Run one console script inside this process.

    Parameters
    ----------
    program : {"landing", "reach", "plan", "tour"}
        Name of the console script.
    arguments : sequence of str
        What follows it on the command line.

    Returns
    -------
    int
        Exit code; errors have been told on stderr.
    """
    return guard.told(lambda rest: _command(program, rest), arguments)


def _run(program: str) -> NoReturn:
    guard.run_process(lambda arguments: _command(program, arguments))


def _command(program: str, arguments: Sequence[str]) -> int:
    from landing_cli.cli.commands import run_command

    return run_command(program, arguments)

"""Which commands there are: a mission or a group is one line in a table."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import typer

from landing_cli.cli import (
    disperse,
    isochrone,
    observe,
    plan,
    rank,
    reach,
    results,
    scenario,
    shapes,
    sweep,
    tour,
)
from landing_cli.cli.options import new_program
from landing_cli.errors import ExitCode

plan.app.command("observe")(observe.observe)
reach.app.command("isochrone")(isochrone.isochrone)
reach.app.command("sweep")(sweep.sweep)
reach.app.command("rank")(rank.rank)
reach.app.command("disperse")(disperse.disperse)

# console script -> its commands
MISSIONS: dict[str, typer.Typer] = {
    "reach": reach.app,
    "plan": plan.app,
    "tour": tour.app,
}
# groups of the umbrella command beside the missions
GROUPS: dict[str, typer.Typer] = {
    "results": results.app,
    "scenario": scenario.app,
    "shapes": shapes.app,
}


def run_command(program: str, arguments: Sequence[str]) -> int:
    """Run one console script.

    Parameters
    ----------
    program : str
        Its name.
    arguments : sequence of str
        What follows it on the command line.

    Returns
    -------
    int
        Exit code; errors are raised.
    """
    app = umbrella() if program == "landing" else MISSIONS[program]
    code: Any = app(args=list(arguments), prog_name=program, standalone_mode=False)
    return code if isinstance(code, int) else ExitCode.OK


def umbrella() -> typer.Typer:
    """Make the ``landing`` command: every mission and every group."""
    app = new_program(
        "Where on an asteroid a spacecraft can land, how it flies there, and what it can visit on the way."
    )
    for name, group in {**MISSIONS, **GROUPS}.items():
        app.add_typer(group, name=name)
    return app

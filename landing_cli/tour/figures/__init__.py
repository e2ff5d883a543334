"""Figures of a tour: the front of chains, their trajectories, and the escape maps."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING

from landing_cli.errors import InputRefused
from landing_cli.results import plotting
from landing_cli.tour.escape_records import EscapeRun
from landing_cli.tour.exports import chosen_cases
from landing_cli.tour.run_records import TourRun
from landing_cli.tour.summary import front

if TYPE_CHECKING:
    from matplotlib.figure import Figure

DRAWN = 6
"""Trajectories of a search that are drawn unless one is chosen: of the front, best first."""


def write_figures(
    run: TourRun | EscapeRun, stem: Path, case: str | None = None, facet: int | None = None
) -> Iterator[Path]:
    """Draw a run: the front and its trajectories; or one chain; the maps of an escape run.

    Parameters
    ----------
    run : TourRun or EscapeRun
        The run.
    stem : Path
        Folder and first part of the names of the files: ``<stem>-front.png``.
    case : str, optional
        This chain, or this map, only.
    facet : None
        Tours have none.

    Yields
    ------
    Path
        Of each file, once it is written.

    Raises
    ------
    InputRefused
        If there is no such chain, or nothing to draw.
    OutputRefused
        If a file cannot be written.
    """
    assert facet is None
    chosen = chosen_cases(run, case)
    if isinstance(run, TourRun) and not any(entry.path is not None for entry in chosen):
        raise InputRefused("holds no flight to draw", where=case or run.facts.name)
    with plotting.style():
        for name, figure in _figures(run, case):
            path = stem.with_name(f"{stem.name}-{name}.png")
            plotting.write_png(figure, path)
            yield path


def _figures(run: TourRun | EscapeRun, case: str | None) -> Iterator[tuple[str, Figure]]:
    if isinstance(run, EscapeRun):
        from landing_cli.tour.figures.escape import escape_figure

        for entry in chosen_cases(run, case):
            yield f"{entry.name}-escape", escape_figure(entry, run.flights)
        return
    from landing_cli.tour.figures.overview import front_figure
    from landing_cli.tour.figures.trajectory import trajectory_figure

    drawn = chosen_cases(run, case)
    if case is None and run.facts.kind == "search":
        yield "front", front_figure(run)
        drawn = front(run.cases)[:DRAWN]
    for entry in drawn:
        if entry.path is not None:
            yield f"{entry.name}-trajectory", trajectory_figure(entry)

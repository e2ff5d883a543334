"""Figures of an observation run (Shen 2026, figs 5 to 13), and fuel against navigation error."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING

from landing_cli.observe.exports import chosen_cases
from landing_cli.observe.stored import ObservationEntry, ObserveRun
from landing_cli.results import plotting

if TYPE_CHECKING:
    from matplotlib.figure import Figure


def write_figures(
    run: ObserveRun, stem: Path, case: str | None = None, facet: int | None = None
) -> Iterator[Path]:
    """Draw a run: all its paths together and each for itself; or one observation.

    Parameters
    ----------
    run : ObserveRun
        The run.
    stem : Path
        Folder and first part of the names of the files: ``<stem>-paths.png``.
    case : str, optional
        This observation only.
    facet : None
        Observations have none.

    Yields
    ------
    Path
        Of each file, once it is written.

    Raises
    ------
    InputRefused
        If there is no such observation.
    OutputRefused
        If a file cannot be written.
    """
    assert facet is None
    chosen = chosen_cases(run, case)
    with plotting.style():
        for name, figure in _figures(chosen, "" if case is None else f"{case}-"):
            path = stem.with_name(f"{stem.name}-{name}.png")
            plotting.write_png(figure, path)
            yield path


def _figures(entries: tuple[ObservationEntry, ...], prefix: str) -> Iterator[tuple[str, Figure]]:
    from landing_cli.observe.figures.costs import costs_figure, front_figure
    from landing_cli.observe.figures.field import field_figure
    from landing_cli.observe.figures.histories import sight_figure, thrust_figure
    from landing_cli.observe.figures.map import map_figure
    from landing_cli.observe.figures.paths import paths_figure

    yield f"{prefix}paths", paths_figure(entries)
    yield f"{prefix}clusters", field_figure(entries)
    for entry in entries:
        yield f"{entry.name}-map", map_figure(entry)
    yield f"{prefix}sight", sight_figure(entries)
    yield f"{prefix}thrust", thrust_figure(entries)
    if sum(entry.observation.objective == "energy" for entry in entries) > 1:
        yield f"{prefix}costs", costs_figure(entries)
    if len(entries) > 1:
        yield f"{prefix}front", front_figure(entries)

"""Figures of an isochrone study: maps of first times, growth of the domain, facets with several intervals."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING

from landing_cli.results import plotting
from landing_cli.studies.isochrone.exports import chosen_cases
from landing_cli.studies.isochrone.records import IsochroneRun, StateResult

if TYPE_CHECKING:
    from matplotlib.figure import Figure


def write_figures(
    run: IsochroneRun, stem: Path, case: str | None = None, facet: int | None = None
) -> Iterator[Path]:
    """Draw a study: its growth, and the map of every initial state; or the times of one facet.

    Parameters
    ----------
    run : IsochroneRun
        The study.
    stem : Path
        Folder and first part of the names of the files: ``<stem>-<state>-isochrones.png``.
    case : str, optional
        This initial state only.
    facet : int, optional
        The times of this facet only.

    Yields
    ------
    Path
        Of each file, once it is written.

    Raises
    ------
    InputRefused
        If there is no such state or facet.
    OutputRefused
        If a file cannot be written.
    """
    cases = chosen_cases(run, case)
    figures = _of_study(cases) if facet is None else _of_facet(cases, facet)
    with plotting.style():
        for name, figure in figures:
            path = stem.with_name(f"{stem.name}-{name}.png")
            plotting.write_png(figure, path)
            yield path


def _of_study(cases: tuple[StateResult, ...]) -> Iterator[tuple[str, Figure]]:
    from landing_cli.results.surface_map import map_surface
    from landing_cli.studies.isochrone.figures.growth import growth_figure
    from landing_cli.studies.isochrone.figures.isochrones import isochrone_figure
    from landing_cli.studies.isochrone.figures.times import several_figure

    yield "growth", growth_figure(cases)
    surface = map_surface(cases[0].case.asteroid.mesh)
    for result in cases:
        yield f"{result.case.name}-isochrones", isochrone_figure(result, surface)
        if result.summary["several"]:
            yield f"{result.case.name}-several", several_figure(result)


def _of_facet(cases: tuple[StateResult, ...], facet: int) -> Iterator[tuple[str, Figure]]:
    from landing_cli.studies.isochrone.figures.times import facet_figure

    yield f"facet{facet}-times", facet_figure(cases, facet)

"""Figures of a reach run: the overview, the maps and the boundary of a case, the flight to a facet."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING

from landing_cli.errors import InputRefused
from landing_cli.reach.exports import chosen_cases
from landing_cli.reach.stored import CaseResult, ReachRun
from landing_cli.results import plotting

if TYPE_CHECKING:
    from matplotlib.figure import Figure


def write_figures(
    run: ReachRun, stem: Path, case: str | None = None, facet: int | None = None
) -> Iterator[Path]:
    """Draw a run: an overview and every case; or one case; or the flight to one facet.

    Parameters
    ----------
    run : ReachRun
        The run.
    stem : Path
        Folder and first part of the names of the files: ``<stem>-<case>-verdict.png``.
    case : str, optional
        This case only.
    facet : int, optional
        The flight to this facet only; needs a case where the run has several.

    Yields
    ------
    Path
        Of each file, once it is written.

    Raises
    ------
    InputRefused
        If there is no such case, or no flight to the facet.
    OutputRefused
        If a file cannot be written.
    """
    cases = chosen_cases(run, case)
    if facet is None:
        figures = _maps(run, cases, overview=case is None)
    elif len(cases) > 1:
        names = ", ".join(c.case.name for c in cases)
        raise InputRefused("a flight belongs to one case", where="--facet", fix=f"add --case, one of {names}")
    else:
        figures = _flight(cases[0], facet)
    with plotting.style():
        for name, figure in figures:
            path = stem.with_name(f"{stem.name}-{name}.png")
            plotting.write_png(figure, path)
            yield path


def _maps(run: ReachRun, cases: tuple[CaseResult, ...], overview: bool) -> Iterator[tuple[str, Figure]]:
    from landing_cli.reach.figures.boundary import boundary_figure
    from landing_cli.reach.figures.case_maps import delta_v_figure, verdict_figure
    from landing_cli.reach.figures.margin_map import margin_figure
    from landing_cli.reach.figures.overview import overview_figure
    from landing_cli.reach.figures.parts import delta_v_scale
    from landing_cli.reach.figures.traced import trace_figure
    from landing_cli.results.surface_map import map_surface

    surface, scale = map_surface(run.asteroid.mesh), delta_v_scale(run)
    if overview:
        yield "overview", overview_figure(run, surface, scale)
    for result in cases:
        name = result.case.name
        yield f"{name}-verdict", verdict_figure(result, surface)
        yield f"{name}-delta-v", delta_v_figure(result, surface, scale)
        if result.level_set is not None:
            yield f"{name}-margin", margin_figure(result, surface)
        if result.boundary is not None and "trace" in result.summary:
            yield f"{name}-boundary", trace_figure(result, result.boundary, surface)
        elif result.boundary is not None:
            yield f"{name}-boundary", boundary_figure(result, result.boundary)


def _flight(result: CaseResult, facet: int) -> Iterator[tuple[str, Figure]]:
    from landing_cli.reach.figures.descent import descent_figure
    from landing_cli.reach.figures.flight import Flight, histories_figure
    from landing_cli.reach.flown import flown_trajectory

    flight = Flight(result, facet, flown_trajectory(result, facet))
    name = f"{result.case.name}-facet{facet}"
    yield f"{name}-histories", histories_figure(flight)
    yield f"{name}-descent", descent_figure(flight)

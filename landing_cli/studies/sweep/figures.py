"""Figures of a sweep: what the axes buy, and on how much of the grid each facet is reachable."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from landing_cli.results import plotting
from landing_cli.studies.sweep.exports import chosen_cases
from landing_cli.studies.sweep.facet_answers import check_facet
from landing_cli.studies.sweep.grid_pages import Quantity, grid_figures
from landing_cli.studies.sweep.records import CellResult, SweepRun

if TYPE_CHECKING:
    from matplotlib.figure import Figure


def write_figures(
    run: SweepRun, stem: Path, case: str | None = None, facet: int | None = None
) -> Iterator[Path]:
    """Draw a sweep: area and velocity increment over the grid, and the share map; or some of its cases.

    Parameters
    ----------
    run : SweepRun
        The sweep.
    stem : Path
        Folder and first part of the names of the files: ``<stem>-area.png``.
    case : str, optional
        Parts of a case's name: of one case its verdicts and velocity increments as `reach run` draws them,
        of several the share map.
    facet : int, optional
        The velocity increment to this facet over the grid.

    Yields
    ------
    Path
        Of each file, once it is written.

    Raises
    ------
    InputRefused
        If there is no such case or facet, or the grid has too many axes to be drawn.
    OutputRefused
        If a file cannot be written.
    """
    cases = chosen_cases(run, case)
    if facet is not None:
        check_facet(cases, facet)
        figures = _of_facet(run, cases, facet)
    elif len(cases) == 1:
        figures = _of_case(cases[0])
    else:
        figures = _of_grid(run, cases, case)
    with plotting.style():
        for name, figure in figures:
            path = stem.with_name(f"{stem.name}-{name}.png")
            plotting.write_png(figure, path)
            yield path


def _of_grid(run: SweepRun, cases: tuple[CellResult, ...], case: str | None) -> Iterator[tuple[str, Figure]]:
    from landing_cli.studies.sweep.share_map import share_figure

    if case is None:
        areas = np.array([case.summary["reachable_area_m2"] for case in run.cases])
        large = areas.max(initial=0.0) >= 1e7
        unit, scale = ("km²", 1e-6) if large else ("1000 m²", 1e-3)
        yield from grid_figures(run, Quantity("area", f"reachable area ({unit})", scale * areas))
        medians = [case.summary["delta_v_m_s"]["median"] for case in run.cases]
        middle = np.array([np.nan if value is None else value for value in medians])
        yield from grid_figures(run, Quantity("delta-v", "median velocity increment (m/s)", middle))
    yield "share" if case is None else f"{case}-share", share_figure(run, cases)


def _of_facet(run: SweepRun, cases: tuple[CellResult, ...], facet: int) -> Iterator[tuple[str, Figure]]:
    values = np.full(len(run.cases), np.nan)
    for case in cases:
        values[case.cell * len(run.grid.states) + case.state] = case.columns["delta_v_m_s"][facet]
    label = f"velocity increment to facet {facet} (m/s)"
    yield from grid_figures(run, Quantity(f"facet{facet}", label, values))


def _of_case(cell: CellResult) -> Iterator[tuple[str, Figure]]:
    from landing_cli.reach.figures.case_maps import delta_v_figure, verdict_figure
    from landing_cli.reach.figures.parts import delta_v_scale
    from landing_cli.reach.stored import ReachRun
    from landing_cli.results.surface_map import map_surface

    result = cell.as_reach()
    surface = map_surface(result.case.asteroid.mesh)
    yield f"{cell.name}-verdict", verdict_figure(result, surface)
    yield f"{cell.name}-delta-v", delta_v_figure(result, surface, delta_v_scale(ReachRun((result,))))

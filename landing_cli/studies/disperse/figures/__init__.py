"""Figures of a dispersion: the probability map, the domain's area, and how the intervals narrow."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING

from landing_cli.errors import InputRefused
from landing_cli.results import plotting
from landing_cli.studies.disperse.exports import chosen_cases
from landing_cli.studies.disperse.facet_story import check_facet
from landing_cli.studies.disperse.records import CaseDispersion, DispersionRun

if TYPE_CHECKING:
    from matplotlib.figure import Figure


def write_figures(
    run: DispersionRun, stem: Path, case: str | None = None, facet: int | None = None
) -> Iterator[Path]:
    """Draw every case of a run, or one case, or how one facet's interval narrows.

    Parameters
    ----------
    run : DispersionRun
        The run.
    stem : Path
        Folder and first part of the names of the files: ``<stem>-<case>-probability.png``.
    case : str, optional
        This case only.
    facet : int, optional
        This facet only; needs a case where the run has several.

    Yields
    ------
    Path
        Of each file, once it is written.

    Raises
    ------
    InputRefused
        If there is no such case or facet.
    OutputRefused
        If a file cannot be written.
    """
    cases = chosen_cases(run, case)
    if facet is None:
        figures = _of_cases(run, cases)
    elif len(cases) > 1:
        names = ", ".join(c.case.name for c in cases)
        raise InputRefused("a facet is of one case", where="--facet", fix=f"add --case, one of {names}")
    else:
        check_facet(cases[0], facet)
        figures = _of_facet(cases[0], facet)
    with plotting.style():
        for name, figure in figures:
            path = stem.with_name(f"{stem.name}-{name}.png")
            plotting.write_png(figure, path)
            yield path


def _of_cases(run: DispersionRun, cases: tuple[CaseDispersion, ...]) -> Iterator[tuple[str, Figure]]:
    from landing_cli.results.surface_map import map_surface
    from landing_cli.studies.disperse.figures.probability_map import probability_figure
    from landing_cli.studies.disperse.figures.samples import area_figure, convergence_figure, telling_facets

    surface = map_surface(run.asteroid.mesh)
    for result in cases:
        name = result.case.name
        yield f"{name}-probability", probability_figure(result, surface)
        yield f"{name}-area", area_figure(result)
        yield f"{name}-convergence", convergence_figure(result, telling_facets(result))


def _of_facet(result: CaseDispersion, facet: int) -> Iterator[tuple[str, Figure]]:
    from landing_cli.studies.disperse.figures.samples import convergence_figure

    yield f"{result.case.name}-facet{facet}-convergence", convergence_figure(result, [facet])

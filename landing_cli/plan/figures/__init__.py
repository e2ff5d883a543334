"""Figures of a plan run: paths over the shape, thrust, histories of a plan, and the map of a sweep."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING

from landing_cli.errors import InputRefused
from landing_cli.plan.exports import chosen_cases
from landing_cli.plan.stored import PlanEntry, PlanRun
from landing_cli.plan.summary import is_sweep
from landing_cli.results import plotting

if TYPE_CHECKING:
    from matplotlib.figure import Figure


def write_figures(
    run: PlanRun, stem: Path, case: str | None = None, facet: int | None = None
) -> Iterator[Path]:
    """Draw a run: all its plans together and each for itself; or one plan; a sweep as a map.

    Parameters
    ----------
    run : PlanRun
        The run.
    stem : Path
        Folder and first part of the names of the files: ``<stem>-paths.png``.
    case : str, optional
        This plan only.
    facet : None
        Plans have none.

    Yields
    ------
    Path
        Of each file, once it is written.

    Raises
    ------
    InputRefused
        If there is no such plan, or nothing to draw.
    OutputRefused
        If a file cannot be written.
    """
    assert facet is None
    chosen = chosen_cases(run, case)
    if not is_sweep(chosen) and not any(entry.plan.control for entry in chosen):
        raise InputRefused(f"holds no path to draw: {chosen[0].plan.message}", where=chosen[0].name)
    with plotting.style():
        for name, figure in _figures(chosen, alone=case is not None):
            path = stem.with_name(f"{stem.name}-{name}.png")
            plotting.write_png(figure, path)
            yield path


def _figures(entries: tuple[PlanEntry, ...], alone: bool) -> Iterator[tuple[str, Figure]]:
    from landing_cli.plan.figures.histories import histories_figure
    from landing_cli.plan.figures.paths import paths_figure
    from landing_cli.plan.figures.profiles import profiles_figure

    drawn = tuple(entry for entry in entries if entry.plan.control)
    if is_sweep(entries) and not alone:
        from landing_cli.plan.figures.sweep import shown_of, sweep_figure

        yield "initial-positions", sweep_figure(entries)
        drawn = shown_of(entries)
        if drawn:
            yield "paths", paths_figure(drawn)
            yield "profiles", profiles_figure(drawn)
        return
    prefix = f"{entries[0].name}-" if alone else ""
    yield f"{prefix}paths", paths_figure(drawn)
    yield f"{prefix}profiles", profiles_figure(drawn)
    for entry in drawn:
        yield f"{entry.name}-histories", histories_figure(entry)
        if entry.plan.method == "bezier":
            from landing_cli.plan.figures.orders import orders_figure

            yield f"{entry.name}-orders", orders_figure(entry)

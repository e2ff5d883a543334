"""What came out differently in two runs, as maps: facets gained and lost, and the change of J."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from landing_cli.reach.compare_runs import Shared, shared_cases
from landing_cli.reach.stored import ReachRun
from landing_cli.results import plotting
from landing_cli.results.surface_map import SurfaceMap, draw_facets, frame_map, map_surface

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

_KINDS = (
    ("gained", plotting.GREEN),
    ("lost", plotting.RED),
    ("reachable in both", plotting.SKY),
    ("reachable in neither", plotting.GREY),
    ("not asked in both", plotting.PALE),
)
_LEFT, _WIDTH = (0.065, 0.56), 0.42


def write_difference(before: ReachRun, after: ReachRun, stem: Path) -> Iterator[Path]:
    """Draw what came out differently, a figure a shared case.

    Parameters
    ----------
    before, after : ReachRun
        Over one surface.
    stem : Path
        Folder and first part of the names of the files: ``<stem>-<case>-diff.png``.

    Yields
    ------
    Path
        Of each file, once it is written.

    Raises
    ------
    InputRefused
        The runs do not compare.
    OutputRefused
        If a file cannot be written.
    """
    surface = map_surface(after.asteroid.mesh)
    with plotting.style():
        for shared in shared_cases(before, after):
            path = stem.with_name(f"{stem.name}-{shared.case}-diff.png")
            plotting.write_png(difference_figure(after, shared, surface), path)
            yield path


def difference_figure(after: ReachRun, shared: Shared, surface: SurfaceMap) -> Figure:
    """Map one shared case: gained and lost facets, and the relative change of J on those in both.

    Parameters
    ----------
    after : ReachRun
        The later run.
    shared : Shared
        The case.
    surface : SurfaceMap
        The mesh in longitude and latitude.

    Returns
    -------
    Figure
    """
    count = len(after.asteroid.mesh.faces)
    figure = plotting.new_figure(11.0, 3.6)
    name = after.asteroid.name[:1].upper() + after.asteroid.name[1:]
    gained, lost = shared.now & ~shared.was, shared.was & ~shared.now
    areas = shared.areas_m2 / 1e6
    plotting.add_title(
        figure,
        f"{name}, {shared.case}: {gained.sum()} facets gained, {lost.sum()} lost",
        f"{areas[gained].sum():.4g} km² gained, {areas[lost].sum():.4g} km² lost",
    )
    panels = [figure.add_axes((left, 0.24, _WIDTH, 0.53)) for left in _LEFT]
    _draw_kinds(figure, panels[0], shared, surface, count)
    _draw_j(figure, panels[1], shared, surface, count)
    for axes, title in zip(panels, ("a  facets", "b  change of J where both reach"), strict=True):
        frame_map(axes)
        axes.set(xlabel="", title=title)
    panels[1].set_ylabel("")
    return figure


def _draw_kinds(figure: Figure, axes: Axes, shared: Shared, surface: SurfaceMap, count: int) -> None:
    from matplotlib.colors import to_rgb
    from matplotlib.patches import Patch

    was, now = shared.was, shared.now
    kind = np.full(count, 4)
    kind[shared.facets] = np.select([now & ~was, was & ~now, was & now], [0, 1, 2], 3)
    colours = np.array([to_rgb(colour) for _, colour in _KINDS])
    draw_facets(axes, surface, colours[kind])
    handles = [
        Patch(facecolor=colour, label=f"{label} ({(kind == i).sum()})")
        for i, (label, colour) in enumerate(_KINDS)
        if (kind == i).any()
    ]
    figure.legend(handles=handles, loc="lower left", bbox_to_anchor=(0.055, 0.0), ncols=4, columnspacing=1.0)


def _draw_j(figure: Figure, axes: Axes, shared: Shared, surface: SurfaceMap, count: int) -> None:
    from matplotlib import colormaps
    from matplotlib.cm import ScalarMappable
    from matplotlib.colors import Normalize, to_rgb

    change: NDArray[np.float64] = np.full(count, np.nan)
    change[shared.facets] = 100.0 * shared.j_change
    known = np.isfinite(change)
    largest = float(np.abs(change[known]).max(initial=0.0)) or 1.0
    scale = ScalarMappable(Normalize(-largest, largest), colormaps["PuOr_r"])
    colours = scale.to_rgba(np.nan_to_num(change))[:, :3]
    colours[~known] = to_rgb(plotting.PALE)
    draw_facets(axes, surface, colours)
    bar = figure.add_axes((0.66, 0.11, 0.22, 0.03))
    figure.colorbar(scale, cax=bar, orientation="horizontal", label="change of J (%)")

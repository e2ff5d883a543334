"""The least thrust level over the surface: its contours, and the boundary of the domain where it is 1."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from landing_cli.body.mesh import FloatArray
from landing_cli.reach.boundary_lines import margin_lines
from landing_cli.reach.figures.case_maps import MapLines, add_bar, case_figure
from landing_cli.reach.figures.parts import KeyEntry, Paint
from landing_cli.reach.level_set import LevelSet, split_surface, trace
from landing_cli.reach.stored import CaseResult
from landing_cli.results import plotting
from landing_cli.results.surface_map import SurfaceMap, lon_lat_deg

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.cm import ScalarMappable
    from matplotlib.figure import Figure

CONTOURS: dict[str, Any] = {"colors": plotting.INK, "linewidths": 0.55, "alpha": 0.75, "zorder": 3}
# Beyond these shares of the thrust bound facets have the colour of the end of the scale.
LOWEST, HIGHEST, STEP = 0.5, 1.5, 0.1


def margin_figure(result: CaseResult, surface: SurfaceMap) -> Figure:
    """Show the least share of the thrust bound that reaches each facet, its contours, and where it is 1.

    Parameters
    ----------
    result : CaseResult
        A case whose every facet was asked for its margin.
    surface : SurfaceMap
        The mesh in longitude and latitude.

    Returns
    -------
    Figure
    """
    mesh, rows = result.case.asteroid.mesh, result.solutions.rows
    level, scale = 1.0 - rows["thrust_margin"], _scale()
    split = split_surface(mesh, level)
    traced = [trace(split, value) for value in contour_levels(level)]
    segments = [line_segments(lines) for lines in traced]
    contours = MapLines(
        line_segments(margin_lines(mesh, rows)), np.concatenate([np.zeros((0, 2, 3)), *segments]), CONTOURS
    )
    figure = case_figure(result, surface, _paint(level, scale), contours, None, 0.32)
    for lines in traced:
        _label(figure.axes[-1], lines)
    add_bar(figure, scale, f"least thrust level tau; contours every {STEP:g}")
    return figure


def contour_levels(level: FloatArray) -> FloatArray:
    """Round levels between the least and the largest, without 1, (k,) float."""
    known = level[np.isfinite(level)]
    if len(known) == 0:
        return np.zeros(0)
    steps = np.arange(np.ceil(known.min() / STEP), np.floor(known.max() / STEP) + 1.0)
    return np.asarray(steps[np.round(steps * STEP, 9) != 1.0] * STEP)


def line_segments(lines: LevelSet) -> FloatArray:
    """Cut lines into their segments, (n, 2, 3) float, m."""
    pairs = np.stack([lines.points_m[:-1], lines.points_m[1:]], axis=1)
    return np.asarray(np.delete(pairs, lines.offsets[1:-1] - 1, axis=0))


def _scale() -> ScalarMappable:
    from matplotlib.cm import ScalarMappable
    from matplotlib.colors import Normalize

    return ScalarMappable(Normalize(LOWEST, HIGHEST), "RdBu_r")


def _paint(level: FloatArray, scale: ScalarMappable) -> Paint:
    from matplotlib.colors import to_rgb

    unknown = ~np.isfinite(level)
    colours = scale.to_rgba(np.nan_to_num(level))[:, :3]
    colours[unknown] = to_rgb(plotting.PALE)
    key = [KeyEntry("unknown", plotting.PALE, False, int(unknown.sum()))] if unknown.any() else []
    return Paint(colours, np.zeros(len(level), dtype=bool), key)


def _label(axes: Axes, lines: LevelSet) -> None:
    """Write a contour's level at the middle of its longest line."""
    from matplotlib.patheffects import withStroke

    counts = np.diff(lines.offsets)
    if len(counts) == 0 or counts.max() < 8:
        return
    line = lines.line(int(np.argmax(counts)))
    east, north = lon_lat_deg(line[len(line) // 2]).tolist()
    text = axes.text(east, north, f"{lines.level:.3g}", fontsize=6.5, ha="center", va="center", zorder=5)
    text.set_path_effects([withStroke(linewidth=1.6, foreground="white")])

"""The verdicts and the velocity increments of a case: three views of the body and a map."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from landing_cli.body.mesh import FloatArray, Mesh
from landing_cli.reach.figures.fields import border_segments, level_segments, spread_over_mesh
from landing_cli.reach.figures.parts import (
    BORDER,
    LEVELS,
    START,
    Paint,
    case_facts,
    case_title,
    draw_arrow_head,
    legend_handles,
    paint_delta_v,
    paint_verdicts,
    scale_levels,
    sights,
)
from landing_cli.reach.stored import CaseResult
from landing_cli.results import plotting
from landing_cli.results.surface_map import (
    SurfaceMap,
    draw_facets,
    draw_map_segments,
    frame_map,
    lon_lat_deg,
)
from landing_cli.results.surface_view import (
    View,
    draw_segments,
    draw_surface,
    draw_triad,
    label_axes,
    reach_m,
    view_from,
)

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.cm import ScalarMappable
    from matplotlib.figure import Figure


def verdict_figure(result: CaseResult, surface: SurfaceMap) -> Figure:
    """Show what is known about every facet of a case.

    Parameters
    ----------
    result : CaseResult
        The case.
    surface : SurfaceMap
        The mesh in longitude and latitude.

    Returns
    -------
    Figure
    """
    fields = spread_over_mesh(result)
    lines = MapLines(facet_border(result), np.zeros((0, 2, 3)))
    return case_figure(result, surface, paint_verdicts(fields), lines, None, 0.435)


def delta_v_figure(result: CaseResult, surface: SurfaceMap, scale: ScalarMappable) -> Figure:
    """Show the velocity increment to every reachable facet of a case.

    Parameters
    ----------
    result : CaseResult
        The case.
    surface : SurfaceMap
        The mesh in longitude and latitude.
    scale : ScalarMappable
        Colours of velocity increments, m/s.

    Returns
    -------
    Figure
    """
    fields = spread_over_mesh(result)
    levels = level_segments(result.case.asteroid.mesh, fields.delta_v_m_s, scale_levels(scale))
    drawn = scale if len(levels) else None
    lines = MapLines(facet_border(result), levels)
    figure = case_figure(result, surface, paint_delta_v(fields, scale), lines, drawn, 0.335)
    add_bar(figure, scale, "velocity increment (m/s)")
    return figure


class MapLines(NamedTuple):
    """Lines over the facets of a map."""

    border: FloatArray  # (n, 2, 3) m, of the domain
    levels: FloatArray  # (n, 2, 3) m
    look: Mapping[str, Any] = LEVELS


def facet_border(result: CaseResult) -> FloatArray:
    """Find the edges between the reachable facets of a case and the others, (n, 2, 3) float, m."""
    fields = spread_over_mesh(result)
    return border_segments(result.case.asteroid.mesh, fields.reachable, fields.asked & ~fields.reachable)


def add_bar(figure: Figure, scale: ScalarMappable, name: str) -> None:
    """Add the colour bar of a case's figure.

    Parameters
    ----------
    figure : Figure
        From :func:`case_figure`, whose legend leaves room for it.
    scale : ScalarMappable
        Its colours.
    name : str
        Quantity and unit.
    """
    bar = figure.colorbar(scale, cax=figure.add_axes((0.70, 0.395, 0.26, 0.022)), orientation="horizontal")
    bar.set_label(name)
    bar.outline.set_visible(False)


def case_figure(
    result: CaseResult,
    surface: SurfaceMap,
    paint: Paint,
    lines: MapLines,
    drawn: ScalarMappable | None,
    legend_top: float,
) -> Figure:
    """Draw three views of the body and a map, with lines and a legend.

    Parameters
    ----------
    result : CaseResult
        The case.
    surface : SurfaceMap
        The mesh in longitude and latitude.
    paint : Paint
        Colours of the facets.
    lines : MapLines
        Lines over them.
    drawn : ScalarMappable or None
        Velocity increments whose levels are among the lines.
    legend_top : float
        Height of the legend's upper edge, as a share of the figure.

    Returns
    -------
    Figure
        Its last axes are the map.
    """
    mesh, start = result.case.asteroid.mesh, result.case.position_m
    border, levels = lines.border, lines.levels
    figure = plotting.new_figure(10.0, 7.35)
    plotting.add_title(figure, case_title(result), case_facts(result.case))
    near, beside = sights(start)
    views = [
        ("a  30° off the initial position", view_from(near)),
        ("b  at right angles to it", view_from(beside)),
        ("c  from the far side, opposite to a", view_from(-near)),
    ]
    for column, (name, view) in enumerate(views):
        axes = figure.add_axes((0.065 + 0.325 * column, 0.525, 0.265, 0.36))
        draw_surface(axes, mesh, view, paint.colours, paint.hatched)
        draw_segments(axes, mesh, view, levels, **lines.look)
        draw_segments(axes, mesh, view, border, **BORDER)
        _frame_view(axes, mesh, view, start, whole_way=column == 1)
        axes.set_title(name)
    axes = figure.add_axes((0.065, 0.06, 0.60, 0.365))
    draw_facets(axes, surface, paint.colours, paint.hatched)
    draw_map_segments(axes, levels, **lines.look)
    draw_map_segments(axes, border, **BORDER)
    axes.plot(*lon_lat_deg(start), **START, clip_on=False, zorder=6)
    frame_map(axes)
    axes.set_title("d  longitude and latitude")
    handles = legend_handles(paint.key, border=bool(len(border)), levels=drawn, counts=True)
    figure.legend(handles=handles, loc="upper left", bbox_to_anchor=(0.685, legend_top), labelspacing=0.7)
    return figure


def _frame_view(axes: Axes, mesh: Mesh, view: View, start: FloatArray, whole_way: bool) -> None:
    """Set the limits of a view, and mark the initial position and the way from it to the surface."""
    reach = 1.15 * reach_m(mesh, view)
    up = start / np.linalg.norm(start)
    low, high = np.full(2, -reach), np.full(2, reach)
    if whole_way:
        low = np.minimum(low, view.flat(start) - 0.12 * reach)
        high = np.maximum(high, view.flat(start) + 0.12 * reach)
        middle, half = 0.5 * (low + high), 0.5 * float((high - low).max())
        low, high = middle - half, middle + half
    axes.set(xlim=(low[0], high[0]), ylim=(low[1], high[1]))
    if view.depth(up) > -1e-9:
        way = view.flat(np.stack([start, up * (mesh.vertices @ up).max()]))
        axes.plot(*way.T, color=plotting.INK, lw=1.0, zorder=5)
        draw_arrow_head(axes, way[1], way[0])
        if (way[0] > low).all() and (way[0] < high - 0.06 * reach).all():
            axes.plot(*way[0], **START, zorder=6)
    label_axes(axes, view)
    draw_triad(axes, view)

"""Paths over the shape, with the guide points of a Bezier curve (Lyu 2026, figs 7, 9, 12, 14)."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from landing_cli.plan.figures.parts import (
    GUIDE,
    START,
    TANGENT,
    TOUCHDOWN,
    FloatArray,
    above_site,
    beside_plane,
    colour_of,
    draw_body,
    facts_of,
    frame,
    label_of,
    path_of,
    thinned,
    title_of,
)
from landing_cli.plan.stored import PlanEntry
from landing_cli.plan.summary import is_sweep
from landing_cli.results import plotting
from landing_cli.results.surface_view import View, draw_path, draw_triad, label_axes, view_from

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

_LISTED = 12  # plans in the legend
_TRIAD = ((0.08, 0.07), 0.06)


def paths_figure(entries: Sequence[PlanEntry]) -> Figure:
    """Draw paths twice: whole, square to the plane of start and site; and their end, with the safety cone.

    Parameters
    ----------
    entries : sequence of PlanEntry
        Plans with a control, at least one.

    Returns
    -------
    Figure
    """
    figure = plotting.new_figure(10.4, 6.1)
    facts = facts_of(entries[0]) if len(entries) == 1 else f"{len(entries)} plans"
    plotting.add_title(figure, title_of(entries), facts)
    case = entries[0].case
    swept = is_sweep(entries)
    whole = view_from((0.0, 0.0, 1.0), (0.0, 1.0, 0.0)) if swept else beside_plane(case)
    paths = [thinned(path_of(entry).position_m) for entry in entries]
    all_points = np.concatenate([*paths, case.asteroid.mesh.vertices])
    for column, view in enumerate((whole, above_site(case) if swept else whole)):
        axes = figure.add_axes((0.07 + 0.49 * column, 0.2, 0.42, 0.63))
        draw_body(axes, case, view)
        if column == 0:
            frame(axes, view.flat(all_points))
            axes.set_title("a  the whole path" if len(entries) == 1 else "a  the whole paths")
        else:
            frame(axes, _neighbourhood(entries, paths, view))
            axes.set_title("b  the end, seen from above the site" if swept else "b  the end")
            if not swept:
                _draw_cone(axes, entries[0], view)
        for index, path in enumerate(paths):
            colour = colour_of(index, len(entries))
            draw_path(axes, case.asteroid.mesh, view, path, color=colour, lw=1.5, zorder=4)
            axes.plot(*view.flat(path[0]), **START, zorder=6)
        if len(entries) == 1:
            _draw_guides(axes, entries[0], view)
        axes.plot(*view.flat(case.site.position_m), **TOUCHDOWN, zorder=6)
        label_axes(axes, view)
        draw_triad(axes, view, *_TRIAD)
    _explain(figure, entries)
    return figure


def _neighbourhood(entries: Sequence[PlanEntry], paths: Sequence[FloatArray], view: View) -> FloatArray:
    """Picture points of the last part of the paths: from a few entry distances before the cone."""
    if is_sweep(entries):  # some begin inside the cone, far away
        near = 0.2 * float(np.ptp(entries[0].case.asteroid.mesh.vertices, axis=0).max())
        return view.flat(entries[0].case.site.position_m) + near * np.array([[-1.0, -1.0], [1.0, 1.0]])
    ends = []
    for entry, path in zip(entries, paths, strict=True):
        away = np.linalg.norm(path - path[-1], axis=1)
        entry_m = float(np.interp(entry.plan.cone_entry_s, np.linspace(0, entry.plan.tof_s, len(path)), away))
        ends.append(path[away <= max(2.5 * entry_m, 10.0 * entry.case.clearance_m)])
    return np.concatenate([view.flat(end) for end in ends])


def _draw_cone(axes: Axes, entry: PlanEntry, view: View) -> None:
    """Fill the safety cone as the eye sees it from beside its axis."""
    from matplotlib.patches import Polygon

    low, high = axes.get_ylim()
    height = 0.7 * (high - low)
    axis = view.flat(entry.case.site.normal)
    length = float(np.linalg.norm(axis))
    if length < 0.2:  # seen from above, it is no triangle
        return
    apex = view.flat(entry.case.site.position_m)
    turn = np.arctan(np.tan(entry.case.cone_half_angle_rad) / length)
    rays = []
    for sign in (-1.0, 1.0):
        c, s = np.cos(sign * turn), np.sin(sign * turn)
        rays.append(apex + height * np.array([[c, -s], [s, c]]) @ (axis / length))
    axes.add_patch(Polygon([apex, *rays], facecolor=plotting.YELLOW, alpha=0.18, lw=0, zorder=2.6))
    for ray in rays:
        axes.plot(*np.stack([apex, ray]).T, color=plotting.ORANGE, lw=1.0, ls=(0, (4, 2)), zorder=2.7)


def _draw_guides(axes: Axes, entry: PlanEntry, view: View) -> None:
    """Mark the guide points and the point where the line of sight grazes the body."""
    parameters = entry.plan.parameters
    marks: tuple[tuple[str, Any], ...] = (
        ("collision_guide_point_m", GUIDE),
        ("obstacle_guide_point_m", GUIDE),
        ("tangent_point_m", TANGENT),
    )
    box = (*axes.get_xlim(), *axes.get_ylim())
    for name, look in marks:
        if name in parameters:
            x, y = view.flat(np.array(parameters[name], dtype=np.float64))
            if box[0] < x < box[1] and box[2] < y < box[3]:
                axes.plot(x, y, **look, zorder=7)


def _explain(figure: Figure, entries: Sequence[PlanEntry]) -> None:
    from matplotlib.lines import Line2D

    shown = range(len(entries)) if len(entries) <= _LISTED else range(0)
    handles = [
        Line2D([], [], color=colour_of(i, len(entries)), lw=1.6, label=label_of(entries[i], entries))
        for i in shown
    ]
    handles += [
        Line2D([], [], **START, label="initial position"),
        Line2D([], [], **TOUCHDOWN, label="site"),
        Line2D([], [], color=plotting.INK, lw=1.6, ls=(0, (0.5, 1.8)), label="behind the body"),
    ]
    if not is_sweep(entries):
        handles.append(Line2D([], [], color=plotting.ORANGE, lw=1.0, ls=(0, (4, 2)), label="safety cone"))
    if len(entries) == 1 and "collision_guide_point_m" in entries[0].plan.parameters:
        handles.append(Line2D([], [], **GUIDE, label="guide points"))
        handles.append(Line2D([], [], **TANGENT, label="grazing point"))
    figure.legend(
        handles=handles,
        loc="lower center",
        ncols=min(8 if is_sweep(entries) else 5, len(handles)),
        bbox_to_anchor=(0.52, 0.005),
    )

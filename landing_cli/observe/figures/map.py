"""One steered path from above: waypoints, field of view, landmarks seen (Shen 2026, figs 9 and 10)."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from landing_cli.body.ray_cast import first_hits
from landing_cli.observe.figures.field import bezier
from landing_cli.observe.figures.parts import (
    CONTROL,
    CURVE,
    SEEN,
    SITE,
    START,
    UNSEEN,
    UNSTEERED,
    WAYPOINT,
    FloatArray,
    label_of,
    scene_box,
    site_points,
    title_of,
    told_of,
)
from landing_cli.observe.observed import ObservedPath
from landing_cli.observe.path_samples import positions_at
from landing_cli.observe.records import ObserveCase
from landing_cli.observe.stored import ObservationEntry
from landing_cli.results import plotting

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

_FOOTPRINTS = 7
_RAYS = 180


def map_figure(entry: ObservationEntry) -> Figure:
    """Draw the unsteered path and a steered one from above, each with what it sees.

    Parameters
    ----------
    entry : ObservationEntry
        The observation.

    Returns
    -------
    Figure
    """
    observation = entry.observation
    figure = plotting.new_figure(10.4, 6.0)
    plotting.add_title(figure, f"{title_of([entry])}, {label_of(entry)}", told_of(observation.steered))
    for column, (name, observed) in enumerate(
        (("a  unsteered", observation.nominal), (f"b  {label_of(entry)}", observation.steered))
    ):
        axes = figure.add_axes((0.07 + 0.49 * column, 0.17, 0.42, 0.68))
        _draw(axes, entry, observed)
        axes.set_title(f"{name}: {observed.seen.distinct} landmarks seen")
        if column == 1:
            axes.plot(*site_points(entry.case, observation.nominal)[:, :2].T, **UNSTEERED)
            _draw_waypoints(axes, entry)
    _explain(figure, entry)
    return figure


def _draw(axes: Axes, entry: ObservationEntry, observed: ObservedPath) -> None:
    case = entry.case
    for outline in footprints(case, observed):
        axes.plot(*outline.T, color=plotting.GREY, lw=0.8, ls=(0, (3, 2)), zorder=1)
    points = case.frame.to_site(case.landmarks.position_m)[:, :2]
    seen = observed.seen.visible.any(axis=0)
    axes.plot(*points[~seen].T, **UNSEEN)
    axes.plot(*points[seen].T, **SEEN)
    axes.plot(*site_points(case, observed)[:, :2].T, color=plotting.BLUE, zorder=4)
    axes.plot(*case.frame.to_site(case.position_m)[:2, None], **START, zorder=5)
    axes.plot(0.0, 0.0, **SITE, zorder=5)
    low, high = scene_box([entry])
    axes.set(xlim=(low[0], high[0]), ylim=(low[1], high[1]), aspect="equal")
    axes.set(xlabel="x, east (m)", ylabel="y, north (m)")


def _draw_waypoints(axes: Axes, entry: ObservationEntry) -> None:
    waypoints = entry.observation.waypoints
    if waypoints is None:
        return
    axes.plot(*bezier(waypoints.curve_m).T, **CURVE)
    axes.plot(*waypoints.curve_m[1:-1].T, **CONTROL)
    axes.plot(*waypoints.position_m.T, **WAYPOINT, zorder=6)


def footprints(case: ObserveCase, observed: ObservedPath) -> list[FloatArray]:
    """Outlines of the field of view on the ground, evenly over the flight.

    Parameters
    ----------
    case : ObserveCase
        With the sensor.
    observed : ObservedPath
        The path it flies along.

    Returns
    -------
    list of (k, 2) float, m, site frame x, y
        NaN where the edge of the field of view passes the body.
    """
    path = observed.path
    times = np.linspace(0.0, path.tof_s, _FOOTPRINTS + 1)[:-1]
    turn = np.linspace(0.0, 2.0 * np.pi, _RAYS + 1)
    half = case.sensor.half_field_of_view_rad
    outlines = []
    for position in positions_at(path, times):
        sight = -case.frame.axes[2] if case.sensor.boresight == "nadir" else case.frame.origin_m - position
        sight = sight / np.linalg.norm(sight)
        across = np.cross(
            sight, case.frame.axes[0] if abs(sight @ case.frame.axes[0]) < 0.9 else case.frame.axes[1]
        )
        across /= np.linalg.norm(across)
        ring = np.outer(np.cos(turn), across) + np.outer(np.sin(turn), np.cross(sight, across))
        rays = np.cos(half) * sight + np.sin(half) * ring
        distance, _ = first_hits(case.surface, np.tile(position, (len(rays), 1)), rays)
        hit = position + np.where(np.isfinite(distance), distance, np.nan)[:, None] * rays
        outlines.append(case.frame.to_site(hit)[:, :2])
    return outlines


def _explain(figure: Figure, entry: ObservationEntry) -> None:
    from matplotlib.lines import Line2D

    handles = [
        Line2D([], [], color=plotting.BLUE, label="path"),
        Line2D([], [], **UNSTEERED, label="unsteered"),
        Line2D([], [], **SEEN, label="landmark seen"),
        Line2D([], [], **UNSEEN, label="not seen"),
        Line2D([], [], color=plotting.GREY, lw=0.8, ls=(0, (3, 2)), label="field of view"),
    ]
    if entry.observation.waypoints is not None:
        handles += [
            Line2D([], [], **WAYPOINT, label="waypoints"),
            Line2D([], [], **CURVE, label="Bezier curve"),
            Line2D([], [], **CONTROL, label="control points"),
        ]
    figure.legend(handles=handles, loc="lower center", ncols=8, bbox_to_anchor=(0.5, 0.0))

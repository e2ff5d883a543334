"""The paths in space over the ground, with the landmarks (Shen 2026, figs 5 and 8)."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from landing_cli.observe.figures.parts import (
    SITE,
    START,
    UNSEEN,
    UNSTEERED,
    colour_of,
    facts_of,
    ground_heights,
    label_of,
    scene_box,
    site_points,
    title_of,
)
from landing_cli.observe.stored import ObservationEntry
from landing_cli.results import plotting

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_GRID = 33
_SECTION = 200


def paths_figure(entries: Sequence[ObservationEntry]) -> Figure:
    """Draw every path in space, and from the south and the west.

    Parameters
    ----------
    entries : sequence of ObservationEntry
        Of one run, at least one.

    Returns
    -------
    Figure
    """
    case = entries[0].case
    figure = plotting.new_figure(10.4, 6.2)
    plotting.add_title(figure, title_of(entries), facts_of(case))
    space: Any = figure.add_axes((0.0, 0.09, 0.57, 0.8), projection="3d")
    low, high = scene_box(entries)
    x, y = np.meshgrid(np.linspace(low[0], high[0], _GRID), np.linspace(low[1], high[1], _GRID))
    heights = ground_heights(case, x.ravel(), y.ravel()).reshape(x.shape)
    space.plot_surface(x, y, heights, color=plotting.ROCK, alpha=0.6, lw=0, antialiased=False, shade=True)
    landmarks = case.frame.to_site(case.landmarks.position_m)
    space.plot(*landmarks.T, **UNSEEN)
    paths = _paths(entries)
    for points, look in paths:
        space.plot(*points.T, **look)
    space.plot(*case.frame.to_site(case.position_m)[:, None], **START)
    space.plot([0.0], [0.0], [0.0], **SITE)
    space.set(xlabel="x, east (m)", ylabel="y, north (m)", zlabel="z, up (m)")
    space.set_box_aspect(None, zoom=0.92)
    space.set_aspect("equal")
    space.view_init(elev=28, azim=-58)
    for row, (axis, name) in enumerate(((0, "x, east (m)"), (1, "y, north (m)"))):
        panel = figure.add_axes((0.655, 0.545 - 0.37 * row, 0.33, 0.29))
        span = np.linspace(low[axis], high[axis], _SECTION)
        ground = np.zeros((_SECTION, 2))
        ground[:, axis] = span
        panel.fill_between(span, ground_heights(case, *ground.T), -1e4, color=plotting.ROCK, alpha=0.6, lw=0)
        panel.plot(landmarks[:, axis], landmarks[:, 2], **UNSEEN)
        for points, look in paths:
            panel.plot(points[:, axis], points[:, 2], **look)
        start = case.frame.to_site(case.position_m)
        panel.plot(start[axis], start[2], **START)
        panel.plot(0.0, 0.0, **SITE)
        bottom = min(0.0, float(landmarks[:, 2].min()), float(min(p[:, 2].min() for p, _ in paths)))
        top = max(float(p[:, 2].max()) for p, _ in paths)
        panel.set(
            xlim=(low[axis], high[axis]), ylim=(bottom - 0.1 * top, 1.1 * top), xlabel=name, ylabel="z (m)"
        )
    _explain(figure, entries)
    return figure


def _paths(entries: Sequence[ObservationEntry]) -> list[tuple[Any, dict[str, Any]]]:
    case = entries[0].case
    unsteered: dict[str, Any] = {**UNSTEERED, "zorder": 5}
    found = [(site_points(case, entries[0].observation.nominal), unsteered)]
    for index, entry in enumerate(entries):
        look: dict[str, Any] = {"color": colour_of(index, len(entries)), "lw": 1.5, "zorder": 4}
        found.append((site_points(case, entry.observation.steered), look))
    return found


def _explain(figure: Figure, entries: Sequence[ObservationEntry]) -> None:
    from matplotlib.lines import Line2D

    handles = [Line2D([], [], **UNSTEERED, label="unsteered")]
    handles += [
        Line2D([], [], color=colour_of(i, len(entries)), label=label_of(entry))
        for i, entry in enumerate(entries)
    ]
    handles += [
        Line2D([], [], **START, label="initial position"),
        Line2D([], [], **SITE, label="site"),
        Line2D([], [], **UNSEEN, label="landmarks"),
    ]
    figure.legend(handles=handles, loc="lower center", ncols=6, bbox_to_anchor=(0.5, 0.0))

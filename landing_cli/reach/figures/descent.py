"""The path of a flight in space: all of it, and its end inside the glide-slope cone."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from landing_cli.body.mesh import FloatArray
from landing_cli.reach.figures.flight import HANDOVER, TOUCHDOWN, Flight
from landing_cli.reach.figures.parts import START
from landing_cli.results import plotting
from landing_cli.results.surface_view import (
    View,
    draw_ellipsoid,
    draw_path,
    draw_surface,
    draw_triad,
    label_axes,
    view_from,
)

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

_ROCK = (0.80, 0.775, 0.735)
_LANDING = (0.94, 0.89, 0.26)


def descent_figure(flight: Flight) -> Figure:
    """Draw the path of a flight over the body, the ellipsoid and the cone of the final stage.

    Parameters
    ----------
    flight : Flight
        The flight.

    Returns
    -------
    Figure
    """
    figure = plotting.new_figure(10.0, 5.9)
    plotting.add_title(figure, flight.title, flight.facts)
    wide, end = _face_on(flight), _beside_cone(flight)
    for column, (view, name) in enumerate(
        [(wide, "a  the whole path, square to its plane"), (end, "b  its end, square to the facet normal")]
    ):
        axes = figure.add_axes((0.07 + 0.49 * column, 0.185, 0.42, 0.65))
        _draw_scene(axes, flight, view)
        if column:
            _draw_cone(axes, flight, view)
            _frame(axes, view.flat(_final(flight)), 0.28)
        else:
            _frame(axes, np.concatenate([view.flat(flight.path.position_m), _outline(flight, view)]), 0.06)
        label_axes(axes, view)
        draw_triad(axes, view)
        axes.set_title(name)
    _explain(figure)
    return figure


def _face_on(flight: Flight) -> View:
    """Look square to the plane through the centre of mass that holds the path best."""
    path = flight.path.position_m
    _, _, directions = np.linalg.svd(path, full_matrices=False)
    sight = directions[2]
    landing_side = sight @ flight.normal
    return view_from(sight if landing_side >= 0.0 else -sight)


def _beside_cone(flight: Flight) -> View:
    """Look square to the facet normal and to where the final stage comes from; the normal is up."""
    coming = flight.path.position_m[flight.handover] - flight.target_m
    sight = np.cross(flight.normal, coming)
    if np.linalg.norm(sight) < 1e-6 * np.linalg.norm(coming):
        sight = np.cross(flight.normal, (1.0, 0.3, 0.2))
    return view_from(sight, flight.normal)


def _final(flight: Flight) -> FloatArray:
    return flight.path.position_m[flight.handover :]


def _outline(flight: Flight, view: View) -> FloatArray:
    axes_m = flight.case.ellipsoid_m
    reach = np.array([np.linalg.norm(axes_m * view.right), np.linalg.norm(axes_m * view.up)])
    return np.stack([-reach, reach])


def _draw_scene(axes: Axes, flight: Flight, view: View) -> None:
    mesh, path = flight.case.asteroid.mesh, flight.path.position_m
    colours = np.tile([_ROCK], (len(mesh.faces), 1))
    colours[flight.facet] = _LANDING
    draw_surface(axes, mesh, view, colours)
    draw_ellipsoid(axes, view, flight.case.ellipsoid_m, color=plotting.BLUE, linewidth=1.0, zorder=2.5)
    cut = flight.handover
    draw_path(axes, mesh, view, path[: cut + 1], color=plotting.INK, lw=1.8, zorder=4)
    draw_path(axes, mesh, view, path[cut:], color=plotting.RED, lw=1.8, zorder=4)
    axes.plot(*view.flat(path[0]), **START, zorder=6)
    axes.plot(*view.flat(path[cut]), **HANDOVER, zorder=6)
    axes.plot(*view.flat(path[-1]), **TOUCHDOWN, zorder=6)


def _draw_cone(axes: Axes, flight: Flight, view: View) -> None:
    """Fill the cone of the glide slope as the eye sees it from the side."""
    from matplotlib.patches import Polygon

    height = 3.0 * float(np.abs((_final(flight) - flight.target_m) @ flight.normal).max())
    width = height * np.tan(flight.case.glide_slope_half_angle_rad)
    apex = view.flat(flight.target_m)
    rim = apex + np.array([[-width, height], [width, height]])
    axes.add_patch(Polygon([apex, *rim], facecolor=plotting.YELLOW, alpha=0.16, lw=0, zorder=2.6))
    for edge in rim:
        axes.plot(*np.stack([apex, edge]).T, color=plotting.ORANGE, lw=1.0, ls=(0, (4, 2)), zorder=2.7)


def _frame(axes: Axes, points: FloatArray, margin: float) -> None:
    """Set equal limits around points."""
    low, high = points.min(axis=0), points.max(axis=0)
    middle, half = 0.5 * (low + high), (0.5 + margin) * float((high - low).max())
    axes.set(xlim=(middle[0] - half, middle[0] + half), ylim=(middle[1] - half, middle[1] + half))


def _explain(figure: Figure) -> None:
    from matplotlib.lines import Line2D
    from matplotlib.patches import Patch

    handles = [
        Line2D([], [], **START, label="initial position"),
        Line2D([], [], color=plotting.INK, lw=1.8, label="descent stage"),
        Line2D([], [], **HANDOVER, label="handover"),
        Line2D([], [], color=plotting.RED, lw=1.8, label="final landing stage"),
        Line2D([], [], **TOUCHDOWN, label="touchdown"),
        Line2D([], [], color=plotting.INK, lw=1.8, ls=(0, (0.5, 1.8)), label="behind the body"),
        Line2D([], [], color=plotting.BLUE, lw=1.0, label="keep-out ellipsoid"),
        Line2D([], [], color=plotting.ORANGE, lw=1.0, ls=(0, (4, 2)), label="glide-slope cone"),
        Patch(color=_LANDING, label="landing facet"),
    ]
    figure.legend(handles=handles, loc="lower center", ncols=5, bbox_to_anchor=(0.52, 0.005))

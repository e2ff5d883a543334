"""Why seventh order: the fifth-order curve of the same boundary conditions beside it (Lyu 2026, fig 3)."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from landing_cli.body.clearance import signed_distances
from landing_cli.flight.bezier_curve import curve_states, first_control_points, last_control_points
from landing_cli.plan.figures.parts import (
    GUIDE,
    LIMIT,
    START,
    TOUCHDOWN,
    FloatArray,
    beside_plane,
    draw_body,
    frame,
    path_of,
    thinned,
    title_of,
)
from landing_cli.plan.records import PlanCase
from landing_cli.plan.stored import PlanEntry
from landing_cli.results import plotting
from landing_cli.results.surface_view import draw_path, draw_triad, label_axes

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

FIFTH = 5


def orders_figure(entry: PlanEntry) -> Figure:
    """Draw a plan and the curve without guide points: paths, and distances to the surface.

    Parameters
    ----------
    entry : PlanEntry
        A Bezier plan.

    Returns
    -------
    Figure
    """
    case, seventh = entry.case, path_of(entry)
    fifth = fifth_order_path(case, seventh.t_s / seventh.t_s[-1])
    depths = [signed_distances(case.surface, path) for path in (fifth, seventh.position_m)]
    figure = plotting.new_figure(10.4, 5.7)
    through = f"cuts {-depths[0].min():.0f} m into the rock" if depths[0].min() < -1.0 else "stays outside"
    told = f"without guide points the path {through}; with them it keeps {entry.plan.clearance_min_m:.1f} m"
    plotting.add_title(figure, title_of([entry]), f"fifth order against seventh: {told}")
    axes = figure.add_axes((0.07, 0.18, 0.42, 0.66))
    view = beside_plane(case)
    draw_body(axes, case, view)
    points = [thinned(fifth), thinned(seventh.position_m)]
    frame(axes, view.flat(np.concatenate([*points, case.asteroid.mesh.vertices])))
    for path, colour in zip(points, (plotting.ORANGE, plotting.BLUE), strict=True):
        draw_path(axes, case.asteroid.mesh, view, path, color=colour, lw=1.6, zorder=4)
    axes.plot(*view.flat(case.position_m), **START, zorder=6)
    axes.plot(*view.flat(case.site.position_m), **TOUCHDOWN, zorder=6)
    for name in ("collision_guide_point_m", "obstacle_guide_point_m"):
        if name in entry.plan.parameters:
            point = np.array(entry.plan.parameters[name], dtype=np.float64)
            axes.plot(*view.flat(point), **GUIDE, zorder=7)
    label_axes(axes, view)
    draw_triad(axes, view)
    axes.set_title("a  paths")
    _draw_distances(figure.add_axes((0.58, 0.18, 0.4, 0.66)), case, seventh.t_s, depths)
    _explain(figure)
    return figure


def fifth_order_path(case: PlanCase, tau: FloatArray) -> FloatArray:
    """The only fifth-order curve of a case's boundary conditions (Lyu 2026, eq 10 with n = 5).

    Parameters
    ----------
    case : PlanCase
        Its states at both ends are met.
    tau : (k,) float
        Shares of the time of flight.

    Returns
    -------
    (k, 3) float, m, body frame
    """
    start = first_control_points(
        FIFTH, case.tof_s, case.position_m, case.velocity_m_s, case.acceleration_m_s2
    )
    end = last_control_points(
        FIFTH,
        case.tof_s,
        case.site.position_m,
        case.landing_velocity_m_s,
        case.landing_acceleration_m_s2,
    )
    return curve_states(np.concatenate([start, end]), case.tof_s, tau)[0]


def _draw_distances(axes: Axes, case: PlanCase, t_s: FloatArray, depths: list[FloatArray]) -> None:
    for depth, colour in zip(depths, (plotting.ORANGE, plotting.BLUE), strict=True):
        axes.plot(t_s, depth, color=colour)
    axes.axhline(case.clearance_m, **LIMIT)
    axes.axhline(0.0, color=plotting.INK, lw=0.9)
    axes.set_yscale("symlog", linthresh=max(10.0, case.clearance_m))
    axes.set(
        xlabel="time (s)", ylabel="signed distance to the surface (m)", title="b  negative inside the body"
    )
    axes.set_xlim(0.0, case.tof_s)
    axes.grid(True)


def _explain(figure: Figure) -> None:
    from matplotlib.lines import Line2D

    handles = [
        Line2D([], [], color=plotting.ORANGE, lw=1.6, label="fifth order"),
        Line2D([], [], color=plotting.BLUE, lw=1.6, label="seventh order"),
        Line2D([], [], **GUIDE, label="guide points"),
        Line2D([], [], **START, label="initial position"),
        Line2D([], [], **TOUCHDOWN, label="site"),
        Line2D([], [], **LIMIT, label="clearance asked"),
    ]
    figure.legend(handles=handles, loc="lower center", ncols=6, bbox_to_anchor=(0.52, 0.005))

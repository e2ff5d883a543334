"""Histories of one plan: state, control and what it keeps clear of (Lyu 2026, figs 10, 11)."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from landing_cli.body.clearance import signed_distances
from landing_cli.plan.assess import measure_trajectory
from landing_cli.plan.figures.parts import LIMIT, FloatArray, facts_of, path_of, title_of
from landing_cli.plan.stored import PlanEntry
from landing_cli.results import plotting

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

_COMPONENTS = (("x", plotting.BLUE), ("y", plotting.ORANGE), ("z", plotting.GREEN))


def histories_figure(entry: PlanEntry) -> Figure:
    """Draw position, velocity, thrust, mass, distance and cone angle of a plan over time.

    Parameters
    ----------
    entry : PlanEntry
        A plan with a control.

    Returns
    -------
    Figure
    """
    path, case, plan = path_of(entry), entry.case, entry.plan
    figure = plotting.new_figure(10.0, 7.6)
    plotting.add_title(figure, title_of([entry]), facts_of(entry))
    grid = figure.add_gridspec(
        3, 2, left=0.075, right=0.985, top=0.875, bottom=0.105, hspace=0.34, wspace=0.2
    )
    panels = [figure.add_subplot(grid[i, k]) for i in range(3) for k in range(2)]
    _draw_vector(panels[0], path.t_s, path.position_m, "|r|")
    panels[0].set_title("a  position, body frame")
    plotting.rule_lengths(panels[0].yaxis, "position")
    _draw_vector(panels[1], path.t_s, path.velocity_m_s, "|v|")
    panels[1].set(ylabel="velocity (m/s)", title="b  velocity relative to the rotating body")
    _draw_vector(panels[2], path.t_s, path.thrust_n, "|T|")
    bound = case.spacecraft.thrust_max_n
    for value in (-bound, bound):
        panels[2].axhline(value, **LIMIT)
    panels[2].set(ylabel="thrust (N)", title="c  thrust, rotating body frame")
    panels[3].plot(path.t_s, path.mass_kg, color=plotting.INK)
    held = ": held constant, as in the paper" if case.mass_model == "constant" else ""
    panels[3].set(ylabel="mass (kg)", title=f"d  mass{held}")
    panels[3].ticklabel_format(useOffset=False)
    _draw_distance(panels[4], entry)
    _draw_cone_angle(panels[5], entry)
    for panel in panels:
        panel.axvspan(plan.cone_entry_s, plan.tof_s, color=plotting.PALE, lw=0, zorder=0)
        panel.set_xlim(0.0, plan.tof_s)
        panel.grid(True)
    for panel in panels[4:]:
        panel.set_xlabel("time (s)")
    _explain(figure)
    return figure


def _draw_vector(axes: Axes, t_s: FloatArray, values: FloatArray, size: str) -> None:
    for i, (name, colour) in enumerate(_COMPONENTS):
        axes.plot(t_s, values[:, i], color=colour, lw=1.4, label=name)
    axes.plot(t_s, np.linalg.norm(values, axis=1), color=plotting.INK, lw=1.9, label=size)
    axes.axhline(0.0, color=plotting.DARK_GREY, lw=0.6)
    axes.legend(ncols=4, loc="best", columnspacing=1.0, handlelength=1.1)


def _draw_distance(axes: Axes, entry: PlanEntry) -> None:
    path = path_of(entry)
    distance = signed_distances(entry.case.surface, path.position_m)
    axes.plot(path.t_s, np.maximum(distance, 1e-3), color=plotting.INK)
    axes.axhline(entry.case.clearance_m, **LIMIT)
    axes.set(yscale="log", ylabel="distance (m)", title="e  distance to the surface")
    axes.set_ylim(max(1.0, 0.02 * entry.case.clearance_m), None)


def _draw_cone_angle(axes: Axes, entry: PlanEntry) -> None:
    """Angle at the site between its normal and the spacecraft."""
    case, path = entry.case, path_of(entry)
    angle = np.degrees(measure_trajectory(case, path, entry.plan.delta_v_m_s).cone_angle_rad)
    axes.plot(path.t_s, angle, color=plotting.INK)
    axes.axhline(np.degrees(case.cone_half_angle_rad), **LIMIT)
    axes.set(ylabel="angle from the normal (°)", ylim=(0.0, None))
    axes.set_title(f"f  angle seen from the site: {entry.plan.landing_angle_deg:.2f}° 1 s before touchdown")


def _explain(figure: Figure) -> None:
    from matplotlib.lines import Line2D
    from matplotlib.patches import Patch

    limit: dict[str, Any] = dict(LIMIT)
    handles = [
        Patch(color=plotting.PALE, label="inside the safety cone"),
        Line2D([], [], **limit, label="limit"),
    ]
    figure.legend(handles=handles, loc="lower center", ncols=2, bbox_to_anchor=(0.53, 0.002))

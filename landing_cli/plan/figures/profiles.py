"""Thrust and distance to the terrain of several plans over time (Lyu 2026, figs 8, 11, 13, 15)."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from landing_cli.body.clearance import signed_distances
from landing_cli.plan.figures.parts import LIMIT, colour_of, facts_of, label_of, path_of, title_of
from landing_cli.plan.stored import PlanEntry
from landing_cli.results import plotting

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_LISTED = 12


def profiles_figure(entries: Sequence[PlanEntry]) -> Figure:
    """Draw the thrust and the distance to the surface of plans over time.

    Parameters
    ----------
    entries : sequence of PlanEntry
        Plans with a control, at least one.

    Returns
    -------
    Figure
    """
    figure = plotting.new_figure(9.6, 6.6)
    facts = facts_of(entries[0]) if len(entries) == 1 else f"{len(entries)} plans"
    plotting.add_title(figure, title_of(entries), facts)
    grid = figure.add_gridspec(2, 1, left=0.08, right=0.985, top=0.87, bottom=0.15, hspace=0.27)
    thrust, distance = (figure.add_subplot(grid[i]) for i in range(2))
    case = entries[0].case
    for index, entry in enumerate(entries):
        path, colour = path_of(entry), colour_of(index, len(entries))
        label = label_of(entry, entries) if len(entries) <= _LISTED else None
        thrust.plot(path.t_s, np.linalg.norm(path.thrust_n, axis=1), color=colour, lw=1.5, label=label)
        clearance = np.maximum(signed_distances(case.surface, path.position_m), 1e-3)
        before = path.t_s <= entry.plan.cone_entry_s
        distance.plot(path.t_s[before], clearance[before], color=colour, lw=1.5)
        distance.plot(path.t_s[~before], clearance[~before], color=colour, lw=1.2, ls=(0, (0.8, 1.4)))
    thrust.axhline(case.spacecraft.thrust_max_n, **LIMIT, label="limit")
    distance.axhline(case.clearance_m, **LIMIT)
    thrust.set(ylabel="thrust (N)", title="a  thrust", ylim=(0.0, None))
    distance.set(ylabel="distance to the surface (m)", yscale="log", xlabel="time (s)")
    distance.set_ylim(max(1.0, 0.02 * case.clearance_m), None)
    distance.set_title("b  distance to the surface; dotted: inside the safety cone")
    for axes in (thrust, distance):
        axes.set_xlim(0.0, max(entry.plan.tof_s for entry in entries))
        axes.grid(True)
    handles, labels = thrust.get_legend_handles_labels()
    figure.legend(
        handles, labels, loc="lower center", ncols=min(4, len(labels)), bbox_to_anchor=(0.53, 0.002)
    )
    return figure

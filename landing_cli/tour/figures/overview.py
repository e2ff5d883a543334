"""How many asteroids for how much delta-v in how much time."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from landing_cli.flight.astronomy import DAY_S
from landing_cli.results import plotting
from landing_cli.tour.run_records import TourRun
from landing_cli.tour.summary import front

if TYPE_CHECKING:
    from matplotlib.figure import Figure


def front_figure(run: TourRun) -> Figure:
    """Draw all chains that hold in N-body, and those that no other beats.

    Parameters
    ----------
    run : TourRun
        With at least one chain.

    Returns
    -------
    Figure
    """
    figure = plotting.new_figure(8.6, 5.0)
    best = front(run.cases)
    told = (
        f"{len(run.cases)} chains hold in N-body, {len(run.broken)} broke; "
        f"{run.facts.searched_targets} targets, {run.facts.method} search"
    )
    plotting.add_title(figure, f"{run.facts.name}: asteroids against delta-v", told)
    axes = figure.add_axes((0.09, 0.13, 0.75, 0.71))
    chains = [entry.chain for entry in run.cases]
    cost = np.array([chain.nbody_delta_v_m_s for chain in chains])
    count = np.array([len(chain.legs) for chain in chains])
    days = np.array([chain.duration_s / DAY_S for chain in chains])
    drawn = axes.scatter(cost, count, c=days, cmap=plotting.delta_v_colours(), s=24, linewidths=0, zorder=3)
    axes.scatter(
        [entry.chain.nbody_delta_v_m_s for entry in best],
        [len(entry.chain.legs) for entry in best],
        facecolors="none",
        edgecolors=plotting.RED,
        s=80,
        linewidths=1.2,
        zorder=4,
        label="beaten by none in number, delta-v and duration",
    )
    axes.axvline(run.facts.limits.delta_v_m_s, color=plotting.DARK_GREY, lw=1.0, ls=(0, (4, 2)))
    axes.set(xlabel="N-body delta-v (m/s)", ylabel="asteroids", xlim=(0.0, None))
    axes.set_yticks(np.arange(1, count.max() + 2))
    axes.set_ylim(0.5, count.max() + 0.8)
    axes.grid(True)
    axes.legend(loc="upper left")
    bar = figure.colorbar(drawn, cax=figure.add_axes((0.87, 0.13, 0.022, 0.71)))
    bar.set_label("duration (d)")
    return figure

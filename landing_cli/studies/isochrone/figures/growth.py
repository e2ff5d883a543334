"""How much of the surface is reachable, over the time of flight."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from landing_cli.body.mesh import facet_areas
from landing_cli.reach.figures.parts import body_name, craft_facts
from landing_cli.results import plotting
from landing_cli.studies.isochrone.intervals import reachable_area
from landing_cli.studies.isochrone.records import StateResult

if TYPE_CHECKING:
    from matplotlib.figure import Figure

COLOURS = (plotting.BLUE, plotting.RED, plotting.GREEN, plotting.PURPLE, plotting.ORANGE, plotting.SKY)


def growth_figure(cases: tuple[StateResult, ...]) -> Figure:
    """Draw the reachable area against the time of flight, a curve an initial state.

    Parameters
    ----------
    cases : tuple of StateResult
        Of one study.

    Returns
    -------
    Figure
    """
    case, grid = cases[0].case, cases[0].grid
    area_m2 = facet_areas(case.asteroid.mesh)
    figure = plotting.new_figure(8.2, 4.1)
    plotting.add_title(
        figure,
        f"{body_name(case)}: how the reachable domain grows with the time of flight",
        craft_facts(case),
    )
    axes = figure.add_axes((0.09, 0.125, 0.79, 0.70))
    total_km2 = area_m2.sum() / 1e6
    for index, result in enumerate(cases):
        tof_s, reachable_m2 = reachable_area(result.intervals, area_m2)
        within = tof_s <= grid.tof_s[-1]  # what lasts to the end of the range ends just beyond it
        times = np.concatenate([[grid.tof_s[0]], tof_s[within], [grid.tof_s[-1]]])
        curve = np.concatenate([[0.0], reachable_m2[within]]) / 1e6
        look: dict[str, Any] = {
            "color": COLOURS[index % len(COLOURS)],
            "ls": "-" if index < len(COLOURS) else "--",
        }
        axes.step(times, np.append(curve, curve[-1]), where="post", **look)
        name = result.case.name.replace("_", " ")
        half = result.summary["first_tof_s"]["median"]
        label = name if half is None else f"{name}: half of its facets from {half:.0f} s"
        axes.plot([], [], label=label, **look)
    axes.set(
        xlim=(grid.tof_s[0], grid.tof_s[-1]),
        ylim=(0.0, 1.03 * total_km2),
        xlabel="time of flight (s)",
        ylabel="reachable area (km²)",
    )
    axes.grid(True)
    axes.axhline(total_km2, color=plotting.DARK_GREY, lw=0.8, ls=":")
    axes.legend(loc="lower right", title=f"reachable within {grid.tof_s[-1]:g} s, by initial state")
    share = axes.twinx()
    share.set(ylim=(0.0, 103.0), ylabel="share of the surface (%)")
    share.spines["right"].set_visible(True)
    return figure

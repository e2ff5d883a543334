"""Intervals of single facets along the time of flight."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from landing_cli.reach.figures.parts import body_name, craft_facts
from landing_cli.reach.records import Verdict
from landing_cli.results import plotting
from landing_cli.studies.isochrone.facet_story import intervals_of_facet
from landing_cli.studies.isochrone.figures.growth import COLOURS
from landing_cli.studies.isochrone.records import Rows, StateResult

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

MOST_BARS = 40


def several_figure(result: StateResult) -> Figure:
    """Show the facets that are reachable in several intervals: those out of reach longest in between.

    Parameters
    ----------
    result : StateResult
        With at least one such facet.

    Returns
    -------
    Figure
    """
    facets = result.facets
    gap_s = facets["last_tof_s"] - facets["first_tof_s"] - facets["reachable_s"]
    several = np.flatnonzero(facets["intervals"] > 1)
    shown = several[np.argsort(-gap_s[several], kind="stable")[:MOST_BARS]]
    height = 1.55 + 0.17 * len(shown)
    figure = plotting.new_figure(7.2, height)
    of = "" if len(shown) == len(several) else f"; the {len(shown)} with the longest gaps"
    plotting.add_title(
        figure,
        f"{body_name(result.case)}, {result.case.name.replace('_', ' ')}: longer is not always easier",
        f"{len(several)} facets are reachable in several intervals{of}\n{craft_facts(result.case)}",
    )
    axes = figure.add_axes((0.10, 0.52 / height, 0.86, 1.0 - 1.45 / height))
    for row, facet in enumerate(shown.tolist()):
        _draw_bars(axes, intervals_of_facet(result, facet), float(row), plotting.BLUE)
    axes.set_yticks(range(len(shown)), [str(facet) for facet in shown], fontsize=7)
    axes.set(ylim=(len(shown) - 0.3, -0.7), ylabel="facet")
    _frame_times(axes, result)
    return figure


def facet_figure(cases: tuple[StateResult, ...], facet: int) -> Figure:
    """Show when a facet is reachable from each initial state, and what it costs at the grid's times.

    Parameters
    ----------
    cases : tuple of StateResult
        Of one study.
    facet : int
        0-based.

    Returns
    -------
    Figure

    Raises
    ------
    InputRefused
        If there is no such facet.
    """
    rows = len(cases)
    height = 4.0 + 0.22 * rows
    figure = plotting.new_figure(7.2, height)
    plotting.add_title(
        figure,
        f"{body_name(cases[0].case)}, facet {facet}: when it can be reached, and at what velocity increment",
        craft_facts(cases[0].case),
    )
    low = 0.55 / height
    bars = figure.add_axes((0.16, low, 0.80, (0.22 * rows + 0.1) / height))
    axes = figure.add_axes((0.16, low + (0.22 * rows + 0.35) / height, 0.80, 2.1 / height))
    for row, result in enumerate(cases):
        colour = COLOURS[row % len(COLOURS)]
        _draw_bars(bars, intervals_of_facet(result, facet), float(row), colour)
        axes.plot(result.grid.tof_s, result.answers.delta_v_m_s[:, facet], ".-", ms=4, lw=1.0, color=colour)
    bars.set_yticks(range(rows), [result.case.name.replace("_", " ") for result in cases])
    bars.set(ylim=(rows - 0.4, -0.6))
    for place in (bars, axes):
        _frame_times(place, cases[0])
    axes.set(ylabel="velocity increment (m/s)", xlabel="")
    axes.tick_params(labelbottom=False)
    return figure


def _draw_bars(axes: Axes, intervals: Rows, row: float, colour: str) -> None:
    for verdict, look in (
        (Verdict.REACHABLE, {"facecolors": colour}),
        (
            Verdict.UNRESOLVED,
            {"facecolors": plotting.PALE, "hatch": "////", "edgecolor": plotting.RED, "lw": 0},
        ),
    ):
        own = intervals[intervals["verdict"] == verdict]
        axes.broken_barh(
            [(one["begin_s"], max(one["end_s"] - one["begin_s"], 0.05)) for one in own],
            (row - 0.32, 0.64),
            **look,
        )


def _frame_times(axes: Axes, result: StateResult) -> None:
    axes.set(xlim=(result.grid.tof_s[0], result.grid.tof_s[-1]), xlabel="time of flight (s)")
    axes.grid(True, axis="x")

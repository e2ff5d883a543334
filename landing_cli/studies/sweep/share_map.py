"""On how much of a sweep each facet is reachable, as maps."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from landing_cli.results import plotting
from landing_cli.results.surface_map import draw_facets, frame_small_map, map_surface
from landing_cli.studies.sweep.exports import reachable_in
from landing_cli.studies.sweep.records import CellResult, SweepRun

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_WIDTH, _COLUMNS = 3.1, 3  # inch, maps


def share_figure(run: SweepRun, cases: tuple[CellResult, ...]) -> Figure:
    """Map the share of cells in which each facet is reachable, an initial state a map.

    Parameters
    ----------
    run : SweepRun
        The sweep.
    cases : tuple of CellResult
        Those to count.

    Returns
    -------
    Figure
    """
    from matplotlib.cm import ScalarMappable
    from matplotlib.colors import Normalize

    states = [state for state in run.grid.states if any(case.initial_state == state for case in cases)]
    columns = min(len(states), _COLUMNS)
    rows = -(-len(states) // columns)
    wide, high = max(0.6 + columns * (_WIDTH + 0.15), 6.0), 0.75 + rows * (0.5 * _WIDTH + 0.4) + 0.75
    figure = plotting.new_figure(wide, high)
    name = run.asteroid.name[:1].upper() + run.asteroid.name[1:]
    shape = " x ".join(f"{len(axis.texts)} {axis.name}" for axis in run.grid.question.axes)
    plotting.add_title(figure, f"{name}: share of the cells in which a facet is reachable", shape)
    surface = map_surface(run.asteroid.mesh)
    scale = ScalarMappable(Normalize(0.0, 100.0), plotting.delta_v_colours())
    for place, state in enumerate(states):
        row, column = divmod(place, columns)
        left, top = 0.6 + column * (_WIDTH + 0.15), 0.75 + row * (0.5 * _WIDTH + 0.4) + 0.25
        box = (left / wide, 1 - (top + 0.5 * _WIDTH) / high, _WIDTH / wide, 0.5 * _WIDTH / high)
        axes = figure.add_axes(box)
        own = [case for case in cases if case.initial_state == state]
        draw_facets(axes, surface, scale.to_rgba(100.0 * reachable_in(own) / len(own))[:, :3])
        frame_small_map(axes, left=column == 0, below=place + columns >= len(states))
        always = int(np.sum(reachable_in(own) == len(own)))
        axes.set_title(state.replace("_", " "), fontweight="bold")
        axes.set_title(f"{always} facets in all {len(own)}", loc="right")
    place_of_bar = figure.add_axes((0.6 / wide, 0.4 / high, 2.4 / wide, 0.12 / high))
    bar = figure.colorbar(scale, cax=place_of_bar, orientation="horizontal", label="cells (%)")
    bar.outline.set_visible(False)
    return figure

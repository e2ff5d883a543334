"""How surely each facet is reachable: three views of the body and a map."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from landing_cli.body.mesh import FloatArray
from landing_cli.reach.figures.fields import level_segments
from landing_cli.reach.figures.parts import START, body_name, case_facts, sights
from landing_cli.results import plotting
from landing_cli.results.surface_map import SurfaceMap, draw_facets, draw_map_segments, frame_map, lon_lat_deg
from landing_cli.results.surface_view import (
    draw_segments,
    draw_surface,
    draw_triad,
    label_axes,
    reach_m,
    view_from,
)
from landing_cli.studies.disperse.records import CaseDispersion

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.cm import ScalarMappable
    from matplotlib.figure import Figure

# Probabilities that lines are drawn at: half, and one in twenty to either side.
EDGES, HALF = (0.05, 0.95), (0.5,)
_EDGE_LOOK = {"colors": plotting.ORANGE, "linewidths": 1.0, "zorder": 3}
_HALF_LOOK = {"colors": plotting.INK, "linewidths": 1.3, "zorder": 4}


def probability_scale() -> ScalarMappable:
    """Colours of probabilities: never is pale, always is dark."""
    from matplotlib.cm import ScalarMappable
    from matplotlib.colors import LinearSegmentedColormap, Normalize

    colours = [plotting.PALE, "#b9d4e6", plotting.SKY, plotting.BLUE, "#00344f"]
    return ScalarMappable(Normalize(0.0, 1.0), LinearSegmentedColormap.from_list("probability", colours))


def probability_figure(result: CaseDispersion, surface: SurfaceMap) -> Figure:
    """Show how surely every facet of a case is reachable.

    Parameters
    ----------
    result : CaseDispersion
        The case.
    surface : SurfaceMap
        The mesh in longitude and latitude.

    Returns
    -------
    Figure
    """
    mesh, start = result.case.asteroid.mesh, result.case.position_m
    probability, scale = np.asarray(result.facets["probability"]), probability_scale()
    colours = scale.to_rgba(probability)[:, :3]
    lines = [
        (level_segments(mesh, probability, np.array(levels)), look)
        for levels, look in ((EDGES, _EDGE_LOOK), (HALF, _HALF_LOOK))
    ]
    figure = plotting.new_figure(10.0, 7.35)
    plotting.add_title(figure, _title(result), _facts(result))
    near, beside = sights(start)
    views = [
        ("a  30° off the initial position", near),
        ("b  at right angles to it", beside),
        ("c  from the far side, opposite to a", -near),
    ]
    for column, (name, toward) in enumerate(views):
        axes, view = figure.add_axes((0.065 + 0.325 * column, 0.525, 0.265, 0.36)), view_from(toward)
        draw_surface(axes, mesh, view, colours)
        for segments, look in lines:
            draw_segments(axes, mesh, view, segments, **look)
        reach = 1.15 * reach_m(mesh, view)
        axes.set(xlim=(-reach, reach), ylim=(-reach, reach), title=name)
        label_axes(axes, view)
        draw_triad(axes, view)
    _draw_map(figure.add_axes((0.065, 0.06, 0.60, 0.365)), surface, colours, lines, start)
    _explain(figure, scale)
    return figure


def _draw_map(
    axes: Axes,
    surface: SurfaceMap,
    colours: FloatArray,
    lines: list[tuple[FloatArray, dict[str, object]]],
    start: FloatArray,
) -> None:
    draw_facets(axes, surface, colours)
    for segments, look in lines:
        draw_map_segments(axes, segments, **look)
    axes.plot(*lon_lat_deg(start), **START, clip_on=False, zorder=6)
    frame_map(axes)
    axes.set_title("d  longitude and latitude")


def _explain(figure: Figure, scale: ScalarMappable) -> None:
    from matplotlib.lines import Line2D

    bar = figure.colorbar(scale, cax=figure.add_axes((0.70, 0.395, 0.26, 0.022)), orientation="horizontal")
    bar.set_label("probability of being reachable")
    bar.outline.set_visible(False)
    handles = [
        Line2D([], [], color=plotting.INK, lw=1.3, label="one half"),
        Line2D([], [], color=plotting.ORANGE, lw=1.0, label="5 % and 95 %"),
        Line2D([], [], **{**START, "markersize": 10}, label="initial position, not dispersed"),
    ]
    figure.legend(handles=handles, loc="upper left", bbox_to_anchor=(0.685, 0.335), labelspacing=0.7)


def _title(result: CaseDispersion) -> str:
    s = result.summary
    return (
        f"{body_name(result.case)}, {result.case.name}: of {s['facets']} facets {s['always']} always "
        f"reachable, {s['sometimes']} sometimes, {s['never']} never"
    )


def _facts(result: CaseDispersion) -> str:
    return f"{result.drawing.samples} samples, seed {result.drawing.seed}; {case_facts(result.case)}"

"""The first time of flight that reaches each facet, with its contours: two views of the body and a map."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from landing_cli.body.mesh import FloatArray, facet_areas
from landing_cli.reach.figures.fields import border_segments, level_segments
from landing_cli.reach.figures.parts import (
    BORDER,
    LEVELS,
    START,
    KeyEntry,
    body_name,
    craft_facts,
    legend_handles,
    scale_levels,
    sights,
)
from landing_cli.reach.records import Verdict
from landing_cli.results import plotting
from landing_cli.results.surface_map import SurfaceMap, draw_facets, draw_map_segments, frame_map, lon_lat_deg
from landing_cli.results.surface_view import (
    draw_scale_bar,
    draw_segments,
    draw_surface,
    draw_triad,
    reach_m,
    view_from,
)
from landing_cli.studies.isochrone.records import StateResult

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.cm import ScalarMappable
    from matplotlib.figure import Figure


def isochrone_figure(result: StateResult, surface: SurfaceMap) -> Figure:
    """Show the first time of flight that reaches each facet.

    Parameters
    ----------
    result : StateResult
        What was found for an initial state.
    surface : SurfaceMap
        The mesh in longitude and latitude.

    Returns
    -------
    Figure
    """
    case, mesh = result.case, result.case.asteroid.mesh
    first, verdict = result.facets["first_tof_s"], result.facets["verdict"]
    reachable = verdict == Verdict.REACHABLE
    scale = _time_scale(first)
    colours, key = _painted(result, scale)
    hatched = verdict == Verdict.UNRESOLVED
    named = scale_levels(scale)
    step = float(named[1] - named[0]) if len(named) > 1 else 0.0
    between = np.append(named, named[0] - step) + 0.5 * step if step else named
    levels = np.union1d(named, between)
    lines = level_segments(mesh, first, levels)
    border = border_segments(mesh, reachable, ~reachable)

    figure = plotting.new_figure(10.0, 5.6)
    plotting.add_title(figure, _title(result), _subtitle(result))
    for index, view in enumerate(
        (view_from(sights(case.position_m)[0]), view_from(-sights(case.position_m)[0]))
    ):
        axes = figure.add_axes((0.015, 0.455 - 0.445 * index, 0.26, 0.38))
        draw_surface(axes, mesh, view, colours, hatched)
        draw_segments(axes, mesh, view, lines, **LEVELS)
        draw_segments(axes, mesh, view, border, **BORDER)
        reach = 1.15 * reach_m(mesh, view)
        axes.set(xlim=(-reach, reach), ylim=(-reach, reach), aspect="equal")
        axes.axis("off")
        draw_triad(axes, view, at=(0.9, 0.12))
        draw_scale_bar(axes, reach)
        axes.set_title(("a  30° off the initial position", "b  from the far side")[index])
    axes = figure.add_axes((0.335, 0.245, 0.655, 0.60))
    draw_facets(axes, surface, colours, hatched)
    draw_map_segments(axes, lines, **LEVELS)
    draw_map_segments(axes, border, **BORDER)
    axes.plot(*lon_lat_deg(case.position_m), **START, clip_on=False, zorder=6)
    frame_map(axes)
    axes.set_title("c  longitude and latitude")
    for level in named:
        _name_level(axes, level_segments(mesh, first, np.array([level])), float(level))
    _explain(figure, scale, key, has_border=bool(len(border)), step_s=0.5 * step)
    return figure


def _time_scale(first_s: FloatArray) -> ScalarMappable:
    """Colours of first times, from the least to the largest."""
    from matplotlib.cm import ScalarMappable
    from matplotlib.colors import Normalize

    known = first_s[np.isfinite(first_s)]
    low, high = (float(known.min()), float(known.max())) if len(known) else (0.0, 1.0)
    return ScalarMappable(Normalize(low, max(high, low + 1.0)), plotting.delta_v_colours())


def _painted(result: StateResult, scale: ScalarMappable) -> tuple[FloatArray, list[KeyEntry]]:
    from matplotlib.colors import to_rgb

    colours = scale.to_rgba(np.nan_to_num(result.facets["first_tof_s"]))[:, :3]
    key = []
    for verdict, name, colour in (
        (Verdict.UNREACHABLE, "not reachable at any time of the range", plotting.GREY),
        (Verdict.UNRESOLVED, "unresolved", plotting.RED),
    ):
        facets = result.facets["verdict"] == verdict
        colours[facets] = to_rgb(colour)
        if facets.any():
            key.append(KeyEntry(name, colour, verdict == Verdict.UNRESOLVED, int(facets.sum())))
    return colours, key


def _title(result: StateResult) -> str:
    mesh, summary = result.case.asteroid.mesh, result.summary
    share = 100.0 * summary["reachable_area_m2"] / facet_areas(mesh).sum()
    name = result.case.name.replace("_", " ")
    return (
        f"{body_name(result.case)}, {name}: the first time of flight that reaches each facet ({share:.3g} %)"
    )


def _subtitle(result: StateResult) -> str:
    summary = result.summary
    return (
        f"{summary['tof_min_s']:g} to {summary['tof_max_s']:g} s, ends to {summary['resolution_s']:.2g} s; "
        f"{craft_facts(result.case)}"
    )


def _name_level(axes: Axes, segments: FloatArray, level: float) -> None:
    """Write a contour's time where the contour comes nearest to the middle of the map."""
    if len(segments) == 0:
        return
    place = lon_lat_deg(segments.mean(axis=1))
    lon, lat = place[np.argmin(np.hypot(place[:, 0] / 2.0, place[:, 1]))]
    look: dict[str, Any] = {
        "fontsize": 7.5,
        "ha": "center",
        "va": "center",
        "color": plotting.INK,
        "zorder": 7,
    }
    axes.text(lon, lat, f"{level:g}", bbox={"fc": "white", "ec": "none", "alpha": 0.75, "pad": 0.8}, **look)


def _explain(
    figure: Figure, scale: ScalarMappable, key: list[KeyEntry], has_border: bool, step_s: float
) -> None:
    """Colour bar below the map, marks beside it."""
    bar = figure.colorbar(scale, cax=figure.add_axes((0.335, 0.115, 0.27, 0.025)), orientation="horizontal")
    every = f"; contours every {step_s:g} s" if step_s else ""
    bar.set_label(f"first time of flight that reaches it (s){every}", labelpad=2)
    bar.outline.set_visible(False)
    handles = legend_handles(key, border=has_border, levels=None, counts=True)
    figure.legend(handles=handles, loc="upper left", bbox_to_anchor=(0.63, 0.165), labelspacing=0.5)

"""The trace of a boundary on a case: what was asked, and the loops found."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from landing_cli.body.mesh import FloatArray
from landing_cli.reach.figures.fields import spread_over_mesh
from landing_cli.reach.figures.parts import START, body_name, sights
from landing_cli.reach.stored import CaseResult
from landing_cli.results import plotting
from landing_cli.results.surface_map import (
    SurfaceMap,
    draw_facets,
    draw_map_segments,
    frame_map,
    lon_lat_deg,
)
from landing_cli.results.surface_view import (
    draw_segments,
    draw_surface,
    draw_triad,
    label_axes,
    reach_m,
    view_from,
)
from landing_cli.results.tree import Group

if TYPE_CHECKING:
    from matplotlib.figure import Figure

Mask = NDArray[np.bool_]

_CLOSED: dict[str, Any] = {"colors": plotting.INK, "linewidths": 1.5, "zorder": 4}
_OPEN: dict[str, Any] = {"colors": plotting.RED, "linewidths": 1.8, "zorder": 4.2}
_PALE_BLUE = (0.72, 0.83, 0.92)


@dataclass(frozen=True, eq=False)
class _Kinds:
    """Facets by what the trace did with them: colour, label and which."""

    colours: FloatArray
    key: list[tuple[str, Any, int]]


def trace_figure(result: CaseResult, group: Group, surface: SurfaceMap) -> Figure:
    """Show what a trace asked, the domain that follows, and the loops of its boundary.

    Parameters
    ----------
    result : CaseResult
        A case that was traced.
    group : Group
        Its boundary.
    surface : SurfaceMap
        The mesh in longitude and latitude.

    Returns
    -------
    Figure
    """
    mesh, case, told = result.case.asteroid.mesh, result.case, result.summary["trace"]
    kinds, lines = _kinds(result, group), _loops(result, group)
    figure = plotting.new_figure(10.0, 8.0)
    plotting.add_title(
        figure,
        f"{body_name(case)}, {case.name}: a trace asks {told['N']} of {len(mesh.faces)} facets "
        f"({100.0 * told['ratio']:.1f} %)",
        f"{told['seeds']} seeds, {told['rounds']} rounds; {told['loops']} loops of {told['boundary_edges']} "
        f"edges, {'all' if told['closed'] else 'not all'} closed; {told['domain_facets']} facets within"
        f"{_agreement(told)}",
    )
    near, beside = sights(case.position_m)
    for column, (name, sight) in enumerate(
        (("a  30° off the initial position", near), ("b  at right angles to it", beside))
    ):
        axes = figure.add_axes((0.075 + 0.49 * column, 0.5, 0.42, 0.39))
        view = view_from(sight)
        draw_surface(axes, mesh, view, kinds.colours)
        for segments, look in lines:
            draw_segments(axes, mesh, view, segments, **look)
        reach = 1.1 * reach_m(mesh, view)
        axes.set(xlim=(-reach, reach), ylim=(-reach, reach))
        label_axes(axes, view)
        draw_triad(axes, view)
        axes.set_title(name)
    axes = figure.add_axes((0.075, 0.115, 0.905, 0.31))
    draw_facets(axes, surface, kinds.colours)
    for segments, look in lines:
        draw_map_segments(axes, segments, **look)
    axes.plot(*lon_lat_deg(case.position_m), **START, clip_on=False, zorder=6)
    frame_map(axes)
    axes.set_title("c  longitude and latitude")
    handles = _handles(kinds, is_open=not told["closed"])
    figure.legend(handles=handles, loc="lower center", bbox_to_anchor=(0.52, 0.002), ncols=4)
    return figure


def _agreement(told: Any) -> str:
    if "misclassified" not in told:
        return ""
    return f"; {told['misclassified']} differ from the traversal"


def _kinds(result: CaseResult, group: Group) -> _Kinds:
    from matplotlib.colors import to_rgb

    fields, domain = spread_over_mesh(result), group.dataset("domain").data == 1
    asked = _asked(result, group, fields.asked)
    missed = np.zeros(len(domain), dtype=bool)
    if "missed_facets" in group.members:
        missed[group.dataset("missed_facets").data] = True
    seeds = np.zeros(len(domain), dtype=bool)
    seeds[group.dataset("seed_facets").data] = True
    kinds: list[tuple[str, Any, Mask]] = [
        ("within, not asked", _PALE_BLUE, domain),
        ("outside, not asked", plotting.PALE, ~domain),
        ("asked, reachable", plotting.BLUE, asked & domain),
        ("asked, not reachable", plotting.GREY, asked & ~domain),
        ("seed", plotting.ORANGE, seeds),
        ("missed", plotting.RED, missed),
    ]
    colours, shown = np.zeros((len(domain), 3)), np.zeros(len(domain), dtype=np.int64)
    for index, (_, colour, facets) in enumerate(kinds):
        colours[facets], shown[facets] = to_rgb(colour), index
    counts = np.bincount(shown, minlength=len(kinds))
    key = [(label, colour, int(n)) for (label, colour, _), n in zip(kinds, counts, strict=True) if n]
    return _Kinds(colours, key)


def _asked(result: CaseResult, group: Group, solved: Mask) -> Mask:
    """Facets that the trace asked; beside a traversal only those that show: seeds and boundary."""
    if "missed_facets" not in group.members:
        return solved
    asked = np.zeros(len(result.case.asteroid.mesh.faces), dtype=bool)
    for name in ("reachable_facet", "unreachable_facet", "seed_facets"):
        asked[group.dataset(name).data] = True
    return asked


def _loops(result: CaseResult, group: Group) -> list[tuple[FloatArray, dict[str, Any]]]:
    """Edges of the closed loops and of the others, (n, 2, 3) float, m."""
    vertices = result.case.asteroid.mesh.vertices
    ends = np.stack([group.dataset("start_vertex").data, group.dataset("end_vertex").data], axis=1)
    closed = (group.dataset("loop_closed").data == 1)[group.dataset("loop").data]
    return [(vertices[ends[closed]], _CLOSED), (vertices[ends[~closed]], _OPEN)]


def _handles(kinds: _Kinds, is_open: bool) -> list[Any]:
    from matplotlib.lines import Line2D
    from matplotlib.patches import Patch

    handles: list[Any] = [
        Patch(facecolor=colour, label=f"{label} ({count})") for label, colour, count in kinds.key
    ]
    handles.append(Line2D([], [], color=plotting.INK, lw=1.5, label="boundary, both sides solved"))
    if is_open:
        handles.append(Line2D([], [], color=plotting.RED, lw=1.8, label="boundary, a side unresolved"))
    handles.append(Line2D([], [], **{**START, "markersize": 10}, label="initial position"))
    return handles

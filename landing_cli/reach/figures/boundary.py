"""Section and expansion on a case: what was asked, and the boundary found (Zhao 2022, figs 2, 3, 7)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from landing_cli.body.mesh import FloatArray, Mesh, facet_centroids
from landing_cli.reach.figures.fields import spread_over_mesh
from landing_cli.reach.figures.parts import START, body_name, draw_arrow_head, sights
from landing_cli.reach.stored import CaseResult
from landing_cli.results import plotting
from landing_cli.results.surface_view import (
    View,
    draw_surface,
    draw_triad,
    hidden,
    label_axes,
    reach_m,
    view_from,
)
from landing_cli.results.tree import Group

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

IntArray = NDArray[np.int64]

_CONTINUITY = 3.0
_LOOKS: dict[str, dict[str, Any]] = {
    "section": {"marker": "s", "color": plotting.ORANGE},
    "ring": {"marker": "o", "color": plotting.GREEN},
    "expansion": {"marker": "D", "color": plotting.SKY},
}
_LINES: dict[str, dict[str, Any]] = {
    "continuous boundary": {"color": plotting.PURPLE, "lw": 4.6, "zorder": 3.4, "solid_capstyle": "round"},
    "initial boundary": {"color": plotting.GREEN, "lw": 1.2, "zorder": 4.6, "solid_capstyle": "round"},
}


@dataclass(frozen=True, eq=False)
class _Section:
    """The facets of a section as points."""

    points: FloatArray  # (m, 3), m
    parts: dict[str, IntArray]  # asked facets by part
    lines: dict[str, IntArray]  # boundaries, by azimuth about the axis
    reachable: NDArray[np.bool_]
    traversed: IntArray | None  # reachable facets, where every facet was asked
    gap_m: float  # 3 h


def boundary_figure(result: CaseResult, group: Group) -> Figure:
    """Show what section and expansion asked, and the boundary they found.

    Parameters
    ----------
    result : CaseResult
        A case that ran the method.
    group : Group
        Its boundary.

    Returns
    -------
    Figure
    """
    case, mesh = result.case, result.case.asteroid.mesh
    section = _section(result, group)
    found = result.summary["section"]
    figure = plotting.new_figure(10.0, 8.2)
    count = found["n"]
    steps = f"{found['P_e']} in {count} expansion{'s' * (count > 1)}" if count else "no expansion needed"
    plotting.add_title(
        figure,
        f"{body_name(case)}, {case.name}: section and expansion ask {found['N']} of {len(mesh.faces)} facets",
        f"{found['P_d']} in the section, {found['P_r']} in the ring, {steps}; "
        f"boundary {'closed' if found['closed'] else 'not closed'}{_agreement(found)}",
    )
    rock = np.tile([[0.88, 0.865, 0.84]], (len(mesh.faces), 1))
    off_axis, along = view_from(sights(case.position_m, 45.0)[0]), _along(case.position_m)
    names = ("a  45° off the initial position", "b  all points, in the plane square to the axis")
    for column, (name, view) in enumerate(zip(names, (off_axis, along), strict=True)):
        axes = figure.add_axes((0.075 + 0.49 * column, 0.46, 0.42, 0.43))
        draw_surface(axes, mesh, view, rock)
        seen = (
            ~hidden(mesh, view, section.points, 8.0) if column == 0 else np.ones(len(mesh.faces), dtype=bool)
        )
        _draw_points(axes, section, view.flat(section.points), seen)
        _mark_axis(axes, mesh, view, case.position_m)
        label_axes(axes, view)
        draw_triad(axes, view)
        axes.set_title(name)
    _draw_unrolled(figure.add_axes((0.075, 0.135, 0.905, 0.235)), section, case.position_m)
    figure.legend(handles=_handles(section), loc="lower center", bbox_to_anchor=(0.52, 0.002), ncols=4)
    return figure


def _draw_unrolled(axes: Axes, section: _Section, start: FloatArray) -> None:
    """Draw azimuth about the axis against distance: the section is a column here, the ring a band."""
    reference = np.eye(3)[0 if _on_spin_axis(start) else 2]  # as the section method counts azimuths
    turned = np.cross(start / np.linalg.norm(start), reference)
    reference = np.cross(turned, start / np.linalg.norm(start))
    azimuth = np.degrees(np.arctan2(section.points @ turned, section.points @ reference))
    range_m = np.linalg.norm(section.points - start, axis=1)
    h_m = max(section.gap_m / _CONTINUITY, 1.0)
    middle = (
        float(np.median(range_m[section.parts["ring"]])) if len(section.parts["ring"]) else range_m.mean()
    )
    flat = np.stack([azimuth, range_m], axis=1)
    seen = np.ones(len(flat), dtype=bool)
    _draw_points(axes, section, flat, seen, jump=180.0)
    axes.set(xlim=(-180, 180), ylim=(middle - 7.5 * h_m, middle + 5.5 * h_m), xticks=range(-180, 181, 60))
    axes.set_xlabel("azimuth about the axis (°)")
    plotting.rule_lengths(axes.yaxis, "distance from the\ninitial position")
    axes.set_title("c  around the boundary")


def _agreement(found: Any) -> str:
    if "iou" not in found:
        return ""
    return f"; IoU with the traversal {found['iou']:.3f}, {found['misclassified']} facets differ"


def _section(result: CaseResult, group: Group) -> _Section:
    mesh, fields = result.case.asteroid.mesh, spread_over_mesh(result)
    points = facet_centroids(mesh)
    parts = {name: group.dataset(f"{name}_facets").data.astype(np.int64) for name in _LOOKS}
    boundary = group.dataset("boundary_facets").data.astype(np.int64)
    ring = np.isin(boundary, parts["ring"])
    range_m = np.linalg.norm(points[parts["ring"]] - result.case.position_m, axis=1)
    return _Section(
        points,
        parts,
        {"continuous boundary": boundary, "initial boundary": boundary[ring]},
        fields.reachable,
        np.flatnonzero(fields.reachable) if fields.asked.all() else None,
        _CONTINUITY * float(np.ptp(range_m)) if len(range_m) else 0.0,  # the ring is one h wide
    )


def _along(start: FloatArray) -> View:
    """Look along the axis, with +z up, or +y where the axis is the spin axis."""
    return view_from(start, (0.0, 1.0, 0.0) if _on_spin_axis(start) else (0.0, 0.0, 1.0))


def _on_spin_axis(start: FloatArray) -> bool:
    return bool(np.hypot(start[0], start[1]) < 1e-9 * np.linalg.norm(start))


def _draw_points(
    axes: Axes, section: _Section, flat: FloatArray, seen: NDArray[np.bool_], jump: float = np.inf
) -> None:
    """Draw the points that are seen, and the boundaries between them where they do not jump across."""
    if section.traversed is not None:
        inside = section.traversed[seen[section.traversed]]
        axes.plot(*flat[inside].T, ls="none", marker=".", ms=2.2, color=plotting.BLUE, alpha=0.55, zorder=3)
    for name, look in _LINES.items():
        for a, b in _links(section, section.lines[name]):
            if seen[a] and seen[b] and abs(flat[a, 0] - flat[b, 0]) < jump:
                axes.plot(*flat[[a, b]].T, **look)
    for name, look in _LOOKS.items():
        facets = section.parts[name]
        facets = facets[seen[facets]]
        yes, no = facets[section.reachable[facets]], facets[~section.reachable[facets]]
        axes.plot(*flat[no].T, ls="none", marker="x", ms=3.8, mew=0.9, color=look["color"], zorder=4)
        axes.plot(*flat[yes].T, ls="none", ms=3.4, zorder=4.5, **look)


def _links(section: _Section, boundary: IntArray) -> list[tuple[int, int]]:
    """Adjacent points of a boundary that are continuous."""
    following = np.roll(boundary, -1)
    apart = np.linalg.norm(section.points[following] - section.points[boundary], axis=1)
    return [
        (int(a), int(b)) for a, b, d in zip(boundary, following, apart, strict=True) if 0 < d <= section.gap_m
    ]


def _mark_axis(axes: Axes, mesh: Mesh, view: View, start: FloatArray) -> None:
    """Set the limits, and mark the initial position or the way to it."""
    reach = 1.15 * reach_m(mesh, view)
    axes.set(xlim=(-reach, reach), ylim=(-reach, reach))
    up = start / np.linalg.norm(start)
    way = view.flat(np.stack([start, up * (mesh.vertices @ up).max()]))
    if np.linalg.norm(way[0] - way[1]) > 0.02 * reach:
        axes.plot(*way.T, color=plotting.INK, lw=1.0, zorder=5)
        draw_arrow_head(axes, way[1], way[0])
    if (np.abs(way[0]) < 0.95 * reach).all():
        axes.plot(*way[0], **START, zorder=6)


def _handles(section: _Section) -> list[Any]:
    from matplotlib.lines import Line2D

    names = {"section": "section P(d)", "ring": "ring P(r)", "expansion": "expansion P(e)"}
    handles = [
        Line2D([], [], ls="none", ms=5, label=f"{names[name]}, reachable", **look)
        for name, look in _LOOKS.items()
        if len(section.parts[name])
    ]
    handles.append(
        Line2D([], [], ls="none", marker="x", ms=5, color=plotting.INK, label="asked, not reachable")
    )
    handles += [Line2D([], [], label=name, **look) for name, look in _LINES.items()]
    if section.traversed is not None:
        dot: dict[str, Any] = {"marker": ".", "ms": 5, "color": plotting.BLUE}
        handles.append(Line2D([], [], ls="none", label="reachable by traversal", **dot))
    handles.append(Line2D([], [], **{**START, "markersize": 10}, label="initial position"))
    return handles

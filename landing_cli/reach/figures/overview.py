"""All cases of a run on one page: the maps of their velocity increments in one colour scale."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from landing_cli.reach.figures.fields import border_segments, level_segments, spread_over_mesh
from landing_cli.reach.figures.parts import (
    BORDER,
    LEVELS,
    START,
    KeyEntry,
    Paint,
    body_name,
    craft_facts,
    draw_arrow_head,
    legend_handles,
    paint_delta_v,
    scale_levels,
    sights,
)
from landing_cli.reach.records import LandingCase
from landing_cli.reach.stored import CaseResult, ReachRun
from landing_cli.results import plotting
from landing_cli.results.surface_map import (
    SurfaceMap,
    draw_facets,
    draw_map_segments,
    frame_small_map,
    lon_lat_deg,
    place_name,
)
from landing_cli.results.surface_view import draw_scale_bar, draw_segments, draw_surface, reach_m, view_from

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.cm import ScalarMappable
    from matplotlib.figure import Figure


class _Page:
    """Places on the page, in inches; a row is a globe and its maps."""

    map_width, gap, globe, left = 2.62, 0.13, 1.6, 2.12
    top, bottom = 0.66, 0.86

    def __init__(self, rows: int, columns: int) -> None:
        self.row = 0.5 * self.map_width + 0.68
        self.width = max(self.left + columns * (self.map_width + self.gap), 7.6)
        self.height = self.top + rows * self.row + self.bottom

    def box(self, left: float, top: float, width: float, height: float) -> tuple[float, float, float, float]:
        """Left, bottom, width and height as fractions of the page."""
        return (
            left / self.width,
            1.0 - (top + height) / self.height,
            width / self.width,
            height / self.height,
        )

    def map_box(self, row: int, column: int) -> tuple[float, float, float, float]:
        """Where a map stands."""
        top = self.top + row * self.row + 0.48
        left = self.left + column * (self.map_width + self.gap)
        return self.box(left, top, self.map_width, 0.5 * self.map_width)

    def globe_box(self, row: int) -> tuple[float, float, float, float]:
        """Where a row's view of the body stands."""
        return self.box(0.05, self.top + row * self.row + 0.32, self.globe, self.globe)


def overview_figure(run: ReachRun, surface: SurfaceMap, scale: ScalarMappable) -> Figure:
    """Show every case: a row an initial position, times of flight from left to right.

    Parameters
    ----------
    run : ReachRun
        The run.
    surface : SurfaceMap
        The mesh in longitude and latitude.
    scale : ScalarMappable
        Colours of velocity increments, m/s.

    Returns
    -------
    Figure
    """
    rows: dict[str, list[CaseResult]] = {}
    for result in sorted(run.cases, key=lambda result: result.case.tof_s):
        rows.setdefault(result.initial_state, []).append(result)
    states = list(dict.fromkeys(result.initial_state for result in run.cases))
    page = _Page(len(rows), max(map(len, rows.values())))
    figure = plotting.new_figure(page.width, page.height)
    plotting.add_title(
        figure,
        f"{body_name(run.cases[0].case)}: where the spacecraft can land, and at what velocity increment",
        f"{len(run.asteroid.mesh.faces)} facets; {craft_facts(run.cases[0].case)}",
    )
    key: dict[str, KeyEntry] = {}
    for i, state in enumerate(states):
        x, y, _, _ = page.box(0.12, page.top + i * page.row, 0.0, 0.2)
        figure.text(
            x, y, _whence(state, rows[state][0].case), fontsize=9.5, fontweight="bold", parse_math=False
        )
        _draw_globe(figure.add_axes(page.globe_box(i)), rows[state][0], scale)
        for k, result in enumerate(rows[state]):
            axes = figure.add_axes(page.map_box(i, k))
            paint = _draw_map(axes, result, surface, scale)
            key |= {entry.label: entry for entry in paint.key}
            frame_small_map(axes, left=k == 0, below=i == len(rows) - 1)
    _explain(figure, page, list(key.values()), scale)
    return figure


def _whence(state: str, case: LandingCase) -> str:
    distance = float(np.linalg.norm(case.position_m))
    far = f"{distance / 1e3:.4g} km" if distance >= 1e3 else f"{distance:.0f} m"
    name = state.replace("_", " ")
    return f"{name[:1].upper()}{name[1:]}: {far} from the centre of mass, over {place_name(case.position_m)}"


def _draw_map(axes: Axes, result: CaseResult, surface: SurfaceMap, scale: ScalarMappable) -> Paint:
    fields, mesh = spread_over_mesh(result), result.case.asteroid.mesh
    paint = paint_delta_v(fields, scale)
    draw_facets(axes, surface, paint.colours, paint.hatched)
    draw_map_segments(axes, level_segments(mesh, fields.delta_v_m_s, scale_levels(scale)), **LEVELS)
    draw_map_segments(
        axes, border_segments(mesh, fields.reachable, fields.asked & ~fields.reachable), **BORDER
    )
    axes.plot(*lon_lat_deg(result.case.position_m), **START, clip_on=False, zorder=6)
    asked = int(fields.asked.sum())
    share = 100.0 * fields.reachable.sum() / max(asked, 1)
    axes.set_title(f"{result.case.tof_s:g} s", fontweight="bold")
    of = "" if fields.asked.all() else f"of {asked} asked "
    axes.set_title(f"{share:.3g} % {of}reachable", loc="right")
    return paint


def _draw_globe(axes: Axes, result: CaseResult, scale: ScalarMappable) -> None:
    """Show the body from near the initial position, in the colours of a case."""
    fields, mesh = spread_over_mesh(result), result.case.asteroid.mesh
    paint = paint_delta_v(fields, scale)
    view = view_from(sights(result.case.position_m, 55.0)[0])
    draw_surface(axes, mesh, view, paint.colours, paint.hatched)
    border = border_segments(mesh, fields.reachable, fields.asked & ~fields.reachable)
    draw_segments(axes, mesh, view, border, **BORDER)
    up = result.case.position_m / np.linalg.norm(result.case.position_m)
    highest = up * (mesh.vertices @ up).max()
    way = view.flat(np.stack([highest + 0.9 * reach_m(mesh, view) * up, highest]))
    axes.plot(*way.T, color=plotting.INK, lw=1.0, zorder=5)
    draw_arrow_head(axes, way[1], way[0])
    reach = 1.25 * reach_m(mesh, view)
    axes.set(xlim=(-reach, reach), ylim=(-reach, reach), aspect="equal")
    axes.axis("off")
    draw_scale_bar(axes, reach)


def _explain(figure: Figure, page: _Page, key: Sequence[KeyEntry], scale: ScalarMappable) -> None:
    """Colour bar at the lower left, marks beside it."""
    low = page.height - 0.56
    place = figure.add_axes(page.box(0.2, low, 2.9, 0.13))
    bar = figure.colorbar(scale, cax=place, orientation="horizontal")
    bar.set_label("velocity increment (m/s)", labelpad=2)
    bar.outline.set_visible(False)
    x, y, _, _ = page.box(3.35, low - 0.06, 0.0, 0.0)
    handles = legend_handles(key, border=True, levels=scale, counts=False)
    figure.legend(
        handles=handles, loc="upper left", bbox_to_anchor=(x, y), ncols=3, columnspacing=1.6, borderpad=0
    )

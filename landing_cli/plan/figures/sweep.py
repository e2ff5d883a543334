"""From where the site can be reached: a success map over the longitudes of the start (Lyu 2026, fig 12)."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from landing_cli.plan.figures.parts import LIMIT, TOUCHDOWN, FloatArray, draw_body, title_of
from landing_cli.plan.stored import PlanEntry
from landing_cli.plan.summary import cause_of, summarise_sweep
from landing_cli.results import plotting
from landing_cli.results.surface_view import draw_triad, label_axes, view_from

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

_SHOWN = 10
_CAUSES = {
    "planned": ("planned", plotting.BLUE),
    "thrust": ("needs more thrust", plotting.ORANGE),
    "clearance": ("comes too close to the surface", plotting.PURPLE),
    "terrain": ("the body stands in the cone", plotting.GREEN),
    "bounds": ("no guide point fits", plotting.INK),
}
_OTHER = ("refused otherwise", plotting.DARK_GREY)


def shown_of(entries: Sequence[PlanEntry]) -> tuple[PlanEntry, ...]:
    """Some of a sweep's plans, even among those that were accepted: the paper shows ten."""
    planned = [entry for entry in entries if entry.plan.status == "planned"]
    chosen = np.unique(np.linspace(0, len(planned) - 1, min(_SHOWN, len(planned))).round().astype(int))
    return tuple(planned[i] for i in chosen)


def sweep_figure(entries: Sequence[PlanEntry]) -> Figure:
    """Draw the starts around the body by what became of them, and fuel and thrust over longitude.

    Parameters
    ----------
    entries : sequence of PlanEntry
        A sweep's plans.

    Returns
    -------
    Figure
    """
    found = summarise_sweep(entries)
    figure = plotting.new_figure(10.4, 6.0)
    told = (
        f"{found['planned']} of {found['initial_positions']} initial positions planned "
        f"({100 * found['planned_share']:.1f} %), "
        f"{100 * found['geometric_share']:.1f} % clear of the terrain; "
        f"{found['verified']} flown again and verified"
    )
    plotting.add_title(figure, title_of(entries), told)
    kinds = [entry.plan.status if entry.plan.status == "planned" else cause_of(entry) for entry in entries]
    longitudes = np.array([float(str(entry.plan.parameters["longitude_deg"])) for entry in entries])
    _draw_circle(figure.add_axes((0.06, 0.17, 0.4, 0.67)), entries, kinds)
    fuel, thrust = figure.add_axes((0.55, 0.53, 0.43, 0.31)), figure.add_axes((0.55, 0.17, 0.43, 0.27))
    _draw_over_longitude(fuel, longitudes, np.array([e.plan.fuel_kg for e in entries]), kinds)
    fuel.set(ylabel="fuel (kg)", title="b  fuel of the plan, or of the closest curve")
    _draw_over_longitude(thrust, longitudes, np.array([e.plan.peak_thrust_n for e in entries]), kinds)
    limit = entries[0].case.spacecraft.thrust_max_n
    thrust.axhline(limit, **LIMIT)
    thrust.set(
        ylabel="peak thrust (N)", xlabel="longitude of the initial position (°)", title="c  peak thrust"
    )
    thrust.set_ylim(0.0, 3.0 * limit)
    _explain(figure, kinds)
    return figure


def _draw_circle(axes: Axes, entries: Sequence[PlanEntry], kinds: Sequence[str]) -> None:
    view = view_from((0.0, 0.0, 1.0), (0.0, 1.0, 0.0))
    draw_body(axes, entries[0].case, view)
    starts = view.flat(np.array([entry.case.position_m for entry in entries]))
    for kind in dict.fromkeys(kinds):
        own = np.array([k == kind for k in kinds])
        axes.plot(*starts[own].T, **_dot(kind), zorder=5)
    axes.plot(*view.flat(entries[0].case.site.position_m), **TOUCHDOWN, zorder=6)
    reach = 1.08 * float(np.abs(starts).max())
    axes.set(xlim=(-reach, reach), ylim=(-reach, reach))
    label_axes(axes, view)
    draw_triad(axes, view, (0.06, 0.05), 0.05)
    axes.set_title("a  initial positions, seen from +z")


def _draw_over_longitude(
    axes: Axes, longitudes: FloatArray, values: FloatArray, kinds: Sequence[str]
) -> None:
    for kind in dict.fromkeys(kinds):
        own = np.array([k == kind for k in kinds])
        axes.plot(longitudes[own] % 360.0, values[own], **_dot(kind))
    axes.set_xlim(0.0, 360.0)
    axes.set_xticks(np.arange(0, 361, 60))
    axes.grid(True)


def _dot(kind: str) -> dict[str, Any]:
    _, colour = _CAUSES.get(kind, _OTHER)
    return {"marker": "o", "markersize": 3.2, "linestyle": "none", "color": colour}


def _explain(figure: Figure, kinds: Sequence[str]) -> None:
    from matplotlib.lines import Line2D

    handles = []
    for kind in sorted(set(kinds), key=lambda k: list(_CAUSES).index(k) if k in _CAUSES else 99):
        label = f"{_CAUSES.get(kind, _OTHER)[0]} ({sum(k == kind for k in kinds)})"
        handles.append(Line2D([], [], **{**_dot(kind), "markersize": 5}, label=label))
    handles.append(Line2D([], [], **TOUCHDOWN, label="site"))
    figure.legend(handles=handles, loc="lower center", ncols=len(handles), bbox_to_anchor=(0.52, 0.005))

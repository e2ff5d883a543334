"""What is in view, what is known, and the thrust, over time (Shen 2026, figs 11 and 12)."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

from landing_cli.observe.figures.parts import UNSTEERED, colour_of, facts_of, label_of, title_of
from landing_cli.observe.observed import ObservedPath
from landing_cli.observe.stored import ObservationEntry
from landing_cli.results import plotting

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure


def sight_figure(entries: Sequence[ObservationEntry]) -> Figure:
    """Draw the landmarks in view and the position sigma of every path.

    Parameters
    ----------
    entries : sequence of ObservationEntry
        Of one run, at least one.

    Returns
    -------
    Figure
    """
    figure, (upper, lower) = _panels(entries, 2, 6.0)
    for observed, look in _all(entries):
        upper.step(observed.seen.t_s, observed.seen.count, where="post", **look)
        lower.plot(observed.sigma.t_s, observed.sigma.position_sigma_m, **look)
    upper.set(ylabel="landmarks in view", title="a  landmarks in view", ylim=(0.0, None))
    lower.set(yscale="log", ylabel="position sigma (m)", title="b  how well the position is known")
    return figure


def thrust_figure(entries: Sequence[ObservationEntry]) -> Figure:
    """Draw the three components of the thrust acceleration of every path.

    Parameters
    ----------
    entries : sequence of ObservationEntry
        Of one run, at least one.

    Returns
    -------
    Figure
    """
    figure, panels = _panels(entries, 3, 7.2)
    axes = entries[0].case.frame.axes
    for observed, look in _all(entries):
        components = 1e3 * observed.path.acceleration_m_s2 @ axes.T
        for i, panel in enumerate(panels):
            panel.plot(observed.path.t_s, components[:, i], **look)
    for panel, letter, name in zip(panels, "abc", ("x, east", "y, north", "z, up"), strict=True):
        panel.axhline(0.0, color=plotting.DARK_GREY, lw=0.6)
        panel.set(ylabel="thrust over mass (mm/s²)", title=f"{letter}  {name}")
    return figure


def _panels(entries: Sequence[ObservationEntry], count: int, height_in: float) -> tuple[Figure, list[Axes]]:
    figure = plotting.new_figure(9.0, height_in)
    plotting.add_title(figure, title_of(entries), facts_of(entries[0].case))
    grid = figure.add_gridspec(
        count, 1, left=0.085, right=0.98, top=1 - 0.85 / height_in, bottom=1.0 / height_in, hspace=0.3
    )
    panels = [figure.add_subplot(grid[i, 0]) for i in range(count)]
    tof_s = entries[0].observation.nominal.path.tof_s
    for panel in panels:
        panel.set_xlim(0.0, tof_s)
        panel.grid(True)
    panels[-1].set_xlabel("time (s)")
    _explain(figure, entries)
    return figure, panels


def _all(entries: Sequence[ObservationEntry]) -> list[tuple[ObservedPath, dict[str, Any]]]:
    found: list[tuple[ObservedPath, dict[str, Any]]] = [
        (entry.observation.steered, {"color": colour_of(i, len(entries)), "lw": 1.4})
        for i, entry in enumerate(entries)
    ]
    return [(entries[0].observation.nominal, {**UNSTEERED, "zorder": 5}), *found]


def _explain(figure: Figure, entries: Sequence[ObservationEntry]) -> None:
    from matplotlib.lines import Line2D

    handles = [Line2D([], [], **UNSTEERED, label="unsteered")]
    handles += [
        Line2D([], [], color=colour_of(i, len(entries)), label=label_of(entry))
        for i, entry in enumerate(entries)
    ]
    figure.legend(handles=handles, loc="lower center", ncols=5, bbox_to_anchor=(0.5, 0.0))

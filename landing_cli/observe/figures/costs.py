"""What steering costs against what it brings: by waypoints (Shen 2026, fig 13), and fuel against sigma."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from landing_cli.observe.figures.parts import facts_of, title_of
from landing_cli.observe.stored import ObservationEntry
from landing_cli.results import plotting

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure


def costs_figure(entries: Sequence[ObservationEntry]) -> Figure:
    """Draw propellant and J, and what is seen, against the number of waypoints.

    Parameters
    ----------
    entries : sequence of ObservationEntry
        Of one run, two of the energy objective or more.

    Returns
    -------
    Figure
    """
    steered = sorted((entry for entry in entries if entry.observation.objective == "energy"), key=_waypoints)
    names = [str(_waypoints(entry)) for entry in steered]
    paths = [entry.observation.steered for entry in steered]

    def paths_of(quantity: str, scale: float) -> list[float]:
        return [scale * getattr(p.path, quantity) for p in paths]

    figure = plotting.new_figure(10.0, 4.4)
    plotting.add_title(figure, title_of(entries), facts_of(entries[0].case))
    left, right = (figure.add_axes((0.08 + 0.5 * i, 0.15, 0.36, 0.63)) for i in range(2))
    _pair(
        left,
        names,
        (paths_of("propellant_mass_fraction", 100.0), "propellant mass fraction (%)", plotting.BLUE),
        (paths_of("performance_index_m2_s3", 1e3), "J (10⁻³ m²/s³)", plotting.RED),
    )
    left.set_title("a  what it costs")
    _pair(
        right,
        names,
        ([p.seen.mean_in_view for p in paths], "landmarks in view, mean", plotting.GREEN),
        ([float(p.seen.distinct) for p in paths], "distinct landmarks seen", plotting.PURPLE),
    )
    right.set_title("b  what it brings")
    return figure


def front_figure(entries: Sequence[ObservationEntry]) -> Figure:
    """Draw the mean position sigma of every path against its energy and its propellant.

    Parameters
    ----------
    entries : sequence of ObservationEntry
        Of one run, two or more.

    Returns
    -------
    Figure
    """
    figure = plotting.new_figure(10.0, 4.6)
    plotting.add_title(figure, title_of(entries), facts_of(entries[0].case))
    panels = [figure.add_axes((0.075 + 0.5 * i, 0.13, 0.41, 0.66)) for i in range(2)]
    for panel, name, label in zip(
        panels,
        ("performance_index_m2_s3", "propellant_mass_fraction"),
        ("J (10⁻³ m²/s³)", "propellant mass fraction (10⁻³)"),
        strict=True,
    ):
        _draw_front(panel, entries, name)
        panel.set(xlabel=label, ylabel="mean position sigma (m)")
        panel.grid(True)
    panels[0].legend(loc="best")
    return figure


def _draw_front(axes: Axes, entries: Sequence[ObservationEntry], quantity: str) -> None:
    informed = [entry for entry in entries if entry.observation.objective == "information"]
    steered = [entry for entry in entries if entry.observation.objective == "energy"]
    nominal = entries[0].observation.nominal
    for group, colour, marker, name in (
        (steered, plotting.BLUE, "v", "waypoints m"),
        (informed, plotting.RED, "o", "information, weight"),
    ):
        if not group:
            continue
        points = np.array(
            [
                (1e3 * getattr(e.observation.steered.path, quantity), e.observation.steered.sigma.mean_m)
                for e in group
            ]
        )
        order = np.argsort(points[:, 0])
        # between two points of the front nothing is known but that the dearer one is no better
        look: dict[str, Any] = {"ls": "-", "drawstyle": "steps-post"} if group is informed else {"ls": "none"}
        axes.plot(*points[order].T, color=colour, marker=marker, lw=1.0, markersize=6, label=name, **look)
        for entry, point in zip(group, points, strict=True):
            told = (
                f"{entry.observation.parameters['weight']:g}" if group is informed else f"{_waypoints(entry)}"
            )
            axes.annotate(told, point, xytext=(5, 5), textcoords="offset points", fontsize=8, color=colour)
    axes.plot(
        1e3 * getattr(nominal.path, quantity),
        nominal.sigma.mean_m,
        color=plotting.INK,
        marker="x",
        ls="none",
        markersize=7,
        label="unsteered",
    )


def _waypoints(entry: ObservationEntry) -> int:
    waypoints = entry.observation.waypoints
    return 0 if waypoints is None else len(waypoints.t_s)


def _pair(axes: Axes, names: Sequence[str], *series: tuple[Sequence[float], str, str]) -> None:
    """Draw two quantities over the number of waypoints, each on an axis of its own colour."""
    other = axes.twinx()
    other.spines["right"].set_visible(True)
    for panel, (values, label, colour), marker in zip((axes, other), series, "so", strict=True):
        panel.plot(range(len(names)), values, color=colour, marker=marker, lw=1.2)
        panel.set_ylabel(label, color=colour)
        panel.margins(x=0.1, y=0.15)
    axes.set_xticks(range(len(names)), names)
    axes.set_xlabel("waypoints m")

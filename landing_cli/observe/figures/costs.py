"""What steering costs against what it brings: by waypoints (Shen 2026, fig 13), and fuel against sigma."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

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
    figure = plotting.new_figure(10.0, 4.4)
    plotting.add_title(figure, title_of(entries), facts_of(entries[0].case))
    left, right = (figure.add_axes((0.08 + 0.5 * i, 0.15, 0.36, 0.63)) for i in range(2))
    _bars(left, names, [100 * p.path.propellant_mass_fraction for p in paths], plotting.BLUE)
    left.set(ylabel="propellant mass fraction (%)", title="a  propellant (bars) and J (points)")
    _points(left, names, [1e3 * p.path.performance_index_m2_s3 for p in paths], "J (10⁻³ m²/s³)")
    _bars(right, names, [p.seen.mean_in_view for p in paths], plotting.GREEN)
    right.set(ylabel="landmarks in view, mean", title="b  in view at a time (bars) and distinct (points)")
    _points(right, names, [p.seen.distinct for p in paths], "distinct landmarks seen")
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
        line = "-" if group is informed else "none"
        axes.plot(*points[order].T, color=colour, marker=marker, ls=line, lw=1.0, markersize=6, label=name)
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


def _bars(axes: Axes, names: Sequence[str], values: Sequence[float], colour: str) -> None:
    axes.bar(range(len(names)), values, color=colour, alpha=0.45, width=0.6)
    axes.set_xticks(range(len(names)), names)
    axes.set(xlabel="waypoints m")


def _points(axes: Axes, names: Sequence[str], values: Sequence[float], label: str) -> None:
    """Mark a second quantity on an axis of its own."""
    other = axes.twinx()
    other.spines["right"].set_visible(True)
    other.plot(range(len(names)), values, color=plotting.RED, marker="o", lw=1.0)
    other.set(ylabel=label, ylim=(0.0, 1.1 * max([*values, 1e-12])))

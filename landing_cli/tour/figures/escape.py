"""What leaving a body takes over altitudes of periapsis and apoapsis (Liu 2023, fig 1)."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from landing_cli.results import plotting
from landing_cli.tour.escape_records import EscapeFlight, EscapeMap

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_LEVELS = 14


def escape_figure(entry: EscapeMap, flights: Sequence[EscapeFlight]) -> Figure:
    """Draw a map as contours; on the Earth's, the orbits that were flown.

    Parameters
    ----------
    entry : EscapeMap
        The map.
    flights : sequence of EscapeFlight
        About the Earth.

    Returns
    -------
    Figure
    """
    figure = plotting.new_figure(7.6, 5.6)
    found = entry.delta_v_m_s
    told = f"{np.nanmin(found):.1f} to {np.nanmax(found):.1f} m/s at the periapsis, two-body"
    plotting.add_title(figure, f"Escape from the {entry.name.title()}", told)
    axes = figure.add_axes((0.12, 0.12, 0.83, 0.74))
    x, y = entry.periapsis_altitude_m / 1e6, entry.apoapsis_altitude_m / 1e6
    values = np.ma.masked_invalid(found.T)
    levels = _levels(float(np.nanmin(found)), float(np.nanmax(found)))
    axes.contourf(x, y, values, levels=levels, cmap=plotting.delta_v_colours(), extend="both", alpha=0.85)
    lines = axes.contour(x, y, values, levels=levels, colors=plotting.INK, linewidths=0.7)
    for label in axes.clabel(lines, fmt="%g", fontsize=8):
        label.set_fontfamily("DejaVu Sans")
    if entry.name == "earth":
        for flight in flights:
            place = flight.perigee_altitude_m / 1e6, flight.apogee_altitude_m / 1e6
            if x[0] <= place[0] <= x[-1] and y[0] <= place[1] <= y[-1]:
                axes.plot(*place, marker="D", ms=6, color=plotting.RED, clip_on=False, zorder=5)
                axes.annotate(
                    f"flown: {flight.flown_m_s:.1f} m/s ({flight.two_body_m_s:.1f} two-body)",
                    place,
                    (9, 3),
                    textcoords="offset points",
                    color=plotting.RED,
                    fontsize=8.5,
                )
    axes.set(xlabel="periapsis altitude (1000 km)", ylabel="apoapsis altitude (1000 km)")
    return figure


def _levels(least: float, most: float) -> list[float]:
    """Round values that cut the range into about `_LEVELS` parts, denser where it is flat."""
    spread = np.geomspace(max(least, 1.0), max(most, 2.0), _LEVELS)[1:-1]
    return sorted({float(f"{value:.2g}") for value in spread})

"""The flight of a chain about the Sun, and its distance from the Earth (Liu 2023, fig 3)."""

from __future__ import annotations

from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from landing_cli.flight.astronomy import AU_M, DAY_S, GM_SUN_M3_S2
from landing_cli.flight.elements import states_at
from landing_cli.results import plotting
from landing_cli.tour.records import Leg
from landing_cli.tour.run_records import ChainEntry, ChainPath
from landing_cli.tour.time_scales import t_s_to_utc

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

FloatArray = NDArray[np.float64]

_COLOURS = (
    plotting.BLUE,
    plotting.RED,
    plotting.GREEN,
    plotting.PURPLE,
    plotting.ORANGE,
    plotting.SKY,
    plotting.DARK_GREY,
)
_ORBIT_POINTS = 361


def colour_of(leg: int) -> str:
    """Colour of a leg, of its asteroid and of that orbit.

    Parameters
    ----------
    leg : int
        0 for the first.
    """
    return _COLOURS[leg % len(_COLOURS)]


def trajectory_figure(entry: ChainEntry) -> Figure:
    """Draw the N-body flight of a chain, leg by leg.

    Parameters
    ----------
    entry : ChainEntry
        With a path.

    Returns
    -------
    Figure
    """
    chain, path = entry.chain, entry.path
    assert path is not None
    assert chain.nbody_legs is not None
    figure = plotting.new_figure(11.6, 6.3)
    plural = "asteroid" if len(chain.legs) == 1 else "asteroids"
    title = f"{entry.facts.name}: {entry.name.replace('_', ' ')}, {len(chain.legs)} {plural}"
    told = (
        f"{chain.nbody_delta_v_m_s:.1f} m/s in N-body ({chain.delta_v_m_s:.1f} two-body), "
        f"{chain.duration_s / DAY_S:.1f} d from {t_s_to_utc(chain.departure_t_s)[:10]}"
    )
    plotting.add_title(figure, title, told)
    plane, distance = figure.add_axes((0.06, 0.09, 0.47, 0.78)), figure.add_axes((0.62, 0.09, 0.36, 0.78))
    _draw_plane(plane, entry, path, chain.nbody_legs)
    _draw_distance(distance, entry, path, chain.nbody_legs)
    return figure


def legs_of_path(path: ChainPath, legs: tuple[Leg, ...]) -> list[NDArray[np.bool_]]:
    """Samples of each leg: from the flyby before it, or the departure, to its own.

    Parameters
    ----------
    path : ChainPath
        The flight.
    legs : tuple of Leg
        Of the chain.

    Returns
    -------
    list of (n,) bool
    """
    ends = [path.t_s[0], *(leg.arrival_t_s for leg in legs)]
    return [(path.t_s >= a) & (path.t_s <= b) for a, b in pairwise(ends)]


def _draw_plane(axes: Axes, entry: ChainEntry, path: ChainPath, legs: tuple[Leg, ...]) -> None:
    axes.plot(*_flat(path.earth_m), color=plotting.GREY, lw=3.0, zorder=1)
    axes.plot(0.0, 0.0, marker="o", color=plotting.YELLOW, mec=plotting.INK, mew=0.6, ms=9, zorder=6)
    reach = 1.15 * np.abs(path.position_m[:, :2]).max() / AU_M
    for i, (leg, own) in enumerate(zip(legs, legs_of_path(path, legs), strict=True)):
        colour = colour_of(i)
        axes.plot(*_flat(_orbit(entry, leg)), color=colour, lw=0.7, ls=(0, (3, 2)), zorder=2)
        axes.plot(*_flat(path.position_m[own]), color=colour, lw=1.8, zorder=4)
        x, y = _flat(entry.chain.flybys[i].position_m[None])
        axes.plot(x, y, marker="o", color=colour, ms=6, mec="white", mew=0.8, zorder=7)
        axes.annotate(
            leg.designation,
            (x[0], y[0]),
            (7, 6 if i % 2 else -11),
            textcoords="offset points",
            color=colour,
            fontsize=8.5,
            zorder=8,
        )
    x, y = _flat(path.position_m[:1])
    axes.plot(x, y, marker="D", color=plotting.INK, ms=5, zorder=7)
    axes.annotate("departure", (x[0], y[0]), (-8, 6), textcoords="offset points", ha="right", fontsize=8.5)
    axes.set(xlim=(-reach, reach), ylim=(-reach, reach), xlabel="x (au)", ylabel="y (au)")
    axes.set_aspect("equal")
    axes.set_title("a  heliocentric, ecliptic of J2000; grey: the Earth; dashed: the asteroids' orbits")
    axes.grid(True)


def _draw_distance(axes: Axes, entry: ChainEntry, path: ChainPath, legs: tuple[Leg, ...]) -> None:
    days = (path.t_s - path.t_s[0]) / DAY_S
    distances = np.linalg.norm(path.position_m - path.earth_m, axis=1) / 1e9
    for i, (leg, own) in enumerate(zip(legs, legs_of_path(path, legs), strict=True)):
        flyby, colour = entry.chain.flybys[i], colour_of(i)
        axes.plot(days[own], distances[own], color=colour)
        at = (leg.arrival_t_s - path.t_s[0]) / DAY_S
        high = flyby.geocentric_distance_m / 1e9
        axes.plot(at, high, marker="o", color=colour, ms=6, mec="white", mew=0.8, zorder=5)
        told = (
            f"{t_s_to_utc(flyby.t_s)[:10]}  {leg.designation}: {leg.size_m_s:.1f} m/s, "
            f"passes at {flyby.speed_m_s / 1e3:.1f} km/s"
        )
        axes.text(0.03, 0.965 - 0.042 * i, told, transform=axes.transAxes, fontsize=8, color=colour, va="top")
        burn = (leg.burn_t_s - path.t_s[0]) / DAY_S
        axes.plot(burn, np.interp(burn, days, distances), marker="^", color=colour, ms=6, zorder=6)
    axes.set(xlabel="time since the departure (d)", ylabel="distance from the Earth (million km)")
    axes.set_xlim(-0.02 * days[-1], 1.04 * days[-1])
    axes.set_ylim(0.0, (1.08 + 0.05 * len(legs)) * distances.max())
    axes.set_title("b  distance from the Earth; triangles: burns")
    axes.grid(True)


def _orbit(entry: ChainEntry, leg: Leg) -> FloatArray:
    """The asteroid's osculating orbit, once round."""
    elements = entry.facts.targets.elements.rows([leg.target])
    period = 2.0 * np.pi * np.sqrt(elements.a_m[0] ** 3 / GM_SUN_M3_S2)
    times = elements.epoch_t_s[0] + np.linspace(0.0, period, _ORBIT_POINTS)
    return np.array([states_at(elements, t)[0, :3] for t in times])


def _flat(position_m: FloatArray) -> tuple[FloatArray, FloatArray]:
    return position_m[:, 0] / AU_M, position_m[:, 1] / AU_M

"""What the figures of observations share: marks, colours, names, and the ground around the site."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from landing_cli.body.ray_cast import first_hits
from landing_cli.observe.observed import ObservedPath
from landing_cli.observe.records import ObserveCase
from landing_cli.observe.stored import ObservationEntry
from landing_cli.results import plotting

FloatArray = NDArray[np.float64]

START: Mapping[str, Any] = {
    "marker": "*",
    "markersize": 11,
    "color": "white",
    "markeredgecolor": plotting.INK,
    "markeredgewidth": 0.8,
    "linestyle": "none",
}
SITE: Mapping[str, Any] = {"marker": "o", "color": plotting.RED, "linestyle": "none", "markersize": 5.5}
UNSEEN: Mapping[str, Any] = {"marker": "^", "color": plotting.INK, "linestyle": "none", "markersize": 3.6}
SEEN: Mapping[str, Any] = {"marker": "^", "color": plotting.PURPLE, "linestyle": "none", "markersize": 4.6}
WAYPOINT: Mapping[str, Any] = {
    "marker": "v",
    "color": "white",
    "markeredgecolor": plotting.BLUE,
    "markeredgewidth": 1.2,
    "linestyle": "none",
    "markersize": 6.5,
}
CONTROL: Mapping[str, Any] = {
    "marker": "D",
    "color": "white",
    "markeredgecolor": plotting.ORANGE,
    "markeredgewidth": 1.2,
    "linestyle": "none",
    "markersize": 5.5,
}
CENTRE: Mapping[str, Any] = {
    "marker": "x",
    "color": plotting.RED,
    "linestyle": "none",
    "markersize": 7,
    "markeredgewidth": 1.6,
}
CURVE: Mapping[str, Any] = {"color": plotting.ORANGE, "lw": 1.1, "ls": (0, (4, 2))}
UNSTEERED: Mapping[str, Any] = {"color": plotting.INK, "lw": 1.5, "ls": (0, (1, 1))}

_COLOURS = (plotting.BLUE, plotting.GREEN, plotting.ORANGE, plotting.PURPLE, plotting.SKY, plotting.RED)
_ABOVE = 4.0  # heights of the flight at which rays to the ground begin


def colour_of(index: int, count: int) -> Any:
    """Colour of one of several observations: told apart one by one, or a scale where there are many."""
    if count <= len(_COLOURS):
        return _COLOURS[index]
    from matplotlib import colormaps

    return colormaps["viridis"](0.92 * index / max(1, count - 1))


def label_of(entry: ObservationEntry) -> str:
    """Name an observation as a reader of the paper would."""
    if entry.observation.objective == "information":
        return f"information, weight {entry.observation.parameters.get('weight', 0.0):g}"
    waypoints = entry.observation.waypoints
    return f"m = {0 if waypoints is None else len(waypoints.t_s)}"


def title_of(entries: Sequence[ObservationEntry]) -> str:
    """Body, site and time of flight."""
    case = entries[0].case
    where = f"facet {case.frame.facet}" if case.frame.facet >= 0 else "a given site"
    tof_s = entries[0].observation.nominal.path.tof_s
    return f"{case.asteroid.name}: landing on {where} in {tof_s:.6g} s"


def facts_of(case: ObserveCase) -> str:
    """The landmarks and the instrument."""
    sensor = case.sensor
    light = "" if sensor.kind == "lidar" else ", lit" if case.sun_direction is not None else ", no sun given"
    return (
        f"{len(case.landmarks.position_m)} landmarks; {sensor.kind}, "
        f"{2 * np.degrees(sensor.half_field_of_view_rad):g}° field of view towards {sensor.boresight}, "
        f"{sensor.rate_hz:g} Hz{light}; {case.frame.kind} site frame"
    )


def told_of(observed: ObservedPath) -> str:
    """What a path costs, sees and knows."""
    path, seen, sigma = observed.path, observed.seen, observed.sigma
    count = seen.visible.shape[1]
    return (
        f"J {path.performance_index_m2_s3:.5g} m²/s³, "
        f"{100 * path.propellant_mass_fraction:.3g} % propellant; "
        f"sees {seen.distinct} of {count}, {seen.mean_in_view:.2f} at a time, "
        f"none for {seen.longest_gap_s:.4g} s; "
        f"mean position sigma {sigma.mean_m:.3g} m"
    )


def site_points(case: ObserveCase, observed: ObservedPath) -> FloatArray:
    """The nodes of a path in the site frame, (k, 3) float, m."""
    return case.frame.to_site(observed.path.position_m)


def scene_box(entries: Sequence[ObservationEntry]) -> tuple[FloatArray, FloatArray]:
    """Least and largest x and y of everything that is drawn, m, site frame, with a margin."""
    case, first = entries[0].case, entries[0].observation
    points = [case.frame.to_site(case.landmarks.position_m)[:, :2], np.zeros((1, 2))]
    points += [site_points(case, first.nominal)[:, :2]]
    points += [site_points(case, entry.observation.steered)[:, :2] for entry in entries]
    points += [e.observation.waypoints.curve_m for e in entries if e.observation.waypoints is not None]
    everything = np.concatenate(points)
    low, high = everything.min(axis=0), everything.max(axis=0)
    middle, half = 0.5 * (low + high), 0.56 * float((high - low).max())
    return middle - half, middle + half


def ground_heights(case: ObserveCase, x_m: FloatArray, y_m: FloatArray) -> FloatArray:
    """Height of the surface below points of the site frame's x-y plane; NaN where there is none.

    Parameters
    ----------
    case : ObserveCase
        Whose surface.
    x_m, y_m : (k,) float, m, site frame
        Points.

    Returns
    -------
    (k,) float, m
    """
    above = _ABOVE * max(1.0, float(np.abs(case.frame.to_site(case.position_m)).max()))
    starts = case.frame.to_body(np.stack([x_m, y_m, np.full(len(x_m), above)], axis=1))
    down = np.tile(-case.frame.axes[2], (len(x_m), 1))
    distance, _ = first_hits(case.surface, starts, down)
    return np.where(np.isfinite(distance), above - distance, np.nan)

"""Paths, and what they see, as arrays: in result files and in journals."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, get_args

import numpy as np
from numpy.typing import NDArray

from landing_cli.observe.observed import ObservedPath, Path, Seen, Sigma, Waypoints
from landing_cli.observe.records import REJECTIONS, PathStatus, WaypointTiming
from landing_cli.results.body_checks import bounded
from landing_cli.results.tree import Dataset, Group

Arrays = dict[str, NDArray[Any]]
Facts = dict[str, Any]
Column = tuple[str, str, str, tuple[str, ...]]  # name, units, meaning, dimensions

LARGEST = 1e12
"""Beyond any position, speed or time of a landing: what is larger is no number of ours."""

PARTS: Mapping[str, tuple[Column, ...]] = {
    "path": (
        ("t_s", "s", "time since the initial state", ("node",)),
        ("position_m", "m", "position, body frame", ("node", "xyz")),
        ("velocity_m_s", "m s-1", "velocity relative to the rotating body frame", ("node", "xyz")),
        ("acceleration_m_s2", "m s-2", "thrust over mass, linear between nodes, body frame", ("node", "xyz")),
    ),
    "seen": (
        ("t_s", "s", "time of the sensor", ("time",)),
        ("visible", "1", "whether the landmark is in view", ("time", "landmark")),
    ),
    "sigma": (
        ("t_s", "s", "time of the sensor", ("time",)),
        ("position_sigma_m", "m", "root of the trace of the position covariance", ("time",)),
    ),
}
WAYPOINTS: tuple[Column, ...] = (
    ("t_s", "s", "time at which the waypoint is passed", ("waypoint",)),
    ("position_m", "m", "waypoint, site frame", ("waypoint", "xy")),
    ("curve_m", "m", "control points of the Bezier curve, site frame", ("point", "xy")),
)
_PATH_NUMBERS = (
    "performance_index_m2_s3",
    "delta_v_m_s",
    "propellant_mass_fraction",
    "peak_thrust_n",
    "clearance_min_m",
    "glide_slope_max_rad",
)


def observed_arrays(observed: ObservedPath) -> Arrays:
    """Return the arrays of a path and its sight, named ``<part>_<column>``."""
    return {
        f"{part}_{name}": getattr(getattr(observed, part), name)
        for part, columns in PARTS.items()
        for name, *_ in columns
    }


def observed_facts(observed: ObservedPath) -> Facts:
    """Return the numbers and words of a path and its sight."""
    path, seen = observed.path, observed.seen
    facts: Facts = {name: getattr(path, name) for name in (*_PATH_NUMBERS, "iterations")}
    facts |= {"status": path.status, "message": path.message, "lit": int(seen.lit)}
    return facts | {f"rejected_{name}": int(seen.rejected.get(name, 0)) for name in REJECTIONS}


def make_observed(arrays: Mapping[str, NDArray[Any]], facts: Mapping[str, Any]) -> ObservedPath:
    """Make a path and its sight of what `observed_arrays` and `observed_facts` gave.

    Parameters
    ----------
    arrays : mapping of arrays
        By name.
    facts : mapping
        By name.

    Returns
    -------
    ObservedPath

    Raises
    ------
    KeyError, ValueError, TypeError
        If a part is missing, of another shape or type, or absurd.
    """
    parts: dict[str, dict[str, NDArray[Any]]] = {
        part: {name: arrays[f"{part}_{name}"] for name, *_ in columns} for part, columns in PARTS.items()
    }
    for name, values in parts["path"].items():
        _check(name, values, (len(parts["path"]["t_s"]), 3)[: 1 if name == "t_s" else 2])
    for part in ("path", "seen", "sigma"):
        _check_times(part, parts[part]["t_s"])
    times = len(parts["seen"]["t_s"])
    visible = parts["seen"]["visible"]
    if visible.ndim != 2 or len(visible) != times or visible.dtype.kind not in "bu" or (visible > 1).any():
        raise ValueError(f"visible is {visible.dtype} {visible.shape}")
    sigma = parts["sigma"]
    _check("position_sigma_m", sigma["position_sigma_m"], sigma["t_s"].shape)
    numbers: dict[str, Any] = {name: float(facts[name]) for name in _PATH_NUMBERS}
    if facts["status"] not in get_args(PathStatus):
        raise ValueError(f"no status {facts['status']}")
    columns: dict[str, Any] = parts["path"]
    path = Path(
        **columns,
        **numbers,
        status=facts["status"],
        message=str(facts["message"]),
        iterations=int(facts["iterations"]),
    )
    rejected = {name: int(facts[f"rejected_{name}"]) for name in REJECTIONS}
    seen = Seen(parts["seen"]["t_s"], visible.astype(bool), rejected, bool(facts["lit"]))
    return ObservedPath(path, seen, Sigma(sigma["t_s"], sigma["position_sigma_m"]))


def observed_to_members(observed: ObservedPath) -> dict[str, Dataset | Group]:
    """Lay a path and its sight out for the store, one group a part."""
    arrays = observed_arrays(observed)
    return {
        part: Group({name: Dataset(arrays[f"{part}_{name}"], *told) for name, *told in columns})  # type: ignore[arg-type]
        for part, columns in PARTS.items()
    }


def observed_from_group(group: Group) -> ObservedPath:
    """Rebuild a path and its sight.

    Parameters
    ----------
    group : Group
        With the members of `observed_to_members` and `observed_facts` as attributes.

    Raises
    ------
    KeyError, ValueError, TypeError
        If a part is missing or wrong.
    """
    arrays = {
        f"{part}_{name}": group.group(part).dataset(name).data
        for part, columns in PARTS.items()
        for name, *_ in columns
    }
    return make_observed(arrays, group.attributes)


def make_waypoints(arrays: Mapping[str, NDArray[Any]], timing: Any) -> Waypoints:
    """Make waypoints of their arrays.

    Parameters
    ----------
    arrays : mapping of arrays
        By the names of `WAYPOINTS`.
    timing : str
        How they are timed.

    Raises
    ------
    KeyError, ValueError
        If an array is missing or wrong.
    """
    if timing not in get_args(WaypointTiming):
        raise ValueError(f"no timing {timing}")
    count = len(arrays["t_s"])
    _check("t_s", arrays["t_s"], (count,))
    _check("position_m", arrays["position_m"], (count, 2))
    _check("curve_m", arrays["curve_m"], (len(arrays["curve_m"]), 2))
    return Waypoints(arrays["t_s"], arrays["position_m"], arrays["curve_m"], timing)


def _check(name: str, values: NDArray[Any], shape: tuple[int, ...]) -> None:
    if values.dtype != np.float64 or values.shape != shape:
        raise ValueError(f"{name} is {values.dtype} {values.shape}")
    bounded(name, values, LARGEST)


def _check_times(part: str, t_s: NDArray[Any]) -> None:
    _check("t_s", t_s, (len(t_s),))
    if len(t_s) < 2 or t_s[0] != 0.0 or not (np.diff(t_s) > 0.0).all():
        raise ValueError(f"the times of {part} do not increase from 0")

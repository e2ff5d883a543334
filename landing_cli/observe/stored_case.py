"""What an observed landing was asked, as a group of the result file."""

from __future__ import annotations

import math
from dataclasses import asdict
from typing import Any, get_args

import numpy as np

from landing_cli.body.asteroid import Asteroid
from landing_cli.body.bvh import build_surface_index
from landing_cli.flight.spacecraft import Spacecraft
from landing_cli.observe.records import (
    Boresight,
    FrameKind,
    Landmarks,
    ObserveCase,
    Prior,
    Sensor,
    SensorKind,
    SiteFrame,
    TimeOfFlight,
)
from landing_cli.observe.stored_paths import LARGEST
from landing_cli.results.body_checks import bounded
from landing_cli.results.body_group import number, vector
from landing_cli.results.tree import Dataset, Group

_SENSOR_WORDS = {"kind": SensorKind, "boresight": Boresight}
_LANDMARK_COLUMNS = (
    ("position_m", "m", "position, body frame", ("landmark", "xyz")),
    ("normal", "1", "outward unit normal of the facet, body frame", ("landmark", "xyz")),
    ("diameter_m", "m", "diameter, NaN where unknown", ("landmark",)),
    ("facet", "1", "facet of the mesh, 0-based", ("landmark",)),
)


def case_to_group(case: ObserveCase) -> Group:
    """Lay out what was asked, all but body and spacecraft.

    Parameters
    ----------
    case : ObserveCase
        The case.

    Returns
    -------
    Group
    """
    frame = case.frame
    asked: dict[str, Any] = {
        "name": case.name,
        "position_m": case.position_m,
        "velocity_m_s": case.velocity_m_s,
        "site_position_m": frame.origin_m,
        "site_normal": frame.normal,
        "site_facet": frame.facet,
        "frame": frame.kind,
        **{f"frame_{axis}": frame.axes[i] for i, axis in enumerate("xyz")},
        "time_of_flight": case.time_of_flight,
        "tof_s": case.tof_s,
        "tof_range_s": np.array(case.tof_range_s),
        "clearance_free_m": case.clearance_free_m,
        **_given("sun_direction", case.sun_direction),
        **_given("clearance_m", case.clearance_m),
        **_given("glide_slope_half_angle_rad", case.glide_slope_half_angle_rad),
    }
    members: dict[str, Dataset | Group] = {
        "landmarks": _landmarks_to_group(case.landmarks),
        "sensor": Group({}, asdict(case.sensor)),
        "prior": Group({}, asdict(case.prior)),
    }
    return Group(members, asked)


def case_from_group(group: Group, asteroid: Asteroid, spacecraft: Spacecraft) -> ObserveCase:
    """Rebuild what was asked.

    Parameters
    ----------
    group : Group
        From `case_to_group`.
    asteroid : Asteroid
        The body, read already.
    spacecraft : Spacecraft
        The spacecraft, read already.

    Returns
    -------
    ObserveCase

    Raises
    ------
    KeyError, ValueError, TypeError
        If a part is missing or wrong.
    """
    told = group.attributes
    axes = np.stack([vector(group, f"frame_{axis}") for axis in "xyz"])
    if not np.abs(axes @ axes.T - np.eye(3)).max() < 1e-9:
        raise ValueError("the site frame's axes are not orthonormal")
    facet = int(number(group, "site_facet"))
    if not -1 <= facet < len(asteroid.mesh.faces):
        raise ValueError("there is no such facet")
    vectors = {
        name: vector(group, name) for name in ("position_m", "velocity_m_s", "site_position_m", "site_normal")
    }
    for name, values in vectors.items():
        bounded(name, values, LARGEST)
    low, high = np.ravel(np.asarray(told["tof_range_s"], dtype=np.float64))
    frame = SiteFrame(
        vectors["site_position_m"],
        axes,
        _word(told["frame"], FrameKind),
        facet,
        vectors["site_normal"],
    )
    return ObserveCase(
        name=str(told["name"]),
        asteroid=asteroid,
        spacecraft=spacecraft,
        position_m=vectors["position_m"],
        velocity_m_s=vectors["velocity_m_s"],
        frame=frame,
        time_of_flight=_word(told["time_of_flight"], TimeOfFlight),
        tof_s=number(group, "tof_s"),
        tof_range_s=(float(low), float(high)),
        landmarks=_landmarks_from_group(group.group("landmarks"), len(asteroid.mesh.faces)),
        sensor=_sensor_from_group(group.group("sensor")),
        prior=_prior_from_group(group.group("prior")),
        sun_direction=_unit(group, "sun_direction") if "sun_direction" in told else None,
        clearance_m=number(group, "clearance_m") if "clearance_m" in told else None,
        clearance_free_m=number(group, "clearance_free_m"),
        glide_slope_half_angle_rad=(
            number(group, "glide_slope_half_angle_rad") if "glide_slope_half_angle_rad" in told else None
        ),
        surface=build_surface_index(asteroid.mesh),
    )


def _given(name: str, value: Any) -> dict[str, Any]:
    return {} if value is None else {name: value}


def _word(value: Any, words: Any) -> Any:
    if value not in get_args(words):
        raise ValueError(f"no {value!r} among {', '.join(get_args(words))}")
    return value


def _unit(group: Group, name: str) -> Any:
    value = vector(group, name)
    if not abs(float(np.linalg.norm(value)) - 1.0) < 1e-9:
        raise ValueError(f"{name} is no unit vector")
    return value


def _landmarks_to_group(landmarks: Landmarks) -> Group:
    members: dict[str, Dataset | Group] = {
        name: Dataset(getattr(landmarks, name), *told)  # type: ignore[arg-type]
        for name, *told in _LANDMARK_COLUMNS
    }
    members["name"] = Dataset(np.array(landmarks.name, dtype=np.str_), "1", "name", ("landmark",))
    return Group(members)


def _landmarks_from_group(group: Group, facets: int) -> Landmarks:
    position, normal, diameter, facet = (group.dataset(name).data for name, *_ in _LANDMARK_COLUMNS)
    count = len(position)
    names = tuple(str(name) for name in group.dataset("name").data)
    if position.shape != (count, 3) or normal.shape != (count, 3) or diameter.shape != (count,):
        raise ValueError("the landmarks' columns are of different lengths")
    if facet.shape != (count,) or facet.dtype.kind not in "iu" or len(names) != count or not count:
        raise ValueError("the landmarks' columns are of different lengths")
    if not 0 <= facet.min() <= facet.max() < facets:
        raise ValueError("a landmark lies on a facet that does not exist")
    for name, values in (("position_m", position), ("normal", normal)):
        bounded(name, values, LARGEST)
    return Landmarks(position, normal, diameter, names, facet.astype(np.int64))


def _sensor_from_group(group: Group) -> Sensor:
    facts: dict[str, Any] = {
        name: _word(group.attributes[name], _SENSOR_WORDS[name])
        if name in _SENSOR_WORDS
        else number(group, name)
        for name in Sensor.__dataclass_fields__
    }
    sensor = Sensor(**facts)
    for name in ("half_field_of_view_rad", "angle_sigma_rad", "rate_hz"):
        if not 0.0 < facts[name] < math.inf:
            raise ValueError(f"{name} is not positive")
    return sensor


def _prior_from_group(group: Group) -> Prior:
    facts = {name: number(group, name) for name in Prior.__dataclass_fields__}
    for name in ("position_sigma_m", "velocity_sigma_m_s"):
        if not 0.0 < facts[name] < math.inf:
            raise ValueError(f"{name} is not positive")
    return Prior(**facts)

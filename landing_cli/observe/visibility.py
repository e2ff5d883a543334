"""Which landmarks the sensor sees, time by time, and what hides the others."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from landing_cli.body.ray_cast import is_obstructed
from landing_cli.observe.illumination import is_light_needed, is_sun_high, sun_directions
from landing_cli.observe.observed import Path, Seen
from landing_cli.observe.path_samples import positions_at
from landing_cli.observe.records import REJECTIONS, ObserveCase, Sensor, SiteFrame

FloatArray = NDArray[np.float64]
BoolArray = NDArray[np.bool_]

RAY_OFFSET_M = 0.05
"""What is left out of a line of sight at either end, so that a landmark's facet does not hide it."""

_BLOCK_PAIRS = 200_000  # of time and landmark at once: tens of MB
_AT_SITE_M = 1e-6  # nearer to the site, there is no direction to it


def sensor_times(sensor: Sensor, tof_s: float) -> FloatArray:
    """Times at which the sensor measures, (T,) float, s: at its rate from 0, and at touchdown."""
    times = np.arange(math.floor(tof_s * sensor.rate_hz * (1.0 - 1e-12)) + 1) / sensor.rate_hz
    return np.append(times, tof_s)


def seen_along(case: ObserveCase, path: Path) -> Seen:
    """Find which landmarks are in view along a path.

    Parameters
    ----------
    case : ObserveCase
        Sensor, landmarks, sun and surface.
    path : Path
        What is flown.

    Returns
    -------
    Seen
        At the sensor's times.
    """
    times = sensor_times(case.sensor, path.tof_s)
    return seen_at(case, times, positions_at(path, times))


def seen_at(case: ObserveCase, t_s: FloatArray, position_m: FloatArray) -> Seen:
    """Find which landmarks are in view at given times and positions.

    Parameters
    ----------
    case : ObserveCase
        Sensor, landmarks, sun and surface.
    t_s : (T,) float, s
        Times, from the initial state.
    position_m : (T, 3) float, m, body frame
        Of the spacecraft.

    Returns
    -------
    Seen
    """
    visible = np.zeros((len(t_s), len(case.landmarks.name)), dtype=np.bool_)
    rejected = dict.fromkeys(REJECTIONS, 0)
    block = max(1, _BLOCK_PAIRS // max(1, visible.shape[1]))
    for first in range(0, len(t_s), block):
        rows = slice(first, first + block)
        passed = np.ones_like(visible[rows])
        for reason in REJECTIONS:
            failed = passed & ~_passes(case, reason, t_s[rows], position_m[rows], passed)
            rejected[reason] += int(np.count_nonzero(failed))
            passed &= ~failed
        visible[rows] = passed
    return Seen(t_s, visible, rejected, is_light_needed(case.sensor, case.sun_direction))


def boresights(sensor: Sensor, frame: SiteFrame, position_m: FloatArray) -> FloatArray:
    """Where the sensor points.

    Parameters
    ----------
    sensor : Sensor
        Its boresight.
    frame : SiteFrame
        The site. ``nadir`` is its -z all the way: in the radial frame, where the paper's figures draw the
        field of view, this is the direction to the body's origin as it is at the site.
    position_m : (T, 3) float, m, body frame
        Of the spacecraft.

    Returns
    -------
    (T, 3) float, body frame
        Unit vectors; on the site itself a ``site`` boresight is nadir.
    """
    down = np.broadcast_to(-frame.axes[2], position_m.shape)
    if sensor.boresight == "nadir":
        return down
    ahead = frame.origin_m - position_m
    distance = np.linalg.norm(ahead, axis=1, keepdims=True)
    away = distance > _AT_SITE_M
    return np.where(away, ahead / np.where(away, distance, 1.0), down)


def clear_lines(case: ObserveCase, position_m: FloatArray, wanted: BoolArray | None = None) -> BoolArray:
    """Whether nothing stands between the spacecraft and each landmark.

    Parameters
    ----------
    case : ObserveCase
        Landmarks and surface.
    position_m : (T, 3) float, m, body frame
        Of the spacecraft.
    wanted : (T, n) bool, optional
        The pairs of interest; the others are called clear without a ray.

    Returns
    -------
    (T, n) bool
    """
    clear = np.ones((len(position_m), len(case.landmarks.name)), dtype=np.bool_)
    when, which = np.nonzero(clear if wanted is None else wanted)
    targets = case.landmarks.position_m[which]
    clear[when, which] = ~is_obstructed(case.surface, targets, position_m[when], RAY_OFFSET_M)
    return clear


def lit(case: ObserveCase, t_s: FloatArray) -> BoolArray:
    """Whether the sun stands high enough over each landmark; cast shadows are left to `sunlit_lines`.

    Parameters
    ----------
    case : ObserveCase
        Landmarks, sensor and sun.
    t_s : (T,) float, s
        Times, from the initial state.

    Returns
    -------
    (T, n) bool
        All true for a lidar, and where the sun's direction is not known.
    """
    if case.sun_direction is None or not is_light_needed(case.sensor, case.sun_direction):
        return np.ones((len(t_s), len(case.landmarks.name)), dtype=np.bool_)
    sun = sun_directions(case.sun_direction, case.asteroid.rotation_rate_rad_s, t_s)
    return is_sun_high(case.landmarks, sun, case.sensor.incidence_max_rad)


def sunlit_lines(case: ObserveCase, t_s: FloatArray, wanted: BoolArray | None = None) -> BoolArray:
    """Whether no terrain casts its shadow on each landmark.

    Parameters
    ----------
    case : ObserveCase
        Landmarks, sensor, sun and surface.
    t_s : (T,) float, s
        Times, from the initial state.
    wanted : (T, n) bool, optional
        The pairs of interest; the others are called sunlit without a ray.

    Returns
    -------
    (T, n) bool
        All true for a lidar, and where the sun's direction is not known.
    """
    sunlit = np.ones((len(t_s), len(case.landmarks.name)), dtype=np.bool_)
    if case.sun_direction is None or not is_light_needed(case.sensor, case.sun_direction):
        return sunlit
    when, which = np.nonzero(sunlit if wanted is None else wanted)
    sun = sun_directions(case.sun_direction, case.asteroid.rotation_rate_rad_s, t_s)
    outside = 4.0 * float(np.linalg.norm(case.asteroid.mesh.vertices, axis=1).max())
    targets = case.landmarks.position_m[which]
    sunlit[when, which] = ~is_obstructed(case.surface, targets, targets + outside * sun[when], RAY_OFFSET_M)
    return sunlit


def unseen_reason(case: ObserveCase, seen: Seen, position_m: FloatArray) -> str:
    """Say why no landmark is ever in view.

    Parameters
    ----------
    case : ObserveCase
        What was asked.
    seen : Seen
        Without a landmark in view.
    position_m : (T, 3) float, m, body frame
        Of the spacecraft at the times of `seen`.

    Returns
    -------
    str
        What hides how many of the pairs of time and landmark, and by how much the best of them misses the
        test that rejects most.
    """
    total = seen.visible.size
    shares = {name: count / total for name, count in seen.rejected.items() if count}
    told = ", ".join(f"{_NOUNS[name]} {100.0 * share:.3g} %" for name, share in shares.items())
    worst = max(shares, key=lambda name: shares[name])
    advice = _least_miss(case, worst, seen.t_s, position_m)
    return f"the {case.sensor.kind} sees none of {seen.visible.shape[1]} landmarks: {told}; {advice}"


_NOUNS = {
    "range": "out of range",
    "field_of_view": "outside the field of view",
    "emission": "seen too flat",
    "incidence": "lit too flat",
    "occlusion": "behind terrain",
    "shadow": "in shadow",
}


def _lines(case: ObserveCase, position_m: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Vectors from the landmarks to the spacecraft, (T, n, 3), and their lengths, (T, n), m."""
    lines = position_m[:, None] - case.landmarks.position_m
    return lines, np.linalg.norm(lines, axis=2)


def _passes(
    case: ObserveCase, reason: str, t_s: FloatArray, position_m: FloatArray, wanted: BoolArray
) -> BoolArray:
    """One test on all pairs, (T, n) bool; the ones that cost rays only on the wanted pairs."""
    sensor = case.sensor
    if reason == "incidence":
        return lit(case, t_s)
    if reason == "occlusion":
        return clear_lines(case, position_m, wanted)
    if reason == "shadow":
        return sunlit_lines(case, t_s, wanted)
    lines, distance = _lines(case, position_m)
    if reason == "range":
        known = distance > 0.0  # on the landmark itself there is no direction to it
        return np.asarray(known & (distance >= sensor.range_min_m) & (distance <= sensor.range_max_m))
    if reason == "field_of_view":
        ahead = -np.einsum("tnk,tk->tn", lines, boresights(sensor, case.frame, position_m))
        return np.asarray(ahead >= distance * math.cos(sensor.half_field_of_view_rad))
    upwards = np.einsum("tnk,nk->tn", lines, case.landmarks.normal)
    return np.asarray(upwards >= distance * math.cos(sensor.emission_max_rad))


def _least_miss(case: ObserveCase, reason: str, t_s: FloatArray, position_m: FloatArray) -> str:
    """By how much the best pair misses a test."""
    sensor = case.sensor
    lines, distance = _lines(case, position_m)
    if reason == "range":
        near, far = distance.min(), distance.max()
        reach = f"{sensor.range_min_m:g} to {sensor.range_max_m:g} m"
        return f"they are {near:.4g} to {far:.4g} m away, {reach} are in range"
    if reason == "field_of_view":
        ahead = -np.einsum("tnk,tk->tn", lines, boresights(sensor, case.frame, position_m))
        return _angle_miss(ahead / distance, "off the boresight", sensor.half_field_of_view_rad)
    if reason == "emission":
        upwards = np.einsum("tnk,nk->tn", lines, case.landmarks.normal)
        return _angle_miss(upwards / distance, "between normal and line of sight", sensor.emission_max_rad)
    if reason == "incidence":
        assert case.sun_direction is not None
        sun = sun_directions(case.sun_direction, case.asteroid.rotation_rate_rad_s, t_s)
        return _angle_miss(sun @ case.landmarks.normal.T, "between normal and sun", sensor.incidence_max_rad)
    return "another side, start or sun would uncover them"


def _angle_miss(cosine: FloatArray, what: str, most_rad: float) -> str:
    least = math.degrees(math.acos(min(1.0, float(np.nanmax(cosine)))))
    return f"the best is {least:.1f} deg {what}, {math.degrees(most_rad):g} are allowed"

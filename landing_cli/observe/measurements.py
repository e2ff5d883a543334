"""What a lidar or camera tells of the position: the information of landmarks, and its exact slopes.

A lidar measures range and direction to a landmark (Shen 2026, eq 4), a camera the direction alone. With the
line of sight u at range rho, noise of range and of each of the two angles independent and the attitude known,
the partials by the position are -u' for the range and -(I - u u')/rho for the direction, so that a landmark
carries the information

    u u' / sigma_range^2 + (I - u u') / (rho sigma_angle)^2

about the position (its Fisher information; what the changing noise itself would tell is left out, as in every
Kalman filter). Landmarks count with weights: 1 or 0 where what is seen is known, smooth where a solver needs
slopes. Every limit of the sensor then is a logistic function of the room left to it.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from landing_cli.kernel import kernel, part
from landing_cli.kernel_record import by_reference
from landing_cli.observe.records import Landmarks, ObserveCase, Sensor

FloatArray = NDArray[np.float64]
BoolArray = NDArray[np.bool_]

_NOTHING = 1e-12  # a smaller weight is none
_SEVERED_M = 1e-9  # a sight line shorter than this has no direction


@by_reference
class Sight(NamedTuple):
    """The landmarks and how much each counts, for kernels.

    Attributes
    ----------
    landmark : (n, 3) float, m, body frame
    normal : (n, 3) float, body frame
    open : (T, n) bool
        Which landmarks count at all at each time.
    site : (3,) float, m, body frame
        What the boresight points at where `at_site`.
    boresight : (3,) float, body frame
        Unit vector; used unless `at_site`.
    at_site : bool
    range_information, angle_information : float, 1/m2, 1/rad2
        One over the variances; the first is 0 for a camera.
    soft : bool
        Whether the limits below weigh; the rest is unused otherwise.
    softness : float
        Width of the logistic functions: radians about an angle, share of a range.
    cos_field_of_view, cos_emission : float
    range_min, range_max : float, m
    """

    landmark: FloatArray
    normal: FloatArray
    open: BoolArray
    site: FloatArray
    boresight: FloatArray
    at_site: bool
    range_information: float
    angle_information: float
    soft: bool
    softness: float
    cos_field_of_view: float
    cos_emission: float
    range_min: float
    range_max: float


def soft_sight(case: ObserveCase, not_hidden: BoolArray, softness: float) -> Sight:
    """Let the landmarks count by the room left to the sensor's limits.

    Parameters
    ----------
    case : ObserveCase
        Sensor, site frame and landmarks.
    not_hidden : (T, n) bool
        Which landmarks are neither dark nor behind terrain at each time: these two have no useful slope.
    softness : float
        Width of the logistic functions: radians about an angle, share of a range.

    Returns
    -------
    Sight
    """
    return _sight(case, not_hidden, True, softness)


def hard_sight(case: ObserveCase, visible: BoolArray) -> Sight:
    """Let the landmarks in view count, and no others.

    Parameters
    ----------
    case : ObserveCase
        Sensor, site frame and landmarks.
    visible : (T, n) bool
        Which landmarks are in view at each time.

    Returns
    -------
    Sight
    """
    return _sight(case, visible, False, 1.0)


def _sight(case: ObserveCase, counted: BoolArray, soft: bool, softness: float) -> Sight:
    sensor: Sensor = case.sensor
    landmarks: Landmarks = case.landmarks
    return Sight(
        np.ascontiguousarray(landmarks.position_m),
        np.ascontiguousarray(landmarks.normal),
        np.ascontiguousarray(counted),
        np.array(case.frame.origin_m),
        -np.array(case.frame.axes[2]),
        sensor.boresight == "site",
        sensor.range_sigma_m**-2 if sensor.kind == "lidar" else 0.0,
        sensor.angle_sigma_rad**-2,
        soft,
        softness,
        math.cos(sensor.half_field_of_view_rad),
        math.cos(sensor.emission_max_rad),
        sensor.range_min_m,
        sensor.range_max_m,
    )


def information_along(sight: Sight, position_m: FloatArray) -> FloatArray:
    """Sum the information of the landmarks at every time.

    Parameters
    ----------
    sight : Sight
        The landmarks and their weights.
    position_m : (T, 3) float, m, body frame
        Where the sensor is.

    Returns
    -------
    (T, 3, 3) float, 1/m2, body frame
        Symmetric, about the position.
    """
    information = np.zeros((len(position_m), 3, 3))
    _inform(sight, np.ascontiguousarray(position_m), information)
    return information


def information_slopes(sight: Sight, position_m: FloatArray, by_information: FloatArray) -> FloatArray:
    """Carry slopes by the information back to the positions.

    Parameters
    ----------
    sight : Sight
        The landmarks and their weights.
    position_m : (T, 3) float, m, body frame
        Where the sensor is.
    by_information : (T, 3, 3) float
        Slope of a number by the information at every time; symmetric.

    Returns
    -------
    (T, 3) float, 1/m
        Slope of that number by the positions, weights included.
    """
    slopes = np.zeros((len(position_m), 3))
    _slope(sight, np.ascontiguousarray(position_m), by_information, slopes)
    return slopes


@part
def _logistic(room: float) -> float:
    return 1.0 / (1.0 + math.exp(-room)) if room > -700.0 else 0.0


@part
def _weight(
    sight: Sight,
    j: int,
    u: FloatArray,
    rho: float,
    boresight: FloatArray,
    away: float,
    slope: FloatArray,
) -> float:
    """Weight of a landmark in sight, and the slope of its logarithm by the position.

    ``boresight`` is the unit vector of the sensor's axis, ``away`` the distance to what it is pointed at (0:
    a fixed axis).
    """
    s, weight = sight.softness, 1.0
    slope[:] = 0.0
    if sight.cos_field_of_view > -1.0:
        width = s * math.sqrt(1.0 - sight.cos_field_of_view**2)
        cosine = boresight[0] * u[0] + boresight[1] * u[1] + boresight[2] * u[2]
        share = _logistic((cosine - sight.cos_field_of_view) / width)
        weight *= share
        for a in range(3):
            turn = -(boresight[a] - cosine * u[a]) / rho
            if away > 0.0:
                turn -= (u[a] - cosine * boresight[a]) / away
            slope[a] += (1.0 - share) / width * turn
    if weight < _NOTHING:
        return 0.0
    if sight.cos_emission > -1.0:
        width = s * math.sqrt(1.0 - sight.cos_emission**2)
        n = sight.normal[j]
        cosine = -(n[0] * u[0] + n[1] * u[1] + n[2] * u[2])
        share = _logistic((cosine - sight.cos_emission) / width)
        weight *= share
        for a in range(3):
            slope[a] += (1.0 - share) / width * (n[a] + cosine * u[a]) / rho
    if weight < _NOTHING:
        return 0.0
    if sight.range_min > 0.0:
        share = _logistic(math.log(rho / sight.range_min) / s)
        weight *= share
        for a in range(3):
            slope[a] -= (1.0 - share) / (s * rho) * u[a]
    if sight.range_max < math.inf:
        share = _logistic(math.log(sight.range_max / rho) / s)
        weight *= share
        for a in range(3):
            slope[a] += (1.0 - share) / (s * rho) * u[a]
    return weight


@part
def _aim(sight: Sight, p: FloatArray, boresight: FloatArray) -> float:
    """Write the sensor's axis; returns the distance to the site where it points there, else 0."""
    away = 0.0
    for a in range(3):
        boresight[a] = sight.boresight[a]
    if sight.at_site:
        x, y, z = sight.site[0] - p[0], sight.site[1] - p[1], sight.site[2] - p[2]
        away = math.sqrt(x * x + y * y + z * z)
        if away < _SEVERED_M:
            return 0.0
        boresight[0], boresight[1], boresight[2] = x / away, y / away, z / away
    return away


@part
def _look(sight: Sight, j: int, p: FloatArray, u: FloatArray) -> float:
    """Write the line of sight to a landmark; returns its length."""
    x, y, z = sight.landmark[j, 0] - p[0], sight.landmark[j, 1] - p[1], sight.landmark[j, 2] - p[2]
    rho = math.sqrt(x * x + y * y + z * z)
    if rho >= _SEVERED_M:
        u[0], u[1], u[2] = x / rho, y / rho, z / rho
    return rho


@kernel
def _inform(sight: Sight, positions: FloatArray, information: FloatArray) -> None:
    u, slope, boresight = np.zeros(3), np.zeros(3), np.zeros(3)
    for t in range(positions.shape[0]):
        p = positions[t]
        away = _aim(sight, p, boresight)
        for j in range(sight.landmark.shape[0]):
            if not sight.open[t, j]:
                continue
            rho = _look(sight, j, p, u)
            if rho < _SEVERED_M:
                continue
            weight = _weight(sight, j, u, rho, boresight, away, slope) if sight.soft else 1.0
            if weight == 0.0:
                continue
            across = weight * sight.angle_information / (rho * rho)
            along = weight * sight.range_information - across
            for a in range(3):
                information[t, a, a] += across
                for b in range(3):
                    information[t, a, b] += along * u[a] * u[b]


@kernel
def _slope(sight: Sight, positions: FloatArray, by_information: FloatArray, slopes: FloatArray) -> None:
    u, slope, boresight = np.zeros(3), np.zeros(3), np.zeros(3)
    for t in range(positions.shape[0]):
        p, B = positions[t], by_information[t]
        away = _aim(sight, p, boresight)
        trace = B[0, 0] + B[1, 1] + B[2, 2]
        for j in range(sight.landmark.shape[0]):
            if not sight.open[t, j]:
                continue
            rho = _look(sight, j, p, u)
            if rho < _SEVERED_M:
                continue
            weight = 1.0
            if sight.soft:
                weight = _weight(sight, j, u, rho, boresight, away, slope)
            if weight == 0.0:
                continue
            x = B[0, 0] * u[0] + B[0, 1] * u[1] + B[0, 2] * u[2]
            y = B[1, 0] * u[0] + B[1, 1] * u[1] + B[1, 2] * u[2]
            z = B[2, 0] * u[0] + B[2, 1] * u[1] + B[2, 2] * u[2]
            inner = u[0] * x + u[1] * y + u[2] * z
            across = sight.angle_information / (rho * rho)
            told = sight.range_information * inner + across * (trace - inner)
            # by the line of sight, p fixed to the landmark: the position moves it the other way
            turn = -2.0 * (sight.range_information - across) / rho
            shorten = 2.0 * across * (trace - inner) / rho
            slopes[t, 0] += weight * (turn * (x - inner * u[0]) + shorten * u[0] + told * slope[0])
            slopes[t, 1] += weight * (turn * (y - inner * u[1]) + shorten * u[1] + told * slope[1])
            slopes[t, 2] += weight * (turn * (z - inner * u[2]) + shorten * u[2] + told * slope[2])

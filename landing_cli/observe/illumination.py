"""Where the sun stands over the landmarks, and whether they are lit."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import ArrayLike, NDArray

from landing_cli.flight.astronomy import OBLIQUITY_RAD
from landing_cli.flight.elements import OrbitElements, states_at
from landing_cli.observe.records import Landmarks, Sensor

FloatArray = NDArray[np.float64]
BoolArray = NDArray[np.bool_]


def is_light_needed(sensor: Sensor, sun_direction: FloatArray | None) -> bool:
    """Whether illumination is tested: a camera needs light, and the sun's direction has to be known."""
    return sensor.kind == "camera" and sun_direction is not None


def sun_directions(sun_direction: ArrayLike, rotation_rate_rad_s: float, t_s: ArrayLike) -> FloatArray:
    """Direction of the sun in the body frame as the body turns.

    Parameters
    ----------
    sun_direction : (3,) float, body frame
        Unit vector at time zero; the body's own way around the sun is left out (0.005 deg in 800 s for
        Eros).
    rotation_rate_rad_s : float, rad/s
        About +z.
    t_s : (T,) float, s
        Times.

    Returns
    -------
    (T, 3) float
    """
    x, y, z = np.asarray(sun_direction, dtype=np.float64)
    angle = rotation_rate_rad_s * np.asarray(t_s, dtype=np.float64)
    cosine, sine = np.cos(angle), np.sin(angle)
    return np.stack([cosine * x + sine * y, cosine * y - sine * x, np.full_like(angle, z)], axis=1)


def is_sun_high(landmarks: Landmarks, sun: FloatArray, incidence_max_rad: float) -> BoolArray:
    """Whether the sun stands high enough over each landmark's facet.

    Parameters
    ----------
    landmarks : Landmarks
        Their normals are used.
    sun : (T, 3) float, body frame
        Unit vectors to the sun.
    incidence_max_rad : float, rad
        Largest angle between the normal and the sun.

    Returns
    -------
    (T, n) bool
    """
    return np.asarray(sun @ landmarks.normal.T >= np.cos(incidence_max_rad))


def body_axes(right_ascension_rad: float, declination_rad: float, meridian_rad: float) -> FloatArray:
    """Axes of the body frame in the ICRF.

    Parameters
    ----------
    right_ascension_rad, declination_rad : float, rad
        alpha_0, delta_0 of the spin pole, +z.
    meridian_rad : float, rad
        W: from the ascending node of the body's equator on the ICRF's, eastward to +x.

    Returns
    -------
    (3, 3) float
        Rows: x, y, z of the body frame; R3(W) R1(90 deg - delta_0) R3(90 deg + alpha_0) (Archinal et al.,
        Celestial Mechanics and Dynamical Astronomy 130:22, 2018).
    """
    sa, ca = np.sin(right_ascension_rad), np.cos(right_ascension_rad)
    sd, cd = np.sin(declination_rad), np.cos(declination_rad)
    node, pole = np.array([-sa, ca, 0.0]), np.array([ca * cd, sa * cd, sd])
    ahead = np.cross(pole, node)
    sw, cw = np.sin(meridian_rad), np.cos(meridian_rad)
    return np.stack([cw * node + sw * ahead, cw * ahead - sw * node, pole])


def sun_direction(
    heliocentric_m: ArrayLike, right_ascension_rad: float, declination_rad: float, meridian_rad: float
) -> FloatArray:
    """Direction of the sun in the body frame from where the body is.

    Parameters
    ----------
    heliocentric_m : (3,) float, m, ICRF
        Position of the body from the sun, at the time for which the meridian is given.
    right_ascension_rad, declination_rad : float, rad
        Spin pole (ICRF).
    meridian_rad : float, rad
        W at that time.

    Returns
    -------
    (3,) float, body frame
        Unit vector to the sun; light time (some 0.005 deg of a body's way around the sun) and aberration are
        left out.
    """
    position = np.asarray(heliocentric_m, dtype=np.float64)
    axes = body_axes(right_ascension_rad, declination_rad, meridian_rad)
    return np.asarray(axes @ (-position / np.linalg.norm(position)))


def heliocentric_position_m(
    semi_major_axis_m: float,
    eccentricity: float,
    inclination_rad: float,
    ascending_node_rad: float,
    perihelion_argument_rad: float,
    mean_anomaly_rad: float,
    elapsed_s: float,
) -> FloatArray:
    """Position of a body on its ellipse around the sun.

    Parameters
    ----------
    semi_major_axis_m, eccentricity : float
        a in m; e below 1.
    inclination_rad, ascending_node_rad, perihelion_argument_rad : float, rad
        i, Omega, omega about the ecliptic and equinox of J2000.
    mean_anomaly_rad : float, rad
        M at the epoch of the elements.
    elapsed_s : float, s
        From that epoch.

    Returns
    -------
    (3,) float, m, ICRF
        On the unperturbed ellipse: planets move a near-Earth body from it by some 0.1 deg in a decade.
    """
    ellipse = OrbitElements(
        np.zeros(1),
        *(
            np.array([value])
            for value in (
                semi_major_axis_m,
                eccentricity,
                inclination_rad,
                ascending_node_rad,
                perihelion_argument_rad,
                mean_anomaly_rad,
            )
        ),
    )
    x, y, z = states_at(ellipse, elapsed_s)[0, :3]
    cosine, sine = math.cos(OBLIQUITY_RAD), math.sin(OBLIQUITY_RAD)
    return np.array([x, cosine * y - sine * z, sine * y + cosine * z])

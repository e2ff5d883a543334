"""Orbital elements as arrays, and the states that they stand for."""

from __future__ import annotations

from dataclasses import dataclass, fields

import numpy as np
from numpy.typing import ArrayLike, NDArray

from landing_cli.flight.astronomy import AU_M, DAY_S, GM_SUN_M3_S2, J2000_JD
from landing_cli.flight.kepler import propagate_kepler

FloatArray = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class OrbitElements:
    """Osculating heliocentric elements of n bodies, ecliptic and equinox J2000.

    Attributes
    ----------
    epoch_t_s : (n,) float, s
        TDB seconds past J2000, each body its own.
    a_m : (n,) float, m
        Semi-major axis.
    e : (n,) float
        Eccentricity, below 1.
    inclination_rad, node_rad, argument_rad, mean_anomaly_rad : (n,) float, rad
        Inclination, longitude of the ascending node, argument of perihelion and mean anomaly at the epoch.
    """

    epoch_t_s: FloatArray
    a_m: FloatArray
    e: FloatArray
    inclination_rad: FloatArray
    node_rad: FloatArray
    argument_rad: FloatArray
    mean_anomaly_rad: FloatArray

    def __len__(self) -> int:
        return len(self.a_m)

    def rows(self, chosen: ArrayLike) -> OrbitElements:
        """Elements of some of the bodies.

        Parameters
        ----------
        chosen : (k,) int or (n,) bool
            Their rows.

        Returns
        -------
        OrbitElements
        """
        rows = np.atleast_1d(np.asarray(chosen))
        return OrbitElements(**{field.name: getattr(self, field.name)[rows] for field in fields(self)})


def elements_of_catalogue(
    epoch_jd_tdb: ArrayLike,
    a_au: ArrayLike,
    e: ArrayLike,
    inclination_deg: ArrayLike,
    node_deg: ArrayLike,
    argument_deg: ArrayLike,
    mean_anomaly_deg: ArrayLike,
) -> OrbitElements:
    """Elements in the units of catalogues.

    Parameters
    ----------
    epoch_jd_tdb : (n,) or () float
        Epoch, Julian date TDB.
    a_au : (n,) float, au
        Semi-major axis.
    e : (n,) float
        Eccentricity.
    inclination_deg, node_deg, argument_deg, mean_anomaly_deg : (n,) float, deg
        Ecliptic and equinox J2000.

    Returns
    -------
    OrbitElements
    """
    a = np.atleast_1d(np.asarray(a_au, dtype=np.float64)) * AU_M
    epoch = (np.asarray(epoch_jd_tdb, dtype=np.float64) - J2000_JD) * DAY_S
    angles = (
        np.radians(np.atleast_1d(np.asarray(value, dtype=np.float64)))
        for value in (inclination_deg, node_deg, argument_deg, mean_anomaly_deg)
    )
    return OrbitElements(
        np.broadcast_to(epoch, a.shape).copy(), a, np.atleast_1d(np.asarray(e, dtype=np.float64)), *angles
    )


def states_of(elements: OrbitElements, mu_m3_s2: float = GM_SUN_M3_S2) -> FloatArray:
    """States at the elements' own epochs.

    Parameters
    ----------
    elements : OrbitElements
        Of n bodies.
    mu_m3_s2 : float, m3/s2
        Gravitational parameter of the centre.

    Returns
    -------
    (n, 6) float, m and m/s
        Position and velocity, in the frame that the angles refer to.
    """
    mean_motion = np.sqrt(mu_m3_s2 / np.abs(elements.a_m) ** 3)
    # the way round from the periapsis, on the shorter side
    anomaly = elements.mean_anomaly_rad
    closed = elements.e < 1.0
    anomaly = np.where(closed, np.remainder(anomaly + np.pi, 2.0 * np.pi) - np.pi, anomaly)
    return propagate_kepler(_periapsis_states(elements, mu_m3_s2), anomaly / mean_motion, mu_m3_s2)


def states_at(elements: OrbitElements, t_s: ArrayLike, mu_m3_s2: float = GM_SUN_M3_S2) -> FloatArray:
    """States at other times, along the osculating conics.

    Parameters
    ----------
    elements : OrbitElements
        Of n bodies.
    t_s : float or (n,) float, s
        TDB seconds past J2000.
    mu_m3_s2 : float, m3/s2
        Gravitational parameter of the centre.

    Returns
    -------
    (n, 6) float, m and m/s
        Position and velocity, in the frame that the angles refer to.
    """
    dt = np.asarray(t_s, dtype=np.float64) - elements.epoch_t_s
    return propagate_kepler(states_of(elements, mu_m3_s2), dt, mu_m3_s2)


def elements_of(states: ArrayLike, t_s: ArrayLike, mu_m3_s2: float = GM_SUN_M3_S2) -> OrbitElements:
    """Osculating elements of states.

    Where an angle has no meaning (a circular or an uninclined orbit) it is 0 and the sum of angles is right.

    Parameters
    ----------
    states : (n, 6) float, m and m/s
        Position and velocity about the centre; not parabolic and not rectilinear.
    t_s : float or (n,) float, s
        Their times, which become the epochs.
    mu_m3_s2 : float, m3/s2
        Gravitational parameter of the centre.

    Returns
    -------
    OrbitElements
        On a hyperbola ``a_m`` is negative and the mean anomaly is ``e sinh F - F``.
    """
    rows = np.atleast_2d(np.asarray(states, dtype=np.float64))
    r, v = rows[:, :3], rows[:, 3:]
    distance, momentum = np.linalg.norm(r, axis=1), np.cross(r, v)
    sigma = np.einsum("ij,ij->i", r, v)
    a = 1.0 / (2.0 / distance - np.einsum("ij,ij->i", v, v) / mu_m3_s2)
    pole = momentum / np.linalg.norm(momentum, axis=1)[:, None]
    eccentric = np.cross(v, momentum) / mu_m3_s2 - r / distance[:, None]
    e = np.linalg.norm(eccentric, axis=1)
    node = np.arctan2(pole[:, 0], -pole[:, 1])
    node = np.where(np.hypot(pole[:, 0], pole[:, 1]) > 0.0, node, 0.0)
    ascending = np.stack([np.cos(node), np.sin(node), np.zeros_like(node)], axis=1)
    ahead = np.cross(pole, ascending)
    argument = np.arctan2(
        np.einsum("ij,ij->i", eccentric, ahead), np.einsum("ij,ij->i", eccentric, ascending)
    )
    # e cos E and e sin E, or with cosh and sinh, need no angle of the eccentricity vector
    root = np.sqrt(mu_m3_s2 * np.abs(a))
    cosine, sine = 1.0 - distance / a, sigma / root
    open_orbit = a < 0.0
    with np.errstate(invalid="ignore", divide="ignore"):
        elliptic = np.arctan2(sine, cosine) - sine
        hyperbolic = sine - np.arcsinh(sine / e)
    inclination = np.arctan2(np.hypot(pole[:, 0], pole[:, 1]), pole[:, 2])
    return OrbitElements(
        np.broadcast_to(np.asarray(t_s, dtype=np.float64), a.shape).copy(),
        a,
        e,
        inclination,
        np.remainder(node, 2.0 * np.pi),
        np.remainder(argument, 2.0 * np.pi),
        np.where(open_orbit, hyperbolic, np.remainder(elliptic, 2.0 * np.pi)),
    )


def _periapsis_states(elements: OrbitElements, mu: float) -> FloatArray:
    """States at periapsis, (n, 6)."""
    cos_i, sin_i = np.cos(elements.inclination_rad), np.sin(elements.inclination_rad)
    cos_n, sin_n = np.cos(elements.node_rad), np.sin(elements.node_rad)
    cos_w, sin_w = np.cos(elements.argument_rad), np.sin(elements.argument_rad)
    towards = [cos_n * cos_w - sin_n * sin_w * cos_i, sin_n * cos_w + cos_n * sin_w * cos_i, sin_w * sin_i]
    ahead = [-cos_n * sin_w - sin_n * cos_w * cos_i, -sin_n * sin_w + cos_n * cos_w * cos_i, cos_w * sin_i]
    q = elements.a_m * (1.0 - elements.e)
    speed = np.sqrt(mu * (1.0 + elements.e) / q)
    return np.stack([*(q * axis for axis in towards), *(speed * axis for axis in ahead)], axis=1)

"""Orbital elements as arrays."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

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

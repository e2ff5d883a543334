"""What an encounter is like: speed, light, distance from the Earth, size and brightness."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from landing_cli.sources.catalogue_records import Catalogue
from landing_cli.tour.ephemeris import Ephemeris, states_of_body
from landing_cli.tour.records import Flyby, Leg
from landing_cli.tour.targets import apparent_magnitude, diameter_m

FloatArray = NDArray[np.float64]


def describe_flybys(
    catalogue: Catalogue,
    legs: Sequence[Leg],
    asteroids: FloatArray,
    crafts: FloatArray,
    ephemeris: Ephemeris,
    albedo: float,
) -> tuple[Flyby, ...]:
    """Describe the encounters at the ends of legs.

    Parameters
    ----------
    catalogue : Catalogue
        That the legs' targets are rows of.
    legs : sequence of k Leg
        In order.
    asteroids, crafts : (k, 6) float, m and m/s
        Heliocentric states at the arrivals, ecliptic and equinox J2000.
    ephemeris : Ephemeris
        Over the flight.
    albedo : float
        Geometric albedo that turns H into a diameter.

    Returns
    -------
    tuple of k Flyby
    """
    earth = states_of_body(ephemeris, "Earth", [leg.arrival_t_s for leg in legs])
    relative = crafts[:, 3:] - asteroids[:, 3:]
    rows = [leg.target for leg in legs]
    magnitude = catalogue.absolute_magnitude[rows]
    size = diameter_m(magnitude, albedo)
    brightness = apparent_magnitude(magnitude, asteroids[:, :3], earth[:, :3])
    distance = np.linalg.norm(asteroids[:, :3] - earth[:, :3], axis=1)
    miss = np.linalg.norm(crafts[:, :3] - asteroids[:, :3], axis=1)
    # on approach the craft lies against its relative velocity, the Sun against the asteroid's position
    cosine = np.einsum("ij,ij->i", asteroids[:, :3], relative)
    sine = np.linalg.norm(np.cross(asteroids[:, :3], relative), axis=1)
    phase = np.arctan2(sine, cosine)
    return tuple(
        Flyby(
            designation=leg.designation,
            t_s=leg.arrival_t_s,
            position_m=asteroids[i, :3].copy(),
            relative_velocity_m_s=relative[i].copy(),
            phase_angle_rad=float(phase[i]),
            geocentric_distance_m=float(distance[i]),
            absolute_magnitude=float(magnitude[i]),
            diameter_m=float(size[i]),
            apparent_magnitude=float(brightness[i]),
            miss_m=float(miss[i]),
        )
        for i, leg in enumerate(legs)
    )

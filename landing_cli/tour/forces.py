"""The forces on a craft among the Sun, the planets, the Earth and the Moon, and their scales.

Newtonian point masses on the ephemeris' paths, and the Earth's oblateness; no relativity, radiation or drag.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from landing_cli.flight.astronomy import OBLIQUITY_RAD
from landing_cli.kernel import inlined, part
from landing_cli.tour.ephemeris import EARTH_ROW, Ephemeris

FloatArray = NDArray[np.float64]

EARTH_RADIUS_M = 6_378_136.3  # that the oblateness refers to
EARTH_J2 = 1.082_625_27e-3  # DE440

_POLE_Y, _POLE_Z = math.sin(OBLIQUITY_RAD), math.cos(OBLIQUITY_RAD)
_OBLATE = 1.5 * EARTH_J2 * EARTH_RADIUS_M**2


@part
def craft_acceleration(
    ephemeris: Ephemeris, bodies: FloatArray, x: float, y: float, z: float
) -> tuple[float, float, float]:
    """Heliocentric acceleration of a craft.

    Parameters
    ----------
    ephemeris : Ephemeris
        Gravitational parameters.
    bodies : (b + 1, 3) float, m and m/s2
        Of `body_positions` at the time.
    x, y, z : float, m
        Heliocentric position.

    Returns
    -------
    tuple of 3 float, m/s2
    """
    square = x * x + y * y + z * z
    pull = -ephemeris.gm_sun / (square * math.sqrt(square))
    count = bodies.shape[0] - 1
    ax, ay, az = bodies[count, 0] + pull * x, bodies[count, 1] + pull * y, bodies[count, 2] + pull * z
    for body in range(count):
        dx, dy, dz = bodies[body, 0] - x, bodies[body, 1] - y, bodies[body, 2] - z
        square = dx * dx + dy * dy + dz * dz
        pull = ephemeris.gm[body] / (square * math.sqrt(square))
        if body == EARTH_ROW:
            share = _OBLATE / square
            height = _POLE_Y * dy + _POLE_Z * dz
            ay += 2.0 * pull * share * height * _POLE_Y
            az += 2.0 * pull * share * height * _POLE_Z
            pull *= 1.0 + share * (1.0 - 5.0 * height * height / square)
        ax += pull * dx
        ay += pull * dy
        az += pull * dz
    return ax, ay, az


@inlined
def first_step(ephemeris: Ephemeris, bodies: FloatArray, state: FloatArray) -> float:
    """A fifth of the shortest time scale about any body.

    Parameters
    ----------
    ephemeris : Ephemeris
        Gravitational parameters.
    bodies : (b + 1, 3) float, m and m/s2
        Of `body_positions` at the time.
    state : (6,) float, m and m/s
        Heliocentric position and velocity.

    Returns
    -------
    float, s
    """
    square = state[0] ** 2 + state[1] ** 2 + state[2] ** 2
    shortest = square * math.sqrt(square) / ephemeris.gm_sun
    for body in range(bodies.shape[0] - 1):
        square = 0.0
        for axis in range(3):
            square += (bodies[body, axis] - state[axis]) ** 2
        shortest = min(shortest, square * math.sqrt(square) / ephemeris.gm[body])
    return 0.2 * math.sqrt(shortest)


@part
def rounding_of(ephemeris: Ephemeris, bodies: FloatArray, state: FloatArray) -> float:
    """What the last digit of a heliocentric position is worth in acceleration.

    Parameters
    ----------
    ephemeris : Ephemeris
        Gravitational parameters.
    bodies : (b + 1, 3) float, m and m/s2
        Of `body_positions` at the time.
    state : (6,) float, m and m/s
        Heliocentric position and velocity.

    Returns
    -------
    float, m/s2
    """
    gradient = 0.0
    for body in range(bodies.shape[0] - 1):
        square = 0.0
        for axis in range(3):
            square += (bodies[body, axis] - state[axis]) ** 2
        gradient = max(gradient, ephemeris.gm[body] / (square * math.sqrt(square)))
    return 2.2e-16 * gradient * math.sqrt(state[0] ** 2 + state[1] ** 2 + state[2] ** 2)

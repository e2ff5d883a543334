"""Flight under the Sun, the planets, the Earth and the Moon apart, with a step that follows the error.

The integrator is Gauss-Radau collocation of order 15 with the step control of IAS15 (Rein and Spiegel 2015):
the highest coefficient of the acceleration's polynomial stays a small share of the acceleration, or, next to
a planet, of what the rounding of heliocentric positions makes of it. The bodies' places at the nodes are
looked up once a step, however often the collocation is iterated.
"""

from __future__ import annotations

import math
from enum import IntEnum

import numpy as np
from numpy.typing import ArrayLike, NDArray

from landing_cli.flight.elements import OrbitElements, states_of
from landing_cli.kernel import inlined, kernel, part
from landing_cli.tour.ephemeris import EARTH_ROW, MOON_ROW, Ephemeris, body_positions
from landing_cli.tour.forces import EARTH_RADIUS_M, craft_acceleration, first_step, rounding_of
from landing_cli.tour.radau import NODES, Radau, extrapolate, radau, state_within

FloatArray = NDArray[np.float64]

MOON_RADIUS_M = 1_738_000.0
TOLERANCE = 1e-8  # share of the acceleration: millimetres in a year away from planets

_STEPS_MAX = 100_000
_ITERATIONS = 14
_CONVERGED = 1e-13
_STALLED = 1e-9
_SHORTEST_S = 1e-3
_RADAU = radau()


class FlightStatus(IntEnum):
    """How a flight ended."""

    ARRIVED = 0
    OUTSIDE_EPHEMERIS = 1
    STEP_TOO_SMALL = 2
    HIT_EARTH = 3
    HIT_MOON = 4


REASONS = {
    FlightStatus.OUTSIDE_EPHEMERIS: "the flight leaves the span of the ephemeris",
    FlightStatus.STEP_TOO_SMALL: "the integrator's step vanishes",
    FlightStatus.HIT_EARTH: "it hits the Earth",
    FlightStatus.HIT_MOON: "it hits the Moon",
}
_ARRIVED, _OUTSIDE, _TOO_SMALL, _HIT_EARTH, _HIT_MOON = (int(status) for status in FlightStatus)


@part
def _below_ground(bodies: FloatArray, state: FloatArray) -> int:
    """Status of a craft inside the Earth or the Moon, else arrived."""
    earth = moon = 0.0
    for axis in range(3):
        earth += (bodies[EARTH_ROW, axis] - state[axis]) ** 2
        moon += (bodies[MOON_ROW, axis] - state[axis]) ** 2
    if earth < EARTH_RADIUS_M**2:
        return _HIT_EARTH
    return _HIT_MOON if moon < MOON_RADIUS_M**2 else _ARRIVED


@part
def _collocate(
    ephemeris: Ephemeris,
    scheme: Radau,
    h: float,
    state: FloatArray,
    bodies: FloatArray,
    forces: FloatArray,
) -> bool:
    """Iterate the accelerations at the nodes 1 to 7 from those given; whether they settled."""
    last = 0.0
    for _ in range(_ITERATIONS):
        change = size = 0.0
        for n in range(1, NODES):
            sx = sy = sz = 0.0
            for j in range(NODES):
                weight = scheme.second[n, j]
                sx += weight * forces[j, 0]
                sy += weight * forces[j, 1]
                sz += weight * forces[j, 2]
            dt = scheme.nodes[n] * h
            ax, ay, az = craft_acceleration(
                ephemeris,
                bodies[n],
                state[0] + dt * state[3] + h * h * sx,
                state[1] + dt * state[4] + h * h * sy,
                state[2] + dt * state[5] + h * h * sz,
            )
            change = max(change, abs(ax - forces[n, 0]), abs(ay - forces[n, 1]), abs(az - forces[n, 2]))
            size = max(size, abs(ax), abs(ay), abs(az))
            forces[n, 0], forces[n, 1], forces[n, 2] = ax, ay, az
        # each round shrinks the change by the same factor, down to rounding, where it stalls
        if change <= _CONVERGED * size or change * change <= _CONVERGED * size * last:
            return True
        if 0.0 < last < 3.0 * change:
            return change <= _STALLED * size
        last = change
    return False


@part
def _growth(scheme: Radau, tolerance: float, rounding: float, forces: FloatArray) -> float:
    """How much longer the next step may be (Rein and Spiegel 2015, eq 11), at most fourfold."""
    size = highest = weights = 0.0
    for axis in range(3):
        leading = 0.0
        for n in range(NODES):
            leading += scheme.leading[n] * forces[n, axis]
            size = max(size, abs(forces[n, axis]))
        highest = max(highest, abs(leading))
    for n in range(NODES):
        weights += abs(scheme.leading[n])
    wanted = tolerance * size + rounding * weights
    return 4.0 if highest <= 1e-5 * wanted else min(4.0, (wanted / highest) ** (1.0 / 7.0))


@inlined
def _advance(scheme: Radau, h: float, forces: FloatArray, state: FloatArray) -> None:
    """Carry a state over a step whose accelerations are known."""
    for axis in range(3):
        one = two = 0.0
        for n in range(NODES):
            one += scheme.first[NODES, n] * forces[n, axis]
            two += scheme.second[NODES, n] * forces[n, axis]
        state[axis] += h * (state[3 + axis] + h * two)
        state[3 + axis] += h * one


@part
def fly_state(
    ephemeris: Ephemeris,
    scheme: Radau,
    tolerance: float,
    state: FloatArray,
    start: float,
    end: float,
    times: FloatArray,
    noted: FloatArray,
    work: FloatArray,
) -> int:
    """Fly one craft from one time to another and note its states on the way.

    Parameters
    ----------
    ephemeris : Ephemeris
        Over the flight.
    scheme : Radau
        Constants of the integrator.
    tolerance : float
        Highest coefficient of the acceleration's polynomial over a step, as a share of the acceleration.
    state : (6,) float, m and m/s
        Heliocentric position and velocity, ecliptic and equinox J2000; replaced by those at the end.
    start, end : float, s
        TDB seconds past J2000; the end may lie before the start.
    times : (k,) float, s
        When to note the state, in the order of flight, between start and end.
    noted : (k, 6) float, m and m/s
        Receives the states at those times as far as the flight goes.
    work : (8, b + 3, 3) float
        Scratch.

    Returns
    -------
    int
        A `FlightStatus`; the state is that of the last step where the craft did not arrive.
    """
    count = work.shape[1] - 2
    bodies, forces, ahead = work[:, :count], work[:, count], work[:, count + 1]
    if not (min(start, end) >= ephemeris.start_s and max(start, end) <= ephemeris.end_s):
        return _OUTSIDE
    body_positions(ephemeris, start, 0.0, bodies[0])
    status = _below_ground(bodies[0], state)
    if status != _ARRIVED:
        return status
    h = math.copysign(first_step(ephemeris, bodies[0], state), end - start)
    t, reached, place = start, 0.0, 0  # reached: the step that the forces are of; none yet
    for _ in range(_STEPS_MAX):
        left = end - t
        last = abs(h) >= abs(left)
        length = left if last else (t + h) - t  # so that t stays exact
        for n in range(NODES):
            body_positions(ephemeris, t, scheme.nodes[n] * length, bodies[n])
        if reached != 0.0:
            extrapolate(scheme, length / reached, forces, ahead)
        ax, ay, az = craft_acceleration(ephemeris, bodies[0], state[0], state[1], state[2])
        for n in range(NODES):
            if reached != 0.0 and n > 0:
                forces[n, 0], forces[n, 1], forces[n, 2] = ahead[n, 0], ahead[n, 1], ahead[n, 2]
            else:
                forces[n, 0], forces[n, 1], forces[n, 2] = ax, ay, az
        settled = _collocate(ephemeris, scheme, length, state, bodies, forces)
        ratio = _growth(scheme, tolerance, rounding_of(ephemeris, bodies[0], state), forces)
        if not (settled and ratio > 0.25):
            reached = 0.0
            h = length * (max(ratio, 0.1) if settled and ratio > 0.0 else 0.25)
            if not abs(h) > _SHORTEST_S:
                return _TOO_SMALL
            continue
        while place < len(times) and (last or abs(times[place] - t) <= abs(length)):
            share = (times[place] - t) / length if length != 0.0 else 0.0
            state_within(scheme, length, share, state, forces, noted[place])
            place += 1
        _advance(scheme, length, forces, state)
        if last:
            return _below_ground(bodies[NODES - 1], state)
        t, reached = t + length, length
        h = length * ratio
        status = _below_ground(bodies[NODES - 1], state)
        if status != _ARRIVED:
            return status
    return _TOO_SMALL


@kernel
def fly_batch(
    ephemeris: Ephemeris,
    scheme: Radau,
    tolerance: float,
    states: FloatArray,
    start: FloatArray,
    end: FloatArray,
    times: FloatArray,
    noted: FloatArray,
    status: NDArray[np.int64],
) -> None:
    """Fly n crafts, each from its own time, by the first of common times to its own end.

    Parameters
    ----------
    ephemeris : Ephemeris
        Over all flights.
    scheme : Radau
        Constants of the integrator.
    tolerance : float
        Of `fly_state`.
    states : (n, 6) float, m and m/s
        Heliocentric, ecliptic and equinox J2000; replaced by those at the ends.
    start, end : (n,) float, s
        TDB seconds past J2000.
    times : (k,) float, s
        When all states are noted, in the order of flight from the first time to the ends.
    noted : (n, k, 6) float, m and m/s
        Receives them.
    status : (n,) int
        Receives a `FlightStatus` each.
    """
    work = np.zeros((NODES, ephemeris.gm.shape[0] + 3, 3))
    for i in range(states.shape[0]):
        begun = start[i]
        if len(times):
            # an epoch may lie on either side of the times
            status[i] = fly_state(
                ephemeris, scheme, tolerance, states[i], begun, times[0], times[:0], noted[i], work
            )
            if status[i] != _ARRIVED:
                continue
            begun = times[0]
        status[i] = fly_state(ephemeris, scheme, tolerance, states[i], begun, end[i], times, noted[i], work)


def fly(
    states: ArrayLike,
    start_t_s: ArrayLike,
    end_t_s: ArrayLike,
    ephemeris: Ephemeris,
    tolerance: float = TOLERANCE,
) -> tuple[FloatArray, NDArray[np.int64]]:
    """Fly crafts or asteroids in N-body.

    Parameters
    ----------
    states : (6,) or (n, 6) float, m and m/s
        Heliocentric position and velocity, ecliptic and equinox J2000.
    start_t_s, end_t_s : float or (n,) float, s
        TDB seconds past J2000; an end may lie before its start.
    ephemeris : Ephemeris
        Over all flights.
    tolerance : float
        Highest coefficient of the acceleration's polynomial over a step, as a share of the acceleration.

    Returns
    -------
    tuple of (n, 6) float and (n,) int
        States at the ends, NaN where a craft did not arrive, and a `FlightStatus` each.
    """
    flown, _, status = _flown(states, start_t_s, end_t_s, np.zeros(0), ephemeris, tolerance)
    flown[status != FlightStatus.ARRIVED] = np.nan
    return flown, status


def fly_through(
    states: ArrayLike,
    start_t_s: ArrayLike,
    times_s: ArrayLike,
    ephemeris: Ephemeris,
    tolerance: float = TOLERANCE,
) -> tuple[FloatArray, NDArray[np.int64]]:
    """Fly crafts or asteroids in N-body and note their states at common times.

    Parameters
    ----------
    states : (6,) or (n, 6) float, m and m/s
        Heliocentric position and velocity, ecliptic and equinox J2000.
    start_t_s : float or (n,) float, s
        TDB seconds past J2000; on either side of the times.
    times_s : (k,) float, s
        When the states are noted, rising or falling.
    ephemeris : Ephemeris
        Over all flights.
    tolerance : float
        Highest coefficient of the acceleration's polynomial over a step, as a share of the acceleration.

    Returns
    -------
    tuple of (n, k, 6) float and (n,) int
        States, NaN from where a craft did not get to, and a `FlightStatus` each.
    """
    times = np.atleast_1d(np.asarray(times_s, dtype=np.float64))
    _, noted, status = _flown(states, start_t_s, times[-1], times, ephemeris, tolerance)
    return noted, status


def _flown(
    states: ArrayLike,
    start_t_s: ArrayLike,
    end_t_s: ArrayLike,
    times: FloatArray,
    ephemeris: Ephemeris,
    tolerance: float,
) -> tuple[FloatArray, FloatArray, NDArray[np.int64]]:
    """States at the ends, (n, 6), on the way, (n, k, 6), and statuses, (n,)."""
    rows = np.atleast_2d(np.asarray(states, dtype=np.float64))
    start, end = np.asarray(start_t_s, dtype=np.float64), np.asarray(end_t_s, dtype=np.float64)
    n = max(len(rows), start.size, end.size)
    ends = np.array(np.broadcast_to(rows, (n, 6)))
    noted = np.full((n, len(times), 6), np.nan)
    status = np.zeros(n, dtype=np.int64)
    starts, stops = (np.ascontiguousarray(np.broadcast_to(value, (n,))) for value in (start, end))
    fly_batch(ephemeris, _RADAU, tolerance, ends, starts, stops, times, noted, status)
    return ends, noted, status


def fly_elements(
    elements: OrbitElements, times_s: ArrayLike, ephemeris: Ephemeris, tolerance: float = TOLERANCE
) -> FloatArray:
    """States of asteroids, flown in N-body from the epochs of their elements.

    Parameters
    ----------
    elements : OrbitElements
        Osculating heliocentric elements of n asteroids.
    times_s : (k,) float, s
        TDB seconds past J2000, rising or falling.
    ephemeris : Ephemeris
        From the epochs to the times.
    tolerance : float
        Highest coefficient of the acceleration's polynomial over a step, as a share of the acceleration.

    Returns
    -------
    (n, k, 6) float, m and m/s
        Heliocentric, ecliptic and equinox J2000; NaN where one did not arrive.
    """
    states = states_of(elements, ephemeris.gm_sun)
    return fly_through(states, elements.epoch_t_s, times_s, ephemeris, tolerance)[0]

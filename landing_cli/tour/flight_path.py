"""The N-body flight of a chain, sampled from the departure to the last flyby."""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from landing_cli.flight.astronomy import DAY_S
from landing_cli.tour.ephemeris import Ephemeris, states_of_body
from landing_cli.tour.nbody import FlightStatus, fly_through
from landing_cli.tour.records import Departure, Leg
from landing_cli.tour.run_records import ChainPath

FloatArray = NDArray[np.float64]

SAMPLE_S = DAY_S
"""Longest time between samples: heliocentric paths bend by a degree in it."""


def sampled_path(departure: Departure, legs: Sequence[Leg], ephemeris: Ephemeris) -> ChainPath | None:
    """Fly a chain through its burns and flybys, and keep its states.

    Parameters
    ----------
    departure : Departure
        Where it begins.
    legs : sequence of Leg
        Its burns, in order.
    ephemeris : Ephemeris
        Over the flight.

    Returns
    -------
    ChainPath or None
        With the instants of all burns and flybys among its times; None where the flight does not arrive.
    """
    state = np.concatenate([departure.position_m, departure.velocity_m_s])
    bounds = [departure.t_s, *(leg.burn_t_s for leg in legs), legs[-1].arrival_t_s]
    parts: list[tuple[FloatArray, FloatArray, NDArray[np.int64]]] = []
    for arc, (start, end) in enumerate(pairwise(bounds)):
        if arc:
            state = np.concatenate([state[:3], state[3:] + legs[arc - 1].delta_v_m_s])
        if end <= start:
            continue  # the first burn may come at once
        inner = [leg.arrival_t_s for leg in legs if start < leg.arrival_t_s < end]
        times = _times(start, end, inner)
        flown, status = fly_through(state, start, times[1:], ephemeris)
        if status[0] != FlightStatus.ARRIVED:
            return None
        states = flown[0]
        parts.append((times, np.vstack([state, states]), np.full(len(times), arc)))
        state = states[-1]
    times = np.concatenate([part[0] for part in parts])
    states = np.vstack([part[1] for part in parts])
    return ChainPath(
        times,
        np.ascontiguousarray(states[:, :3]),
        np.ascontiguousarray(states[:, 3:]),
        np.ascontiguousarray(states_of_body(ephemeris, "Earth", times)[:, :3]),
        np.concatenate([part[2] for part in parts]),
    )


def _times(start: float, end: float, inner: Sequence[float]) -> FloatArray:
    even = np.linspace(start, end, max(2, math.ceil((end - start) / SAMPLE_S) + 1))
    return np.union1d(even, np.array(inner, dtype=np.float64))

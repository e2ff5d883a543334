"""The burn that makes a craft meet a place at a time in N-body: Newton's method on the flight."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from landing_cli.tour.ephemeris import Ephemeris
from landing_cli.tour.nbody import REASONS, FlightStatus, fly

FloatArray = NDArray[np.float64]

MISS_M = 10.0  # a flyby this close is met
CORRECTIONS = 30
HALVINGS = 10
_PROBE_M_S = 0.1  # far above the integrator's noise, far below where the flight bends


@dataclass(frozen=True, eq=False)
class Shot:
    """A burn and the flight that it starts.

    Attributes
    ----------
    delta_v_m_s : (3,) float, m/s
        The burn; heliocentric ecliptic axes.
    state : (6,) float, m and m/s
        In which the craft arrives; NaN where it did not.
    miss_m : float, m
        Distance from the place that was aimed at.
    message : str
        Why it missed; empty where it met.
    """

    delta_v_m_s: FloatArray
    state: FloatArray
    miss_m: float
    message: str

    @property
    def met(self) -> bool:
        """Whether the place was met."""
        return not self.message


def shoot(
    state: FloatArray,
    burn_t_s: float,
    arrival_t_s: float,
    target_m: FloatArray,
    guess_m_s: FloatArray,
    ephemeris: Ephemeris,
) -> Shot:
    """Correct a burn until the flight meets a place.

    The sensitivity to the burn comes from flights with the burn changed along each axis. A correction that
    does not bring the craft nearer is halved.

    Parameters
    ----------
    state : (6,) float, m and m/s
        Before the burn; heliocentric, ecliptic and equinox J2000.
    burn_t_s, arrival_t_s : float, s
        TDB seconds past J2000.
    target_m : (3,) float, m
        The place to meet.
    guess_m_s : (3,) float, m/s
        Burn to start from.
    ephemeris : Ephemeris
        Over the flight.

    Returns
    -------
    Shot
    """
    burn = np.array(guess_m_s, dtype=np.float64)
    probes = np.zeros((4, 3))
    probes[1:] = _PROBE_M_S * np.eye(3)
    states, status = _fly(state, burn + probes, burn_t_s, arrival_t_s, ephemeris)
    for _ in range(CORRECTIONS):
        if status.any():
            reason = REASONS[FlightStatus(int(status[status != 0][0]))]
            return Shot(burn, np.full(6, np.nan), np.nan, reason)
        off = target_m - states[0, :3]
        miss = float(np.linalg.norm(off))
        if miss < MISS_M:
            return Shot(burn, states[0], miss, "")
        slopes = (states[1:, :3] - states[0, :3]).T / _PROBE_M_S
        step, *_ = np.linalg.lstsq(slopes, off, rcond=1e-12)
        for _ in range(HALVINGS):
            tried, found = _fly(state, burn + step + probes, burn_t_s, arrival_t_s, ephemeris)
            if not found.any() and np.linalg.norm(target_m - tried[0, :3]) < miss:
                break
            step = 0.5 * step
        else:
            return Shot(burn, states[0], miss, f"no burn nearby meets it: {miss / 1e3:.0f} km are left")
        burn, states, status = burn + step, tried, found
    return Shot(burn, states[0], miss, f"{CORRECTIONS} corrections leave {miss / 1e3:.0f} km")


def _fly(
    state: FloatArray, burns: FloatArray, burn_t_s: float, arrival_t_s: float, ephemeris: Ephemeris
) -> tuple[FloatArray, NDArray[np.int64]]:
    """Fly a state after each of some burns."""
    starts = np.tile(state, (len(burns), 1))
    starts[:, 3:] += burns
    return fly(starts, burn_t_s, arrival_t_s, ephemeris)

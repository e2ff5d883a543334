"""A two-body chain corrected leg by leg in N-body: what of it holds, and what it costs.

Asteroids and spacecraft fly under the Sun, the planets, the Earth and the Moon. Each burn is corrected until
its leg meets the asteroid; the craft flies on from where it is, not from where the two-body chain has it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from landing_cli.sources.catalogue_records import Catalogue
from landing_cli.tour.ephemeris import Ephemeris
from landing_cli.tour.flybys import describe_flybys
from landing_cli.tour.nbody import REASONS, FlightStatus, fly, fly_elements
from landing_cli.tour.records import Departure, FlybyChain, Leg, SearchLimits
from landing_cli.tour.shooting import shoot
from landing_cli.tour.time_scales import t_s_to_utc

FloatArray = NDArray[np.float64]


def refly(
    chain: FlybyChain,
    catalogue: Catalogue,
    departure: Departure,
    limits: SearchLimits,
    ephemeris: Ephemeris,
    albedo: float,
) -> FlybyChain:
    """Correct a chain leg by leg in N-body.

    Parameters
    ----------
    chain : FlybyChain
        Two-body legs; their dates are kept.
    catalogue : Catalogue
        That the legs' targets are rows of.
    departure : Departure
        The state before the first burn.
    limits : SearchLimits
        What the corrected chain must keep to.
    ephemeris : Ephemeris
        Over the flight and the asteroids' epochs.
    albedo : float
        Geometric albedo that turns H into a diameter.

    Returns
    -------
    FlybyChain
        ``flown``, with the corrected legs and flybys; or ``broken``, with the reason, and the corrected legs
        where every asteroid is met but a limit is not kept.
    """
    asteroids = asteroid_states(chain.legs, catalogue, ephemeris)
    corrected, crafts, message = correct_legs(chain.legs, asteroids, departure, ephemeris)
    if message:
        return replace(chain, nbody_legs=None, status="broken", message=message)
    flybys = describe_flybys(catalogue, corrected, asteroids, crafts, ephemeris, albedo)
    flown = replace(chain, nbody_legs=corrected, flybys=flybys, status="flown", message="")
    broken = limit_broken(flown, limits)
    return replace(flown, status="broken", message=broken) if broken else flown


def asteroid_states(legs: Sequence[Leg], catalogue: Catalogue, ephemeris: Ephemeris) -> FloatArray:
    """States of the asteroids of a chain at their flybys, in N-body from the epochs of their elements.

    Parameters
    ----------
    legs : sequence of k Leg
        Targets and arrivals.
    catalogue : Catalogue
        That the targets are rows of.
    ephemeris : Ephemeris
        Over the flight and the epochs.

    Returns
    -------
    (k, 6) float, m and m/s
        Heliocentric, ecliptic and equinox J2000; NaN where an asteroid does not get there.
    """
    return np.concatenate(
        [
            fly_elements(catalogue.elements.rows([leg.target]), leg.arrival_t_s, ephemeris)[:, 0]
            for leg in legs
        ]
    )


def correct_legs(
    legs: Sequence[Leg], asteroids: FloatArray, departure: Departure, ephemeris: Ephemeris
) -> tuple[tuple[Leg, ...], FloatArray, str]:
    """Correct the burns of a chain, one after the other.

    Parameters
    ----------
    legs : sequence of k Leg
        Dates, and burns to start from.
    asteroids : (k, 6) float, m and m/s
        Their states at the arrivals.
    departure : Departure
        The state before the first burn.
    ephemeris : Ephemeris
        Over the flight.

    Returns
    -------
    tuple of tuple of Leg, (k, 6) float and str
        The legs as far as they were corrected, the states in which the craft arrives, and why it goes no
        further; empty where it does.
    """
    here, t_s = np.concatenate([departure.position_m, departure.velocity_m_s]), departure.t_s
    corrected: list[Leg] = []
    crafts: list[FloatArray] = []
    message = ""
    for number, (leg, asteroid) in enumerate(zip(legs, asteroids, strict=True), 1):
        told = f"leg {number} to {leg.designation}: "
        before, status = fly(here, t_s, leg.burn_t_s, ephemeris)
        if status[0]:
            message = f"{told}coasting to its burn, {REASONS[FlightStatus(int(status[0]))]}"
            break
        if not np.isfinite(asteroid).all():
            message = f"{told}the asteroid itself does not get there (it hits the Earth or the Moon)"
            break
        shot = shoot(before[0], leg.burn_t_s, leg.arrival_t_s, asteroid[:3], leg.delta_v_m_s, ephemeris)
        if not shot.met:  # a conic out of the Earth's reach may mislead; the coast is another start
            again = shoot(before[0], leg.burn_t_s, leg.arrival_t_s, asteroid[:3], np.zeros(3), ephemeris)
            shot = again if again.met else shot
        if not shot.met:
            message = told + shot.message
            break
        corrected.append(replace(leg, delta_v_m_s=shot.delta_v_m_s))
        crafts.append(shot.state)
        here, t_s = shot.state, leg.arrival_t_s
    return tuple(corrected), np.array(crafts).reshape(-1, 6), message


def limit_broken(chain: FlybyChain, limits: SearchLimits) -> str:
    """Say which limit a corrected chain does not keep to; empty where it keeps to all.

    Parameters
    ----------
    chain : FlybyChain
        Corrected in N-body, with its flybys.
    limits : SearchLimits
        What it must keep to.

    Returns
    -------
    str
    """
    spent = chain.nbody_delta_v_m_s
    if spent > limits.delta_v_m_s:
        return f"in N-body it takes {spent:.1f} m/s of {limits.delta_v_m_s:.1f}"
    first_wait_s = chain.best_legs[0].burn_t_s - chain.departure_t_s
    if first_wait_s > limits.first_burn_wait_s + 1.0:
        return f"its first burn is {first_wait_s / 86400:.1f} d after the departure"
    for flyby in chain.flybys:
        if flyby.t_s > limits.end_t_s:
            return f"{flyby.designation} is met on {t_s_to_utc(flyby.t_s)[:10]}, after the end"
        if flyby.geocentric_distance_m > limits.geocentric_distance_m:
            distance_km = flyby.geocentric_distance_m / 1e3
            return f"{flyby.designation} is met {distance_km:.3e} km from the Earth, out of range"
    return ""

"""Better dates for a chain, in N-body: the burns and flybys that ask for the least in all.

A change of the dates changes every later burn, because each leg still has to meet its asteroid. To first
order that follows from the sensitivities of the flights alone: a burn that comes later by dt leaves the craft
displaced by minus the burn times dt, an asteroid that is met later by dt has moved on relative to the craft.
So a gradient costs two dozen flights a leg and no further shooting. SLSQP does the rest.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from landing_cli.flight.astronomy import DAY_S
from landing_cli.sources.catalogue_records import Catalogue
from landing_cli.tour.ephemeris import Ephemeris
from landing_cli.tour.flybys import describe_flybys
from landing_cli.tour.nbody import fly
from landing_cli.tour.records import Departure, FlybyChain, Leg, SearchLimits
from landing_cli.tour.reflight import asteroid_states, correct_legs, limit_broken

FloatArray = NDArray[np.float64]
Window = tuple[float, float]

LEAST_LEG_S = 2.0 * DAY_S
_ROUNDS = 40
_SETTLED_M_S = 1e-3
_BROKEN_M_S = 1e5  # what dates cost with which a leg does not meet its asteroid
_PROBES = np.repeat([1e3, 1e-2], 3)  # m, m/s: far above the noise of a flight


@dataclass(frozen=True, eq=False)
class Dated:
    """A chain at some dates.

    Attributes
    ----------
    legs : tuple of k Leg
        Corrected in N-body.
    asteroids, crafts : (k, 6) float, m and m/s
        States at the flybys.
    """

    legs: tuple[Leg, ...]
    asteroids: FloatArray
    crafts: FloatArray

    @property
    def delta_v_m_s(self) -> float:
        """Sum of the burns, m/s."""
        return sum((leg.size_m_s for leg in self.legs), 0.0)


def improve_dates(
    chain: FlybyChain,
    catalogue: Catalogue,
    departure: Departure,
    limits: SearchLimits,
    ephemeris: Ephemeris,
    albedo: float,
    windows: Sequence[Window] | None = None,
) -> FlybyChain:
    """Move the burns and flybys of a corrected chain to where they ask for less in all.

    Parameters
    ----------
    chain : FlybyChain
        With N-body legs, of `reflight.refly`.
    catalogue : Catalogue
        That the legs' targets are rows of.
    departure : Departure
        The state before the first burn.
    limits : SearchLimits
        Last date, latest first burn, and what the chain must keep to.
    ephemeris : Ephemeris
        Over the flight.
    albedo : float
        Geometric albedo that turns H into a diameter.
    windows : sequence of k pairs of float, s
        Earliest and latest arrival of each leg; by default anything before the end.

    Returns
    -------
    FlybyChain
        ``flown`` or ``broken`` by a limit, never dearer than `chain`; `chain` itself where it was not
        corrected or nothing is gained.
    """
    from scipy.optimize import minimize

    if chain.nbody_legs is None:
        return chain
    start = Dated(
        chain.nbody_legs,
        asteroid_states(chain.nbody_legs, catalogue, ephemeris),
        np.zeros((len(chain.nbody_legs), 6)),
    )
    descent = _Descent(start, departure, ephemeris)
    dates = dates_of(start.legs)
    lower, upper = _bounds(start.legs, departure, limits, windows)
    minimize(
        descent.cost,
        dates / DAY_S,
        jac=True,
        method="SLSQP",
        bounds=list(zip(lower / DAY_S, upper / DAY_S, strict=True)),
        constraints=[_order(len(dates))],
        options={"maxiter": _ROUNDS, "ftol": _SETTLED_M_S},
    )
    best = descent.best
    if best is None or not best.delta_v_m_s < chain.nbody_delta_v_m_s - _SETTLED_M_S:
        return chain
    flybys = describe_flybys(catalogue, best.legs, best.asteroids, best.crafts, ephemeris, albedo)
    better = replace(chain, nbody_legs=best.legs, flybys=flybys, status="flown", message="")
    broken = limit_broken(better, limits)
    if broken and chain.status == "flown":
        return chain
    return replace(better, status="broken", message=broken) if broken else better


def dates_of(legs: Sequence[Leg]) -> FloatArray:
    """Burns and arrivals of legs, in turn.

    Parameters
    ----------
    legs : sequence of k Leg
        In order.

    Returns
    -------
    (2 k,) float, s
    """
    return np.array([t for leg in legs for t in (leg.burn_t_s, leg.arrival_t_s)])


def fly_dates(dates_s: FloatArray, near: Dated, departure: Departure, ephemeris: Ephemeris) -> Dated | None:
    """Correct a chain at other dates.

    Parameters
    ----------
    dates_s : (2 k,) float, s
        Burns and arrivals in turn.
    near : Dated
        The chain at dates nearby: asteroids and burns are carried over from it.
    departure : Departure
        The state before the first burn.
    ephemeris : Ephemeris
        Over the flight.

    Returns
    -------
    Dated or None
        None where a leg does not meet its asteroid.
    """
    arrivals = [leg.arrival_t_s for leg in near.legs]
    asteroids, _ = fly(near.asteroids, arrivals, dates_s[1::2], ephemeris)
    moved = tuple(
        replace(leg, burn_t_s=float(burn), arrival_t_s=float(arrival))
        for leg, burn, arrival in zip(near.legs, dates_s[::2], dates_s[1::2], strict=True)
    )
    legs, crafts, message = correct_legs(moved, asteroids, departure, ephemeris)
    return None if message else Dated(legs, asteroids, crafts)


def slopes_of(dated: Dated, departure: Departure, ephemeris: Ephemeris) -> FloatArray:
    """How the sum of the burns changes with the dates, each asteroid still met.

    Parameters
    ----------
    dated : Dated
        A corrected chain.
    departure : Departure
        The state before the first burn.
    ephemeris : Ephemeris
        Over the flight.

    Returns
    -------
    (2 k,) float, m/s2
        By each burn and each arrival in turn.
    """
    count = 2 * len(dated.legs)
    here, t_s = np.concatenate([departure.position_m, departure.velocity_m_s]), departure.t_s
    moved = np.zeros((6, count))  # how the state moves with the dates
    total = np.zeros(count)
    for k, (leg, asteroid, craft) in enumerate(zip(dated.legs, dated.asteroids, dated.crafts, strict=True)):
        before, coast = _flight_and_slopes(here, t_s, leg.burn_t_s, ephemeris)
        after = before + np.concatenate([np.zeros(3), leg.delta_v_m_s])
        _, flight = _flight_and_slopes(after, leg.burn_t_s, leg.arrival_t_s, ephemeris)
        moved = coast @ moved
        moved[:3, 2 * k] -= leg.delta_v_m_s
        wanted = -flight[:3] @ moved
        wanted[:, 2 * k + 1] += asteroid[3:] - craft[3:]
        burn = np.linalg.solve(flight[:3, 3:], wanted)
        total += leg.delta_v_m_s @ burn / max(leg.size_m_s, 1e-9)
        moved[3:] += burn
        moved = flight @ moved
        here, t_s = craft, leg.arrival_t_s
    return total


class _Descent:
    """The sum of the burns as a function of the dates in days, and the best dates seen."""

    def __init__(self, start: Dated, departure: Departure, ephemeris: Ephemeris) -> None:
        self.near, self.departure, self.ephemeris = start, departure, ephemeris
        self.best: Dated | None = None

    def cost(self, days: FloatArray) -> tuple[float, FloatArray]:
        """Sum of the burns, m/s, and its slopes, m/s a day."""
        dates = days * DAY_S
        dates[2::2] = np.maximum(dates[2::2], dates[1:-1:2])  # SLSQP keeps to the order to rounding
        found = fly_dates(dates, self.near, self.departure, self.ephemeris)
        if found is None:
            return _BROKEN_M_S, np.zeros(len(days))
        if self.best is None or found.delta_v_m_s < self.best.delta_v_m_s:
            self.best = self.near = found
        return found.delta_v_m_s, slopes_of(found, self.departure, self.ephemeris) * DAY_S


def _flight_and_slopes(
    state: FloatArray, start_t_s: float, end_t_s: float, ephemeris: Ephemeris
) -> tuple[FloatArray, FloatArray]:
    """State at the end and its derivatives by the state at the start, (6,) and (6, 6)."""
    starts = np.vstack([state, state + np.diag(_PROBES), state - np.diag(_PROBES)])
    ends, _ = fly(starts, start_t_s, end_t_s, ephemeris)
    return ends[0], ((ends[1:7] - ends[7:]) / (2.0 * _PROBES[:, None])).T


def _bounds(
    legs: Sequence[Leg], departure: Departure, limits: SearchLimits, windows: Sequence[Window] | None
) -> tuple[FloatArray, FloatArray]:
    """Earliest and latest dates, s."""
    lower = np.full(2 * len(legs), departure.t_s)
    upper = np.full(2 * len(legs), limits.end_t_s)
    if windows is not None:
        lower[1::2], upper[1::2] = np.array(windows).T
    upper[0] = min(upper[0], departure.t_s + limits.first_burn_wait_s)
    return lower, np.maximum(lower, upper)


def _order(count: int) -> dict[str, Any]:
    """Constraint that dates come one after the other: gaps of at least 0 before a burn, of two days after."""
    steps = np.diff(np.eye(count), axis=0)
    least = np.where(np.arange(count - 1) % 2 == 0, LEAST_LEG_S / DAY_S, 0.0)
    return {"type": "ineq", "fun": lambda days: steps @ days - least, "jac": lambda _: steps}

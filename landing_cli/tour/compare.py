"""The schemes that Liu et al. (2023) print in Table 2, as chains of ours."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from landing_cli.errors import InputRefused
from landing_cli.flight.astronomy import DAY_S
from landing_cli.sources.catalogue_records import Catalogue
from landing_cli.tour.cases import TourCase
from landing_cli.tour.ephemeris import Ephemeris, states_of_body
from landing_cli.tour.lambert import solve_lambert
from landing_cli.tour.liu2023 import SCHEMES, PrintedFlyby, PrintedScheme
from landing_cli.tour.nbody import fly, fly_elements
from landing_cli.tour.records import FlybyChain, Leg
from landing_cli.tour.time_scales import utc_to_t_s

FloatArray = NDArray[np.float64]

HOURS = np.arange(25)


@dataclass(frozen=True, eq=False)
class _Stop:
    """An asteroid at the time of its flyby: row of the targets, time, and heliocentric state (6,)."""

    row: int
    t_s: float
    state: FloatArray


def scheme_hints(case: TourCase) -> tuple[list[str], list[FlybyChain]]:
    """Make two-body chains of the printed schemes whose asteroids are among the targets.

    Table 2 gives the day of a flyby, and the asteroid's distance from the Earth. The flyby is put to the
    instant of that day at which the asteroid stands at the printed distance, or comes nearest to it. Burns
    are at the departure and at each flyby; a leg takes the number of revolutions and the branch that ask
    for the least velocity increment.

    Parameters
    ----------
    case : TourCase
        Departure, targets, ephemeris.

    Returns
    -------
    list of str
        ``scheme_02`` and so on.
    list of FlybyChain

    Raises
    ------
    InputRefused
        None of the printed asteroids is among the targets.
    """
    rows = {name: row for row, name in enumerate(case.targets.designations)}
    known = [s for s in SCHEMES if s.flybys and all(f.designation in rows for f in s.flybys)]
    if not known:
        raise InputRefused(
            "holds no scheme of Table 2 with all its asteroids",
            where=case.catalogue.source,
            fix="take liu2023, the catalogue that is shipped, and tour.targets that keep its asteroids",
        )
    return [scheme_name(scheme) for scheme in known], [_hint(case, scheme, rows) for scheme in known]


def scheme_name(scheme: PrintedScheme) -> str:
    """Name of a scheme in files and tables.

    Parameters
    ----------
    scheme : PrintedScheme
        As printed.
    """
    return f"scheme_{scheme.number:02d}"


def scheme_of(name: str) -> PrintedScheme:
    """Return the printed scheme of a name.

    Parameters
    ----------
    name : str
        From `scheme_name`.

    Raises
    ------
    KeyError
        There is none.
    """
    return {scheme_name(scheme): scheme for scheme in SCHEMES}[name]


def day_distances(name: str, chain: FlybyChain, targets: Catalogue, ephemeris: Ephemeris) -> FloatArray:
    """Distances of a scheme's asteroids from the Earth over the days that are printed for their flybys.

    Parameters
    ----------
    name : str
        Of the scheme.
    chain : FlybyChain
        Its legs count the rows of `targets`.
    targets : Catalogue
        Their orbits.
    ephemeris : Ephemeris
        Over the flight and the epochs of the orbits.

    Returns
    -------
    (k, 2) float, m
        Least and greatest in the course of the day (every hour).
    """
    ranges = []
    for leg, printed in zip(chain.legs, scheme_of(name).flybys, strict=True):
        distances = _over_day(leg.target, printed, targets, ephemeris)[2]
        ranges.append((distances.min(), distances.max()))
    return np.array(ranges)


def _hint(case: TourCase, scheme: PrintedScheme, rows: dict[str, int]) -> FlybyChain:
    stops = [_stop(rows[flyby.designation], flyby, case) for flyby in scheme.flybys]
    here, velocity, t_s = case.departure.position_m, case.departure.velocity_m_s, case.departure.t_s
    legs = []
    for stop in stops:
        leg, arriving = _leg(here, velocity, t_s, stop, case)
        legs.append(leg)
        here, velocity, t_s = stop.state[:3], arriving, stop.t_s
    return FlybyChain(case.departure.t_s, tuple(legs), None, (), "hint")


def _leg(
    here: FloatArray, velocity: FloatArray, t_s: float, stop: _Stop, case: TourCase
) -> tuple[Leg, FloatArray]:
    """The cheapest two-body arc to an asteroid, and the velocity that it arrives with."""
    most = case.limits.revolutions_max
    kinds = [(0, False), *((n, right) for n in range(1, most + 1) for right in (False, True))]
    leaving, arriving = solve_lambert(
        here,
        stop.state[:3],
        stop.t_s - t_s,
        case.ephemeris.gm_sun,
        [n for n, _ in kinds],
        [right for _, right in kinds],
    )
    costs = np.linalg.norm(leaving - velocity, axis=1)
    best = int(np.nanargmin(costs))
    name = case.targets.designations[stop.row]
    return Leg(stop.row, name, t_s, stop.t_s, leaving[best] - velocity, kinds[best][0]), arriving[best]


def _stop(row: int, printed: PrintedFlyby, case: TourCase) -> _Stop:
    times, states, distances = _over_day(row, printed, case.targets, case.ephemeris)
    wanted = printed.geocentric_distance_km * 1e3
    off = distances - wanted
    crossings = np.flatnonzero(np.sign(off[:-1]) != np.sign(off[1:]))
    if crossings.size:
        i = int(crossings[0])
        t_s = float(times[i] + (times[i + 1] - times[i]) * off[i] / (off[i] - off[i + 1]))
        return _Stop(row, t_s, fly(states[i], times[i], t_s, case.ephemeris)[0][0])
    i = int(np.argmin(np.abs(off)))
    return _Stop(row, float(times[i]), states[i])


def _over_day(
    row: int, printed: PrintedFlyby, targets: Catalogue, ephemeris: Ephemeris
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Hours of the printed day, and an asteroid's states and distances from the Earth then."""
    times: FloatArray = utc_to_t_s(printed.date) + HOURS * (DAY_S / 24.0)
    states = fly_elements(targets.elements.rows([row]), times, ephemeris)[0]
    earth = states_of_body(ephemeris, "Earth", times)
    distances: FloatArray = np.linalg.norm(states[:, :3] - earth[:, :3], axis=1)
    return times, states, distances

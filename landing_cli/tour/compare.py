"""The schemes that Liu et al. (2023) print in Table 2, as chains of ours."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from landing_cli.errors import InputRefused
from landing_cli.flight.astronomy import DAY_S, J2000_JD
from landing_cli.flight.kepler import propagate_kepler
from landing_cli.tour.best_dates import Window, best_chain, with_instants
from landing_cli.tour.cases import TourCase
from landing_cli.tour.ephemeris import states_of_body
from landing_cli.tour.liu2023 import SCHEMES, PrintedFlyby, PrintedScheme
from landing_cli.tour.nbody import fly_elements
from landing_cli.tour.records import FlybyChain
from landing_cli.tour.run_records import PrintedDay, SchemeModel
from landing_cli.tour.time_scales import utc_to_t_s

FloatArray = NDArray[np.float64]
States = Callable[[int, FloatArray], FloatArray]

PRINTED_EPOCH_JD = 2_459_200.5
"""17 December 2020, an epoch of the MPC's list: two-body orbits from there pass at the printed distances."""
FINE_S = 600.0
HOUR_S = 3600.0
LATEST_S = DAY_S
"""How far from the printed day the same asteroids may be flown by where they really are."""
ROUNDING_KM = 0.5e4
"""Half the last printed digit of a distance from the Earth."""


@dataclass(frozen=True, eq=False)
class Scheme:
    """A printed scheme and what it becomes.

    Attributes
    ----------
    name : str
        ``scheme_02`` and so on.
    hint : FlybyChain
        Past the asteroids where they are in N-body, within a day of the printed dates, for the least sum.
    windows : tuple of (float, float), s
        Earliest and latest of these flybys, TDB past J2000.
    model : SchemeModel
        Past the asteroids of the paper.
    """

    name: str
    hint: FlybyChain
    windows: tuple[tuple[float, float], ...]
    model: SchemeModel


def schemes_of(case: TourCase) -> tuple[Scheme, ...]:
    """Make chains of the printed schemes whose asteroids are all among the targets.

    Parameters
    ----------
    case : TourCase
        Departure, targets, ephemeris.

    Returns
    -------
    tuple of Scheme

    Raises
    ------
    InputRefused
        There is none, or one cannot be flown at all.
    """
    names = set(case.targets.designations)
    known = [s for s in SCHEMES if s.flybys and names.issuperset(f.designation for f in s.flybys)]
    if not known:
        raise InputRefused(
            "holds no scheme of Table 2 with all its asteroids",
            where=case.catalogue.source,
            fix="take liu2023, the catalogue that is shipped, and tour.targets that keep its asteroids",
        )
    printed = _states_of_2020(case)

    def real(row: int, times: FloatArray) -> FloatArray:
        return fly_elements(case.targets.elements.rows([row]), times, case.ephemeris)[0]

    found = []
    for scheme in known:
        days = [_day(case, flyby, real, HOUR_S, LATEST_S) for flyby in scheme.flybys]
        windows = tuple((float(day.t_s[0]), float(day.t_s[-1])) for day in days)
        hint = _chain(case, scheme, days, None)
        found.append(Scheme(scheme_name(scheme), hint, windows, _model(case, scheme, printed)))
    return tuple(found)


def printed_days(case: TourCase) -> tuple[PrintedDay, ...]:
    """Distances of the paper's asteroids from the Earth on the days of their flybys.

    Parameters
    ----------
    case : TourCase
        Targets and ephemeris.

    Returns
    -------
    tuple of PrintedDay
        Of every row of Table 2 whose asteroid is among the targets.
    """
    printed, names, days = _states_of_2020(case), set(case.targets.designations), []
    for scheme in SCHEMES:
        for flyby in scheme.flybys:
            if flyby.designation in names:
                distances = _distances(case, _day(case, flyby, printed, HOUR_S))
                days.append(
                    PrintedDay(
                        scheme.number, flyby.designation, float(distances.min()), float(distances.max())
                    )
                )
    return tuple(days)


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


def _model(case: TourCase, scheme: PrintedScheme, printed: States) -> SchemeModel:
    days = [_day(case, flyby, printed, FINE_S) for flyby in scheme.flybys]
    told = [
        with_instants(day, _as_printed(_distances(case, day), flyby))
        for day, flyby in zip(days, scheme.flybys, strict=True)
    ]
    wanted = [flyby.delta_v_m_s for flyby in scheme.flybys]
    hours = [_day(case, flyby, printed, HOUR_S) for flyby in scheme.flybys]
    return SchemeModel(
        np.array([leg.size_m_s for leg in _chain(case, scheme, told, wanted).legs]),
        np.array([leg.size_m_s for leg in _chain(case, scheme, hours, None).legs]),
    )


def _as_printed(distances_m: FloatArray, flyby: PrintedFlyby) -> NDArray[np.bool_]:
    """Instants at which the distance rounds to the printed one, else the one that comes nearest."""
    off = np.abs(distances_m / 1e3 - flyby.geocentric_distance_km)
    return off <= max(ROUNDING_KM, float(off.min()))


def _chain(
    case: TourCase, scheme: PrintedScheme, windows: Sequence[Window], wanted: Sequence[float] | None
) -> FlybyChain:
    chain = best_chain(windows, case.departure, case.limits.revolutions_max, case.ephemeris, wanted)
    if chain is None:
        raise InputRefused(
            f"no burn at the departure meets {windows[0].designation} (scheme {scheme.number})",
            where="tour.departure",
            fix="take the departure of liu2023-ce5.yaml",
        )
    return chain


def _day(case: TourCase, flyby: PrintedFlyby, states: States, step_s: float, more_s: float = 0.0) -> Window:
    """Instants of a printed day, or of somewhat more, and the asteroid's states then."""
    row = case.targets.designations.index(flyby.designation)
    start = utc_to_t_s(flyby.date)
    times: FloatArray = start + np.arange(-more_s, DAY_S + more_s + 0.5 * step_s, step_s)
    return Window(row, flyby.designation, times, states(row, times))


def _distances(case: TourCase, window: Window) -> FloatArray:
    earth = states_of_body(case.ephemeris, "Earth", window.t_s)
    distances: FloatArray = np.linalg.norm(window.states[:, :3] - earth[:, :3], axis=1)
    return distances


def _states_of_2020(case: TourCase) -> States:
    """States of the targets on the orbits that osculate at the epoch the paper's list seems to have had."""
    t_s = (PRINTED_EPOCH_JD - J2000_JD) * DAY_S
    states = fly_elements(case.targets.elements, [t_s], case.ephemeris)[:, 0]

    def printed(row: int, times: FloatArray) -> FloatArray:
        return propagate_kepler(states[row], times - t_s, case.ephemeris.gm_sun)

    return printed

"""Our figures beside those that Liu et al. (2023) print, with the causes of the differences."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from landing_cli.flight.astronomy import DAY_S
from landing_cli.tour.compare import ROUNDING_KM, scheme_name, scheme_of
from landing_cli.tour.escape_records import EscapeMap, EscapeRun
from landing_cli.tour.liu2023 import ESCAPE_CORNERS_M_S, ESCAPE_FLIGHTS_M_S, SCHEMES, PrintedScheme
from landing_cli.tour.run_records import ChainEntry, PrintedDay, TourRun
from landing_cli.tour.summary import flyby_rows, summarise
from landing_cli.tour.targets import diameter_m
from landing_cli.tour.time_scales import t_s_to_utc, utc_to_t_s

FloatArray = NDArray[np.float64]

WITHIN_M_S = 10.0
"""Leg difference up to which an inferred start explains it."""
TABLE_COLUMNS = (
    "scheme",
    "designation",
    "printed_date",
    "printed_delta_v_m_s",
    "as_printed_m_s",
    "least_m_s",
    "nbody_delta_v_m_s",
    "nbody_date_utc",
    "printed_distance_km",
    "on_day",
    "printed_diameter_m",
    "diameter_m",
)
ESCAPE_SHOWN = 5

_NOTES = (
    "as_printed_m_s, least_m_s: past the paper's asteroids, on two-body orbits of 2020-12-17. As printed: "
    "each at the printed distance from the Earth, within its rounding nearest to the printed burns. Least: "
    "the least sum on the printed days.",
    "nbody_delta_v_m_s: past the same asteroids where the Sun, the planets, the Earth and the Moon take "
    "them, within a day of the printed dates, for the least sum.",
    "The start is inferred, not printed: {distance:.4g} km from the Earth's centre, {angle:.1f} degrees "
    "counter-clockwise from the Sun, {speed:.0f} m/s outwards.",
    "{fit} of the {objects} asteroids that have an orbit stand at the printed distance on the printed days.",
    "Sizes: the paper's eq 3 prints 329; 1329 km and an albedo of {albedo:g} give its table (H is rounded).",
)
_ESCAPE_NOTES = (
    "two_body_m_s leads to infinity, two_body_reach_m_s to 1.5e6 km, where the paper's flights end. "
    "flown_m_s leads there in N-body: median, least and most over a month and all directions of the orbit.",
    "Without an atmosphere nothing takes the orbit with a perigee of 100 km down to the apogee of 4.8e5 km "
    "that the paper states: its 42 m/s make good for drag, which is not modelled here.",
)
_NO_ORBIT = (
    ". 2014 NQ64 was seen on one day of 2014: no orbit known today says where the paper had it. Its date for "
    "12923 does not fit its duration either: 172.8 d after the start is 28 September, Table 2 says 26"
)


def compare_with_paper(run: TourRun) -> dict[str, Any]:
    """Set Tables 1 and 2 beside the same schemes flown again.

    Parameters
    ----------
    run : TourRun
        From `tour compare`.

    Returns
    -------
    dict
        ``schemes``: a row of Table 1 each; ``flybys``: a row of Table 2 each; ``days``: distances on the
        printed days; ``table_1``: all 19 rows as printed; ``chains``: as of a search; ``notes``.
    """
    entries = {entry.name: entry for entry in run.cases}
    days = [_day(day) for day in run.days]
    names = {row["designation"] for row in days}
    fit = sum(all(row["on_day"] for row in days if row["designation"] == name) for name in names)
    departure = run.facts.departure
    told = {
        "distance": departure.geocentric_distance_m / 1e3,
        "angle": math.degrees(departure.angle_rad),
        "speed": departure.radial_speed_m_s,
        "albedo": run.facts.albedo,
        "fit": fit,
        "objects": len(names),
    }
    return {
        "schemes": [_scheme(s, entries.get(scheme_name(s)), days) for s in SCHEMES if s.flybys],
        "flybys": [row for entry in run.cases for row in _flyby_rows(entry, days)],
        "days": days,
        "objects_on_their_days": fit,
        "objects": len(names),
        "table_1": [_printed(scheme) for scheme in SCHEMES],
        "chains": [summarise(entry) for entry in run.cases],
        "notes": [note.format(**told) for note in _NOTES],
    }


def _printed(scheme: PrintedScheme) -> dict[str, Any]:
    return {
        "number": scheme.number,
        "asteroids": scheme.asteroids,
        "duration_d": scheme.duration_d,
        "delta_v_m_s": scheme.delta_v_m_s,
        "distance_min_km": scheme.distance_km[0],
        "distance_max_km": scheme.distance_km[1],
    }


def _day(day: PrintedDay) -> dict[str, Any]:
    flybys = {f.designation: f for f in scheme_of(f"scheme_{day.scheme:02d}").flybys}
    printed = flybys[day.designation].geocentric_distance_km
    low, high = day.least_m / 1e3, day.greatest_m / 1e3
    return {
        "scheme": day.scheme,
        "designation": day.designation,
        "printed_distance_km": printed,
        "least_km": low,
        "greatest_km": high,
        "on_day": low - ROUNDING_KM <= printed <= high + ROUNDING_KM,
    }


def _scheme(
    scheme: PrintedScheme, entry: ChainEntry | None, days: Sequence[dict[str, Any]]
) -> dict[str, Any]:
    """A row of Table 1 with ours beside it, and what the difference comes from."""
    row: dict[str, Any] = {
        "number": scheme.number,
        "asteroids": scheme.asteroids,
        "printed_duration_d": scheme.duration_d,
        "printed_delta_v_m_s": scheme.delta_v_m_s,
    }
    if entry is None or entry.model is None:
        named = [flyby.designation for flyby in scheme.flybys]
        told = f"not flown: {' and '.join(named)} are not all among the targets"
        return {
            **row,
            "status": "left out",
            "told": told + (_NO_ORBIT if "2014 NQ64" in named else ""),
        }
    chain, model = entry.chain, entry.model
    printed = np.array([flyby.delta_v_m_s for flyby in scheme.flybys])
    differences = model.delta_v_m_s - printed
    worst = int(np.argmax(np.abs(differences)))
    row |= {
        "status": chain.status,
        "as_printed_m_s": float(model.delta_v_m_s.sum()),
        "least_m_s": float(model.least_m_s.sum()),
        "largest_leg_difference_m_s": float(differences[worst]),
        "nbody_delta_v_m_s": chain.nbody_delta_v_m_s,
        "duration_d": chain.duration_s / DAY_S,
    }
    flown = (
        f"in N-body {chain.nbody_delta_v_m_s:.1f} m/s in {chain.duration_s / DAY_S:.1f} d"
        if chain.nbody_legs
        else f"does not hold in N-body ({chain.message})"
    )
    told = (
        f"printed {scheme.delta_v_m_s:.1f} m/s in {scheme.duration_d:.1f} d; past the paper's asteroids "
        f"{row['as_printed_m_s']:.1f} m/s, legs within {abs(differences[worst]):.1f} m/s; the least sum on "
        f"the printed days {row['least_m_s']:.1f} m/s; {flown}"
    )
    return {**row, "told": told + _cause(scheme, differences, days)}


def _cause(scheme: PrintedScheme, differences: FloatArray, days: Sequence[dict[str, Any]]) -> str:
    """What a difference beyond the inference of the start comes from."""
    worst = int(np.argmax(np.abs(differences)))
    if abs(differences[worst]) <= WITHIN_M_S:
        return ""
    lost = [
        f"{row['designation']} stands at {row['least_km']:.4g} to {row['greatest_km']:.4g} km instead of "
        f"{row['printed_distance_km']:.4g}"
        for row in days
        if row["scheme"] == scheme.number and not row["on_day"]
    ]
    missing = f"On its printed day {'; '.join(lost)}: its hour there is unknown. " if lost else ""
    gaps = np.diff([utc_to_t_s(flyby.date) for flyby in scheme.flybys]) / DAY_S
    return (
        f". {missing}Dates are printed to the day, and flybys follow each other within {gaps.min():.0f} d: "
        "an hour more or less decides about the burns between, as the least sum on the same days shows"
    )


def _flyby_rows(entry: ChainEntry, days: Sequence[dict[str, Any]]) -> list[dict[str, Any]]:
    scheme, model = scheme_of(entry.name), entry.model
    assert model is not None  # a comparison stores one
    ours = flyby_rows(entry.chain) or [{} for _ in scheme.flybys]
    legs = entry.chain.nbody_legs
    fits = {row["designation"]: row["on_day"] for row in days if row["scheme"] == scheme.number}
    rows = []
    for i, (printed, row) in enumerate(zip(scheme.flybys, ours, strict=True)):
        magnitude = float(entry.facts.targets.absolute_magnitude[entry.chain.legs[i].target])
        rows.append(
            {
                "scheme": scheme.number,
                "designation": printed.designation,
                "printed_date": printed.date,
                "printed_delta_v_m_s": printed.delta_v_m_s,
                "as_printed_m_s": float(model.delta_v_m_s[i]),
                "least_m_s": float(model.least_m_s[i]),
                "nbody_delta_v_m_s": math.nan if legs is None else legs[i].size_m_s,
                "nbody_date_utc": t_s_to_utc(entry.chain.best_legs[i].arrival_t_s)[:16],
                "printed_distance_km": printed.geocentric_distance_km,
                "nbody_distance_km": row.get("geocentric_distance_km", math.nan),
                "on_day": fits.get(printed.designation),
                "printed_absolute_magnitude": printed.absolute_magnitude,
                "absolute_magnitude": magnitude,
                "printed_diameter_m": printed.diameter_m,
                "diameter_m": float(diameter_m(magnitude, entry.facts.albedo)),
                "speed_m_s": row.get("speed_m_s", math.nan),
                "phase_angle_deg": row.get("phase_angle_deg", math.nan),
            }
        )
    return rows


def escape_beside_paper(run: EscapeRun) -> dict[str, Any]:
    """Sum up an escape run: least and greatest increments and the flown orbits, beside the printed ones.

    Parameters
    ----------
    run : EscapeRun
        The run.

    Returns
    -------
    dict
        ``maps`` hold every value; ``corners`` and ``flights`` stand beside the paper's.
    """
    corners = []
    for entry in run.cases:
        least, most = ESCAPE_CORNERS_M_S.get(entry.name, (math.nan, math.nan))
        corners.append(
            {
                "body": entry.name,
                "least_m_s": float(np.nanmin(entry.delta_v_m_s)),
                "printed_least_m_s": least,
                "greatest_m_s": float(np.nanmax(entry.delta_v_m_s)),
                "printed_greatest_m_s": most,
            }
        )
    flights = [
        {
            "orbit": flight.name,
            "perigee_km": flight.perigee_altitude_m / 1e3,
            "apogee_km": flight.apogee_altitude_m / 1e3,
            "two_body_m_s": flight.two_body_m_s,
            "two_body_reach_m_s": flight.two_body_reach_m_s,
            "flown_m_s": flight.flown_m_s,
            "flown_least_m_s": flight.flown_least_m_s,
            "flown_most_m_s": flight.flown_most_m_s,
            "printed_m_s": ESCAPE_FLIGHTS_M_S.get(flight.name, math.nan),
            "told": flight.told,
        }
        for flight in run.flights
    ]
    maps = {
        entry.name: {
            "periapsis_altitude_km": entry.periapsis_altitude_m / 1e3,
            "apoapsis_altitude_km": entry.apoapsis_altitude_m / 1e3,
            "delta_v_m_s": entry.delta_v_m_s,
        }
        for entry in run.cases
    }
    return {"corners": corners, "flights": flights, "notes": list(_ESCAPE_NOTES), "maps": maps}


def escape_table(entry: EscapeMap) -> tuple[list[str], list[list[object]]]:
    """Thin a map out to a table that fits a screen.

    Parameters
    ----------
    entry : EscapeMap
        The map.

    Returns
    -------
    list of str
        Headings: the apoapsis altitudes, km.
    list of list
        A row a periapsis altitude, which stands first, km.
    """
    low, high = (
        np.unique(np.linspace(0, len(axis) - 1, min(ESCAPE_SHOWN, len(axis))).round().astype(int))
        for axis in (entry.periapsis_altitude_m, entry.apoapsis_altitude_m)
    )
    columns = ["periapsis_altitude_km", *(f"{entry.apoapsis_altitude_m[j] / 1e3:g}" for j in high)]
    rows = [
        [entry.periapsis_altitude_m[i] / 1e3, *(round(float(entry.delta_v_m_s[i, j]), 1) for j in high)]
        for i in low
    ]
    return columns, rows

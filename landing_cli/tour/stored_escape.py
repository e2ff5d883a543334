"""Escape maps and flights in the file."""

from __future__ import annotations

import numpy as np

from landing_cli.results.body_group import number
from landing_cli.results.tree import Dataset, Group
from landing_cli.tour.escape_records import EscapeFlight, EscapeMap, EscapeRun
from landing_cli.tour.stored_words import text

_NUMBERS = (
    "perigee_altitude_m",
    "apogee_altitude_m",
    "two_body_m_s",
    "two_body_reach_m_s",
    "flown_m_s",
    "flown_least_m_s",
    "flown_most_m_s",
    "flown_apogee_m",
)


def escape_to_members(run: EscapeRun) -> dict[str, Dataset | Group]:
    """Lay maps and flights out for the store.

    Parameters
    ----------
    run : EscapeRun
        What was found.

    Returns
    -------
    dict of Group
        ``cases`` and ``flights``.
    """
    maps = {entry.name: _map_to_group(entry, order) for order, entry in enumerate(run.cases)}
    flights = {flight.name: Group({}, {**vars(flight), "order": i}) for i, flight in enumerate(run.flights)}
    return {"cases": Group(maps), "flights": Group(flights)}


def escape_from_tree(tree: Group) -> EscapeRun:
    """Rebuild maps and flights.

    Parameters
    ----------
    tree : Group
        With the members that `escape_to_members` made.

    Returns
    -------
    EscapeRun

    Raises
    ------
    KeyError, ValueError
        If a part is missing or wrong.
    """
    maps = tuple(_map_from_group(name, group) for name, group in _ordered(tree.group("cases")))
    if not maps:
        raise ValueError("no map")
    flights = tuple(
        EscapeFlight(name=name, told=text(group, "told"), **{key: number(group, key) for key in _NUMBERS})
        for name, group in _ordered(tree.group("flights"))
    )
    return EscapeRun(maps, flights)


def _ordered(groups: Group) -> list[tuple[str, Group]]:
    named = [(name, groups.group(name)) for name in groups.members]
    return sorted(named, key=lambda pair: number(pair[1], "order"))


def _map_to_group(entry: EscapeMap, order: int) -> Group:
    members = {
        "periapsis_altitude_m": Dataset(
            entry.periapsis_altitude_m, "m", "altitude of the periapsis", ("periapsis_altitude_m",)
        ),
        "apoapsis_altitude_m": Dataset(
            entry.apoapsis_altitude_m, "m", "altitude of the apoapsis", ("apoapsis_altitude_m",)
        ),
        "delta_v_m_s": Dataset(
            entry.delta_v_m_s,
            "m s-1",
            "increment at the periapsis that escapes, two-body",
            ("periapsis_altitude_m", "apoapsis_altitude_m"),
        ),
    }
    return Group(members, {"order": order, "gm_m3_s2": entry.gm_m3_s2, "radius_m": entry.radius_m})


def _map_from_group(name: str, group: Group) -> EscapeMap:
    low, high, found = (
        group.dataset(key).data for key in ("periapsis_altitude_m", "apoapsis_altitude_m", "delta_v_m_s")
    )
    if found.shape != (len(low), len(high)) or any(x.dtype != np.float64 for x in (low, high, found)):
        raise ValueError(f"the map of {name} has the shape {found.shape}")
    return EscapeMap(name, number(group, "gm_m3_s2"), number(group, "radius_m"), low, high, found)

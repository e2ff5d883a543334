"""Chains of flybys as tables and groups of the file."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, get_args

import numpy as np
from numpy.typing import NDArray

from landing_cli.errors import InputRefused
from landing_cli.results.body_group import number
from landing_cli.results.columns import Column
from landing_cli.results.tree import Dataset, Group, table_group, table_rows
from landing_cli.tour.records import ChainStatus, DepthReport, Flyby, FlybyChain, Leg
from landing_cli.tour.stored_words import choice, text

LEG_COLUMNS = (
    Column("target", "i8", "1", "row of /targets"),
    Column("burn_t_s", "f8", "s", "time of the burn, TDB past J2000"),
    Column("arrival_t_s", "f8", "s", "time of the flyby, TDB past J2000"),
    Column("delta_v_m_s", "f8", "m s-1", "the burn, heliocentric axes, ecliptic and equinox J2000", (3,)),
    Column("revolutions", "i8", "1", "whole revolutions about the Sun on the way"),
)
FLYBY_COLUMNS = (
    Column("t_s", "f8", "s", "time of the flyby, TDB past J2000"),
    Column("position_m", "f8", "m", "the asteroid, heliocentric, ecliptic and equinox J2000", (3,)),
    Column("relative_velocity_m_s", "f8", "m s-1", "of the spacecraft relative to the asteroid", (3,)),
    Column("phase_angle_rad", "f8", "rad", "Sun - asteroid - spacecraft on approach"),
    Column("geocentric_distance_m", "f8", "m", "asteroid to Earth"),
    Column("absolute_magnitude", "f8", "1", "H"),
    Column("diameter_m", "f8", "m", "of H and the assumed albedo"),
    Column("apparent_magnitude", "f8", "1", "seen from the Earth"),
    Column("miss_m", "f8", "m", "distance of spacecraft and asteroid that the flight leaves"),
)
PATH_COLUMNS = (
    Column("t_s", "f8", "s", "TDB past J2000"),
    Column("position_m", "f8", "m", "spacecraft, heliocentric, ecliptic and equinox J2000", (3,)),
    Column("velocity_m_s", "f8", "m s-1", "spacecraft, heliocentric, ecliptic and equinox J2000", (3,)),
    Column("earth_m", "f8", "m", "the Earth, heliocentric, ecliptic and equinox J2000", (3,)),
    Column("arc", "i8", "1", "coast: 0 before the first burn, i after burn i"),
)
MODEL_COLUMNS = (
    Column("delta_v_m_s", "f8", "m s-1", "burns past the paper's asteroids, at the printed distances"),
    Column("least_m_s", "f8", "m s-1", "burns past the paper's asteroids, least sum on the printed days"),
)
DAY_COLUMNS = (
    Column("scheme", "i8", "1", "of Table 2"),
    Column("least_m", "f8", "m", "least distance from the Earth on the printed day"),
    Column("greatest_m", "f8", "m", "greatest distance from the Earth on the printed day"),
)
DEPTH_COLUMNS = (
    Column("asteroids", "i8", "1", "length of the chains"),
    Column("tried", "i8", "1", "transfers computed"),
    Column("within_limits", "i8", "1", "of them, those that keep to every limit"),
    Column("kept", "i8", "1", "chains from which the search went on"),
    Column("least_delta_v_m_s", "f8", "m s-1", "least two-body sum, beyond the limit too"),
)


def chain_to_group(chain: FlybyChain) -> Group:
    """Lay a chain out for the store, as `chain_from_group` reads it."""
    members: dict[str, Dataset | Group] = {
        "legs": table_group(table_of(chain.legs, LEG_COLUMNS), LEG_COLUMNS, "flyby"),
        "flybys": table_group(table_of(chain.flybys, FLYBY_COLUMNS), FLYBY_COLUMNS, "flyby"),
    }
    if chain.nbody_legs is not None:
        members["nbody_legs"] = table_group(table_of(chain.nbody_legs, LEG_COLUMNS), LEG_COLUMNS, "flyby")
    attributes = {
        "targets": chain.targets,
        "status": chain.status,
        "message": chain.message,
        "departure_t_s": chain.departure_t_s,
        "delta_v_m_s": chain.delta_v_m_s,
        "nbody_delta_v_m_s": chain.nbody_delta_v_m_s,
    }
    return Group(members, attributes)


def chain_from_group(group: Group) -> FlybyChain:
    """Rebuild a chain.

    Parameters
    ----------
    group : Group
        From `chain_to_group`.

    Raises
    ------
    KeyError, ValueError
        If it is none.
    """
    names = group.attributes["targets"]
    if not isinstance(names, tuple):
        raise ValueError("a chain without targets")
    nbody = None
    if "nbody_legs" in group.members:
        nbody = legs_of(table_rows(group.group("nbody_legs"), LEG_COLUMNS), names)
    return FlybyChain(
        number(group, "departure_t_s"),
        legs_of(table_rows(group.group("legs"), LEG_COLUMNS), names),
        nbody,
        flybys_of(table_rows(group.group("flybys"), FLYBY_COLUMNS), names),
        choice(text(group, "status"), get_args(ChainStatus)),
        text(group, "message"),
    )


def table_of(records: Sequence[Any], columns: tuple[Column, ...]) -> NDArray[np.void]:
    """Put fields of records into rows of a table.

    Parameters
    ----------
    records : sequence of records
        With a field for every column.
    columns : tuple of Column
        What to take.

    Returns
    -------
    (n,) structured array
    """
    rows = np.zeros(len(records), dtype=[(c.name, c.dtype, c.shape) for c in columns])
    for row, record in zip(rows, records, strict=True):
        for column in columns:
            row[column.name] = getattr(record, column.name)
    return rows


def legs_of(rows: NDArray[Any], names: tuple[str, ...]) -> tuple[Leg, ...]:
    """Make legs of the rows of a table; ValueError where there are none, or other than names."""
    if not len(rows):
        raise ValueError("a chain without legs")
    return tuple(
        Leg(
            int(row["target"]),
            name,
            float(row["burn_t_s"]),
            float(row["arrival_t_s"]),
            np.array(row["delta_v_m_s"]),
            int(row["revolutions"]),
        )
        for row, name in zip(rows, names, strict=True)
    )


def flybys_of(rows: NDArray[Any], names: tuple[str, ...]) -> tuple[Flyby, ...]:
    """Make flybys of the rows of a table; ValueError where there are some, but other than names."""
    flybys = []
    for row, name in zip(rows, names, strict=bool(len(rows))):
        told: dict[str, Any] = {
            c.name: np.array(row[c.name]) if c.shape else float(row[c.name]) for c in FLYBY_COLUMNS
        }
        flybys.append(Flyby(designation=name, **told))
    return tuple(flybys)


def depths_of(rows: NDArray[Any]) -> tuple[DepthReport, ...]:
    """Make the reports on each length of chain of the rows of a table."""
    return tuple(DepthReport(*row.item()) for row in rows)


def unfit(what: str, where: str = "") -> InputRefused:
    """Make the refusal of a file or journal of another version."""
    return InputRefused(what, where=where, fix="run again with --force, or use the version that wrote it")

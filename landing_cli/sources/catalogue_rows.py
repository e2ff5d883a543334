"""One object of a catalogue, checked, whatever the format it was written in."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from landing_cli.errors import InputRefused
from landing_cli.flight.elements import elements_of_catalogue
from landing_cli.sources.catalogue_records import BadRow, Catalogue

_SHOWN = 3


class Row(NamedTuple):
    """An object in the units of catalogues: au, degrees, Julian dates (TDB).

    `line` is where it stands; `magnitude` is NaN and `condition` -1 where they are not given.
    """

    line: int
    designation: str
    numbered: bool
    epoch_jd: float
    a_au: float
    e: float
    inclination_deg: float
    node_deg: float
    argument_deg: float
    mean_anomaly_deg: float
    magnitude: float
    condition: int


class HyperbolicOrbit(Exception):
    """A row that holds no closed orbit: the file is no list of asteroids."""


@dataclass(frozen=True)
class Origin:
    """The file that rows come from: its path for messages, name, hash, and what a row is called."""

    path: str
    name: str
    sha256: str
    unit: str


def fault(row: Row) -> str:
    """Tell what is impossible about an object.

    Parameters
    ----------
    row : Row
        As written.

    Returns
    -------
    str
        Empty if nothing is.

    Raises
    ------
    HyperbolicOrbit
        The orbit is not closed.
    """
    if not all(map(math.isfinite, row[3:10])):
        return "an element is missing or no finite number"
    if row.e >= 1.0 or row.a_au < 0.0:
        raise HyperbolicOrbit(f"{row.designation} has e = {row.e:g}, a = {row.a_au:g} au: no closed orbit")
    if row.e < 0.0:
        return f"the eccentricity is {row.e:g}"
    if row.a_au == 0.0:
        return "the semi-major axis is 0"
    if not 0.0 <= row.inclination_deg <= 180.0:
        return f"the inclination is {row.inclination_deg:g} degrees"
    if not 2_000_000.0 < row.epoch_jd < 3_000_000.0:
        return f"the epoch {row.epoch_jd:g} is no Julian date"
    return ""


def assemble(rows: Iterable[Row | BadRow], origin: Origin) -> Catalogue:
    """Check rows and put them into arrays.

    Parameters
    ----------
    rows : iterable of Row or BadRow
        In the order of the file.
    origin : Origin
        The file.

    Returns
    -------
    Catalogue
        Bad rows and repeated objects are left out and named.

    Raises
    ------
    InputRefused
        An orbit is hyperbolic, no row is good, or most are bad.
    """
    good: dict[str, Row] = {}
    bad: list[BadRow] = []
    for row in rows:
        if isinstance(row, BadRow):
            bad.append(row)
            continue
        try:
            reason = fault(row)
        except HyperbolicOrbit as error:
            raise InputRefused(
                str(error),
                where=f"{origin.path}, {origin.unit} {row.line}",
                fix="only elliptic orbits can be searched: take the row out",
            ) from error
        if not reason and row.designation in good:
            reason = f"{row.designation} stands in {origin.unit} {good[row.designation].line} already"
        if reason:
            bad.append(BadRow(row.line, reason))
        else:
            good[row.designation] = row
    _refuse_rubbish(len(good), bad, origin)
    return _to_arrays(list(good.values()), tuple(bad), origin)


def _refuse_rubbish(good: int, bad: list[BadRow], origin: Origin) -> None:
    if good > len(bad):
        return
    if not bad:
        raise InputRefused("holds no objects", where=origin.path)
    told = "; ".join(f"{origin.unit} {row.line}: {row.reason}" for row in bad[:_SHOWN])
    raise InputRefused(
        f"{len(bad)} of {good + len(bad)} rows are bad ({told}{'; ...' if len(bad) > _SHOWN else ''})",
        where=origin.path,
        fix="give MPCORB fixed width, the MPC's extended JSON, or an SBDB CSV",
    )


def _to_arrays(rows: list[Row], bad: tuple[BadRow, ...], origin: Origin) -> Catalogue:
    table = np.array([row[3:11] for row in rows], dtype=np.float64)
    return Catalogue(
        designations=tuple(row.designation for row in rows),
        elements=elements_of_catalogue(*table[:, :7].T),
        absolute_magnitude=table[:, 7].copy(),
        condition_code=np.array([row.condition for row in rows], dtype=np.int64),
        numbered=np.array([row.numbered for row in rows], dtype=np.bool_),
        source=origin.name,
        sha256=origin.sha256,
        bad_rows=bad,
    )

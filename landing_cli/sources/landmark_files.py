"""Lists of landmarks from files, read strictly: CSV here, and the checks that any format shares."""

from __future__ import annotations

import csv
import hashlib
import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from landing_cli.errors import InputRefused
from landing_cli.sources.guarded_file import open_regular

FloatArray = NDArray[np.float64]

SIZE_CAP_BYTES = 16 * 2**20
ROW_CAP = 100_000
LENGTH_CAP_M = 1e9
NAME_CAP = 100

POSITION_M, POSITION_KM, DIRECTION = ("x_m", "y_m", "z_m"), ("x_km", "y_km", "z_km"), ("lon_deg", "lat_deg")
_PLACES = (POSITION_M, POSITION_KM, DIRECTION)
_OPTIONAL = ("name", "diameter_m")
_NUMBER = re.compile(r"[+-]?(\d+\.?\d*|\.\d+)([eE][+-]?\d{1,4})?", re.ASCII)


@dataclass(frozen=True)
class LandmarkEntry:
    """One landmark as a file gives it: by position or by direction.

    Attributes
    ----------
    where : str
        File and line, for messages.
    name : str
        Empty where the file gives none.
    position_m : tuple of float or None, m, body frame
    direction_deg : tuple of float or None, deg
        Longitude (east) and latitude from the body's origin.
    diameter_m : float or None, m
    """

    where: str
    name: str
    position_m: tuple[float, float, float] | None
    direction_deg: tuple[float, float] | None
    diameter_m: float | None


@dataclass(frozen=True, eq=False)
class LandmarkTable:
    """The landmarks that a file lists, checked, in its order.

    Attributes
    ----------
    name : tuple of str
        All different; L001, L002 and so on by place where the file gives none.
    where : tuple of str
        File and line of each, for messages.
    position_m : (n, 3) float, m, body frame
        NaN where a landmark is given by direction.
    longitude_rad, latitude_rad : (n,) float, rad, body frame
        East and from the equator; NaN where it is given by position.
    diameter_m : (n,) float, m
        NaN where unknown.
    sha256 : str
        Of the file.
    """

    name: tuple[str, ...]
    where: tuple[str, ...]
    position_m: FloatArray
    longitude_rad: FloatArray
    latitude_rad: FloatArray
    diameter_m: FloatArray
    sha256: str


def read_landmark_csv(path: Path | str) -> LandmarkTable:
    """Read a CSV list of landmarks.

    Parameters
    ----------
    path : Path or str
        The first row names the columns: ``x_m,y_m,z_m`` (or km), or ``lon_deg,lat_deg`` (planetocentric, east
        positive), with or without ``name`` and ``diameter_m``, in any order. Blank lines and lines that begin
        with # are skipped; a diameter may be left empty.

    Returns
    -------
    LandmarkTable

    Raises
    ------
    InputRefused
        It is no regular file, too large, not UTF-8, or not such a list; the line is named.
    """
    text, sha256 = read_landmark_text(Path(path))
    rows = _rows(text, str(path))
    head_where, head = next(rows, (str(path), []))
    place = _place_columns(head, head_where)
    return landmark_table([_entry(row, where, head, place) for where, row in rows], sha256, str(path))


def read_landmark_text(path: Path) -> tuple[str, str]:
    """Read the text of a list of landmarks.

    Parameters
    ----------
    path : Path
        A regular file of at most 16 MiB.

    Returns
    -------
    str
        Without a byte-order mark.
    str
        SHA-256 of the file.

    Raises
    ------
    InputRefused
        It cannot be read, is too large, or is not UTF-8.
    """
    with open_regular(path, SIZE_CAP_BYTES) as stream:
        data = stream.read(SIZE_CAP_BYTES + 1)
    if len(data) > SIZE_CAP_BYTES:
        raise InputRefused("grows while it is read", where=str(path))
    try:
        return data.decode("utf-8-sig"), hashlib.sha256(data).hexdigest()
    except UnicodeDecodeError as error:
        line = data.count(b"\n", 0, error.start) + 1
        raise InputRefused(
            f"byte 0x{data[error.start]:02x} is not UTF-8",
            where=f"{path}, line {line}",
            fix="save it as UTF-8",
        ) from None


def landmark_table(entries: Sequence[LandmarkEntry], sha256: str, source: str) -> LandmarkTable:
    """Check a list of landmarks and make arrays of it.

    Parameters
    ----------
    entries : sequence of LandmarkEntry
        In the file's order.
    sha256 : str
        Of the file.
    source : str
        What to call it in messages.

    Returns
    -------
    LandmarkTable

    Raises
    ------
    InputRefused
        It is empty or too long, a value is out of range, or a name or a place occurs twice.
    """
    if not entries:
        raise InputRefused("lists no landmark", where=source, fix="a row a landmark is needed")
    if len(entries) > ROW_CAP:
        raise InputRefused(f"lists more than {ROW_CAP} landmarks", where=source)
    for entry in entries:
        _check(entry)
    names = [entry.name or f"L{index:03d}" for index, entry in enumerate(entries, 1)]
    _refuse_twice(names, entries, "name")
    _refuse_twice([entry.position_m or entry.direction_deg for entry in entries], entries, "place")
    nowhere, no_direction = (np.nan,) * 3, (np.nan,) * 2
    directions = np.radians([entry.direction_deg or no_direction for entry in entries])
    diameters = [np.nan if entry.diameter_m is None else entry.diameter_m for entry in entries]
    return LandmarkTable(
        name=tuple(names),
        where=tuple(entry.where for entry in entries),
        position_m=np.array([entry.position_m or nowhere for entry in entries]),
        longitude_rad=directions[:, 0],
        latitude_rad=directions[:, 1],
        diameter_m=np.array(diameters),
        sha256=sha256,
    )


def _rows(text: str, source: str) -> Iterator[tuple[str, list[str]]]:
    """Cut CSV into rows, each with its place; a record keeps to one line."""
    for number, line in enumerate(text.split("\n"), 1):
        line = line.removesuffix("\r")
        where = f"{source}, line {number}"
        if not line.strip() or line.lstrip().startswith("#"):
            continue
        if "\0" in line or "\r" in line:
            raise InputRefused("holds a control character", where=where, fix="is this a text file?")
        try:
            yield where, [cell.strip() for cell in next(csv.reader([line], strict=True))]
        except csv.Error as error:
            raise InputRefused(f"is no CSV: {error}", where=where) from None


def _place_columns(head: list[str], where: str) -> tuple[str, ...]:
    """Find by which columns the landmarks are placed, and refuse all that is not understood."""
    wanted = "x_m,y_m,z_m (or x_km,y_km,z_km) or lon_deg,lat_deg; name and diameter_m may stand beside them"
    if len(head) == 1 and re.search(r"[;\t]", head[0]):
        raise InputRefused("columns are not separated by commas", where=where, fix="save it with commas")
    for column in head:
        if column not in {*sum(_PLACES, ()), *_OPTIONAL}:
            raise InputRefused(
                f"{column[:40]!r} is no column of landmarks", where=where, fix=f"name them {wanted}"
            )
        if head.count(column) > 1:
            raise InputRefused(f"names the column {column!r} twice", where=where)
    found = [place for place in _PLACES if set(place) & set(head)]
    if len(found) != 1 or not set(found[0]) <= set(head):
        raise InputRefused("does not say where landmarks are in one way", where=where, fix=f"name {wanted}")
    return found[0]


def _entry(row: list[str], where: str, head: list[str], place: tuple[str, ...]) -> LandmarkEntry:
    if len(row) != len(head):
        raise InputRefused(f"has {len(row)} cells where {len(head)} columns are named", where=where)
    cells = dict(zip(head, row, strict=True))
    numbers = [_number(cells[column], column, where) for column in place]
    diameter = cells.get("diameter_m", "")
    scale = 1000.0 if place == POSITION_KM else 1.0
    return LandmarkEntry(
        where=where,
        name=cells.get("name", ""),
        position_m=None
        if place == DIRECTION
        else (scale * numbers[0], scale * numbers[1], scale * numbers[2]),
        direction_deg=(numbers[0], numbers[1]) if place == DIRECTION else None,
        diameter_m=_number(diameter, "diameter_m", where) if diameter else None,
    )


def _number(cell: str, column: str, where: str) -> float:
    if not _NUMBER.fullmatch(cell):
        raise InputRefused(f"{column}: {cell[:24]!r} is no finite decimal number", where=where)
    return float(cell)


def _check(entry: LandmarkEntry) -> None:
    """Hold one landmark's values to their ranges; written so that infinities fail."""
    name = entry.name
    if len(name) > NAME_CAP or not name.isprintable():
        raise InputRefused(
            "the name is too long or holds control characters", where=entry.where, fix=f"at most {NAME_CAP}"
        )
    if entry.position_m is not None and not max(map(abs, entry.position_m)) <= LENGTH_CAP_M:
        raise InputRefused("the position is a million km away", where=entry.where, fix="check the unit")
    if entry.direction_deg is not None:
        longitude, latitude = entry.direction_deg
        if not -180.0 <= longitude <= 360.0:
            raise InputRefused(f"lon_deg: {longitude:g} is not within -180 to 360", where=entry.where)
        if not -90.0 <= latitude <= 90.0:
            raise InputRefused(f"lat_deg: {latitude:g} is not within -90 to 90", where=entry.where)
    if entry.diameter_m is not None and not 0.0 < entry.diameter_m <= LENGTH_CAP_M:
        raise InputRefused(f"diameter_m: {entry.diameter_m:g} is no diameter", where=entry.where)


def _refuse_twice(values: Sequence[object], entries: Sequence[LandmarkEntry], noun: str) -> None:
    first: dict[object, str] = {}
    for value, entry in zip(values, entries, strict=True):
        if value in first:
            raise InputRefused(
                f"gives the {noun} of another landmark ({first[value]}) again",
                where=entry.where,
                fix="remove one",
            )
        first[value] = entry.where

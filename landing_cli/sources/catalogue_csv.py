"""Rows of a CSV of JPL's small-body database (ssd.jpl.nasa.gov/tools/sbdb_query.html).

Read by the database's column names: ``pdes`` or ``full_name``; ``epoch`` (JD) or ``epoch_mjd``; ``a`` or
``q``; ``e``, ``i``, ``om``, ``w``, ``ma``; and where they stand ``H`` and ``condition_code``. Other columns,
and lines that begin with #, are skipped.
"""

from __future__ import annotations

import csv
import math
import re
from collections.abc import Callable, Iterator

from landing_cli.errors import InputRefused
from landing_cli.sources.catalogue_records import UNKNOWN_CONDITION, BadRow
from landing_cli.sources.catalogue_rows import Row

MJD_ZERO_JD = 2_400_000.5
_CHOICES = (
    ("pdes", "full_name"),
    ("epoch", "epoch_mjd"),
    ("a", "q"),
    ("e",),
    ("i",),
    ("om",),
    ("w",),
    ("ma",),
)
_REAL = re.compile(r"[+-]?(\d+\.?\d*|\.\d+)([eE][+-]?\d{1,3})?")
_FULL_NAME = re.compile(r"(?P<number>\d+)?[^(]*(\((?P<provisional>[^)]+)\))?")


def csv_rows(text: bytes, path: str) -> Iterator[Row | BadRow]:
    """Read the rows below the header.

    Parameters
    ----------
    text : bytes
        The unpacked file.
    path : str
        Its path, for messages.

    Yields
    ------
    Row or BadRow

    Raises
    ------
    InputRefused
        The header lacks a column, names one twice, or a line is of another format.
    """
    lines = text.decode("utf-8", "replace").splitlines()
    kept = [
        (number, line) for number, line in enumerate(lines, 1) if line.strip() and not line.startswith("#")
    ]
    columns = _columns(next(csv.reader([kept[0][1]])), f"{path}, line {kept[0][0]}")
    for number, line in kept[1:]:
        cells = next(csv.reader([line]))
        if len(cells) == 1:
            raise InputRefused(
                "is no CSV", where=f"{path}, line {number}", fix="give a catalogue of one format"
            )
        if len(cells) != len(columns):
            yield BadRow(number, f"has {len(cells)} columns, the header {len(columns)}")
            continue
        yield _row(number, dict(zip(columns, (cell.strip() for cell in cells), strict=True)))


def _columns(header: list[str], where: str) -> list[str]:
    names = [name.strip() for name in header]
    absent = [" or ".join(choice) for choice in _CHOICES if not set(choice) & set(names)]
    if absent:
        raise InputRefused(
            f"the CSV header has no column {', '.join(absent)}",
            where=where,
            fix="export pdes, epoch, a, e, i, om, w, ma, H, condition_code",
        )
    twice = sorted({name for name in names if names.count(name) > 1})
    if twice:
        raise InputRefused(f"the CSV header names {', '.join(twice)} twice", where=where)
    return names


def _row(number: int, cells: dict[str, str]) -> Row | BadRow:
    named = _designation(cells)
    if named is None:
        return BadRow(number, "has no designation")
    real = _reader(cells)
    e = real("e")
    a = real("a") if "a" in cells else real("q") / (1.0 - e) if e != 1.0 else math.inf
    epoch = real("epoch") if "epoch" in cells else real("epoch_mjd") + MJD_ZERO_JD
    values = (epoch, a, e, real("i"), real("om"), real("w"), real("ma"))
    if any(map(math.isnan, values)):
        return BadRow(number, f"{named[0]}: an element is missing or no decimal number")
    code = cells.get("condition_code", "")
    condition = int(code) if len(code) == 1 and code in "0123456789" else UNKNOWN_CONDITION
    return Row(number, *named, *values, real("H"), condition)


def _reader(cells: dict[str, str]) -> Callable[[str], float]:
    def real(name: str) -> float:
        text = cells.get(name, "")
        return float(text) if _REAL.fullmatch(text) else math.nan

    return real


def _designation(cells: dict[str, str]) -> tuple[str, bool] | None:
    """Take the number or the provisional designation; full names read ``433 Eros (A898 PA)``, ``(1 A)``."""
    name = cells.get("pdes", "")
    if not name:
        match = _FULL_NAME.fullmatch(cells.get("full_name", ""))
        name = (match["number"] or match["provisional"] or "") if match else ""
    return (name, name.isascii() and name.isdigit()) if name else None

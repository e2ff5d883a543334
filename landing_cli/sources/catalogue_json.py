"""Rows of the MPC's extended JSON (nea_extended.json, mpcorb_extended.json).

Source: Minor Planet Center, "MPCORB Extended Format"
(minorplanetcenter.net/Extended_Files/Extended_MPCORB_Data_Format_Manual.pdf).
"""

from __future__ import annotations

import json
import math
from collections.abc import Iterator
from typing import Any

from landing_cli.errors import InputRefused
from landing_cli.sources.catalogue_records import UNKNOWN_CONDITION, BadRow
from landing_cli.sources.catalogue_rows import Row

_ELEMENTS = ("Epoch", "a", "e", "i", "Node", "Peri", "M")


def json_rows(text: bytes, path: str) -> Iterator[Row | BadRow]:
    """Take the objects out of a JSON list.

    Parameters
    ----------
    text : bytes
        The unpacked file.
    path : str
        Its path, for messages.

    Yields
    ------
    Row or BadRow
        Their `line` is the entry of the list, from 1.

    Raises
    ------
    InputRefused
        The file is no JSON list of objects.
    """
    try:
        entries = json.loads(text)
    except (ValueError, RecursionError) as error:
        raise InputRefused(f"is no JSON: {error}", where=path) from error
    if not isinstance(entries, list):
        raise InputRefused("is a JSON object, not the MPC's list of objects", where=path)
    for number, entry in enumerate(entries, 1):
        yield _row(number, entry) if isinstance(entry, dict) else BadRow(number, "is no JSON object")


def _row(number: int, entry: dict[str, Any]) -> Row | BadRow:
    named = _designation(entry)
    if named is None:
        return BadRow(number, "has neither Number nor Principal_desig")
    values = [_real(entry.get(key)) for key in _ELEMENTS]
    absent = [key for key, value in zip(_ELEMENTS, values, strict=True) if math.isnan(value)]
    if absent:
        return BadRow(number, f"{named[0]}: {', '.join(absent)} missing or no number")
    code = str(entry.get("U", ""))
    condition = int(code) if len(code) == 1 and code in "0123456789" else UNKNOWN_CONDITION
    epoch, a, e, inclination, node, argument, anomaly = values
    magnitude = _real(entry.get("H"))
    return Row(number, *named, epoch, a, e, inclination, node, argument, anomaly, magnitude, condition)


def _designation(entry: dict[str, Any]) -> tuple[str, bool] | None:
    number = str(entry.get("Number", "")).strip("() ")
    if number.isascii() and number.isdigit():
        return str(int(number)), True
    name = entry.get("Principal_desig")
    return (name.strip(), False) if isinstance(name, str) and name.strip() else None


def _real(value: object) -> float:
    """A JSON number as float; NaN for anything else (a string, a truth value, nothing)."""
    if isinstance(value, bool) or not isinstance(value, int | float):
        return math.nan
    try:
        return float(value)
    except OverflowError:
        return math.nan

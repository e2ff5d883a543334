"""Rows of the MPC's fixed-width format (MPCORB.DAT, NEA.txt).

Source: Minor Planet Center, "Export Format For Minor-Planet Orbits"
(minorplanetcenter.net/iau/info/MPOrbitFormat.html).
"""

from __future__ import annotations

import math
from collections.abc import Iterator

from landing_cli.errors import InputRefused
from landing_cli.sources.catalogue_records import UNKNOWN_CONDITION, BadRow
from landing_cli.sources.catalogue_rows import Row
from landing_cli.sources.packed_designations import unpack_designation, unpack_epoch

_SHORTEST = 103  # up to the semi-major axis
_RULE = "-" * 20  # MPCORB.DAT ends its preamble with a line of dashes
_NOT_DECIMAL = str.maketrans("", "", "0123456789.+- ")
_OTHER_FORMATS = {"{": "JSON", "[": "JSON", "<": "HTML"}


def fixed_rows(text: bytes, path: str) -> Iterator[Row | BadRow]:
    """Cut fixed-width lines into rows.

    Parameters
    ----------
    text : bytes
        The unpacked file; a preamble up to a line of dashes and blank lines are skipped.
    path : str
        Its path, for messages.

    Yields
    ------
    Row or BadRow

    Raises
    ------
    InputRefused
        A line is of another format.
    """
    lines = text.decode("latin-1").split("\n")
    preamble = next((n for n, line in enumerate(lines[:200], 1) if line.startswith(_RULE)), 0)
    epochs: dict[str, float | None] = {}
    for number, line in enumerate(lines[preamble:], preamble + 1):
        if not line.strip():
            continue
        other = "CSV" if line.count(",") >= 6 else _OTHER_FORMATS.get(line[0], "")
        if other:
            raise InputRefused(
                f"is {other}, the lines before are fixed width" if number > 1 else f"is {other}",
                where=f"{path}, line {number}",
                fix="give a catalogue of one format",
            )
        yield _row(number, line, epochs)


def _row(number: int, line: str, epochs: dict[str, float | None]) -> Row | BadRow:
    if len(line.rstrip()) < _SHORTEST:
        return BadRow(number, f"has {len(line.rstrip())} characters, fewer than {_SHORTEST}")
    packed, epoch = line[:7].strip(), line[20:25]
    named = unpack_designation(packed)
    if named is None:
        return BadRow(number, f"'{packed}' is no packed designation")
    if epoch not in epochs:
        epochs[epoch] = unpack_epoch(epoch)
    jd = epochs[epoch]
    if jd is None:
        return BadRow(number, f"{named[0]}: '{epoch}' is no packed epoch")
    numbers = f"{line[8:13]} {line[25:103]}"
    if numbers.translate(_NOT_DECIMAL):
        return BadRow(number, f"{named[0]}: an element is no decimal number")
    try:
        magnitude = float(line[8:13]) if line[8:13].strip() else math.nan
        # with the blanks before them: what has slipped out of its column is no number
        anomaly, argument, node = float(line[25:35]), float(line[35:46]), float(line[46:57])
        inclination, e, a = float(line[57:68]), float(line[68:79]), float(line[91:103])
    except ValueError:
        return BadRow(number, f"{named[0]}: an element is missing or no decimal number")
    code = line[105:106]
    condition = int(code) if code in "0123456789" and code else UNKNOWN_CONDITION
    return Row(number, *named, jd, a, e, inclination, node, argument, anomaly, magnitude, condition)

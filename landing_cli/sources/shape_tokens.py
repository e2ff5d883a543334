"""Tokens of a shape file turned into numbers, strictly: what Python would forgive is refused here."""

from __future__ import annotations

import re

import numpy as np

from landing_cli.body.mesh import FloatArray, IntArray
from landing_cli.errors import InputRefused
from landing_cli.sources.shape_lines import ShapeLines, Tokens

_REAL = re.compile(rb"[+-]?(\d+\.?\d*|\.\d+)([eE][+-]?\d{1,4})?")
_INDEX = re.compile(rb"\d{1,10}")


def shown(token: bytes) -> str:
    """Quote a token for a message, shortened and with unprintable bytes escaped."""
    text = token[:24].decode("ascii", "backslashreplace")
    return repr(text if len(token) <= 24 else f"{text}...")


def reals(rows: list[Tokens], numbers: list[int], lines: ShapeLines) -> FloatArray:
    """Convert rows of equal width.

    Parameters
    ----------
    rows : list of list of bytes
        Tokens of each row.
    numbers : list of int
        Line of each row, for messages.
    lines : ShapeLines
        The file they came from.

    Returns
    -------
    (len(rows), width) float

    Raises
    ------
    InputRefused
        If a token is no finite decimal number.
    """
    flat = [token for row in rows for token in row]
    # Letters other than the exponent's would let nan, inf and 1_0 through.
    if b" ".join(flat).translate(None, b"0123456789+-.eE "):
        _refuse(rows, numbers, lines, _REAL, "a finite decimal number")
    try:
        values = np.array(list(map(float, flat)), dtype=np.float64)
    except ValueError:
        _refuse(rows, numbers, lines, _REAL, "a finite decimal number")
    table = values.reshape(len(rows), -1)
    if not np.isfinite(values).all():
        at = int(np.flatnonzero(~np.isfinite(table).all(axis=1))[0])
        raise InputRefused("a number overflows", where=lines.where(numbers[at]))
    return table


def indices(rows: list[Tokens], numbers: list[int], lines: ShapeLines) -> IntArray:
    """Convert rows of three vertex indices, as :func:`reals` does; signs and points are refused.

    Parameters
    ----------
    rows : list of list of bytes
        Tokens of each row.
    numbers : list of int
        Line of each row, for messages.
    lines : ShapeLines
        The file they came from.

    Returns
    -------
    (len(rows), width) int
    """
    flat = [token for row in rows for token in row]
    if not flat:
        return np.zeros((0, 3), dtype=np.int64)
    if b" ".join(flat).translate(None, b"0123456789 ") or len(max(flat, key=len)) > 10:
        _refuse(rows, numbers, lines, _INDEX, "a vertex index (absolute, at most 10 digits)")
    return np.array(list(map(int, flat)), dtype=np.int64).reshape(len(rows), -1)


def _refuse(
    rows: list[Tokens], numbers: list[int], lines: ShapeLines, grammar: re.Pattern[bytes], wanted: str
) -> None:
    for row, number in zip(rows, numbers, strict=True):
        for token in row:
            if not grammar.fullmatch(token):
                raise InputRefused(f"{shown(token)} is not {wanted}", where=lines.where(number))

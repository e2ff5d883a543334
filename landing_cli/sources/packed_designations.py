"""The Minor Planet Center's packed designations and epochs.

Source: Minor Planet Center, "Packed Provisional and Permanent Designations" and "Packed Dates"
(minorplanetcenter.net/iau/info/PackedDes.html and PackedDates.html).
"""

from __future__ import annotations

import re
from datetime import date

DIGITS = "0123456789ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz"
_VALUE = {digit: value for value, digit in enumerate(DIGITS)}
_CENTURY = {"I": 1800, "J": 1900, "K": 2000, "L": 2100}
_ORDER = "ABCDEFGHJKLMNOPQRSTUVWXYZ"  # the second letter; there is no I
_FIRST_TILDE = 620_000  # permanent numbers from here on are written ~xxxx
_FIRST_UNDERSCORE = 620  # cycles of the second letter from here on are written _yhxxxx
_JD_OF_ORDINAL_ZERO = 1_721_424.5

_PERMANENT = re.compile(r"[0-9A-Za-z]\d{4}")
_TILDE = re.compile(r"~[0-9A-Za-z]{4}")
_PROVISIONAL = re.compile(r"[IJKL]\d\d[A-HJ-Y][0-9A-Za-z]\d[A-HJ-Z0]")
_UNDERSCORE = re.compile(r"_[0-9A-Za-z][A-HJ-Y][0-9A-Za-z]{4}")
_SURVEY = re.compile(r"(PL|T[123])S\d{4}")
_EPOCH = re.compile(r"[IJKL]\d\d[1-9A-C][1-9A-V]")


def unpack_designation(packed: str) -> tuple[str, bool] | None:
    """Write a packed designation out.

    Parameters
    ----------
    packed : str
        ``K14F37R``, ``F4276``, ``~0000``, ``_QC0000``, ``PLS2040``; no blanks.

    Returns
    -------
    (str, bool) or None
        ``2014 FR37`` or ``154276``, and whether the object is numbered; None if it is no packed designation.
    """
    if _PERMANENT.fullmatch(packed):
        return str(_VALUE[packed[0]] * 10_000 + int(packed[1:])), True
    if _TILDE.fullmatch(packed):
        return str(_FIRST_TILDE + _base_62(packed[1:])), True
    if _PROVISIONAL.fullmatch(packed) and packed[6] != "0":
        cycle = _VALUE[packed[4]] * 10 + int(packed[5])
        year = _CENTURY[packed[0]] + int(packed[1:3])
        return f"{year} {packed[3]}{packed[6]}{cycle or ''}", False
    if _UNDERSCORE.fullmatch(packed):
        cycle, letter = divmod(_base_62(packed[3:]), len(_ORDER))
        return f"{2000 + _VALUE[packed[1]]} {packed[2]}{_ORDER[letter]}{_FIRST_UNDERSCORE + cycle}", False
    if _SURVEY.fullmatch(packed):
        return f"{packed[3:]} {packed[0]}-{packed[1]}", False
    return None


def unpack_epoch(packed: str) -> float | None:
    """Turn a packed date into a Julian date.

    Parameters
    ----------
    packed : str
        ``K1972`` is 2019-07-02, 0 h TT.

    Returns
    -------
    float or None
        JD TT (within 2 ms of TDB); None if it is no packed date.
    """
    if not _EPOCH.fullmatch(packed):
        return None
    try:
        day = date(_CENTURY[packed[0]] + int(packed[1:3]), _VALUE[packed[3]], _VALUE[packed[4]])
    except ValueError:
        return None
    return day.toordinal() + _JD_OF_ORDINAL_ZERO


def _base_62(text: str) -> int:
    value = 0
    for digit in text:
        value = 62 * value + _VALUE[digit]
    return value

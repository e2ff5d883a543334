"""Civil time and the time of the ephemerides: UTC and TDB, seconds past J2000."""

from __future__ import annotations

import math
from bisect import bisect_right
from datetime import UTC, datetime, timedelta

from landing_cli.errors import InputRefused
from landing_cli.flight.astronomy import DAY_S

_J2000 = datetime(2000, 1, 1, 12)
_TT_TAI_S = 32.184
# TAI - UTC from the 1st of a month on (IERS Bulletin C; none since 2017)
_LEAP_SECONDS = (
    (1972, 1, 10), (1972, 7, 11), (1973, 1, 12), (1974, 1, 13), (1975, 1, 14), (1976, 1, 15), (1977, 1, 16),
    (1978, 1, 17), (1979, 1, 18), (1980, 1, 19), (1981, 7, 20), (1982, 7, 21), (1983, 7, 22), (1985, 7, 23),
    (1988, 1, 24), (1990, 1, 25), (1991, 1, 26), (1992, 7, 27), (1993, 7, 28), (1994, 7, 29), (1996, 1, 30),
    (1997, 7, 31), (1999, 1, 32), (2006, 1, 33), (2009, 1, 34), (2012, 7, 35), (2015, 7, 36), (2017, 1, 37),
)  # fmt: skip
_CHANGES_S = [(datetime(year, month, 1) - _J2000).total_seconds() for year, month, _ in _LEAP_SECONDS]


def utc_to_t_s(text: str, where: str = "") -> float:
    """Turn a UTC date into TDB seconds past J2000.

    Parameters
    ----------
    text : str
        ISO 8601, as 2021-04-08T15:36:00; a trailing Z is allowed, another offset is not.
    where : str
        Key or option that holds it, for the message.

    Returns
    -------
    float, s
        TDB seconds past J2000.

    Raises
    ------
    InputRefused
        If it is no date, carries an offset, or lies before 1972, when UTC had no whole leap seconds.
    """
    fix = "write UTC as 2021-04-08T15:36:00"
    try:
        date = datetime.fromisoformat(text)
    except ValueError as error:
        raise InputRefused(f"{text[:40]!r} is no date", where=where, fix=fix) from error
    if date.tzinfo is not None:
        if date.utcoffset() != timedelta(0):
            raise InputRefused(f"{text!r} is not in UTC", where=where, fix=fix)
        date = date.astimezone(UTC).replace(tzinfo=None)
    utc_s = (date - _J2000).total_seconds()
    place = bisect_right(_CHANGES_S, utc_s)
    if place == 0:
        raise InputRefused(f"{text!r} is before 1972", where=where, fix="UTC is defined from 1972 on")
    tt_s = utc_s + _LEAP_SECONDS[place - 1][2] + _TT_TAI_S
    return tt_s + tdb_minus_tt_s(tt_s)


def t_s_to_utc(t_s: float) -> str:
    """Turn TDB seconds past J2000 into a UTC date.

    Parameters
    ----------
    t_s : float, s
        TDB seconds past J2000, from 1972 on.

    Returns
    -------
    str
        ISO 8601 to the millisecond, without offset. A leap second itself is written as the second after it.

    Raises
    ------
    InputRefused
        If it lies before 1972.
    """
    tai_s = t_s - tdb_minus_tt_s(t_s) - _TT_TAI_S
    starts = [change + leap[2] for change, leap in zip(_CHANGES_S, _LEAP_SECONDS, strict=True)]
    place = bisect_right(starts, tai_s)
    if place == 0:
        raise InputRefused(f"{t_s:.0f} s past J2000 is before 1972", fix="UTC is defined from 1972 on")
    utc_s = round(tai_s - _LEAP_SECONDS[place - 1][2], 3)
    return (_J2000 + timedelta(seconds=utc_s)).isoformat(timespec="milliseconds")


def tdb_minus_tt_s(t_s: float) -> float:
    """TDB - TT by its largest term, good to 50 microseconds (Astronomical Almanac, section B).

    Parameters
    ----------
    t_s : float, s
        TT or TDB seconds past J2000.

    Returns
    -------
    float, s
    """
    g = math.radians(357.53 + 0.985_600_28 * t_s / DAY_S)
    return 0.001_658 * math.sin(g) + 0.000_014 * math.sin(2.0 * g)

"""UTC and TDB: published conversions, round trips over leap seconds, refusals."""

from __future__ import annotations

import pytest

from landing_cli.errors import InputRefused
from landing_cli.flight.astronomy import DAY_S, J2000_JD
from landing_cli.tour.time_scales import t_s_to_utc, utc_to_t_s


@pytest.mark.parametrize(
    ("utc", "tai_minus_utc"),
    [
        ("1972-01-01T00:00:00", 10),
        ("1999-01-01T00:00:00", 32),
        ("2016-12-31T23:59:59", 36),
        ("2021-04-08", 37),
    ],
)
def test_tdb_is_utc_with_leap_seconds(utc: str, tai_minus_utc: int) -> None:
    from datetime import datetime

    counted = (datetime.fromisoformat(utc) - datetime(2000, 1, 1, 12)).total_seconds()
    assert abs(utc_to_t_s(utc) - counted - tai_minus_utc - 32.184) < 0.0017


def test_the_epoch() -> None:
    """J2000 is 2000-01-01 12:00 TT, 11:58:55.816 UTC."""
    assert abs(utc_to_t_s("2000-01-01T11:58:55.816")) < 1e-4  # TDB - TT is -73 microseconds there


def test_julian_date() -> None:
    """2021-04-08T15:36:00 UTC is JD 2459313.15 UTC, 69.184 s earlier than TDB."""
    t_s = utc_to_t_s("2021-04-08T15:36:00Z")
    assert abs(t_s - ((2_459_313.15 - J2000_JD) * DAY_S + 69.184)) < 0.002


@pytest.mark.parametrize(
    "utc",
    [
        "2016-12-31T23:59:59.500",
        "2017-01-01T00:00:00.000",
        "1972-07-01T00:00:00.000",
        "2022-12-31T12:34:56.789",
    ],
)
def test_round_trip(utc: str) -> None:
    assert t_s_to_utc(utc_to_t_s(utc)) == utc


def test_a_leap_second_passes() -> None:
    assert abs(utc_to_t_s("2017-01-01T00:00:00") - utc_to_t_s("2016-12-31T23:59:59") - 2.0) < 1e-6


@pytest.mark.parametrize(
    ("text", "told"),
    [
        ("yesterday", "is no date"),
        ("2021-04-08T15:36:00+08:00", "is not in UTC"),
        ("1971-12-31T00:00:00", "is before 1972"),
        ("2016-12-31T23:59:60", "is no date"),
    ],
)
def test_refused(text: str, told: str) -> None:
    with pytest.raises(InputRefused, match=told) as caught:
        utc_to_t_s(text, "tour.departure.t_utc")
    assert caught.value.where == "tour.departure.t_utc"
    assert caught.value.fix


def test_before_1972_has_no_utc() -> None:
    with pytest.raises(InputRefused, match="before 1972"):
        t_s_to_utc(-1.0e9)

"""Targets: the filters, Table 2's diameters, and the brightness of asteroids."""

from __future__ import annotations

import dataclasses
import math

import numpy as np
import pytest

from landing_cli.errors import InputRefused
from landing_cli.flight.astronomy import AU_M, DAY_S
from landing_cli.tour.records import TargetLimits
from landing_cli.tour.targets import (
    apparent_magnitude,
    diameter_m,
    embedded_catalogue,
    phase_angle,
    refuse_far_epochs,
    select,
)

ALL = TargetLimits(math.inf, math.inf, None, False, (), 0.15)


@pytest.mark.parametrize(
    ("H", "published_m"),
    [
        (27.7, 9.9),
        (17.6, 1036.5),
        (25.3, 29.9),
        (25.1, 32.8),
        (26.4, 18.0),
        (26.9, 14.3),
        (21.3, 188.6),
        (22.9, 90.3),
    ],
)
def test_diameters_of_table_2_with_1329_km(H: float, published_m: float) -> None:
    np.testing.assert_allclose(diameter_m(H, 0.15), published_m, rtol=2e-4, atol=0.05)  # printed to 0.1


def test_the_printed_diameter_of_12923_lies_within_the_rounding_of_its_magnitude() -> None:
    assert diameter_m(15.85, 0.15) < 2429.7 < diameter_m(15.7, 0.15)


def test_select_keeps_to_every_limit() -> None:
    ten = embedded_catalogue()

    def left(**changes: object) -> tuple[str, ...]:
        return select(ten, dataclasses.replace(ALL, **changes)).designations

    assert left() == ten.designations
    assert left(numbered_only=True) == ("12923", "154276", "452807")
    assert left(perihelion_max_m=0.55 * AU_M) == ("154276", "2010 WC", "2014 NQ64")
    assert left(absolute_magnitude_max=17.6) == ("12923", "154276")
    assert "2014 NQ64" not in left(excluded=("2014 NQ64",))
    known = dataclasses.replace(ten, condition_code=np.arange(10) - 1)
    codes = select(known, dataclasses.replace(ALL, condition_code_max=2))
    assert codes.designations == ten.designations[1:4]
    assert codes.elements.e.tolist() == ten.elements.e[1:4].tolist()


def test_a_selection_of_nothing_is_refused() -> None:
    with pytest.raises(InputRefused, match="none of its 10 asteroids is a target"):
        select(embedded_catalogue(), dataclasses.replace(ALL, perihelion_max_m=0.1 * AU_M))


def test_epochs_far_from_the_flight_are_refused() -> None:
    ten = embedded_catalogue()
    refuse_far_epochs(ten, 0.0, 365.0 * DAY_S)
    with pytest.raises(InputRefused, match=r"the orbit of 2014 NQ64 is of 2025\.9, 55 years from the flight"):
        refuse_far_epochs(ten, -31.0 * 365.25 * DAY_S, -29.0 * 365.25 * DAY_S)


def test_phase_angles_of_a_right_triangle() -> None:
    asteroid, earth = np.array([AU_M, AU_M, 0.0]), np.array([AU_M, 0.0, 0.0])
    np.testing.assert_allclose(phase_angle(asteroid, earth), math.pi / 4, rtol=1e-14)
    np.testing.assert_allclose(phase_angle(asteroid, np.zeros(3)), 0.0, atol=1e-15)


def simple_drop(angle_rad: float) -> float:
    """The two-exponential form of the H, G system (IAU Commission 20, 1985), good beyond some ten degrees."""
    half = math.tan(angle_rad / 2)
    return -2.5 * math.log10(0.85 * math.exp(-3.33 * half**0.63) + 0.15 * math.exp(-1.87 * half**1.22))


@pytest.mark.parametrize("degrees", [10.0, 20.0, 40.0, 60.0, 90.0, 120.0])
def test_brightness_falls_with_the_phase_angle_as_the_simple_form_says(degrees: float) -> None:
    asteroid = np.array([AU_M, 0.0, 0.0])
    away = math.radians(degrees)
    earth = asteroid + AU_M * np.array([-math.cos(away), math.sin(away), 0.0])
    found = apparent_magnitude(20.0, asteroid, earth) - 20.0
    np.testing.assert_allclose(found, simple_drop(away), rtol=0, atol=0.015)


def test_brightness_falls_with_the_square_of_both_distances() -> None:
    asteroid = np.array([2.0 * AU_M, 0.0, 0.0])
    np.testing.assert_allclose(
        apparent_magnitude(15.0, asteroid, np.zeros(3)), 15.0 + 5.0 * math.log10(4.0), rtol=1e-13
    )

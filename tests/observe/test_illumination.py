"""The sun over the body: frames against spherical trigonometry, orbits against Kepler's own facts."""

from __future__ import annotations

import math
from datetime import datetime, timedelta

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from landing_cli.flight.astronomy import AU_M, GM_SUN_M3_S2, OBLIQUITY_RAD
from landing_cli.observe.illumination import (
    body_axes,
    heliocentric_position_m,
    sun_direction,
    sun_directions,
)


def test_body_axes_are_those_of_the_iau_definition():
    alpha, delta, meridian = math.radians(11.35), math.radians(17.22), math.radians(326.07)
    axes = body_axes(alpha, delta, meridian)
    np.testing.assert_allclose(axes @ axes.T, np.eye(3), atol=1e-15)
    assert np.linalg.det(axes) == pytest.approx(1.0, rel=1e-14)
    pole = [math.cos(delta) * math.cos(alpha), math.cos(delta) * math.sin(alpha), math.sin(delta)]
    np.testing.assert_allclose(axes[2], pole, rtol=1e-14)
    node = [math.cos(alpha + math.pi / 2), math.sin(alpha + math.pi / 2), 0.0]
    assert math.atan2(np.cross(node, axes[0]) @ pole, node @ axes[0]) == pytest.approx(
        meridian - 2 * math.pi, rel=1e-13
    )
    np.testing.assert_allclose(body_axes(-math.pi / 2, math.pi / 2, 0.0), np.eye(3), atol=1e-15)


def test_the_sun_at_the_equinox_and_at_the_subsolar_point():
    """A body with the Earth's axes, in the direction of the vernal equinox, sees the sun opposite."""
    direction = sun_direction([1.5 * AU_M, 0.0, 0.0], -math.pi / 2, math.pi / 2, 0.0)
    np.testing.assert_allclose(direction, [-1.0, 0.0, 0.0], atol=1e-15)
    # after a quarter turn of the meridian the sun stands over longitude 90 deg
    direction = sun_direction([1.5 * AU_M, 0.0, 0.0], -math.pi / 2, math.pi / 2, math.pi / 2)
    np.testing.assert_allclose(direction, [0.0, 1.0, 0.0], atol=1e-15)


def test_a_turning_body_is_one_with_a_turned_meridian():
    alpha, delta, meridian, rate = 0.2, 0.3, 1.1, 3.3e-4
    where = np.array([1.1, -0.7, 0.3]) * AU_M
    times = np.array([0.0, 400.0, 9000.0])
    turned = sun_directions(sun_direction(where, alpha, delta, meridian), rate, times)
    again = [sun_direction(where, alpha, delta, meridian + rate * t) for t in times]
    np.testing.assert_allclose(turned, again, atol=1e-15)


@pytest.mark.parametrize("eccentricity", [0.0, 0.2228, 0.9, 0.999])
def test_the_ellipse_obeys_newton(eccentricity):
    """Fly from perihelion by an integrator, in the ecliptic, and turn the frame by its obliquity."""
    a, inclination, node, argument = 1.458 * AU_M, 0.189, 5.314, 3.121
    period = 2.0 * math.pi * math.sqrt(a**3 / GM_SUN_M3_S2)
    cn, sn, ci, si = math.cos(node), math.sin(node), math.cos(inclination), math.sin(inclination)
    cw, sw = math.cos(argument), math.sin(argument)
    towards = np.array([cn * cw - sn * sw * ci, sn * cw + cn * sw * ci, sw * si])
    ahead = np.array([-cn * sw - sn * cw * ci, -sn * sw + cn * cw * ci, cw * si])
    q = a * (1.0 - eccentricity)
    speed = math.sqrt(GM_SUN_M3_S2 * (1.0 + eccentricity) / q)
    times = np.array([0.07, 0.31, 0.5, 0.83]) * period

    def rates(t: float, y: np.ndarray) -> np.ndarray:
        return np.concatenate([y[3:], -GM_SUN_M3_S2 * y[:3] / np.linalg.norm(y[:3]) ** 3])

    start = np.concatenate([q * towards, speed * ahead])
    flown = solve_ivp(rates, (0.0, times[-1]), start, "DOP853", times, rtol=3e-14, atol=1e-6)
    ce, se = math.cos(OBLIQUITY_RAD), math.sin(OBLIQUITY_RAD)
    to_icrf = np.array([[1.0, 0.0, 0.0], [0.0, ce, -se], [0.0, se, ce]])
    for t, ecliptic in zip(times, flown.y[:3].T, strict=True):
        found = heliocentric_position_m(a, eccentricity, inclination, node, argument, 0.0, t)
        assert np.linalg.norm(found - to_icrf @ ecliptic) < 5e-10 * a
        mean = 2.0 * math.pi * t / period
        same = heliocentric_position_m(a, eccentricity, inclination, node, argument, mean - 40 * math.pi, 0.0)
        assert np.linalg.norm(found - same) < 1e-11 * a  # at e = 0.999 beta is a difference of large numbers


def test_the_earth_at_the_march_equinox():
    """The Earth's elements (Standish, 1800-2050): on 2000-03-20 07:35 UT the sun stands at 0 deg."""
    since_j2000 = (78.0 + (7.0 + 35.0 / 60.0 + 64.2 / 3600.0 - 12.0) / 24.0) * 86400.0 + 86400.0
    mean = math.radians(100.46457166 - 102.93768193)
    position = heliocentric_position_m(
        1.00000261 * AU_M, 0.01671123, 0.0, 0.0, math.radians(102.93768193), mean, since_j2000
    )
    sun = -position / np.linalg.norm(position)
    assert abs(math.degrees(math.atan2(sun[1], sun[0]))) < 0.02  # the moon moves the Earth by 0.002 deg
    assert np.linalg.norm(position) == pytest.approx(0.99597 * AU_M, rel=1e-3)


def test_the_seasons_of_eros_were_those_that_near_saw():
    """Autumn began in the north on 2000-06-25, and around 2001-02-01 the sun stood over the south pole.

    Elements of the Minor Planet Center for 2019-07-02, pole of the IAU's report (11.35, 17.22 deg).
    """
    angles = [math.radians(value) for value in (10.82858, 304.30424, 178.83549, 84.17190)]
    epoch = datetime(2019, 7, 2)

    def latitude_deg(day: datetime) -> float:
        elapsed = (day - epoch).total_seconds()
        position = heliocentric_position_m(1.4581823 * AU_M, 0.2227385, *angles, elapsed)
        z = sun_direction(position, math.radians(11.35), math.radians(17.22), 0.0)[2]
        return math.degrees(math.asin(z))

    assert latitude_deg(datetime(2000, 6, 24)) > 0.0 > latitude_deg(datetime(2000, 6, 26))
    days = [datetime(2000, 12, 1) + timedelta(days=i) for i in range(120)]
    least = min(days, key=latitude_deg)
    assert abs((least - datetime(2001, 2, 1)).days) <= 4
    assert latitude_deg(least) < -88.0

"""Harmonics against Legendre functions, the dipole against its equilibria, and what the makers refuse."""

from __future__ import annotations

import math

import numpy as np
import pytest
from gravity_helpers import points_around
from scipy.special import lpmv

from landing_cli.body.gravity.coefficients import kappa
from landing_cli.body.gravity.dipole import dipole_field
from landing_cli.body.gravity.field_values import accelerations, potentials
from landing_cli.body.gravity.harmonics import harmonics_field
from landing_cli.body.gravity.point_mass import point_mass_field
from landing_cli.errors import InputRefused

GM, FRACTION, SEPARATION = 18.083, 0.437, 463.1
RATE = 2.0 * math.pi / (14.9 * 3600.0)


def legendre_sum(
    point: np.ndarray, gm: float, radius: float, c: dict[int, float], s: dict[int, float]
) -> float:
    """GM/r [1 + (R/r)^2 sum_m P_2m(sin phi) (C_2m cos m lambda + S_2m sin m lambda)]."""
    r = float(np.linalg.norm(point))
    sin_latitude, longitude = point[2] / r, math.atan2(point[1], point[0])
    total = 0.0
    for m in range(3):
        legendre = (-1.0) ** m * lpmv(m, 2, sin_latitude)  # scipy's carries the Condon-Shortley phase
        total += legendre * (c[m] * math.cos(m * longitude) + s[m] * math.sin(m * longitude))
    return gm / r * (1.0 + (radius / r) ** 2 * total)


def test_harmonics_equal_the_sum_of_legendre_functions() -> None:
    c, s = {0: -0.118, 1: 0.004, 2: 0.054}, {0: 0.0, 1: -0.007, 2: -0.018}
    field = harmonics_field(4.9, 246.0, c20=c[0], c22=c[2], s22=s[2], c21=c[1], s21=s[1])
    points = points_around(400.0, 50)
    expected = [legendre_sum(p, 4.9, 246.0, c, s) for p in points]
    np.testing.assert_allclose(potentials(field, points), expected, rtol=2e-15, atol=0)


def test_harmonics_have_no_singular_pole() -> None:
    field = harmonics_field(4.9, 246.0, c20=-0.039, c22=0.0037)
    gx, gy, gz = accelerations(field, [[0.0, 0.0, 300.0]])[0]
    # on the axis U = GM/z + GM R^2 C20 / z^3
    expected = -4.9 / 300.0**2 * (1.0 + 3.0 * (246.0 / 300.0) ** 2 * -0.039)
    assert (gx, gy) == (0.0, 0.0)
    assert gz == pytest.approx(expected, rel=1e-14)


def effective_acceleration(points: np.ndarray) -> np.ndarray:
    field = dipole_field(GM, FRACTION, SEPARATION)
    return accelerations(field, points) + RATE**2 * points * [1.0, 1.0, 0.0]


def test_dipole_balances_at_its_two_triangular_points() -> None:
    # both masses at distance kappa^(1/3) d, so that GM (r - centre of mass)/distance^3 = omega^2 r
    distance = kappa(GM, RATE, SEPARATION) ** (1.0 / 3.0) * SEPARATION
    x = (0.5 - FRACTION) * SEPARATION
    y = math.sqrt(distance**2 - SEPARATION**2 / 4.0)
    residual = effective_acceleration(np.array([[x, y, 0.0], [x, -y, 0.0]]))
    assert np.abs(residual).max() < 1e-15 * GM / SEPARATION**2


def test_dipole_balances_at_its_three_collinear_points() -> None:
    front, back = (1.0 - FRACTION) * SEPARATION, -FRACTION * SEPARATION
    found = []
    # omega^2 x (x-a)^2 (x-b)^2 = sign_a GM mu (x-b)^2 + sign_b GM (1-mu) (x-a)^2, signs by interval
    square_a, square_b = np.poly([front, front]), np.poly([back, back])
    left = kappa(GM, RATE, SEPARATION) ** -1.0 / SEPARATION**3 * np.poly([0.0, front, front, back, back])
    for low, high in ((front, math.inf), (back, front), (-math.inf, back)):
        pull = np.polyadd(
            math.copysign(FRACTION, low - front + 1e-9) * square_b,
            math.copysign(1.0 - FRACTION, low - back + 1e-9) * square_a,
        )
        roots = np.roots(np.polysub(left, pull))
        real = roots[np.abs(roots.imag) < 1e-9 * SEPARATION].real
        found += [x for x in real if low < x < high]
    assert len(found) == 3
    residual = effective_acceleration(np.array([[x, 0.0, 0.0] for x in found]))
    assert np.abs(residual).max() < 1e-13 * GM / SEPARATION**2


def test_kappa_of_bacchus_is_that_of_the_reference_table() -> None:
    assert kappa(GM, RATE, SEPARATION) == pytest.approx(13.27, abs=0.005)


def test_dipole_turns_with_its_azimuth() -> None:
    angle = 0.3
    turn = np.array(
        [[math.cos(angle), -math.sin(angle), 0], [math.sin(angle), math.cos(angle), 0], [0, 0, 1]]
    )
    points = points_around(700.0, 10)
    straight = accelerations(dipole_field(GM, FRACTION, SEPARATION), points)
    turned = accelerations(dipole_field(GM, FRACTION, SEPARATION, angle), points @ turn.T)
    np.testing.assert_allclose(turned, straight @ turn.T, rtol=0, atol=1e-14 * np.abs(straight).max())


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: point_mass_field(0.0), "gm_m3_s2 is 0"),
        (lambda: point_mass_field(math.nan), "gm_m3_s2 is nan"),
        (lambda: harmonics_field(-1.0, 1.0, 0.0, 0.0), "gm_m3_s2 is -1"),
        (lambda: harmonics_field(1.0, 0.0, 0.0, 0.0), "reference_radius_m is 0"),
        (lambda: harmonics_field(1.0, 1.0, math.inf, 0.0), "c20 is inf"),
        (lambda: harmonics_field(1.0, 1.0, 0.0, 0.0, s21=math.nan), "s21 is nan"),
        (lambda: dipole_field(math.inf, 0.5, 1.0), "gm_m3_s2 is inf"),
        (lambda: dipole_field(1.0, 1.0, 1.0), "mass_fraction is 1"),
        (lambda: dipole_field(1.0, 0.5, -2.0), "separation_m is -2"),
        (lambda: dipole_field(1.0, 0.5, 1.0, math.nan), "azimuth_rad is nan"),
        (lambda: kappa(1.0, 0.0, 1.0), "rotation_rate_rad_s is 0"),
    ],
)
def test_absurd_parameters_are_refused_by_name(make, message: str) -> None:
    with pytest.raises(InputRefused, match=message):
        make()

"""The largest thrust along a flown curve: at its ends or where it is stationary (Lyu 2026, eqs 33-38).

Thrust over the initial mass is ``s |u|`` with u the thrust acceleration and s the share of the mass that is
left, s' = -s |u| / ve. It is stationary where ``u . u' = |u|^3 / ve``; the right side is 0 when the mass
stays constant, as in the paper. There u' = a' - dg/dt + 2 w x a + w x (w x v): the paper's eqs 34 and 36 are
each wrong in the sign of dg/dt, together right; its eq 35 lacks 1/t_f^3; its eq 37 does not follow from them
(at a sample where the truth is -1.2e-6 it gives 1.16) and is not used.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from landing_cli.body.gravity.field import GravityKind
from landing_cli.body.gravity.kernels import acceleration_and_gradient
from landing_cli.flight.legs import BezierLeg
from landing_cli.kernel import kernel, part

FloatArray = NDArray[np.float64]

_INTERVALS = 200
_BISECTIONS = 40  # a 200th of the curve to the last digit of its middle


class FlownCurve(NamedTuple):
    """What the thrust along a Bezier curve follows from.

    Attributes
    ----------
    points : (4, n + 1, 3) float, m/s^k
        Row k: control points of the k-th time derivative; those beyond its degree are zero.
    kind : GravityKind
    params : (p,) float, SI
        Gravity model.
    w : float, rad/s
        Spin rate about +z.
    exhaust_velocity : float, m/s
        Infinity for a mass that stays constant.
    duration : float, s
    """

    points: FloatArray
    kind: GravityKind
    params: FloatArray
    w: float
    exhaust_velocity: float
    duration: float


def flown_curve(leg: BezierLeg, rotation_rate_rad_s: float, exhaust_velocity_m_s: float) -> FlownCurve:
    """Arrange a stored curve for the kernels.

    Parameters
    ----------
    leg : BezierLeg
        Curve and gravity.
    rotation_rate_rad_s : float, rad/s
        Spin rate about +z.
    exhaust_velocity_m_s : float, m/s
        By which the mass falls; infinity for a mass that stays constant.

    Returns
    -------
    FlownCurve
    """
    degree = len(leg.points_m) - 1
    points = np.zeros((4, degree + 1, 3))
    for k in range(4):
        scale = math.perm(degree, k) / leg.duration_s**k
        points[k, : degree + 1 - k] = scale * np.diff(leg.points_m, k, axis=0)
    field = leg.gravity
    return FlownCurve(
        points, field.kind, field.params, rotation_rate_rad_s, exhaust_velocity_m_s, leg.duration_s
    )


def peak_acceleration(
    leg: BezierLeg, rotation_rate_rad_s: float, exhaust_velocity_m_s: float = math.inf
) -> tuple[float, float]:
    """Largest thrust on a Bezier curve over the initial mass (Lyu 2026, eq 38).

    Parameters
    ----------
    leg : BezierLeg
        Curve and gravity.
    rotation_rate_rad_s : float, rad/s
        Spin rate about +z.
    exhaust_velocity_m_s : float, m/s
        By which the mass falls; infinity for a mass that stays constant, as in the paper.

    Returns
    -------
    (float, float)
        Thrust over the initial mass (m/s2), and when (s).
    """
    value, tau = _peak(flown_curve(leg, rotation_rate_rad_s, exhaust_velocity_m_s))
    return value, tau * leg.duration_s


@part
def bezier_point(points: FloatArray, degree: int, tau: float) -> tuple[float, float, float]:
    """Point of a Bezier curve, by Horner's rule in tau / (1 - tau), or its reverse beyond the middle.

    Parameters
    ----------
    points : (m, 3) float
        Control points; the first ``degree + 1`` count.
    degree : int
        n.
    tau : float
        Share of the curve, 0 to 1.

    Returns
    -------
    tuple of 3 float
    """
    late = tau > 0.5
    ratio = (1.0 - tau) / tau if late else tau / (1.0 - tau)
    x = y = z = 0.0
    choose = 1.0  # binomial (degree, i), from i = degree down to 0
    for i in range(degree, -1, -1):
        p = points[degree - i] if late else points[i]
        x, y, z = x * ratio + choose * p[0], y * ratio + choose * p[1], z * ratio + choose * p[2]
        choose *= i / (degree - i + 1.0)
    scale = (tau if late else 1.0 - tau) ** degree
    return scale * x, scale * y, scale * z


@part
def thrust_slope(curve: FlownCurve, tau: float) -> tuple[float, float]:
    """Thrust acceleration, and a number of the sign of the thrust's rate.

    Parameters
    ----------
    curve : FlownCurve
        The curve.
    tau : float
        Share of the curve, 0 to 1.

    Returns
    -------
    (float, float)
        ``|u|`` (m/s2) and ``u . u' - |u|^3 / ve`` (m2/s5).
    """
    n, w, points = curve.points.shape[1] - 1, curve.w, curve.points
    rx, ry, rz = bezier_point(points[0], n, tau)
    vx, vy, vz = bezier_point(points[1], n - 1, tau)
    ax, ay, az = bezier_point(points[2], n - 2, tau)
    jx, jy, jz = bezier_point(points[3], n - 3, tau)
    g = acceleration_and_gradient(curve.kind, curve.params, rx, ry, rz)
    ux = ax - g[0] - w * (2.0 * vy + w * rx)
    uy = ay - g[1] - w * (-2.0 * vx + w * ry)
    uz = az - g[2]
    gxx, gyy, gzz, gxy, gxz, gyz = g[3], g[4], g[5], g[6], g[7], g[8]
    sx = jx - (gxx * vx + gxy * vy + gxz * vz) - w * (2.0 * ay + w * vx)
    sy = jy - (gxy * vx + gyy * vy + gyz * vz) - w * (-2.0 * ax + w * vy)
    sz = jz - (gxz * vx + gyz * vy + gzz * vz)
    size = math.sqrt(ux * ux + uy * uy + uz * uz)
    return size, ux * sx + uy * sy + uz * sz - size**3 / curve.exhaust_velocity


@part
def _burnt(curve: FlownCurve, h: float, u: float, slope: float, after: float, next_slope: float) -> float:
    """Velocity increment over a share h of the curve: trapezoidal, corrected by the rates at its ends.

    The slopes hold ``u . u' - |u|^3 / ve``, so that ``d|u|/dt = slope / |u| + |u|^2 / ve``.
    """
    seconds = h * curve.duration
    if u <= 0.0 or after <= 0.0:
        return 0.5 * seconds * (u + after)
    rate = slope / u + u * u / curve.exhaust_velocity
    next_rate = next_slope / after + after * after / curve.exhaust_velocity
    return 0.5 * seconds * (u + after) + seconds * seconds * (rate - next_rate) / 12.0


@kernel
def _peak(curve: FlownCurve) -> tuple[float, float]:
    """Largest thrust over the initial mass, and the share of the curve where it is.

    Every interval in which the slope turns from rising to falling holds a top, which is bisected.
    """
    h = 1.0 / _INTERVALS
    u, slope = thrust_slope(curve, 0.0)
    best, where, spent = u, 0.0, 0.0
    for i in range(_INTERVALS):
        after, next_slope = thrust_slope(curve, (i + 1) * h)
        if slope > 0.0 and next_slope <= 0.0:
            low, high = i * h, (i + 1) * h
            for _ in range(_BISECTIONS):
                middle = 0.5 * (low + high)
                if middle <= low or middle >= high:
                    break
                if thrust_slope(curve, middle)[1] > 0.0:
                    low = middle
                else:
                    high = middle
            top, flat = thrust_slope(curve, low)
            burnt = spent + _burnt(curve, low - i * h, u, slope, top, flat)
            level = top * math.exp(-burnt / curve.exhaust_velocity)
            if level > best:
                best, where = level, low
        spent += _burnt(curve, h, u, slope, after, next_slope)
        u, slope = after, next_slope
    level = u * math.exp(-spent / curve.exhaust_velocity)
    return (level, 1.0) if level > best else (best, where)

"""All Bezier curves that two guide points can make, as sums over their heights alpha and beta.

With the other control points given, every state along the curve is affine in (alpha, beta): per time and
curve a few multiplications are left, plus gravity.
"""

from __future__ import annotations

import math
from functools import lru_cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from landing_cli.body.gravity.field import GravityKind
from landing_cli.body.gravity.kernels import acceleration
from landing_cli.body.gravity.models import number_of
from landing_cli.body.gravity.point_mass import point_acceleration
from landing_cli.flight.bezier_curve import bezier_basis, first_control_points, last_control_points
from landing_cli.kernel import kernel, part
from landing_cli.plan.guide_points import DEGREE, GuidePlane
from landing_cli.plan.records import PlanCase

FloatArray = NDArray[np.float64]

_POINT_MASS = int(GravityKind.POINT_MASS)


class CurveFamily(NamedTuple):
    """States of the curves at even times; a row holds what does not vary, what alpha adds, what beta adds.

    Attributes
    ----------
    position : (n, 3, 3) float, m, m/m, m/m
        Position at time i is ``position[i, 0] + alpha position[i, 1] + beta position[i, 2]``.
    acceleration : (n, 3, 3) float, m/s2, 1/s2, 1/s2
        Acceleration less Coriolis and centrifugal, in the same manner: thrust over mass plus gravity.
    step_s : float, s
        Between times.
    """

    position: FloatArray
    acceleration: FloatArray
    step_s: float


def control_point_family(case: PlanCase, plane: GuidePlane) -> FloatArray:
    """Control points as functions of the guide points' heights (Lyu 2026, eqs 11, 13, 20).

    Parameters
    ----------
    case : PlanCase
        What is asked.
    plane : GuidePlane
        Its guide plane. Where the line to the start is free, both guide points are r_f + alpha n_f.

    Returns
    -------
    (3, 8, 3) float, m, 1, 1
        ``P = family[0] + alpha family[1] + beta family[2]``.
    """
    family = np.zeros((3, DEGREE + 1, 3))
    start = (case.position_m, case.velocity_m_s, case.acceleration_m_s2)
    end = (case.site.position_m, case.landing_velocity_m_s, case.landing_acceleration_m_s2)
    family[0, :3] = first_control_points(DEGREE, case.tof_s, *start)
    family[0, -3:] = last_control_points(DEGREE, case.tof_s, *end)
    family[0, 4], family[1, 4] = plane.origin_m, case.site.normal
    if plane.blocked:
        family[0, 3], family[2, 3] = plane.tangent_point_m, plane.e_z
    else:
        family[:, 3] = family[:, 4]
    return family


def curve_family(case: PlanCase, points: FloatArray, samples: int) -> CurveFamily:
    """Sample a family of curves at even times.

    Parameters
    ----------
    case : PlanCase
        What is asked.
    points : (3, 8, 3) float, m, 1, 1
        Control points, as `control_point_family` returns them.
    samples : int
        How many times.

    Returns
    -------
    CurveFamily
    """
    r, v, a = (np.swapaxes(_basis(samples, k) @ points, 0, 1) / case.tof_s**k for k in range(3))
    w = case.asteroid.rotation_rate_rad_s
    turning = np.stack([2.0 * v[..., 1] + w * r[..., 0], -2.0 * v[..., 0] + w * r[..., 1]], axis=-1)
    a[..., :2] -= w * turning
    return CurveFamily(np.ascontiguousarray(r), np.ascontiguousarray(a), case.tof_s / (samples - 1))


def position_family(points: FloatArray, samples: int) -> FloatArray:
    """Sample the positions of a family of curves at even times.

    Parameters
    ----------
    points : (3, 8, 3) float, m, 1, 1
        Control points, as `control_point_family` returns them.
    samples : int
        How many times.

    Returns
    -------
    (n, 3, 3) float, m, m/m, m/m
        As in `CurveFamily`.
    """
    return np.ascontiguousarray(np.swapaxes(_basis(samples, 0) @ points, 0, 1))


@lru_cache(maxsize=16)
def _basis(samples: int, order: int) -> FloatArray:
    """The basis at even times, which is the same for every case."""
    basis = bezier_basis(DEGREE, np.linspace(0.0, 1.0, samples), order)
    basis.setflags(write=False)
    return basis


@kernel
def fill_costs(
    kind: GravityKind,
    params: FloatArray,
    family: CurveFamily,
    departure: FloatArray,
    alpha: FloatArray,
    beta: FloatArray,
    exhaust_velocity: float,
    delta_v: FloatArray,
    peak: FloatArray,
) -> None:
    """Add up what each curve of a family costs (Lyu 2026, eqs 27-28), by the trapezoidal rule.

    Curves are the inner loop, so that a processor takes several at once.

    Parameters
    ----------
    kind : GravityKind
        Gravity model to fly in.
    params : (p,) float, SI
        Parameters of the gravity model.
    family : CurveFamily
        The curves, at n times.
    departure : (n, 3, m) float, m/s2
        What the field pulls more than that model, for each time and curve; or (0, 3, m): nothing.
    alpha, beta : (m,) float, m
        Heights of the guide points.
    exhaust_velocity : float, m/s
        Infinity for a mass that stays constant.
    delta_v : (m,) float, m/s
        Zeros; receives the velocity increments.
    peak : (m,) float, m/s2
        Zeros; receives the largest thrust over the initial mass, among the times.
    """
    n, m = family.position.shape[0], alpha.shape[0]
    pull, before = np.zeros((3, m)), np.zeros(m)
    departs, loses_mass = departure.shape[0] > 0, exhaust_velocity < np.inf
    for i in range(n):
        _fill_pull(kind, params, family.position[i], alpha, beta, pull)
        if departs:
            pull += departure[i]
        q = family.acceleration[i]
        q00, q01, q02, q10, q11, q12 = q[0, 0], q[0, 1], q[0, 2], q[1, 0], q[1, 1], q[1, 2]
        q20, q21, q22 = q[2, 0], q[2, 1], q[2, 2]
        half = 0.5 * family.step_s if i > 0 else 0.0
        for j in range(m):
            ux = q00 + alpha[j] * q10 + beta[j] * q20 - pull[0, j]
            uy = q01 + alpha[j] * q11 + beta[j] * q21 - pull[1, j]
            uz = q02 + alpha[j] * q12 + beta[j] * q22 - pull[2, j]
            u = math.sqrt(ux * ux + uy * uy + uz * uz)
            delta_v[j] += half * (before[j] + u)
            before[j] = u
        if loses_mass:
            for j in range(m):
                peak[j] = max(peak[j], before[j] * math.exp(-delta_v[j] / exhaust_velocity))
        else:
            for j in range(m):
                peak[j] = max(peak[j], before[j])


@part
def _fill_pull(
    kind: GravityKind,
    params: FloatArray,
    p: FloatArray,
    alpha: FloatArray,
    beta: FloatArray,
    pull: FloatArray,
) -> None:
    """Write the gravity (3, m) on every curve at one time; a point mass apart, without a branch inside."""
    p00, p01, p02, p10, p11, p12 = p[0, 0], p[0, 1], p[0, 2], p[1, 0], p[1, 1], p[1, 2]
    p20, p21, p22 = p[2, 0], p[2, 1], p[2, 2]
    if number_of(kind) == _POINT_MASS:
        gm = params[0]
        for j in range(alpha.shape[0]):
            x = p00 + alpha[j] * p10 + beta[j] * p20
            y = p01 + alpha[j] * p11 + beta[j] * p21
            z = p02 + alpha[j] * p12 + beta[j] * p22
            pull[0, j], pull[1, j], pull[2, j] = point_acceleration(gm, x, y, z)
    else:
        for j in range(alpha.shape[0]):
            x = p00 + alpha[j] * p10 + beta[j] * p20
            y = p01 + alpha[j] * p11 + beta[j] * p21
            z = p02 + alpha[j] * p12 + beta[j] * p22
            pull[0, j], pull[1, j], pull[2, j] = acceleration(kind, params, x, y, z)


@part
def fill_path(position: FloatArray, alpha: float, beta: float, path: FloatArray) -> None:
    """Write the positions of one curve of a family.

    Parameters
    ----------
    position : (n, 3, 3) float, m, m/m, m/m
        Of the family, as in `CurveFamily`.
    alpha, beta : float, m
        Heights of the guide points.
    path : (n, 3) float, m
        Receives the positions.
    """
    for i in range(path.shape[0]):
        for k in range(3):
            p = position[i]
            path[i, k] = p[0, k] + alpha * p[1, k] + beta * p[2, k]

"""One yardstick for every path: what it costs, and the limits of the case that it keeps or breaks."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from landing_cli.body.clearance import TOUCHDOWN_TOLERANCE_M, path_clearance
from landing_cli.flight.spacecraft import Spacecraft
from landing_cli.observe.observed import Path
from landing_cli.observe.records import ObserveCase, PathStatus

FloatArray = NDArray[np.float64]

THRUST_TOLERANCE = 2e-5
"""Share by which the thrust may exceed the spacecraft's: what a solver leaves, no more."""

CLEARANCE_TOLERANCE_M = 0.01
GLIDE_SLOPE_TOLERANCE_RAD = math.radians(0.05)

_PARTS = 5  # samples between nodes, at which the path is held against the terrain
_APEX_M = 0.05  # nearer to the site, rounding makes the glide slope
_QUADRATURE = np.polynomial.legendre.leggauss(4)


def path_of(
    case: ObserveCase,
    t_s: FloatArray,
    position_m: FloatArray,
    velocity_m_s: FloatArray,
    acceleration_m_s2: FloatArray,
    status: PathStatus,
    message: str,
    iterations: int,
) -> Path:
    """Measure a flown path, and call it infeasible where it breaks a limit of the case.

    Parameters
    ----------
    case : ObserveCase
        What was asked.
    t_s : (k,) float, s
        Times of the nodes; increasing from 0.
    position_m, velocity_m_s : (k, 3) float, m, m/s, body frame
        At the nodes.
    acceleration_m_s2 : (k, 3) float, m/s2, body frame
        Thrust over mass at the nodes, linear between them.
    status : {"planned", "infeasible", "unresolved"}
        What the solver says.
    message : str
        Why.
    iterations : int
        Of the solver.

    Returns
    -------
    Path
        A ``planned`` one keeps the terrain, the clearance, the glide slope and the thrust.
    """
    spent = velocity_increments(t_s, acceleration_m_s2)
    clearance, slope = limits_along(case, samples_between(t_s, position_m, velocity_m_s))
    peak = _peak_thrust(case.spacecraft, spent, acceleration_m_s2)
    if status == "planned":
        broken = _broken_limit(case, clearance, slope, peak)
        status, message = ("infeasible", broken) if broken else (status, message)
    return Path(
        t_s=t_s,
        position_m=position_m,
        velocity_m_s=velocity_m_s,
        acceleration_m_s2=acceleration_m_s2,
        performance_index_m2_s3=control_energy(t_s, acceleration_m_s2),
        delta_v_m_s=float(spent[-1]),
        propellant_mass_fraction=-math.expm1(-float(spent[-1]) / case.spacecraft.exhaust_velocity_m_s),
        peak_thrust_n=peak,
        clearance_min_m=clearance,
        glide_slope_max_rad=slope,
        status=status,
        message=message,
        iterations=iterations,
    )


def control_energy(t_s: FloatArray, acceleration_m_s2: FloatArray) -> float:
    """Integrate u'u exactly where u is linear between nodes (eq 13).

    Parameters
    ----------
    t_s : (k,) float, s
        Times of the nodes.
    acceleration_m_s2 : (k, 3) float, m/s2
        u at the nodes.

    Returns
    -------
    float, m2/s3
        J.
    """
    u, v = acceleration_m_s2[:-1], acceleration_m_s2[1:]
    squares = (u * u + u * v + v * v).sum(axis=1) / 3.0
    return float(np.diff(t_s) @ squares)


def velocity_increments(t_s: FloatArray, acceleration_m_s2: FloatArray) -> FloatArray:
    """Integrate the magnitude of a thrust acceleration that is linear between nodes.

    On an interval u runs along a straight line that passes the origin at a distance p; with x the way along
    that line, the integral of sqrt(p^2 + x^2) has a closed form. Eq 16 sums the same over samples.

    Parameters
    ----------
    t_s : (k,) float, s
        Times of the nodes.
    acceleration_m_s2 : (k, 3) float, m/s2
        u at the nodes.

    Returns
    -------
    (k,) float, m/s
        Velocity increment from the start to each node.
    """
    u, change = acceleration_m_s2[:-1], np.diff(acceleration_m_s2, axis=0)
    length = np.linalg.norm(change, axis=1)
    size = np.linalg.norm(acceleration_m_s2, axis=1)
    largest = np.maximum(size[:-1], size[1:])
    straight = length > 1e-2 * largest  # a smaller change would cancel in the closed form
    means = np.empty(len(u))
    nodes, weights = _QUADRATURE
    points = u[~straight, None] + 0.5 * (nodes[:, None] + 1.0) * change[~straight, None]
    means[~straight] = np.linalg.norm(points, axis=2) @ (0.5 * weights)
    along, way = (u[straight] * change[straight]).sum(axis=1) / length[straight], length[straight]
    p2 = np.maximum((u[straight] ** 2).sum(axis=1) - along**2, 0.0)
    means[straight] = (_line_integral(p2, along + way) - _line_integral(p2, along)) / way
    return np.concatenate([[0.0], np.cumsum(np.diff(t_s) * means)])


def samples_between(t_s: FloatArray, position_m: FloatArray, velocity_m_s: FloatArray) -> FloatArray:
    """Sample a path between its nodes by cubic Hermite interpolation.

    Parameters
    ----------
    t_s : (k,) float, s
        Times of the nodes.
    position_m, velocity_m_s : (k, 3) float, m, m/s
        At the nodes.

    Returns
    -------
    (5 (k - 1) + 1, 3) float, m
        The nodes are among them.
    """
    s = (np.arange(_PARTS) / _PARTS)[None, :, None]
    h = np.diff(t_s)[:, None, None]
    r, v = position_m[:, None], velocity_m_s[:, None]
    points = (
        (1.0 + 2.0 * s) * (1.0 - s) ** 2 * r[:-1]
        + s * (1.0 - s) ** 2 * h * v[:-1]
        + s**2 * (3.0 - 2.0 * s) * r[1:]
        - s**2 * (1.0 - s) * h * v[1:]
    )
    return np.ascontiguousarray(np.concatenate([points.reshape(-1, 3), position_m[-1:]]))


def limits_along(case: ObserveCase, position_m: FloatArray) -> tuple[float, float]:
    """Measure how a sampled path keeps the terrain and the glide slope.

    Parameters
    ----------
    case : ObserveCase
        What was asked.
    position_m : (k, 3) float, m, body frame
        Samples in the order of flight, the touchdown last.

    Returns
    -------
    clearance_m : float, m
        Least distance to the surface outside the ball about the site, or the depth where the path cuts the
        body; infinite where it never leaves the ball.
    slope_rad : float, rad
        Largest angle between the site frame's z and the line from the site to the spacecraft.
    """
    clearance, _ = path_clearance(
        case.surface, position_m, case.clearance_free_m, TOUCHDOWN_TOLERANCE_M, np.inf
    )
    offset = case.frame.to_site(position_m)
    distance = np.linalg.norm(offset, axis=1)
    far = distance > _APEX_M
    cosines = offset[far, 2] / distance[far]
    slope = float(np.arccos(np.clip(cosines, -1.0, 1.0)).max()) if far.any() else 0.0
    return float(clearance), slope


def _line_integral(p2: FloatArray, x: FloatArray) -> FloatArray:
    """Antiderivative of sqrt(p^2 + x^2) by x; of |x| where p is zero."""
    p = np.sqrt(p2)
    turn = np.arcsinh(np.divide(x, p, out=np.zeros_like(x), where=p > 1e-150))
    return np.asarray(0.5 * (x * np.sqrt(p2 + x * x) + p2 * turn))


def _peak_thrust(craft: Spacecraft, spent_m_s: FloatArray, acceleration_m_s2: FloatArray) -> float:
    """Largest thrust: |u| is convex between nodes, so it is largest at one of them."""
    mass = craft.mass_kg * np.exp(-spent_m_s / craft.exhaust_velocity_m_s)
    return float((mass * np.linalg.norm(acceleration_m_s2, axis=1)).max())


def _broken_limit(case: ObserveCase, clearance_m: float, slope_rad: float, peak_n: float) -> str:
    """Say which limit of the case a path breaks and by how much; empty where it keeps all."""
    if not clearance_m > -TOUCHDOWN_TOLERANCE_M:
        return f"the path cuts the terrain, {-clearance_m:.3g} m deep"
    wanted = case.clearance_m
    if wanted is not None and clearance_m < wanted - CLEARANCE_TOLERANCE_M:
        return f"the path comes within {clearance_m:.4g} m of the terrain, {wanted:g} m is asked"
    half_angle = case.glide_slope_half_angle_rad
    if half_angle is not None and slope_rad > half_angle + GLIDE_SLOPE_TOLERANCE_RAD:
        asked, found = math.degrees(half_angle), math.degrees(slope_rad)
        return f"the path leaves the glide slope: {found:.2f} deg from the site's z, {asked:g} are allowed"
    bound = case.spacecraft.thrust_max_n
    if peak_n > bound * (1.0 + THRUST_TOLERANCE):
        return f"the path needs {peak_n:.4g} N, the thruster gives {bound:g} N"
    return ""

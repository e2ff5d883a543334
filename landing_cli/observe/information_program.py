"""The path that sees best as a program: control energy against the mean position sigma, over spline knots.

    minimise    J / J0 + lambda log(mean sigma / sigma0)
    over        the inner knots of a clamped cubic spline, thrust by inverse dynamics
    subject to  |u| <= thrust / initial mass,  clearance and terrain,  the glide slope (a fixed cone)

J and the sigma come with exact slopes. Three things are held while a program is solved: the transitions of
the covariance, which landmarks stand behind terrain, and which are dark; the caller renews them. (That the
transitions move with the path changes slopes of the mean sigma by less than a part in ten thousand on Eros.)
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

from landing_cli.body.clearance import TOUCHDOWN_TOLERANCE_M
from landing_cli.body.distance_slope import distances_with_slopes
from landing_cli.body.gravity.field_values import accelerations, accelerations_and_gradients
from landing_cli.flight.linear_arcs import frame_slopes
from landing_cli.observe.covariance import mean_sigma_with_slopes, state_transitions
from landing_cli.observe.measurements import information_along, information_slopes, soft_sight
from landing_cli.observe.observed import Path
from landing_cli.observe.path_samples import positions_at
from landing_cli.observe.records import ObserveCase
from landing_cli.observe.spline_path import SplineSamples, knot_times, spline_samples
from landing_cli.observe.visibility import clear_lines, lit, sensor_times, sunlit_lines
from landing_cli.optimize.cone_records import ConeBlock, SmoothRows
from landing_cli.optimize.curved_program import CurvedProgram, CurvedValue

FloatArray = NDArray[np.float64]
BoolArray = NDArray[np.bool_]

REACH = 0.1
"""How far knots may move in a round at trust 1, in distances from start to site."""
CLEARANCE_MARGIN_M = 0.005
GLIDE_SLOPE_MARGIN_RAD = 2e-5

_MOST_TIMES = 250  # of the sensor's that the program looks at; each stands for its neighbours
_SPANS = 16  # at least so many pieces of four Gauss points in the integral of u'u
_CHECKS = 600  # even samples held against the terrain
_BUCKET = 15  # of which share a row
_CONE_CHECKS = 4  # every so many of them are held against the glide slope


@dataclass(frozen=True, eq=False)
class SplineFlight:
    """A spline from the start to the site, sampled wherever the program looks.

    Attributes
    ----------
    case : ObserveCase
    tof_s : float, s
    knot_s : (m,) float, s
    thrust : SplineSamples
        At the Gauss points, the knots and the ends.
    share_s : (k,) float, s
        Weights of these in the integral over time; 0 for knots and ends.
    sensor : SplineSamples
        At the sensor's times, or evenly picked ones of them.
    stands_for : (T,) float
        How many times of the sensor each of these stands for.
    check : SplineSamples
        At even times between the ends.
    """

    case: ObserveCase
    tof_s: float
    knot_s: FloatArray
    thrust: SplineSamples
    share_s: FloatArray
    sensor: SplineSamples
    stands_for: FloatArray
    check: SplineSamples

    @property
    def length_m(self) -> float:
        """Unit of length: from the start to the site."""
        return float(np.linalg.norm(self.case.position_m - self.case.frame.origin_m))

    def samples(self, t_s: FloatArray) -> SplineSamples:
        """Sample the spline at any times, (k,) float, s."""
        case = self.case
        ends = case.position_m, case.velocity_m_s, case.frame.origin_m
        return spline_samples(t_s, self.knot_s, self.tof_s, *ends)


@dataclass(frozen=True, eq=False)
class Held:
    """What is held while a program is solved.

    Attributes
    ----------
    transitions : (T - 1, 6, 6) float, SI
        Of the state between the sensor's times.
    not_hidden : (T, n) bool
        Landmarks that are neither behind terrain nor dark.
    softness : float
        Width of the sensor's limits: radians about an angle, share of a range.
    """

    transitions: FloatArray
    not_hidden: BoolArray
    softness: float


def spline_flight(case: ObserveCase, tof_s: float, knots: int) -> SplineFlight:
    """Lay out a spline with even knots.

    Parameters
    ----------
    case : ObserveCase
        Ends and sensor.
    tof_s : float, s
        t_f.
    knots : int
        Inner knots.

    Returns
    -------
    SplineFlight
    """
    knot_s = knot_times(tof_s, knots)
    edges = np.linspace(0.0, tof_s, (knots + 1) * math.ceil(_SPANS / (knots + 1)) + 1)
    nodes, weights = np.polynomial.legendre.leggauss(4)
    half = 0.5 * np.diff(edges)[:, None]
    gauss, share = (edges[:-1, None] + half * (1.0 + nodes)).ravel(), (half * weights).ravel()
    times = sensor_times(case.sensor, tof_s)
    picked = np.arange(0, len(times), math.ceil(len(times) / _MOST_TIMES))
    stands_for = np.diff(np.append(picked, len(times))).astype(np.float64)
    bare = np.concatenate([[0.0], knot_s, [tof_s]])
    ends = case.position_m, case.velocity_m_s, case.frame.origin_m
    thrust, sensor, check = (
        spline_samples(t_s, knot_s, tof_s, *ends)
        for t_s in (
            np.concatenate([gauss, bare]),
            times[picked],
            np.linspace(0.0, tof_s, _CHECKS + 1)[1:-1],
        )
    )
    return SplineFlight(
        case, tof_s, knot_s, thrust, np.append(share, np.zeros(len(bare))), sensor, stands_for, check
    )


def held_along(flight: SplineFlight, knots_m: FloatArray, softness: float) -> Held:
    """Find what is held, along the present path.

    Parameters
    ----------
    flight : SplineFlight
        The spline.
    knots_m : (m, 3) float, m, body frame
        Its present inner knots.
    softness : float
        Width of the sensor's limits.

    Returns
    -------
    Held
    """
    case, t_s = flight.case, flight.sensor.t_s
    bright = lit(case, t_s)
    bright &= sunlit_lines(case, t_s, bright)
    clear = clear_lines(case, flight.sensor.at(knots_m)[0], bright)
    return Held(transitions_along(flight, knots_m, t_s), bright & clear, softness)


def transitions_along(flight: SplineFlight, knots_m: FloatArray, t_s: FloatArray) -> FloatArray:
    """Linearise the motion along a spline.

    Parameters
    ----------
    flight : SplineFlight
        The spline.
    knots_m : (m, 3) float, m, body frame
        Inner knots.
    t_s : (T,) float, s
        Times between which the transitions are wanted.

    Returns
    -------
    (T - 1, 6, 6) float, SI, rotating body frame
    """
    nodes = np.argsort(flight.thrust.t_s)
    along = flight.thrust.at(knots_m)[0][nodes]
    return state_transitions(flight.case.asteroid, flight.thrust.t_s[nodes], along, t_s)


def thrust_along(flight: SplineFlight, samples: SplineSamples, knots_m: FloatArray) -> FloatArray:
    """Thrust over mass that keeps the spacecraft on the spline (eq 1), (k, 3) float, m/s2, body frame."""
    r, v, a = samples.at(knots_m)
    by_v, by_r = frame_slopes(flight.case.asteroid.rotation_rate_rad_s)
    return a - accelerations(flight.case.asteroid.gravity, r) - r @ by_r.T - v @ by_v.T


@dataclass(frozen=True, eq=False)
class Thrust:
    """Thrust over mass at the Gauss points, the knots and the ends of a spline.

    Attributes
    ----------
    u_m_s2 : (k, 3) float, m/s2, body frame
    by_knots : (k, 3, 3 m) float, 1/s2
        Its slope by the inner knots.
    """

    u_m_s2: FloatArray
    by_knots: FloatArray


def thrust_with_slopes(flight: SplineFlight, knots_m: FloatArray) -> Thrust:
    """Find the thrust along a spline and its slopes by inverse dynamics.

    Parameters
    ----------
    flight : SplineFlight
        The spline.
    knots_m : (m, 3) float, m, body frame
        Inner knots.

    Returns
    -------
    Thrust
    """
    samples, asteroid = flight.thrust, flight.case.asteroid
    r, v, a = samples.at(knots_m)
    g, G = accelerations_and_gradients(asteroid.gravity, r)
    by_v, by_r = frame_slopes(asteroid.rotation_rate_rad_s)
    u = a - g - r @ by_r.T - v @ by_v.T
    R, V, A = samples.basis[:, :, None, :, None]  # (k, 1, m, 1) each
    slope = A * np.eye(3)[:, None, :] - R * (by_r + G)[:, :, None, :] - V * by_v[:, None, :]
    return Thrust(u, slope.reshape(len(u), 3, -1))


def energy(flight: SplineFlight, thrust: Thrust) -> tuple[float, FloatArray, FloatArray]:
    """Control energy of a spline, its slope and Gauss-Newton's part of its curvature, by the knots.

    Parameters
    ----------
    flight : SplineFlight
        The spline.
    thrust : Thrust
        Along it.

    Returns
    -------
    J : float, m2/s3
        The integral of u'u (eq 13) by Gauss's rule.
    slope : (3 m,) float
    curvature : (3 m, 3 m) float
    """
    u, by_knots, share = thrust.u_m_s2, thrust.by_knots, flight.share_s
    slope = 2.0 * np.einsum("k,ka,kan->n", share, u, by_knots)
    root = (np.sqrt(2.0 * share)[:, None, None] * by_knots).reshape(-1, by_knots.shape[2])
    return float(share @ (u * u).sum(axis=1)), slope, root.T @ root


def mean_sigma(flight: SplineFlight, held: Held, knots_m: FloatArray) -> tuple[float, FloatArray]:
    """Mean position sigma with smooth limits, and its slope by the knots.

    Parameters
    ----------
    flight : SplineFlight
        The spline.
    held : Held
        Transitions, hidden landmarks and softness.
    knots_m : (m, 3) float, m, body frame
        Inner knots.

    Returns
    -------
    mean : float, m
    slope : (3 m,) float
    """
    case, position = flight.case, flight.sensor.at(knots_m)[0]
    sight = soft_sight(case, held.not_hidden, held.softness)
    each = flight.stands_for[:, None, None]
    information = each * information_along(sight, position)
    mean, by_information = mean_sigma_with_slopes(
        case.prior, flight.sensor.t_s, held.transitions, information
    )
    by_position = information_slopes(sight, position, each * by_information)
    return mean, (flight.sensor.basis[0].T @ by_position).ravel()


def information_program(
    flight: SplineFlight,
    held: Held,
    origin_m: FloatArray,
    energy_unit: float,
    weight: float,
) -> CurvedProgram:
    """Pose the program in knots scaled about a given path.

    Parameters
    ----------
    flight : SplineFlight
        The spline.
    held : Held
        What does not move while the program is solved.
    origin_m : (m, 3) float, m, body frame
        Inner knots at x = 0; x is in distances from start to site.
    energy_unit : float, m2/s3
        J0.
    weight : float
        lambda.

    Returns
    -------
    CurvedProgram
        Its objective leaves out the constant lambda log(sigma0): sigma in metres.
    """
    L = flight.length_m

    def knots(x: FloatArray) -> FloatArray:
        return origin_m + L * x.reshape(-1, 3)

    @lru_cache(maxsize=2)  # objective and limits ask at the same points
    def thrust(x: bytes) -> Thrust:
        return thrust_with_slopes(flight, knots(np.frombuffer(x)))

    def objective(x: FloatArray) -> CurvedValue:
        J, slope, curvature = energy(flight, thrust(x.tobytes()))
        value, slope, curvature = (
            J / energy_unit,
            slope * (L / energy_unit),
            curvature * (L * L / energy_unit),
        )
        if weight > 0.0:
            sigma, by_knots = mean_sigma(flight, held, knots(x))
            value, slope = value + weight * math.log(sigma), slope + (weight * L / sigma) * by_knots
        return CurvedValue(value, slope, curvature)

    n = origin_m.size
    return CurvedProgram(
        objective,
        _glide_slope(flight, origin_m),
        lambda x: _limits(flight, knots(x), thrust(x.tobytes())),
        np.full(n, REACH),
    )


def knots_of(flight: SplineFlight, path: Path) -> FloatArray:
    """Knots of the spline through a path, (m, 3) float, m, body frame."""
    return positions_at(path, flight.knot_s)


def _glide_slope(flight: SplineFlight, origin_m: FloatArray) -> tuple[ConeBlock, ...]:
    """The cone about the site frame's z at even times: z . d >= cos(angle) |d|."""
    case = flight.case
    if case.glide_slope_half_angle_rad is None:
        return ()
    angle = case.glide_slope_half_angle_rad - GLIDE_SLOPE_MARGIN_RAD
    lift = np.concatenate([case.frame.axes[2][None], math.cos(angle) * np.eye(3)])
    rows = slice(None, None, _CONE_CHECKS)
    offset = (flight.check.at(origin_m)[0][rows] - case.frame.origin_m) @ lift.T / flight.length_m
    matrix = sparse.kron(sparse.csr_array(flight.check.basis[0][rows]), lift, format="csr")
    return (ConeBlock("second_order", matrix, offset.ravel(), 4),)


def _limits(flight: SplineFlight, knots_m: FloatArray, thrust: Thrust) -> SmoothRows:
    """Thrust, terrain and clearance as rows wanted nonnegative, scaled to order one."""
    craft = flight.case.spacecraft
    bound = craft.thrust_max_n / craft.mass_kg
    u, by_knots = thrust.u_m_s2, thrust.by_knots
    L, n = flight.length_m, by_knots.shape[2]
    room, slope, fall = _terrain(flight, knots_m)
    size = np.linalg.norm(u, axis=1)
    along = u / np.maximum(size, 1e-12 * bound)[:, None]
    value = np.concatenate([1.0 - size / bound, room / L])
    rows = np.concatenate([-L / bound * np.einsum("ka,kan->kn", along, by_knots), slope])
    far = np.concatenate([np.full(len(u), np.inf), fall])
    return SmoothRows(np.zeros(0), sparse.csr_array((0, n)), value, sparse.csr_array(rows), far)


def _terrain(flight: SplineFlight, knots_m: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Room to terrain and clearance (q,), m, its slope by the scaled knots (q, 3 m), and its fall (q,)."""
    case, basis = flight.case, flight.check.basis[0]
    position = flight.check.at(knots_m)[0]
    room, slope = distances_with_slopes(case.surface, position)
    room = room + 0.5 * TOUCHDOWN_TOLERANCE_M  # towards the touchdown rounding puts it on either side
    if case.clearance_m is not None:
        offset = position - case.frame.origin_m
        away = np.linalg.norm(offset, axis=1)
        # near the site the terrain alone counts; a step less, so that no sample is skipped on the way out
        step = min(1.5 * flight.length_m / _CHECKS, 0.25 * case.clearance_free_m)
        inside = case.clearance_free_m - step - away
        near = inside < room
        forgiven = np.where(near, inside, room)
        asked = room - case.clearance_m - CLEARANCE_MARGIN_M - 0.5 * TOUCHDOWN_TOLERANCE_M
        inward = -offset / np.maximum(away, 1e-9)[:, None]
        slope = np.where((near & (forgiven > asked))[:, None], inward, slope)
        room = np.maximum(asked, forgiven)
    padded = np.append(room, np.full(-len(room) % _BUCKET, np.inf)).reshape(-1, _BUCKET)
    worst = np.argmin(padded, axis=1) + _BUCKET * np.arange(len(padded))
    rows = (basis[worst, :, None] * slope[worst, None, :]).reshape(len(worst), -1)
    reach = np.append(np.abs(basis).sum(axis=1), np.zeros(padded.size - len(room))).reshape(padded.shape)
    return room[worst], rows, math.sqrt(3.0) * REACH * reach.max(axis=1)

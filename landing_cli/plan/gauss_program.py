"""The pseudospectral planning problem as a cone program on Legendre-Gauss nodes.

Unknowns, scaled: the thrust acceleration u and the position at the nodes of both phases, and bounds
sigma >= |u| at the points of a finer Gauss rule. That the positions are those which u flies is a smooth
equality; thrust and cone are fixed cones, and the clearance is linearised. All are bound between the nodes as
well: a polynomial that keeps a bound at its nodes may break it in between.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import sparse
from scipy.linalg import block_diag

from landing_cli.body.gravity.field_values import accelerations
from landing_cli.optimize.collocation import (
    differentiation_matrix,
    gauss_span,
    interpolation_matrix,
    legendre_gauss,
)
from landing_cli.optimize.cone_program import ConeBlock, ConeProgram, SmoothRows
from landing_cli.plan.gauss_phases import PhaseFlight
from landing_cli.plan.gauss_problem import GaussProblem, phase_flights
from landing_cli.plan.path_rows import path_rows
from landing_cli.plan.records import CHECK_SAMPLES

FloatArray = NDArray[np.float64]

_BOUND_POINTS = 2  # points of the finer rule for each node
_CONE_POINTS = 4  # at which the second phase lies in the cone, for each node
_BUCKET = 40  # samples that share a row
_REST = 1e-9  # weight of sigma where a bound has none: it has to rest on |u| there too
_POSITION_REACH = 0.1  # of the chord from start to site, in a round at trust 1


@dataclass(frozen=True, eq=False)
class _Bounds:
    """The finer rule of all phases together.

    Attributes
    ----------
    control : (m, 3 q) sparse
        From the control at all nodes to |u|'s arguments: rows x, y, z of every point.
    weights : (m,) float
        Quadrature over the whole flight, in units of its duration.
    spent : (m, m) float
        Takes sigma to its integral up to every point, in the same unit.
    share : (m,) float
        Of the greatest thrust.
    """

    control: sparse.csr_array
    weights: FloatArray
    spent: FloatArray
    share: FloatArray


def _bounds(problem: GaussProblem) -> _Bounds:
    tof = problem.case.tof_s
    maps, weights, spent, share = [], [], [], []
    for phase, part in zip(problem.phases, problem.thrust_share, strict=True):
        rule = gauss_span(_BOUND_POINTS * len(phase.span.nodes))
        points = np.concatenate([[-1.0], rule.nodes, [1.0]])
        half = phase.half_s / tof
        maps.append(sparse.kron(phase.span.control_at(points), np.eye(3)))
        weights.append(half * np.concatenate([[0.0], rule.weights, [0.0]]))
        within = np.zeros((len(points), len(points)))
        within[1:-1, 1:-1], within[-1, 1:-1] = half * rule.integral, half * rule.weights
        spent.append(within)
        share.append(np.full(len(points), part))
    joined = sparse.block_diag(spent).toarray()
    counts = [len(part) for part in weights]
    if len(counts) > 1:  # what the first phase spent, the second one has spent from its start on
        joined[counts[0] :, : counts[0]] = weights[0]
    return _Bounds(
        sparse.csr_array(sparse.block_diag(maps)), np.concatenate(weights), joined, np.concatenate(share)
    )


@dataclass(frozen=True, eq=False)
class _PathGrid:
    """Positions: their scaling, and the path between the nodes.

    Attributes
    ----------
    unit_m : (n,) float, m
        Scale of the position at each node: the chord, and after the cone entry the height that one can be at.
    weight_m : (s,) float, 1/m
        Scale of the path bounds at each of `CHECK_SAMPLES` samples.
    to_samples : (s, n) float
    offset_m : (s, 3) float, m
        The samples are at ``offset_m + to_samples @ positions at the nodes``.
    chord_m : float, m
        From the start to the site.
    """

    unit_m: FloatArray
    weight_m: FloatArray
    to_samples: FloatArray
    offset_m: FloatArray
    chord_m: float


def _path_grid(problem: GaussProblem) -> _PathGrid:
    case = problem.case
    chord = float(np.linalg.norm(case.position_m - case.site.position_m))
    times = np.linspace(0.0, case.tof_s, CHECK_SAMPLES)
    to_samples, offset = _between_nodes(problem, times)
    nodes = problem.node_times_s
    unit, weight = np.full(len(nodes), chord), np.full(len(times), 1.0 / chord)
    if problem.entry:
        own = slice(problem.node_counts[0], None)
        unit[own] = _height(problem, case.tof_s - nodes[own])
        tail = slice(problem.entry, None)
        weight[tail] = 0.1 / _height(problem, case.tof_s - times[tail] + 0.5 * (times[1] - times[0]))
    return _PathGrid(unit, weight, to_samples, offset, chord)


def _height(problem: GaussProblem, left_s: FloatArray) -> FloatArray:
    """How far from the site one can be a time before touchdown: what keeps rows near the apex to scale."""
    speed = float(np.linalg.norm(problem.case.landing_velocity_m_s))
    return np.asarray(0.5 * problem.scale_m_s2 * left_s**2 + speed * left_s)


def _between_nodes(problem: GaussProblem, times: FloatArray) -> tuple[FloatArray, FloatArray]:
    """From the positions at all nodes to those at times: matrix (m, n), and offset (m, 3).

    The first phase interpolates through the start and its nodes, the second through its nodes and the site.
    """
    case, n = problem.case, problem.node_counts[0]
    first = problem.phases[0]
    matrix, offset = np.zeros((len(times), sum(problem.node_counts))), np.zeros((len(times), 3))
    later = times >= first.end_s - 1e-9 * case.tof_s if problem.entry else np.zeros(len(times), dtype=bool)
    rows = interpolation_matrix(first.span.support, first.points_of(times[~later]))
    matrix[~later, :n], offset[~later] = rows[:, 1:], rows[:, :1] * case.position_m
    if problem.entry:
        last = problem.phases[1]
        rows = interpolation_matrix(np.concatenate([last.span.nodes, [1.0]]), last.points_of(times[later]))
        matrix[later, n:], offset[later] = rows[:, :-1], rows[:, -1:] * case.site.position_m
    return matrix, offset


def _meeting(problem: GaussProblem, flights: list[PhaseFlight]) -> tuple[FloatArray, FloatArray]:
    """What the phases miss each other by, or one phase the landing: (6,), and by the control (6, q)."""
    if problem.entry:
        miss = flights[0].far + problem.drift - flights[1].far
        return miss, np.concatenate([flights[0].far_slope, -flights[1].far_slope], axis=1)
    case = problem.case
    return flights[0].far - np.concatenate([case.site.position_m, case.landing_velocity_m_s]), flights[
        0
    ].far_slope


def build_program(problem: GaussProblem) -> ConeProgram:
    """Write the problem as a cone program.

    Parameters
    ----------
    problem : GaussProblem
        The case, its phases and grids.

    Returns
    -------
    ConeProgram
        Over the control at the nodes, the positions there, then sigma.
    """
    bounds, grid = _bounds(problem), _path_grid(problem)
    q, m = problem.control_size, len(bounds.weights)
    blocks = [_ball_block(q, bounds)]
    if problem.case.mass_model == "constant":
        one = sparse.hstack([sparse.csr_array((m, 2 * q)), -sparse.eye_array(m)])
        blocks.append(ConeBlock("nonnegative", sparse.csr_array(one), bounds.share))
    if problem.case.spacecraft.propellant_kg is not None:
        blocks.append(_propellant_block(problem, bounds))
    if problem.entry:
        blocks.append(_cone_block(problem, grid, 2 * q + m))
    if problem.terminal == "paper":
        blocks.append(_terminal_block(problem, 2 * q + m))
    cost, quadratic = np.zeros(2 * q + m), None
    if problem.objective == "fuel":
        cost[2 * q :] = bounds.weights + _REST
    else:
        cost[2 * q :] = _REST
        quadratic = sparse.diags_array(np.concatenate([np.zeros(2 * q), 2.0 * bounds.weights]))
    position_reach = np.where(grid.unit_m < grid.chord_m, np.inf, _POSITION_REACH)
    reach = np.concatenate([np.full(q, np.inf), np.repeat(position_reach, 3), np.full(m, np.inf)])
    return ConeProgram(cost, tuple(blocks), _smooth(problem, bounds, grid), reach, quadratic)


def _ball_block(q: int, bounds: _Bounds) -> ConeBlock:
    """|u| <= sigma at every point of the finer rule."""
    m = len(bounds.weights)
    spread = sparse.csr_array(sparse.kron(np.eye(m), np.eye(4, 3, -1)))  # (x, y, z) to (0, x, y, z)
    first = sparse.csr_array(sparse.kron(np.eye(m), np.eye(4, 1)))
    matrix = sparse.hstack([spread @ bounds.control, sparse.csr_array((4 * m, q)), first])
    return ConeBlock("second_order", sparse.csr_array(matrix), np.zeros(4 * m), size=4)


def _propellant_block(problem: GaussProblem, bounds: _Bounds) -> ConeBlock:
    """Spend no more velocity increment than the propellant gives."""
    case, q = problem.case, problem.control_size
    craft = case.spacecraft
    share = float(craft.propellant_kg or 0.0) / craft.mass_kg
    ratio = share if case.mass_model == "constant" else -math.log1p(-min(share, 1.0 - 1e-9))
    bound = craft.exhaust_velocity_m_s * ratio / (problem.scale_m_s2 * case.tof_s)
    row = np.concatenate([np.zeros(2 * q), -bounds.weights])[None]
    return ConeBlock("nonnegative", sparse.csr_array(row), np.array([bound]))


def _cone_block(problem: GaussProblem, grid: _PathGrid, width: int) -> ConeBlock:
    """Keep the second phase in the safety cone (Lyu 2026, eq 3), at its start and between all nodes."""
    case, phase, q = problem.case, problem.phases[1], problem.control_size
    points = np.concatenate([[-1.0], legendre_gauss(_CONE_POINTS * problem.node_counts[1])[0]])
    times = phase.times_of(points)
    to_points, offset = _between_nodes(problem, times)
    scale = 1.0 / _height(problem, case.tof_s - times)
    face = np.vstack([case.site.normal / np.cos(case.cone_half_angle_rad), np.eye(3)])
    rows = np.einsum("p,ca,pn,n->pcna", scale, face, to_points, grid.unit_m).reshape(4 * len(points), q)
    constant = np.einsum("p,ca,pa->pc", scale, face, offset - case.site.position_m).ravel()
    # each point's constant: positions are scaled about the site
    constant += np.einsum("p,ca,pn,a->pc", scale, face, to_points, case.site.position_m).ravel()
    matrix = sparse.hstack(
        [
            sparse.csr_array((len(rows), q)),
            sparse.csr_array(rows),
            sparse.csr_array((len(rows), width - 2 * q)),
        ]
    )
    return ConeBlock("second_order", sparse.csr_array(matrix), constant, size=4)


def _terminal_block(problem: GaussProblem, width: int) -> ConeBlock:
    """Terminal acceleration a_f and, where rest leaves the angle open, a jerk along n_f (Lyu 2026, eq 4).

    With v_f = a_f = 0 the last of the path is r_f - j s^3 / 6 (s: time to go), so theta tends to 0 exactly
    where the jerk j has no part across n_f. Gravity and rotation do not change at rest, hence j = du/dt.
    """
    case, phase, n = problem.case, problem.phases[-1], problem.node_counts[-1]
    end = phase.span.control_at(np.array([1.0]))[0]
    w = np.array([0.0, 0.0, case.asteroid.rotation_rate_rad_s])
    r, v = case.site.position_m, case.landing_velocity_m_s
    free = accelerations(case.asteroid.gravity, r[None])[0] - 2 * np.cross(w, v) - np.cross(w, np.cross(w, r))
    rows = [np.kron(end, axis) for axis in np.eye(3)]
    offset = list((free - case.landing_acceleration_m_s2) / problem.scale_m_s2)
    if not np.any(v) and not np.any(case.landing_acceleration_m_s2):
        across = np.linalg.svd(case.site.normal[None])[2][1:]
        rows += [np.kron(_slope_at_end(phase.span.nodes, end) / n**2, axis) for axis in across]
        offset += [0.0, 0.0]
    matrix = sparse.lil_array((len(rows), width))
    first = problem.control_size - 3 * n
    matrix[:, first : first + 3 * n] = np.array(rows)
    return ConeBlock("zero", sparse.csr_array(matrix), np.array(offset))


def _slope_at_end(nodes: FloatArray, end: FloatArray) -> FloatArray:
    """Row that takes values at the nodes to the derivative of their polynomial at 1."""
    row = differentiation_matrix(np.concatenate([nodes, [1.0]]))[-1]
    return np.asarray(row[:-1] + row[-1] * end)


def _smooth(problem: GaussProblem, bounds: _Bounds, grid: _PathGrid) -> Callable[[FloatArray], SmoothRows]:
    """Write what is linearised: the positions that u flies, the landing, path bounds, the mass."""
    case, q, m = problem.case, problem.control_size, len(bounds.weights)
    units = np.repeat(grid.unit_m, 3)
    meeting_unit = np.repeat([grid.chord_m, grid.chord_m / case.tof_s], 3)
    rate = problem.scale_m_s2 * case.tof_s / case.spacecraft.exhaust_velocity_m_s

    def smooth(x: FloatArray) -> SmoothRows:
        flights = phase_flights(problem, x)
        positions = case.site.position_m + (units * x[q : 2 * q]).reshape(-1, 3)
        flown = np.concatenate([flight.position_m for flight in flights])
        miss, miss_slope = _meeting(problem, flights)
        equality = np.concatenate([(positions - flown).ravel() / units, miss / meeting_unit])
        by_control = block_diag(
            *(flight.position_slope.reshape(-1, flight.far_slope.shape[1]) for flight in flights)
        )
        equality_slope = np.block(
            [
                [-problem.scale_m_s2 * by_control / units[:, None], np.eye(q)],
                [problem.scale_m_s2 * miss_slope / meeting_unit[:, None], np.zeros((6, q))],
            ]
        )
        value, slope = _path_bounds(problem, grid, positions)
        inequality = sparse.hstack(
            [sparse.csr_array((len(value), q)), slope, sparse.csr_array((len(value), m))]
        )
        if case.mass_model == "variable":
            lighter = bounds.share * np.exp(rate * (bounds.spent @ x[2 * q :]))
            lighter_slope = rate * lighter[:, None] * bounds.spent - np.eye(m)
            value = np.concatenate([value, lighter - x[2 * q :]])
            inequality = sparse.vstack(
                [inequality, sparse.hstack([sparse.csr_array((m, 2 * q)), lighter_slope])]
            )
        padded = sparse.hstack([equality_slope, sparse.csr_array((q + 6, m))])
        return SmoothRows(equality, sparse.csr_array(padded), value, sparse.csr_array(inequality))

    return smooth


def _path_bounds(
    problem: GaussProblem, grid: _PathGrid, positions_m: FloatArray
) -> tuple[FloatArray, sparse.csr_array]:
    """Clearance, cone and ground rows, and their slopes by the scaled positions at the nodes."""
    q = problem.control_size
    if not problem.entry:
        return np.zeros(0), sparse.csr_array((0, q))
    samples = grid.offset_m + grid.to_samples @ positions_m
    rows = path_rows(problem.case, samples, problem.entry, _BUCKET, problem.margin_m, cone=False)
    by_node = grid.weight_m[rows.sample, None] * grid.to_samples[rows.sample] * grid.unit_m
    slope = (by_node[:, :, None] * rows.slope[:, None, :]).reshape(len(rows.value), q)
    return grid.weight_m[rows.sample] * rows.value, sparse.csr_array(slope)


def start_point(problem: GaussProblem, acceleration_m_s2: FloatArray, positions_m: FloatArray) -> FloatArray:
    """Make the unknowns of a control and a path, which need not agree.

    Parameters
    ----------
    problem : GaussProblem
        The problem.
    acceleration_m_s2 : (n, 3) float, m/s2, rotating body frame
        Thrust acceleration at all nodes, phase after phase.
    positions_m : (n, 3) float, m, body frame
        Positions there.

    Returns
    -------
    (2 q + m,) float
    """
    control = (acceleration_m_s2 / problem.scale_m_s2).ravel()
    offset = (positions_m - problem.case.site.position_m) / _path_grid(problem).unit_m[:, None]
    magnitude = np.linalg.norm((_bounds(problem).control @ control).reshape(-1, 3), axis=1)
    return np.concatenate([control, offset.ravel(), magnitude])


def node_positions(problem: GaussProblem, x: FloatArray) -> FloatArray:
    """Return the positions at all nodes, (n, 3) float, m, of scaled unknowns."""
    q, unit = problem.control_size, _path_grid(problem).unit_m[:, None]
    return np.asarray(problem.case.site.position_m + unit * x[q : 2 * q].reshape(-1, 3))


def velocity_increment_m_s(problem: GaussProblem, x: FloatArray) -> float:
    """Return the integral of |u|, m/s, of scaled unknowns."""
    bounds = _bounds(problem)
    spent = bounds.weights @ x[2 * problem.control_size :]
    return float(spent * problem.scale_m_s2 * problem.case.tof_s)

"""The pseudospectral planning problem as a cone program over the control at Legendre-Gauss nodes.

Unknowns, scaled by the greatest thrust acceleration on the initial mass: the thrust acceleration u at the
nodes of both phases, and bounds sigma >= |u| at the points of a finer Gauss rule. Thrust, clearance and cone
are bound between the nodes as well: a polynomial that keeps a bound at its nodes may break it in between.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

from landing_cli.body.gravity.field_values import accelerations
from landing_cli.flight.legs import AccelerationLeg, GaussAccelerationLeg
from landing_cli.optimize.collocation import (
    differentiation_matrix,
    gauss_span,
    interpolation_matrix,
    legendre_gauss,
)
from landing_cli.optimize.cone_program import ConeBlock, ConeProgram, SmoothRows
from landing_cli.plan.gauss_phases import Phase, PhaseFlight, fly_phases
from landing_cli.plan.path_rows import path_rows
from landing_cli.plan.records import CHECK_SAMPLES, Objective, PlanCase, TerminalConditions

FloatArray = NDArray[np.float64]

_BOUND_POINTS = 3  # points of the finer rule for each node
_BUCKET = 10  # samples that share a row


@dataclass(frozen=True, eq=False)
class GaussProblem:
    """A case with its phases and the grids on which it is bound.

    Attributes
    ----------
    case : PlanCase
    objective : {"fuel", "energy"}
    terminal : {"rest", "paper"}
    entry : int
        The sample, of `CHECK_SAMPLES`, at which the second phase and the cone begin.
    phases : tuple of Phase
        Up to the cone entry, and after it.
    thrust_share : tuple of float
        Share of the greatest thrust that each phase may use at the points of the finer rule.
    margin_m : float, m
        Added to the clearance.
    """

    case: PlanCase
    objective: Objective
    terminal: TerminalConditions
    entry: int
    phases: tuple[Phase, ...]
    thrust_share: tuple[float, ...]
    margin_m: float = 0.0

    @property
    def scale_m_s2(self) -> float:
        """Greatest thrust acceleration on the initial mass, m/s2."""
        return self.case.spacecraft.thrust_max_n / self.case.spacecraft.mass_kg

    @property
    def node_counts(self) -> tuple[int, ...]:
        """Nodes of each phase."""
        return tuple(len(phase.span.nodes) for phase in self.phases)

    @property
    def control_size(self) -> int:
        """Unknowns that are control."""
        return 3 * sum(self.node_counts)

    def controls(self, x: FloatArray) -> list[FloatArray]:
        """Return the scaled control at the nodes of each phase, (n, 3) each."""
        edges = 3 * np.cumsum([0, *self.node_counts])
        return [x[a:b].reshape(-1, 3) for a, b in zip(edges[:-1], edges[1:], strict=True)]

    def legs(self, x: FloatArray) -> tuple[AccelerationLeg, ...]:
        """Return the control as legs that can be flown again."""
        return tuple(
            GaussAccelerationLeg(np.array([0.0, phase.end_s - phase.start_s]), self.scale_m_s2 * u[None])
            for phase, u in zip(self.phases, self.controls(x), strict=True)
        )


def gauss_problem(
    case: PlanCase,
    objective: Objective,
    terminal: TerminalConditions,
    entry: int,
    nodes: tuple[int, ...],
    thrust_share: tuple[float, ...] = (1.0, 1.0),
) -> GaussProblem:
    """Lay the phases out.

    Parameters
    ----------
    case : PlanCase
        What is asked.
    objective : {"fuel", "energy"}
        The integral of |u|, or of its square.
    terminal : {"rest", "paper"}
        Whether Lyu 2026's terminal acceleration and angle (eq 4) are imposed.
    entry : int
        First sample, of `CHECK_SAMPLES`, of the phase inside the cone; 0 for one phase without path bounds.
    nodes : tuple of int
        Legendre-Gauss nodes of each phase.
    thrust_share : tuple of float
        Share of the greatest thrust that each phase may use.

    Returns
    -------
    GaussProblem
    """
    edges = [0.0, case.tof_s]
    if entry:
        edges.insert(1, case.tof_s * entry / (CHECK_SAMPLES - 1))
    spans = [gauss_span(n) for n in nodes]
    phases = tuple(Phase(*parts) for parts in zip(spans, edges[:-1], edges[1:], strict=True))
    return GaussProblem(case, objective, terminal, entry, phases, thrust_share[: len(phases)])


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


def build_program(problem: GaussProblem) -> ConeProgram:
    """Write the problem as a cone program.

    Parameters
    ----------
    problem : GaussProblem
        The case, its phases and grids.

    Returns
    -------
    ConeProgram
        Over the control at the nodes, then sigma.
    """
    bounds = _bounds(problem)
    q, m = problem.control_size, len(bounds.weights)
    ball = sparse.lil_array((4 * m, q + m))
    ball[np.arange(0, 4 * m, 4), q + np.arange(m)] = 1.0
    triples = np.setdiff1d(np.arange(4 * m), np.arange(0, 4 * m, 4))
    wide = sparse.lil_array((4 * m, q))
    wide[triples] = bounds.control
    ball = sparse.csr_array(ball) + sparse.hstack([sparse.csr_array(wide), sparse.csr_array((4 * m, m))])
    blocks = [ConeBlock("second_order", sparse.csr_array(ball), np.zeros(4 * m), size=4)]
    if problem.case.mass_model == "constant":
        one = sparse.hstack([sparse.csr_array((m, q)), -sparse.eye_array(m)])
        blocks.append(ConeBlock("nonnegative", sparse.csr_array(one), bounds.share))
    if problem.terminal == "paper":
        blocks.append(_terminal_block(problem, q + m))
    cost, quadratic = np.zeros(q + m), None
    if problem.objective == "fuel":
        cost[q:] = bounds.weights + 1e-9  # the ends carry no weight, but sigma has to rest on |u| there too
    else:
        cost[q:] = 1e-9
        quadratic = sparse.diags_array(np.concatenate([np.zeros(q), 2.0 * bounds.weights]))
    reach = np.concatenate([np.ones(q), np.full(m, np.inf)])
    return ConeProgram(cost, tuple(blocks), _smooth(problem, bounds), reach, quadratic)


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


def _smooth(problem: GaussProblem, bounds: _Bounds):  # noqa: ANN202
    case, q, m = problem.case, problem.control_size, len(bounds.weights)
    start = np.concatenate([case.position_m, case.velocity_m_s])
    length = float(np.linalg.norm(case.position_m - case.site.position_m))
    target = np.concatenate([case.site.position_m, case.landing_velocity_m_s])
    unit = np.array([length] * 3 + [length / case.tof_s] * 3)
    times = np.linspace(0.0, case.tof_s, CHECK_SAMPLES)
    samples = _sample_maps(problem, times)
    weight = _row_weights(problem, times, length)
    ve = case.spacecraft.exhaust_velocity_m_s
    rate = problem.scale_m_s2 * case.tof_s / ve

    def smooth(x: FloatArray) -> SmoothRows:
        controls = [problem.scale_m_s2 * u for u in problem.controls(x)]
        flights = fly_phases(
            case.asteroid.gravity, case.asteroid.rotation_rate_rad_s, start, problem.phases, controls
        )
        miss = (flights[-1].end - target) / unit
        miss_slope = problem.scale_m_s2 * flights[-1].end_slope / unit[:, None]
        values, slopes = [np.zeros(0)], [np.zeros((0, q))]
        if problem.entry:
            positions = np.concatenate(
                [rows @ flight.position_m for rows, flight in zip(samples, flights, strict=True)]
            )
            bound = path_rows(case, positions, problem.entry, _BUCKET, problem.margin_m)
            values.append(weight[bound.sample] * bound.value)
            by_position = _position_slopes(problem, samples, flights, bound.sample)
            slope = np.einsum("ra,raq->rq", bound.slope, by_position)
            slopes.append(problem.scale_m_s2 * weight[bound.sample, None] * slope)
        inequality, inequality_slope = np.concatenate(values), np.concatenate(slopes)
        padded = sparse.hstack([inequality_slope, sparse.csr_array((len(inequality), m))])
        if case.mass_model == "variable":
            lighter = bounds.share * np.exp(rate * (bounds.spent @ x[q:]))
            room = lighter - x[q:]
            room_slope = rate * lighter[:, None] * bounds.spent - np.eye(m)
            inequality = np.concatenate([inequality, room])
            padded = sparse.vstack([padded, sparse.hstack([sparse.csr_array((m, q)), room_slope])])
        equality_slope = sparse.hstack([miss_slope, sparse.csr_array((6, m))])
        return SmoothRows(miss, sparse.csr_array(equality_slope), inequality, sparse.csr_array(padded))

    return smooth


def _sample_maps(problem: GaussProblem, times: FloatArray) -> list[FloatArray]:
    """From the positions on the support of each phase to the samples that belong to it."""
    cuts = [0, *([problem.entry] if problem.entry else []), len(times)]
    return [
        interpolation_matrix(phase.span.support, phase.points_of(times[a:b]))
        for phase, a, b in zip(problem.phases, cuts[:-1], cuts[1:], strict=True)
    ]


def _position_slopes(
    problem: GaussProblem, samples: list[FloatArray], flights: list[PhaseFlight], wanted: NDArray[np.int64]
) -> FloatArray:
    """Derivative of the wanted samples' positions with respect to the control, (r, 3, q)."""
    inside = wanted >= problem.entry
    slopes = np.zeros((len(wanted), 3, problem.control_size))
    for own, rows, flight, first in zip((~inside, inside), samples, flights, (0, problem.entry), strict=True):
        slopes[own] = np.tensordot(rows[wanted[own] - first], flight.position_slope, axes=1)
    return slopes


def _row_weights(problem: GaussProblem, times: FloatArray, length: float) -> FloatArray:
    """Per metre of room: the chord before the entry; after it, how far half the thrust takes one in the time
    to go, or the path would matter less and less towards the cone's apex."""
    case = problem.case
    left = case.tof_s - times
    speed = float(np.linalg.norm(case.landing_velocity_m_s))
    height = np.maximum(0.25 * problem.scale_m_s2 * left**2 + speed * left, 1e-9)
    weight = np.full(len(times), 1.0 / length)
    tail = slice(problem.entry, None)
    weight[tail] = np.minimum(0.05 / height[tail], 1e3)
    return weight


def start_point(problem: GaussProblem, acceleration: FloatArray) -> FloatArray:
    """Make the unknowns of a control.

    Parameters
    ----------
    problem : GaussProblem
        The problem.
    acceleration : (n, 3) float, m/s2
        Thrust acceleration at all nodes, phase after phase.

    Returns
    -------
    (q + m,) float
    """
    control = (acceleration / problem.scale_m_s2).ravel()
    magnitude = np.linalg.norm((_bounds(problem).control @ control).reshape(-1, 3), axis=1)
    return np.concatenate([control, magnitude])

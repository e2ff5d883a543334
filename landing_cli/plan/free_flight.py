"""A landing with free thrust acceleration, linear between nodes, as a cone program with smooth rows.

Unknowns at every node, scaled: position r, velocity v, thrust acceleration u, a bound sigma >= |u|, and the
velocity increment S spent so far; and one excess gamma by which the thrust may exceed its bound at a price:
a flight that is too short still has a solution, which tells the thrust that it needs.

    minimise  S(t_f)  (fuel)   or   integral |u|^2 dt  (energy)
    r, v, u:  multiple shooting over exact arcs;      |u| <= sigma <= thrust / mass;      S' = sigma
    clearance before the cone entry, the cone after it (Lyu 2026, eqs 2-5)
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

from landing_cli.flight.dynamics import natural_acceleration
from landing_cli.flight.linear_arcs import Arcs, fly_linear_arcs, positions_between, slopes_between
from landing_cli.optimize.cone_program import ConeBlock, ConeProgram, ConeSolution, SmoothRows
from landing_cli.plan.path_rows import path_rows
from landing_cli.plan.records import Objective, PlanCase, PlanStatus, TerminalConditions

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]

R, V, U, SIGMA, SPENT = slice(0, 3), slice(3, 6), slice(6, 9), 9, 10
WIDTH = 11

EXCESS_PRICE = 10.0
"""Cost of thrust above its bound, in (largest thrust acceleration) t_f per unit of excess."""
EXCESS_TOLERANCE = 1e-6
ENERGY_TRACE = 1e-6
CLEARANCE_MARGIN_M = 0.01
CONE_MARGIN_RAD = 2e-5
REACH = 0.1
"""How far nodes may move in a round at trust 1, in distances from start to site."""


@dataclass(frozen=True, eq=False)
class FreeFlight:
    """What is transcribed.

    Attributes
    ----------
    case : PlanCase
    times_s : (n + 1,) float, s
        Nodes of the control, from 0 to t_f.
    entry_s : float, s
        From then on the path lies in the cone; before, it keeps the clearance. Infinite: neither is asked.
    samples : int
        Even samples at which the path is bound.
    bucket : int
        Samples that share a row.
    objective : {"fuel", "energy"}
    terminal : {"rest", "paper"}
    """

    case: PlanCase
    times_s: FloatArray
    entry_s: float
    samples: int
    bucket: int
    objective: Objective
    terminal: TerminalConditions

    @property
    def length_m(self) -> float:
        """Unit of length: from the start to the site."""
        return float(np.linalg.norm(self.case.position_m - self.case.site.position_m))

    @property
    def acceleration_m_s2(self) -> float:
        """Unit of acceleration: the largest thrust on the initial mass."""
        return self.case.spacecraft.thrust_max_n / self.case.spacecraft.mass_kg

    @property
    def unit(self) -> FloatArray:
        """Units of (r, v, u), (9,)."""
        length, tof = self.length_m, self.case.tof_s
        return np.repeat([length, length / tof, self.acceleration_m_s2], 3)

    @property
    def columns(self) -> IntArray:
        """Places of the nodes' unknowns, (n + 1, 11); the excess comes last of all."""
        return np.arange(WIDTH * len(self.times_s)).reshape(-1, WIDTH)

    @property
    def unknowns(self) -> int:
        """How many."""
        return WIDTH * len(self.times_s) + 1


def unpacked(flight: FreeFlight, x: FloatArray) -> tuple[FloatArray, FloatArray, float]:
    """Unscale the unknowns.

    Parameters
    ----------
    flight : FreeFlight
        What was transcribed.
    x : (m,) float
        Scaled unknowns.

    Returns
    -------
    states : (n + 1, 6) float, m, m/s
    thrust_acceleration : (n + 1, 3) float, m/s2
    excess : float
        Share by which the thrust exceeds its bound.
    """
    nodes = x[:-1].reshape(-1, WIDTH)
    scaled = nodes[:, :9] * flight.unit
    return scaled[:, :6], scaled[:, U], float(x[-1])


def packed(flight: FreeFlight, states: FloatArray, thrust_acceleration: FloatArray) -> FloatArray:
    """Scale states (n + 1, 6) and thrust accelerations (n + 1, 3) at the nodes into unknowns."""
    nodes = np.zeros((len(flight.times_s), WIDTH))
    nodes[:, :9] = np.concatenate([states, thrust_acceleration], axis=1) / flight.unit
    nodes[:, SIGMA] = np.linalg.norm(nodes[:, U], axis=1)
    nodes[1:, SPENT] = np.cumsum(_shares(flight) * (nodes[1:, SIGMA] + nodes[:-1, SIGMA]) / 2.0)
    return np.append(nodes.ravel(), max(0.0, float(nodes[:, SIGMA].max()) - 1.0))


def free_flight_program(flight: FreeFlight) -> ConeProgram:
    """Transcribe a landing.

    Parameters
    ----------
    flight : FreeFlight
        What to transcribe.

    Returns
    -------
    ConeProgram
    """
    columns, m = flight.columns, flight.unknowns
    cost, reach = np.zeros(m), np.full(m, np.inf)
    cost[-1] = EXCESS_PRICE
    # energy: a trace of S keeps sigma on |u|, for the flown mass and the propellant
    cost[columns[-1, SPENT]] = 1.0 if flight.objective == "fuel" else ENERGY_TRACE
    reach[columns[1:-1, R].ravel()] = REACH
    pick = sparse.eye_array(m, format="csr")
    blocks = (
        *_boundary(flight, pick),
        *_thrust(flight, pick),
        *_cone(flight, pick),
        *_terminal(flight, pick),
    )
    quadratic = _energy(flight) if flight.objective == "energy" else None
    return ConeProgram(cost, blocks, lambda x: _smooth(flight, x), reach, quadratic, elastic_equalities=False)


def verdict(solution: ConeSolution) -> tuple[PlanStatus, str]:
    """Say what it means when a solution, flown again, breaks a constraint, and why it may.

    Parameters
    ----------
    solution : ConeSolution
        With the excess of the thrust as its last unknown.

    Returns
    -------
    status : {"infeasible", "unresolved"}
    because : str
    """
    if solution.status != "unresolved" and solution.x[-1] > EXCESS_TOLERANCE:
        return "infeasible", "the least thrust found is not enough"
    status: PlanStatus = "infeasible" if solution.status == "infeasible" else "unresolved"
    return status, f"successive convexification: {solution.message}"


def _shares(flight: FreeFlight) -> FloatArray:
    """Arcs' durations over t_f."""
    return np.diff(flight.times_s) / flight.case.tof_s


def _boundary(flight: FreeFlight, pick: sparse.csr_array) -> list[ConeBlock]:
    """Start, touchdown, and the velocity increment by the trapezoidal rule: at least the flown one."""
    case, columns, unit = flight.case, flight.columns, flight.unit[:6]
    start = np.concatenate([case.position_m, case.velocity_m_s]) / unit
    end = np.concatenate([case.site.position_m, case.landing_velocity_m_s]) / unit
    half = sparse.diags_array(_shares(flight) / 2.0)
    bound, spent = pick[columns[:, SIGMA]], pick[columns[:, SPENT]]
    growth = spent[1:] - spent[:-1] - half @ (bound[1:] + bound[:-1])
    return [
        ConeBlock("zero", pick[columns[0, :6]], -start),
        ConeBlock("zero", pick[columns[-1, :6]], -end),
        ConeBlock("zero", growth, np.zeros(growth.shape[0])),
        ConeBlock("zero", spent[:1], np.zeros(1)),
    ]


def _thrust(flight: FreeFlight, pick: sparse.csr_array) -> list[ConeBlock]:
    columns, n = flight.columns, len(flight.times_s)
    ball = pick[np.concatenate([columns[:, [SIGMA]], columns[:, U]], axis=1).ravel()]
    blocks = [
        ConeBlock("second_order", ball, np.zeros(4 * n), 4),
        ConeBlock("nonnegative", pick[[-1]], np.zeros(1)),
    ]
    if flight.case.mass_model == "constant":
        excess = sparse.csr_array(np.ones((n, 1))) @ pick[[-1]]
        blocks.append(ConeBlock("nonnegative", excess - pick[columns[:, SIGMA]], np.ones(n)))
    return blocks


def _cone(flight: FreeFlight, pick: sparse.csr_array) -> list[ConeBlock]:
    """The safety cone at the nodes after the entry.

    In the last arc the offset from the site over the square of the time to go runs from the last node's to
    half the touchdown acceleration: with both in the cone, so is the arc (but for the Coriolis turn).
    """
    case, columns = flight.case, flight.columns
    if not np.isfinite(flight.entry_s):
        return []
    inside = np.flatnonzero(flight.times_s[:-1] >= flight.entry_s)
    lift = cone_matrix(case)
    rows = sparse.kron(sparse.eye_array(len(inside)), lift, format="csr") @ pick[columns[inside, R].ravel()]
    site = lift @ case.site.position_m / flight.length_m
    blocks = [ConeBlock("second_order", rows, np.tile(-site, len(inside)), 4)]
    if flight.terminal == "rest" and not np.any(case.landing_velocity_m_s):
        natural = _natural_at_site(case) / flight.acceleration_m_s2
        blocks.append(
            ConeBlock("second_order", sparse.csr_array(lift) @ pick[columns[-1, U]], lift @ natural, 4)
        )
    return blocks


def cone_matrix(case: PlanCase) -> FloatArray:
    """Matrix that takes an offset to the second-order cone: (n . d, cos(theta) d), (4, 3)."""
    angle = case.cone_half_angle_rad - CONE_MARGIN_RAD
    return np.concatenate([case.site.normal[None], np.cos(angle) * np.eye(3)])


def _natural_at_site(case: PlanCase) -> FloatArray:
    field, w = case.asteroid.gravity, case.asteroid.rotation_rate_rad_s
    state = (*case.site.position_m, *case.landing_velocity_m_s)
    return np.array(natural_acceleration(field.kind, field.params, w, *state))


def _terminal(flight: FreeFlight, pick: sparse.csr_array) -> list[ConeBlock]:
    """Touchdown acceleration and angle of eq 4.

    Landing at rest without acceleration, the path comes in along the jerk, which is the slope of u in the
    last arc: it points along -n_f.
    """
    case, columns = flight.case, flight.columns
    if flight.terminal == "rest":
        return []
    u = (case.landing_acceleration_m_s2 - _natural_at_site(case)) / flight.acceleration_m_s2
    blocks = [ConeBlock("zero", pick[columns[-1, U]], -u)]
    if not np.any(case.landing_velocity_m_s) and not np.any(case.landing_acceleration_m_s2):
        axes = sparse.csr_array(np.linalg.svd(case.site.normal[None])[2])
        turned = axes @ (pick[columns[-1, U]] - pick[columns[-2, U]])
        sign = float(np.sign(axes.toarray()[0] @ case.site.normal))
        blocks += [
            ConeBlock("zero", turned[1:], np.zeros(2)),
            ConeBlock("nonnegative", -sign * turned[:1], np.zeros(1)),
        ]
    return blocks


def _energy(flight: FreeFlight) -> sparse.csr_array:
    """P with x'Px/2 = (1/t_f) integral |u|^2 dt, exact for linear u."""
    third = _shares(flight) / 3.0
    main = 2.0 * (np.append(third, 0.0) + np.append(0.0, third))
    by_node = sparse.diags_array([third, main, third], offsets=[-1, 0, 1])
    place = sparse.csr_array((np.ones(3), (range(6, 9), range(6, 9))), shape=(WIDTH, WIDTH))
    return sparse.csr_array(sparse.block_diag([sparse.kron(by_node, place), sparse.csr_array((1, 1))]))


def _smooth(flight: FreeFlight, x: FloatArray) -> SmoothRows:
    """Gaps of the shooting, and the room of path, thrust and propellant."""
    case, times = flight.case, flight.times_s
    states, u, _ = unpacked(flight, x)
    arcs = fly_linear_arcs(case.asteroid.gravity, case.asteroid.rotation_rate_rad_s, times, states[:-1], u)
    columns = flight.columns
    reached = np.concatenate([columns[:-1, :9], columns[1:, U]], axis=1)
    unit = np.concatenate([flight.unit, flight.unit[U]])
    slope = (arcs.end_slope * unit / flight.unit[:6, None]).reshape(-1, 12)
    own = columns[1:, :6].reshape(-1, 1)
    gaps = sparse_rows(
        np.concatenate([slope, -np.ones_like(own)], axis=1),
        np.concatenate([np.repeat(reached, 6, axis=0), own], axis=1),
        flight.unknowns,
    )
    path, path_slope = _path(flight, arcs, reached, unit)
    mass, mass_slope = _mass(flight, x, u)
    return SmoothRows(
        ((arcs.end - states[1:]) / flight.unit[:6]).ravel(),
        gaps,
        np.concatenate([path, mass]),
        sparse.csr_array(sparse.vstack([path_slope, mass_slope])),
        np.concatenate([np.full(len(path), 3.0 * REACH), np.full(len(mass), np.inf)]),
    )


def _path(
    flight: FreeFlight, arcs: Arcs, reached: IntArray, unit: FloatArray
) -> tuple[FloatArray, sparse.csr_array]:
    if not np.isfinite(flight.entry_s):
        return np.zeros(0), sparse.csr_array((0, flight.unknowns))
    times, t = flight.times_s, np.linspace(0.0, flight.case.tof_s, flight.samples)
    arc = np.clip(np.searchsorted(times, t, side="right") - 1, 0, len(times) - 2)
    share = (t - times[arc]) / np.diff(times)[arc]
    entry = int(np.searchsorted(t, flight.entry_s))
    rows = path_rows(
        flight.case, positions_between(arcs, arc, share), entry, flight.bucket, CLEARANCE_MARGIN_M
    )
    own = arc[rows.sample]
    slope = slopes_between(arcs, own, share[rows.sample], rows.slope) * unit / flight.length_m
    return rows.value / flight.length_m, sparse_rows(slope, reached[own], flight.unknowns)


def _mass(flight: FreeFlight, x: FloatArray, u: FloatArray) -> tuple[FloatArray, sparse.csr_array]:
    """Room of thrust under the flown mass, and of the propellant.

    sigma <= exp(S/ve) + gamma; the reference S is that of |u| itself, which the trapezoidal rule exceeds.
    """
    case, columns = flight.case, flight.columns
    nodes = x[:-1].reshape(-1, WIDTH)
    kappa = flight.acceleration_m_s2 * case.tof_s / case.spacecraft.exhaust_velocity_m_s
    if case.mass_model == "constant" and case.spacecraft.propellant_kg is None:
        return np.zeros(0), sparse.csr_array((0, flight.unknowns))
    values, slopes = [], []
    pick = sparse.eye_array(flight.unknowns, format="csr")
    if case.mass_model == "variable":
        growth = np.exp(kappa * _spent(flight, u))
        rows = sparse.diags_array(kappa * growth) @ pick[columns[:, SPENT]] - pick[columns[:, SIGMA]]
        values.append(growth + x[-1] - nodes[:, SIGMA])
        slopes.append(rows + sparse.csr_array(np.ones((len(nodes), 1))) @ pick[[-1]])
    if case.spacecraft.propellant_kg is not None:
        share = case.spacecraft.propellant_kg / case.spacecraft.mass_kg
        bound = share if case.mass_model == "constant" else -np.log1p(-min(share, 1.0 - 1e-9))
        values.append(np.array([bound / kappa - nodes[-1, SPENT]]))
        slopes.append(-pick[columns[-1:, SPENT]])
    return np.concatenate(values), sparse.csr_array(sparse.vstack(slopes))


def _spent(flight: FreeFlight, u: FloatArray) -> FloatArray:
    """Scaled velocity increment up to every node, of u that is linear in between."""
    x, weight = np.polynomial.legendre.leggauss(8)
    share = 0.5 * (x[:, None, None] + 1.0)
    size = np.linalg.norm((1.0 - share) * u[:-1] + share * u[1:], axis=2) / flight.acceleration_m_s2
    return np.concatenate([[0.0], np.cumsum(_shares(flight) * (0.5 * weight @ size))])


def sparse_rows(values: FloatArray, columns: IntArray, width: int) -> sparse.csr_array:
    """Rows with values (k, c) at columns (k, c)."""
    k, c = values.shape
    return sparse.csr_array((values.ravel(), (np.repeat(np.arange(k), c), columns.ravel())), shape=(k, width))

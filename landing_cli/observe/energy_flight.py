"""What the least-energy transcription is made of: nodes, units, a first path, linear rows."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

from landing_cli.flight.acceleration_control import natural_accelerations
from landing_cli.flight.linearised_arcs import LinearisedArcs, linearised_arcs
from landing_cli.observe.observed import Waypoints
from landing_cli.observe.records import ObserveCase

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]
Positions = Callable[[FloatArray], FloatArray]

WIDTH = 9
R, V, U = slice(0, 3), slice(3, 6), slice(6, 9)


@dataclass(frozen=True, eq=False)
class EnergyFlight:
    """A landing on nodes of time.

    Attributes
    ----------
    case : ObserveCase
        What is asked.
    times_s : (n + 1,) float, s
        Nodes; every waypoint's time is one of them.
    waypoint_node : (m,) int
        Their nodes.
    waypoint_m : (m, 2) float, m, site frame x, y
    """

    case: ObserveCase
    times_s: FloatArray
    waypoint_node: IntArray
    waypoint_m: FloatArray

    @property
    def tof_s(self) -> float:
        """Time of flight t_f, s: the unit of time."""
        return float(self.times_s[-1])

    @property
    def length_m(self) -> float:
        """Unit of length, m: from the start to the site."""
        return float(np.linalg.norm(self.case.position_m - self.case.frame.origin_m))

    @property
    def unit(self) -> FloatArray:
        """Units of (r, v, u), (9,): L, L/T and L/T^2."""
        length, tof = self.length_m, self.tof_s
        return np.repeat([length, length / tof, length / tof**2], 3)

    @property
    def edges_s(self) -> FloatArray:
        """Times between which the path is smooth: the ends and the waypoints', s."""
        return self.times_s[np.concatenate([[0], self.waypoint_node, [len(self.times_s) - 1]])]

    @property
    def start(self) -> FloatArray:
        """Initial state, (6,), from the site, m, m/s."""
        return np.concatenate([self.case.position_m - self.case.frame.origin_m, self.case.velocity_m_s])


def energy_flight(case: ObserveCase, tof_s: float, waypoints: Waypoints | None, nodes: int) -> EnergyFlight:
    """Place the nodes: evenly between the waypoints.

    Parameters
    ----------
    case : ObserveCase
        What is asked.
    tof_s : float, s
        t_f.
    waypoints : Waypoints or None
        Where to pass.
    nodes : int
        Intervals in all, at least; each span between waypoints takes the same number.

    Returns
    -------
    EnergyFlight
    """
    count = 0 if waypoints is None else len(waypoints.t_s)
    parts = -(-nodes // (count + 1))
    times = np.linspace(0.0, tof_s, parts * (count + 1) + 1)
    passed = parts * np.arange(1, count + 1)
    position = np.zeros((0, 2)) if waypoints is None else waypoints.position_m
    return EnergyFlight(case, times, passed, position)


def spline_positions(flight: EnergyFlight) -> Positions:
    """Return the path that ignores forces: clamped cubic splines through the waypoints.

    x and y pass all waypoints, z is a single cubic. Under a uniform acceleration it is the optimum.

    Parameters
    ----------
    flight : EnergyFlight
        Ends and waypoints.

    Returns
    -------
    callable
        Positions (k, 3), m, body frame, at times (k,), s; ``positions(t, order)`` gives a derivative.
    """
    from scipy.interpolate import CubicSpline

    frame, edges = flight.case.frame, flight.edges_s
    start, velocity = frame.to_site(flight.case.position_m), frame.axes @ flight.case.velocity_m_s
    level = np.concatenate([start[None, :2], flight.waypoint_m, np.zeros((1, 2))])
    across = CubicSpline(edges, level, bc_type=((1, velocity[:2]), (1, np.zeros(2))))
    ends = CubicSpline(
        edges[[0, -1]], np.array([start[2:], [0.0]]), bc_type=((1, velocity[2:]), (1, np.zeros(1)))
    )

    def positions(t_s: FloatArray, order: int = 0) -> FloatArray:
        offset = np.concatenate([across(t_s, order), ends(t_s, order)], axis=1) @ frame.axes
        return np.asarray(offset + frame.origin_m if order == 0 else offset)

    return positions


def hermite_positions(times_s: FloatArray, position_m: FloatArray, velocity_m_s: FloatArray) -> Positions:
    """Return the path through states (k, 3) at nodes (k,), cubic in between."""
    from scipy.interpolate import CubicHermiteSpline

    spline = CubicHermiteSpline(times_s, position_m, velocity_m_s)
    return lambda t_s: np.asarray(spline(t_s))


def inverse_dynamics(case: ObserveCase, r: FloatArray, v: FloatArray, a: FloatArray) -> FloatArray:
    """Thrust acceleration that keeps the spacecraft on a given path.

    Parameters
    ----------
    case : ObserveCase
        Field and spin.
    r, v, a : (k, 3) float, m, m/s, m/s2, body frame
        The path and its derivatives in the rotating frame.

    Returns
    -------
    (k, 3) float, m/s2, body frame
    """
    field, natural = case.asteroid.gravity, np.zeros_like(r)
    natural_accelerations(field.kind, field.params, case.asteroid.rotation_rate_rad_s, *_plain(r, v), natural)
    return np.asarray(a - natural)


def _plain(*arrays: FloatArray) -> list[FloatArray]:
    return [np.ascontiguousarray(array, dtype=np.float64) for array in arrays]


def dynamics_rows(flight: EnergyFlight, arcs: LinearisedArcs) -> tuple[sparse.csr_array, FloatArray]:
    """Equations of motion between the nodes, scaled.

    Parameters
    ----------
    flight : EnergyFlight
        Nodes and units.
    arcs : LinearisedArcs
        The affine maps.

    Returns
    -------
    matrix : (6 n, 9 (n + 1)) sparse
        Times the scaled unknowns gives the state that an arc ends with less the next node's.
    offset : (6 n,) float
        To be added: zero in all where the arcs join.
    """
    n, unit = len(flight.times_s) - 1, flight.unit
    by = np.concatenate([arcs.by_state, arcs.by_thrust_start, arcs.by_thrust_end], axis=2)
    by = by * np.append(unit, unit[U]) / unit[:6, None]
    columns = WIDTH * np.arange(n)[:, None]
    reached = np.concatenate([columns + np.arange(WIDTH), columns + WIDTH + np.arange(6, 9)], axis=1)
    own = columns + WIDTH + np.arange(6)
    values = np.concatenate([by, np.broadcast_to(-1.0, (n, 6, 1))], axis=2)
    places = np.concatenate([np.repeat(reached[:, None], 6, axis=1), own[:, :, None]], axis=2)
    matrix = sparse.csr_array(
        (values.ravel(), places.ravel(), 13 * np.arange(6 * n + 1)), shape=(6 * n, WIDTH * (n + 1))
    )
    return matrix, (arcs.drift / unit[:6]).ravel()


def boundary_rows(flight: EnergyFlight) -> tuple[sparse.csr_array, FloatArray]:
    """Start, rest on the site, and the waypoints (eqs 14-15), scaled.

    Parameters
    ----------
    flight : EnergyFlight
        Ends and waypoints.

    Returns
    -------
    matrix : (12 + 2 m, 9 (n + 1)) sparse
    offset : (12 + 2 m,) float
        ``matrix x + offset`` is zero where the path begins, ends and passes as asked.
    """
    n = len(flight.times_s) - 1
    pick = sparse.eye_array(WIDTH * (n + 1), format="csr")
    ends = pick[np.concatenate([np.arange(6), WIDTH * n + np.arange(6)])]
    offset = np.concatenate([-flight.start / flight.unit[:6], np.zeros(6)])
    count = len(flight.waypoint_node)
    if count == 0:
        return ends, offset
    passed = pick[(WIDTH * flight.waypoint_node[:, None] + np.arange(3)).ravel()]
    level = sparse.kron(sparse.eye_array(count), flight.case.frame.axes[:2], format="csr") @ passed
    return (
        sparse.csr_array(sparse.vstack([ends, level])),
        np.concatenate([offset, -flight.waypoint_m.ravel() / flight.length_m]),
    )


def energy_matrix(flight: EnergyFlight) -> sparse.csr_array:
    """P with x'P x / 2 = J T^3 / L^2, the integral of u'u in the scaled unknowns, exact for linear u."""
    third = np.diff(flight.times_s) / flight.tof_s / 3.0
    main = 2.0 * (np.append(third, 0.0) + np.append(0.0, third))
    by_node = sparse.diags_array([third, main, third], offsets=[-1, 0, 1])
    place = sparse.csr_array((np.ones(3), (range(6, 9), range(6, 9))), shape=(WIDTH, WIDTH))
    return sparse.csr_array(sparse.kron(by_node, place))


def flight_arcs(flight: EnergyFlight, x: FloatArray | None) -> LinearisedArcs:
    """Linearise the flight about a path.

    Parameters
    ----------
    flight : EnergyFlight
        Nodes, field and spin.
    x : (9 (n + 1),) float or None
        Scaled unknowns of the path; None takes the spline through the waypoints.

    Returns
    -------
    LinearisedArcs
    """
    asteroid, origin = flight.case.asteroid, flight.case.frame.origin_m
    positions = spline_positions(flight)
    if x is not None:
        states = x.reshape(-1, WIDTH)[:, :6] * flight.unit[:6]
        positions = hermite_positions(flight.times_s, states[:, R] + origin, states[:, V])
    return linearised_arcs(
        asteroid.gravity, asteroid.rotation_rate_rad_s, flight.times_s, positions, flight.edges_s, origin
    )


def nearest_flight(flight: EnergyFlight, x: FloatArray | None) -> FloatArray:
    """Solve the linearised flight whose thrust is closest to a path's, or least where there is none.

    Parameters
    ----------
    flight : EnergyFlight
        What is transcribed.
    x : (9 (n + 1),) float or None
        Scaled unknowns of the path.

    Returns
    -------
    (9 (n + 1),) float
        Scaled unknowns that begin, pass and end as asked.
    """
    target = np.zeros(WIDTH * len(flight.times_s)) if x is None else x
    motion = dynamics_rows(flight, flight_arcs(flight, x))
    return closest(energy_matrix(flight), target, motion, boundary_rows(flight))


def closest(
    P: sparse.csr_array,
    target: FloatArray,
    *rows: tuple[sparse.csr_array, FloatArray],
) -> FloatArray:
    """Minimise (x - target)' P (x - target) / 2 where ``matrix x + offset = 0``, by the KKT system.

    Parameters
    ----------
    P : (w, w) sparse
        Positive semidefinite, and definite where the equations leave x free.
    target : (w,) float
        What to come close to; zero for the least x'P x.
    *rows : (sparse, float)
        Matrices and offsets of the equations.

    Returns
    -------
    (w,) float
    """
    from scipy.sparse.linalg import splu

    matrix = sparse.vstack([part[0] for part in rows])
    right = np.concatenate([P @ target, *(-part[1] for part in rows)])
    system = sparse.block_array([[P, matrix.T], [matrix, None]], format="csc")
    return np.asarray(splu(system).solve(right)[: P.shape[0]])

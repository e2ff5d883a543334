"""The landing of least control energy through waypoints, under the asteroid's own gravity (eqs 13-15).

The thrust acceleration is linear between nodes. Around a path the flight is linearised exactly enough to be
flown (`flight.linearised_arcs`), so that the least energy is the solution of one sparse linear system, the
Karush-Kuhn-Tucker conditions; its path is linearised anew until it stands still. The first path is a clamped
cubic spline. Shen 2026 solves the same by direct collocation and gives no accuracy.

Where thrust, clearance or glide slope bind, the cone program of `observe.bounded_transcription` takes over.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

from landing_cli.flight.linearised_arcs import linearised_arcs
from landing_cli.observe.energy_flight import (
    WIDTH,
    EnergyFlight,
    U,
    boundary_rows,
    dynamics_rows,
    energy_flight,
    energy_matrix,
    hermite_positions,
    spline_positions,
)
from landing_cli.observe.path_values import path_of
from landing_cli.observe.records import ObserveCase, Path, PathStatus, Waypoints

FloatArray = NDArray[np.float64]

STEP_TOLERANCE = 1e-7
"""Settled when no node moves by more than this share of the distance from start to site. What is left of
energy and equations of motion is of the order of its square."""
MOST_ROUNDS = 30


@dataclass(frozen=True, eq=False)
class EnergySolution:
    """Where the rounds came to.

    Attributes
    ----------
    x : (9 (n + 1),) float
        Scaled unknowns: position from the site, velocity and thrust acceleration at every node.
    converged : bool
    step : float
        Largest move of a node in the last round, in distances from start to site.
    rounds : int
    """

    x: FloatArray
    converged: bool
    step: float
    rounds: int


def least_energy_path(case: ObserveCase, tof_s: float, waypoints: Waypoints | None, nodes: int) -> Path:
    """Find the landing of least control energy.

    Parameters
    ----------
    case : ObserveCase
        What is asked.
    tof_s : float, s
        t_f.
    waypoints : Waypoints or None
        Where x and y of the site frame have to pass, and when.
    nodes : int
        Intervals of the transcription, at least.

    Returns
    -------
    Path
        ``unresolved`` where the rounds do not settle.
    """
    flight = energy_flight(case, tof_s, waypoints, nodes)
    return solved_path(flight, solve_energy(flight))


def solve_energy(flight: EnergyFlight) -> EnergySolution:
    """Solve for the least energy by linearising again and again.

    Parameters
    ----------
    flight : EnergyFlight
        What is transcribed.

    Returns
    -------
    EnergySolution
    """
    asteroid, origin, unit = flight.case.asteroid, flight.case.frame.origin_m, flight.unit
    boundary, P = boundary_rows(flight), energy_matrix(flight)
    positions = spline_positions(flight)
    before, step, rounds = positions(flight.times_s), np.inf, 0
    while rounds < MOST_ROUNDS:
        arcs = linearised_arcs(
            asteroid.gravity,
            asteroid.rotation_rate_rad_s,
            flight.times_s,
            positions,
            flight.edges_s,
            origin,
        )
        x = _least_energy(P, dynamics_rows(flight, arcs), boundary)
        nodes = x.reshape(-1, WIDTH)[:, :6] * unit[:6]
        after = nodes[:, :3] + origin
        step, rounds = float(np.abs(after - before).max()) / flight.length_m, rounds + 1
        if step <= STEP_TOLERANCE or not np.isfinite(step):
            break
        positions, before = hermite_positions(flight.times_s, after, nodes[:, 3:]), after
    return EnergySolution(x, step <= STEP_TOLERANCE, step, rounds)


def solved_path(flight: EnergyFlight, solution: EnergySolution) -> Path:
    """Unscale a solution and measure it.

    Parameters
    ----------
    flight : EnergyFlight
        What was transcribed.
    solution : EnergySolution
        Its solution.

    Returns
    -------
    Path
    """
    nodes = solution.x.reshape(-1, WIDTH) * flight.unit
    status: PathStatus = "planned" if solution.converged else "unresolved"
    message = f"settled in {solution.rounds} rounds"
    if not solution.converged:
        message = f"not settled after {solution.rounds} rounds: nodes still move by "
        message += f"{solution.step * flight.length_m:.3g} m"
    return path_of(
        flight.case,
        flight.times_s,
        nodes[:, :3] + flight.case.frame.origin_m,
        nodes[:, 3:6],
        nodes[:, U],
        status,
        message,
        solution.rounds,
    )


def _least_energy(
    P: sparse.csr_array,
    dynamics: tuple[sparse.csr_array, FloatArray],
    boundary: tuple[sparse.csr_array, FloatArray],
) -> FloatArray:
    """Minimise x'P x / 2 under linear equations by their KKT system."""
    from scipy.sparse.linalg import splu

    rows = sparse.vstack([dynamics[0], boundary[0]])
    right = -np.concatenate([np.zeros(P.shape[0]), dynamics[1], boundary[1]])
    system = sparse.block_array([[P, rows.T], [rows, None]], format="csc")
    return np.asarray(splu(system).solve(right)[: P.shape[0]])

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

from landing_cli.observe.energy_flight import (
    WIDTH,
    EnergyFlight,
    R,
    U,
    V,
    boundary_rows,
    closest,
    dynamics_rows,
    energy_flight,
    energy_matrix,
    flight_arcs,
    spline_positions,
)
from landing_cli.observe.observed import Path, Waypoints
from landing_cli.observe.path_values import path_of
from landing_cli.observe.records import ObserveCase, PathStatus

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
        ``unresolved`` where the rounds do not settle; ``infeasible`` where no path within thrust, terrain and
        glide slope was found.
    """
    flight = energy_flight(case, tof_s, waypoints, nodes)
    free = solve_energy(flight)
    path = measured_path(flight, free.x, *_told(flight, free))
    return path if path.status != "infeasible" else _bounded_path(flight, free, path.message)


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
    P, boundary = energy_matrix(flight), boundary_rows(flight)
    still, path, rounds = np.zeros(P.shape[0]), None, 0
    before = spline_positions(flight)(flight.times_s) - flight.case.frame.origin_m
    while True:
        x = closest(P, still, dynamics_rows(flight, flight_arcs(flight, path)), boundary)
        after = x.reshape(-1, WIDTH)[:, R] * flight.length_m
        step, rounds = float(np.abs(after - before).max()) / flight.length_m, rounds + 1
        if step <= STEP_TOLERANCE or not np.isfinite(step) or rounds == MOST_ROUNDS:
            return EnergySolution(x, step <= STEP_TOLERANCE, step, rounds)
        path, before = x, after


def measured_path(flight: EnergyFlight, x: FloatArray, status: PathStatus, message: str, rounds: int) -> Path:
    """Unscale the unknowns and measure the path.

    Parameters
    ----------
    flight : EnergyFlight
        What was transcribed.
    x : (9 (n + 1),) float
        Scaled unknowns.
    status, message, rounds
        What the solver says.

    Returns
    -------
    Path
    """
    nodes = x.reshape(-1, WIDTH) * flight.unit
    position = nodes[:, R] + flight.case.frame.origin_m
    return path_of(flight.case, flight.times_s, position, nodes[:, V], nodes[:, U], status, message, rounds)


def _told(flight: EnergyFlight, solution: EnergySolution) -> tuple[PathStatus, str, int]:
    rounds = solution.rounds
    if solution.converged:
        return "planned", f"settled in {rounds} rounds", rounds
    left = solution.step * flight.length_m
    return "unresolved", f"not settled after {rounds} rounds: nodes still move by {left:.3g} m", rounds


def _bounded_path(flight: EnergyFlight, free: EnergySolution, why: str) -> Path:
    """Solve again with the limits that the free optimum breaks."""
    from landing_cli.observe.bounded_transcription import solve_bounded

    x, solution, rounds = solve_bounded(flight, free.x)
    statuses: dict[str, PathStatus] = {"converged": "planned", "infeasible": "infeasible"}
    status = statuses.get(solution.status, "unresolved")
    found = {"converged": solution.message, "infeasible": f"no path was found ({solution.message})"}
    message = f"without limits {why}; within them {found.get(solution.status, solution.message)}"
    return measured_path(flight, x, status, message, free.rounds + rounds)

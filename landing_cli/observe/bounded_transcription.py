"""The landing of least control energy where thrust, terrain or glide slope bind, as a cone program.

The rows of `observe.energy_flight`, with |u| <= thrust / mass and the glide slope as second-order cones and
the distance to the terrain as smooth rows. The mass is that of the path before, and so are the nodes that lie
beyond the ball in which no clearance is asked; both settle in a few solutions. What a cone solver leaves of
the equations of motion is taken away by the least change of the thrust.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

from landing_cli.body.distance_slope import distances_with_slopes
from landing_cli.flight.dynamics import natural_acceleration
from landing_cli.observe.energy_flight import (
    WIDTH,
    EnergyFlight,
    R,
    U,
    boundary_rows,
    dynamics_rows,
    energy_matrix,
    flight_arcs,
    nearest_flight,
)
from landing_cli.observe.path_values import velocity_increments
from landing_cli.optimize.cone_program import (
    ConeBlock,
    ConeOptions,
    ConeProgram,
    ConeSolution,
    SmoothRows,
    solve_cone_program,
)

FloatArray = NDArray[np.float64]
BoolArray = NDArray[np.bool_]

CLEARANCE_MARGIN_M = 0.005
CONE_MARGIN_RAD = 2e-5
_REACH = 0.2
_DRIVE = ConeOptions(price=1e3, price_max=1e8, violation_tol=1e-8, progress_tol=1e-9, max_rounds=80)
_MOST_SOLUTIONS = 6
_SETTLED = 1e-7  # of the mass
_POLISHES = 2


@dataclass(frozen=True, eq=False)
class Bounds:
    """The limits of a flight, as they are known from the path before.

    Attributes
    ----------
    thrust : (n + 1,) float
        Largest thrust acceleration at the nodes, scaled.
    far : (n + 1,) bool
        The nodes beyond the ball about the site and their neighbours: they keep the clearance, the others
        stay out of the ground.
    """

    thrust: FloatArray
    far: BoolArray


def solve_bounded(flight: EnergyFlight, start: FloatArray) -> tuple[FloatArray, ConeSolution, int]:
    """Solve for the least energy within the limits of the case.

    Parameters
    ----------
    flight : EnergyFlight
        What is transcribed.
    start : (9 (n + 1),) float
        Scaled unknowns to begin with: the optimum without limits.

    Returns
    -------
    x : (9 (n + 1),) float
        Scaled unknowns, flown exactly.
    solution : ConeSolution
        Of the last program.
    rounds : int
        Convex programs in all.
    """
    x, bounds, rounds = start, known_bounds(flight, start), 0
    for _ in range(_MOST_SOLUTIONS):
        solution = solve_cone_program(bounded_program(flight, bounds), x, _DRIVE)
        x, rounds = solution.x, rounds + solution.rounds
        after = known_bounds(flight, x)
        settled = np.abs(after.thrust / bounds.thrust - 1.0).max() <= _SETTLED
        if solution.status != "converged" or (settled and np.array_equal(after.far, bounds.far)):
            break
        bounds = after
    if solution.status == "converged":
        for _ in range(_POLISHES):
            x = nearest_flight(flight, x)
    return x, solution, rounds


def known_bounds(flight: EnergyFlight, x: FloatArray) -> Bounds:
    """Take the mass and the nodes that keep the clearance from a path.

    Parameters
    ----------
    flight : EnergyFlight
        What is transcribed.
    x : (9 (n + 1),) float
        Its scaled unknowns.

    Returns
    -------
    Bounds
    """
    craft, nodes = flight.case.spacecraft, x.reshape(-1, WIDTH) * flight.unit
    spent = velocity_increments(flight.times_s, nodes[:, U])
    mass = craft.mass_kg * np.exp(-spent / craft.exhaust_velocity_m_s)
    outside = np.linalg.norm(nodes[:, R], axis=1) > flight.case.clearance_free_m
    far = outside.copy()  # and the first nodes inside: the path leaves the ball between nodes
    far[1:] |= outside[:-1]
    far[:-1] |= outside[1:]
    return Bounds(craft.thrust_max_n / mass / flight.unit[U][0], far)


def bounded_program(flight: EnergyFlight, bounds: Bounds) -> ConeProgram:
    """Transcribe a landing within limits.

    Parameters
    ----------
    flight : EnergyFlight
        What is transcribed.
    bounds : Bounds
        Its limits.

    Returns
    -------
    ConeProgram
    """
    width = WIDTH * len(flight.times_s)
    pick = sparse.eye_array(width, format="csr")
    boundary, offset = boundary_rows(flight)
    reach = np.full(width, np.inf)
    reach.reshape(-1, WIDTH)[1:-1, R] = _REACH
    blocks = (
        ConeBlock("zero", boundary, offset),
        _thrust_block(bounds, pick),
        *_glide_slope_blocks(flight, pick),
    )
    return ConeProgram(
        np.zeros(width),
        blocks,
        lambda x: _smooth(flight, bounds, x),
        reach,
        energy_matrix(flight),
        elastic_equalities=False,
    )


def _thrust_block(bounds: Bounds, pick: sparse.csr_array) -> ConeBlock:
    """|u| <= bound at every node: between them |u| is no larger."""
    n = len(bounds.thrust)
    # the first row of each cone is the bound alone: any column will do for its zeros
    columns = WIDTH * np.arange(n)[:, None] + np.array([6, 6, 7, 8])
    kept = sparse.diags_array(np.tile([0.0, 1.0, 1.0, 1.0], n)) @ pick[columns.ravel()]
    offset = np.zeros((n, 4))
    offset[:, 0] = bounds.thrust
    return ConeBlock("second_order", sparse.csr_array(kept), offset.ravel(), 4)


def _glide_slope_blocks(flight: EnergyFlight, pick: sparse.csr_array) -> list[ConeBlock]:
    """The cone about the site frame's z, at the nodes and along the last arc.

    In the last arc the position over the square of the time to go runs from the last node's to half the
    touchdown acceleration: with both in the cone, so is the arc.
    """
    case, half_angle = flight.case, flight.case.glide_slope_half_angle_rad
    if half_angle is None:
        return []
    n = len(flight.times_s) - 1
    up = case.frame.axes[2]
    lift = np.concatenate([up[None], math.cos(half_angle - CONE_MARGIN_RAD) * np.eye(3)])
    nodes = pick[(WIDTH * np.arange(n)[:, None] + np.arange(3)).ravel()]
    rows = sparse.kron(sparse.eye_array(n), lift, format="csr") @ nodes
    field = case.asteroid.gravity
    natural = natural_acceleration(
        field.kind, field.params, case.asteroid.rotation_rate_rad_s, *case.frame.origin_m, 0.0, 0.0, 0.0
    )
    touchdown = sparse.csr_array(lift) @ pick[WIDTH * n + np.arange(6, 9)]
    return [
        ConeBlock("second_order", sparse.csr_array(rows), np.zeros(4 * n), 4),
        ConeBlock("second_order", touchdown, lift @ np.array(natural) / flight.unit[U][0], 4),
    ]


def _smooth(flight: EnergyFlight, bounds: Bounds, x: FloatArray) -> SmoothRows:
    """Gaps between the arcs, and the room to the terrain at the nodes between start and site."""
    motion, drift = dynamics_rows(flight, flight_arcs(flight, x))
    inner = np.arange(1, len(flight.times_s) - 1)
    offset = x.reshape(-1, WIDTH)[inner, R] * flight.length_m
    distance, slope = distances_with_slopes(flight.case.surface, offset + flight.case.frame.origin_m)
    wanted = np.where(bounds.far[inner], (flight.case.clearance_m or 0.0) + CLEARANCE_MARGIN_M, 0.0)
    places = WIDTH * inner[:, None] + np.arange(3)
    rows = sparse.csr_array(
        (slope.ravel(), places.ravel(), 3 * np.arange(len(inner) + 1)), shape=(len(inner), len(x))
    )
    return SmoothRows(
        motion @ x + drift,
        motion,
        (distance - wanted) / flight.length_m,
        rows,
        np.full(len(inner), 2.0 * _REACH),
    )

"""The landing that knows best where it is, for the energy it spends (beyond Shen 2026).

Instead of drawing the path towards clusters of landmarks, the navigation error itself is minimised: the mean
position sigma that a covariance filter reaches with the landmarks in view, against the control energy.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from landing_cli.observe.covariance import position_sigmas
from landing_cli.observe.first_order_hold import first_order_hold
from landing_cli.observe.information_program import (
    Held,
    SplineFlight,
    energy,
    held_along,
    information_program,
    knots_of,
    spline_flight,
    thrust_along,
    thrust_with_slopes,
    transitions_along,
)
from landing_cli.observe.measurements import hard_sight, information_along
from landing_cli.observe.observed import Path
from landing_cli.observe.path_values import path_of
from landing_cli.observe.records import InformationOptions, ObserveCase, PathStatus
from landing_cli.observe.visibility import seen_at, sensor_times
from landing_cli.optimize.cone_program import ConeOptions
from landing_cli.optimize.curved_program import CurvedSolution, solve_curved_program

FloatArray = NDArray[np.float64]

SOFTNESS = (0.3, 0.1, 0.03, 0.01, 0.003)
"""Widths of the sensor's limits, one after the other: radians about an angle, share of a range."""

_CONTINUATION = (0.1, 0.3)  # shares of the weight
_SAME = 1e-3  # splines this close, in distances from start to site, have come to the same
_ROUGH = ConeOptions(progress_tol=1e-4, max_rounds=40)
_FINE = ConeOptions(progress_tol=1e-7, max_rounds=80)


@dataclass(frozen=True, eq=False)
class Candidate:
    """A spline and what it is worth with the sensor's true limits.

    Attributes
    ----------
    knots_m : (m, 3) float, m, body frame
    energy_m2_s3 : float, m2/s3
    sigma_m : float, m
        Mean position sigma.
    solution : CurvedSolution
        What found it.
    """

    knots_m: FloatArray
    energy_m2_s3: float
    sigma_m: float
    solution: CurvedSolution

    def cost(self, weight: float, energy_unit: float) -> float:
        """J/J0 + lambda log(sigma); infinite where a limit of the case is broken."""
        if self.solution.violation > _FINE.violation_tol:
            return math.inf
        return self.energy_m2_s3 / energy_unit + weight * math.log(self.sigma_m)

    def rank(self, weight: float, energy_unit: float) -> tuple[bool, float, float]:
        """Least is best: what has converged, then the cost, then the violation."""
        cost = self.cost(weight, energy_unit)
        return self.solution.status != "converged", cost, self.solution.violation


def most_informative_path(
    case: ObserveCase, start: Path, options: InformationOptions, others: Sequence[Path] = ()
) -> Path:
    """Find the path of least J/J0 + lambda log(mean position sigma).

    From every starting path, and from the answer to lighter weights, the program is solved with softer, then
    harder limits of the sensor; what is hidden by terrain or in the dark is looked up anew each time. The
    best answer by the true limits is flown.

    Parameters
    ----------
    case : ObserveCase
        What is asked.
    start : Path
        The least-energy path: it sets t_f, J0 and the nodes of the answer, and is the first starting path.
    options : InformationOptions
        Weight and knots.
    others : sequence of Path, optional
        More paths to start from, of the same t_f: those of the paper's method, say.

    Returns
    -------
    Path
        A local optimum; ``infeasible`` where the least violation found remains.
    """
    flight = spline_flight(case, start.tof_s, options.knots)
    best, rounds = best_spline(
        flight, [knots_of(flight, path) for path in (start, *others)], start, options.weight
    )
    return flown(flight, best, start, rounds)


def best_spline(
    flight: SplineFlight, starts_m: Sequence[FloatArray], unit: Path, weight: float
) -> tuple[Candidate, int]:
    """Solve the program from several splines, and keep the best by the sensor's true limits.

    Parameters
    ----------
    flight : SplineFlight
        The spline.
    starts_m : sequence of (m, 3) float, m, body frame
        Inner knots to start from.
    unit : Path
        The least-energy path, of J0.
    weight : float
        lambda.

    Returns
    -------
    best : Candidate
    rounds : int
        Quadratic programs solved in all.
    """
    found: list[Candidate] = []
    pool = list(starts_m)
    if weight > 0.0:  # lighter weights lead to where the heavy one would not get to at once
        knots = pool[0]
        for share in _CONTINUATION:
            held = held_along(flight, knots, SOFTNESS[0])
            knots = _solved(flight, held, knots, unit, share * weight, _ROUGH).knots_m
        pool.append(knots)
    for softness in SOFTNESS if weight > 0.0 else SOFTNESS[-1:]:
        drive = _FINE if softness == SOFTNESS[-1] else _ROUGH
        solved = [_solved(flight, held_along(flight, k, softness), k, unit, weight, drive) for k in pool]
        found += solved
        pool = _distinct([one.knots_m for one in solved], _SAME * flight.length_m)
    best = min(found, key=lambda one: one.rank(weight, unit.performance_index_m2_s3))
    return best, sum(one.solution.rounds for one in found)


def flown(flight: SplineFlight, best: Candidate, start: Path, rounds: int) -> Path:
    """Fly a spline with a thrust linear between the nodes of the starting path.

    Parameters
    ----------
    flight : SplineFlight
        The spline.
    best : Candidate
        Its knots.
    start : Path
        Its nodes are taken.
    rounds : int
        What it took.

    Returns
    -------
    Path
    """
    case, samples = flight.case, flight.samples(start.t_s)
    r, v, _ = samples.at(best.knots_m)
    wanted = thrust_along(flight, samples, best.knots_m)
    states, u, gap = first_order_hold(case.asteroid, start.t_s, np.concatenate([r, v], axis=1), wanted)
    solution = best.solution
    status: PathStatus = "planned" if solution.status == "converged" else solution.status
    message = f"sequential cone programs over {len(flight.knot_s)} knots: {solution.message}"
    if gap > 1e-6:
        status, message = "unresolved", f"the flight does not close: a gap of {gap:.3g} m remains"
    return path_of(case, start.t_s, states[:, :3], states[:, 3:], u, status, message, rounds)


def _distinct(splines_m: Sequence[FloatArray], apart_m: float) -> list[FloatArray]:
    """Splines that are not the same as an earlier one."""
    kept: list[FloatArray] = []
    for knots in splines_m:
        if all(np.abs(knots - other).max() > apart_m for other in kept):
            kept.append(knots)
    return kept


def _solved(
    flight: SplineFlight, held: Held, start: FloatArray, unit: Path, weight: float, drive: ConeOptions
) -> Candidate:
    """Solve one program, and judge its answer by the true limits."""
    J0 = unit.performance_index_m2_s3
    solution = solve_curved_program(
        information_program(flight, held, start, J0, weight), np.zeros(start.size), drive
    )
    knots = start + flight.length_m * solution.x.reshape(-1, 3)
    J, _, _ = energy(flight, thrust_with_slopes(flight, knots))
    return Candidate(knots, J, hard_mean_sigma(flight, knots), solution)


def hard_mean_sigma(flight: SplineFlight, knots_m: FloatArray) -> float:
    """Mean position sigma by the sensor's true limits at all its times, m, for inner knots (m, 3), m."""
    case = flight.case
    t_s = sensor_times(case.sensor, flight.tof_s)
    position = flight.samples(t_s).at(knots_m)[0]
    sight = hard_sight(case, seen_at(case, t_s, position).visible)
    told = information_along(sight, position)
    transitions = transitions_along(flight, knots_m, t_s)
    return float(position_sigmas(case.prior, t_s, transitions, told).mean())

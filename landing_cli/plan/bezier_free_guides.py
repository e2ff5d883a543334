"""The Bezier method with its guide points free in space, and with more of them (degrees above 7)."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from landing_cli.errors import InputRefused
from landing_cli.flight.bezier_curve import bezier_basis
from landing_cli.flight.legs import BezierLeg
from landing_cli.optimize.cone_program import ConeSolution, solve_cone_program
from landing_cli.plan.assess import plan_of
from landing_cli.plan.cone_entry import FINE, first_time_to_go, search_case, search_cone_entry
from landing_cli.plan.free_flight import EXCESS_TOLERANCE, verdict
from landing_cli.plan.free_guides import FreeGuides, control_points, free_guides_program, guides_through
from landing_cli.plan.records import CHECK_SAMPLES, FreeGuidesOptions, Parameter, Plan, PlanCase
from landing_cli.plan.sampled_flight import sampled_flight
from landing_cli.plan.starting_paths import starting_paths

FloatArray = NDArray[np.float64]

METHOD = "bezier_free_guides"

LEAST_DEGREE, LARGEST_DEGREE = 6, 14
_COARSE_SAMPLES = 81
_COARSE_PATH_SAMPLES = 401
_BUCKET = 5
_THRUST_ROUNDS = 4
_ROOM = 1.0 - 1e-5


def plan_bezier_free_guides(case: PlanCase, options: FreeGuidesOptions | None = None) -> Plan:
    """Plan the landing of least fuel or energy along a Bezier curve with free inner control points.

    Parameters
    ----------
    case : PlanCase
        What is asked.
    options : FreeGuidesOptions, optional
        Degree, objective and samples.

    Returns
    -------
    Plan
        A local optimum; ``infeasible`` where the least violation found remains.

    Raises
    ------
    InputRefused
        The degree leaves no control point free, or is above 14, where the search has been seen to stall.
    """
    options = options or FreeGuidesOptions()
    if not LEAST_DEGREE <= options.degree <= LARGEST_DEGREE:
        raise InputRefused(
            f"a Bezier curve of degree {options.degree} has no free control point or too many",
            where="plan.bezier_free_guides.degree",
            fix=f"choose a degree from {LEAST_DEGREE} to {LARGEST_DEGREE}; the paper's is 7",
        )
    rough = search_case(case)
    coarse = FreeGuides(
        rough, options.degree, np.inf, _COARSE_SAMPLES, _COARSE_PATH_SAMPLES, 1, options.objective
    )
    search = search_cone_entry(
        rough,
        lambda entry_s: free_guides_program(replace(coarse, entry_s=entry_s)),
        _starts(coarse),
        max(first_time_to_go(case), case.tof_s / options.degree),
    )
    fine = replace(
        coarse,
        case=case,
        entry_s=search.entry_s,
        samples=options.samples,
        path_samples=CHECK_SAMPLES,
        bucket=_BUCKET,
    )
    fine, solution, rounds = _within_thrust(fine, _through(fine, coarse, search.solution.x))
    points = control_points(fine, solution.x)
    status, because = verdict(solution)
    parameters: dict[str, Parameter] = {
        "degree": options.degree,
        "objective": options.objective,
        "samples": options.samples,
        "guide_points_m": points[3 : options.degree - 2].tolist(),
        "cone_entry_bound_s": search.entry_s,
        "cone_entries_tried_s": search.tried_s,
        "cone_entries_cost": search.tried_cost,
        "starts_cost": search.starts_cost,
        "searched_in": "point mass" if rough is not case else "the field of the plan",
        "thrust_share_at_samples": fine.thrust_share,
    }
    return plan_of(
        case,
        METHOD,
        [BezierLeg(case.tof_s, points, case.asteroid.gravity)],
        iterations=search.rounds + rounds,
        parameters=parameters,
        otherwise=status,
        because=because,
    )


def _within_thrust(fine: FreeGuides, start: FloatArray) -> tuple[FreeGuides, ConeSolution, int]:
    """Solve, and leave the more room at the samples, the more the thrust exceeds its bound between them."""
    rounds = 0
    for _ in range(_THRUST_ROUNDS):
        solution = solve_cone_program(free_guides_program(fine), start, FINE)
        rounds += solution.rounds
        if solution.status != "converged" or solution.x[-1] > EXCESS_TOLERANCE:
            break
        peak = _peak_share(fine, solution.x)
        if peak <= 1.0:
            break
        fine, start = replace(fine, thrust_share=_ROOM * fine.thrust_share / peak), solution.x
    return fine, solution, rounds


def _peak_share(fine: FreeGuides, x: FloatArray) -> float:
    """Largest thrust at the check samples over its bound."""
    case = fine.case
    leg = BezierLeg(case.tof_s, control_points(fine, x), case.asteroid.gravity)
    trajectory, _ = sampled_flight(case, [leg])
    return float(np.linalg.norm(trajectory.thrust_n, axis=1).max()) / case.spacecraft.thrust_max_n


def _starts(guides: FreeGuides) -> list[FloatArray]:
    """Curves out of the body on several sides, from the curve of the same degree that passes through it."""
    case = guides.case
    times = np.linspace(0.0, case.tof_s, _COARSE_PATH_SAMPLES)
    straight = bezier_basis(5, times / case.tof_s) @ control_points(
        replace(guides, degree=5), np.zeros(guides.unknowns)
    )
    return [guides_through(guides, path) for path in starting_paths(case, times, straight)]


def _through(fine: FreeGuides, coarse: FreeGuides, x: FloatArray) -> FloatArray:
    """Unknowns of one transcription that fly the curve of another."""
    path = bezier_basis(coarse.degree, np.linspace(0.0, 1.0, _COARSE_PATH_SAMPLES)) @ control_points(
        coarse, x
    )
    return guides_through(fine, path)

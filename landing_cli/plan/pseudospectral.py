"""The Gauss pseudospectral method, with which Lyu 2026 (section 3.4) compares the Bezier curves.

Two phases, up to the cone entry and inside the safety cone, each with one polynomial per state on
Legendre-Gauss nodes (Benson 2005). What happens between nodes is not trusted: thrust, clearance and cone are
bound there too, and the control is flown by an integrator, whose peak thrust and touchdown correct the
problem until it lands.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from landing_cli.flight.trajectory import Trajectory
from landing_cli.optimize.cone_program import ConeSolution, solve_cone_program
from landing_cli.plan.assess import Measured, broken_constraints, measure, no_plan, plan_of
from landing_cli.plan.cone_entry import FINE, ROUGH, first_time_to_go, search_cone_entry
from landing_cli.plan.gauss_problem import GaussProblem, gauss_problem, phase_flights
from landing_cli.plan.gauss_program import build_program, node_positions, start_point, velocity_increment_m_s
from landing_cli.plan.records import (
    CHECK_SAMPLES,
    Parameter,
    Plan,
    PlanCase,
    PlanStatus,
    PseudospectralOptions,
)
from landing_cli.plan.sampled_flight import accelerations_at
from landing_cli.plan.starting_paths import boundary_cubic, starting_paths

FloatArray = NDArray[np.float64]

METHOD = "pseudospectral"

_CONE_SHARE = 0.25  # of the nodes, inside the cone
_CONE_NODES = 6  # at least
_CORRECTIONS = 10  # of thrust bound, drift and clearance
_DRAW = 1.5  # power of the excess by which the bound is drawn in: the peak grows back by some of it
_WEAK_NODES = 16  # with which the thrust is told that a site would take
_DOUBLINGS = 5  # of the thrust, in which one is looked for that suffices


@dataclass(frozen=True, eq=False)
class _Solved:
    """A problem, its solution, and the cone programs that it took."""

    problem: GaussProblem
    solution: ConeSolution
    rounds: int


def plan_pseudospectral(case: PlanCase, options: PseudospectralOptions | None = None) -> Plan:
    """Plan a landing by Gauss pseudospectral transcription.

    Parameters
    ----------
    case : PlanCase
        What is asked.
    options : PseudospectralOptions, optional
        Objective, terminal conditions and number of nodes.

    Returns
    -------
    Plan
        A local optimum of the transcription, re-flown; ``infeasible`` where a violation remains at its local
        least. The control is a polynomial over each phase.
    """
    options = options or PseudospectralOptions()
    free = without_terrain(case, options)
    if free.solution.status == "infeasible":
        parameters = _choices(free.problem, options)
        why = _too_weak(case, options)
        return no_plan(case, METHOD, "infeasible", why, iterations=free.rounds, parameters=parameters)
    first_s = first_time_to_go(case)
    starts = _either_side(free, _problem_at(case, options, case.tof_s - first_s))
    search = search_cone_entry(
        case, lambda entry_s: build_program(_problem_at(case, options, entry_s)), starts, first_s
    )
    solved = _as_flown(_problem_at(case, options, search.entry_s), search.solution.x)
    searched: dict[str, Parameter] = {
        "cone_entry_bound_s": solved.problem.phases[1].start_s,
        "cone_entries_tried_s": search.tried_s,
        "cone_entries_cost": search.tried_cost,
        "starts_cost": search.starts_cost,
        "delta_v_without_terrain_m_s": velocity_increment_m_s(free.problem, free.solution.x),
        "thrust_share": list(solved.problem.thrust_share),
    }
    return _answer(solved, options, searched, free.rounds + search.rounds + solved.rounds)


def plan_entering_at(case: PlanCase, options: PseudospectralOptions, entry_s: float) -> Plan:
    """Plan with a given time of cone entry.

    Parameters
    ----------
    case : PlanCase
        What is asked.
    options : PseudospectralOptions
        Objective, terminal conditions and number of nodes.
    entry_s : float, s
        From then on the path is in the cone; it may be so earlier.

    Returns
    -------
    Plan
    """
    free, problem = without_terrain(case, options), _problem_at(case, options, entry_s)
    tried = [
        solve_cone_program(build_program(problem), start, ROUGH) for start in _either_side(free, problem)
    ]
    best = min(tried, key=lambda one: one.value + ROUGH.price * one.rows.total)
    solved = _as_flown(problem, best.x)
    rounds = free.rounds + sum(one.rounds for one in tried) + solved.rounds
    return _answer(solved, options, {"cone_entry_bound_s": entry_s}, rounds)


def _problem_at(case: PlanCase, options: PseudospectralOptions, entry_s: float) -> GaussProblem:
    entry = min(max(round(entry_s / case.tof_s * (CHECK_SAMPLES - 1)), 2), CHECK_SAMPLES - 2)
    return gauss_problem(case, options.objective, options.terminal, entry, phase_nodes(options.nodes))


def phase_nodes(nodes: int) -> tuple[int, int]:
    """Share nodes between the phase up to the cone entry and the one inside the cone.

    Parameters
    ----------
    nodes : int
        In all.

    Returns
    -------
    (int, int)
        Nodes of each phase; at least one outside.
    """
    inside = max(_CONE_NODES, round(_CONE_SHARE * nodes))
    return max(nodes - inside, 1), inside


def without_terrain(case: PlanCase, options: PseudospectralOptions) -> _Solved:
    """Solve one phase with neither clearance nor cone, from the cubic between the boundary states.

    Parameters
    ----------
    case : PlanCase
        What is asked.
    options : PseudospectralOptions
        Objective, terminal conditions and number of nodes.

    Returns
    -------
    _Solved
        A lower bound, up to the polynomial's own limits, and a first path.
    """
    problem, start = _free_problem(case, options)
    solution = solve_cone_program(build_program(problem), start, FINE)
    return _Solved(problem, solution, solution.rounds)


def _free_problem(case: PlanCase, options: PseudospectralOptions) -> tuple[GaussProblem, FloatArray]:
    """One phase without path bounds, and where to start."""
    problem = gauss_problem(case, options.objective, options.terminal, 0, (options.nodes,))
    path = boundary_cubic(case, problem.node_times_s)[:, :3]
    return problem, start_point(problem, np.zeros_like(path), path)


def _either_side(free: _Solved, problem: GaussProblem) -> list[FloatArray]:
    """Unknowns of the free path pushed out of the body, and bent to its other side."""
    case, times = problem.case, problem.node_times_s
    control = accelerations_at(free.problem.legs(free.solution.x), times, case.asteroid.rotation_rate_rad_s)
    known = np.concatenate([[0.0], free.problem.node_times_s, [case.tof_s]])
    inner = node_positions(free.problem, free.solution.x)
    path = np.concatenate([case.position_m[None], inner, case.site.position_m[None]])
    at_nodes = np.stack([np.interp(times, known, column) for column in path.T], axis=1)
    return [start_point(problem, control, one) for one in starting_paths(case, times, at_nodes)]


def _as_flown(problem: GaussProblem, x: FloatArray) -> _Solved:
    """Solve to the end, so that the control keeps its constraints when an integrator flies it.

    Between the points the control polynomial exceeds its bound, and the integrator leaves the state
    polynomials by what these do not resolve: the bound is drawn in, the second phase moved and the clearance
    raised by as much.
    """
    case, rounds = problem.case, 0
    for _ in range(_CORRECTIONS):
        solution = solve_cone_program(build_program(problem), x, FINE)
        rounds, x = rounds + solution.rounds, solution.x
        measured = measure(case, problem.legs(x))
        if solution.status != "converged" or not broken_constraints(case, measured):
            break
        flown, peaks = measured.trajectory, _peak_shares(problem, measured.trajectory)
        shares = zip(problem.thrust_share, peaks, strict=True)
        problem = replace(
            problem,
            thrust_share=tuple(share / max(peak, 1.0) ** _DRAW for share, peak in shares),
            drift=_at_entry(problem, flown) - phase_flights(problem, x)[0].far,
            margin_m=problem.margin_m + max(case.clearance_m - _clearance_m(case, measured), 0.0),
        )
    return _Solved(problem, solution, rounds)


def _peak_shares(problem: GaussProblem, flown: Trajectory) -> list[float]:
    """Greatest thrust of each phase at the samples, over the thruster's."""
    shares = np.linalg.norm(flown.thrust_n, axis=1) / problem.case.spacecraft.thrust_max_n
    return [float(part.max()) for part in np.split(shares, [problem.entry])]


def _clearance_m(case: PlanCase, measured: Measured) -> float:
    by_surface = case.clearance_metric == "surface"
    return measured.clearance_surface_m if by_surface else measured.clearance_vertices_m


def _at_entry(problem: GaussProblem, flown: Trajectory) -> FloatArray:
    return np.concatenate([flown.position_m[problem.entry], flown.velocity_m_s[problem.entry]])


def _too_weak(case: PlanCase, options: PseudospectralOptions) -> str:
    """Say how much thrust the site would take without terrain and cone; fewer nodes tell it well enough."""
    share, problem, start = 1.0, *_free_problem(case, replace(options, nodes=min(options.nodes, _WEAK_NODES)))

    def reaches(share: float) -> bool:
        program = build_program(replace(problem, thrust_share=(share,)))
        return solve_cone_program(program, start, ROUGH).status == "converged"

    bound = case.spacecraft.thrust_max_n
    low = 1.0
    for _ in range(_DOUBLINGS):
        share = 2.0 * low
        if reaches(share):
            break
        low = share
    else:
        return f"even without terrain {share * bound:.0f} N do not suffice in {case.tof_s:.6g} s"
    while share > 1.01 * low:
        middle = float(np.sqrt(share * low))
        low, share = (low, middle) if reaches(middle) else (middle, share)
    return (
        f"even without terrain it takes {share * bound:.3g} N to land in {case.tof_s:.6g} s; "
        f"the thruster gives {bound:g} N"
    )


def _choices(problem: GaussProblem, options: PseudospectralOptions) -> dict[str, Parameter]:
    return {
        "objective": options.objective,
        "terminal": options.terminal,
        "nodes": options.nodes,
        "phase_nodes": [float(n) for n in problem.node_counts],
    }


def _answer(
    solved: _Solved, options: PseudospectralOptions, searched: dict[str, Parameter], rounds: int
) -> Plan:
    """Fly the control again and tell what it keeps."""
    problem, solution = solved.problem, solved.solution
    status: PlanStatus = "infeasible" if solution.status == "infeasible" else "unresolved"
    return plan_of(
        problem.case,
        METHOD,
        problem.legs(solution.x),
        iterations=rounds,
        parameters={**_choices(problem, options), **searched},
        otherwise=status,
        because=f"successive convexification: {solution.message}",
    )

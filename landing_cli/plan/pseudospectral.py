"""The Gauss pseudospectral method, with which Lyu 2026 (section 3.4) compares the Bezier curves.

Two phases, up to the cone entry and inside the safety cone, each with one polynomial per state on
Legendre-Gauss nodes (Benson 2005). What happens between nodes is not trusted: thrust, clearance and cone are
bound there too, the thrust bound is drawn in until the control polynomial keeps it everywhere, and the
control is flown again by an integrator before a path is called planned.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from landing_cli.optimize.cone_program import ConeSolution, solve_cone_program
from landing_cli.plan.assess import THRUST_TOLERANCE, accelerations_at, measure, plan_of
from landing_cli.plan.cone_entry import FINE, first_time_to_go, search_cone_entry
from landing_cli.plan.gauss_program import (
    GaussProblem,
    build_program,
    gauss_problem,
    node_positions,
    start_point,
    velocity_increment_m_s,
)
from landing_cli.plan.records import (
    CHECK_SAMPLES,
    Parameter,
    Plan,
    PlanCase,
    PlanStatus,
    PseudospectralOptions,
)
from landing_cli.plan.starting_paths import boundary_cubic, starting_paths

FloatArray = NDArray[np.float64]

_CONE_SHARE = 0.25  # of the nodes, inside the cone
_CONE_NODES = 6  # at least
_DRAWS = 6  # of the thrust bound


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
        return _answer(free, options, {}, "even without terrain the thrust does not suffice", free.rounds)
    nodes = phase_nodes(options.nodes)

    def problem_at(entry_s: float) -> GaussProblem:
        entry = round(entry_s / case.tof_s * (CHECK_SAMPLES - 1))
        entry = min(max(entry, 2), CHECK_SAMPLES - 2)
        return gauss_problem(case, options.objective, options.terminal, entry, nodes)

    first_s = first_time_to_go(case)
    starts = _either_side(free, problem_at(case.tof_s - first_s))
    search = search_cone_entry(case, lambda entry_s: build_program(problem_at(entry_s)), starts, first_s)
    solved = _thrust_kept(problem_at(search.entry_s), search.solution.x)
    searched: dict[str, Parameter] = {
        "cone_entry_bound_s": solved.problem.phases[1].start_s,
        "cone_entries_tried_s": search.tried_s,
        "cone_entries_cost": search.tried_cost,
        "starts_cost": search.starts_cost,
        "delta_v_without_terrain_m_s": velocity_increment_m_s(free.problem, free.solution.x),
        "thrust_share": list(solved.problem.thrust_share),
    }
    return _answer(solved, options, searched, "", free.rounds + search.rounds + solved.rounds)


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
    problem = gauss_problem(case, options.objective, options.terminal, 0, (options.nodes,))
    path = boundary_cubic(case, problem.node_times_s)[:, :3]
    start = start_point(problem, np.zeros_like(path), path)
    solution = solve_cone_program(build_program(problem), start, FINE)
    return _Solved(problem, solution, solution.rounds)


def _either_side(free: _Solved, problem: GaussProblem) -> list[FloatArray]:
    """Unknowns of the free path pushed out of the body, and bent to its other side."""
    case, times = problem.case, problem.node_times_s
    control = accelerations_at(free.problem.legs(free.solution.x), times, case.asteroid.rotation_rate_rad_s)
    known = np.concatenate([[0.0], free.problem.node_times_s, [case.tof_s]])
    inner = node_positions(free.problem, free.solution.x)
    path = np.concatenate([case.position_m[None], inner, case.site.position_m[None]])
    at_nodes = np.stack([np.interp(times, known, column) for column in path.T], axis=1)
    return [start_point(problem, control, one) for one in starting_paths(case, times, at_nodes)]


def _thrust_kept(problem: GaussProblem, x: FloatArray) -> _Solved:
    """Solve to the end, drawing the thrust bound in until the polynomial keeps it between points too."""
    rounds = 0
    for _ in range(_DRAWS):
        solution = solve_cone_program(build_program(problem), x, FINE)
        rounds, x = rounds + solution.rounds, solution.x
        peaks = _peak_shares(problem, x)
        if solution.status == "unresolved" or max(peaks) <= 1.0 + 0.5 * THRUST_TOLERANCE:
            break
        shares = zip(problem.thrust_share, peaks, strict=True)
        problem = replace(problem, thrust_share=tuple(share / max(peak, 1.0) for share, peak in shares))
    return _Solved(problem, solution, rounds)


def _peak_shares(problem: GaussProblem, x: FloatArray) -> list[float]:
    """Greatest thrust of each phase at the samples, over the thruster's."""
    thrust = np.linalg.norm(measure(problem.case, problem.legs(x)).trajectory.thrust_n, axis=1)
    shares = thrust / problem.case.spacecraft.thrust_max_n
    return [float(part.max()) for part in np.split(shares, [problem.entry])]


def _answer(
    solved: _Solved,
    options: PseudospectralOptions,
    searched: dict[str, Parameter],
    because: str,
    rounds: int,
) -> Plan:
    """Fly the control again and tell what it keeps."""
    problem, solution = solved.problem, solved.solution
    status: PlanStatus = "infeasible" if solution.status == "infeasible" else "unresolved"
    parameters: dict[str, Parameter] = {
        "objective": options.objective,
        "terminal": options.terminal,
        "nodes": options.nodes,
        "phase_nodes": [float(n) for n in problem.node_counts],
        **searched,
    }
    return plan_of(
        problem.case,
        "pseudospectral",
        problem.legs(solution.x),
        iterations=rounds,
        parameters=parameters,
        otherwise=status,
        because=because or f"successive convexification: {solution.message}",
    )

"""The free-control optimum: a landing with no shape prescribed, by successive convexification.

What the methods with a prescribed shape are compared with: the best path that thrust, terrain and cone allow.
The time of cone entry is searched on a coarse grid of nodes, then the nodes are placed where the thrust
changes and the program is solved to its end.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from landing_cli.flight.legs import LinearAccelerationLeg
from landing_cli.optimize.cone_program import ConeSolution, solve_cone_program
from landing_cli.plan.assess import plan_of
from landing_cli.plan.cone_entry import FINE, first_time_to_go, search_cone_entry
from landing_cli.plan.free_flight import (
    EXCESS_TOLERANCE,
    SPENT,
    FreeFlight,
    free_flight_program,
    packed,
    unpacked,
    verdict,
)
from landing_cli.plan.records import CHECK_SAMPLES, ConvexOptions, Parameter, Plan, PlanCase
from landing_cli.plan.starting_paths import boundary_cubic, refined_times, starting_paths

FloatArray = NDArray[np.float64]

_COARSE_NODES = 41
_COARSE_SAMPLES = 401
_BUCKET = 5


@dataclass(frozen=True, eq=False)
class _Solved:
    """A transcribed flight and its solution."""

    flight: FreeFlight
    solution: ConeSolution


def plan_convex(case: PlanCase, options: ConvexOptions | None = None) -> Plan:
    """Plan the landing of least fuel or energy with free thrust.

    Parameters
    ----------
    case : PlanCase
        What is asked.
    options : ConvexOptions, optional
        Objective, terminal conditions and number of nodes.

    Returns
    -------
    Plan
        A local optimum; ``infeasible`` where the least violation found from either side of the body remains.
        The control is linear between nodes.
    """
    options = options or ConvexOptions()
    free = _without_terrain(case, options)
    if free.solution.x[-1] > EXCESS_TOLERANCE:
        return _answer(free, options, {}, "even without terrain, ", free.solution.rounds)
    starts = _either_side(free)
    search = search_cone_entry(
        case,
        lambda entry_s: free_flight_program(replace(free.flight, entry_s=entry_s)),
        starts,
        first_time_to_go(case),
    )
    coarse = _Solved(replace(free.flight, entry_s=search.entry_s), search.solution)
    solved = _refined(coarse, options.nodes)
    searched: dict[str, Parameter] = {
        "cone_entry_bound_s": search.entry_s,
        "cone_entries_tried_s": search.tried_s,
        "cone_entries_cost": search.tried_cost,
        "starts_cost": search.starts_cost,
        "fuel_without_terrain_kg": _fuel_kg(free),
    }
    rounds = free.solution.rounds + search.rounds + solved.solution.rounds
    return _answer(solved, options, searched, "", rounds)


def _without_terrain(case: PlanCase, options: ConvexOptions) -> _Solved:
    """The optimum with neither clearance nor cone, from a cubic: a lower bound, and a first path."""
    times = np.linspace(0.0, case.tof_s, _COARSE_NODES)
    flight = FreeFlight(case, times, np.inf, _COARSE_SAMPLES, 1, options.objective, options.terminal)
    start = packed(flight, boundary_cubic(case, times), np.zeros((_COARSE_NODES, 3)))
    return _Solved(flight, solve_cone_program(free_flight_program(flight), start, FINE))


def _either_side(free: _Solved) -> list[FloatArray]:
    """Unknowns of the free path pushed out of the body, and bent to its other side."""
    flight = free.flight
    states, thrust, _ = unpacked(flight, free.solution.x)
    paths = starting_paths(flight.case, flight.times_s, states[:, :3])
    return [packed(flight, np.concatenate([path, states[:, 3:]], axis=1), thrust) for path in paths]


def _refined(coarse: _Solved, nodes: int) -> _Solved:
    """Place the nodes where the thrust changes, bind all samples, and solve to the end."""
    states, thrust, _ = unpacked(coarse.flight, coarse.solution.x)
    times = refined_times(coarse.flight.times_s, thrust, nodes)
    flight = replace(coarse.flight, times_s=times, samples=CHECK_SAMPLES, bucket=_BUCKET)
    columns = np.concatenate([states, thrust], axis=1).T
    at_nodes = np.stack([np.interp(times, coarse.flight.times_s, column) for column in columns], axis=1)
    start = packed(flight, at_nodes[:, :6], at_nodes[:, 6:])
    return _Solved(flight, solve_cone_program(free_flight_program(flight), start, FINE))


def _fuel_kg(solved: _Solved) -> float:
    case = solved.flight.case
    spent = solved.solution.x[solved.flight.columns[-1, SPENT]] * solved.flight.acceleration_m_s2 * case.tof_s
    ratio = spent / case.spacecraft.exhaust_velocity_m_s
    share = ratio if case.mass_model == "constant" else -np.expm1(-ratio)
    return float(case.spacecraft.mass_kg * share)


def _answer(
    solved: _Solved, options: ConvexOptions, searched: dict[str, Parameter], where: str, rounds: int
) -> Plan:
    """Fly the control again and tell what it keeps."""
    flight, solution = solved.flight, solved.solution
    _, thrust, _ = unpacked(flight, solution.x)
    status, because = verdict(solution)
    parameters: dict[str, Parameter] = {
        "objective": options.objective,
        "terminal": options.terminal,
        "nodes": options.nodes,
        **searched,
    }
    return plan_of(
        flight.case,
        "convex",
        [LinearAccelerationLeg(flight.times_s, thrust)],
        iterations=rounds,
        parameters=parameters,
        otherwise=status,
        because=f"{where}{because}",
    )

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
from landing_cli.optimize.cone_program import ConeOptions, ConeSolution, solve_cone_program
from landing_cli.plan.assess import plan_of
from landing_cli.plan.cone_entry import FINE, ROUGH, first_time_to_go, priced, search_case, search_cone_entry
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
        A local optimum; ``infeasible`` where the least violation found remains.
        The control is linear between nodes.
    """
    options = options or ConvexOptions()
    rough = search_case(case)
    free = _without_terrain(rough, options)
    bound = _refined(free, options.nodes, case=case, drive=FINE)
    if bound.solution.x[-1] > EXCESS_TOLERANCE:
        rounds = free.solution.rounds + bound.solution.rounds
        return _answer(bound, options, {}, "even without terrain, ", rounds)
    starts = _every_side(free)
    placed = _refined(min(starts, key=_cost), _COARSE_NODES)
    search = search_cone_entry(
        rough,
        lambda entry_s: free_flight_program(replace(placed.flight, entry_s=entry_s)),
        [placed.solution.x],
        first_time_to_go(case),
    )
    coarse = _Solved(replace(placed.flight, entry_s=search.entry_s), search.solution)
    solved = _refined(coarse, options.nodes, case=case, samples=CHECK_SAMPLES, bucket=_BUCKET, drive=FINE)
    searched: dict[str, Parameter] = {
        "cone_entry_bound_s": search.entry_s,
        "cone_entries_tried_s": search.tried_s,
        "cone_entries_cost": search.tried_cost,
        "starts_cost": [_cost(one) for one in starts],
        "fuel_without_terrain_kg": _fuel_kg(bound),
        "searched_in": "point mass" if rough is not case else "the field of the plan",
        "last_arc_s": float(np.diff(solved.flight.times_s)[-1]),
    }
    rounds = search.rounds + sum(one.solution.rounds for one in (free, bound, *starts, placed, solved))
    return _answer(solved, options, searched, "", rounds)


def _without_terrain(case: PlanCase, options: ConvexOptions) -> _Solved:
    """The optimum with neither clearance nor cone, from a cubic: a lower bound, and a first path."""
    times = np.linspace(0.0, case.tof_s, _COARSE_NODES)
    flight = FreeFlight(case, times, np.inf, _COARSE_SAMPLES, 1, options.objective, options.terminal)
    start = packed(flight, boundary_cubic(case, times), np.zeros((_COARSE_NODES, 3)))
    return _Solved(flight, solve_cone_program(free_flight_program(flight), start, FINE))


def _every_side(free: _Solved) -> list[_Solved]:
    """Solve roughly from the free path pushed out of the body, and from it bent to its other sides."""
    flight = replace(free.flight, entry_s=free.flight.case.tof_s - first_time_to_go(free.flight.case))
    states, thrust, _ = unpacked(flight, free.solution.x)
    solved = []
    for path in starting_paths(flight.case, flight.times_s, states[:, :3]):
        start = packed(flight, np.concatenate([path, states[:, 3:]], axis=1), thrust)
        solved.append(_Solved(flight, solve_cone_program(free_flight_program(flight), start, ROUGH)))
    return solved


def _cost(solved: _Solved) -> float:
    return priced(solved.solution)


def _refined(
    solved: _Solved,
    nodes: int,
    *,
    case: PlanCase | None = None,
    samples: int = _COARSE_SAMPLES,
    bucket: int = 1,
    drive: ConeOptions = ROUGH,
) -> _Solved:
    """Place the nodes where the thrust changes, and solve again from there."""
    states, thrust, _ = unpacked(solved.flight, solved.solution.x)
    old = solved.flight.times_s
    times = refined_times(old, thrust, nodes)
    flight = replace(
        solved.flight, case=case or solved.flight.case, times_s=times, samples=samples, bucket=bucket
    )
    states, thrust = (
        np.stack([np.interp(times, old, column) for column in values.T], axis=1)
        for values in (states, thrust)
    )
    start = packed(flight, states, thrust)
    return _Solved(flight, solve_cone_program(free_flight_program(flight), start, drive))


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

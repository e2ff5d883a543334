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
from landing_cli.plan.cone_entry import first_time_to_go, least_cost_time_to_go
from landing_cli.plan.free_flight import (
    EXCESS_TOLERANCE,
    SPENT,
    FreeFlight,
    free_flight_program,
    packed,
    unpacked,
)
from landing_cli.plan.records import CHECK_SAMPLES, ConvexOptions, Parameter, Plan, PlanCase, PlanStatus
from landing_cli.plan.starting_paths import refined_times, starting_paths

FloatArray = NDArray[np.float64]

_COARSE_NODES = 41
_COARSE_SAMPLES = 401
_BUCKET = 5
_PRICE = 10.0
_ROUGH = ConeOptions(progress_tol=3e-4, violation_tol=1e-5, price=_PRICE, price_max=_PRICE, max_rounds=25)
_FINE = ConeOptions(progress_tol=1e-5, violation_tol=3e-8, price=_PRICE, price_max=1e4)


@dataclass(frozen=True, eq=False)
class _Solved:
    """A transcribed flight and its solution."""

    flight: FreeFlight
    solution: ConeSolution

    @property
    def cost(self) -> float:
        """Objective and priced violations."""
        return self.solution.value + _PRICE * self.solution.rows.total


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
        return _answer(free, options, {}, "even without terrain")
    to_go = first_time_to_go(case)
    starts = _from_either_side(free, case.tof_s - to_go)
    best = min(starts, key=lambda solved: solved.cost)

    def solve(time_to_go_s: float) -> tuple[float, _Solved]:
        nonlocal best
        solved = _solve(replace(best.flight, entry_s=case.tof_s - time_to_go_s), best, _ROUGH)
        best = min(best, solved, key=lambda one: one.cost)
        return solved.cost, solved

    to_go, coarse, tried = least_cost_time_to_go(solve, to_go, case.tof_s)
    _, thrust, _ = unpacked(coarse.flight, coarse.solution.x)
    times = refined_times(coarse.flight.times_s, thrust, options.nodes)
    fine = replace(coarse.flight, times_s=times, samples=CHECK_SAMPLES, bucket=_BUCKET)
    solved = _solve(fine, coarse, _FINE)
    rounds = free.solution.rounds + sum(one.solution.rounds for one in starts) + solved.solution.rounds
    searched: dict[str, Parameter] = {
        "cone_entry_bound_s": case.tof_s - to_go,
        "cone_entries_tried_s": [case.tof_s - one for one, _ in tried],
        "cone_entries_cost": [cost for _, cost in tried],
        "starts_cost": [one.cost for one in starts],
        "fuel_without_terrain_kg": _fuel_kg(free),
        "rounds_last": solved.solution.rounds,
    }
    return _answer(solved, options, searched, "", rounds)


def _without_terrain(case: PlanCase, options: ConvexOptions) -> _Solved:
    """The optimum with neither clearance nor cone, from a cubic: a lower bound, and a first path."""
    times = np.linspace(0.0, case.tof_s, _COARSE_NODES)
    flight = FreeFlight(case, times, np.inf, _COARSE_SAMPLES, 1, options.objective, options.terminal)
    return _Solved(
        flight, solve_cone_program(free_flight_program(flight), packed(flight, *_cubic(case, times)), _FINE)
    )


def _cubic(case: PlanCase, times_s: FloatArray) -> tuple[FloatArray, FloatArray]:
    """States on the cubic between the boundary states, and no thrust."""
    s, tof = (times_s / case.tof_s)[:, None], case.tof_s
    r0, r1 = case.position_m, case.site.position_m
    d0, d1 = tof * case.velocity_m_s, tof * case.landing_velocity_m_s
    square, cubic = 3.0 * (r1 - r0) - 2.0 * d0 - d1, d0 + d1 - 2.0 * (r1 - r0)
    r = r0 + s * (d0 + s * (square + s * cubic))
    v = (d0 + s * (2.0 * square + 3.0 * s * cubic)) / tof
    return np.concatenate([r, v], axis=1), np.zeros_like(r)


def _from_either_side(free: _Solved, entry_s: float) -> list[_Solved]:
    """Solve from the free path, pushed out of the body and bent to its other side."""
    flight = replace(free.flight, entry_s=entry_s)
    states, thrust, _ = unpacked(free.flight, free.solution.x)
    solved = []
    for path in starting_paths(flight.case, flight.times_s, states[:, :3], entry_s):
        start = packed(flight, np.concatenate([path, states[:, 3:]], axis=1), thrust)
        solved.append(_Solved(flight, solve_cone_program(free_flight_program(flight), start, _ROUGH)))
    return solved


def _solve(flight: FreeFlight, start: _Solved, options: ConeOptions) -> _Solved:
    """Solve from the solution of another flight, interpolated to the nodes."""
    states, thrust, _ = unpacked(start.flight, start.solution.x)
    columns = np.concatenate([states, thrust], axis=1).T
    at_nodes = np.stack(
        [np.interp(flight.times_s, start.flight.times_s, column) for column in columns], axis=1
    )
    x = packed(flight, at_nodes[:, :6], at_nodes[:, 6:])
    return _Solved(flight, solve_cone_program(free_flight_program(flight), x, options))


def _fuel_kg(solved: _Solved) -> float:
    case = solved.flight.case
    spent = solved.solution.x[solved.flight.columns[-1, SPENT]] * solved.flight.acceleration_m_s2 * case.tof_s
    ratio = spent / case.spacecraft.exhaust_velocity_m_s
    share = ratio if case.mass_model == "constant" else -np.expm1(-ratio)
    return float(case.spacecraft.mass_kg * share)


def _answer(
    solved: _Solved, options: ConvexOptions, searched: dict[str, Parameter], where: str, rounds: int = 0
) -> Plan:
    """Fly the control again and tell what it keeps."""
    flight, solution = solved.flight, solved.solution
    _, thrust, excess = unpacked(flight, solution.x)
    status: PlanStatus = "unresolved" if solution.status == "unresolved" else "infeasible"
    because = f"successive convexification: {solution.message}"
    if excess > EXCESS_TOLERANCE and status == "infeasible":
        because = " ".join(["the least thrust found is not enough", where]).strip()
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
        iterations=rounds or solution.rounds,
        parameters=parameters,
        otherwise=status,
        because=because,
    )

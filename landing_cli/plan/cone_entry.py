"""Search of the time at which the path enters the cone: one number outside the smooth program."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from landing_cli.body.gravity.field import GravityKind
from landing_cli.body.gravity.point_mass import point_mass_field
from landing_cli.optimize.cone_program import ConeOptions, ConeProgram, ConeSolution, solve_cone_program
from landing_cli.plan.records import PlanCase

Answer = TypeVar("Answer")

FloatArray = NDArray[np.float64]

_FACTOR = 1.3
_MOVES = 8  # a factor of 8 either way
_REFINEMENTS = 2
_PRICE = 10.0
ROUGH = ConeOptions(progress_tol=3e-4, violation_tol=1e-5, price=_PRICE, price_max=_PRICE, max_rounds=25)
FINE = ConeOptions(progress_tol=1e-5, violation_tol=3e-8, price=_PRICE, price_max=1e4)


@dataclass(frozen=True, eq=False)
class EntrySearch:
    """What a search came to.

    Attributes
    ----------
    entry_s : float, s
        The cone entry of least cost.
    solution : ConeSolution
        Rough, with that entry.
    starts_cost : list of float
        Scaled cost from each start at the first entry, violations at a price included.
    tried_s, tried_cost : list of float
        Entries in the order of the search, and their costs.
    rounds : int
        Cone programs solved.
    """

    entry_s: float
    solution: ConeSolution
    starts_cost: list[float]
    tried_s: list[float]
    tried_cost: list[float]
    rounds: int


def search_cone_entry(
    case: PlanCase,
    program_of: Callable[[float], ConeProgram],
    starts: Sequence[FloatArray],
    first_s: float,
) -> EntrySearch:
    """Solve a landing roughly from every start, and from the best of them over the time of cone entry.

    Parameters
    ----------
    case : PlanCase
        Clearance, thrust and time of flight.
    program_of : callable
        ``program_of(entry_s)`` is the program with that entry; its unknowns keep their places.
    starts : sequence of (m,) float
        Scaled unknowns.
    first_s : float, s
        Time to go at the first entry.

    Returns
    -------
    EntrySearch
    """
    rounds = 0
    best: ConeSolution | None = None

    def solve(time_to_go_s: float, start: FloatArray | None = None) -> tuple[float, ConeSolution]:
        nonlocal best, rounds
        if start is None:
            assert best is not None  # every start has been solved
            start = best.x
        solution = solve_cone_program(program_of(case.tof_s - time_to_go_s), start, ROUGH)
        rounds += solution.rounds
        if best is None or priced(solution) < priced(best):
            best = solution
        return priced(solution), solution

    starts_cost = [solve(first_s, start)[0] for start in starts]
    to_go, solution, tried = least_cost_time_to_go(solve, first_s, case.tof_s)
    return EntrySearch(
        case.tof_s - to_go,
        solution,
        starts_cost,
        [case.tof_s - one for one, _ in tried],
        [cost for _, cost in tried],
        rounds,
    )


def priced(solution: ConeSolution) -> float:
    """Objective of a rough solution, violations at their price included."""
    return solution.value + _PRICE * solution.rows.total


def search_case(case: PlanCase) -> PlanCase:
    """Give a case a field that is cheap enough to search in.

    Parameters
    ----------
    case : PlanCase
        What is asked.

    Returns
    -------
    PlanCase
        In a polyhedral field, the case in that of the same mass in a point: the best time of cone entry moves
        by seconds, and evaluating thousands of facets at every node of every trial is saved. The last solve
        is always in the case's own field. Otherwise the case itself.
    """
    if case.asteroid.gravity.kind != GravityKind.POLYHEDRON:
        return case
    return replace(case, asteroid=replace(case.asteroid, gravity=point_mass_field(case.asteroid.gm_m3_s2)))


def first_time_to_go(case: PlanCase) -> float:
    """Time to go at the cone entry with which a search begins, s: braking from h_min at full thrust.

    Parameters
    ----------
    case : PlanCase
        Clearance, thrust and mass.

    Returns
    -------
    float, s
        Twice the time in which the thrust alone crosses the clearance, between 2 % and half of the flight.
    """
    acceleration = case.spacecraft.thrust_max_n / case.spacecraft.mass_kg
    fall = 2.0 * math.sqrt(max(case.clearance_m, 0.0) / acceleration)
    return min(max(fall, 0.02 * case.tof_s), 0.5 * case.tof_s)


def least_cost_time_to_go(
    solve: Callable[[float], tuple[float, Answer]], first_s: float, longest_s: float
) -> tuple[float, Answer, list[tuple[float, float]]]:
    """Find the time to go at the cone entry that costs least, by steps downhill and parabolas.

    Parameters
    ----------
    solve : callable
        ``solve(time_to_go_s)`` gives a cost and an answer; called in the order of the search.
    first_s : float, s
        Where to begin.
    longest_s : float, s
        Not beyond this.

    Returns
    -------
    time_to_go_s : float, s
    answer
        What ``solve`` gave there.
    tried : list of (float, float)
        Times to go, s, and their costs, in the order of the search.
    """
    answers: dict[float, tuple[float, Answer]] = {}

    def cost(log_s: float) -> float:
        if log_s not in answers:
            answers[log_s] = solve(math.exp(log_s))
        return answers[log_s][0]

    step, top = math.log(_FACTOR), math.log(longest_s)
    middle = min(math.log(first_s), top)
    for _ in range(_MOVES):
        below, above = middle - step, min(middle + step, top)
        if cost(middle) <= min(cost(above), cost(below)):
            break
        middle = above if cost(above) < cost(below) else below
    for _ in range(_REFINEMENTS):
        place = sorted(answers).index(middle)
        around = sorted(answers)[max(place - 1, 0) : place + 2]
        if len(around) < 3:
            break
        lowest = _vertex(*around, *(cost(x) for x in around))
        if min(abs(lowest - x) for x in around) < 0.05 * step:
            break
        if cost(lowest) < cost(middle):
            middle = lowest
    tried = [(math.exp(x), answer[0]) for x, answer in answers.items()]
    return math.exp(middle), answers[middle][1], tried


def _vertex(a: float, b: float, c: float, fa: float, fb: float, fc: float) -> float:
    """Least point of the parabola through three points a < b < c, of which the middle one is lowest."""
    left, right = (fb - fa) / (b - a), (fc - fb) / (c - b)
    if right - left <= 0.0:
        return b
    slope_at_b = (left * (c - b) + right * (b - a)) / (c - a)
    lowest = b - slope_at_b * (c - a) / (2.0 * (right - left))
    return min(max(lowest, 0.5 * (a + b)), 0.5 * (b + c))

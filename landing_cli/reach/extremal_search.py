"""Facets by extremals: a trust-region SQP over the seven initial costates.

Beyond the free end of the horizon nothing is relaxed: the SQP moves the costates of exact extremals until the
two-stage landing meets every row of ``extremal_terms`` at the least energy. The kernels of its rounds are
called by address (`kernel_address`), so that they compile side by side.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np
from numba import types
from numpy.typing import NDArray

from landing_cli.flight.extremal import thrust_ratio
from landing_cli.kernel import inlined, kernel, part
from landing_cli.kernel_address import Callee, call
from landing_cli.kernel_record import by_reference
from landing_cli.optimize.sqp import propose
from landing_cli.reach.extremal_facet import (
    Flight,
    N,
    Search,
    Trial,
    new_flight,
    new_search,
    renew_model,
    try_costates,
)
from landing_cli.reach.extremal_terms import (
    MAX_ROWS,
    N_ARC,
    ROW_DIPS,
    ROW_GLIDE,
    ROW_HANDOVER,
    ROW_PROPELLANT,
    ExtremalProblem,
    glide_weights,
)
from landing_cli.reach.records import Binding

_types: Any = types  # not typed

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

UNCONVERGED, OPTIMAL, STUCK = 0, 1, 2

FEASIBLE = 1e-7  # sum of violations
SETTLED = 1e-9  # of the merit: nothing more is expected
HOPELESS = 1e-4  # of the violation: a full step expects no less of it
MAX_ROUNDS = 120
FIRST_PRICE, LAST_PRICE = 10.0, 1e3
FIRST_REACH, FULL_REACH, LONGEST_REACH, SHORTEST_REACH = 0.5, 1e-2, 4.0, 1e-10
MOST_PROBES = 3

# Where the thrust is at its bound throughout, the costates' size means nothing and the energy is flat. A
# search that ends there goes on from costates small enough to throttle somewhere, at most so often.
PLATEAUS, OFF_PLATEAU = 2, 0.9

_THRUST, _ELLIPSOID, _GLIDE_SLOPE, _PROPELLANT, _HANDOVER = (
    int(b) - 1
    for b in (
        Binding.THRUST,
        Binding.ELLIPSOID,
        Binding.GLIDE_SLOPE,
        Binding.PROPELLANT,
        Binding.HANDOVER,
    )
)


@by_reference
class Searcher(NamedTuple):
    """Everything that a search works in; allocated once and used for many facets."""

    search: Search
    here: Flight
    there: Flight
    spare: Flight
    costates: Floats  # (7,) of the facet
    trial: Floats  # (7,) costates that are tried
    corrected: Floats  # (7,) step
    kept: Floats  # (MAX_ROWS,) values
    multipliers: Floats  # (MAX_ROWS,) of a correction
    pressure: Floats  # (6,) by Binding, at the end
    try_costates: Callee
    renew_model: Callee
    propose: Callee


@by_reference
class Found(NamedTuple):
    """What the searches of a batch found."""

    status: Ints  # (n,) OPTIMAL, STUCK or UNCONVERGED
    rounds: Ints  # (n,)
    energy: Floats  # (n,) J over a0^2 t_p
    broken: Floats  # (n,) violation
    costates: Floats  # (n, 7)
    pressure: Floats  # (n, 6) by Binding: what loosening it by a relative unit takes off J


def new_found(size: int) -> Found:
    """Return a zeroed batch."""
    return Found(
        np.zeros(size, dtype=np.int64),
        np.zeros(size, dtype=np.int64),
        np.zeros(size),
        np.zeros(size),
        np.zeros((size, N)),
        np.zeros((size, len(Binding) - 1)),
    )


class Ended(NamedTuple):
    """How a search ended: ``OPTIMAL``, ``STUCK`` (a local least of the violation) or ``UNCONVERGED``."""

    status: int
    rounds: int
    energy: float  # J over a0^2 t_p
    broken: float
    least: float  # thrust that the costates ask for along the extremal; it is bounded at 1


def new_searcher(problem: ExtremalProblem, n_steps: int) -> Searcher:
    """Allocate what searches the facets of one case, flown with ``n_steps`` steps."""
    search = new_search(problem, n_steps)
    here, there, spare = (new_flight(problem.field, n_steps) for _ in range(3))
    costates, number, rows = np.zeros(N), 0, np.zeros(MAX_ROWS)
    trial = _types.NamedTuple((_types.int64, _types.int64, _types.float64, _types.float64), Trial)
    return Searcher(
        search,
        here,
        there,
        spare,
        costates,
        np.zeros(N),
        np.zeros(N),
        np.zeros(MAX_ROWS),
        rows,
        np.zeros(len(Binding) - 1),
        Callee(try_costates, trial, problem, costates, here, search),
        Callee(renew_model, _types.none, problem, here, Trial(0, 0, 0.0, 0.0), number, search),
        Callee(propose, _types.float64, search.model, number, 0.0, costates, costates, rows),
    )


@inlined
def _correct(flight: Flight, rows: int, price: float, searcher: Searcher) -> None:
    """Second-order correction: aim again, from what the rows turned out to be after the step."""
    search, kept, step = searcher.search, searcher.kept, searcher.corrected
    model = search.model
    for r in range(rows):
        kept[r], model.values[r] = model.values[r], flight.values[r]
        for a in range(N):
            model.values[r] -= model.jacobian[r, a] * search.step[a]
    call(searcher.propose, (model, rows, price, search.radius, step, searcher.multipliers))
    for r in range(rows):
        model.values[r] = kept[r]


@inlined
def _take_step(
    problem: ExtremalProblem,
    now: Trial,
    price: float,
    expected: float,
    there: Flight,
    spare: Flight,
    searcher: Searcher,
) -> tuple[Trial, float, bool]:
    """Fly the proposed step, or its correction where that is better.

    Returns
    -------
    trial : Trial
    ratio : float
        How much the merit fell, over what was expected.
    corrected : bool
        Whether the trial is the corrected one, flown in ``spare``.
    """
    search, costates, trial, step = searcher.search, searcher.costates, searcher.trial, searcher.corrected
    for a in range(N):
        trial[a] = costates[a] + search.step[a]
    then = call(searcher.try_costates, (problem, trial, there, search))
    ratio = (now.energy - then.energy + price * (now.broken - then.broken)) / expected
    if ratio >= 0.5 or then.rows != now.rows:
        return then, ratio, False
    _correct(there, now.rows, price, searcher)
    for a in range(N):
        trial[a] = costates[a] + step[a]
    other = call(searcher.try_costates, (problem, trial, spare, search))
    better = (now.energy - other.energy + price * (now.broken - other.broken)) / expected
    if better <= ratio:
        return then, ratio, False
    for a in range(N):
        search.step[a] = step[a]
    return other, better, True


@inlined
def _pressures(
    problem: ExtremalProblem, target: Floats, flight: Flight, multipliers: Floats, out: Floats
) -> None:
    """Gather the multipliers by constraint; a saturated descent presses by rho - 1 per unit of time."""
    extremal = flight.extremal
    for b in range(out.shape[0]):
        out[b] = 0.0
    k, t = 0, 0.0
    while t < 1.0 - 1e-12:
        h = extremal.step[k]
        if extremal.saturated[k]:
            ahead, _ = thrust_ratio(problem.field.scale.flow, False, extremal.state[k + 1])
            behind, _ = thrust_ratio(problem.field.scale.flow, False, extremal.state[k])
            out[_THRUST] += 0.5 * h * max(ahead + behind - 2.0, 0.0)
        t += h
        k += 1
    x = extremal.state[k]
    for j in range(N_ARC):
        out[_THRUST] += multipliers[j]
    for end in range(2):
        wd, wv = glide_weights(end, problem.final_time)
        square = 0.0
        for i in range(3):
            square += (wd * (x[i] - target[i]) + wv * x[3 + i]) ** 2
        # per relative unit of the half-angle's tangent
        loosened = problem.cos_half_angle * (1.0 - problem.cos_half_angle**2) * math.sqrt(square)
        out[_GLIDE_SLOPE] += multipliers[ROW_GLIDE + end] * loosened
    at_handover = abs(multipliers[ROW_HANDOVER])
    out[_HANDOVER if problem.on_ellipsoid else _ELLIPSOID] += at_handover
    out[_PROPELLANT] += multipliers[ROW_PROPELLANT] * problem.propellant
    for r in range(ROW_DIPS, MAX_ROWS):
        out[_ELLIPSOID] += multipliers[r]


@inlined
def _least_ratio(flow: float, flight: Flight) -> float:
    """Least thrust that the costates ask for along an extremal; above 1 it is at its bound throughout."""
    extremal = flight.extremal
    least, _ = thrust_ratio(flow, False, extremal.state[0])
    k, t = 0, 0.0
    while t < 1.0 - 1e-12:
        least = min(least, thrust_ratio(flow, False, extremal.state[k + 1])[0])
        t += extremal.step[k]
        k += 1
    return least


@part
def search_extremal(problem: ExtremalProblem, searcher: Searcher) -> Ended:
    """Improve the initial costates for one facet.

    Parameters
    ----------
    problem : ExtremalProblem
        The case.
    searcher : Searcher
        Its costates are the start, and the best ones on return; the multipliers, and what they press by
        constraint, belong to these.

    Returns
    -------
    Ended
    """
    search, costates = searcher.search, searcher.costates
    here, there, spare = searcher.here, searcher.there, searcher.spare
    price, reach, probes = FIRST_PRICE, FIRST_REACH, 0
    fresh, old_rows, status, rounds = True, 0, UNCONVERGED, 0
    for r in range(MAX_ROWS):
        search.multipliers[r] = 0.0
    now = call(searcher.try_costates, (problem, costates, here, search))
    while rounds < MAX_ROUNDS:
        rounds += 1
        if fresh:
            call(searcher.renew_model, (problem, here, now, old_rows, search))
            fresh = False
        size = 1.0
        for a in range(6):
            size = max(size, abs(costates[a]))
        for a in range(N):
            search.radius[a] = reach * size
        program = search.model, now.rows, price, search.radius, search.step, search.multipliers
        expected = call(searcher.propose, program)
        if now.broken < FEASIBLE and expected < SETTLED * (1.0 + abs(now.energy)):
            status = OPTIMAL
            break
        if now.broken >= FEASIBLE and expected < max(SETTLED, HOPELESS * price * now.broken):
            if reach < FULL_REACH and probes < MOST_PROBES:
                reach, probes = 2.0 * FULL_REACH, probes + 1
            elif price < LAST_PRICE:
                price *= 10.0
            else:
                status = STUCK
                break
            continue
        then, ratio, corrected = _take_step(problem, now, price, expected, there, spare, searcher)
        if corrected:
            there, spare = spare, there
        longest = 0.0
        for a in range(N):
            longest = max(longest, abs(search.step[a]))
        if ratio > 1e-3:
            old_rows, now, fresh = now.rows, then, True
            here, there = there, here
            for a in range(N):
                costates[a] += search.step[a]
        if ratio > 0.75:
            reach = max(reach, min(3.0 * longest / size, LONGEST_REACH))
        elif not ratio >= 0.25:
            reach = 0.25 * longest / size
            if reach < SHORTEST_REACH:
                break
    _pressures(problem, search.target, here, search.multipliers, searcher.pressure)
    return Ended(status, rounds, now.energy, now.broken, _least_ratio(problem.field.scale.flow, here))


@inlined
def _is_better(ended: Ended, status: int, energy: float, broken: float) -> bool:
    """Whether a search ended better than the best before it."""
    if ended.status == OPTIMAL and status == OPTIMAL:
        return ended.energy < energy
    return ended.status == OPTIMAL or (status != OPTIMAL and ended.broken < broken)


@kernel
def search_batch(
    problem: ExtremalProblem,
    targets: Floats,
    normals: Floats,
    starts: Floats,
    guards: Floats,
    searcher: Searcher,
    found: Found,
) -> None:
    """Search for the best extremal of each facet.

    Parameters
    ----------
    problem : ExtremalProblem
        The case.
    targets : (n, 3) float, scaled, body frame
        Touchdown points.
    normals : (n, 3) float
        Outward unit normals.
    starts : (n, k, 7) float, scaled
        Costates to start from, tried in turn until one leads to an optimum; NaN rows are passed over.
    guards : (n,) float
        Kept from the thrust bound of the final arc, for what the thrust bulges between the points.
    searcher : Searcher
        Work space for the case.
    found : Found
        Filled.
    """
    search, costates = searcher.search, searcher.costates
    for i in range(targets.shape[0]):
        found.status[i], found.broken[i], found.energy[i] = UNCONVERGED, math.inf, math.inf
        search.guard[0] = guards[i]
        for a in range(3):
            search.target[a], search.normal[a] = targets[i, a], normals[i, a]
        for s in range(starts.shape[1]):
            given = True
            for a in range(7):
                costates[a] = starts[i, s, a]
                given = given and math.isfinite(costates[a])
            if not given:
                continue
            for _ in range(1 + PLATEAUS):
                ended = search_extremal(problem, searcher)
                found.rounds[i] += ended.rounds
                if _is_better(ended, found.status[i], found.energy[i], found.broken[i]):
                    found.status[i], found.energy[i] = ended.status, ended.energy
                    found.broken[i] = ended.broken
                    for a in range(7):
                        found.costates[i, a] = costates[a]
                    for b in range(searcher.pressure.shape[0]):
                        found.pressure[i, b] = searcher.pressure[b]
                if ended.status != OPTIMAL or ended.least <= 1.0:
                    break
                for a in range(7):  # step off the plateau
                    costates[a] *= OFF_PLATEAU / ended.least
            if found.status[i] == OPTIMAL:
                break

"""Beam search over sequences of flybys.

Each level extends the best partial chains by one flyby: the whole catalogue is screened along each coast by
its linear sensitivity to a burn, what is cheap is solved exactly, and the dates of the whole chain are then
improved together. The first leg is flown in N-body throughout, later legs are heliocentric conics.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from landing_cli.errors import PartialResult
from landing_cli.flight.astronomy import DAY_S
from landing_cli.parallel import LostChunk
from landing_cli.sources.catalogue_records import Catalogue
from landing_cli.tour.beam import Chains, SearchSpace, extended, joined
from landing_cli.tour.chain_kernel import Bounds
from landing_cli.tour.ephemeris import Ephemeris
from landing_cli.tour.first_level import (
    ROUNDS,
    distinct_first_legs,
    first_fan,
    seen_from_fan,
    shot,
)
from landing_cli.tour.found_chains import outcome_of
from landing_cli.tour.records import BeamOptions, Departure, DepthReport, SearchLimits, SearchOutcome
from landing_cli.tour.target_table import TargetTable, target_table

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]
Run = Callable[[Callable[[Any], Any], Sequence[Any]], Iterable[tuple[int, Any]]]

CHUNK_TARGETS, CHUNK_FLIGHTS, CHUNK_SHOTS, CHUNK_CHAINS = 500, 20, 50, 10
FINAL_ROUNDS = 60
"""Steps that improve the dates of a chosen chain."""
WAIT_MAX_S = 250.0 * DAY_S
FIRST_LEGS = 8
"""First legs flown exactly, for each chain of the beam."""
SAME_FLYBY_S = 20.0 * DAY_S
"""Chains of the same targets are kept apart where their last flybys are."""
TIME_WEIGHT = 0.7
"""How much the share of the time that a partial chain has used counts beside the share of its burns."""


def serial(work: Callable[[Any], Any], chunks: Sequence[Any]) -> Iterable[tuple[int, Any]]:
    """Run chunks one after the other.

    Parameters
    ----------
    work : callable
        Takes a chunk.
    chunks : sequence
        Chunks.

    Yields
    ------
    (int, answer)
    """
    for index, chunk in enumerate(chunks):
        yield index, work(chunk)


def search(
    catalogue: Catalogue,
    departure: Departure,
    limits: SearchLimits,
    options: BeamOptions,
    ephemeris: Ephemeris,
    run: Run = serial,
    progress: Callable[[DepthReport], None] = lambda _: None,
) -> SearchOutcome:
    """Search chains of flybys.

    Parameters
    ----------
    catalogue : Catalogue
        The targets.
    departure : Departure
        Where the spacecraft sets out.
    limits : SearchLimits
        What every chain keeps to.
    options : BeamOptions
        Width and grid.
    ephemeris : Ephemeris
        From the epochs of the catalogue to the end of the flight.
    run : callable
        Runs a function on chunks of work and yields (index, answer) in any order.
    progress : callable
        Told what each level found.

    Returns
    -------
    SearchOutcome
        Hints, not yet flown in N-body beyond their first leg.

    Raises
    ------
    PartialResult
        A worker was lost.
    """
    space = search_space(catalogue, departure, limits, options, ephemeris, run)
    levels: list[Chains] = []
    reports: list[DepthReport] = []
    nearest: Chains | None = None
    while len(levels) < limits.asteroids_max:
        if levels:
            found = _joined_or_none(
                gather(run, partial(_extend, levels[-1], space), len(levels[-1]), CHUNK_CHAINS)
            )
        else:
            found = first_level(departure, limits, options, space, run)
        if found is None:
            break
        within = found.take(np.flatnonzero(found.cost_m_s <= space.limit_m_s))
        kept = choose(within, departure.t_s, space, options.beam)
        if len(kept):
            settle = partial(shot, kept, space, FINAL_ROUNDS)
            kept = _within(joined(gather(run, settle, len(kept), CHUNK_SHOTS)), space)
        elif not levels:
            nearest = found.take(np.argsort(found.cost_m_s, kind="stable")[:1])
        least = kept if len(kept) else found
        report = DepthReport(
            asteroids=found.length,
            tried=len(found),
            within_limits=len(within),
            kept=len(kept),
            least_delta_v_m_s=float(least.cost_m_s.min()),
        )
        reports.append(report)
        progress(report)
        if not len(kept):
            break
        levels.append(kept)
    return outcome_of(levels, nearest, tuple(reports), catalogue, departure, options.kept_chains)


def search_space(
    catalogue: Catalogue,
    departure: Departure,
    limits: SearchLimits,
    options: BeamOptions,
    ephemeris: Ephemeris,
    run: Run,
) -> SearchSpace:
    """Tabulate the targets and gather what every level needs.

    Parameters
    ----------
    catalogue : Catalogue
        The targets.
    departure : Departure
        Where the spacecraft sets out.
    limits : SearchLimits
        What every chain keeps to.
    options : BeamOptions
        Width and grid.
    ephemeris : Ephemeris
        From the epochs of the catalogue to the end of the flight.
    run : callable
        Runs chunks.

    Returns
    -------
    SearchSpace
    """
    work = partial(_tabulate, catalogue, departure.t_s, limits.end_t_s, options.time_step_s, ephemeris)
    tables = gather(run, work, len(catalogue), CHUNK_TARGETS)
    table = TargetTable(
        tables[0].node_t_s,
        np.concatenate([part.node_states for part in tables]),
        tables[0].grid_t_s,
        np.concatenate([part.grid_m for part in tables]),
    )
    bounds = Bounds(
        end_t_s=np.array([limits.end_t_s]),
        turns_max=np.array([limits.revolutions_max]),
        wait_max_s=np.array([WAIT_MAX_S]),
        earth_m=np.array([limits.geocentric_distance_m]),
    )
    return SearchSpace(
        table, bounds, ephemeris, limits.delta_v_m_s, np.array(options.waits_s), options.branches
    )


def first_level(
    departure: Departure, limits: SearchLimits, options: BeamOptions, space: SearchSpace, run: Run
) -> Chains | None:
    """Find the targets that one burn reaches.

    Parameters
    ----------
    departure : Departure
        Where the spacecraft sets out.
    limits : SearchLimits
        What every chain keeps to.
    options : BeamOptions
        Width and grid.
    space : SearchSpace
        Targets and bounds.
    run : callable
        Runs chunks.

    Returns
    -------
    Chains or None
        Of one flyby, their legs flown in N-body; None where no target is near.
    """
    fan = first_fan(departure, limits.first_burn_wait_s, space)
    count = len(fan.coasts.first)
    wanted = FIRST_LEGS * options.beam
    keep = max(options.branches, 4 * wanted // count, 60)
    near = _joined_or_none(gather(run, partial(seen_from_fan, fan, space, keep), count, CHUNK_FLIGHTS))
    if near is None:
        return None
    chosen = distinct_first_legs(near, space, wanted)
    return _joined_or_none(gather(run, partial(shot, chosen, space, ROUNDS), len(chosen), CHUNK_SHOTS))


def choose(found: Chains, start_t_s: float, space: SearchSpace, beam: int) -> Chains:
    """Choose the chains that the search goes on from.

    Parameters
    ----------
    found : Chains
        Within the limits.
    start_t_s : float, s
        Departure.
    space : SearchSpace
        Limits.
    beam : int
        Chains at most.

    Returns
    -------
    Chains
        Those that have used least of burns and time, no sequence of targets twice.
    """
    spent = found.cost_m_s / space.limit_m_s
    late = (found.arrival_t_s - start_t_s) / (space.bounds.end_t_s[0] - start_t_s)
    order = np.argsort(spent + TIME_WEIGHT * late, kind="stable")
    cells = np.column_stack([found.targets, np.round(found.arrival_t_s / SAME_FLYBY_S)])
    _, place = np.unique(cells[order], axis=0, return_index=True)
    return found.take(order[np.sort(place)[:beam]])


def gather(run: Run, work: Callable[[IntArray], Any], count: int, size: int) -> list[Any]:
    """Run a function on all of some items, and put its answers in order.

    Parameters
    ----------
    run : callable
        Runs chunks.
    work : callable
        Takes indices.
    count : int
        Items.
    size : int
        Items a chunk.

    Returns
    -------
    list
        Answers in the order of the items.

    Raises
    ------
    PartialResult
        A worker was lost.
    """
    chunks = [np.arange(i, min(i + size, count)) for i in range(0, count, size)]
    answers: list[tuple[int, int, Any]] = []
    for index, answer in run(work, chunks):
        if isinstance(answer, LostChunk):
            raise PartialResult(f"a part of the search was lost: {answer.reason}", fix="run it again")
        answers.append((index, len(answers), answer))
    return [answer for _, _, answer in sorted(answers, key=lambda item: item[:2])]


def _tabulate(
    catalogue: Catalogue,
    start_t_s: float,
    end_t_s: float,
    step_s: float,
    ephemeris: Ephemeris,
    rows: IntArray,
) -> TargetTable:
    return target_table(catalogue.elements.rows(rows), start_t_s, end_t_s, step_s, ephemeris)


def _extend(chains: Chains, space: SearchSpace, rows: IntArray) -> Chains:
    return extended(chains.take(rows), space, ROUNDS)


def _joined_or_none(parts: list[Chains]) -> Chains | None:
    whole = joined(parts) if parts else None
    return whole if whole is not None and len(whole) else None


def _within(chains: Chains, space: SearchSpace) -> Chains:
    """Chains within the limit, the cheapest first."""
    order = np.argsort(chains.cost_m_s, kind="stable")
    return chains.take(order[chains.cost_m_s[order] <= space.limit_m_s])

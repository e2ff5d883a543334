"""`tour search`, step by step: case, search, flights in N-body, the file."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from contextlib import closing
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from landing_cli import __version__
from landing_cli.compile_cache import is_cached
from landing_cli.parallel import LostChunk, WorkPlan, run_chunks
from landing_cli.results.identity import RunIdentity
from landing_cli.results.journal import Journal
from landing_cli.results.output import finish_output, open_output
from landing_cli.results.provenance import Stopwatch
from landing_cli.results.store import read
from landing_cli.scenario.load import LoadedTour
from landing_cli.scenario.show import to_yaml
from landing_cli.tour.cases import TourCase
from landing_cli.tour.compare import printed_days, schemes_of
from landing_cli.tour.escape_records import EscapeRun
from landing_cli.tour.flight_path import sampled_path
from landing_cli.tour.nbody import fly_batch
from landing_cli.tour.recorded import (
    chain_from_arrays,
    chain_to_arrays,
    outcome_from_arrays,
    outcome_to_arrays,
)
from landing_cli.tour.records import BeamOptions, DepthReport, FlybyChain, SearchOutcome
from landing_cli.tour.redating import improve_dates
from landing_cli.tour.reflight import refly
from landing_cli.tour.run_records import ChainEntry, ChainPath, TourRun
from landing_cli.tour.stored import MISSION, run_from_result, run_to_tree, used_targets
from landing_cli.tour.summary import best_first

COMPILING = "compiling the kernels (once after an installation; about half a minute)"
SEARCHED = "search"
BEYOND = 10.0
"""Where nothing keeps to the limit: how many times its delta-v is searched for what came nearest."""

Run = Callable[[Callable[[Any], Any], Sequence[Any]], Iterator[tuple[int, Any]]]

Windows = Sequence[tuple[float, float]]
Found = tuple[FlybyChain, ChainPath | None]


@dataclass(frozen=True, eq=False)
class Request:
    """What a tour command is asked.

    Attributes
    ----------
    command : str
        ``tour search``, ``tour compare`` or ``tour escape``.
    loaded : LoadedTour
    case : TourCase
    """

    command: str
    loaded: LoadedTour
    case: TourCase


@dataclass(frozen=True)
class RunOptions:
    """How a run is carried out."""

    plan: WorkPlan
    resume: bool = False
    force: bool = False


@dataclass(frozen=True)
class Outcome:
    """A run, whether its result was there already, and why flights were lost, by their targets."""

    run: TourRun | EscapeRun
    up_to_date: bool
    lost: dict[str, str]


def run_search(
    request: Request,
    output: Path,
    options: RunOptions,
    progress: Callable[[int, int], None],
    say: Callable[[str], None] = lambda _: None,
) -> Outcome:
    """Search chains of flybys, fly each in N-body, and store those that hold.

    Parameters
    ----------
    request : Request
        What was asked.
    output : Path
        Where the result goes.
    options : RunOptions
        Backend, resume, force.
    progress : callable
        Told (flown, total) chains.
    say : callable
        Told one line a length of chain: how far the search looked, and the best so far.

    Returns
    -------
    Outcome
        The run as stored.

    Raises
    ------
    LandingError
        The output is refused.
    """
    return _stored_run(request, output, options, say, partial(_search_and_fly, progress=progress, say=say))


def run_compare(
    request: Request,
    output: Path,
    options: RunOptions,
    progress: Callable[[int, int], None],
    say: Callable[[str], None] = lambda _: None,
) -> Outcome:
    """Fly the paper's schemes in N-body, asteroid by asteroid on the stated days, and store them.

    Parameters
    ----------
    request : Request
        What was asked.
    output : Path
        Where the result goes.
    options : RunOptions
        Backend, resume, force.
    progress : callable
        Told (flown, total) schemes.
    say : callable
        Told one line when something takes a while.

    Returns
    -------
    Outcome
        The run as stored.

    Raises
    ------
    LandingError
        The output is refused.
    """
    return _stored_run(request, output, options, say, partial(_fly_schemes, progress=progress))


Work = Callable[[TourCase, Journal, WorkPlan], tuple[TourRun, dict[str, str]]]


def _stored_run(
    request: Request, output: Path, options: RunOptions, say: Callable[[str], None], work: Work
) -> Outcome:
    watch = Stopwatch()
    case = request.case
    text = to_yaml(request.loaded.scenario)
    identity = RunIdentity(request.command, text, case.catalogue.sha256, __version__, chunk_facets=1)
    journal = open_output(output, identity, resume=options.resume, force=options.force)
    if journal is None:
        return Outcome(run_from_result(read(output)), up_to_date=True, lost={})
    with journal:
        if not is_cached(fly_batch):
            say(COMPILING)
        found, lost = work(case, journal, options.plan)
        taken = {"jobs": options.plan.jobs, "backend": options.plan.backend, "resumed": int(options.resume)}
        provenance = watch.provenance(**taken)
        finish_output(journal, run_to_tree(found), {"mission": MISSION}, provenance, complete=not lost)
    return Outcome(found, up_to_date=False, lost=lost)


def _search_and_fly(
    case: TourCase,
    journal: Journal,
    plan: WorkPlan,
    progress: Callable[[int, int], None],
    say: Callable[[str], None],
) -> tuple[TourRun, dict[str, str]]:
    outcome = _searched(case, journal, plan, say)
    nearest = () if outcome.nearest is None else (outcome.nearest,)
    targets, hints = used_targets([*outcome.chains, *nearest], case.targets)
    found, lost = _flown(
        replace(case, targets=targets), hints[: len(outcome.chains)], journal, plan, progress
    )
    holding = [pair for pair in found if pair[0].status == "flown"]
    broken = tuple(chain for chain, _ in found if chain.status == "broken")
    facts = case.facts("search", targets)
    entries = tuple(
        ChainEntry(f"chain_{rank:02d}", *holding[place], facts)
        for rank, place in enumerate(best_first([chain for chain, _ in holding]), 1)
    )
    return TourRun(entries, facts, outcome.depths, _nearest(entries, broken, hints[-1:]), broken), lost


def _nearest(
    entries: Sequence[ChainEntry], broken: Sequence[FlybyChain], hint: Sequence[FlybyChain]
) -> FlybyChain | None:
    """Where no chain holds: the best of those that broke, else the one that the search came nearest with."""
    if entries:
        return None
    if broken:
        return broken[best_first(broken)[0]]
    return hint[0] if hint else None


def _fly_schemes(
    case: TourCase, journal: Journal, plan: WorkPlan, progress: Callable[[int, int], None]
) -> tuple[TourRun, dict[str, str]]:
    schemes = schemes_of(case)
    targets, hints = used_targets([scheme.hint for scheme in schemes], case.targets)
    unbound = replace(case.limits, delta_v_m_s=math.inf, end_t_s=math.inf, geocentric_distance_m=math.inf)
    asked = replace(case, targets=targets, limits=unbound)
    windows = [scheme.windows for scheme in schemes]
    found, lost = _flown(asked, hints, journal, plan, progress, windows)
    facts = case.facts("compare", targets)
    entries = tuple(
        ChainEntry(scheme.name, chain, path, facts, scheme.model)
        for scheme, (chain, path) in zip(schemes, found, strict=not lost)
    )
    return TourRun(entries, facts, (), None, days=printed_days(case)), lost


def _searched(case: TourCase, journal: Journal, plan: WorkPlan, say: Callable[[str], None]) -> SearchOutcome:
    """Search, or take over what the journal holds of an earlier search."""
    if SEARCHED in journal.records:
        return outcome_from_arrays(journal.records[SEARCHED])

    def told(depth: DepthReport) -> None:
        say(depth_line(depth))

    def run(work: Callable[[Any], Any], chunks: Sequence[Any]) -> Iterator[tuple[int, Any]]:
        with closing(run_chunks(work, chunks, plan)) as answers:
            yield from answers

    outcome = _search(case, run, told)
    if not outcome.chains and outcome.nearest is None:  # nothing at all within the limits: look beyond
        wider = replace(case.limits, delta_v_m_s=BEYOND * case.limits.delta_v_m_s, asteroids_max=1)
        beyond = _search(replace(case, limits=wider), run, lambda _: None)
        outcome = replace(outcome, nearest=_cheapest(beyond))
    journal.append(SEARCHED, outcome_to_arrays(outcome))
    return outcome_from_arrays(outcome_to_arrays(outcome))


def _search(case: TourCase, run: Run, told: Callable[[DepthReport], None]) -> SearchOutcome:
    asked, options = (case.targets, case.departure, case.limits), case.options
    if isinstance(options, BeamOptions):
        from landing_cli.tour.beam_search import search as search_beam

        return search_beam(*asked, options, case.ephemeris, run=run, progress=told)
    from landing_cli.tour.layered_search import search as search_layers

    return search_layers(*asked, options, case.ephemeris, run=run, progress=told)


def _cheapest(outcome: SearchOutcome) -> FlybyChain | None:
    return min(outcome.chains, key=lambda chain: chain.delta_v_m_s, default=outcome.nearest)


def depth_line(depth: DepthReport) -> str:
    """Say in a line how far the search looked at one length of chain, and the best there.

    Parameters
    ----------
    depth : DepthReport
        What was looked at.
    """
    best = "none" if np.isnan(depth.least_delta_v_m_s) else f"{depth.least_delta_v_m_s:.1f} m/s at least"
    return (
        f"{depth.asteroids} asteroids: {depth.tried} transfers tried, {depth.within_limits} within limits, "
        f"{depth.kept} chains kept; two-body {best}"
    )


def _flown(
    case: TourCase,
    hints: Sequence[FlybyChain],
    journal: Journal,
    plan: WorkPlan,
    progress: Callable[[int, int], None],
    windows: Sequence[Windows] | None = None,
) -> tuple[list[Found], dict[str, str]]:
    """Fly chains, each recorded as it comes; take over those that the journal holds."""
    flown = {int(key): chain_from_arrays(a) for key, a in journal.records.items() if key != SEARCHED}
    if hints:
        progress(len(flown), len(hints))
    left = [[index] for index in range(len(hints)) if index not in flown]
    lost: dict[str, str] = {}
    reduced = replace(case, catalogue=case.targets)  # the full one is not sent
    work = partial(fly_chains, hints, reduced, windows)
    with closing(run_chunks(work, left, plan)) as answers:
        for _, answer in answers:
            if isinstance(answer, LostChunk):
                lost |= {", ".join(hints[index].targets): answer.reason for index in answer.items}
                continue
            for index, arrays in answer:
                journal.append(str(index), arrays)
                flown[index] = chain_from_arrays(arrays)
            progress(len(flown), len(hints))
    return [flown[index] for index in sorted(flown)], lost


def fly_chains(
    hints: Sequence[FlybyChain], case: TourCase, windows: Sequence[Windows] | None, indices: Sequence[int]
) -> list[tuple[int, dict[str, Any]]]:
    """Fly some chains in N-body, and move their dates to where they ask for less.

    Parameters
    ----------
    hints : sequence of FlybyChain
        All of them.
    case : TourCase
        What was asked.
    windows : sequence of sequences of (float, float), s, or None
        Earliest and latest flybys of each chain; None where only the limits bind.
    indices : sequence of int
        Which to fly.

    Returns
    -------
    list of (int, dict of arrays)
        Index and encoded chain.
    """
    return [(index, _fly(hints[index], case, windows[index] if windows else None)) for index in indices]


def _fly(hint: FlybyChain, case: TourCase, windows: Windows | None) -> dict[str, Any]:
    asked = (case.targets, case.departure, case.limits, case.ephemeris, case.albedo)
    chain = improve_dates(refly(hint, *asked), *asked, windows)
    path = None
    if chain.nbody_legs is not None:
        path = sampled_path(case.departure, chain.nbody_legs, case.ephemeris)
    return chain_to_arrays(chain, path)

"""Whether a stored dispersion does what it says.

The samples are drawn again from the seed, the tables summed up again from the verdicts, and a sample of
(sample, facet) pairs is solved again in full, by the solve that `reach run` stores flights of. Each flight
found on the way is flown open loop by an integrator that did not plan it and measured against each limit;
some are flown by scipy's DOP853 too.
"""

from __future__ import annotations

from collections.abc import Callable
from contextlib import closing
from dataclasses import dataclass
from functools import partial

import numpy as np
from numpy.typing import NDArray

from landing_cli.parallel import LostChunk, WorkPlan, run_chunks
from landing_cli.reach.facet_work import solve_items
from landing_cli.reach.flown import flown_trajectory, rows_with_flight
from landing_cli.reach.free_descent import PreparedCase, prepare, survey
from landing_cli.reach.records import FacetSolutions, LandingCase, Verdict
from landing_cli.reach.reflight import Ground, measure_rows
from landing_cli.reach.stored import CaseResult
from landing_cli.reach.verify import LIMITS
from landing_cli.results.verification import Check, Report
from landing_cli.studies.disperse.axes import state_axes
from landing_cli.studies.disperse.dispersed import begins_inside, dispersed_case, prepare_dispersed
from landing_cli.studies.disperse.draws import deviations, standard_normals
from landing_cli.studies.disperse.records import CaseDispersion, FloatArray
from landing_cli.studies.disperse.statistics import facet_rows, verdict_correlations
from landing_cli.studies.disperse.summary import sample_rows

# Samples whose facets are solved again, and how many facets of each; all of both with --all.
SAMPLES, FACETS = 20, 12
# Flights of each of these samples that DOP853 flies too: each takes it 0.06 s.
DOP853_FLIGHTS = 2
# What is computed again may differ by rounding on another processor, a share of the quantity or of 1.
ROUNDING = 1e-9

_TOUCHDOWN = ("touchdown_miss_m", "touchdown_speed_m_s")
_DRAWN = ("position_m", "velocity_m_s", "mass_kg", "thrust_max_n", "gm_m3_s2")


@dataclass(frozen=True)
class DispersionReport(Report):
    """What the second look at a case found.

    Attributes
    ----------
    pairs, flights : int
        Pairs of sample and facet that were solved again, and flights that were flown again.
    """

    pairs: int
    flights: int


@dataclass(frozen=True, eq=False)
class _Again:
    """A sample's facets, solved and flown again."""

    sample: int
    apart: NDArray[np.int64]  # facets whose verdict is another now
    worst: dict[str, float]
    pairs: int
    flights: int


def verify_run(
    results: tuple[CaseDispersion, ...],
    *,
    polyhedron_for_all: bool = False,
    jobs: int = 1,
    progress: Callable[[int, int], None] = lambda done, total: None,
) -> tuple[DispersionReport, ...]:
    """Draw, count and solve some of every case again.

    Parameters
    ----------
    results : tuple of CaseDispersion
        Cases of one run, at least one.
    polyhedron_for_all : bool
        Solve and fly every facet of the chosen samples again, not a few of each.
    jobs : int
        Threads.
    progress : callable
        Told (solved and flown, total) pairs.

    Returns
    -------
    tuple of DispersionReport
        One a case.
    """
    shared = survey(results[0].case)
    plan, done = WorkPlan(jobs, "threads", None), 0
    asked = [_facets_to_ask(result, None if polyhedron_for_all else FACETS) for result in results]
    total = sum(
        len(_spread(r.drawing.samples, SAMPLES)) * len(f) for r, f in zip(results, asked, strict=True)
    )

    def told(more: int) -> None:
        nonlocal done
        done += more
        progress(done, total)

    return tuple(
        _verify_case(result, prepare(result.case, shared), facets, plan, told)
        for result, facets in zip(results, asked, strict=True)
    )


def _verify_case(
    result: CaseDispersion,
    nominal: PreparedCase,
    facets: NDArray[np.int64],
    plan: WorkPlan,
    told: Callable[[int], None],
) -> DispersionReport:
    drawing = result.drawing
    drawn = deviations(drawing.spread, standard_normals(drawing.seed, drawing.samples))
    worst = {"draws_apart": Check(_draws_apart(result, drawn), ROUNDING)}
    worst["tables_apart"] = Check(_tables_apart(result, drawn), ROUNDING)
    work = partial(_solve_again, result, nominal, drawn, facets)
    chosen = [np.array([sample]) for sample in _spread(drawing.samples, SAMPLES)]
    found: list[_Again] = []
    with closing(run_chunks(work, chosen, plan)) as coming:
        for _, answer in coming:
            assert not isinstance(answer, LostChunk)  # threads lose nothing
            found.append(answer)
            told(answer.pairs)
    for name in dict.fromkeys(name for again in found for name in again.worst):
        values = [again.worst[name] for again in found if name in again.worst]
        worst[name] = Check(float(np.max(values)), LIMITS[name])
    pairs, flights = sum(again.pairs for again in found), sum(again.flights for again in found)
    fault = _told_apart(found, pairs)
    return DispersionReport(result.case.name, "solved", True, worst, fault, pairs, flights)


def _told_apart(found: list[_Again], pairs: int) -> str:
    """Which verdicts are others now; empty where none is."""
    apart = [again for again in found if len(again.apart)]
    if not apart:
        return ""
    first = min(apart, key=lambda again: again.sample)
    count = sum(len(again.apart) for again in apart)
    return (
        f"facet {first.apart[0]} of sample {first.sample}: solved again, its verdict is another "
        f"({count} of {pairs} pairs differ)"
    )


def _draws_apart(result: CaseDispersion, drawn: FloatArray) -> float:
    """Largest difference of a stored draw from that of the seed, over the size of the quantity."""
    known = sample_rows(result.case, result.drawing, drawn)
    apart = [
        np.abs(result.samples[name] - known[name]).max() / max(float(np.abs(known[name]).max()), 1e-300)
        for name in _DRAWN
    ]
    return float(max(apart))


def _tables_apart(result: CaseDispersion, drawn: FloatArray) -> float:
    """Largest difference of the facets' table from what verdicts and draws make of it."""
    known, stored = facet_rows(result.verdicts, result.drawing, drawn), result.facets
    columns = ("probability", "probability_low", "probability_high")
    apart = max(float(np.abs(stored[name] - known[name]).max()) for name in columns)
    correlation = np.abs(verdict_correlations(result.verdicts, drawn))
    largest = np.where(np.isnan(correlation), 0.0, correlation).max(axis=0)
    follows = np.nan_to_num(np.abs(stored["driver_correlation"]), nan=0.0)
    named = (stored["driver"] != 0) == (largest > 0.0)
    return max(apart, float(np.abs(follows - largest).max()), 0.0 if named.all() else 1.0)


def _solve_again(
    result: CaseDispersion,
    nominal: PreparedCase,
    drawn: FloatArray,
    facets: NDArray[np.int64],
    samples: NDArray[np.int64],
) -> _Again:
    """Solve some facets of a sample in full, and fly what reaches them."""
    sample = int(samples[0])
    turn = state_axes(result.case, result.drawing.spread.axes)
    case = dispersed_case(result.case, turn, drawn[sample])
    if begins_inside(case):
        return _Again(
            sample, facets[result.verdicts[sample, facets] == Verdict.REACHABLE], {}, len(facets), 0
        )
    solved = solve_items((prepare_dispersed(nominal, case),), len(result.facets), facets)
    stored = result.verdicts[sample, facets].copy()
    asked = np.array([(sample, facet) not in result.lost for facet in facets.tolist()])
    apart = facets[asked & (stored != solved.rows["verdict"])]
    rows = np.flatnonzero((solved.rows["verdict"] == Verdict.REACHABLE) & rows_with_flight(solved))
    shared = nominal.shared
    ground = Ground(shared.surface, shared.normals, shared.mean_edge_m)
    worst = _worst_flights(case, solved, rows, ground) if len(rows) else {}
    return _Again(sample, apart, worst, len(facets), len(rows))


def _facets_to_ask(result: CaseDispersion, most: int | None) -> NDArray[np.int64]:
    """Half of them where the samples disagree, half from all over the surface; ascending."""
    count = len(result.facets)
    if most is None:
        return np.arange(count)
    open_ = np.flatnonzero((result.facets["reachable"] > 0) & (result.facets["unreachable"] > 0))
    ranked = open_[np.argsort(result.facets["probability"][open_], kind="stable")]
    halves = ranked[_spread(len(ranked), most // 2)], _spread(count, most - most // 2)
    return np.union1d(*halves)


def _worst_flights(
    case: LandingCase, solved: FacetSolutions, rows: NDArray[np.int64], ground: Ground
) -> dict[str, float]:
    """The worst of all flights in every respect."""
    craft = case.spacecraft
    measured = measure_rows(case, solved, rows, ground)
    found = {
        "descent_thrust_excess": measured["peak_thrust_ratio_descent"] - 1.0,
        "final_thrust_excess": measured["peak_thrust_ratio_final"] - 1.0,
        "ellipsoid_depth": -measured["ellipsoid_margin"],
        "glide_slope_excess_deg": -measured["glide_slope_margin_deg"],
        "propellant_excess": measured["fuel_kg"] / (craft.propellant_kg or craft.mass_kg) - 1.0,
    }
    if case.handover == "on_ellipsoid":
        found["handover_off_ellipsoid"] = measured["handover_off_ellipsoid"]
    if case.terrain == "require":
        found["depth_in_rock_m"] = -measured["terrain_clearance_min_m"]
    few = rows[_spread(len(rows), DOP853_FLIGHTS)]
    for name, by_dop853 in zip(_TOUCHDOWN, _touchdowns(CaseResult(case, "", solved), few), strict=True):
        found[name] = np.concatenate([measured[name], by_dop853])
    return {name: float(np.max(values)) for name, values in found.items()}


def _touchdowns(result: CaseResult, rows: NDArray[np.int64]) -> tuple[FloatArray, FloatArray]:
    """Miss and speed at touchdown as DOP853 flies, (n,) m and m/s."""
    facets = result.solutions.rows["facet"][rows]
    flights = [flown_trajectory(result, int(facet), integrator="dop853") for facet in facets]
    targets = result.case.asteroid.mesh.corners[facets].mean(axis=1)
    misses = np.array([flown.position_m[-1] for flown in flights]) - targets
    speeds = np.array([flown.velocity_m_s[-1] for flown in flights])
    return np.linalg.norm(misses, axis=1), np.linalg.norm(speeds, axis=1)


def _spread(count: int, wanted: int) -> NDArray[np.int64]:
    """At most so many indices below a count, evenly spaced, first and last included."""
    if count == 0:
        return np.zeros(0, dtype=np.int64)
    return np.unique(np.linspace(0, count - 1, min(count, wanted)).round().astype(np.int64))
